"""The Lennard-Jones potential: U = 4 ε ((σ/r)¹² − (σ/r)⁶), f = 24 ε (2 (σ/r)¹² − (σ/r)⁶) l/r², l = x₁ − x₂, r = |l|.

Its minimum −ε is at r = 2^(1/6) σ. Groups of different kinds mix by the rules of Lorentz and Berthelot,
σ = (σ₁ + σ₂)/2 and ε = √(ε₁ ε₂).
Source: J. E. Jones, Proc. R. Soc. Lond. A 106, 463 (1924); M. P. Allen, D. J. Tildesley, Computer Simulation of Liquids,
2nd ed., sections 1.3 and 1.4.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Ge, Gt
from pydantic import model_validator

from particlesim.interactions.base import PairInteraction
from particlesim.laws.pair import Pair, Terms, central_law
from particlesim.model.base import Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Joules, Metres
from particlesim.model.vectors import square

Depth = Annotated[Joules, Ge(0)]
Size = Annotated[Metres, Gt(0)]


class LennardJones(PairInteraction):
    """Atoms of noble gases, and what stands for them: strong repulsion, weak attraction."""

    type: Literal["lennard_jones"] = "lennard_jones"
    epsilon: Depth | dict[Name, Depth]
    """Depth ε of the potential; for several kinds of particles a table by group, { argon = ..., krypton = ... }."""
    sigma: Size | dict[Name, Size]
    """Distance σ at which the potential is 0; for several kinds a table by group."""

    formula: ClassVar[str] = "f = 24 ε (2 (σ/r)¹² − (σ/r)⁶) l/r², l = x₁ − x₂, r = |l|"
    energy: ClassVar[str] = "U = 4 ε ((σ/r)¹² − (σ/r)⁶)"

    by_group: ClassVar[tuple[str, ...]] = ("epsilon", "sigma")

    @model_validator(mode="after")
    def _kinds(self) -> LennardJones:
        for key in ("epsilon", "sigma"):
            if getattr(self, key) == {}:
                raise invalid(
                    "names no group", at=(key,), allowed=f"{key} = {{ argon = ... }}, or one number for all"
                )
        return self

    @property
    def mixed(self) -> bool:
        """Whether groups are of different kinds."""
        return isinstance(self.epsilon, dict) or isinstance(self.sigma, dict)

    def length(self) -> float | None:
        return max(self.sigma.values(), default=None) if isinstance(self.sigma, dict) else self.sigma

    def record(self) -> LennardJonesRecord | MixedRecord:
        if isinstance(self.epsilon, dict) or isinstance(self.sigma, dict):
            return MixedRecord()
        return LennardJonesRecord(4 * self.epsilon, square(self.sigma))

    def numbers_of(self, group: str) -> tuple[float, float]:
        if not self.mixed:
            return 0.0, 0.0
        epsilon, sigma = (
            each[group] if isinstance(each, dict) else each for each in (self.epsilon, self.sigma)
        )
        return sigma / 2, 2 * math.sqrt(epsilon)

    def lacks(self, group: str) -> tuple[str, str] | None:
        for key in ("epsilon", "sigma"):
            table = getattr(self, key)
            if isinstance(table, dict) and group not in table:
                return key, f"{key} of {group!r}"
        return None


class LennardJonesRecord(NamedTuple):
    """4 ε [J], σ² [m²]."""

    depth: float
    square: float


class MixedRecord(NamedTuple):
    """Every particle has a = σ/2 [m] and b = 2 √ε [√J]."""


def lennard_jones_terms(depth: float, square: float, s: float) -> Terms:
    """Terms of the law with 4 ε and σ²."""
    one, six, eight, many = type(s)(1), type(s)(6), type(s)(8), type(s)(28)  # numbers of the run's precision
    inverse = one / s
    ratio = square * inverse
    sixth = ratio * ratio * ratio
    k = six * depth * sixth * (sixth + sixth - one) * inverse
    return depth * sixth * (sixth - one), k, six * depth * sixth * (eight - many * sixth) * inverse * inverse


@central_law(LennardJonesRecord)
def lennard_jones(f: LennardJonesRecord, p: Pair, s: float) -> Terms:
    return lennard_jones_terms(f.depth, f.square, s)


@central_law(MixedRecord)
def mixed(f: MixedRecord, p: Pair, s: float) -> Terms:
    sigma = p.a1 + p.a2
    return lennard_jones_terms(p.b1 * p.b2, sigma * sigma, s)
