"""Attraction by a fixed point: f = −μ m l / (l² + ε²)^((n+1)/2) with l = x − c.

n = 2 is the inverse-square law of gravity with μ = G M; ε is Plummer's softening length. The potential is
U = −μ m / ((n − 1) (l² + ε²)^((n−1)/2)), and ½ μ m ln((l² + ε²)/1 m²) for n = 1.
Source: H. C. Plummer, MNRAS 71, 460 (1911) for the softened inverse-square law.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from pydantic import model_validator

from particlesim.forces.base import Force
from particlesim.laws.matrices import outer, with_diagonal
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
from particlesim.model.constants import GRAVITATIONAL_CONSTANT
from particlesim.model.mistakes import invalid
from particlesim.model.units import CubicMetresPerSecondSquared, Kilograms, Metres, Number
from particlesim.model.units import Vector as Vector3
from particlesim.model.vectors import square


class Attractor(Force):
    """A fixed point that attracts (or, with negative strength, repels) with a power of the distance."""

    type: Literal["attractor"] = "attractor"
    center: Vector3[Metres] = (0.0, 0.0, 0.0)
    """The point c."""
    strength: CubicMetresPerSecondSquared | None = None
    """μ: acceleration times distance to the power n; for n = 2 the gravitational parameter G M in m³/s²."""
    mass: Annotated[Kilograms, Gt(0)] | None = None
    """Mass M of the attracting body, instead of the strength; needs exponent = 2."""
    exponent: Number = 2.0
    """n: the force falls off as 1/distanceⁿ; −1 is a spring."""
    softening: Annotated[Metres, Ge(0)] = 0.0
    """Length ε that bounds the force near the center."""

    formula: ClassVar[str] = "f = −μ m l / (l² + ε²)^((n+1)/2), l = x − c"
    by_place: ClassVar[bool] = True
    energy: ClassVar[str] = "U = −μ m / ((n−1) (l² + ε²)^((n−1)/2)); ½ μ m ln(l² + ε²) for n = 1"

    @model_validator(mode="after")
    def _one_strength(self) -> Attractor:
        if self.strength is None and self.mass is None:
            raise invalid(
                "needs a strength", allowed="strength (G M, in m³/s² for exponent 2), or mass in kg"
            )
        if self.strength is not None and self.mass is not None:
            raise invalid(
                "strength and mass contradict each other", at=("mass",), also=[(("strength",), "given here")]
            )
        if self.mass is not None and self.exponent != 2:
            raise invalid(
                "a mass attracts with exponent 2",
                at=("exponent",),
                also=[(("mass",), "give strength instead of mass")],
            )
        return self

    @property
    def mu(self) -> float:
        """Strength μ [m^(n+1)/s²]."""
        return self.strength if self.strength is not None else GRAVITATIONAL_CONSTANT * (self.mass or 0.0)

    def record(self) -> InverseSquareRecord | PowerLawRecord | LogarithmicRecord:
        if self.exponent == 2:
            return InverseSquareRecord(*self.center, self.mu, square(self.softening))
        if self.exponent == 1:
            return LogarithmicRecord(*self.center, self.mu, square(self.softening))
        return PowerLawRecord(*self.center, self.mu, square(self.softening), (self.exponent + 1) / 2)

    def has_zero(self) -> bool:
        return self.exponent > 1 or (self.exponent < 1 and self.mu > 0)  # infinitely far away; in the center


class InverseSquareRecord(NamedTuple):
    """Center [m], μ [m³/s²], ε² [m²]."""

    x: float
    y: float
    z: float
    mu: float
    eps2: float


class LogarithmicRecord(NamedTuple):
    """Center [m], μ [m²/s²], ε² [m²]; n = 1."""

    x: float
    y: float
    z: float
    mu: float
    eps2: float


class PowerLawRecord(NamedTuple):
    """Center [m], μ, ε² [m²], half = (n + 1)/2."""

    x: float
    y: float
    z: float
    mu: float
    eps2: float
    half: float


def offset(f: Any, p: Particle) -> tuple[float, float, float, float]:
    """l = x − c, and l² + ε²."""
    dx, dy, dz = p.x - f.x, p.y - f.y, p.z - f.z
    return dx, dy, dz, dx * dx + dy * dy + dz * dz + f.eps2


def central_dx(dx: float, dy: float, dz: float, k: float, q: float) -> Matrix:
    """Jacobian of −k l with dk/dl = −q l: −k 1 + q l lᵀ."""
    return with_diagonal(-k, outer((q * dx, q * dy, q * dz), (dx, dy, dz)))


@law(force, InverseSquareRecord)
def inverse_square_force(f: InverseSquareRecord, p: Particle) -> Vector:
    dx, dy, dz, s = offset(f, p)
    k = -f.mu * p.m / (s * np.sqrt(s))
    return k * dx, k * dy, k * dz


@law(potential, InverseSquareRecord)
def inverse_square_potential(f: InverseSquareRecord, p: Particle) -> float:
    _, _, _, s = offset(f, p)
    return -f.mu * p.m / np.sqrt(s)


@law(force_dx, InverseSquareRecord)
def inverse_square_dx(f: InverseSquareRecord, p: Particle) -> Matrix:
    dx, dy, dz, s = offset(f, p)
    k = f.mu * p.m / (s * np.sqrt(s))
    return central_dx(dx, dy, dz, k, 3 * k / s)


@law(force, LogarithmicRecord)
def logarithmic_force(f: LogarithmicRecord, p: Particle) -> Vector:
    dx, dy, dz, s = offset(f, p)
    k = -f.mu * p.m / s
    return k * dx, k * dy, k * dz


@law(potential, LogarithmicRecord)
def logarithmic_potential(f: LogarithmicRecord, p: Particle) -> float:
    _, _, _, s = offset(f, p)
    return 0.5 * f.mu * p.m * np.log(s)


@law(force_dx, LogarithmicRecord)
def logarithmic_dx(f: LogarithmicRecord, p: Particle) -> Matrix:
    dx, dy, dz, s = offset(f, p)
    k = f.mu * p.m / s
    return central_dx(dx, dy, dz, k, 2 * k / s)


@law(force, PowerLawRecord)
def power_law_force(f: PowerLawRecord, p: Particle) -> Vector:
    dx, dy, dz, s = offset(f, p)
    k = -f.mu * p.m * s ** (-f.half)
    return k * dx, k * dy, k * dz


@law(potential, PowerLawRecord)
def power_law_potential(f: PowerLawRecord, p: Particle) -> float:
    _, _, _, s = offset(f, p)
    return f.mu * p.m * s ** (1 - f.half) / (2 * (1 - f.half))


@law(force_dx, PowerLawRecord)
def power_law_dx(f: PowerLawRecord, p: Particle) -> Matrix:
    dx, dy, dz, s = offset(f, p)
    k = f.mu * p.m * s ** (-f.half)
    # A spring (n = −1) and steeper wells are regular at the center, where q l lᵀ vanishes.
    q = 2 * f.half * k / s if s > 0 else 0.0
    return central_dx(dx, dy, dz, k, q)


def _no_dv(f: Any, p: Particle) -> Matrix:
    return ZERO_MATRIX


for _record in (InverseSquareRecord, LogarithmicRecord, PowerLawRecord):
    law(force_dv, _record)(_no_dv)
