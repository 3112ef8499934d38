"""1/√x without a division and a root, which would take most of the time of a pair of particles.

An estimate y from the exponent has e = 1 − x y² with −0.0692 < e < 0.0676; then 1/√x = y (1 − e)^(−1/2), by the polynomial
of e whose largest relative error there is least.
Source: the estimate is Blinn's (1997), with the constant of McEniry (2007) for float64; the polynomials are fitted by
Lawson's iteration (C. L. Lawson, thesis, 1961).
"""

from __future__ import annotations

from particlesim.compiler.intrinsics import bits_of, number_of
from particlesim.compiler.roots import polynomial

_MAGIC = 0x5FE6EB50C7B537A9
"""Half of 3 · 2^1022's exponent bits, moved to where the worst relative error is least: 0.0344."""
_FINE = (0.27403802439865826, 0.31394081571215837, 0.3750007006908018, 0.4999983167290684, 0.9999999993446365)
"""Highest power first."""
_FINEST = (
    0.2262660483541069,
    0.24781186362709773,
    0.27343892096639827,
    0.3124959858833233,
    0.3749999954571012,
    0.5000000023437114,
    1.0000000000011393,
)


def inverse_root(x: float, order: int) -> float:
    """1/√x for normal x > 0, a hundred times as exact as multipoles of an order are: within 3e-8 up to order 7, 3e-11 from
    there on."""
    y = number_of(_MAGIC - (bits_of(x) >> 1))
    e = 1 - x * y * y
    return y * polynomial(e, _FINE if order <= 7 else _FINEST)
