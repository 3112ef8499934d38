"""Forces of the pairs of a chunk, and the memory of their contacts.

Some pairs at a time are tested; those that touch are gathered, computed in vectors, some contacts at once, and added to the
forces of the chunk, in the order of the list, which depends on the state alone. What the law reads of a member is one row of
an array, and so is the memory of a contact: in a large heap, which fits into no cache, a contact costs as many cache lines
as it has rows.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import lanes, on_stack, outlined, prefetch
from particlesim.engine.interactions.contact_lists import KNOWN
from particlesim.engine.interactions.neighbours.record import FAR, GROUP, IMAGE_SHIFT, MOST
from particlesim.engine.interactions.pair_blocks import Block
from particlesim.engine.interactions.pressing import Held, Rolling, Turning, dot, inverse_length, press
from particlesim.engine.interactions.touching import normal_of, touching
from particlesim.engine.state.columns import type_of
from particlesim.interactions.contact import JkrRecord, stretch
from particlesim.laws.contact import touch
from particlesim.laws.pair import Pair

BATCH = 64
"""Pairs that are tested, gathered and worked out together."""
ABREAST = 2
"""Vectors of contacts that are worked out at a time: of one alone, roots and slides wait for each other most of the time."""
AT_ONCE = 8
"""Pairs of the next batch that are asked for with some contacts."""
GAP = 1e-9
"""Part of the radii by which centres that coincide count as apart, along x, away from the one with the larger row."""
PLACE, MOTION, TURN, ANGLE = 0, 4, 8, 12
"""In `rows`, of every member: x, y, z, r; v, 1/m; ω; the angle turned since the step began. The last two where it
spins."""
QUAD = 4
TORQUE = 4
"""In `pull`: three forces, then three torques, as in `rows`."""


# What is made of a chunk


class Sum(NamedTuple):
    """Forces and torques."""


class Settle(NamedTuple):
    """Forces and torques, and what contacts remember."""


class Energies(NamedTuple):
    """Elastic energies, half to each of a pair."""


class Powers(NamedTuple):
    """Powers of all forces but the elastic push, half to each of a pair."""


class Virial(NamedTuple):
    """l ⊗ f, half for each of a pair, added to `out` [9]."""

    out: Any

    def add(self, part: Any, way: Any, force: Any) -> None:
        """A part of a pair's."""
        for i in range(3):
            for j in range(3):
                self.out[3 * i + j] += part * float(way[i]) * float(force[j])


class Gathered(NamedTuple):
    """What is seen of some pairs, four numbers each [BATCH, 4]: l and r₁; v and r₂; Ω and 1/m₁; A and 1/m₂; ω₁ − ω₂;
    α₁ − α₂; and what they remember, the anchor and the way rolled; None where the law does not look at it."""

    way: Any
    speed: Any
    turn: Any
    angle: Any
    spun: Any
    bent: Any
    anchor: Any
    rolled: Any


class Found(NamedTuple):
    """The results, as in `Gathered`: the force and a number, the twist, the moment, and the new memory."""

    force: Any
    twist: Any
    moment: Any
    anchor: Any
    rolled: Any


def seen_in(rows: Any, seen: Block) -> Block:
    """The columns of members that the law reads, as a `Block` with numbers in rows; positions are not among them."""
    light, r, v = rows[:, MOTION + 3], rows[:, 3], rows[:, MOTION : MOTION + 3].T
    return seen._replace(vx=v[0], vy=v[1], vz=v[2], m=None, r=r, a=light)


def turning_in(each: Any, c: Any) -> Any:
    """Columns of how members turn, and where in their rows that goes."""
    if each.turns is None:
        return ()
    s = c.spin
    turns, angles = (s.wx, s.wy, s.wz), (s.ax, s.ay, s.az)
    return tuple((column, each.rows[:, TURN + axis]) for axis, column in enumerate(turns)) + tuple(
        (column, each.rows[:, ANGLE + axis]) for axis, column in enumerate(angles)
    )


