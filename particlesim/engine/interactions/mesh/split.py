"""1/R, R = √(r² + ε²), cut into a far part, which is smooth, and a near one, which ends soon.

    1/R = (2/√π) ∫₀^∞ e^(−t² R²) dt = erf(αR)/R + erfc(αR)/R

by the part of the integral below α and the one above (Ewald). The far part is an entire function of R²: with x = α² R² it is
α E(x), E(x) = erf(√x)/√x. So a polynomial of R² approximates it to any accuracy, without roots, divisions or exponentials;
subtracted from the law itself it leaves the near part, with Plummer's softening as for points. With softening by a cubic
spline the far part is that of points, and the near part has a law of its own where particles are close to each other.
Source: P. P. Ewald, Ann. Phys. 369, 253 (1921).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.laws.pair import Pair, Terms, central, central_law

Floats = NDArray[np.float64]
Coefficients = tuple[float, ...]


class ByMass(NamedTuple):
    """Particles act by their masses."""


class ByCharge(NamedTuple):
    """Particles act by their charges."""


class Far(NamedTuple):
    """Polynomials of R², highest power first, by the variable `scale` · R² − 1: E, −2 E' and 4 E'', and −c α, −c α³, c α⁵
    by which they are the energy, k and q of two unit particles."""

    scale: float
    square: float
    height: Coefficients
    slope: Coefficients
    bend: Coefficients
    by_height: float
    by_slope: float
    by_bend: float


class Near(NamedTuple):
    """A law without its far part; whether particles act by mass or by charge; and the energy of two unit particles that is
    taken from it, so that it ends at 0 where pairs do."""

    law: Any
    by: Any
    far: Far
    end: float = 0.0


@central_law(Near)
def near_part(f: Near, p: Pair, s: float) -> Terms:
    u, k, q = central(f.law, p, s)
    far = f.far
    w = p.m1 * p.m2 if isinstance(f.by, ByMass) else p.q1 * p.q2
    x = far.scale * (s + far.square) - 1
    return (
        u - w * (far.by_height * polynomial(x, far.height) + f.end),
        k - w * far.by_slope * polynomial(x, far.slope),
        q - w * far.by_bend * polynomial(x, far.bend),
    )


def polynomial(x: Any, coefficients: Any) -> Any:
    """Horner's scheme, highest power first."""
    total = coefficients[0]
    for c in coefficients[1:]:
        total = total * x + c
    return total


def ended(law: Near, reach: float) -> Near:
    """The same with an energy of 0 at a reach."""
    unit = Pair(reach, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, q1=1.0, q2=1.0)
    return law._replace(end=float(central(law._replace(end=0.0), unit, reach * reach)[0]))


@lru_cache
def far_polynomials(reach: float, error: float) -> tuple[Coefficients, Coefficients, Coefficients]:
    """E, −2 E' and 4 E'' for 0 ≤ x ≤ reach², by the variable 2 x/reach² − 1, within `error`, or 10⁻¹⁴ where that is less."""
    found, error = [], max(error, 1e-14)
    for degree, scale in ((0, 1.0), (1, -2.0), (2, 4.0)):
        nodes = np.cos(np.pi * (np.arange(80) + 0.5) / 80)
        values = scale * e_function(reach * reach * (nodes + 1) / 2, degree)
        series = np.polynomial.chebyshev.chebfit(nodes, values, 60)
        tail = np.cumsum(np.abs(series[::-1]))[::-1]
        last = int(np.argmax(tail < error)) if (tail < error).any() else len(series)
        power = np.polynomial.chebyshev.cheb2poly(series[: max(last, 2)])
        found.append(tuple(power[::-1].tolist()))
    return found[0], found[1], found[2]


def e_function(x: Floats, derivative: int) -> Floats:
    """E(x) = erf(√x)/√x or one of its first two derivatives; for small x by its series 2/√π Σ (−x)^k/(k! (2 k + 1))."""
    from scipy.special import erf

    x = np.asarray(x, float)
    small = x < 1.0
    z = np.where(small, 1.0, x)
    root, bell = np.sqrt(z), 2 / np.sqrt(np.pi) * np.exp(-z)
    e = erf(root) / root
    for n in range(derivative):  # 2 x E⁽ⁿ⁺¹⁾ = (−1)ⁿ 2/√π e^(−x) − (2 n + 1) E⁽ⁿ⁾
        e = ((-1) ** n * bell - (2 * n + 1) * e) / (2 * z)
    y = np.where(small, x, 0.0)
    series, term = np.zeros_like(y), np.full_like(y, 2 / np.sqrt(np.pi))
    for k in range(24):
        # the derivative of (−x)^k/k! of order n is (−1)^n (−x)^(k−n)/(k−n)!
        series += (-1) ** derivative * term / (2 * (k + derivative) + 1)
        term = term * -y / (k + 1)
    return np.where(small, series, e)


def far_of(alpha: float, square: float, strength: float, reach: float, error: float) -> Far:
    """The far part of U = −`strength`/R for a softening with that square, where α R ≤ reach."""
    height, slope, bend = far_polynomials(reach, error)
    return Far(
        2 * (alpha / reach) ** 2,
        square,
        height,
        slope,
        bend,
        -strength * alpha,
        -strength * alpha**3,
        strength * alpha**5,
    )
