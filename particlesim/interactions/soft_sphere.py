"""Spheres that push each other apart while they overlap: U = (ε/α) (1 − r/σ)^α for r < σ, else 0; r = |x₁ − x₂|.

σ is the sum of both radii, or a length that is given. α = 2 is a linear repulsion, α = 5/2 that of Hertz.
Source: C. S. O'Hern, L. E. Silbert, A. J. Liu, S. R. Nagel, Phys. Rev. E 68, 011306 (2003).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt

from particlesim.interactions.base import PairInteraction
from particlesim.laws.pair import Pair, Terms, by_distance, central_law
from particlesim.model.units import Joules, Metres, Number


class SoftSphere(PairInteraction):
    """Spheres that push each other apart while they overlap, and otherwise do nothing."""

    type: Literal["soft_sphere"] = "soft_sphere"
    epsilon: Annotated[Joules, Ge(0)]
    """Energy ε: of two spheres in one place it is ε/α."""
    sigma: Annotated[Metres, Gt(0)] | None = None
    """Distance σ up to which they repel each other; the sum of both radii unless given."""
    exponent: Annotated[Number, Ge(2)] = 2.0
    """α: 2 for a linear force, 2.5 for that of Hertz."""

    formula: ClassVar[str] = "f = (ε/σ) (1 − r/σ)^(α−1) l/r for r < σ, l = x₁ − x₂, r = |l|"
    energy: ClassVar[str] = "U = (ε/α) (1 − r/σ)^α for r < σ, else 0"

    def record(self) -> SoftSphereRecord | SoftRadiiRecord:
        if self.sigma is None:
            return SoftRadiiRecord(self.epsilon, self.exponent)
        return SoftSphereRecord(self.epsilon, self.exponent, self.sigma)

    def needs(self) -> frozenset[str]:
        return frozenset({"radius"}) if self.sigma is None else frozenset()

    def reach(self) -> float | None:
        ends = [end for end in (self.cutoff, self.sigma) if end is not None]
        return min(ends) if ends else None

    def touching(self) -> bool:
        return self.sigma is None

    def singular(self) -> bool:
        return False


class SoftSphereRecord(NamedTuple):
    """ε [J], α, σ [m]."""

    epsilon: float
    exponent: float
    sigma: float


class SoftRadiiRecord(NamedTuple):
    """ε [J], α; σ is the sum of the radii."""

    epsilon: float
    exponent: float


def soft_terms(epsilon: float, exponent: float, sigma: float, s: float) -> Terms:
    """Terms of the law with a distance σ; zeros where spheres do not overlap."""
    r = np.sqrt(s)
    gap = 1 - r / sigma
    overlap = max(gap, gap - gap)
    # 0 to the power of a positive exponent is 0; for exponent 2 the curvature is switched off by hand
    u = epsilon / exponent * overlap**exponent
    slope = -epsilon / sigma * overlap ** (exponent - 1)
    curvature = epsilon / (sigma * sigma) * (exponent - 1) * overlap ** (exponent - 2)
    return by_distance(u, slope, curvature if gap > 0 else gap - gap, r)


@central_law(SoftSphereRecord)
def soft_sphere(f: SoftSphereRecord, p: Pair, s: float) -> Terms:
    return soft_terms(f.epsilon, f.exponent, f.sigma, s)


@central_law(SoftRadiiRecord)
def soft_radii(f: SoftRadiiRecord, p: Pair, s: float) -> Terms:
    return soft_terms(f.epsilon, f.exponent, p.r1 + p.r2, s)
