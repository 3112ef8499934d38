"""Which hard grains colliders have thrown back within a step, before their ways are followed (`ways`).

Forces and rebounds look alike where only the ends of a step are known: both change the velocity. A particle counts as
thrown back by a collider that it may have touched, where its velocity has come to it and leaves it, at the place where it
ends or at the bend of its way; and if it moves as no method does. Its velocity then does not tell what forces have done in
the step, which is asked of those that act on particles alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.walls import colliders_of, speed_along, whole
from particlesim.engine.interactions.hard.ways import ENDS, THROWN, bend_of, bend_way
from particlesim.engine.state.columns import fetch, type_of
from particlesim.laws.registry import force, gap_and_normal, moved_to

CLOSE = 0.25
"""How near to a collider the way of a particle bends that has been thrown back by it, as a part of the radius."""
LEFT = 1e-9
"""Speed that is left after an impact without rebound by rounding, as a part of that before it."""


def bend_ways(each: Any, parts: Any, c: Any, before: Any, t: Any, h: Any) -> None:
    """Bend the ways of all members that have been thrown back in a step of h that ends at time t."""
    for part in parts:
        for collider in colliders_of(part):
            find_thrown(each, collider, part.forces, c, before, t, h, part.first, part.last)
    for part in parts:
        bend_thrown(each, part.forces, c, t, h, part.first, part.last)


@outlined
def find_thrown(
    each: Any, collider: Any, forces: Any, c: Any, before: Any, t: Any, h: Any, first: Any, last: Any
) -> None:
    """Find those of particles [first, last) that a collider has thrown back."""
    w = each.ways
    for i in range(first, last):
        if (w.when[ENDS, i] > 0) & (each.a[i] > 0) & (w.what[THROWN, i] == 0):
            p = fetch(c, i, t)
            u, v = (before[3, i], before[4, i], before[5, i]), (p.vx, p.vy, p.vz)
            g, axes = gap_and_normal(collider.shape, p)
            far = h * (size_of(u) + size_of(v))
            if g <= far:
                thrown = leaves(collider, p, u, whole(axes, g))
                part, middle = bend_of(w, i, h, kick_of(each, forces, i, p, h))
                if (not thrown) & (part > 0):
                    x = tuple(type_of(p.x, w.at[axis, i] + middle[axis]) for axis in range(3))
                    q = moved_to(p, x[0], x[1], x[2], p.vx, p.vy, p.vz, p.t)
                    g, axes = gap_and_normal(collider.shape, q)
                    thrown = (g < type_of(g, CLOSE) * p.r) & leaves(collider, q, u, whole(axes, g))
                w.what[THROWN, i] = 1 if thrown else 0


def size_of(v: Any) -> Any:
    """The length of a vector."""
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def leaves(collider: Any, p: Any, u: Any, n: Any) -> Any:
    """Whether a particle leaves a collider that it came to with a velocity u."""
    along = speed_along(collider, p, n)
    came = u[0] * n[0] + u[1] * n[1] + u[2] * n[2] - along
    return (came < 0) & (p.vx * n[0] + p.vy * n[1] + p.vz * n[2] - along >= type_of(came, LEFT) * came)


@outlined
def bend_thrown(each: Any, forces: Any, c: Any, t: Any, h: Any, first: Any, last: Any) -> None:
    """Bend the ways of those of particles [first, last) that have been thrown back."""
    w = each.ways
    for i in range(first, last):
        if w.what[THROWN, i] > 0:
            bend_way(w, i, h, kick_of(each, forces, i, fetch(c, i, t), h))


def kick_of(each: Any, forces: Any, i: Any, p: Any, h: Any) -> Any:
    """By how much forces that act on a particle alone change its velocity in a step of h [m/s]."""
    if len(forces) == 0:
        return 0.0, 0.0, 0.0
    x, y, z = force(forces, p)
    by = float(h) * float(each.a[i])
    return by * float(x), by * float(y), by * float(z)
