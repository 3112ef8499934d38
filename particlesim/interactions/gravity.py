"""Gravity between particles: f = −G m₁ m₂ l/(l² + ε²)^(3/2), U = −G m₁ m₂/(l² + ε²)^(1/2), with l = x₁ − x₂.

ε is Plummer's softening length: bodies attract each other as Plummer spheres of that size attract points. Without softening
they are points.
Source: H. C. Plummer, MNRAS 71, 460 (1911); S. J. Aarseth, MNRAS 126, 223 (1963) for its use between bodies.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Ge, Gt

from particlesim.interactions.far import FarInteraction
from particlesim.laws.pair import Pair, Terms, central_law, over_cube
from particlesim.model.constants import GRAVITATIONAL_CONSTANT
from particlesim.model.units import GravitationalConstant, Metres


class MutualGravity(FarInteraction):
    """Newton's law of gravitation: every two particles attract each other by their masses."""

    type: Literal["gravity"] = "gravity"
    constant: Annotated[GravitationalConstant, Gt(0)] = GRAVITATIONAL_CONSTANT
    """The constant of gravitation G; another for units of your own, such as 1."""
    softening: Annotated[Metres, Ge(0)] = 0.0
    """Plummer's softening length ε, which bounds the force of near bodies."""

    by: ClassVar[str] = "mass"
    formula: ClassVar[str] = "f = −G m₁ m₂ l/(l² + ε²)^(3/2), l = x₁ − x₂"
    energy: ClassVar[str] = "U = −G m₁ m₂/(l² + ε²)^(1/2)"

    def coupling(self) -> float:
        return self.constant

    def record(self) -> MutualGravityRecord:
        return MutualGravityRecord(self.constant, self.softening**2)

    def singular(self) -> bool:
        return self.softening == 0

    def everywhere(self) -> bool:
        return self.softening > 0


class MutualGravityRecord(NamedTuple):
    """G [m³/(kg s²)], ε² [m²]."""

    g: float
    eps2: float


@central_law(MutualGravityRecord)
def mutual_gravity(f: MutualGravityRecord, p: Pair, s: float) -> Terms:
    square = s + f.eps2
    k = over_cube(-f.g * (p.m1 * p.m2), square, p)
    return k * square, k, -3 * k / square
