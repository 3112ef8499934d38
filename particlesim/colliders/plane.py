"""Planes: half-spaces that particles bounce off, stick to or die at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field, field_validator, model_validator

from particlesim.colliders.plane_laws import PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord
from particlesim.laws.registry import KILL, PASS, STICK
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Number, Vector
from particlesim.model.vectors import dot, unit

LIVELY = 0.9
"""Restitution above which projection out of a plane may add more energy than the bounce takes."""

AnyPlaneRecord = PlaneRecord | PlaneXRecord | PlaneYRecord | PlaneZRecord


class Plane(Model):
    """A plane; the normal points to the side where particles may be."""

    name: Name | None = None
    """Name for messages and overrides."""
    on: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Groups it holds back; all unless given."""
    point: Vector[Metres] = (0.0, 0.0, 0.0)
    """A point on the plane."""
    normal: Vector[float] = (0.0, 1.0, 0.0)
    """Direction to the legal side; its length does not matter."""
    restitution: Annotated[Number, Ge(0), Le(1)] = 1.0
    """Speed after over speed before the impact, along the normal: 1 elastic, 0 no rebound."""
    tangential_loss: Annotated[Number, Ge(0), Le(1)] = 0.0
    """Part of the velocity along the plane that an impact takes away. No friction: what lies on the plane loses it in every
    step, and slides by a distance that depends on dt."""
    detection: Literal["continuous", "discrete"] = "continuous"
    """Continuous finds the time of impact inside the step; discrete looks at the end of the step and projects."""
    contact: Literal["bounce", "stick", "kill"] = "bounce"
    """What contact does: bounce, stay there for good, or end the particle."""

    @field_validator("normal")
    @classmethod
    def _has_direction(cls, normal: tuple[float, float, float]) -> tuple[float, float, float]:
        unit(normal)
        return normal

    @model_validator(mode="after")
    def _bounces(self) -> Plane:
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

    def record(self) -> AnyPlaneRecord:
        """The plane as kernels take it; planes along an axis have faster records of their own."""
        normal = unit(self.normal)
        outcome = {"bounce": PASS, "stick": STICK, "kill": KILL}[self.contact]
        bounce, loss = 1 + self.restitution, self.tangential_loss
        if self.contact == "stick":
            bounce, loss = 1.0, 1.0  # nothing of the velocity is left
        elif self.contact == "kill":
            bounce, loss = 0.0, 0.0  # the velocity of the impact stays in the record
        along: tuple[Callable[..., AnyPlaneRecord], ...] = (PlaneXRecord, PlaneYRecord, PlaneZRecord)
        for axis, kind in enumerate(along):
            if abs(normal[axis]) == 1:
                side = normal[axis]
                return kind(side, side * self.point[axis], bounce, 1 - loss, outcome)
        return PlaneRecord(*normal, dot(normal, self.point), bounce, loss, outcome)
