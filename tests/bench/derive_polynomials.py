"""Writes particlesim/compiler/polynomials.py, from nothing but the functions themselves.

Each function is written as a known beginning plus a smooth rest. The rest is interpolated in Chebyshev's points in 60
digits, and its coefficients are rounded to float64. The error stated beside is the largest over the interval of the whole
function with the rounded coefficients, relative to the function; float64 itself rounds with 2⁻⁵³.

    python tests/bench/derive_polynomials.py > particlesim/compiler/polynomials.py
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import NamedTuple

from mpmath import asin, atan, atanh, cos, exp, log, lu_solve, matrix, mp, mpf, sin, sinh, sqrt, workdps

Function = Callable[[mpf], mpf]

HEAD = '''\
"""The polynomials of the elementary functions, highest power first, with the largest relative errors of the functions.

Written by tests/bench/derive_polynomials.py.
"""
'''


class Fit(NamedTuple):
    """A rest to approximate on an interval, the number of its coefficients, and how it enters the function."""

    name: str
    meaning: str
    rest: Function
    interval: tuple[mpf, mpf]
    count: int
    function: Function
    weight: Function  # the factor of the rest in the function


def polynomial(z: mpf, highest_first: Sequence[float]) -> mpf:
    """Horner's scheme."""
    return reduce(lambda total, c: total * z + c, highest_first, mpf(0))


def odd(f: Function, *known: mpf) -> Function:
    """(f(u)/u − the known beginning of its series in z = u²) / zⁿ as a function of z."""
    return lambda z: (f(sqrt(z)) / sqrt(z) - polynomial(z, known[::-1])) / z ** len(known)


def fits() -> list[Fit]:
    """The rests of all functions; for odd and even functions the variable is z = u²."""
    one = mpf(1)
    more = 1 + mpf(2) ** -20  # a reduced argument may leave its interval by a rounding
    nothing = mpf(10) ** -12
    half = log(mpf(2)) / 2
    quarter = (nothing, (mp.pi / 4) ** 2 * more)
    eighth = (sqrt(mpf(2)) - 1) ** 2 * more

    def cube(z: mpf) -> mpf:
        return z * sqrt(z)

    def of_root(f: Function) -> Function:
        return lambda z: f(sqrt(z))

    return [
        Fit(
            "EXP",
            "eʳ = 1 + r + r²/2 + r³ EXP(r) for |r| ≤ ln 2 / 2",
            lambda r: (exp(r) - 1 - r - r**2 / 2) / r**3,
            (-half, half * more),
            10,
            exp,
            lambda r: r**3,
        ),
        Fit(
            "ATANH",
            "artanh s = s + s³/3 + s⁵/5 + s⁷ ATANH(s²) for |s| ≤ (√2 − 1)²",
            odd(atanh, one, one / 3, one / 5),
            (nothing, eighth**2),
            7,
            of_root(atanh),
            lambda z: z**3 * sqrt(z),
        ),
        Fit(
            "SIN",
            "sin r = r − r³/6 + r⁵ SIN(r²) for |r| ≤ π/4",
            odd(sin, one, -one / 6),
            quarter,
            6,
            of_root(sin),
            lambda z: z**2 * sqrt(z),
        ),
        Fit(
            "COS",
            "cos r = 1 − r²/2 + r⁴ COS(r²) for |r| ≤ π/4",
            lambda z: (cos(sqrt(z)) - 1 + z / 2) / z**2,
            quarter,
            6,
            of_root(cos),
            lambda z: z**2,
        ),
        Fit(
            "ATAN",
            "atan u = u + u³ ATAN(u²) for |u| ≤ tan π/8",
            odd(atan, one),
            (nothing, eighth),
            12,
            of_root(atan),
            cube,
        ),
        Fit(
            "ASIN",
            "asin s = s + s³ ASIN(s²) for |s| ≤ ½",
            odd(asin, one),
            (nothing, one / 4 * more),
            14,
            of_root(asin),
            cube,
        ),
        Fit(
            "SINH",
            "sinh a = a + a³ SINH(a²) for |a| ≤ ½",
            odd(sinh, one),
            (nothing, one / 4 * more),
            6,
            of_root(sinh),
            cube,
        ),
    ]


def coefficients(fit: Fit) -> tuple[float, ...]:
    """Highest power first, of the polynomial through the values at Chebyshev's points."""
    low, high = fit.interval
    angles = [(2 * k + 1) * mp.pi / (2 * fit.count) for k in range(fit.count)]
    points = [(low + high + (high - low) * mp.cos(angle)) / 2 for angle in angles]
    powers = matrix([[z**k for k in reversed(range(fit.count))] for z in points])
    return tuple(float(c) for c in lu_solve(powers, matrix([fit.rest(z) for z in points])))


def error(fit: Fit, found: tuple[float, ...]) -> float:
    """Largest relative error over a grid, as a power of two."""
    low, high = fit.interval
    points = [low + (high - low) * (mpf(k) + mpf("0.37")) / 500 for k in range(500)]
    return max(
        float(log(abs(fit.weight(z) * (polynomial(z, found) - fit.rest(z)) / fit.function(z)), 2))
        for z in points
    )


def module() -> str:
    """The text of the module."""
    parts = [HEAD]
    with workdps(60):
        for fit in fits():
            found = coefficients(fit)
            lines = "".join(f"    {c!r},\n" for c in found)
            parts.append(f'{fit.name} = (\n{lines})\n"""{fit.meaning}: 2^{error(fit, found):.1f}."""\n')
    return "\n".join(parts)


if __name__ == "__main__":
    print(module(), end="")
