"""Coulomb's law between charged particles: f = k q₁ q₂ l/(l² + ε²)^(3/2), U = k q₁ q₂/(l² + ε²)^(1/2), l = x₁ − x₂.

k = 1/(4π ε₀ εᵣ), with the relative permittivity εᵣ of what is between them. ε smears the charges out, as the masses of a
Plummer sphere are.
Source: C. A. de Coulomb (1785); J. D. Jackson, Classical Electrodynamics, 3rd ed., section 1.1.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Ge, Gt
from pydantic import model_validator

from particlesim.interactions.far import FarInteraction
from particlesim.laws.pair import Pair, Terms, central_law, over_cube
from particlesim.model.constants import COULOMB_CONSTANT
from particlesim.model.mistakes import invalid
from particlesim.model.units import CoulombConstant, Metres, Number
from particlesim.model.vectors import square


class Coulomb(FarInteraction):
    """Coulomb's law: charges of one sign repel each other, and those of different signs attract."""

    type: Literal["coulomb"] = "coulomb"
    constant: Annotated[CoulombConstant, Gt(0)] | None = None
    """The constant k; 1/(4π ε₀ εᵣ) unless given."""
    relative_permittivity: Annotated[Number, Gt(0)] = 1.0
    """εᵣ of the medium between the particles: 1 for vacuum, about 80 for water."""
    softening: Annotated[Metres, Ge(0)] = 0.0
    """Length ε that bounds the force of near charges."""

    by: ClassVar[str] = "charge"
    formula: ClassVar[str] = "f = k q₁ q₂ l/(l² + ε²)^(3/2), l = x₁ − x₂"
    energy: ClassVar[str] = "U = k q₁ q₂/(l² + ε²)^(1/2)"

    @model_validator(mode="after")
    def _one_constant(self) -> Coulomb:
        if self.constant is not None and "relative_permittivity" in self.model_fields_set:
            raise invalid(
                "the constant is given already",
                at=("relative_permittivity",),
                also=[(("constant",), "here")],
            )
        return self

    def coupling(self) -> float:
        return -self.record().k

    def record(self) -> CoulombRecord:
        k = COULOMB_CONSTANT / self.relative_permittivity if self.constant is None else self.constant
        return CoulombRecord(k, square(self.softening))

    def needs(self) -> frozenset[str]:
        return frozenset({"charge"})

    def singular(self) -> bool:
        return self.softening == 0

    def everywhere(self) -> bool:
        return self.softening > 0


class CoulombRecord(NamedTuple):
    """k [N m²/C²], ε² [m²]."""

    k: float
    eps2: float


@central_law(CoulombRecord)
def coulomb(f: CoulombRecord, p: Pair, s: float) -> Terms:
    square = s + f.eps2
    k = over_cube(f.k * (p.q1 * p.q2), square, p)
    return k * square, k, -3 * k / square
