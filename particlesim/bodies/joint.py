"""`[[joints]]`: ball joints and hinges between rigid bodies, or between bodies and the world.

A joint holds two bodies together at a place, about which they turn: freely in a ball joint, about one axis in a hinge, or as
far as limits let them. It does no work but that of its motor. What holds bodies at a distance are rods (`[[rods]]`), what
pulls them are springs (`[[springs]]`); both go from a point of one body to a point of another, or of the world.
"""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Gt, Lt
from pydantic import Field, StrictBool, model_validator

from particlesim.bonds.pairs import SINGLE, WORLD, Pairs, check_pairs, joined_groups
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Degrees, Metres, NewtonMetres, Number, RadiansPerSecond, Vector
from particlesim.model.variants import Tagged
from particlesim.model.vectors import Vector3, norm


class Joint(Model):
    """A joint of two bodies at one point."""

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
    touch: StrictBool = False
    """Whether the two bodies of a pair also touch each other. Unless they do, they may overlap at the joint."""

    @model_validator(mode="after")
    def _joins(self) -> Joint:
        first, second = self.groups()
        if first == second == WORLD:
            raise invalid(
                "the world is joined to itself, and does not move",
                at=("between",),
                allowed='a group of bodies and "world", or two groups of bodies',
            )
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
        check_pairs(self.pairs or (), inside=first == second, of="body")
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

    @property
    def driven(self) -> bool:
        """Whether a motor turns it."""
        return False

    def groups(self) -> tuple[Name, Name]:
        """Groups of the first and second bodies; the second may be the world."""
        return joined_groups(self.on, self.between)

    def describe(self) -> str:
        """The joints in a few words."""
        number = len(self.pairs or SINGLE)
        return f"{self.type} joint" if number == 1 else f"{number} {self.type} joints"


class BallJoint(Joint):
    """Bodies turn freely about a place that they share, or within a cone."""

    type: Literal["ball"] = "ball"
    axis: Vector[Number] | None = None
    """Direction at the start that `cone` is about; its length does not count."""
    cone: Annotated[Degrees, Gt(0), Lt(180)] | None = None
    """How far the first body may lean: the greatest angle between the axis as it carries it and as the second one does, in
    degrees. They may turn about it freely."""

    @model_validator(mode="after")
    def _leans(self) -> BallJoint:
        if (self.axis is None) != (self.cone is None):
            given, missing = ("cone", "axis") if self.axis is None else ("axis", "cone")
            allowed = "axis = [0, -1, 0]" if missing == "axis" else "cone = 40 (degrees)"
            raise invalid(f"{given} needs {missing}", at=(given,), allowed=allowed)
        if self.axis is not None:
            require_direction(self.axis, "cone")
        return self


class Motor(Model):
    """A motor that turns a hinge."""

    speed: RadiansPerSecond
    """Speed that it is to reach: of the first body against the second about the axis, right-handed."""
    torque: Annotated[NewtonMetres, Gt(0)]
    """Largest torque with which it drives the hinge, or brakes it when it turns faster."""


class HingeJoint(Joint):
    """Bodies turn about an axis that they share."""

    type: Literal["hinge"] = "hinge"
    axis: Vector[Number]
    """Direction of the axis at the start; its length does not count."""
    limits: tuple[Degrees, Degrees] | None = None
    """Least and greatest angle of the first body against the second about the axis, right-handed, in degrees; it is 0 at the
    start. Unlimited unless given."""
    motor: Motor | None = None
    """Turns the first body against the second, with a bounded torque."""

    @model_validator(mode="after")
    def _axis(self) -> HingeJoint:
        require_direction(self.axis, "hinge")
        if self.limits is not None and self.limits[0] > self.limits[1]:
            raise invalid(
                "the least angle comes first, and is above the greatest",
                at=("limits",),
                allowed="limits = [-30, 90], between -180 and 180",
            )
        if self.limits is not None and not -180 < self.limits[0] <= 0 <= self.limits[1] < 180:
            raise invalid(
                "the angle is 0 at the start and must be within its limits",
                at=("limits",),
                allowed="limits = [-30, 90], between -180 and 180",
            )
        return self

    @property
    def driven(self) -> bool:
        return self.motor is not None


def require_direction(axis: Vector3, what: str) -> None:
    """Raises a mistake for an axis of no length."""
    if not norm(axis) > 0:
        raise invalid(f"the axis of a {what} needs a direction", at=("axis",), allowed="axis = [0, 0, 1]")


AnyJoint = Annotated[BallJoint | HingeJoint, Tagged("type")]
JOINTS: tuple[type[Joint], ...] = (BallJoint, HingeJoint)
