"""Shapes of rigid bodies: volume, moments of inertia, surface, and the convex pieces that touch.

A shape is stated in a frame of its own. A body has its origin in the centre of mass and its axes along those of that frame;
it turns about its principal axes. With J_k = ∫ x_k² dV along these the moment of inertia about axis i is ρ (J_j + J_k).
Source: Goldstein, Classical Mechanics, chapter 5; a capsule is a cylinder of length l with two halves of a ball at its ends:
J_z = π r² l³/12 + 2 (2 π r⁵/15 + (2 π r³/3)(l²/4 + 3 l r/8)), J_x = π r⁴ l/4 + 4 π r⁵/15.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import model_validator

from particlesim.bodies.base import BodyShape
from particlesim.bodies.mass import Solidity
from particlesim.bodies.pieces import BOX, CAPSULE, CONE, CYLINDER, SPHERE, Piece
from particlesim.colliders.triangulation import Triangles, arc, cuboid, revolved
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres

Length = Annotated[Metres, Gt(0)]

NOWHERE = np.zeros(3)
UNTURNED = np.eye(3)


def about_z(profile: list[tuple[float, float]], sides: int, closed: bool = False) -> Triangles:
    """What a line of points (distance from the z axis, height) sweeps out around that axis: polygons of the area of the
    circles that they stand for."""
    turn = 2 * math.pi / sides
    wide = math.sqrt(turn / math.sin(turn))
    surface = revolved([(wide * r, z) for r, z in profile], sides, closed)  # about the y axis
    return Triangles(surface.corners[:, [2, 0, 1]], surface.faces)


def symmetric(volume: float, x: float, y: float, z: float) -> Solidity:
    """A solid about its centre and along its axes, by V and J."""
    return Solidity(volume, NOWHERE, np.diag([x, y, z]))


class BallBody(BodyShape):
    """A ball."""

    type: Literal["sphere"] = "sphere"
    radius: Length
    """Radius of the ball."""

    def solid(self) -> Solidity:
        j = 4 / 15 * math.pi * self.radius**5
        return symmetric(4 / 3 * math.pi * self.radius**3, j, j, j)

    def pieces(self) -> tuple[Piece, ...]:
        return (Piece(SPHERE, (self.radius, 0.0, 0.0), NOWHERE, UNTURNED),)

    def surface(self, sides: int = 48) -> Triangles:
        surface = revolved(arc((0, 0), self.radius, -math.pi / 2, math.pi / 2, sides // 2), sides)
        return Triangles(surface.corners[:, [2, 0, 1]], surface.faces)

    def words(self) -> str:
        return f"a ball of radius {self.radius:g} m"


class BoxBody(BodyShape):
    """A cuboid."""

    type: Literal["box"] = "box"
    size: tuple[Length, Length, Length]
    """Its edges along x, y and z, before it is turned."""

    def solid(self) -> Solidity:
        v = math.prod(self.size)
        a, b, c = self.size
        return symmetric(v, v * a * a / 12, v * b * b / 12, v * c * c / 12)

    def pieces(self) -> tuple[Piece, ...]:
        a, b, c = self.size
        return (Piece(BOX, (a / 2, b / 2, c / 2), NOWHERE, UNTURNED),)

    def surface(self, sides: int = 48) -> Triangles:
        return cuboid(self.size)

    def words(self) -> str:
        a, b, c = self.size
        return f"a box of {a:g} × {b:g} × {c:g} m"


class CapsuleBody(BodyShape):
    """A cylinder with round ends, along z before it is turned."""

    type: Literal["capsule"] = "capsule"
    radius: Length
    """Radius of the cylinder and of its ends."""
    length: Length
    """Distance between the centres of the ends."""

    def solid(self) -> Solidity:
        r, l = self.radius, self.length  # noqa: E741
        across = math.pi * r**4 * l / 4 + 4 * math.pi * r**5 / 15
        # A half ball has its volume 2 π r³/3 at l/2 + 3 r/8 in the mean, and ∫ z² dV = 2 π r⁵/15 about its flat side.
        half = 2 * math.pi * r**3 / 3
        ends = 2 * (2 * math.pi * r**5 / 15 + half * (l * l / 4 + 2 * (l / 2) * 3 * r / 8))
        volume = math.pi * r**2 * (l + 4 / 3 * r)
        return symmetric(volume, across, across, math.pi * r * r * l**3 / 12 + ends)

    def pieces(self) -> tuple[Piece, ...]:
        return (Piece(CAPSULE, (self.radius, self.length / 2, 0.0), NOWHERE, UNTURNED),)

    def surface(self, sides: int = 48) -> Triangles:
        r, h, parts = self.radius, self.length / 2, sides // 4
        profile = arc((0, -h), r, -math.pi / 2, 0, parts) + arc((0, h), r, 0, math.pi / 2, parts)
        surface = revolved(profile, sides)  # about the y axis
        return Triangles(surface.corners[:, [2, 0, 1]], surface.faces)

    def words(self) -> str:
        return f"a capsule of radius {self.radius:g} m and length {self.length:g} m"


class CylinderBody(BodyShape):
    """A cylinder with flat ends, along z before it is turned."""

    type: Literal["cylinder"] = "cylinder"
    radius: Length
    """Radius of the cylinder."""
    length: Length
    """Distance between its ends."""

    def solid(self) -> Solidity:
        r, l = self.radius, self.length  # noqa: E741
        v = math.pi * r * r * l
        return symmetric(v, v * r * r / 4, v * r * r / 4, v * l * l / 12)

    def pieces(self) -> tuple[Piece, ...]:
        return (Piece(CYLINDER, (self.radius, self.length / 2, 0.0), NOWHERE, UNTURNED),)

    def surface(self, sides: int = 48) -> Triangles:
        r, h = self.radius, self.length / 2
        return about_z([(0.0, -h), (r, -h), (r, h), (0.0, h)], sides)

    def words(self) -> str:
        return f"a cylinder of radius {self.radius:g} m and length {self.length:g} m"


class ConeBody(BodyShape):
    """A cone, its tip towards z before it is turned; its centre of mass is a quarter of its length above its base."""

    type: Literal["cone"] = "cone"
    radius: Length
    """Radius of its base."""
    length: Length
    """From its base to its tip."""

    def solid(self) -> Solidity:
        r, l = self.radius, self.length  # noqa: E741
        v = math.pi * r * r * l / 3
        return symmetric(v, v * 3 * r * r / 20, v * 3 * r * r / 20, v * 3 * l * l / 80)

    def pieces(self) -> tuple[Piece, ...]:
        return (Piece(CONE, (self.radius, self.length, 0.0), NOWHERE, UNTURNED),)

    def surface(self, sides: int = 48) -> Triangles:
        return about_z(
            [(0.0, -self.length / 4), (self.radius, -self.length / 4), (0.0, 0.75 * self.length)], sides
        )

    def words(self) -> str:
        return f"a cone of radius {self.radius:g} m and length {self.length:g} m"


class TorusBody(BodyShape):
    """A ring of round wire about the z axis, before it is turned. It touches planes as what it is, all else as
    a chain of capsules."""

    type: Literal["torus"] = "torus"
    radius: Length
    """Radius of the ring, to the middle of its wire."""
    tube: Length
    """Radius of its wire."""
    segments: Annotated[int, Ge(6), Le(96)] = 16
    """Capsules that it touches as; their axes go by the middle of the wire within radius · (1 − cos(π/segments))/2."""

    @model_validator(mode="after")
    def _has_a_hole(self) -> TorusBody:
        if self.tube >= self.radius:
            raise invalid(
                "the wire of a ring is thinner than its radius",
                at=("tube",),
                also=[(("radius",), "the ring")],
                allowed=f"less than {self.radius:g} m",
            )
        return self

    def solid(self) -> Solidity:
        a, r = self.radius, self.tube
        v = 2 * math.pi**2 * a * r * r
        across = v * (a * a / 2 + 3 * r * r / 8)
        return symmetric(v, across, across, v * r * r / 4)

    def pieces(self) -> tuple[Piece, ...]:
        half = math.pi / self.segments
        corner = (
            2 * self.radius / (1 + math.cos(half))
        )  # as far outside of the circle as their middles are inside
        found = []
        for k in range(self.segments):
            c, s = math.cos(2 * half * k), math.sin(2 * half * k)
            at = corner * math.cos(half) * np.array([c, s, 0.0])
            rotation = np.array([[0.0, c, -s], [0.0, s, c], [1.0, 0.0, 0.0]])  # x its axis, z along it
            size = (self.tube, corner * math.sin(half), self.radius)
            found.append(Piece(CAPSULE, size, at, rotation))
        return tuple(found)

    def surface(self, sides: int = 48) -> Triangles:
        ring = arc((self.radius, 0), self.tube, -math.pi, math.pi, sides // 2)[:-1]
        surface = revolved(ring, sides, closed=True)
        return Triangles(surface.corners[:, [2, 0, 1]], surface.faces)

    def words(self) -> str:
        return f"a ring of radius {self.radius:g} m, its wire of radius {self.tube:g} m"
