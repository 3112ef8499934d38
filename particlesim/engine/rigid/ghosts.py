"""Ghosts: contacts of a body with the hidden edge of a collider whose face lies flush with that of another.

A corner that rests on two boxes side by side is a little below their tops, and comes to the hidden side of the next box as
to a wall; a ball comes to the hidden edge before it is above it, and is thrown up. In truth both go on over one face.

A contact with collider B at p with the normal n is a ghost if another collider A passes through p, or around it, and has
another normal m there, at p + ε n, and B goes on with the same face: at q = p + (ε + d) m − (ε + r) s, B has the normal m
and is as far below q as the face of A is. Here s is the unit vector of n − (n·m) m, d how deep p is below the face, and
r = d |n − (n·m) m|/(1 − n·m) how far it is then outside of it if the edge is round, as that of a thin sheet is.

On a step, in a corner of walls or under a plate that leans there, q is inside of B, and nothing is flush at a free edge. So
A holds the body, and the ghost is dropped. Where the body is not over A, as over the seam itself, it gets the contact that
the common face gives, with the normal m.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import row
from particlesim.engine.rigid.narrow import minus, plus
from particlesim.engine.rigid.probing import away, probe
from particlesim.engine.rigid.rotation import dot
from particlesim.laws.registry import gap

LOOK = 10.0
"""How far beside a contact faces are looked at (ε), in units of the overlap that is left alone."""
FLUSH = 0.1
"""By how much faces that are flush may differ in height, in the same units: what comes over them is not pushed up."""
LEVEL, TILT = 1e-7, 1e-6
"""Angle by which normals of one face may differ, and from which on a normal is that of another one."""


@outlined
def is_beside(walls: Any, own: Any, group: Any, x: Any, far: Any, t: Any) -> bool:
    """Whether another collider than that with the number `own` comes nearer than so `far` to a body of a group at x."""
    found = False
    for wall in walls:
        if not found and wall.number != own and wall.on[group] > 0:
            found = gap(wall.shape, probe(x, far, t)) < 0
    return found


@outlined
def settle_ghosts(walls: Any, wall: Any, k: Any, group: Any, first: Any, slop: Any, t: Any) -> None:
    """Drop ghosts, or have them turned, among contacts of a body of a group with a collider, from `first` on."""
    look, kept = LOOK * slop, first
    for c in range(first, k.number[0]):
        p, n, g = row(k.point, c), row(k.normal, c), k.gap[c]
        other, ghost, over, high, m = -1, False, False, 0.0, n
        while not ghost and other < len(walls):
            other, over, high, m = next_face(walls, wall.number, group, other, p, n, g, look, t)
            ghost = other < len(walls) and goes_on(wall.shape, p, n, m, high, look, t)
        if ghost and not over and abs(g) < look:
            body, g = plus(p, g, n), high + g * dot(n, m)
            p, n, ghost = plus(body, -g, m), m, False
        if not ghost:
            k.first[kept], k.second[kept], k.feature[kept] = k.first[c], k.second[c], k.feature[c]
            k.gap[kept] = g
            k.point[0, kept], k.point[1, kept], k.point[2, kept] = p
            k.normal[0, kept], k.normal[1, kept], k.normal[2, kept] = n
            kept += 1
    k.number[0] = kept


@outlined
def next_face(walls: Any, own: Any, group: Any, last: Any, p: Any, n: Any, g: Any, look: Any, t: Any) -> Any:
    """The next collider after the `last` one that passes through a contact of another one, with the number `own`, and has
    another normal there: its number, as many as there are if there is none; and what `face_at` says of it."""
    found, over, high, m = len(walls), False, 0.0, n
    for wall in walls:
        if found == len(walls) and wall.number > last and wall.number != own and wall.on[group] > 0:
            near = gap(wall.shape, probe(p, 0.0, t))
            if near < 0.5 * look and near > -look - abs(g):
                tilted, over, high, m = face_at(wall.shape, p, n, g, look, t)
                if tilted:
                    found = wall.number
    return found, over, high, m


@outlined
def face_at(shape: Any, p: Any, n: Any, g: Any, look: Any, t: Any) -> Any:
    """The face of a collider at a contact of another one: whether its normal is another one, whether it is below the body,
    how high p is above it [m], and its normal m."""
    at = probe(plus(p, look, n), 0.0, t)
    m = away(shape, at)
    side = plus(n, -dot(n, m), m)
    tilted = dot(side, side) > TILT * TILT
    over = tilted and is_along(away(shape, probe(plus(p, g, n), 0.0, t)), m)
    return tilted, over, gap(shape, at) - look * dot(n, m), m


@outlined
def goes_on(shape: Any, p: Any, n: Any, m: Any, high: Any, look: Any, t: Any) -> bool:
    """Whether a collider goes on behind a contact with the face of another one, of the normal m, that p is so `high` above:
    behind its edge, which is as round as it may be with p so deep below the face."""
    side, deep = plus(n, -dot(n, m), m), max(-high, 0.0)
    length = np.sqrt(dot(side, side))
    behind = look + deep * length / (1 - dot(n, m))
    at = probe(plus(plus(p, look + deep, m), -behind / length, side), 0.0, t)
    expected = high + look + deep
    off = abs(gap(shape, at) - expected)
    return bool(expected > 0 and off < FLUSH * look / LOOK and is_along(away(shape, at), m))


def is_along(n: Any, m: Any) -> Any:
    """Whether two normals are those of one face."""
    d = minus(n, m)
    return dot(d, d) < LEVEL * LEVEL
