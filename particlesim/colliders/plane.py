"""Planes: half-spaces that particles stay out of.

Gap g = n·x − n·p − r for a particle of radius r. Planes whose normal is an axis have records of their own: the two other
components then drop out of the compiled loop. One that moves, which may come to what rests, is searched for along the way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Literal, NamedTuple

from pydantic import field_validator

from particlesim.colliders.base import Collider
from particlesim.colliders.solid import is_concave, is_convex
from particlesim.laws.registry import KILL, Particle, Vector, gap, law, normal, surface
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3, dot, parallel, unit


class Plane(Collider):
    """A plane; the normal points to the side where particles may be."""

    kind: ClassVar[str] = "plane"
    killed: ClassVar[int] = KILL

    point: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """A point on the plane."""
    normal: VectorOf[float] = (0.0, 1.0, 0.0)
    """Direction to the legal side; its length does not matter."""

    @field_validator("normal")
    @classmethod
    def _has_direction(cls, normal: tuple[float, float, float]) -> tuple[float, float, float]:
        unit(normal)
        return normal

    def shape(self) -> AnyPlaneRecord:
        """The plane as kernels take it; planes along an axis have faster records of their own."""
        normal = unit(self.normal)
        along: tuple[Callable[..., AnyPlaneRecord], ...] = (PlaneXRecord, PlaneYRecord, PlaneZRecord)
        for axis, kind in enumerate(along):
            if abs(normal[axis]) == 1:
                side = normal[axis]
                return kind(side, side * self.point[axis])
        return PlaneRecord(*normal, dot(normal, self.point))

    def moved_shape(self) -> HalfSpaceRecord:
        normal = unit(self.normal)
        return HalfSpaceRecord(*normal, dot(normal, self.point))

    def pivot(self) -> tuple[float, float, float]:
        return self.point

    def round_about(self, axis: Vector3) -> bool:
        return parallel(axis, self.normal)

    def reach(self) -> float:
        """Nothing: a plane is as far from the origin as the particles on it."""
        return 0.0

    def describe(self) -> str:
        x, y, z = self.normal
        return f"normal ({x:g}, {y:g}, {z:g})"


class PlaneCollider(Plane):
    """A plane; the normal points to the side where particles may be."""

    type: Literal["plane"] = "plane"


class PlaneRecord(NamedTuple):
    """Any plane: unit normal, n·p."""

    nx: float
    ny: float
    nz: float
    offset: float


class HalfSpaceRecord(NamedTuple):
    """A plane that may be searched for along a way: unit normal, n·p."""

    nx: float
    ny: float
    nz: float
    offset: float


class PlaneXRecord(NamedTuple):
    """A plane whose normal is side · x̂ with side = ±1; offset = side · (the plane's x)."""

    side: float
    offset: float


class PlaneYRecord(NamedTuple):
    """A plane whose normal is side · ŷ."""

    side: float
    offset: float


class PlaneZRecord(NamedTuple):
    """A plane whose normal is side · ẑ."""

    side: float
    offset: float


AnyPlaneRecord = PlaneRecord | PlaneXRecord | PlaneYRecord | PlaneZRecord


@law(gap, PlaneRecord)
@law(gap, HalfSpaceRecord)
def plane_gap(c: PlaneRecord | HalfSpaceRecord, p: Particle) -> float:
    return p.x * c.nx + p.y * c.ny + p.z * c.nz - c.offset - p.r


@law(gap, PlaneXRecord)
def plane_x_gap(c: PlaneXRecord, p: Particle) -> float:
    return c.side * p.x - c.offset - p.r


@law(gap, PlaneYRecord)
def plane_y_gap(c: PlaneYRecord, p: Particle) -> float:
    return c.side * p.y - c.offset - p.r


@law(gap, PlaneZRecord)
def plane_z_gap(c: PlaneZRecord, p: Particle) -> float:
    return c.side * p.z - c.offset - p.r


@law(normal, PlaneRecord)
@law(normal, HalfSpaceRecord)
def plane_normal(c: PlaneRecord | HalfSpaceRecord, p: Particle) -> Vector:
    return c.nx, c.ny, c.nz


@law(normal, PlaneXRecord)
def plane_x_normal(c: PlaneXRecord, p: Particle) -> tuple[float, None, None]:
    return c.side, None, None


@law(normal, PlaneYRecord)
def plane_y_normal(c: PlaneYRecord, p: Particle) -> tuple[None, float, None]:
    return None, c.side, None


@law(normal, PlaneZRecord)
def plane_z_normal(c: PlaneZRecord, p: Particle) -> tuple[None, None, float]:
    return None, None, c.side


@law(surface, PlaneXRecord)
def plane_x_surface(c: PlaneXRecord, p: Particle) -> Vector:
    return c.side * (c.offset + p.r), p.y, p.z


@law(surface, PlaneYRecord)
def plane_y_surface(c: PlaneYRecord, p: Particle) -> Vector:
    return p.x, c.side * (c.offset + p.r), p.z


@law(surface, PlaneZRecord)
def plane_z_surface(c: PlaneZRecord, p: Particle) -> Vector:
    return p.x, p.y, c.side * (c.offset + p.r)


is_convex(HalfSpaceRecord)
for _record in (PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord):
    is_concave(_record)
