"""What a collider is: a shape that particles bounce off, stick to or die at.

A shape gives `gap` and `normal` of its record: a signed distance and its gradient. The response to contact is the same for
all of them (`response`).
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from particlesim.colliders.response import ColliderRecord, ResponseRecord
from particlesim.laws.registry import ABSORB, PASS, STICK
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Number

LIVELY = 0.9
"""Restitution above which projection out of a collider may add more energy than the bounce takes."""


class Collider(Model):
    """What holds particles back. Laws: `gap` and `normal` of its shape's record."""

    kind: ClassVar[str]
    """What the shape is called."""
    killed: ClassVar[int] = ABSORB
    """The outcome of contact = "kill"."""

    name: Name | None = None
    """Name for messages and overrides."""
    on: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Groups it holds back; all unless given."""
    restitution: Annotated[Number, Ge(0), Le(1)] = 1.0
    """Speed after over speed before the impact, along the normal: 1 elastic, 0 no rebound."""
    tangential_loss: Annotated[Number, Ge(0), Le(1)] = 0.0
    """Part of the velocity along the surface that an impact takes away. No friction: what lies on the surface loses it in
    every step, and slides by a distance that depends on dt."""
    detection: Literal["continuous", "discrete"] = "continuous"
    """Continuous finds the time of impact inside the step; discrete looks at the end of the step and projects."""
    contact: Literal["bounce", "stick", "kill"] = "bounce"
    """What contact does: bounce, stay there for good, or end the particle."""

    @model_validator(mode="after")
    def _bounces(self) -> Collider:
        for name in ("restitution", "tangential_loss"):
            if self.contact != "bounce" and getattr(self, name) != type(self).model_fields[name].default:
                raise invalid(
                    f'{name} acts only with contact = "bounce"',
                    at=(name,),
                    also=[(("contact",), f"{self.contact} here")],
                )
        return self

    def lifts(self) -> bool:
        """Whether particles may gain energy as they are lifted out of it."""
        return self.contact == "bounce" and self.detection == "discrete" and self.restitution > LIVELY

    def shape(self) -> tuple[Any, ...]:
        """The shape as kernels take it."""
        raise NotImplementedError

    def reach(self) -> float:
        """Size of the numbers beside the particle's place [m] that its gap is the difference of."""
        raise NotImplementedError

    def describe(self) -> str:
        """The shape in a few words."""
        raise NotImplementedError

    def record(self) -> ColliderRecord:
        """The collider as kernels take it."""
        return ColliderRecord(self.shape(), self._response())

    def _response(self) -> ResponseRecord:
        if self.contact == "stick":
            return ResponseRecord(1.0, 1.0, 0.0, STICK)  # nothing of the velocity is left
        if self.contact == "kill":
            return ResponseRecord(0.0, 0.0, 1.0, self.killed)  # the record keeps the velocity of the impact
        loss = self.tangential_loss
        return ResponseRecord(1 + self.restitution, loss, 1 - loss, PASS)
