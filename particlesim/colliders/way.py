"""The way of a particle in a step, and where it first meets a shape, however fast the particle is. No convex shape is too
thin for that, down to rounding.

The way is the parabola x(s) = x₀ + u s + c s², 0 ≤ s ≤ 1, through the places at both ends of the step with the velocity at
its beginning: u = h v₀, c = x₁ − x₀ − u. In a uniform field it is exact, else its error is of third order.

Two searches, both from one safe place to the next (conservative advancement):

- A convex shape lies on one side of the plane through its nearest point, so that g(x') ≥ g(x) + n·(x' − x) everywhere. Along
  a parabola this bound is a quadratic in s, and the way is free up to its first root. That is Newton's method on a convex
  function from the left: on a flat face the first root is the contact, on round ones it converges quadratically, and a way
  that moves off needs one look.
- Of any other shape the gap is known to change no faster than the place: the way is free as far as the gap is wide. Steps
  are no shorter than `grain`, a small part of the shape's smallest radius R, so that at most a graze of depth grain²/8R is
  missed, and what is thinner than `grain`, as parts of differences, intersections and level sets may be.

Sources: J. C. Hart, Sphere tracing, The Visual Computer 12, 527 (1996); B. V. Mirtich, Impulse-based dynamic simulation of
rigid body systems (thesis, Berkeley 1996), section 2.3.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.laws.registry import Particle, gap, moved_to, normal

MOST_LOOKS = 96
"""Looks at a convex shape; a graze halves what is left each time, and the gap is rounding by then."""
INTO = 1.5
"""How deep into a shape a way is followed, in rounding errors: so that it is seen to be reached, and not passed if thin."""
MOST_STEPS = 4096
"""Safe steps along other shapes; beyond them the way is cut into pieces of a thousandth."""


class Way(NamedTuple):
    """The coefficients u and c of a parabola [m]; it begins where the particle is."""

    ux: float
    uy: float
    uz: float
    cx: float
    cy: float
    cz: float


def way_of(p: Particle, q: Particle, h: float) -> Way:
    """The way of a step of h [s] from p to q."""
    ux, uy, uz = h * p.vx, h * p.vy, h * p.vz
    return Way(ux, uy, uz, q.x - p.x - ux, q.y - p.y - uy, q.z - p.z - uz)


def place_on(w: Way, p: Particle, s: float) -> Particle:
    """The particle p at the part s of its way."""
    return moved_to(
        p,
        p.x + s * (w.ux + s * w.cx),
        p.y + s * (w.uy + s * w.cy),
        p.z + s * (w.uz + s * w.cz),
        p.vx,
        p.vy,
        p.vz,
        p.t,
    )


def longest(w: Way) -> float:
    """A bound on the length of a way, and on its speed by s [m]: |u + 2cs| is largest at an end."""
    x, y, z = w.ux + 2 * w.cx, w.uy + 2 * w.cy, w.uz + 2 * w.cz
    return np.sqrt(max(w.ux * w.ux + w.uy * w.uy + w.uz * w.uz, x * x + y * y + z * z))


# Convex shapes


def lowest(g: Any, b: Any, a: Any) -> Any:
    """A lower bound of g + b s + a s² for 0 ≤ s ≤ 1, exact where a ≤ 0."""
    zero = type(g)(0)
    return g + (min(a + b, zero) if a < 0 else min(b, zero))


def convex_apart(c: Any, p: Particle, q: Particle, h: float, slack: float) -> bool:
    """`apart` of a convex shape: the planes of both ends of the way keep them apart."""
    w = way_of(p, q, h)
    n, m = normal(c, p), normal(c, q)
    ahead = lowest(
        gap(c, p), n[0] * w.ux + n[1] * w.uy + n[2] * w.uz, n[0] * w.cx + n[1] * w.cy + n[2] * w.cz
    )
    bend = m[0] * w.cx + m[1] * w.cy + m[2] * w.cz
    behind = lowest(gap(c, q), -(m[0] * w.ux + m[1] * w.uy + m[2] * w.uz) - 2 * bend, bend)
    return max(ahead, behind) >= -slack


@outlined
def convex_contact(c: Any, p: Particle, q: Particle, h: float, slack: float) -> float:
    """`first_contact` of a convex shape."""
    w = way_of(p, q, h)
    one = type(p.x)(1)
    s = one - one
    found = one
    for _ in range(MOST_LOOKS):
        here = place_on(w, p, s)
        g = gap(c, here)
        if g < -slack:
            found = s
            break
        n = normal(c, here)
        b = n[0] * (w.ux + 2 * s * w.cx) + n[1] * (w.uy + 2 * s * w.cy) + n[2] * (w.uz + 2 * s * w.cz)
        a = n[0] * w.cx + n[1] * w.cy + n[2] * w.cz
        s = s + first_root(a, b, g + type(g)(INTO) * slack)
        if not s < 1:
            break
    return max(found, type(p.x)(2.0**-40))


def first_root(a: Any, b: Any, g: Any) -> Any:
    """The first s > 0 at which g + b s + a s² is 0, where g > 0; 2 where there is none before 2."""
    none = type(g)(2)
    inside = b * b - 4 * a * g
    if inside < 0 or (b >= 0 and a >= 0):
        return none
    root = np.sqrt(inside)
    # of the two forms of a root the one that does not cancel
    first = 2 * g / (root - b) if b < 0 else (b + root) / (-2 * a)
    return min(first, none)


# Any other shape


def lipschitz_apart(c: Any, p: Particle, q: Particle, h: float, slack: float) -> bool:
    """`apart` of any shape: the way is shorter than the gaps at its ends together."""
    return gap(c, p) + gap(c, q) >= longest(way_of(p, q, h))


@outlined
def marched_contact(c: Any, p: Particle, q: Particle, h: float, slack: float, grain: float) -> float:
    """`first_contact` of any shape, in safe steps of at least `grain` [m]."""
    w = way_of(p, q, h)
    speed = longest(w)
    one = type(p.x)(1)
    found = one
    s = one - one
    k = 0
    while s < 1 and speed > 0:
        g = gap(c, place_on(w, p, s))
        if g < -slack:
            found = s
            break
        k += 1
        least = max(grain, type(p.x)(1e-3) * speed) if k > MOST_STEPS else grain
        s = s + max(g, least) / speed
    return max(found, type(p.x)(2.0**-40))


# The inside of a convex shape


def concave_apart(c: Any, p: Particle, q: Particle, h: float, slack: float) -> bool:
    """`apart` of the inside of a convex shape: its gap is a concave function of the place, so that a straight way between
    two legal places is free. The parabola leaves it by |c| s (1 − s): a (1 − s) + b s − |c| s (1 − s) ≥ 0 if √a + √b ≥ √|c|.
    """
    w = way_of(p, q, h)
    a, b = gap(c, p), gap(c, q)
    zero = a - a
    bend = np.sqrt(w.cx * w.cx + w.cy * w.cy + w.cz * w.cz)
    room = max(a, zero) + max(b, zero) + 2 * np.sqrt(max(a, zero) * max(b, zero))
    return (room >= bend) & (min(a, b) >= -slack)
