"""Contacts of bodies with colliders, through the gap and the normal that every shape of a collider gives.

Boxes are what bodies are to each other (`narrow`), and their insides six planes (`box_walls`). To all else a sphere is its
centre with a radius, a capsule its two ends and, where a collider is not flat, the nearest point between them; a box or a
hull is its corners and, likewise, the nearest point of each edge (`point_walls`). Contact in the interior of a face is
found from the centre of a spherical collider; with other shapes, as the corner of another box, by alternating projections
onto the face and onto the collider, both shrunk a little so that they stay apart (W. Cheney, A. Goldstein, Proc. Am. Math.
Soc. 10, 448, 1959). The rims of cylinders and cones are eight points around, the first of them the lowest.

A moving collider contributes the velocity of its surface to the relative velocity of a contact; a belt only the component
along the surface.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies.pieces import BOX, CONE, CYLINDER, HULL, SPHERE
from particlesim.colliders.moving import MovingRecord, carried, frame_at, out_of, surface_velocity
from particlesim.colliders.response import FallingRecord
from particlesim.colliders.sphere import BallRecord
from particlesim.compiler import outlined
from particlesim.engine.rigid.bending import note_bends
from particlesim.engine.rigid.bodies import (
    FEATURES,
    WORLD,
    add_contact,
    orientation,
    place,
    row,
    set_fall,
    set_surface,
)
from particlesim.engine.rigid.box_walls import SIDES as SIDES_OF_ROOM
from particlesim.engine.rigid.box_walls import box_of, is_box, is_room, plane_of, room_of
from particlesim.engine.rigid.ghosts import LOOK, is_beside, settle_ghosts
from particlesim.engine.rigid.manifold import LEANING, OTHER, SPAN
from particlesim.engine.rigid.narrow import (
    box_distance,
    box_normal,
    clamped,
    half_axis,
    minus,
    plus,
    touch_pieces,
)
from particlesim.engine.rigid.pieces import corner, ring_of, solid_of
from particlesim.engine.rigid.pipe_walls import ENDS, end_of, has_edges, is_pipe, side_of
from particlesim.engine.rigid.point_walls import FLAT, ball_on_wall, line_on_wall, point_on_wall
from particlesim.engine.rigid.probing import away, probe
from particlesim.engine.rigid.rotation import cross, dot, matrix, to_body, to_world
from particlesim.laws.registry import gap

TURNS = 40
"""Alternating projections onto a box and a collider."""
DRAWN_IN = 0.25
"""How far a collider is drawn in for them, in units of the smallest half edge of the box."""


SPAN_OF_SIDE = SPAN // 8
"""Numbers for the features of a piece at each side of a room."""
RIM = 4
"""Turns of the search for the lowest place of a circle."""
BESIDE = 0.99
"""The cosine of the angle from that place, from which on another one of the circle is beside it."""
CORNERS = 8
"""Places around a circle that may touch."""
AROUND = 16
"""Numbers for the features of a circle."""


class Wall(NamedTuple):
    """A collider: its shape, which groups it holds back [groups], restitution, static and kinetic friction, the
    velocity of its surface along itself [m/s], its number; how restitution falls with the speed of impacts, or None."""

    shape: Any
    on: Any
    restitution: float
    static: float
    kinetic: float
    belt: tuple[float, float, float]
    number: int
    falling: FallingRecord | None = None


@outlined
def touch_wall(scene: Any, wall: Any, b: Any, k: Any, i: Any, margin: Any, t: Any, h: Any) -> None:
    """Note the contacts of body i with a collider that are nearer than a margin, but for ghosts (`ghosts`)."""
    begin, p, g = k.number[0], b.pieces, b.group[i]
    if isinstance(wall.shape, MovingRecord):
        f = frame_at(wall.shape, t, 0.0)
        w = surface_velocity(wall.shape, f, b.x[0, i], b.x[1, i], b.x[2, i])
        rate = 0.0 if wall.shape.spin is None else abs(wall.shape.spin.rate)
        margin = margin + h * (np.sqrt(dot(w, w)) + rate * b.reach[i])
    if gap(wall.shape, probe(place(b, i), b.reach[i], t)) < margin:
        r = matrix(orientation(b, i))
        for number in range(p.first[g], p.first[g + 1]):
            s = solid_of(p, number, place(b, i), r)
            code = FEATURES * (1 + wall.number) + SPAN * (number - p.first[g])
            touch_piece(wall, k, p, i, s, margin, t, code)
    if len(scene.walls) > 1 and k.number[0] > begin:
        far = b.reach[i] + margin + LOOK * scene.slop
        if is_beside(scene.walls, wall.number, g, place(b, i), far, t):
            settle_ghosts(scene.walls, wall, k, g, begin, scene.slop, t)
    for number in range(begin, k.number[0]):
        set_wall(wall, k, number, t)
    if isinstance(wall.shape, MovingRecord) and k.number[0] > begin:
        note_lead(wall.shape, k, place(b, i), row(b.v, i), begin, t, h)
    if h > 0:
        note_bends(scene, wall.shape, b, k, i, begin, t, h)


@outlined
def note_lead(c: Any, k: Any, x: Any, v: Any, begin: Any, t: Any, h: Any) -> None:
    """Note by how much a collider that moves has another velocity at the end of a step of h than in its middle at t, along
    the way of a body at x that has come there with v, for the contacts of that from `begin` on. What the collider carries
    has come with its velocity at the beginning of the step, and goes on by as much faster as that has become since."""
    was, f, end = frame_at(c, t - 0.5 * h, 0.0), frame_at(c, t, 0.0), frame_at(c, t + 0.5 * h, 0.0)
    begun = plus(x, -0.5 * h, v)
    before, now = (
        surface_velocity(c, was, begun[0], begun[1], begun[2]),
        surface_velocity(c, f, x[0], x[1], x[2]),
    )
    y = plus(plus(x, 0.5 * h, v), 0.5 * h, minus(now, before))
    then = surface_velocity(c, end, y[0], y[1], y[2])
    for number in range(begin, k.number[0]):
        for axis, (one, two) in enumerate(zip(now, then, strict=True)):
            k.lead[axis, number] = two - one


def set_wall(wall: Any, k: Any, number: Any, t: Any) -> None:
    """What a collider does at a contact, and how its surface moves there at a time."""
    set_surface(k, number, wall.restitution, wall.static, wall.kinetic)
    if wall.falling is not None:
        set_fall(k, number, 0, wall.restitution, wall.falling.speed, wall.falling.exponent)
    n = row(k.normal, number)
    belt = carried(wall.shape, wall.belt, t, 0.0)
    out = dot(belt, n)  # what points out of the surface counts for nothing
    for axis, part in enumerate(belt):
        k.belt[axis, number] = part - out * k.normal[axis, number]
    if isinstance(wall.shape, MovingRecord):
        at, f = row(k.point, number), frame_at(wall.shape, t, 0.0)
        for axis, part in enumerate(surface_velocity(wall.shape, f, at[0], at[1], at[2])):
            k.belt[axis, number] += part


@outlined
def touch_piece(wall: Any, k: Any, p: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """Note the contacts of a piece of body i with a collider."""
    if not gap(wall.shape, probe(s.x, p.ball[s.number], t)) < margin:
        return
    if is_box(wall.shape):
        touch_box(k, p, i, s, box_of(wall.shape, t, s.number), margin, code)
    elif is_room(wall.shape):
        o = room_of(wall.shape, t, s.number)
        for side in range(SIDES_OF_ROOM):
            touch_side(wall, plane_of(o, side), k, p, i, s, margin, t, code + SPAN_OF_SIDE * side)
    elif is_pipe(wall.shape):
        if has_edges(s):
            touch_side(wall, side_of(wall.shape), k, p, i, s, margin, t, code)
            for end in range(ENDS):
                plane = end_of(wall.shape, end, t)
                touch_side(wall, plane, k, p, i, s, margin, t, code + SPAN_OF_SIDE * (1 + end))
        else:
            piece_on_wall(wall, k, p, i, s, margin, t, code)
    else:
        piece_on_wall(wall, k, p, i, s, margin, t, code)


def touch_side(wall: Any, shape: Any, k: Any, p: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """Note the contacts of a piece of body i with one side of a collider."""
    if gap(shape, probe(s.x, p.ball[s.number], t)) < margin:
        side = Wall(
            shape, wall.on, wall.restitution, wall.static, wall.kinetic, wall.belt, wall.number, wall.falling
        )
        piece_on_wall(side, k, p, i, s, margin, t, code)


def touch_box(k: Any, p: Any, i: Any, s: Any, o: Any, margin: Any, code: Any) -> None:
    """Note the contacts of a piece of body i with a box that is a collider: those of two bodies, but that they are on the
    surface of the box."""
    begin = k.number[0]
    touch_pieces(k, p, i, WORLD, s, o, margin, code)
    for c in range(begin, k.number[0]):
        for axis in range(3):
            k.point[axis, c] -= 0.5 * k.gap[c] * k.normal[axis, c]


@outlined
def piece_on_wall(wall: Any, k: Any, p: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """Note the contacts of a piece of body i with a collider through its gap and its normal."""
    if p.corners is not None:
        if s.kind == HULL:
            hull_on_wall(wall, k, p, i, s, margin, t, code)
            return
        if s.kind == CYLINDER or s.kind == CONE:
            round_on_wall(wall, k, i, s, margin, t, code)
            return
    if s.kind != BOX:
        core_on_wall(wall, k, i, s, margin, t, code)
    elif isinstance(wall.shape, BallRecord):
        c = wall.shape
        box_on_ball(c, (c.x, c.y, c.z), k, i, s, margin, code)
    elif isinstance(wall.shape, MovingRecord) and isinstance(wall.shape.shape, BallRecord):
        c, f = wall.shape.shape, frame_at(wall.shape, t, 0.0)
        away_from = (c.x - wall.shape.x, c.y - wall.shape.y, c.z - wall.shape.z)
        box_on_ball(c, plus((f.x, f.y, f.z), 1.0, out_of(f.rows, away_from)), k, i, s, margin, code)
    else:
        box_on_wall(wall, k, i, s, margin, t, code)


def core_on_wall(wall: Any, k: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """Contacts of a sphere or a capsule."""
    radius, x = s.size[0], s.x
    if s.kind == SPHERE:
        ball_on_wall(wall, k, i, x, radius, margin, t, code)
        return
    if isinstance(wall.shape, FLAT) and s.size[2] > 0:
        arc_on_wall(wall, k, i, s, margin, t, code)
        return
    u = half_axis(s)
    ball_on_wall(wall, k, i, plus(x, 1.0, u), radius, margin, t, code + 1)
    ball_on_wall(wall, k, i, plus(x, -1.0, u), radius, margin, t, code + 2)
    if not isinstance(wall.shape, FLAT):
        line_on_wall(wall, k, i, plus(x, -1.0, u), plus(x, 1.0, u), radius, margin, t, code + 3)


def arc_on_wall(wall: Any, k: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """The contact of the part of a ring that a capsule stands for: of the places around it, as many as there are parts,
    that go out from its lowest one, the one in this part. So a ring rolls on a circle."""
    axis = to_world(s.r, (1.0, 0.0, 0.0))
    half, center = ring_of(s)
    n = away(wall.shape, probe(center, 0.0, t))
    d = plus((-n[0], -n[1], -n[2]), dot(n, axis), axis)
    own, turn = to_body(s.r, d), 0.0
    if dot(d, d) >= LEANING * LEANING:
        turn = np.arctan2(own[2], own[1])
        turn -= 2 * half * np.floor(turn / (2 * half) + 0.5)
    at = to_world(s.r, (0.0, s.size[2] * np.cos(turn), s.size[2] * np.sin(turn)))
    point_on_wall(wall, k, i, plus(center, 1.0, at), s.size[0], margin, t, code)


def box_on_wall(wall: Any, k: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """Contacts of the corners of a box, and of its edges where the collider is not flat."""
    r, half, x = s.r, s.size, s.x
    for m in range(8):
        at = plus(x, 1.0, to_world(r, corner_of(half, m)))
        point_on_wall(wall, k, i, at, 0.0, margin, t, code + m)
    if not isinstance(wall.shape, FLAT):
        for edge in range(12):
            axis, first = edge // 4, first_corner(edge)
            one = plus(x, 1.0, to_world(r, corner_of(half, first)))
            two = plus(x, 1.0, to_world(r, corner_of(half, first + (1 << axis))))
            line_on_wall(wall, k, i, one, two, 0.0, margin, t, code + 8 + edge)
        face_on_wall(wall.shape, k, i, s, margin, t, code + 20)


def face_on_wall(shape: Any, k: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """The contact of a collider with the inside of a face of a box; corners and edges have been looked at."""
    half = s.size
    depth = DRAWN_IN * min(half[0], min(half[1], half[2]))
    y, last = (0.0, 0.0, 0.0), 0.0
    for _ in range(TURNS):
        p = probe(plus(s.x, 1.0, to_world(s.r, y)), 0.0, t)
        step = gap(shape, p) + depth
        z = plus(y, -step, to_body(s.r, away(shape, p)))
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
        inside_contact(shape, k, i, plus(s.x, 1.0, to_world(s.r, y)), margin, t, code)


def inside_contact(shape: Any, k: Any, i: Any, at: Any, margin: Any, t: Any, code: Any) -> None:
    """A contact of a place inside of a face."""
    p = probe(at, 0.0, t)
    distance = gap(shape, p)
    if distance < margin:
        n = away(shape, p)
        add_contact(k, i, WORLD, code, plus(at, -distance, n), n, distance)


# ---- hulls


def hull_on_wall(wall: Any, k: Any, p: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """Contacts of the corners of a hull, and of its edges and faces where the collider is not flat."""
    first = p.first_corner[s.number]
    for c in range(first, p.first_corner[s.number + 1]):
        point_on_wall(wall, k, i, corner(p, s, c), 0.0, margin, t, code + c - first)
    if not isinstance(wall.shape, FLAT):
        for e in range(p.first_edge[s.number], p.first_edge[s.number + 1]):
            one, two = corner(p, s, p.edges[0, e]), corner(p, s, p.edges[1, e])
            number = e - p.first_edge[s.number]
            line_on_wall(wall, k, i, one, two, 0.0, margin, t, code + OTHER + number)
        for f in range(p.first_face[s.number], p.first_face[s.number + 1]):
            polygon_on_wall(
                wall.shape, k, p, i, s, f, margin, t, code + OTHER // 2 + f - p.first_face[s.number]
            )


@outlined
def polygon_on_wall(
    shape: Any, k: Any, p: Any, i: Any, s: Any, f: Any, margin: Any, t: Any, code: Any
) -> None:
    """The contact of a collider with the inside of a face of a hull: steps down the gap, back onto the face."""
    n = to_world(s.r, (p.planes[0, f], p.planes[1, f], p.planes[2, f]))
    first, last = p.loop[f], p.loop[f + 1]
    y, size = (0.0, 0.0, 0.0), 1.0 / (last - first)
    for m in range(first, last):
        y = plus(y, size, corner(p, s, p.loops[m]))
    middle, wide = y, 0.0
    for m in range(first, last):
        d = minus(corner(p, s, p.loops[m]), middle)
        wide = max(wide, dot(d, d))
    wide = np.sqrt(wide)
    if not gap(shape, probe(middle, wide, t)) < margin:
        return
    depth = DRAWN_IN * wide
    for _ in range(TURNS):
        q = probe(y, 0.0, t)
        z = plus(y, -(gap(shape, q) + depth), away(shape, q))
        z = plus(z, -dot(minus(z, middle), n), n)
        z = onto_polygon(p, s, f, n, z)
        d = minus(z, y)
        y = z
        if dot(d, d) < 1e-24 * depth * depth:
            break
    # Its own place inside: near an edge that edge, or a corner, has the contact.
    room = wide
    for m in range(first, last):
        a, c = corner(p, s, p.loops[m]), corner(p, s, p.loops[m + 1 if m + 1 < last else first])
        out = cross(minus(c, a), n)
        room = min(room, dot(minus(a, y), out) / np.sqrt(dot(out, out)))
    if room > 0.01 * wide:
        inside_contact(shape, k, i, y, margin, t, code)


def onto_polygon(p: Any, s: Any, f: Any, n: Any, z: Any) -> Any:
    """The place of a face that is nearest to a place in its plane."""
    first, last = p.loop[f], p.loop[f + 1]
    inside, best, found = True, np.inf, z
    for m in range(first, last):
        a, c = corner(p, s, p.loops[m]), corner(p, s, p.loops[m + 1 if m + 1 < last else first])
        e, d = minus(c, a), minus(z, a)
        inside = inside and dot(cross(e, n), d) <= 0
        part = clamped(dot(d, e) / dot(e, e), 0.0, 1.0)
        near = plus(a, part, e)
        away_by = minus(z, near)
        if dot(away_by, away_by) < best:
            best, found = dot(away_by, away_by), near
    return z if inside else found


# ---- cylinders and cones


@outlined
def round_on_wall(wall: Any, k: Any, i: Any, s: Any, margin: Any, t: Any, code: Any) -> None:
    """Contacts of the rims of a cylinder, or of the rim and the tip of a cone; of the lines between them that look at the
    collider, and of the ends, where the collider is not flat."""
    axis = to_world(s.r, (0.0, 0.0, 1.0))
    low = plus(s.x, -s.size[1] if s.kind == CYLINDER else -0.25 * s.size[1], axis)
    high = plus(s.x, s.size[1] if s.kind == CYLINDER else 0.75 * s.size[1], axis)
    rim_on_wall(wall, k, i, s, low, axis, margin, t, code)
    if s.kind == CYLINDER:
        rim_on_wall(wall, k, i, s, high, axis, margin, t, code + AROUND)
    else:
        point_on_wall(wall, k, i, high, 0.0, margin, t, code + AROUND)
    if not isinstance(wall.shape, FLAT):
        if s.kind == CYLINDER:  # which an edge of the collider may meet between two of the lines
            line_on_wall(wall, k, i, low, high, s.size[0], margin, t, code + 2 * AROUND + 8)
        out = lowest(wall.shape, s, plus(low, 0.5, minus(high, low)), axis, t)
        side = cross(axis, out)
        for m in range(-2, 3):  # edges of meshes may be beside the first of them
            turn = m * np.pi / 8
            d = plus(
                (np.cos(turn) * out[0], np.cos(turn) * out[1], np.cos(turn) * out[2]), np.sin(turn), side
            )
            one = plus(low, s.size[0], d)
            two = plus(high, s.size[0] if s.kind == CYLINDER else 0.0, d)
            line_on_wall(wall, k, i, one, two, 0.0, margin, t, code + 2 * AROUND + 3 + m)
        end_on_wall(wall, k, i, s, low, axis, margin, t, code + 2 * AROUND + 6)
        if s.kind == CYLINDER:
            end_on_wall(wall, k, i, s, high, axis, margin, t, code + 2 * AROUND + 7)


def lowest(shape: Any, s: Any, center: Any, axis: Any, t: Any) -> Any:
    """The direction across an axis in which a circle about it comes nearest to a collider; the piece's own x direction where
    all of it is as near."""
    own = to_world(s.r, (1.0, 0.0, 0.0))
    out, at = own, center
    for _ in range(RIM):
        n = away(shape, probe(at, 0.0, t))
        d = plus((-n[0], -n[1], -n[2]), dot(n, axis), axis)
        length = np.sqrt(dot(d, d))
        if length < LEANING:
            return own
        out = (d[0] / length, d[1] / length, d[2] / length)
        at = plus(center, s.size[0], out)
    return out


@outlined
def rim_on_wall(
    wall: Any, k: Any, i: Any, s: Any, center: Any, axis: Any, margin: Any, t: Any, code: Any
) -> None:
    """Contacts of places around a circle, the first of them the lowest."""
    if not gap(wall.shape, probe(center, s.size[0], t)) < margin:
        return
    out = lowest(wall.shape, s, center, axis, t)
    side = cross(axis, out)
    for m in range(CORNERS):
        turn = 2 * np.pi * m / CORNERS
        d = (
            np.cos(turn) * out[0] + np.sin(turn) * side[0],
            np.cos(turn) * out[1] + np.sin(turn) * side[1],
            np.cos(turn) * out[2] + np.sin(turn) * side[2],
        )
        point_on_wall(wall, k, i, plus(center, s.size[0], d), 0.0, margin, t, code + m)


@outlined
def end_on_wall(
    wall: Any, k: Any, i: Any, s: Any, center: Any, axis: Any, margin: Any, t: Any, code: Any
) -> None:
    """The contact of a collider with the inside of a flat end, or with its rim where an edge meets that beside its lowest
    place."""
    shape, radius = wall.shape, s.size[0]
    if not gap(shape, probe(center, radius, t)) < margin:
        return
    y, depth = center, DRAWN_IN * radius
    for _ in range(TURNS):
        q = probe(y, 0.0, t)
        d = minus(plus(y, -(gap(shape, q) + depth), away(shape, q)), center)
        d = plus(d, -dot(d, axis), axis)
        size = np.sqrt(dot(d, d))
        z = plus(center, radius / size if size > radius else 1.0, d)
        d = minus(z, y)
        y = z
        if dot(d, d) < 1e-24 * depth * depth:
            break
    d = minus(y, center)
    if dot(d, d) < 0.98 * radius * radius:
        inside_contact(shape, k, i, y, margin, t, code)
    elif dot(d, lowest(shape, s, center, axis, t)) < BESIDE * radius:
        point_on_wall(wall, k, i, y, 0.0, margin, t, code)


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


def box_on_ball(c: Any, center: Any, k: Any, i: Any, s: Any, margin: Any, code: Any) -> None:
    """The contact of a box with a solid ball, whose centre is there now."""
    a = to_body(s.r, minus(center, s.x))
    distance = box_distance(s.size, a) - c.radius
    if distance < margin:
        n = to_world(s.r, box_normal(s.size, a))
        at = plus(center, -c.radius, n)
        add_contact(k, i, WORLD, code, at, (-n[0], -n[1], -n[2]), distance)
