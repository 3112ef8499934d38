"""How a collider bends along the way of what lies on it, and how rims roll.

What lies on a hollow surface and goes along it with the velocity u has to turn with it. From the middle of one step to that
of the next, h later, it goes straight on; the normal n has turned against it by then. So in the middle of a step a place of
the body that stays on the surface comes up with u·n = −b and leaves with u·n = b,

    b = −h/2 (d(n·u)/dt + n·(ω × (ω × r))),

with u relative to the surface, whose change is that along a straight way, and the last term for what its own turning with ω
takes, a place r away from the centre. On the inside of a sphere of radius R that is u² h/(2R). With u·n = 0 instead it would
lose a part (u h/R)²/2 of its energy in a step. Where the surface bends away it has a gap to fall into.

What rolls there has an axis that does not turn from one middle to the next, while the normal turns by Δn: it slips by
σ = ρ ω × Δn/2 after the impulses of each, and by −σ before those of the next one, with ρ the radius at the contact. So
friction, which turns the axis, does no work. With no slip at all it takes some, of first order in h.

So it is on planes with a corner about which a body tips, and with a rim that rolls, as that of a coin, whose lowest place
goes around it: freely that place would have another velocity in the middle of the next step, by Δ. It has −Δ/2 after
impulses, along the plane and across it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.bodies.pieces import BOX, CAPSULE, CONE, CYLINDER, HULL, SPHERE
from particlesim.colliders.disc import DiscRecord
from particlesim.colliders.mesh import MeshRecord
from particlesim.colliders.moving import MovingRecord, frame_at, surface_velocity
from particlesim.colliders.rectangle import RectangleRecord
from particlesim.colliders.sphere import BallRecord
from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import FEATURES, orientation, place, row
from particlesim.engine.rigid.box_walls import is_box, is_room
from particlesim.engine.rigid.manifold import LEANING, SPAN
from particlesim.engine.rigid.narrow import entry, minus, plus
from particlesim.engine.rigid.pieces import ring_of, solid_of
from particlesim.engine.rigid.point_walls import FLAT
from particlesim.engine.rigid.probing import away, probe
from particlesim.engine.rigid.rotation import (
    angular_velocity,
    cross,
    dot,
    matrix,
    to_body,
    to_world,
    turned_freely,
)

STRAIGHT = (*FLAT, BallRecord, DiscRecord, MeshRecord, RectangleRecord)
"""Shapes of flat sides, and what is round outside only."""
UNEVEN = 0.25
"""By how much normals may turn more on one half of the way than on the other, as a part of all, on a surface that bends:
else there is an edge or a corner."""
PART_OF_TURN = 0.4
"""Square of the turn of the normal on each half of the way, at most, over that of all of it: a quarter where it is even."""
KEEPS = 0.9
"""Part that is kept of a speed by which something comes up to a surface a little faster than by its bend."""
LOWEST = 0.01
"""How far the place of a contact may be from the lowest one of a rim, as a part of its radius."""
EDGE = 2
"""Contacts of what tips about an edge, at most."""
LYING = 0.5
"""Cosine of the angle between the axis of a cylinder and the normal, below which it may roll there."""


def bends(shape: Any) -> bool:
    """Whether a collider may be hollow somewhere without an edge."""
    if is_box(shape) or is_room(shape):
        return False
    if isinstance(shape, MovingRecord):
        return not isinstance(shape.shape, STRAIGHT)
    return not isinstance(shape, STRAIGHT)


def note_bends(scene: Any, shape: Any, b: Any, k: Any, i: Any, begin: Any, t: Any, h: Any) -> None:
    """Note how a collider bends along the way of body i in a step of h, the middle of which is at t, at its contacts from
    `begin` on: b and σ. What joints do to that is taken off later (`swinging`)."""
    joined, closed = scene.joints is not None and scene.joined[i] > 0, 0
    for c in range(begin, k.number[0]):
        closed += 1 if k.gap[c] <= scene.slop else 0
    for c in range(begin, k.number[0]):
        if bends(shape):
            note_bend(shape, b, k, i, c, t, h)
        elif isinstance(shape, FLAT) and not joined and may_tip(b, k, c, closed):
            note_roll(b, k, i, c, closed, h)


def may_tip(b: Any, k: Any, c: Any, closed: Any) -> bool:
    """Whether a body with so many closed contacts on a plane may roll or tip there: most boxes stand, or have not come."""
    return bool(b.pieces.kind[piece_of(b, k, c)] not in (BOX, HULL) or 0 < closed <= EDGE)


@outlined
def note_bend(shape: Any, b: Any, k: Any, i: Any, c: Any, t: Any, h: Any) -> None:
    """The same at contact c."""
    n = row(k.normal, c)
    at = place_of(b, k, c)
    arm = minus(at, place(b, i))
    turning = angular_velocity(orientation(b, i), row(b.spin, i), row(b.inertia, i))
    u = plus(row(b.v, i), 1.0, cross(turning, arm))
    slides = slides_at(shape, at, u, t)
    if not dot(slides, slides) > 0:
        return
    # It has come from where it was in the middle of the last step, and goes off as it has come.
    out = dot(slides, n)
    parts = plus(u, -2 * out, n)
    behind, ahead = plus(at, -h, u), plus(at, h, parts)
    was, then = away(shape, probe(behind, 0.0, t - h)), away(shape, probe(ahead, 0.0, t + h))
    one = out - dot(slides_at(shape, behind, u, t - h), was)
    two = out + dot(slides_at(shape, ahead, parts, t + h), then)
    bend = -0.25 * (one + two) - 0.5 * h * dot(n, cross(turning, cross(turning, arm)))
    if bend > 0 and abs(two - one) <= UNEVEN * abs(one + two) and is_one_turn(was, n, then):
        k.bend[c] = bend
        away_from = minus(row(k.point, c), at)
        size = np.sqrt(dot(away_from, away_from))
        slip = cross(turning, minus(then, was))
        out = dot(slip, n)
        for axis in range(3):
            k.slip[axis, c] = 0.25 * size * (entry(slip, axis) - out * k.normal[axis, c])
        if isinstance(shape, MovingRecord):  # its lead is in that
            lead = dot(row(k.lead, c), n)
            for axis in range(3):
                k.lead[axis, c] -= lead * k.normal[axis, c]


def is_one_turn(was: Any, n: Any, then: Any) -> bool:
    """Whether a normal is about half-way between two others, as on a surface that bends. Beside an edge or in a corner the
    others are those of another side."""
    one, two, all_of_it = minus(n, was), minus(then, n), minus(then, was)
    most = PART_OF_TURN * dot(all_of_it, all_of_it)
    return bool(dot(one, one) <= most and dot(two, two) <= most)


@outlined
def note_roll(b: Any, k: Any, i: Any, c: Any, closed: Any, h: Any) -> None:
    """Note how a body rolls or tips on a plane at contact c, one of so many that are `closed`: by how much the velocity of
    the place that touches would change freely in a step of h. It comes up with half of that, and goes on with half of it the
    other way. What stands on more than an edge does not tip."""
    n, q, spin, inertia = row(k.normal, c), orientation(b, i), row(b.spin, i), row(b.inertia, i)
    r = matrix(q)
    s = solid_of(b.pieces, piece_of(b, k, c), place(b, i), r)
    rim, ball, center = foot_of(s, core_of(b, k, c), n)
    if s.kind == SPHERE or rim < 0 or (rim == 0 and closed > EDGE):
        return
    own, own_axis = to_body(r, minus(center, place(b, i))), to_body(r, axis_of(s))
    change = (0.0, 0.0, 0.0)
    for side in range(2):
        sign = 1.0 - 2.0 * side
        then = turned_freely(q, spin, inertia, sign * h)
        r = matrix(then)
        at = plus(to_world(r, own), -ball, n)
        if rim > 0:
            at = plus(at, rim, down_across(n, to_world(r, own_axis)))
        change = plus(change, 0.5 * sign, cross(angular_velocity(then, spin, inertia), at))
    up = dot(change, n)
    for axis in range(3):
        k.slip[axis, c] = -0.5 * (entry(change, axis) - up * k.normal[axis, c])
    k.bend[c] = -0.5 * up


def foot_of(s: Any, core: Any, n: Any) -> Any:
    """What a piece stands on at a contact on a plane with the normal n: the radius of a rim whose lowest place is at `core`,
    0 for what keeps its place in the body, less than 0 for other places of rims, which change all the time; the radius about
    that; and the centre of the rim, or the place."""
    axis, at, size, ball = axis_of(s), core, 0.0, 0.0
    if s.kind == CAPSULE:
        ball = s.size[0]
        if s.size[2] > 0:
            _, at = ring_of(s)
            size = s.size[2]
    elif s.kind in (CYLINDER, CONE):
        size, at = s.size[0], plus(s.x, dot(minus(core, s.x), axis), axis)
        out = minus(core, at)
        size = size if dot(out, out) > 0.25 * size * size else 0.0  # else it is a tip
    across = dot(n, axis)
    if not (size > 0 and 1 - across * across > LEANING * LEANING):
        return 0.0, ball, core
    off = minus(core, plus(at, size, down_across(n, axis)))
    return (size if dot(off, off) <= LOWEST * LOWEST * size * size else -1.0), ball, at


def axis_of(s: Any) -> Any:
    """The axis of a piece, or of the ring that it is a part of."""
    return to_world(s.r, (1.0, 0.0, 0.0) if s.kind == CAPSULE else (0.0, 0.0, 1.0))


def down_across(n: Any, axis: Any) -> Any:
    """The direction across an axis that goes down most."""
    d = plus((-n[0], -n[1], -n[2]), dot(n, axis), axis)
    size = np.sqrt(dot(d, d))
    return d[0] / size, d[1] / size, d[2] / size


def slides_at(shape: Any, at: Any, u: Any, t: Any) -> Any:
    """A velocity relative to that of a collider at a place and a time."""
    if isinstance(shape, MovingRecord):
        return minus(u, surface_velocity(shape, frame_at(shape, t, 0.0), at[0], at[1], at[2]))
    return u


def leaves_with(bend: Any, approach: Any) -> Any:
    """The speed with which what has come up to a surface that bends leaves it, so that it stays there: no faster than it has
    come, and nearly as fast where it has come a little faster than by the bend, as what forces make faster does."""
    more = approach - bend
    if more < 0:
        return max(approach, 0.0)
    return bend + KEEPS * more if more < bend else bend


def place_of(b: Any, k: Any, c: Any) -> Any:
    """The corner of a body, or the place about which it may roll, at its contact c with a collider."""
    i, at = k.first[c], core_of(b, k, c)
    number = piece_of(b, k, c)
    if b.pieces.kind[number] in (CYLINDER, CONE):
        s = solid_of(b.pieces, number, place(b, i), matrix(orientation(b, i)))
        axis = to_world(s.r, (0.0, 0.0, 1.0))
        if abs(dot(row(k.normal, c), axis)) < LYING:
            return plus(s.x, dot(minus(at, s.x), axis), axis)
    return at


def core_of(b: Any, k: Any, c: Any) -> Any:
    """The corner of a body, or the place about which it has its radius, at its contact c with a collider."""
    number, p = piece_of(b, k, c), b.pieces
    radius = p.size[0, number] if p.kind[number] in (SPHERE, CAPSULE) else 0.0
    return plus(row(k.point, c), k.gap[c] + radius, row(k.normal, c))


def piece_of(b: Any, k: Any, c: Any) -> int:
    """The number of the piece of the first body at contact c."""
    return int(b.pieces.first[b.group[k.first[c]]] + (k.feature[c] % FEATURES) // SPAN)
