"""Shapes of rigid bodies: volume, moments of inertia and surface, about the centre of mass and along the principal axes.

With J_k = ∫ x_k² dV the moment of inertia about axis i is ρ (J_j + J_k). Source: Goldstein, Classical Mechanics, chapter 5;
a capsule is a cylinder of length l with two halves of a ball at its ends:
J_z = π r² l³/12 + 2 (2 π r⁵/15 + (2 π r³/3)(l²/4 + 3 l r/8)), J_x = π r⁴ l/4 + 4 π r⁵/15.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt

from particlesim.colliders.triangulation import Triangles, arc, cuboid, revolved
from particlesim.model.base import Model
from particlesim.model.units import Metres
from particlesim.model.variants import Tagged
from particlesim.model.vectors import Vector3, norm

Length = Annotated[Metres, Gt(0)]

SPHERE, BOX, CAPSULE = 0, 1, 2
"""Kinds of shapes, for kernels."""


class BodyShape(Model):
    """A shape of a rigid body."""

    kind: ClassVar[int]
    """Its number for kernels."""

    type: str

    def volume(self) -> float:
        """Volume [m³]."""
        raise NotImplementedError

    def spread(self) -> Vector3:
        """J = ∫ x² dV, ∫ y² dV, ∫ z² dV [m⁵]."""
        raise NotImplementedError

    def sizes(self) -> Vector3:
        """The numbers of its kind that kernels take [m] (`engine.rigid.bodies`)."""
        raise NotImplementedError

    def reach(self) -> float:
        """Radius of a ball about it [m]."""
        raise NotImplementedError

    def triangles(self) -> Triangles:
        """Its surface, for pictures."""
        raise NotImplementedError

    def words(self) -> str:
        """A body of this shape in a few words."""
        raise NotImplementedError


class BallBody(BodyShape):
    """A ball."""

    kind: ClassVar[int] = SPHERE

    type: Literal["sphere"] = "sphere"
    radius: Length
    """Radius of the ball."""

    def volume(self) -> float:
        return 4 / 3 * math.pi * self.radius**3

    def spread(self) -> Vector3:
        j = 4 / 15 * math.pi * self.radius**5
        return j, j, j

    def sizes(self) -> Vector3:
        return self.radius, 0.0, 0.0

    def reach(self) -> float:
        return self.radius

    def triangles(self) -> Triangles:
        return revolved(arc((0, 0), self.radius, -math.pi / 2, math.pi / 2, 24), 48)

    def words(self) -> str:
        return f"a ball of radius {self.radius:g} m"


class BoxBody(BodyShape):
    """A cuboid."""

    kind: ClassVar[int] = BOX

    type: Literal["box"] = "box"
    size: tuple[Length, Length, Length]
    """Its edges along x, y and z, before it is turned."""

    def volume(self) -> float:
        return math.prod(self.size)

    def spread(self) -> Vector3:
        v = self.volume()
        a, b, c = self.size
        return v * a * a / 12, v * b * b / 12, v * c * c / 12

    def sizes(self) -> Vector3:
        a, b, c = self.size
        return a / 2, b / 2, c / 2

    def reach(self) -> float:
        return norm(self.size) / 2

    def triangles(self) -> Triangles:
        return cuboid(self.size)

    def words(self) -> str:
        a, b, c = self.size
        return f"a box of {a:g} × {b:g} × {c:g} m"


class CapsuleBody(BodyShape):
    """A cylinder with round ends, along z before it is turned."""

    kind: ClassVar[int] = CAPSULE

    type: Literal["capsule"] = "capsule"
    radius: Length
    """Radius of the cylinder and of its ends."""
    length: Length
    """Distance between the centres of the ends."""

    def volume(self) -> float:
        return math.pi * self.radius**2 * (self.length + 4 / 3 * self.radius)

    def spread(self) -> Vector3:
        r, l = self.radius, self.length  # noqa: E741
        across = math.pi * r**4 * l / 4 + 4 * math.pi * r**5 / 15
        # A half ball has its volume 2 π r³/3 at l/2 + 3 r/8 in the mean, and ∫ z² dV = 2 π r⁵/15 about its flat side.
        half = 2 * math.pi * r**3 / 3
        ends = 2 * (2 * math.pi * r**5 / 15 + half * (l * l / 4 + 2 * (l / 2) * 3 * r / 8))
        return across, across, math.pi * r * r * l**3 / 12 + ends

    def sizes(self) -> Vector3:
        return self.radius, self.length / 2, 0.0

    def reach(self) -> float:
        return self.radius + self.length / 2

    def triangles(self) -> Triangles:
        r, h = self.radius, self.length / 2
        profile = arc((0, -h), r, -math.pi / 2, 0, 12) + arc((0, h), r, 0, math.pi / 2, 12)
        surface = revolved(profile, 48)  # about the y axis
        return Triangles(surface.corners[:, [2, 0, 1]], surface.faces)

    def words(self) -> str:
        return f"a capsule of radius {self.radius:g} m and length {self.length:g} m"


AnyBodyShape = Annotated[BallBody | BoxBody | CapsuleBody, Tagged("type")]
BODY_SHAPES: tuple[type[BodyShape], ...] = (BallBody, BoxBody, CapsuleBody)
