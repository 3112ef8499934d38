"""Contacts of bodies with colliders, through the gap and the normal that every shape of a collider gives.

A sphere is its centre with a radius, a capsule its two ends and, where a collider is not flat, the place between them that
is nearest; a box is its corners and, likewise, the nearest place of each edge. A ball that touches the inside of a face is
found from its centre.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.bodies.shape import BOX, SPHERE
from particlesim.colliders.plane import PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord
from particlesim.colliders.sphere import BallRecord
from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import (
    WORLD,
    add_contact,
    orientation,
    place,
    row,
    set_surface,
)
from particlesim.engine.rigid.narrow import GOLDEN, box_distance, box_normal, half_axis, minus, plus
from particlesim.engine.rigid.rotation import dot, matrix, to_body, to_world
from particlesim.laws.registry import Particle, gap, normal
from particlesim.model.attributes import FURTHER

FLAT = (PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord)
"""Shapes whose nearest place to an edge is at one of its ends."""
SECTIONS = 24
"""Golden sections of an edge."""


class Wall(NamedTuple):
    """A collider: its shape, which groups it holds back [groups], restitution, static and kinetic friction, the velocity of its
    surface along itself [m/s], its number."""

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
def touch_wall(wall: Any, b: Any, k: Any, i: Any, margin: Any, t: Any) -> None:
    """Note the contacts of body i with a collider that are nearer than a margin."""
    begin = k.number[0]
    if gap(wall.shape, probe(place(b, i), b.reach[i], t)) < margin:
        code = 16384 * (1 + wall.number)
        if b.kind[i] == BOX:
            if isinstance(wall.shape, BallRecord):
                box_on_ball(wall, b, k, i, margin, code)
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


def box_on_ball(wall: Any, b: Any, k: Any, i: Any, margin: Any, code: Any) -> None:
    """The contact of a box with a solid ball."""
    c, r, half = wall.shape, matrix(orientation(b, i)), row(b.size, i)
    a = to_body(r, minus((c.x, c.y, c.z), place(b, i)))
    distance = box_distance(half, a) - c.radius
    if distance < margin:
        n = to_world(r, box_normal(half, a))
        at = plus((c.x, c.y, c.z), -c.radius, n)
        add_contact(k, i, WORLD, code, at, (-n[0], -n[1], -n[2]), distance)
