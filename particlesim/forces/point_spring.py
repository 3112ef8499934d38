"""Hooke spring to a fixed point: f = −k (x − a), U = ½ k |x − a|²."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Ge

from particlesim.forces.base import Force
from particlesim.laws.registry import (
    ZERO_MATRIX,
    Matrix,
    Particle,
    Vector,
    force,
    force_dv,
    force_dx,
    law,
    potential,
)
from particlesim.model.units import Metres, NewtonsPerMetre
from particlesim.model.units import Vector as Vector3


class PointSpring(Force):
    """A spring of no rest length from every particle to one fixed point; a harmonic well."""

    type: Literal["point_spring"] = "point_spring"
    stiffness: Annotated[NewtonsPerMetre, Ge(0)]
    """Stiffness k."""
    anchor: Vector3[Metres] = (0.0, 0.0, 0.0)
    """The point a."""

    formula: ClassVar[str] = "f = −k (x − a)"
    by_place: ClassVar[bool] = True
    energy: ClassVar[str] = "U = ½ k |x − a|²"

    def record(self) -> PointSpringRecord:
        return PointSpringRecord(self.stiffness, self.stiffness / 2, *self.anchor)

    def has_zero(self) -> bool:
        return True


class PointSpringRecord(NamedTuple):
    """k and k/2 [N/m], anchor [m]."""

    k: float
    half_k: float
    x: float
    y: float
    z: float


@law(force, PointSpringRecord)
def point_spring_force(f: PointSpringRecord, p: Particle) -> Vector:
    return f.k * (f.x - p.x), f.k * (f.y - p.y), f.k * (f.z - p.z)


@law(potential, PointSpringRecord)
def point_spring_potential(f: PointSpringRecord, p: Particle) -> float:
    dx, dy, dz = p.x - f.x, p.y - f.y, p.z - f.z
    return f.half_k * (dx * dx + dy * dy + dz * dz)


@law(force_dx, PointSpringRecord)
def point_spring_dx(f: PointSpringRecord, p: Particle) -> Matrix:
    return -f.k, 0.0, 0.0, 0.0, -f.k, 0.0, 0.0, 0.0, -f.k


@law(force_dv, PointSpringRecord)
def point_spring_dv(f: PointSpringRecord, p: Particle) -> Matrix:
    return ZERO_MATRIX
