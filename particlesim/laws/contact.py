"""Laws of contact: normal forces and friction between two particles that touch.

A record has a law for `touch`: at the overlap δ of a pair it gives the elastic push N(δ) and its slope, the coefficient γ_n
of the damper beside it, stiffness k_t and damping γ_t along the surfaces, and the constant attraction C of surfaces that
touch. With n = l/|l|, l = x₁ − x₂, v = v₁ − v₂ the first feels along n the force

    f_n = N(δ) − C − γ_n v·n     while δ = r₁ + r₂ − |l| > 0,

so `pair_force` and its Jacobians follow; they are what friction, which needs a memory, is added to (`engine.interactions.
contacts`). Numbers `a` of a pair are inverse masses, 0 of what is held.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from particlesim.laws.matrices import outer, with_diagonal
from particlesim.laws.pair import Pair, pair_force, pair_force_dv, pair_force_dx, pair_potential, square
from particlesim.laws.registry import GENERICS, Matrix, Vector, generic, law


class Touch(NamedTuple):
    """A contact at an overlap: push N [N], its slope N' [N/m], energy of push and attraction [J], γ_n and its slope [kg/s,
    kg/(m s)], k_t [N/m], γ_t [kg/s], attraction C [N]."""

    push: float
    slope: float
    energy: float
    damping: float
    damping_slope: float
    stiffness: float
    rub: float
    pull: float


@generic(0)
def touch(f: Any, p: Pair, overlap: float) -> Touch:
    """The contact of a pair at an overlap > 0 [m]."""
    return GENERICS[touch].laws[type(f)](f, p, overlap)


def reduced_mass(p: Pair) -> float:
    """m₁ m₂/(m₁ + m₂) [kg] from inverse masses, 0 of a pair of which both are held."""
    both = p.a1 + p.a2
    one = type(both)(1)
    return one / (both if both > 0 else one) if both > 0 else both


def reduced_radius(p: Pair) -> float:
    """r₁ r₂/(r₁ + r₂) [m]."""
    return p.r1 * p.r2 / (p.r1 + p.r2)


def contact_law(record: type) -> Callable[[Callable[..., Touch]], Callable[..., Touch]]:
    """Register the decorated function as the law of contact of a record: the force along n, its energy and its Jacobians
    follow from it."""

    def register(function: Callable[..., Touch]) -> Callable[..., Touch]:
        law(touch, record)(function)
        law(pair_force, record)(_force)
        law(pair_potential, record)(_potential)
        law(pair_force_dx, record)(_by_place)
        law(pair_force_dv, record)(_by_velocity)
        return function

    return register


def _overlap(p: Pair) -> tuple[float, float, bool]:
    """The distance, the overlap, or a radius where there is none, and whether there is one."""
    r = np.sqrt(square(p))
    both = p.r1 + p.r2
    there = (r < both) & (r > 0)
    return (r if r > 0 else both), (both - r if there else both), there


def _rate(p: Pair, r: float) -> float:
    """v·n."""
    return (p.x * p.vx + p.y * p.vy + p.z * p.vz) / r


def _force(f: Any, p: Pair) -> Vector:
    r, overlap, there = _overlap(p)
    at = touch(f, p, overlap)
    k = (at.push - at.pull - at.damping * _rate(p, r)) / r if there else r - r
    return k * p.x, k * p.y, k * p.z


def _potential(f: Any, p: Pair) -> float:
    _, overlap, there = _overlap(p)
    return touch(f, p, overlap).energy if there else overlap - overlap


def _by_place(f: Any, p: Pair) -> Matrix:
    r, overlap, there = _overlap(p)
    at, rate = touch(f, p, overlap), _rate(p, r)
    n = (p.x / r, p.y / r, p.z / r)
    along = at.damping_slope * rate - at.slope
    turn = at.damping / r
    # f = F n: n (∂F/∂l)ᵀ + F/r (1 − n nᵀ)
    k = (at.push - at.pull - at.damping * rate) / r
    rows = tuple(
        (along * axis - turn * (v - rate * axis) - k * axis)
        for axis, v in zip(n, (p.vx, p.vy, p.vz), strict=True)
    )
    if there:
        return with_diagonal(k, outer(n, rows))
    none = r - r
    return none, none, none, none, none, none, none, none, none


def _by_velocity(f: Any, p: Pair) -> Matrix:
    r, overlap, there = _overlap(p)
    c = touch(f, p, overlap).damping / (r * r) if there else r - r
    return outer((-c * p.x, -c * p.y, -c * p.z), (p.x, p.y, p.z))
