"""A power of the distance: f = −k m₁ m₂ l/(l² + ε²)^((n+1)/2), with l = x₁ − x₂; for ε = 0, −k m₁ m₂ l/|l|ⁿ⁺¹.

The potential is U = −k m₁ m₂/((n − 1) (l² + ε²)^((n−1)/2)), and ½ k m₁ m₂ ln((l² + ε²)/1 m²) for n = 1.
Source: V. I. Arnold, Mathematical Methods of Classical Mechanics, 2nd ed., section 8, on central fields.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge

from particlesim.interactions.base import PairInteraction
from particlesim.laws.pair import Pair, Terms, central_law
from particlesim.model.units import Metres, Number
from particlesim.model.vectors import square


class PairPowerLaw(PairInteraction):
    """Attraction by mass with a power of the distance; a negative strength repels."""

    type: Literal["power_law"] = "power_law"
    strength: Number
    """k: force times distance to the power n over both masses, in N mⁿ/kg²."""
    exponent: Number
    """n: the force falls off as 1/distanceⁿ; 2 is gravity, −1 a spring, 1 attraction in a plane."""
    softening: Annotated[Metres, Ge(0)] = 0.0
    """Length ε that bounds the force of near particles."""

    formula: ClassVar[str] = "f = −k m₁ m₂ l/(l² + ε²)^((n+1)/2), l = x₁ − x₂"
    energy: ClassVar[str] = "U = −k m₁ m₂/((n−1) (l² + ε²)^((n−1)/2)); ½ k m₁ m₂ ln(l² + ε²) for n = 1"

    def record(self) -> PairPowerRecord | PairLogarithmRecord:
        if self.exponent == 1:
            return PairLogarithmRecord(self.strength, square(self.softening))
        return PairPowerRecord(self.strength, square(self.softening), (self.exponent + 1) / 2)

    def product(self) -> tuple[str, float]:
        return "mass", self.strength

    def singular(self) -> bool:
        return self.softening == 0 and self.exponent > 0

    def everywhere(self) -> bool:
        return self.softening > 0


class PairPowerRecord(NamedTuple):
    """k, ε² [m²], half = (n + 1)/2."""

    k: float
    eps2: float
    half: float


class PairLogarithmRecord(NamedTuple):
    """k, ε² [m²]; n = 1."""

    k: float
    eps2: float


@central_law(PairPowerRecord)
def power_law(f: PairPowerRecord, p: Pair, s: float) -> Terms:
    square = s + f.eps2
    k = -f.k * (p.m1 * p.m2) * square ** (-f.half)
    return -k * square / (2 * (1 - f.half)), k, -2 * f.half * k / square


@central_law(PairLogarithmRecord)
def logarithm(f: PairLogarithmRecord, p: Pair, s: float) -> Terms:
    square = s + f.eps2
    k = -f.k * (p.m1 * p.m2) / square
    return 0.5 * f.k * (p.m1 * p.m2) * np.log(square), k, -2 * k / square
