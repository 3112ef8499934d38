"""Laws of pairs: what two particles, near or far, do to each other.

A record has a law for `pair_force`, the force on the first of a pair; the second feels its opposite. Laws are pure scalar
functions of a record and a `Pair`, without branches, as they are vectorised over pairs. Whether a pair is near enough to
count is not theirs to say, but the engine's.

Most laws are *central*: f = k l with l = x₁ − x₂ and k a function of s = l·l and of what the particles are. For these one
function gives the potential U, k = −U'/r and q = k'/r = 2 dk/ds, from which follow

    f = k l,   ∂f/∂l = k 1 + q l lᵀ,   ∂f/∂v = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler.roots import inverse_sqrt
from particlesim.laws.matrices import outer, with_diagonal
from particlesim.laws.registry import (
    GENERICS,
    ZERO_MATRIX,
    Matrix,
    Vector,
    evaluate,
    generic,
    has_law,
    law,
)


class Pair(NamedTuple):
    """Two particles as laws see them: l = x₁ − x₂ [m] to the nearest image and v = v₁ − v₂ [m/s], masses [kg], radii [m],
    charges [C], the time [s]; `a` and `b`, numbers that an interaction keeps of every particle; their ids; and whether roots
    are to be found by products, as others keep the divider busy: known when a kernel is compiled."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    m1: float
    m2: float
    r1: float = 0.0
    r2: float = 0.0
    q1: float = 0.0
    q2: float = 0.0
    t: float = 0.0
    a1: float = 0.0
    a2: float = 0.0
    b1: float = 0.0
    b2: float = 0.0
    id1: int = 0
    id2: int = 0
    by_products: bool = False


Terms = tuple[float, float, float]
"""Of a central law: U [J], k [N/m], q [N/m³]."""


@generic(3)
def pair_force(f: Any, p: Pair) -> Vector:
    """Force on the first of a pair [N]; the second feels its opposite."""
    return evaluate(pair_force, f, p)


@generic(1)
def pair_potential(f: Any, p: Pair) -> float:
    """Potential energy of a pair [J]."""
    return evaluate(pair_potential, f, p)


@generic(9)
def pair_force_dx(f: Any, p: Pair) -> Matrix:
    """Jacobian of a pair's force by l = x₁ − x₂ [N/m], row by row."""
    return evaluate(pair_force_dx, f, p)


@generic(9)
def pair_force_dv(f: Any, p: Pair) -> Matrix:
    """Jacobian of a pair's force by v₁ − v₂ [N s/m], row by row."""
    return evaluate(pair_force_dv, f, p)


@generic(0)
def central(f: Any, p: Pair, s: float) -> Terms:
    """U, k and q of a central law at the squared distance s [m²]; the pair says what the particles are."""
    return GENERICS[central].laws[type(f)](f, p, s)


def central_law(record: type) -> Callable[[Callable[..., Terms]], Callable[..., Terms]]:
    """Register the decorated function as the central law of a record: force, potential and Jacobians follow from it."""

    def register(function: Callable[..., Terms]) -> Callable[..., Terms]:
        law(central, record)(function)
        law(pair_force, record)(_central_force)
        law(pair_potential, record)(_central_potential)
        law(pair_force_dx, record)(_central_dx)
        law(pair_force_dv, record)(_no_dv)
        return function

    return register


def is_central(f: Any) -> bool:
    """Whether a record's law is a central one."""
    return has_law(central, f)


def over_cube(c: float, s: float, p: Pair) -> float:
    """c/s^(3/2): of laws that fall off as the square of the distance √s."""
    if p.by_products and not isinstance(s, np.float32):
        y = inverse_sqrt(s)
        return c * y * (y * y)
    return c / (s * np.sqrt(s))


def by_distance(u: float, slope: float, curvature: float, r: float) -> Terms:
    """U, k and q from U and its first two derivatives by the distance r."""
    k = -slope / r
    return u, k, (-curvature - k) / (r * r)


def square(p: Pair) -> float:
    """The squared distance of a pair [m²]."""
    return p.x * p.x + p.y * p.y + p.z * p.z


def _central_force(f: Any, p: Pair) -> Vector:
    _, k, _ = central(f, p, square(p))
    return k * p.x, k * p.y, k * p.z


def _central_potential(f: Any, p: Pair) -> float:
    return central(f, p, square(p))[0]


def _central_dx(f: Any, p: Pair) -> Matrix:
    _, k, q = central(f, p, square(p))
    return with_diagonal(k, outer((q * p.x, q * p.y, q * p.z), (p.x, p.y, p.z)))


def _no_dv(f: Any, p: Pair) -> Matrix:
    return ZERO_MATRIX


class EnergyShifted(NamedTuple):
    """A central law less the energy that it has at a distance, whose square this is [m²]."""

    law: Any
    square: float


class ForceShifted(NamedTuple):
    """A central law less the force, and then the energy, that it has at a distance, whose square this is [m²]."""

    law: Any
    square: float


@central_law(EnergyShifted)
def energy_shifted(f: EnergyShifted, p: Pair, s: float) -> Terms:
    u, k, q = central(f.law, p, s)
    end, _, _ = central(f.law, p, f.square)
    return u - end, k, q


@central_law(ForceShifted)
def force_shifted(f: ForceShifted, p: Pair, s: float) -> Terms:
    # F(r) − F(c) along l derives from U(r) − U(c) + (r − c) F(c)
    u, k, q = central(f.law, p, s)
    end, pull, _ = central(f.law, p, f.square)
    r, c = np.sqrt(s), np.sqrt(f.square)
    last = pull * c
    return u - end + (r - c) * last, k - last / r, q + last / (r * s)
