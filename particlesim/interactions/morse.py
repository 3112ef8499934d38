"""Morse's potential of a chemical bond: U = D ((1 − e^(−a (r − r₀)))² − 1), r = |x₁ − x₂|.

The well is D deep at the distance r₀; near it the stiffness is 2 D a².
Source: P. M. Morse, Phys. Rev. 34, 57 (1929).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt

from particlesim.interactions.base import PairInteraction
from particlesim.laws.pair import Pair, Terms, by_distance, central_law
from particlesim.model.units import Joules, Metres, PerMetre


class Morse(PairInteraction):
    """A well with a soft wall: attraction that ends, and bounded repulsion."""

    type: Literal["morse"] = "morse"
    depth: Annotated[Joules, Ge(0)]
    """Depth D of the well."""
    width: Annotated[PerMetre, Gt(0)]
    """a: the larger, the narrower the well."""
    distance: Annotated[Metres, Ge(0)]
    """Distance r₀ of the minimum."""

    formula: ClassVar[str] = "f = −2 D a (e − e²) l/r with e = e^(−a (r − r₀)), l = x₁ − x₂, r = |l|"
    energy: ClassVar[str] = "U = D ((1 − e)² − 1)"

    def length(self) -> float | None:
        return self.distance

    def record(self) -> MorseRecord:
        return MorseRecord(self.depth, self.width, self.distance)

    def singular(self) -> bool:
        return False


class MorseRecord(NamedTuple):
    """D [J], a [1/m], r₀ [m]."""

    depth: float
    width: float
    distance: float


@central_law(MorseRecord)
def morse(f: MorseRecord, p: Pair, s: float) -> Terms:
    r = np.sqrt(s)
    e = np.exp(-f.width * (r - f.distance))
    steep = 2 * f.depth * f.width
    return f.depth * e * (e - 2), *by_distance(
        0.0, steep * e * (1 - e), steep * f.width * e * (2 * e - 1), r
    )[1:]
