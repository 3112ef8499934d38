"""`[[joints]]`: ball joints and hinges between rigid bodies, or between bodies and the world.

A joint holds two bodies together at a place, about which they turn: freely in a ball joint, about one axis in a hinge. It
does no work. What holds bodies at a distance are rods (`[[rods]]`), what pulls them are springs (`[[springs]]`); both go
from a point of one body to a point of another, or of the world.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from particlesim.bonds.pairs import SINGLE, WORLD, Pairs, check_pairs, joined_groups
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Number, Vector
from particlesim.model.variants import Tagged
from particlesim.model.vectors import Vector3, norm


class Joint(Model):
    """What holds two bodies together at a place."""

    type: str
    name: Name = "joints"
    """Name for messages."""
    on: Name | None = None
    """The group whose bodies are joined, by `pairs`."""
    between: tuple[Name, Name] | None = None
    """Two groups instead of one, or a group and "world", which does not move."""
    pairs: Pairs | None = Field(default=None, min_length=1)
    """Indices of the joined bodies, a pair for every joint, the first index in the first group; that of the world is 0. The
    first bodies of two groups unless given."""
    anchor: Vector[Metres] | tuple[Vector[Metres], ...] | None = None
    """Where the bodies are joined at the start: one place for all pairs or one for each. Unless given, halfway between the
    centres of two bodies, and with the world the centre of the body."""
    touch: bool = False
    """Whether the two bodies of a pair also touch each other. Unless they do, they may overlap at the joint."""

    @model_validator(mode="after")
    def _joins(self) -> Joint:
        first, second = self.groups()
        if first == WORLD:
            raise invalid(
                '"world" must be the second of the two',
                at=("between", 0),
                allowed=f'between = ["{second}", "world"]',
            )
        if self.pairs is None and first == second:
            raise invalid(
                "which bodies are joined?", allowed="pairs = [[0, 1]], or two groups with between = [...]"
            )
        check_pairs(self.pairs or (), inside=first == second)
        for k, pair in enumerate(self.pairs or ()):
            if second == WORLD and pair[1] != 0:
                raise invalid("the index of the world is 0", at=("pairs", k, 1), allowed="0")
        if self.several and len(self.anchors) != len(self.pairs or SINGLE):
            raise invalid(
                f"{len(self.anchors)} places for {len(self.pairs or SINGLE)} joints",
                at=("anchor",),
                allowed="one place, or one for each of the pairs",
            )
        return self

    @property
    def several(self) -> bool:
        """Whether every joint has an anchor of its own."""
        return self.anchor is not None and isinstance(self.anchor[0], tuple)

    @property
    def anchors(self) -> tuple[Vector3, ...]:
        """The anchors that are given."""
        if self.anchor is None:
            return ()
        return self.anchor if self.several else (self.anchor,)  # type: ignore[return-value]

    def groups(self) -> tuple[Name, Name]:
        """Groups of the first and second bodies; the second may be the world."""
        return joined_groups(self.on, self.between)

    def describe(self) -> str:
        """The joints in a few words."""
        number = len(self.pairs or SINGLE)
        return f"{self.type} joint" if number == 1 else f"{number} {self.type} joints"


class BallJoint(Joint):
    """Bodies turn freely about a place that they share."""

    type: Literal["ball"] = "ball"


class HingeJoint(Joint):
    """Bodies turn about an axis that they share."""

    type: Literal["hinge"] = "hinge"
    axis: Vector[Number]
    """Direction of the axis at the start; its length does not count."""

    @model_validator(mode="after")
    def _axis(self) -> HingeJoint:
        if not norm(self.axis) > 0:
            raise invalid("the axis of a hinge needs a direction", at=("axis",), allowed="axis = [0, 0, 1]")
        return self


AnyJoint = Annotated[BallJoint | HingeJoint, Tagged("type")]
JOINTS: tuple[type[Joint], ...] = (BallJoint, HingeJoint)
