"""What a component of rods touches at the end of a step, or is near to: its contacts (`contact_forces.Touch`)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.dents import dented
from particlesim.colliders.moving import MovingRecord, carried, lead_of
from particlesim.compiler import outlined
from particlesim.engine.constraints.contact_forces import FEW
from particlesim.engine.constraints.shake_rattle import ROUNDING
from particlesim.engine.state.columns import fetch, type_of
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.crossing import beyond
from particlesim.laws.registry import PASS, gap_and_normal, moved_to

WALLS, SAME_WALL = 3, 0.9
"""Walls of one collider that a particle may touch, as in a corner of a room; the cosine of the angle between two normals
from which on they are those of one wall."""

NOTICED, OFF = 16, 4.0
"""How many rounding errors of a place are a gap; from how many depths off a wall that is looked at."""


class Look(NamedTuple):
    """How contacts are looked for: the beginning of the step, and its time; the time of its end; the time by which impulses
    act on places, and the gap up to which a particle takes part [m]."""

    before: Any
    t: Any
    end: Any
    late: Any
    near: Any


def hard(contacts: Any) -> Any:
    """The colliders that do not yield."""
    return contacts.colliders if isinstance(contacts, Simple) else contacts.continuous + contacts.discrete


@outlined
def find_touch(parts: Any, rods: Any, c: Any, look: Any, k: Any) -> int:
    """The contacts of component k; how many there are, 0 if there are too many, or such that are not known here."""
    rig, touch, count = rods.rig, rods.blows.touch, 0
    first = rig.slots[k]
    for s in range(first, rig.slots[k + 1]):
        i = rig.rows[s]
        touch.first[s - first] = max(count, 0)
        if rig.inverse[s] > 0:
            for part in parts:
                if (part.first <= i) & (i < part.last):
                    for number, each in enumerate(hard(part.contacts)):
                        if count >= 0:
                            count = note_touch(each, number, rods, c, look, s, s - first, count)
    touch.first[rig.slots[k + 1] - first] = max(count, 0)
    return max(count, 0)


@outlined
def note_touch(each: Any, number: Any, rods: Any, c: Any, look: Any, s: Any, at: Any, count: Any) -> int:
    """Add contacts of slot s, which is slot `at` of its component, if it is near a collider, or near several walls of one;
    how many there are then, −1 if there is no room, or nothing to do with this collider."""
    own, free, touch, first = rods.blows.own, rods.blows.free, rods.blows.touch, count
    p = fetch(c, rods.rig.rows[s], look.end)
    x, y, z = (type_of(p.x, own[axis, s]) for axis in range(3))
    u = tuple(float(axis) for axis in lead_of(each.shape, (x, y, z), look.end))
    ways, several = (0.0, 0.0, 0.0), dented(each.shape)
    for turn in range(WALLS + 1 if several else 1):
        there = moved_to(
            p,
            x + type_of(x, ways[0]),
            y + type_of(x, ways[1]),
            z + type_of(x, ways[2]),
            p.vx,
            p.vy,
            p.vz,
            look.end,
        )
        found, normal = gap_and_normal(each, there)
        n = tuple(0.0 if axis is None else float(axis) for axis in normal)
        # Looked at from some way off a wall, the next one is nearest; and where two meet, one of them, not their edge.
        distance = float(found) - (n[0] * ways[0] + n[1] * ways[1] + n[2] * ways[2])
        above, need = distance, 0.0
        for axis in range(3):
            above += n[axis] * (free[axis, s] - own[axis, s])
            need += n[axis] * u[axis]
        new = min(distance, above) <= look.near and (turn > 0 or not several)
        for m in range(first, count):
            d = touch.normal
            new &= n[0] * d[0, m] + n[1] * d[1, m] + n[2] * d[2, m] < SAME_WALL
        if new:
            full = count == touch.need.shape[0] or count - touch.first[at] == FEW
            if full or each.response.outcome != PASS:
                return -1
            touch.slot[count], touch.collider[count] = at, number
            for axis in range(3):
                touch.normal[axis, count], touch.surface[axis, count] = n[axis], u[axis]
            size = ROUNDING * (abs(x) + abs(y) + abs(z))
            leaves, lands = leaving(rods, s, n, u, above, look.late, size)
            touch.need[count], touch.land[count] = need + leaves, need + lands
            touch.place[count] = n[0] * x + n[1] * y + n[2] * z - distance
            note_friction(each, touch, p, (x, y, z), count, look.end)
            if above > 0:
                touch.keep[count] = 1.0
            find_begun(each, touch, p, look, rods.rig.rows[s], count, ways)
            count += 1
        ways = tuple(way + 2 * look.near * axis for way, axis in zip(ways, n, strict=True))
    return int(count)


def leaving(rods: Any, s: Any, n: Any, u: Any, above: Any, late: Any, rounding: Any) -> Any:
    """The velocity along the normal n that slot s must have at least, relative to a surface that has the velocity u, and
    that which its place follows: what has been above the surface, by more than `rounding` [m], may come down to it."""
    own, free, met, arrives, leaves = rods.blows.own, rods.blows.free, False, 0.0, 0.0
    for axis in range(3):
        met |= own[3 + axis, s] != free[3 + axis, s]
        arrives += n[axis] * (free[3 + axis, s] - u[axis])
        leaves += n[axis] * (own[3 + axis, s] - u[axis])
    down = arrives - above / late if late > 0 else -np.inf
    if above > 0:
        least = min(0.0, down)
    elif met and arrives < 0:
        least = min(max(leaves, 0.0), -arrives)  # not as fast as at the impact, if it is slower now
    else:
        least = 0.0
    falls = late > 0 and late * (least - down) > NOTICED * rounding
    return least, (down if falls else least)


def note_friction(each: Any, touch: Any, p: Any, place: Any, m: Any, end: Any) -> None:
    """Note how the surface of contact m rubs, and what runs along it."""
    response = each.response
    touch.static[m], touch.kinetic[m], touch.keep[m] = 0.0, 0.0, 1.0
    if response.friction is not None:
        touch.static[m] = float(response.friction.static)
        touch.kinetic[m] = float(response.friction.kinetic)
    if response.loss > 0:
        touch.keep[m] = float(response.keep)
    if response.friction is not None or response.loss > 0:
        runs = carried(each.shape, response.belt, end, place[0])
        if runs is not None:
            for axis, run in enumerate(runs):
                touch.surface[axis, m] += float(run)


@outlined
def find_begun(each: Any, touch: Any, p: Any, look: Any, i: Any, m: Any, ways: Any) -> None:
    """Note the normal that the surface of contact m had where its particle began the step, if it lay there; else its own.
    Along the mean of both a bent surface gives no energy: v·n₀ = 0 and V·n = 0 are that of (v + V)·(n₀ + n)."""
    n = touch.normal[0, m], touch.normal[1, m], touch.normal[2, m]
    begun: Any = n
    if not isinstance(each.shape, MovingRecord):
        x, y, z = (look.before[axis, i] + type_of(p.x, ways[axis]) for axis in range(3))
        found, normal = gap_and_normal(each, moved_to(p, x, y, z, p.vx, p.vy, p.vz, look.t))
        first = tuple(0.0 if axis is None else float(axis) for axis in normal)
        same = first[0] * n[0] + first[1] * n[1] + first[2] * n[2] > SAME_WALL
        distance = float(found) - (first[0] * ways[0] + first[1] * ways[1] + first[2] * ways[2])
        begun = tuple(a if same and distance <= look.near else b for a, b in zip(first, n, strict=True))
    for axis in range(3):
        touch.begun[axis, m] = begun[axis]


@outlined
def find_depths(parts: Any, rods: Any, c: Any, k: Any, end: Any) -> Any:
    """Ask for every contact of component k that it be put out of its collider: by how much [m], in place of a velocity. The
    greatest depth, and how much is but rounding."""
    rig, touch, size, deepest = rods.rig, rods.blows.touch, 0.0, 0.0
    first = rig.slots[k]
    for m in range(touch.first[rig.slots[k + 1] - first]):
        i = rig.rows[first + touch.slot[m]]
        for part in parts:
            if (part.first <= i) & (i < part.last):
                for number, each in enumerate(hard(part.contacts)):
                    if number == touch.collider[m]:
                        touch.goal[m] = depth_in(each, rods, c, first + touch.slot[m], m, end)
        deepest = max(deepest, touch.goal[m])
        size = max(size, abs(c.x[i]), abs(c.y[i]), abs(c.z[i]), abs(touch.place[m]))
    return deepest, ROUNDING * size


@outlined
def depth_in(each: Any, rods: Any, c: Any, s: Any, m: Any, end: Any) -> float:
    """How deep slot s is in the collider of contact m [m], below where contact by itself has left it; negative outside. The
    normal is that of the surface where it is, unless it is behind that."""
    touch, own = rods.blows.touch, rods.blows.own
    d, q = touch.normal, fetch(c, rods.rig.rows[s], end)
    x, y, z = (type_of(q.x, own[axis, s]) for axis in range(3))
    p = moved_to(q, x, y, z, q.vx, q.vy, q.vz, end)
    found, normal = gap_and_normal(each, q)
    behind = beyond((each,), p, q, type_of(q.x, ROUNDING) * (abs(q.x) + abs(q.y) + abs(q.z) + q.r))
    if found >= 0 and not behind:
        return float(-found)
    depth, size = float(-found), abs(q.x) + abs(q.y) + abs(q.z)
    if dented(each.shape):
        # Beyond a corner of walls nearly anything is normal; on its own side of a wall that is nearest, if no other one is.
        off = OFF * depth + NOTICED * ROUNDING * size
        x, y, z = (float(a) + off * d[axis, m] for axis, a in enumerate((q.x, q.y, q.z)))
        there = moved_to(q, type_of(q.x, x), type_of(q.x, y), type_of(q.x, z), q.vx, q.vy, q.vz, end)
        found, normal = gap_and_normal(each, there)
        n = tuple(0.0 if axis is None else float(axis) for axis in normal)
        depth = off * (n[0] * d[0, m] + n[1] * d[1, m] + n[2] * d[2, m]) - float(found)
    else:
        n = tuple(0.0 if axis is None else float(axis) for axis in normal)
    if behind or n[0] * d[0, m] + n[1] * d[1, m] + n[2] * d[2, m] < SAME_WALL:
        return float(touch.place[m] - (d[0, m] * q.x + d[1, m] * q.y + d[2, m] * q.z))
    for axis in range(3):
        d[axis, m] = n[axis]
    touch.place[m] = n[0] * q.x + n[1] * q.y + n[2] * q.z + depth
    return float(depth)
