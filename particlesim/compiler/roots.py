"""Polynomials, and the reciprocal square root by products alone, with the same bits on every machine.

Processors have one slow unit for square roots and divisions, and several for products. A loop that keeps the first busy can
compute some of its roots by products meanwhile. Instructions that estimate the root give other bits on other processors;
here the first guess comes from the bits of the number instead: half of its exponent, with the opposite sign.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler.intrinsics import bits_of, exact, fma, number_of

MAGIC = 0x5FE6EB50C7B537A9
"""Makes the guess good to 3.5 %. Source: C. Lomont, Fast inverse square root (2003); M. Robertson (2012) for the number."""
POSITIVE = (1 << 63) - 1


@exact
def inverse_sqrt(x: Any) -> Any:
    """1/√x for a float64 x > 0, finite and not subnormal, within 1.1 units of the last place; NaN for NaN."""
    y = number_of(MAGIC - ((bits_of(x) >> 1) & POSITIVE))
    # with δ = 1 − x y²: 1/√x = y (1 − δ)^(−1/2) = y (1 + δ/2 + 3 δ²/8 + 5 δ³/16 + 35 δ⁴/128 + …), first |δ| < 0.07
    d = fma(-(x * y), y, 1.0)
    y = fma(y * d, fma(fma(fma(35 / 128, d, 5 / 16), d, 3 / 8), d, 1 / 2), y)
    d = fma(-(x * y), y, 1.0)  # below 2⁻¹⁹ now, so that two terms do
    return fma(y * d, fma(3 / 8, d, 1 / 2), y)


def root(x: Any) -> Any:
    """√x for x ≥ 0, finite and not subnormal; of a float64 by products, within 2 units of the last place."""
    return np.sqrt(x) if isinstance(x, np.float32) else x * inverse_sqrt(x)


def polynomial(x: float, coefficients: tuple[float, ...]) -> float:
    """Horner's scheme, highest power first."""
    total = coefficients[0]
    for c in coefficients[1:]:
        total = fma(total, x, c)
    return total
