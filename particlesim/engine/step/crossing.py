"""Whether the path of a step crosses a collider, such as a ball or a thin sheet: a parabola, or a chord when it slides."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord, alight, ride
from particlesim.colliders.parts import IntersectionRecord, UnionRecord
from particlesim.colliders.response import at_rest, crossable, opposite
from particlesim.colliders.way import place_on, way_of
from particlesim.compiler import outlined
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.contacts import MANY, Careful, Simple, by_calls, farther, nowhere
from particlesim.laws.registry import apart, bend, first_contact, gap, moved_to, normal, side_from

EPSILON = {float: 2.0**-52, np.float64: 2.0**-52, np.float32: 2.0**-23}
"""The rounding error of 1 in each precision."""

EVEN = 2.0**-20
"""How far a velocity may be from that of an even way, in parts of it."""


def all_apart(colliders: Any, on: Any, p: Any, q: Any, h: Any, slack: Any, alone: bool = False) -> Any:
    """Whether a step of h from p to q is sure to cross no collider but those on which the particle lies; `alone` as in
    `inside`."""
    if len(colliders) == 0:
        return True
    others = all_apart(colliders[1:], on[1:], p, q, h, slack, alone)
    if alone and on[0]:
        return others
    return others & (apart(colliders[0], p, q, h, slack) | on[0]) if crossable(colliders[0]) else others


def first_crossing(colliders: Any, on: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    """The part of a step of h from p to q after which it first is inside of a collider, 1 where it is not before its end,
    and the particle there. What a particle lies on it does not cross."""
    if len(colliders) == 0:
        return type_of(p.x, 1), q
    first, there = first_crossing(colliders[1:], on[1:], p, q, h, slack)
    if not crossable(colliders[0]):
        return first, there
    s = type_of(p.x, 1)
    if not on[0]:
        s = min(first_contact(colliders[0], p, q, h, slack), s)
    place = met(colliders[0], p, q, h, s)
    sooner = s < first
    there = moved_to(
        q,
        place.x if sooner else there.x,
        place.y if sooner else there.y,
        place.z if sooner else there.z,
        q.vx,
        q.vy,
        q.vz,
        q.t,
    )
    return min(s, first), there


def met(c: Any, p: Any, q: Any, h: Any, s: Any) -> Any:
    """The particle after the part s of the way on which it meets a collider: its parabola in the frame of that."""
    if isinstance(c.shape, MovingRecord):
        local = ride(c.shape, p)
        there = place_on(way_of(local, ride(c.shape, q), h), local, s)
        there = moved_to(there, there.x, there.y, there.z, there.vx, there.vy, there.vz, p.t + h * s)
        return alight(c.shape, there)
    return place_on(way_of(p, q, h), p, s)


def turned_away(colliders: Any, p: Any, q: Any) -> Any:
    """Whether p and q, which are close to each other, are on different sides of a thin collider that q is inside of."""
    if len(colliders) == 0:
        return False
    others = turned_away(colliders[1:], p, q)
    if not crossable(colliders[0]):
        return others
    return others | ((gap(colliders[0], q) < 0) & opposite(colliders[0], p, q))


def straight(p: Any, q: Any, h: Any) -> Any:
    """The particle p with the velocity that leads straight to q in a time h: the way of what glides."""
    k = type_of(h, 1) / h
    return moved_to(p, p.x, p.y, p.z, k * (q.x - p.x), k * (q.y - p.y), k * (q.z - p.z), p.t)


def even(p: Any, q: Any, h: Any) -> Any:
    """Whether a glide of h from p to q is along the parabola through both with the velocity of p, as along what is flat, or,
    of a method of first order, the straight line with that of q."""
    k = type_of(h, 1) / h
    x, y, z = (k * (b - a) for a, b in zip((p.x, p.y, p.z), (q.x, q.y, q.z), strict=True))
    off = abs(x - q.vx) + abs(y - q.vy) + abs(z - q.vz)
    return _bent_evenly(p, q, h) | (off <= type_of(h, EVEN) * (abs(x) + abs(y) + abs(z)))


def _bent_evenly(p: Any, q: Any, h: Any) -> Any:
    """The first of these: the velocity of q is that of the end of the parabola."""
    k = type_of(h, 2) / h
    x, y, z = (k * (b - a) for a, b in zip((p.x, p.y, p.z), (q.x, q.y, q.z), strict=True))
    off = abs(x - p.vx - q.vx) + abs(y - p.vy - q.vy) + abs(z - p.vz - q.vz)
    return off <= type_of(h, EVEN) * (abs(x) + abs(y) + abs(z))


@outlined
def through(c: Any, p: Any, q: Any, slack: Any) -> Any:
    """The part of the straight way from p to q, each at its own time, after which it leads into a collider to come out of
    its other side, in the frame of one that moves; 1 where it does not."""
    one = type_of(p.x, 1)
    if not crossable(c):
        return one
    if isinstance(c.shape, MovingRecord):
        a, e = ride(c.shape, p), ride(c.shape, q)
        return _through(c.shape.shape, straight(a, e, one), e, slack)
    return _through(c.shape, straight(p, q, one), q, slack)


def _through(shape: Any, p: Any, q: Any, slack: Any) -> Any:
    """`through` of a shape, for a way in a time of 1. Of what is put together each part has its own other side."""
    if isinstance(shape, UnionRecord):
        return min(*[_through(part, p, q, slack) for part in shape.parts])
    one = type_of(p.x, 1)
    if apart(shape, p, q, one, slack) or not _behind(shape, p, q, slack):
        return one
    return min(first_contact(shape, p, q, one, slack), one)


def _behind(shape: Any, p: Any, q: Any, slack: Any) -> Any:
    """Whether q is on the other side of a shape than p."""
    if isinstance(shape, IntersectionRecord):
        return (side_from(shape, p, q)[0] < -slack) & ((gap(shape, q) >= -slack) | opposite(shape, p, q))
    return opposite(shape, p, q)


def beyond(colliders: Any, p: Any, q: Any, slack: Any) -> Any:
    """Whether the straight way from p to q leads through something thin."""
    found = False
    for c in colliders:
        found = found or through(c, p, q, slack) < 1
    return found


LONGER = 1.1
"""The square of how much longer than at the faster of its ends a particle may have come in a step."""

# What discrete detection does not see


def passable(contacts: Any) -> Any:
    """The colliders that a particle may pass within a step without being seen: their ends alone are looked at."""
    discrete = contacts.colliders if isinstance(contacts, Simple) else contacts.discrete
    return tuple(c for c in discrete + contacts.soft if crossable(c))


def _noise(p: Any, q: Any, h: Any) -> Any:
    """Gaps that are nothing but rounding errors in a step from p to q, whose end is a place as good as its beginning [m]."""
    here, there = abs(p.x) + abs(p.y) + abs(p.z), abs(q.x) + abs(q.y) + abs(q.z)
    return type_of(h, 64 * EPSILON[type(h)]) * (max(here, there) + p.r)


def _seen_way(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """The particle p with the velocity of the way that a step of h to q is taken to go: its parabola, or, where impacts
    may have bent it, the straight line."""
    if isinstance(contacts, Careful) and len(contacts.continuous) > 0:
        return straight(p, q, h)
    return p


def may_pass(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """Whether the way of a step of h from p to q may lead through a collider that does not see it: a quick look."""
    colliders = passable(contacts)
    return not all_apart(colliders, nowhere(colliders), _seen_way(contacts, p, q, h), q, h, _noise(p, q, h))


@outlined
def crossings(contacts: Any, p: Any, q: Any, h: Any) -> int:
    """How many colliders a step of h from p to q has led through: from outside to outside without a touch, or to the far
    side of what it was found in at its end, from where it was put out there."""
    number = 0
    slack, begin = _noise(p, q, h), _seen_way(contacts, p, q, h)
    for c in passable(contacts):
        near = gap(c, p) >= -slack and not apart(c, begin, q, h, slack)
        through = near and first_contact(c, begin, q, h, slack) < 1
        if through and (gap(c, q) > slack or opposite(c, p, q)):
            number += 1
    return number


# What a step with impacts has led through


def thin(contacts: Any) -> Any:
    """The continuous colliders that a way may cross."""
    return () if isinstance(contacts, Simple) else tuple(c for c in contacts.continuous if crossable(c))


@outlined
def passed(contacts: Any, p: Any, q: Any, h: Any) -> int:
    """How many convex continuous colliders a step of h from p to q, with impacts on the way or none, has led through for
    sure: both ends are outside, on opposite sides, and no way around the rim is as short as the particle came."""
    number = 0
    slack = _noise(p, q, h)
    for c in thin(by_calls(contacts)):
        a, e, still = p, q, c
        if isinstance(c.shape, MovingRecord):
            a, e, still = ride(c.shape, p), ride(c.shape, q), at_rest(c)
        begin = straight(a, e, h)
        outside = bend(still.shape) > 0 and gap(still, a) >= -slack and gap(still, e) > slack
        if outside and not apart(still, begin, e, h, slack):
            s = first_contact(still, begin, e, h, slack)
            there = place_on(way_of(begin, e, h), begin, s)
            if s < 1 and opposite(still, a, e) and _wide(still, a, e, there, h):
                number += 1
    return number


@outlined
def _wide(c: Any, p: Any, q: Any, there: Any, h: Any) -> bool:
    """Whether a thin collider reaches so far around a place of the straight way from p to q that a particle cannot have gone
    around it in a time h. A way of length L between places at a distance d comes no farther than b = √(L² − d²)/2 from the
    line between them; in the plane of the sheet, to which that is inclined, b over the cosine. A convex solid that holds
    four places at √2 times that, crosswise, holds all of the circle."""
    one, zero = type_of(h, 1), p.x - p.x
    nx, ny, nz = (zero if axis is None else axis for axis in normal(c, p))
    dx, dy, dz = q.x - p.x, q.y - p.y, q.z - p.z
    fast = max(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz, q.vx * q.vx + q.vy * q.vy + q.vz * q.vz)
    most = type_of(h, LONGER) * h * h * fast
    way = dx * dx + dy * dy + dz * dz
    across = abs(dx * nx + dy * ny + dz * nz)
    far = np.sqrt(max(most - way, zero) * way / 2) / across
    if not across > 0:
        return False
    lies = abs(ny) < type_of(h, 0.5)
    ux, uy, uz = (nz if lies else -ny, zero if lies else nx, -nx if lies else zero)
    k = far / np.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = k * ux, k * uy, k * uz
    near, holds = far / 64 + _noise(p, q, h), True
    for turn in range(4):
        i, j = (one if turn < 2 else -one), (one if turn % 2 == 0 else -one)
        x = i * ux + j * (ny * uz - nz * uy)
        y = i * uy + j * (nz * ux - nx * uz)
        z = i * uz + j * (nx * uy - ny * ux)
        half = type_of(h, 0.5 * 2**0.5)
        beside = moved_to(
            p, there.x + half * x, there.y + half * y, there.z + half * z, zero, zero, zero, p.t
        )
        holds &= gap(c, beside) < near
    return holds


def crossing(contacts: Any, on: Any, p: Any, q: Any, h: Any) -> Any:
    """When a step of h from p to q first crosses a collider, h where it does not, and where that is."""
    if not any(crossable(c) for c in contacts.continuous):
        return h, q
    return (_crossing_many if len(contacts.continuous) > MANY else _crossing)(contacts, on, p, q, h)


@outlined
def _crossing_many(contacts: Any, on: Any, p: Any, q: Any, h: Any) -> Any:
    return _crossing(contacts, on, p, q, h)


def _crossing(contacts: Any, on: Any, p: Any, q: Any, h: Any) -> Any:
    chord = straight(p, q, h)
    if not any(on) or _bent_evenly(p, q, h):
        chord = moved_to(p, p.x, p.y, p.z, p.vx, p.vy, p.vz, p.t)
    s, place = first_crossing(contacts.continuous, on, chord, q, h, farther(contacts, p, q))
    return h * s, place
