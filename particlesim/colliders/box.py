"""Boxes: cuboids of any size, place and orientation.

With b half the size and q = |y| − b in the frame of the box, the distance is |max(q, 0)| outside, and max(q) inside, where
it is negative. The nearest point of the surface is on the face that is nearest.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt

from particlesim.colliders.pose import UNTURNED, Orientation, Rows, placed
from particlesim.colliders.solid import GRAIN, Solid, SolidCollider, is_convex
from particlesim.colliders.triangulation import Triangles, cuboid
from particlesim.laws.registry import Particle, Vector, gap, law, normal
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import norm

Size = tuple[Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)]]


class Box(Solid):
    """A cuboid."""

    kind: ClassVar[str] = "box"
    exact: ClassVar[bool] = True

    type: Literal["box"] = "box"
    center: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Centre of the box."""
    size: Size
    """Its edges along x, y and z, before it is turned."""
    orientation: Orientation | None = None
    """How it is turned about its centre."""

    def rotation(self) -> Rows:
        """From its own axes to those of the world."""
        return UNTURNED if self.orientation is None else self.orientation.rotation()

    def geometry(self) -> Any:
        a, b, c = self.size
        return placed(BoxRecord(a / 2, b / 2, c / 2), self.center, self.rotation())

    def grain(self) -> float:
        return GRAIN * min(self.size)

    def waist(self) -> float:
        return min(self.size)

    def farthest(self) -> float:
        return max(map(abs, self.center)) + norm(self.size) / 2

    def words(self) -> str:
        x, y, z = self.center
        a, b, c = self.size
        return f"{a:g} × {b:g} × {c:g} m at ({x:g}, {y:g}, {z:g})"

    def triangles(self) -> Triangles:
        return cuboid(self.size).placed(self.center, self.rotation())


class BoxCollider(Box, SolidCollider):
    """A cuboid."""


class BoxRecord(NamedTuple):
    """Half the edges of a box about the origin [m]."""

    x: float
    y: float
    z: float


@law(gap, BoxRecord)
def box_gap(c: BoxRecord, p: Particle) -> float:
    x, y, z = abs(p.x) - c.x, abs(p.y) - c.y, abs(p.z) - c.z
    zero = type(p.x)(0)
    a, b, d = max(x, zero), max(y, zero), max(z, zero)
    return np.sqrt(a * a + b * b + d * d) + min(max(x, y, z), zero) - p.r


@law(normal, BoxRecord)
def box_normal(c: BoxRecord, p: Particle) -> Vector:
    x, y, z = abs(p.x) - c.x, abs(p.y) - c.y, abs(p.z) - c.z
    zero, one = type(p.x)(0), type(p.x)(1)
    a, b, d = max(x, zero), max(y, zero), max(z, zero)
    length = np.sqrt(a * a + b * b + d * d)
    outside = length > 0
    k = one / length if outside else zero
    most = max(x, y, z)
    up = y >= most
    right = (x >= most) & (not up)
    a = k * a if outside else (one if right else zero)
    b = k * b if outside else (one if up else zero)
    d = k * d if outside else (zero if up | right else one)
    return (a if p.x >= 0 else -a), (b if p.y >= 0 else -b), (d if p.z >= 0 else -d)


is_convex(BoxRecord)
