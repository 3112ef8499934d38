"""Contacts of points, balls and lines of bodies with colliders, through the gap and the normal that every shape gives."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.plane import PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord
from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import WORLD, add_contact, row
from particlesim.engine.rigid.narrow import GOLDEN, minus, plus
from particlesim.engine.rigid.probing import away, probe
from particlesim.engine.rigid.rotation import dot
from particlesim.laws.registry import gap

FLAT = (PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord)
"""Shapes whose nearest place to an edge is at one of its ends."""
SECTIONS = 24
"""Golden sections of an edge."""
ASIDE, FARTHER, SAME_SIDE, HALVES, SIDES, THERE = 0.1, 4.0, 0.99, 8, 8, 1e-3
"""How far from a side of a collider a ball looks for others, at least, in radii, and how many times as far as contacts are
looked for; the cosine of the angle between two normals from which on they are of one side; looks at one; numbers for the
features of each; and how near to the surface its nearest place is, in radii."""


def point_on_wall(wall: Any, k: Any, i: Any, at: Any, radius: Any, margin: Any, t: Any, code: Any) -> None:
    """A contact of a point of a body with a radius."""
    p = probe(at, radius, t)
    distance = gap(wall.shape, p)
    if distance < margin:
        n = away(wall.shape, p)
        add_contact(k, i, WORLD, code, plus(at, -(radius + distance), n), n, distance)


@outlined
def ball_on_wall(wall: Any, k: Any, i: Any, at: Any, radius: Any, margin: Any, t: Any, code: Any) -> None:
    """Contacts of a ball: where it is nearest to the collider, and on up to two further sides of that, as in a corner, that
    are nearest to places farther away from those which are known."""
    begin = k.number[0]
    point_on_wall(wall, k, i, at, radius, margin, t, code)
    if isinstance(wall.shape, FLAT) or k.number[0] == begin:
        return
    known, shift = begin, (0.0, 0.0, 0.0)
    aside = min(max(ASIDE * radius, FARTHER * margin), radius)
    for more in range(1, 3):
        shift = plus(shift, aside, row(k.normal, known))
        there = plus(at, 1.0, shift)
        y, m = nearest_side(wall.shape, there, at, t)
        new = True
        for c in range(begin, k.number[0]):
            new = new and dot(row(k.normal, c), m) < SAME_SIDE
        distance, known = dot(minus(at, y), m) - radius, k.number[0]
        # of what is put together the surface of a part may go on where there is nothing
        if not (new and distance < margin and abs(gap(wall.shape, probe(y, 0.0, t))) < THERE * radius):
            return
        add_contact(k, i, WORLD, code + SIDES * more, plus(at, -(radius + distance), m), m, distance)
        if k.number[0] == known:
            return


def nearest_side(shape: Any, start: Any, x: Any, t: Any) -> Any:
    """The place of a surface that is nearest to x on the side which is nearest to where to start, and its normal there: from
    half the way to it again and again."""
    y, m = start, (0.0, 0.0, 0.0)
    for turn in range(HALVES):
        z = start if turn == 0 else plus(y, 0.5, minus(x, y))
        p = probe(z, 0.0, t)
        m = away(shape, p)
        y = plus(z, -gap(shape, p), m)
    return y, m


def line_on_wall(
    wall: Any, k: Any, i: Any, a: Any, c: Any, radius: Any, margin: Any, t: Any, code: Any
) -> None:
    """A contact between the ends of a line with a radius, where the collider is not flat and looks at its middle."""
    d = minus(c, a)
    middle = probe(plus(a, 0.5, d), radius + 0.5 * np.sqrt(dot(d, d)), t)
    if gap(wall.shape, middle) < margin:
        part = nearest_part(wall.shape, a, c, t)
        if 0.01 < part < 0.99:
            point_on_wall(wall, k, i, plus(a, part, d), radius, margin, t, code)


@outlined
def nearest_part(shape: Any, a: Any, c: Any, t: Any) -> float:
    """Where the way from a to c is nearest to a collider: 0 at a, 1 at c."""
    low, high, d = 0.0, 1.0, minus(c, a)
    for _ in range(SECTIONS):
        s, u = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        if gap(shape, probe(plus(a, s, d), 0.0, t)) < gap(shape, probe(plus(a, u, d), 0.0, t)):
            high = u
        else:
            low = s
    return 0.5 * (low + high)