def room_for(each: Any, kind: Any) -> Any:
    """Room for a batch: `Gathered`, `Found`, and where the pairs are in the lists."""
    memory, one = each.lists.memory, [on_stack(BATCH, QUAD, kind) for _ in range(13)]
    spins, rolls = each.turns is not None, memory is not None and memory.rolled is not None
    given = Gathered(
        one[0],
        one[1],
        one[2],
        one[3],
        one[4] if rolls else None,
        one[5] if rolls else None,
        None if memory is None else one[6],
        one[7] if rolls else None,
    )
    found = Found(
        one[8],
        one[9] if spins else None,
        one[10] if rolls else None,
        None if memory is None else one[11],
        one[12] if rolls else None,
    )
    for rows in given:
        if rows is not None:
            for b in range(BATCH):
                for k in lanes(QUAD):
                    rows[b, k] = 1
    return given, found, on_stack(3, BATCH, np.int64)


def wide(kind: Any) -> Any:
    """Contacts that are worked out together: numbers of the widest vectors, ABREAST."""
    return ABREAST * (2 * GROUP if kind == np.float32 else GROUP)


def part_of(rows: Any, first: Any, count: Any) -> Any:
    """Some of a batch."""
    return type(rows)(*[None if each is None else each[first : first + count] for each in rows])


