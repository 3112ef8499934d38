"""Discs: thin round sheets that particles touch from both sides, with round edges like those of `rectangle`."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt
from pydantic import field_validator

from particlesim.colliders.pose import along, placed
from particlesim.colliders.rectangle import Sheet, SheetCollider
from particlesim.colliders.solid import is_convex
from particlesim.colliders.triangulation import Triangles, arc, revolved
from particlesim.laws.registry import Particle, Vector, gap, law, normal
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3, parallel, unit


class Disc(Sheet):
    """A thin disc, flat on the ground unless it has another normal."""

    kind: ClassVar[str] = "disc"

    type: Literal["disc"] = "disc"
    center: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Centre of the disc."""
    normal: VectorOf[float] = (0.0, 1.0, 0.0)
    """Direction across the disc; its length does not matter."""
    radius: Annotated[Metres, Gt(0)]
    """Radius of the disc."""

    @field_validator("normal")
    @classmethod
    def _has_direction(cls, normal: Vector3) -> Vector3:
        unit(normal)
        return normal

    def extent(self) -> float:
        return 2 * self.radius

    def geometry(self) -> Any:
        return placed(DiscRecord(self.radius, self.half()), self.center, along(self.normal))

    def round_about(self, axis: Vector3) -> bool:
        return parallel(axis, self.normal)

    def farthest(self) -> float:
        return max(map(abs, self.center)) + self.radius + self.half()

    def words(self) -> str:
        x, y, z = self.center
        return f"radius {self.radius:g} m at ({x:g}, {y:g}, {z:g})"

    def triangles(self) -> Triangles:
        half = self.half()
        rim = arc((self.radius, 0.0), half, -np.pi / 2, np.pi / 2, 8)
        return revolved([(0.0, -half), *rim, (0.0, half)]).placed(self.center, along(self.normal))


class DiscCollider(Disc, SheetCollider):
    """A thin disc, flat on the ground unless it has another normal."""


class DiscRecord(NamedTuple):
    """Radius and half the thickness of a disc about the y axis [m]."""

    radius: float
    half: float


@law(gap, DiscRecord)
def disc_gap(c: DiscRecord, p: Particle) -> float:
    out = max(np.sqrt(p.x * p.x + p.z * p.z) - c.radius, type(p.x)(0))
    return np.sqrt(out * out + p.y * p.y) - c.half - p.r


@law(normal, DiscRecord)
def disc_normal(c: DiscRecord, p: Particle) -> Vector:
    zero, one = type(p.x)(0), type(p.x)(1)
    rho = np.sqrt(p.x * p.x + p.z * p.z)
    out = max(rho - c.radius, zero)
    length = np.sqrt(out * out + p.y * p.y)
    k = one / length if length > 0 else zero
    side = k * out / rho if rho > 0 else zero
    return side * p.x, (k * p.y if length > 0 else one), side * p.z


is_convex(DiscRecord)
