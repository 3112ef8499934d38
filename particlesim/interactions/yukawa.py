"""A screened charge: U = A e^(−r/λ)/r, f = A e^(−r/λ) (1/r + 1/λ) l/r², l = x₁ − x₂, r = |l|.

Source: P. Debye, E. Hückel, Phys. Z. 24, 185 (1923); H. Yukawa, Proc. Phys. Math. Soc. Japan 17, 48 (1935).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt

from particlesim.interactions.base import PairInteraction
from particlesim.laws.pair import Pair, Terms, by_distance, central_law
from particlesim.model.units import JouleMetres, Metres


class Yukawa(PairInteraction):
    """Repulsion, or with a negative strength attraction, that a medium screens."""

    type: Literal["yukawa"] = "yukawa"
    strength: JouleMetres
    """A: energy times distance; positive repels."""
    screening_length: Annotated[Metres, Gt(0)]
    """Length λ over which the interaction is screened."""

    formula: ClassVar[str] = "f = A e^(−r/λ) (1/r + 1/λ) l/r², l = x₁ − x₂, r = |l|"
    energy: ClassVar[str] = "U = A e^(−r/λ)/r"

    def length(self) -> float | None:
        return self.screening_length

    def record(self) -> YukawaRecord:
        return YukawaRecord(self.strength, 1 / self.screening_length)


class YukawaRecord(NamedTuple):
    """A [J m], 1/λ [1/m]."""

    strength: float
    rate: float


@central_law(YukawaRecord)
def yukawa(f: YukawaRecord, p: Pair, s: float) -> Terms:
    r = np.sqrt(s)
    inverse = 1 / r
    u = f.strength * np.exp(-f.rate * r) * inverse
    steep = inverse + f.rate
    return by_distance(u, -u * steep, u * (steep * steep + inverse * inverse), r)
