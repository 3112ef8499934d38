"""Which hard grains colliders have thrown back within a step, before their ways are followed (`ways`).

Forces and rebounds look alike where only the ends of a step are known: both change the velocity. A particle counts as
thrown back by a collider that it may have touched, where forces on it alone do not explain how its velocity has changed, and
that has come to the collider and leaves it, where it ends or at the bend of its way, or has changed along the normal. What
forces have done to it in the step is then what these have done. What moves as no method does has a bend, too, unless other
particles act on it, whose forces change within the step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.interactions.hard.bench import NEAR_WALL
from particlesim.engine.interactions.hard.turns import NOISE, OTHER, way_of
from particlesim.engine.interactions.hard.walls import colliders_of, speed_along, whole
from particlesim.engine.interactions.hard.ways import (
    BEGUN,
    COLLIDER,
    ENDS,
    SOMETHING,
    THROWN,
    bend_of,
    bend_way,
)
from particlesim.engine.state.columns import fetch, type_of
from particlesim.laws.registry import force, gap_and_normal, moved_to

STRAIGHT = (0.0, 0.0, 0.0)
"""By how much colliders have turned a velocity that they have not [m/s]."""
CLOSE = 0.25
"""How near to a collider the way of a particle bends that has been thrown back by it, as a part of the radius."""
LEFT = 1e-9
"""Speed that is left after an impact without rebound by rounding, as a part of that before it."""


def bend_ways(w: Any, alone: bool, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
    """Bend the ways of the members of a share that have been thrown back in a step of h that ends at time t; `alone`: they
    act on each other by impulses only."""
    for part in parts:
        note_kicks(w, part.forces, c, t, h, max(part.first, share.first), min(part.last, share.last))
    find_strange(w, alone, c, before, h, share.first, share.last)
    for part in parts:
        first, last = max(part.first, share.first), min(part.last, share.last)
        for collider in colliders_of(part):
            find_thrown(w, collider, c, before, t, h, first, last)
    bend_thrown(w, c, h, share.first, share.last)


@outlined
def note_kicks(w: Any, forces: Any, c: Any, t: Any, h: Any, first: Any, last: Any) -> None:
    """By how much forces that act on particles [first, last) alone change their velocities in the step, into `image`."""
    for i in range(first, last):
        x, y, z = force(forces, fetch(c, i, t)) if len(forces) > 0 else (0.0, 0.0, 0.0)
        by = float(h) * w.light[i]
        w.image[0, i], w.image[1, i], w.image[2, i] = by * float(x), by * float(y), by * float(z)


@outlined
def find_strange(w: Any, alone: bool, c: Any, before: Any, h: Any, first: Any, last: Any) -> None:
    """Find those of particles [first, last) that move as no method does."""
    for i in range(first, last):
        lasts = w.when[ENDS, i] - w.when[BEGUN, i]
        if (lasts > 0) & (w.light[i] > 0):
            strange = alone and way_of(c, before, i, lasts * float(h), STRAIGHT) < 0
            w.what[THROWN, i] = SOMETHING if strange else 0


@outlined
def find_thrown(w: Any, collider: Any, c: Any, before: Any, t: Any, h: Any, first: Any, last: Any) -> None:
    """Find those of particles [first, last) that a collider has thrown back."""
    for i in range(first, last):
        by = unexplained(w, i)
        if (size_of(by) > 0) & (w.when[ENDS, i] > 0) & (w.light[i] > 0) & (w.what[THROWN, i] != COLLIDER):
            p, u = fetch(c, i, t), (before[3, i], before[4, i], before[5, i])
            x, far, looks, thrown = (p.x, p.y, p.z), h * (size_of(u) + size_of((p.vx, p.vy, p.vz))), 0, False
            far += type_of(far, NEAR_WALL) * p.r
            while looks < 2:  # where it ends, and at the bend
                q = moved_to(p, x[0], x[1], x[2], p.vx, p.vy, p.vz, p.t)
                g, axes = gap_and_normal(collider.shape, q)
                n = whole(axes, g)
                along = by[0] * n[0] + by[1] * n[1] + by[2] * n[2]
                thrown = (g <= far) & (leaves(collider, q, u, n) | (along > 0.5 * size_of(by)))
                part, middle = bend_of(w, i, float(p.r), h)
                looks = looks + 1 if (g <= far) & (not thrown) & (part > 0) else 2
                x = tuple(type_of(p.x, w.at[axis, i] + middle[axis]) for axis in range(3))
                far = type_of(far, CLOSE) * p.r
            w.what[THROWN, i] = COLLIDER if thrown else w.what[THROWN, i]


def size_of(v: Any) -> Any:
    """The length of a vector."""
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def leaves(collider: Any, p: Any, u: Any, n: Any) -> Any:
    """Whether a particle leaves a collider that it came to with a velocity u."""
    along = speed_along(collider, p, n)
    came = u[0] * n[0] + u[1] * n[1] + u[2] * n[2] - along
    return (came < 0) & (p.vx * n[0] + p.vy * n[1] + p.vz * n[2] - along >= type_of(came, LEFT) * came)


def unexplained(w: Any, i: Any) -> Any:
    """By how much the velocity of a particle has changed other than by forces on it alone [m/s]; nothing if it is little."""
    lasts = w.when[ENDS, i] - w.when[BEGUN, i]
    kick = tuple(lasts * w.image[axis, i] for axis in range(3))
    by = tuple(w.speed[axis, i] - w.first[axis, i] - kick[axis] for axis in range(3))
    least = OTHER * size_of(kick) + NOISE * size_of((w.speed[0, i], w.speed[1, i], w.speed[2, i]))
    return by if size_of(by) > least else (0.0, 0.0, 0.0)


@shared
def bend_thrown(w: Any, c: Any, h: Any, first: Any, last: Any) -> None:
    """Bend the ways of those of particles [first, last) that have been thrown back."""
    for i in range(first, last):
        if w.what[THROWN, i] > 0:
            bend_way(w, i, float(c.r[i]), h)
