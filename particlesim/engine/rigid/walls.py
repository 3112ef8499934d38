"""Contacts of bodies with colliders, through the gap and the normal that every shape of a collider gives.

A sphere is its centre with a radius, a capsule its two ends and, where a collider is not flat, the place between them that
is nearest; a box is its corners and, likewise, the nearest place of each edge. A ball that touches the inside of a face is
found from its centre; what else touches it there, as the corner of another box, by projections in turn onto the box and
onto the collider, drawn in a little so that the two stay apart (W. Cheney, A. Goldstein, Proc. Am. Math. Soc. 10, 448,
1959).

The surface of a collider that moves carries its velocity into the contact, all of it; that of a belt, which runs along
itself, only what is along the surface.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies.shape import BOX, SPHERE
from particlesim.colliders.moving import MovingRecord, frame_at, out_of, surface_velocity
from particlesim.colliders.plane import PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord
from particlesim.colliders.sphere import BallRecord
from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import (
    FEATURES,
    WORLD,
    add_contact,
    orientation,
    place,
    row,
    set_surface,
)
from particlesim.engine.rigid.narrow import GOLDEN, box_distance, box_normal, clamped, half_axis, minus, plus
from particlesim.engine.rigid.rotation import dot, matrix, to_body, to_world
from particlesim.laws.registry import Particle, gap, normal
from particlesim.model.attributes import FURTHER

FLAT = (PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord)
"""Shapes whose nearest place to an edge is at one of its ends."""
SECTIONS = 24
"""Golden sections of an edge."""
TURNS = 40
"""Projections in turn onto a box and a collider."""
DRAWN_IN = 0.25
"""How far a collider is drawn in for them, in units of the smallest half edge of the box."""


class Wall(NamedTuple):
    """A collider: its shape, which groups it holds back [groups], restitution, static and kinetic friction, the
    velocity of its surface along itself [m/s], its number."""

    shape: Any
    on: Any
    restitution: float
    static: float
    kinetic: float
    belt: tuple[float, float, float]
    number: int


def probe(p: Any, radius: Any, t: Any) -> Any:
    """A point with a radius, as colliders see particles."""
    zero = 0.0
    return Particle(p[0], p[1], p[2], zero, zero, zero, 1.0, radius, zero, t, 1.0, *[zero for _ in FURTHER])


def away(shape: Any, p: Any) -> Any:
    """The normal of a collider; a component that is always zero may be None."""
    n = normal(shape, p)
    return (
        0.0 if n[0] is None else n[0],
        0.0 if n[1] is None else n[1],
        0.0 if n[2] is None else n[2],
    )


@outlined
def touch_wall(wall: Any, b: Any, k: Any, i: Any, margin: Any, t: Any, h: Any) -> None:
    """Note the contacts of body i with a collider that are nearer than a margin."""
    begin = k.number[0]
    if isinstance(wall.shape, MovingRecord):
        f = frame_at(wall.shape, t, 0.0)
        w = surface_velocity(wall.shape, f, b.x[0, i], b.x[1, i], b.x[2, i])
        rate = 0.0 if wall.shape.spin is None else abs(wall.shape.spin.rate)
        margin = margin + h * (np.sqrt(dot(w, w)) + rate * b.reach[i])
    if gap(wall.shape, probe(place(b, i), b.reach[i], t)) < margin:
        code = FEATURES * (1 + wall.number)
        if b.kind[i] == BOX:
            if isinstance(wall.shape, BallRecord):
                c = wall.shape
                box_on_ball(c, (c.x, c.y, c.z), b, k, i, margin, code)
            elif isinstance(wall.shape, MovingRecord) and isinstance(wall.shape.shape, BallRecord):
                c, f = wall.shape.shape, frame_at(wall.shape, t, 0.0)
                away_from = (c.x - wall.shape.x, c.y - wall.shape.y, c.z - wall.shape.z)
                box_on_ball(c, plus((f.x, f.y, f.z), 1.0, out_of(f.rows, away_from)), b, k, i, margin, code)
            else:
                box_on_wall(wall, b, k, i, margin, t, code)
        else:
            core_on_wall(wall, b, k, i, margin, t, code)
    for number in range(begin, k.number[0]):
        set_surface(k, number, wall.restitution, wall.static, wall.kinetic)
        n = row(k.normal, number)
        out = dot(wall.belt, n)  # what points out of the surface counts for nothing
        for axis, part in enumerate(wall.belt):
            k.belt[axis, number] = part - out * k.normal[axis, number]
        if isinstance(wall.shape, MovingRecord):
            at, f = row(k.point, number), frame_at(wall.shape, t, 0.0)
            for axis, part in enumerate(surface_velocity(wall.shape, f, at[0], at[1], at[2])):
                k.belt[axis, number] += part


def point_on_wall(
    wall: Any, b: Any, k: Any, i: Any, at: Any, radius: Any, margin: Any, t: Any, code: Any
) -> None:
    """A contact of a point of a body with a radius."""
    p = probe(at, radius, t)
    distance = gap(wall.shape, p)
    if distance < margin:
        n = away(wall.shape, p)
        add_contact(k, i, WORLD, code, plus(at, -(radius + distance), n), n, distance)


def core_on_wall(wall: Any, b: Any, k: Any, i: Any, margin: Any, t: Any, code: Any) -> None:
    """Contacts of a sphere or a capsule."""
    radius, x = b.size[0, i], place(b, i)
    if b.kind[i] == SPHERE:
        point_on_wall(wall, b, k, i, x, radius, margin, t, code)
        return
    u = half_axis(b, i)
    point_on_wall(wall, b, k, i, plus(x, 1.0, u), radius, margin, t, code + 1)
    point_on_wall(wall, b, k, i, plus(x, -1.0, u), radius, margin, t, code + 2)
    if not isinstance(wall.shape, FLAT):
        s = nearest_part(wall.shape, plus(x, -1.0, u), plus(x, 1.0, u), t)
        if 0.01 < s < 0.99:
            point_on_wall(wall, b, k, i, plus(x, 2 * s - 1, u), radius, margin, t, code + 3)


def box_on_wall(wall: Any, b: Any, k: Any, i: Any, margin: Any, t: Any, code: Any) -> None:
    """Contacts of the corners of a box, and of its edges where the collider is not flat."""
    r, half, x = matrix(orientation(b, i)), row(b.size, i), place(b, i)
    for corner in range(8):
        at = plus(x, 1.0, to_world(r, corner_of(half, corner)))
        point_on_wall(wall, b, k, i, at, 0.0, margin, t, code + corner)
    if not isinstance(wall.shape, FLAT):
        for edge in range(12):
            axis, first = edge // 4, first_corner(edge)
            one = plus(x, 1.0, to_world(r, corner_of(half, first)))
            two = plus(x, 1.0, to_world(r, corner_of(half, first + (1 << axis))))
            s = nearest_part(wall.shape, one, two, t)
            if 0.01 < s < 0.99:
                at = plus(one, s, minus(two, one))
                point_on_wall(wall, b, k, i, at, 0.0, margin, t, code + 8 + edge)
        face_on_wall(wall.shape, b, k, i, r, half, margin, t, code + 20)


@outlined
def face_on_wall(
    shape: Any, b: Any, k: Any, i: Any, r: Any, half: Any, margin: Any, t: Any, code: Any
) -> None:
    """The contact of a collider with the inside of a face of a box; corners and edges have been looked at."""
    x, depth = place(b, i), DRAWN_IN * min(half[0], min(half[1], half[2]))
    y, last = (0.0, 0.0, 0.0), 0.0
    for _ in range(TURNS):
        p = probe(plus(x, 1.0, to_world(r, y)), 0.0, t)
        step = gap(shape, p) + depth
        z = plus(y, -step, to_body(r, away(shape, p)))
        z = (
            clamped(z[0], -half[0], half[0]),
            clamped(z[1], -half[1], half[1]),
            clamped(z[2], -half[2], half[2]),
        )
        d = minus(z, y)
        y, last = z, dot(d, d)
        if last < 1e-24 * depth * depth:
            break
    bound = 0
    for axis in range(3):
        if abs(y[axis]) > 0.99 * half[axis]:
            bound += 1
    if bound == 1:
        at = plus(x, 1.0, to_world(r, y))
        p = probe(at, 0.0, t)
        distance = gap(shape, p)
        if distance < margin:
            n = away(shape, p)
            add_contact(k, i, WORLD, code, plus(at, -distance, n), n, distance)


def corner_of(half: Any, corner: Any) -> Any:
    """A corner of a box in its frame, by the three bits of its number."""
    return (
        half[0] if corner & 1 else -half[0],
        half[1] if corner & 2 else -half[1],
        half[2] if corner & 4 else -half[2],
    )


def first_corner(edge: Any) -> int:
    """The corner where an edge of a box begins: edges 0 to 3 are along x, then y, then z."""
    axis, m = edge // 4, edge % 4
    if axis == 0:
        return int(2 * m)
    if axis == 1:
        return int((m & 1) + 4 * (m // 2))
    return int(m)


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


def box_on_ball(c: Any, center: Any, b: Any, k: Any, i: Any, margin: Any, code: Any) -> None:
    """The contact of a box with a solid ball, whose centre is there now."""
    r, half = matrix(orientation(b, i)), row(b.size, i)
    a = to_body(r, minus(center, place(b, i)))
    distance = box_distance(half, a) - c.radius
    if distance < margin:
        n = to_world(r, box_normal(half, a))
        at = plus(center, -c.radius, n)
        add_contact(k, i, WORLD, code, at, (-n[0], -n[1], -n[2]), distance)
