"""Kepler's problem in universal variables: where a body is a time later, on any orbit.

Formulas and sources are those of `particlesim.integrators.whfast`. The equation for X is solved by Laguerre's method as
B. A. Conway, Celest. Mech. 39, 199 (1986) uses it, with n = 5, which converges from far away, and with third order in the
end; where a step leaves the bracket of the root, or is not less than half of the step before, the bracket is halved instead.
The error of the last iteration is removed with two terms of Taylor's series, so that two or three evaluations of the
functions are enough.

Orbits go on for millions of steps. Their rounding errors must be random, so that the sum grows only as the root of the
number of steps. So the operations behind the result are rounded exactly as written (`exact`): a reciprocal shared by
divisions, or a rounded coefficient, has the same error in every step of an orbit.
"""

from __future__ import annotations

from fractions import Fraction
from math import factorial
from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import exact, outlined
from particlesim.compiler.intrinsics import fma

NEAR = 2.0
"""|β X²| up to which the functions are summed as series; beyond, circular and hyperbolic functions lose nothing."""
TERMS = 11
"""Terms of the series: 2^11/(2·11 + 2)! is 3e-21."""
STUMPFF = tuple(
    ((-1.0) ** k / factorial(2 * k + 2), 6 * (-1.0) ** k / factorial(2 * k + 3)) for k in range(TERMS, 1, -1)
)
"""Coefficients of c₂ and of 6 c₃, Stumpff's functions, as series of z = β X², from the last to that of z²."""
SECOND, THIRD = -1 / 24, -1 / 20
"""Those of z; and what rounding takes from them."""
SECOND_REST, THIRD_REST = (float(Fraction(-1, n) - Fraction(-1 / n)) for n in (24, 20))
CLOSE = 1e-4
"""Last step of X, relative to X, after which it is right to 1e-12, and to rounding with the final correction."""
MOST_ITERATIONS = 100
"""Bisections of the whole range of numbers, about; 2 to 4 iterations are usual."""


class Conic(NamedTuple):
    """The quantities of an orbit at one position: 1/r₀ [1/m] and r₀ [m], η [m²/s], β [m²/s²], ζ [m³/s²]."""

    inverse: float
    r0: float
    eta: float
    beta: float
    zeta: float


@exact
def conic(mu: Any, x: Any, y: Any, z: Any, vx: Any, vy: Any, vz: Any) -> Conic:
    """The orbit of a body about a mass with μ = G M [m³/s²] at the origin."""
    r0 = np.sqrt(fma(x, x, fma(y, y, z * z)))
    eta = fma(x, vx, fma(y, vy, z * vz))
    beta = 2.0 * mu / r0 - fma(vx, vx, fma(vy, vy, vz * vz))
    return Conic(1.0 / r0, r0, eta, beta, fma(-beta, r0, mu))


def stiefel(beta: Any, x: Any) -> Any:
    """Stiefel's functions G₀, G₁, G₂, G₃ at X."""
    z = beta * x * x
    if abs(z) <= NEAR:
        second, third = 0.0, 0.0
        for a, b in STUMPFF:
            second, third = fma(second, z, a), fma(third, z, b)
        second, third = fma(second, z, SECOND_REST) + SECOND, fma(third, z, THIRD_REST) + THIRD
        c2, c3 = fma(second, z, 0.5), fma(third, z, 1.0) / 6.0
        return fma(-z, c2, 1.0), x * fma(-z, c3, 1.0), x * x * c2, x * x * x * c3
    size = abs(beta)
    root = np.sqrt(size)
    rest = fma(-root, root, size) / (2.0 * root)
    half = 0.5 * fma(root, x, rest * x)
    if beta > 0:
        s, c = np.sin(half), np.cos(half)
    else:
        s, c = np.sinh(half), np.cosh(half)
    g1, g2 = 2.0 * s * c / root, 2.0 * s * s / size
    g1 -= g1 * (rest / root)
    return fma(-beta, g2, 1.0), g1, g2, (x - g1) / beta


def find_root(orbit: Any, lower: Any, upper: Any, h: Any) -> Any:
    """X at a time h [s], about, between two borders."""
    inverse, r0, eta, beta, zeta = orbit
    first = h * inverse
    root = first * (1.0 - 0.5 * eta * first * inverse)  # X = h/r₀ − h² η/(2 r₀³) + …
    root = root if lower <= root <= upper else first
    root = root if lower <= root <= upper else 0.5 * (lower + upper)
    searching, iteration, before = h != 0, 0, np.inf
    while searching and iteration < MOST_ITERATIONS:
        g0, g1, g2, g3 = stiefel(beta, root)
        miss = r0 * root + eta * g2 + zeta * g3 - h
        slope = r0 + eta * g1 + zeta * g2
        bend = eta * g0 + zeta * g1
        above = miss > 0 if abs(miss) < np.inf else root > 0  # beyond all numbers: much too far
        lower, upper = (lower, root) if above else (root, upper)
        newton = miss / slope
        step = -5.0 * newton / (1.0 + np.sqrt(abs(16.0 - 20.0 * newton * (bend / slope))))
        searching = not abs(step) <= CLOSE * abs(root)
        after = root + step
        if searching and not (lower < after < upper and abs(step) < 0.5 * before):
            after = 0.5 * (lower + upper)
            after = after if abs(after) < np.inf else 2.0 * root
        before = abs(after - root)
        root = after
        iteration += 1
    return root


@exact
def arrival(mu: Any, orbit: Any, root: Any, h: Any, x: Any, y: Any, z: Any, vx: Any, vy: Any, vz: Any) -> Any:
    """How place and velocity change in a time h, with X known about."""
    inverse, r0, eta, beta, zeta = orbit
    g0, g1, g2, g3 = stiefel(beta, root)
    slope = fma(eta, g1, fma(zeta, g2, r0))
    left = (h - fma(r0, root, fma(eta, g2, zeta * g3))) / slope if slope > 0 else 0.0
    g3 = fma(left, fma(0.5 * left, g1, g2), g3)
    g2 = fma(left, fma(0.5 * left, g0, g1), g2)
    g1 = fma(left, fma(-0.5 * left * beta, g1, g0), g1)
    r = fma(eta, g1, fma(zeta, g2, r0))
    f, g = -mu * g2 * inverse, fma(-mu, g3, h)
    fv, gv = -mu * g1 * inverse / r, -mu * g2 / r
    return (
        fma(f, x, g * vx),
        fma(f, y, g * vy),
        fma(f, z, g * vz),
        fma(fv, x, gv * vx),
        fma(fv, y, gv * vy),
        fma(fv, z, gv * vz),
    )


@outlined
def kepler_step(
    mu: float, x: float, y: float, z: float, vx: float, vy: float, vz: float, h: float
) -> tuple[float, float, float, float, float, float]:
    """How place and velocity change in a time h [s] on the orbit about a mass with μ = G M [m³/s²] at the origin."""
    orbit = conic(mu, x, y, z, vx, vy, vz)
    lower, upper = (0.0, np.inf) if h > 0 else (-np.inf, 0.0)
    if orbit.beta > 0:
        speed = np.sqrt(orbit.beta)
        period = 2.0 * np.pi * mu / (orbit.beta * speed)
        h -= period * np.rint(h / period)
        most = 2.0 * np.pi / speed
        lower, upper = (0.0, most) if h > 0 else (-most, 0.0)
    return arrival(mu, orbit, find_root(orbit, lower, upper, h), h, x, y, z, vx, vy, vz)
