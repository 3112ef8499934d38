"""When a swift hard grain comes to a collider, or to a rigid body, on its way (`swift`).

A collider is as far away at least as its gap says, and a grain goes as far as that, again and again; of planes the time is
known at once. Bodies tell it themselves (`rigid.obstacles`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord, frame_at, surface_velocity
from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.blows import dot, minus, row
from particlesim.engine.interactions.hard.walls import FLAT, colliders_of, whole
from particlesim.engine.interactions.hard.ways import (
    BEGUN,
    BEND,
    ENDS,
    HIT,
    IMPACTS,
    MOST_IMPACTS,
    SIDE,
    STRAIGHT,
    WALL,
    leg_of,
    place_at,
    velocity_at,
)
from particlesim.engine.state.columns import fetch
from particlesim.laws.registry import gap_and_normal, moved_to, with_radius

ROUNDING = 1e-12
"""Rate at which what lies on a collider comes closer to it by rounding, as a part of its pace."""
HALVINGS = 40
"""Of a way that has led into a collider."""
TOUCHES, LEAVES, MOST_STRIDES = 1e-9, 0.05, 256
"""Gap to a collider at which a particle hits it, and what it goes without a look where it leaves one, as parts of its
radius; strides on the way to a collider at most, where it is taken to be then."""


def find_wall(w: Any, parts: Any, c: Any, i: Any, t: Any, h: Any) -> None:
    """Find out when a particle comes to a collider or a rigid body on its way, which it has not gone before."""
    find_collider(w, parts, c, i, t, h)
    if w.obstacles is not None and may_meet(w, i):
        find_body(w, c, i, w.when[BEGUN, i])


def find_collider(w: Any, parts: Any, c: Any, i: Any, t: Any, h: Any) -> None:
    """Find out when a particle comes to a collider on its way, which it has not gone before."""
    k = 0
    w.when[WALL, i] = np.inf
    for part in parts:
        for collider in colliders_of(part):
            if (part.first <= i) & (i < part.last) & (w.light[i] > 0):
                soonest = wall_ahead(w, collider, c, i, t, h)
                if soonest < w.when[WALL, i]:
                    w.when[WALL, i], w.what[SIDE, i] = soonest, k
            k += 1


def look_again(w: Any, parts: Any, c: Any, i: Any, s: Any, t: Any, h: Any) -> None:
    """Find out anew when a particle comes to something from time s on: the body that it would have come to then has got
    another way."""
    if w.what[HIT, i] > 0:
        find_collider(w, parts, c, i, t, h)
    else:
        w.when[WALL, i] = np.inf  # the way of what nobody hits is known
    find_body(w, c, i, s)
    if (s < w.when[BEND, i]) & (w.when[BEND, i] < STRAIGHT) & (w.when[WALL, i] == np.inf):
        find_body(w, c, i, w.when[BEND, i])


@outlined
def find_body(w: Any, c: Any, i: Any, s: Any) -> None:
    """Find out when a particle comes to a rigid body on its leg from time s on, if that is before it comes to a collider."""
    o, (begun, x, go) = w.obstacles, leg_of(w, i, s)
    x = (x[0] + (s - begun) * go[0], x[1] + (s - begun) * go[1], x[2] + (s - begun) * go[2])
    ends = w.when[BEND, i] if s < w.when[BEND, i] else w.when[ENDS, i]
    soonest, body, pace, n = type(o).find(o, x, go, float(c.r[i]), i, s, min(ends, w.when[ENDS, i]))
    if soonest < w.when[WALL, i]:
        w.when[WALL, i], w.what[SIDE, i] = soonest, -1 - body
        for axis in range(3):
            w.met[axis, i], w.met[3 + axis, i] = pace[axis], n[axis]
        w.met[6, i] = o.changes[body]


def may_meet(w: Any, i: Any) -> Any:
    """Whether a particle is moved by impulses, and does not go with the surface of a body that it has come to."""
    with_it = w.what[SIDE, i] < 0
    for axis in range(3):
        with_it = with_it & (w.go[axis, i] == w.met[axis, i])
    return (w.light[i] > 0) & (w.what[IMPACTS, i] < MOST_IMPACTS) & (not with_it)


@outlined
def wall_ahead(w: Any, collider: Any, c: Any, i: Any, t: Any, h: Any) -> float:
    """When a particle comes to a collider: it goes as far as that is away at least, again and again. Where it leaves one
    side it goes a little way at once, and may come into another one, as in a corner; then that is looked for on this way."""
    s, go, r, stride = w.when[BEGUN, i], row(w.go, i), float(c.r[i]), 0
    left = s
    own = np.sqrt(dot(go, go))
    while (s < w.when[ENDS, i]) & (stride < MOST_STRIDES) & (own > 0):
        g, axes = look_from(w, collider, c, i, s, t, h)
        x, fast = pace_of(collider, on_way(w, c, i, s, t, h), h)
        fast, n = fast + own, whole(axes, g)
        rate = dot(minus(go, x), n)
        closes = rate < -ROUNDING * fast
        if isinstance(collider.shape, FLAT):
            return s + max(g, 0.0) / -rate if closes else np.inf
        if (g <= TOUCHES * r) & closes:
            low, high = (left if g < -TOUCHES * r else s), s
            for _ in range(HALVINGS if low < high else 0):
                middle = 0.5 * (low + high)
                gap, _ = look_from(w, collider, c, i, middle, t, h)
                low, high = (low, middle) if gap < -TOUCHES * r else (middle, high)
            return low
        left = s
        s += (g if closes else max(g, LEAVES * r)) / fast
        stride += 1
    return s if (s < w.when[ENDS, i]) & (own > 0) else np.inf


def pace_of(collider: Any, p: Any, h: Any) -> Any:
    """How far the surface of a collider comes in a step at a particle, and at most near it [m]."""
    if not isinstance(collider.shape, MovingRecord):
        return (0.0, 0.0, 0.0), 0.0
    u = surface_velocity(collider.shape, frame_at(collider.shape, p.t, p.x), p.x, p.y, p.z)
    turns = 0.0 if collider.shape.spin is None else abs(float(collider.shape.spin.rate))
    x = (h * u[0], h * u[1], h * u[2])
    way = h * np.sqrt(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz)
    return x, np.sqrt(dot(x, x)) + turns * h * way


def look_from(w: Any, collider: Any, c: Any, i: Any, s: Any, t: Any, h: Any) -> Any:
    """The gap to a collider, and its normal, at time s of the way of a particle."""
    return gap_and_normal(collider.shape, on_way(w, c, i, s, t, h))


def on_way(w: Any, c: Any, i: Any, s: Any, t: Any, h: Any) -> Any:
    """A particle at time s of its way."""
    x, v = place_at(w, i, s), velocity_at(w, i, s)
    p = with_radius(fetch(c, i, t), float(c.r[i]))
    return moved_to(p, x[0], x[1], x[2], v[0], v[1], v[2], t - (1.0 - s) * float(h))
