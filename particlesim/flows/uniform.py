"""Uniform wind: w = const."""

from __future__ import annotations

from typing import Literal, NamedTuple

from particlesim.flows.base import Flow
from particlesim.laws.registry import ZERO_MATRIX, Matrix, Particle, Vector, law, velocity, velocity_dx
from particlesim.model.units import MetresPerSecond
from particlesim.model.units import Vector as Vector3


class Uniform(Flow):
    """Wind of the same velocity everywhere, w = const."""

    type: Literal["uniform"] = "uniform"
    velocity: Vector3[MetresPerSecond]
    """Velocity of the fluid."""

    def record(self) -> UniformRecord:
        return UniformRecord(*self.velocity)


class UniformRecord(NamedTuple):
    """Velocity [m/s]."""

    x: float
    y: float
    z: float


@law(velocity, UniformRecord)
def uniform_velocity(f: UniformRecord, p: Particle) -> Vector:
    return f.x, f.y, f.z


@law(velocity_dx, UniformRecord)
def uniform_gradient(f: UniformRecord, p: Particle) -> Matrix:
    return ZERO_MATRIX
