"""Particles as laws of pairs see them, one by one and in blocks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import on_stack
from particlesim.engine.state.columns import load, type_of
from particlesim.laws.pair import Pair, central, is_central, pair_force, pair_potential, square
from particlesim.model.attributes import FURTHER

TARGETS = 32
"""Particles in a block: their places and sums fill the registers of AVX-512, and divide evenly into those of others."""
BY_DIVIDER = 24
"""Those of a block that have their roots from the processor's divider; the others have them by products meanwhile."""
FEW = 4
"""Particles in a block of few bodies: a vector of AVX, all by the divider."""
CHARGE = [each.name for each in FURTHER].index("charge")


class Block(NamedTuple):
    """The particles of a block as rows of numbers: place, velocity, mass, radius, charge, what the interaction keeps of
    each; and ids, None where the law does not read them."""

    x: Any
    y: Any
    z: Any
    vx: Any
    vy: Any
    vz: Any
    m: Any
    r: Any
    q: Any
    a: Any
    b: Any
    id: Any


def particle_of(each: Any, c: Any, i: Any) -> Any:
    """The values of a particle that the law of an interaction reads, as a `Block` of single numbers."""
    x = c.x[i]
    charge = c.further[CHARGE] if len(c.further) > 0 else None
    return Block(
        x,
        c.y[i],
        c.z[i],
        c.vx[i],
        c.vy[i],
        c.vz[i],
        c.m[i],
        load(c.r, i, x),
        load(charge, i, x),
        load(each.a, i, x),
        load(each.b, i, x),
        None if each.ids is None else each.ids[i],
    )


def gathered(each: Any, c: Any, start: Any, lo: Any, hi: Any, width: Any = TARGETS) -> Any:
    """The block of `width` particles that begins at `start`, of which [lo, hi) count: copies of these take the places of
    others."""
    room = on_stack(len(Block._fields) - 1, width, c.x.dtype)
    numbers, ids = [room[k] for k in range(len(Block._fields) - 1)], None
    for i in range(width):
        one = particle_of(each, c, max(min(start + i, hi - 1), lo))
        for row, number in zip(numbers, one[:-1], strict=True):
            row[i] = number
    if each.ids is not None:
        ids = on_stack(1, width, np.int64)[0]
        for i in range(width):
            ids[i] = each.ids[max(min(start + i, hi - 1), lo)]
    return Block(*(*numbers, ids))


def nearest(d: Any, period: Any) -> Any:
    """A difference of coordinates to the nearest image; `period` is None where there is none."""
    if period is None:
        return d
    return d - type_of(d, period) * np.rint(d * type_of(d, 1.0 / period))


def pair_of(one: Any, other: Any, t: Any, by_products: Any = False, box: Any = None) -> Any:
    """Two particles as laws see them; the nearest image of the other in a box, whose periods are given."""
    px, py, pz = (None, None, None) if box is None else box
    return Pair(
        nearest(one.x - other.x, px),
        nearest(one.y - other.y, py),
        nearest(one.z - other.z, pz),
        one.vx - other.vx,
        one.vy - other.vy,
        one.vz - other.vz,
        one.m,
        other.m,
        one.r,
        other.r,
        one.q,
        other.q,
        t,
        one.a,
        other.a,
        one.b,
        other.b,
        0 if one.id is None else one.id,
        0 if other.id is None else other.id,
        by_products,
    )


def pair_in(block: Any, i: Any, other: Any, t: Any, by_products: Any = False, box: Any = None) -> Any:
    """Particle i of a block and another one, as laws see them."""
    return pair_of(Block(*[None if row is None else row[i] for row in block]), other, t, by_products, box)


def reaches(each: Any, s: Any) -> Any:
    """Whether two particles at a squared distance s act on each other; True where all do."""
    if each.most is None:
        return True if each.least is None else s > each.least
    return s < each.most if each.least is None else (s > each.least) & (s < each.most)


def chosen(condition: Any, value: Any) -> Any:
    """A number where a condition holds, else 0."""
    if condition is True:
        return value
    return value if condition else type_of(value, 0)


def apart(near: Any, p: Any) -> Any:
    """A pair at which laws have a value: the same if it is near, else one at a distance of 1 m or more."""
    if near is True:
        return p
    return Pair(p.x if near else type_of(p.x, 1), *p[1:])


def force_in(each: Any, p: Any) -> Any:
    """Force on the first of a pair; 0 if they do not act on each other."""
    s = square(p)
    near = reaches(each, s)
    if is_central(each.law):
        _, k, _ = central(each.law, p, s if near is True else (s if near else type_of(s, 1)))
        k = chosen(near, k)
        return k * p.x, k * p.y, k * p.z
    fx, fy, fz = pair_force(each.law, apart(near, p))
    return chosen(near, fx), chosen(near, fy), chosen(near, fz)


def energy_in(each: Any, p: Any, counts: Any) -> Any:
    """Potential energy of a pair; 0 if they do not act on each other, or the pair does not count.

    At one place, where a law that stays finite has no direction, it is the energy very near to each other.
    """
    s = square(p)
    near = reaches(each, s) & counts
    if each.least is not None:
        together = (s <= each.least) & (each.least > 0) & counts
        p = Pair(np.sqrt(each.least) if together else p.x, *p[1:])
        near = near | together
    return chosen(near, pair_potential(each.law, apart(near, p)))


def slopes_in(each: Any, p: Any, generic: Any) -> Any:
    """A Jacobian of a pair; zeros if they do not act on each other."""
    near = reaches(each, square(p))
    return tuple([chosen(near, entry) for entry in generic(each.law, apart(near, p))])
