"""Rectangles: thin sheets that particles touch from both sides.

A sheet of thickness d has rounded edges: it is all places within d/2 of a flat rectangle. So it is a body like any other,
with a front and a back, that nothing crosses at any speed.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt

from particlesim.colliders.base import Collider
from particlesim.colliders.pose import UNTURNED, Orientation, Rows, placed
from particlesim.colliders.solid import Solid, is_convex, pivot_of
from particlesim.colliders.triangulation import Triangles, cuboid
from particlesim.laws.registry import Particle, Vector, gap, law, normal
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3

THIN = 1e-4
"""Thickness of a sheet, in parts of its size, unless it is given."""


class Sheet(Solid):
    """A thin shape with two sides."""

    thickness: Annotated[Metres, Gt(0)] | None = None
    """Thickness; a ten-thousandth of its size unless given. Its edges are round."""

    def extent(self) -> float:
        """Its size [m]."""
        raise NotImplementedError

    def half(self) -> float:
        """Half its thickness [m]."""
        return 0.5 * (THIN * self.extent() if self.thickness is None else self.thickness)

    def waist(self) -> float:
        return 2 * self.half()

    def grain(self) -> float:
        return 0.1 * self.half()


class SheetCollider(Collider):
    """A thin shape that particles touch from both sides."""

    def shape(self) -> Any:
        sheet: Any = self
        return sheet.geometry()

    def pivot(self) -> Vector3:
        return pivot_of(self)

    def reach(self) -> float:
        sheet: Any = self
        return float(sheet.farthest())

    def describe(self) -> str:
        sheet: Any = self
        return str(sheet.words())


class Rectangle(Sheet):
    """A thin rectangle, flat on the ground unless it is turned."""

    kind: ClassVar[str] = "rectangle"

    type: Literal["rectangle"] = "rectangle"
    center: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Centre of the rectangle."""
    size: tuple[Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)]]
    """Its sides along x and z, before it is turned; its normal is then y."""
    orientation: Orientation | None = None
    """How it is turned about its centre."""

    def extent(self) -> float:
        return max(self.size)

    def rotation(self) -> Rows:
        """From its own axes to those of the world."""
        return UNTURNED if self.orientation is None else self.orientation.rotation()

    def geometry(self) -> Any:
        a, b = self.size
        return placed(RectangleRecord(a / 2, b / 2, self.half()), self.center, self.rotation())

    def farthest(self) -> float:
        return max(map(abs, self.center)) + sum(self.size) / 2 + self.half()

    def words(self) -> str:
        x, y, z = self.center
        a, b = self.size
        return f"{a:g} × {b:g} m at ({x:g}, {y:g}, {z:g})"

    def triangles(self) -> Triangles:
        a, b = self.size
        return cuboid((a, 2 * self.half(), b)).placed(self.center, self.rotation())


class RectangleCollider(Rectangle, SheetCollider):
    """A thin rectangle, flat on the ground unless it is turned."""


class RectangleRecord(NamedTuple):
    """Half the sides along x and z of a rectangle about the origin, and half its thickness [m]."""

    x: float
    z: float
    half: float


@law(gap, RectangleRecord)
def rectangle_gap(c: RectangleRecord, p: Particle) -> float:
    zero = type(p.x)(0)
    a, d = max(abs(p.x) - c.x, zero), max(abs(p.z) - c.z, zero)
    return np.sqrt(a * a + p.y * p.y + d * d) - c.half - p.r


@law(normal, RectangleRecord)
def rectangle_normal(c: RectangleRecord, p: Particle) -> Vector:
    zero, one = type(p.x)(0), type(p.x)(1)
    a, d = max(abs(p.x) - c.x, zero), max(abs(p.z) - c.z, zero)
    length = np.sqrt(a * a + p.y * p.y + d * d)
    k = one / length if length > 0 else zero
    x, z = k * a, k * d
    return (x if p.x >= 0 else -x), (k * p.y if length > 0 else one), (z if p.z >= 0 else -z)


is_convex(RectangleRecord)
