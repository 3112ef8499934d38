"""Uniform gravity: f = m g, U = −m g·x."""

from __future__ import annotations

from typing import ClassVar, Literal, NamedTuple

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
from particlesim.model.units import MetresPerSecondSquared
from particlesim.model.units import Vector as Vector3

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s²] (CGPM 1901)."""


class Gravity(Force):
    """Uniform gravity: every particle is pulled with its mass times the acceleration g."""

    type: Literal["gravity"] = "gravity"
    acceleration: Vector3[MetresPerSecondSquared] = (0.0, -STANDARD_GRAVITY, 0.0)
    """Acceleration of free fall g."""

    formula: ClassVar[str] = "f = m g"
    uniform: ClassVar[bool] = True
    energy: ClassVar[str] = "U = −m g·x"

    def record(self) -> GravityRecord:
        return GravityRecord(*self.acceleration)


class GravityRecord(NamedTuple):
    """Acceleration [m/s²]."""

    x: float
    y: float
    z: float


@law(force, GravityRecord)
def gravity_force(f: GravityRecord, p: Particle) -> Vector:
    return p.m * f.x, p.m * f.y, p.m * f.z


@law(potential, GravityRecord)
def gravity_potential(f: GravityRecord, p: Particle) -> float:
    return -p.m * (f.x * p.x + f.y * p.y + f.z * p.z)


@law(force_dx, GravityRecord)
def gravity_dx(f: GravityRecord, p: Particle) -> Matrix:
    return ZERO_MATRIX


@law(force_dv, GravityRecord)
def gravity_dv(f: GravityRecord, p: Particle) -> Matrix:
    return ZERO_MATRIX
