"""The coefficients of particlesim/compiler/elementary.py, from nothing but the functions themselves.

Each function f is written as a known beginning plus a smooth rest, and the rest is interpolated in Chebyshev's points in
60 digits, then rounded to float64. What is printed beside is the largest error over the interval of the whole function
with the rounded coefficients, relative to f, in powers of two: float64 itself rounds with 2⁻⁵³.

    python tests/bench/derive_polynomials.py
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from mpmath import (
    acos,
    asin,
    atan,
    atanh,
    chebyfit,
    cos,
    exp,
    log,
    mp,
    mpf,
    polyval,
    sin,
    sinh,
    sqrt,
    workdps,
)

Function = Callable[[mpf], mpf]


class Fit(NamedTuple):
    """A rest to approximate on an interval, the number of its coefficients, and how it enters the function."""

    name: str
    rest: Function
    interval: tuple[mpf, mpf]
    count: int
    function: Function
    weight: Function  # the factor of the rest in the function


def odd(f: Function, *known: mpf) -> Function:
    """(f(u)/u − the known beginning of its series in z = u²) / zⁿ as a function of z."""

    def rest(z: mpf) -> mpf:
        u = sqrt(z)
        return (f(u) / u - polyval(known[::-1], z)) / z ** len(known)

    return rest


def at_root(f: Function) -> Function:
    return lambda z: f(sqrt(z))


def fits() -> list[Fit]:
    """The rests of all functions; for odd and even functions the variable is z = u²."""
    half = log(mpf(2)) / 2
    quarter = (mp.pi / 4) ** 2 * (1 + mpf(2) ** -20)
    root = (sqrt(mpf(2)) - 1) ** 2 * (1 + mpf(2) ** -20)
    nothing = mpf(10) ** -12
    turn = mpf(1)
    return [
        Fit(
            "EXP",
            lambda r: (exp(r) - 1 - r) / r**2,
            (-half, half * (1 + mpf(2) ** -20)),
            11,
            exp,
            lambda r: r**2,
        ),
        Fit(
            "ATANH",
            odd(atanh, turn, turn / 3),
            (nothing, root**2),
            8,
            at_root(atanh),
            lambda z: z**2 * sqrt(z),
        ),
        Fit("SIN", odd(sin, turn), (nothing, quarter), 7, at_root(sin), lambda z: z * sqrt(z)),
        Fit(
            "COS",
            lambda z: (cos(sqrt(z)) - 1 + z / 2) / z**2,
            (nothing, quarter),
            6,
            at_root(cos),
            lambda z: z**2,
        ),
        Fit("ATAN", odd(atan, turn), (nothing, root), 12, at_root(atan), lambda z: z * sqrt(z)),
        Fit("ASIN", odd(asin, turn), (nothing, turn / 4), 14, at_root(asin), lambda z: z * sqrt(z)),
        Fit("SINH", odd(sinh, turn), (nothing, turn), 7, at_root(sinh), lambda z: z * sqrt(z)),
    ]


def error(fit: Fit, coefficients: list[float]) -> mpf:
    """Largest relative error over a grid, as a power of two."""
    low, high = fit.interval
    points = [low + (high - low) * (mpf(k) + mpf("0.37")) / 2000 for k in range(2000)]
    return max(
        log(abs(fit.weight(z) * (polyval(coefficients, z) - fit.rest(z)) / fit.function(z)), 2)
        for z in points
    )


def main() -> None:
    with workdps(60):
        for fit in fits():
            coefficients = [float(c) for c in chebyfit(fit.rest, list(fit.interval), fit.count)]
            print(f"{fit.name}: 2^{float(error(fit, coefficients)):.1f}")
            print("".join(f"    {c!r},\n" for c in coefficients))
        for name, number in {
            "LN2": log(mpf(2)),
            "PI_2": mp.pi / 2,
            "PI_4": mp.pi / 4,
            "THIRD": mpf(1) / 3,
        }.items():
            parts = []
            for _ in range(3):
                parts.append(float(number))
                number -= parts[-1]
            print(name, parts)


if __name__ == "__main__":
    main()