@outlined
def take_pairs(each: Any, first: Any, last: Any, spare: Any, what: Any, shifted: Any, ago: Any) -> Any:
    """The pairs of places [first, last) of a chunk, in a step that began `ago` [s]; the forces on particles of other chunks
    go to row `spare` of `pull`."""
    lists, near, rows = each.lists, each.near, each.rows
    memory = lists.memory
    given, found, at = room_for(each, near.x.dtype)
    some = wide(near.x.dtype)
    begin = lists.begin[first // GROUP]
    end, total = lists.begin[last // GROUP - 1] + lists.count[last // GROUP - 1], 0.0
    for lo in range(begin, end, BATCH):
        count = 0
        for e in range(lo, min(lo + BATCH, end)):
            i, j = lists.first[e], lists.second[e]
            q = j & (MOST - 1)
            dx, dy, dz = rows[i, 0] - rows[q, 0], rows[i, 1] - rows[q, 1], rows[i, 2] - rows[q, 2]
            reach = rows[i, 3] + rows[q, 3]
            if isinstance(each.law, JkrRecord):
                one, other = rows[i, 3], rows[q, 3]
                reach += stretch(each.law, one * other / reach) if memory.anchor[e, KNOWN] > 0 else one - one
            if shifted:
                image = j >> IMAGE_SHIFT
                dx -= type_of(dx, near.images[0, image])
                dy -= type_of(dx, near.images[1, image])
                dz -= type_of(dx, near.images[2, image])
            hit = dx * dx + dy * dy + dz * dz < reach * reach
            if near.part is not None:
                hit = hit & (rows[i, 0] < FAR)
            at[0, count], at[1, count], at[2, count] = e, i, j
            count += 1 if hit else 0
            if isinstance(what, Settle) and memory is not None:
                memory.anchor[e, KNOWN] *= 1 if hit else 0  # APART, without a branch
        for k in range(count):
            ask_for(each, lo + BATCH + k, end)
            gather(each, given, k, at[0, k], at[1, k], at[2, k], shifted)
        asked = count
        for b in range((count + some - 1) // some):
            for k in range(asked, min(asked + AT_ONCE, BATCH)):
                ask_for(each, lo + BATCH + k, end)
            asked += AT_ONCE
            part, out = part_of(given, some * b, some), part_of(found, some * b, some)
            for i in lanes(some, ABREAST):
                work_out(each, part, out, i, what, ago)
        for k in range(asked, BATCH):
            ask_for(each, lo + BATCH + k, end)
        for k in range(count):
            i, q = at[1, k], at[2, k] & (MOST - 1)
            inside = (first <= q) & (q < last)
            if isinstance(what, Sum | Settle):
                send(each, found, k, i, q, q if inside else spare)
            elif isinstance(what, Virial):
                Virial.add(what, 1.0 if inside else 0.5, three(given.way, k), three(found.force, k))
            else:
                total += (1.0 if inside else 0.5) * float(found.force[k, 3])
            if isinstance(what, Settle) and memory is not None:
                e = at[0, k]
                for axis in lanes(QUAD):
                    memory.anchor[e, axis] = found.anchor[k, axis]
                if memory.rolled is not None:
                    for axis in lanes(QUAD):
                        memory.rolled[e, axis] = found.rolled[k, axis]
    return total


def ask_for(each: Any, e: Any, end: Any) -> None:
    """Have what pair e is about fetched into the cache. A core waits for lines that are not there when it has asked for some
    tens of them, so those of the next batch are asked for a few at a time, between the contacts of this one."""
    if e < end:
        memory, q = each.lists.memory, each.lists.second[e] & (MOST - 1)
        prefetch(each.rows, q, PLACE)
        if each.turns is not None:
            prefetch(each.rows, q, TURN)
        if memory is not None:
            prefetch(memory.anchor, e, 0)


def gather(each: Any, given: Any, k: Any, e: Any, i: Any, j: Any, shifted: Any) -> None:
    """What the law sees of places i and j, which are pair e of the lists."""
    near, rows, memory, q = each.near, each.rows, each.lists.memory, j & (MOST - 1)
    r, s = rows[i, 3], rows[q, 3]
    for axis in lanes(QUAD):
        given.way[k, axis] = rows[i, axis] - rows[q, axis]
    for axis in lanes(QUAD):
        given.speed[k, axis] = rows[i, MOTION + axis] - rows[q, MOTION + axis]
    if shifted:
        for axis in range(3):
            given.way[k, axis] -= type_of(r, near.images[axis, j >> IMAGE_SHIFT])
    if (given.way[k, 0] == 0) & (given.way[k, 1] == 0) & (given.way[k, 2] == 0):
        side = GAP * (r + s)
        given.way[k, 0] = -side if near.order[i] < near.order[q] else side
    if each.turns is not None:
        for axis in lanes(QUAD):
            given.turn[k, axis] = r * rows[i, TURN + axis] + s * rows[q, TURN + axis]
        for axis in lanes(QUAD):
            given.angle[k, axis] = r * rows[i, ANGLE + axis] + s * rows[q, ANGLE + axis]
    given.way[k, 3], given.speed[k, 3] = r, s
    given.turn[k, 3], given.angle[k, 3] = rows[i, 7], rows[q, 7]
    if given.anchor is not None:
        for axis in lanes(QUAD):
            given.anchor[k, axis] = memory.anchor[e, axis]
    if given.rolled is not None:
        for axis in lanes(QUAD):
            given.rolled[k, axis] = memory.rolled[e, axis]
        for axis in lanes(QUAD):
            given.spun[k, axis] = rows[i, TURN + axis] - rows[q, TURN + axis]
        for axis in lanes(QUAD):
            given.bent[k, axis] = rows[i, ANGLE + axis] - rows[q, ANGLE + axis]


def send(each: Any, found: Any, k: Any, i: Any, q: Any, to: Any) -> None:
    """Force and torque of a contact to both its places, to the second one in row `to`."""
    rows, pull = each.rows, each.pull
    for axis in lanes(QUAD):
        pull[i, axis] += found.force[k, axis]
    for axis in lanes(QUAD):
        pull[to, axis] -= found.force[k, axis]
    if found.twist is not None:
        r, s = rows[i, 3], rows[q, 3]
        for axis in lanes(QUAD):
            pull[i, TORQUE + axis] -= r * found.twist[k, axis]
        for axis in lanes(QUAD):
            pull[to, TORQUE + axis] -= s * found.twist[k, axis]
    if found.moment is not None:
        for axis in lanes(QUAD):
            pull[i, TORQUE + axis] += found.moment[k, axis]
        for axis in lanes(QUAD):
            pull[to, TORQUE + axis] -= found.moment[k, axis]


def three(rows: Any, k: Any) -> Any:
    """Three numbers of a row."""
    return rows[k, 0], rows[k, 1], rows[k, 2]


def put(rows: Any, k: Any, numbers: Any, last: Any) -> None:
    """Three numbers of a row, and the last."""
    rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = numbers[0], numbers[1], numbers[2], last


def work_out(each: Any, given: Any, out: Any, i: Any, what: Any, ago: Any) -> None:
    """A contact, from what is gathered to what is found."""
    way, v, memory = three(given.way, i), three(given.speed, i), each.lists.memory
    none = way[0] - way[0]
    r1, r2, square = given.way[i, 3], given.speed[i, 3], dot(way, way)
    light = given.turn[i, 3], given.angle[i, 3]
    p = Pair(way[0], way[1], way[2], v[0], v[1], v[2], none, none, r1, r2, a1=light[0], a2=light[1])
    by, reach = inverse_length(square), r1 + r2
    far = by * square
    n = tuple(by * x for x in way)
    held, turning, rolling = None, None, None
    if memory is not None:
        held = Held(given.anchor[i, KNOWN], *three(given.anchor, i))
    if each.turns is not None:
        turning = Turning(far / reach, three(given.turn, i), three(given.angle, i))
    if given.rolled is not None:
        rolling = Rolling(three(given.spun, i), three(given.bent, i), three(given.rolled, i))
    at = press(each.law, p, n, reach - far, held, turning, rolling, ago)
    if isinstance(what, Energies):
        out.force[i, 3] = at.energy
    elif isinstance(what, Powers):
        power = dot(at.force, v) - at.push * at.rate
        if turning is not None:
            power -= dot(at.twist, turning.w)
        if rolling is not None:
            power += dot(at.moment, rolling.w)
        out.force[i, 3] = power
    else:
        put(out.force, i, at.force, none)
        if out.twist is not None:
            put(out.twist, i, at.twist, none)
        if out.moment is not None:
            put(out.moment, i, at.moment, none)
        if isinstance(what, Settle) and out.anchor is not None:
            put(out.anchor, i, at.held[1:], at.held.state)
            if out.rolled is not None:
                put(out.rolled, i, at.rolled, none)


# Chunks whose pairs found no room: slowly, and as if contacts had just begun


class Slowly(NamedTuple):
    """What is made of the pairs of a group, into sums [4, GROUP]."""

    sums: Any
    what: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Add what one of a group feels of another."""
        n, k, q = normal_of(p, row, other), each.near.place[row], each.near.place[other]
        at = touch(each.law, p, n.overlap)
        rate = type_of(n.overlap, 0)
        for axis in range(3):
            rate += (each.rows[k, MOTION + axis] - each.rows[q, MOTION + axis]) * n[axis]
        push = at.push - at.pull - at.damping * rate
        self.sums[0, i] += push * n.x
        self.sums[1, i] += push * n.y
        self.sums[2, i] += push * n.z
        half = type_of(rate, 0.5)
        if isinstance(self.what, Virial):
            Virial.add(self.what, 0.5, (p.x, p.y, p.z), (push * n.x, push * n.y, push * n.z))
        if isinstance(self.what, Energies):
            self.sums[3, i] += half * at.energy
        else:
            self.sums[3, i] -= half * at.damping * rate * rate


def take_slowly(each: Any, first: Any, last: Any, t: Any, what: Any) -> Any:
    """The contacts of some groups by neighbour lists."""
    sums, total = on_stack(4, GROUP, each.near.x.dtype), 0.0
    for g in range(first, last):
        for i in range(GROUP):
            sums[0, i] = sums[1, i] = sums[2, i] = sums[3, i] = 0
        touching(each, g, Slowly(sums, what), t)
        for i in range(GROUP):
            if isinstance(what, Energies | Powers):
                total += float(sums[3, i])
            elif isinstance(what, Sum | Settle):
                for axis in range(3):
                    each.pull[GROUP * g + i, axis] = sums[axis, i]
    return total
