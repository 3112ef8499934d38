"""Soft contacts: particles that overlap push each other apart by springs and dampers, rub each other, and turn.

The forces of a contact are those of `laws.contact` along the normal, and of `pressing` along the surfaces. Once in a step,
at its end, what contacts remember is brought up to date: springs that slide give way, contacts that have ended are
forgotten. The forces of that moment are worked out with it, so that a method that looks at the beginning of its next step
finds them.

Chunks of pairs (`contact_lists`) are taken by threads in turn. Of every chunk, some pairs at a time are tested; what touches
is gathered in rows, so that the numbers of a contact are worked out in vectors; then forces go to the places of the chunk,
in the order of the list, which depends on the state alone.

Colliders act by the same laws (`contact_walls`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, lanes, on_stack, outlined
from particlesim.compiler.barrier import meet
from particlesim.engine.interactions.contact_lists import (
    BUILT,
    CHUNK,
    FRESH,
    ROOM,
    ROUND,
    WANTED,
    Draft,
    Lists,
    Memory,
    contacts_in,
    draft_for,
    lists_of,
    made,
    new_lists,
    new_memory,
)
from particlesim.engine.interactions.contact_walls import (
    Marks,
    Wall,
    is_clear,
    is_held_back,
    press_wall,
    surrounding,
    wall_gap,
    walls_of,
)
from particlesim.engine.interactions.interaction import Interaction, Ints, Site, lone
from particlesim.engine.interactions.near_pairs import NearLists, NearPairs, bring_up, near_pairs_of
from particlesim.engine.interactions.neighbours.record import (
    DUE,
    FAR,
    GROUP,
    IMAGE_SHIFT,
    MOST,
    Neighbours,
    enlarged,
    forget,
)
from particlesim.engine.interactions.pair_blocks import Block
from particlesim.engine.interactions.pressing import Held, Rolling, Turning, press
from particlesim.engine.interactions.touching import normal_of, touching
from particlesim.engine.state.columns import Spin, in_step, type_of
from particlesim.engine.state.table import SPIN
from particlesim.interactions import PairSet
from particlesim.laws.contact import touch
from particlesim.laws.pair import Pair

BATCH = 64
"""Pairs that are tested, gathered and worked out together."""
GAP = 1e-9
"""Part of the radii by which centres that coincide count as apart, along x, away from the one with the larger row."""
SPARE = 512
"""Pairs to have room for beyond those of each particle."""
PULLS = 6
"""Force and torque."""


class ContactColumns(NamedTuple):
    """Contacts of one law: the first ten as in `NearColumns`, with forces and torques [room, 6]; lists of pairs, and room to
    make them; how members turn, in the order of the lists, None where they do not; colliders and what each remembers."""

    law: Any
    least: Any
    most: Any
    a: Any
    b: Any
    ids: Any
    near: Neighbours
    seen: Block
    pull: Any
    box: Any
    lists: Lists
    draft: Draft
    spin: Any
    walls: tuple[Wall, ...]
    marks: tuple[Marks | None, ...]


class Contacts(NearLists, ContactColumns):
    """Soft contacts, looked for among near pairs before every sum of forces."""

    __slots__ = ()
    prepares: ClassVar[bool] = True
    concludes: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(ContactColumns._fields) - {"lists", "marks"}

    def prepare(self, c: Any, share: Any, t: Any) -> None:
        if self.lists.report[FRESH] != 0:
            meet(share.gate, share.threads)
            if share.number == 0:
                self.lists.report[FRESH] = 0
        else:
            changed = look_at(self, c, share, t)
            if changed or self.near.report[DUE] != 0:
                take_chunks(self, c, share, t, Sum())
                meet(share.gate, share.threads)
                if share.number == 0:
                    self.near.report[DUE] = 0

    def conclude(self, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
        if remembers(self):
            ahead = in_step(c, t, t + float(h))  # who is there in the next step, as forces will be asked for
            look_at(self, ahead, share, t)
            take_chunks(self, ahead, share, t, Settle())
            meet(share.gate, share.threads)
            if share.number == 0:
                self.lists.time[0] = t
                self.near.report[DUE] = 0
                self.lists.report[FRESH] = 1
                self.lists.report[ROUND] += 1
            meet(share.gate, share.threads)

    def leave(self) -> None:
        self.lists.report[FRESH] = 0

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        place, pull = self.near.place, self.pull
        for i in range(first, last):
            k = place[i]
            if k >= 0:
                for axis in range(3):
                    total[axis, i] += pull[k, axis]
                if c.spin is not None:
                    for axis in range(3):
                        total[3 + axis, i] += pull[k, 3 + axis]

    def renewed(self) -> Self:
        forget(self.near)
        near, lists, draft = enlarged(self.near), self.lists, self.draft
        lists.report[FRESH] = 0
        if lists.report[WANTED] > lists.first.size:
            lists = with_room(lists, int(lists.report[WANTED]) * 5 // 4)
        if draft.first.size != lists.first.size:
            draft = draft_for(lists)
        if near is self.near and lists is self.lists and draft is self.draft:
            return self
        return self._replace(near=near, lists=lists, draft=draft)

    def after(self, before: Interaction, place: Ints) -> Self:
        assert isinstance(before, Contacts)
        near, lists, draft, marks = self.near, self.lists, self.draft, self.marks
        if lists.memory is not None:
            i, j, at = contacts_in(before.lists)
            i, j = place[i], place[j]
            left = (i >= 0) & (j >= 0)
            room = max(lists.first.size, before.lists.first.size)
            found = (i[left], j[left]), before.lists.memory, at[left]
            lists = lists_of(near.members, near.order.size, near.place.size, room, *found)
            draft = draft_for(lists)
        lists.time[:] = before.lists.time
        lists.report[ROUND] = before.lists.report[ROUND]
        there = np.flatnonzero(place >= 0)
        for mine, theirs in zip(marks, before.marks, strict=True):
            for now, then in zip(mine or (), theirs or (), strict=True):
                if now is not None:
                    now[..., place[there]] = then[..., there]
        return self._replace(lists=lists, draft=draft, marks=marks)

    def energy(self, c: Any) -> float:
        return float(contact_sum(self, c._replace(clock=None), lone(c.x.size), 0.0, Energies()))

    @property
    def spends(self) -> bool:
        laws = (self.law, *(wall.law for wall in self.walls))
        moved = any(hasattr(wall.shape, "path") or wall.belt is not None for wall in self.walls)
        return moved or any(law.beta > 0 or law.friction is not None for law in laws)

    def power(self, c: Any, t: float) -> float:
        return float(contact_sum(self, c, lone(c.x.size), t, Powers()))

    def virial(self, c: Any, t: float) -> NDArray[np.float64]:
        """Σ l ⊗ f over all pairs [J], shape [3, 3]."""
        out = np.zeros(9)
        contact_sum(self, c._replace(clock=None), lone(c.x.size), t, Virial(out))
        return out.reshape(3, 3)

    def changing(self) -> tuple[NDArray[Any], ...]:
        if not remembers(self):
            return ()
        lists = [*self.lists[:8], *(self.lists.memory or ())]
        arrays = [*lists, *(each for memory in self.marks for each in memory or ())]
        return tuple(each for each in arrays if each is not None)

    def with_changed(self, arrays: Sequence[NDArray[Any]]) -> Self:
        if not remembers(self):
            return self
        rest = iter(arrays)

        def again(memory: Any) -> Any:
            if memory is None:
                return None
            return type(memory)(*(None if each is None else next(rest) for each in memory))

        lists = Lists(*[next(rest) for _ in range(8)], memory=None)  # type: ignore[misc]
        lists = lists._replace(memory=again(self.lists.memory))
        return self._replace(lists=lists, marks=tuple(again(memory) for memory in self.marks))


def remembers(each: Any) -> bool:
    """Whether there is something to remember from one step to the next."""
    return each.lists.memory is not None or any(memory is not None for memory in each.marks)


def look_at(each: Any, c: Any, share: Any, t: Any) -> Any:
    """Neighbour lists, lists of pairs, and all that the law reads of the members; returns whether any of it has changed."""
    moving: Any = ()
    quiet: Any = ()
    if each.spin is not None:
        s, own = c.spin, each.spin
        moving = ((s.wx, own.wx), (s.wy, own.wy), (s.wz, own.wz))
        quiet = ((s.ax, own.ax), (s.ay, own.ay), (s.az, own.az))
    changed = bring_up(each, c, share, t, moving, quiet)
    made(each.lists, each.draft, each.near, share)
    return changed


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


def take_chunks(each: Any, c: Any, share: Any, t: Any, what: Any) -> None:
    """All chunks, by threads in turn."""
    for chunk in range(share.number, each.draft.slow.size, share.threads):
        take_chunk(each, c, chunk, t, what)


def since(each: Any, t: Any) -> Any:
    """How long ago the present step began [s]."""
    return t - each.lists.time[0]


@outlined
def take_chunk(each: Any, c: Any, chunk: Any, t: Any, what: Any) -> Any:
    """Contacts of the places of a chunk: a sum, where one is asked for."""
    first, last = CHUNK * chunk, min(CHUNK * (chunk + 1), each.near.order.size)
    total = 0.0
    if isinstance(what, Sum | Settle):
        for k in range(first, last):
            for axis in range(PULLS):
                each.pull[k, axis] = 0
    if each.draft.slow[chunk] != 0:
        total += take_slowly(each, first // GROUP, last // GROUP, t, what)
    elif each.near.box is None:
        total += take_pairs(each, first, last, what, False)
    else:
        total += take_pairs(each, first, last, what, True)
    if len(each.walls) > 0:
        ball = surrounding(each, first, last)
        walls = () if isinstance(what, Virial) else each.walls
        for wall, memory in zip(walls, each.marks[: len(walls)], strict=True):
            if not is_clear(wall, ball, t):
                total += take_wall(each, c, wall, memory, first, last, t, what)
    return total


LENGTH, SPEED, SIZE, LIGHT, KNOWN, TURN, ANGLE, SPUN, BENT, WAY = 0, 3, 6, 8, 10, 14, 17, 20, 23, 26
"""Rows of what is gathered of a pair: l, v, radii, inverse masses, what it remembers, Ω, A, ω₁ − ω₂, α₁ − α₂, ρ."""
GATHERED = 29
FORCE, TWIST, MOMENT, STATE, ANCHOR, ROLLED, PUSH = 0, 3, 6, 9, 10, 13, 16
"""Rows of what is found."""
FOUND = 19


@outlined
def take_pairs(each: Any, first: Any, last: Any, what: Any, shifted: Any) -> Any:
    """The pairs of a chunk's places."""
    lists, near, seen, kind = each.lists, each.near, each.seen, each.near.x.dtype
    memory, spin, friction = lists.memory, each.spin, each.law.friction
    x, y, z, r, pull = near.x[0], near.x[1], near.x[2], seen.r, each.pull
    given, found = on_stack(GATHERED, BATCH, kind), on_stack(FOUND, BATCH, kind)
    at = on_stack(1, BATCH, np.int64)[0]
    for row in range(GATHERED):
        for i in range(BATCH):
            given[row, i] = 1
    g0, g1 = first // GROUP, last // GROUP - 1
    begin, end, total = lists.begin[g0], lists.begin[g1] + lists.count[g1], 0.0
    for lo in range(begin, end, BATCH):
        count = 0
        for e in range(lo, min(lo + BATCH, end)):
            i, j = lists.first[e], lists.second[e]
            q = j & (MOST - 1)
            dx, dy, dz, reach = x[i] - x[q], y[i] - y[q], z[i] - z[q], r[i] + r[q]
            if shifted:
                image = j >> IMAGE_SHIFT
                dx -= type_of(dx, near.images[0, image])
                dy -= type_of(dx, near.images[1, image])
                dz -= type_of(dx, near.images[2, image])
            hit = (dx * dx + dy * dy + dz * dz < reach * reach) & (x[i] < FAR)
            given[LENGTH, count], given[LENGTH + 1, count], given[LENGTH + 2, count] = dx, dy, dz
            at[count] = e
            count += 1 if hit else 0
            if isinstance(what, Settle) and memory is not None:
                memory.state[e] *= 1 if hit else 0  # APART, without a branch
        column = 0
        for k in range(count):
            e = at[k]
            gather(each, given, column, e, lists.first[e], lists.second[e] & (MOST - 1))
            # k in other words, or this would be a loop over vectors: processors gather slower than they load
            column += 1 if e >= 0 else 0
        for b in range((count + GROUP - 1) // GROUP):
            part, out = given[:, GROUP * b : GROUP * b + GROUP], found[:, GROUP * b : GROUP * b + GROUP]
            for i in lanes(GROUP):
                work_out(each, part, out, i, what)
        for k in range(count):
            e = at[k]
            i, q = lists.first[e], lists.second[e] & (MOST - 1)
            inside = (first <= q) & (q < last)
            if isinstance(what, Sum | Settle):
                for axis in range(3):
                    pull[i, axis] += found[FORCE + axis, k]
                    if friction is not None and spin is not None:
                        pull[i, 3 + axis] -= r[i] * found[TWIST + axis, k]
                        if each.law.rolling is not None:
                            pull[i, 3 + axis] += found[MOMENT + axis, k]
                if inside:
                    for axis in range(3):
                        pull[q, axis] -= found[FORCE + axis, k]
                        if friction is not None and spin is not None:
                            pull[q, 3 + axis] -= r[q] * found[TWIST + axis, k]
                            if each.law.rolling is not None:
                                pull[q, 3 + axis] -= found[MOMENT + axis, k]
            elif isinstance(what, Virial):
                Virial.add(what, 1.0 if inside else 0.5, three(given, LENGTH, k), three(found, FORCE, k))
            else:
                total += (1.0 if inside else 0.5) * float(found[PUSH, k])
            if isinstance(what, Settle) and memory is not None:
                memory.state[e] = int(found[STATE, k])
                for axis in range(3):
                    memory.anchor[axis, e] = found[ANCHOR + axis, k]
                    if memory.rolled is not None:
                        memory.rolled[axis, e] = found[ROLLED + axis, k]
    return total


def gather(each: Any, given: Any, k: Any, e: Any, i: Any, q: Any) -> None:
    """Column k: what the law sees of the pair of places i and q, which is pair e of the lists."""
    seen, memory, s = each.seen, each.lists.memory, each.spin
    if (given[0, k] == 0) & (given[1, k] == 0) & (given[2, k] == 0):
        side = GAP * (seen.r[i] + seen.r[q])
        given[LENGTH, k] = -side if each.near.order[i] < each.near.order[q] else side
    given[SIZE, k], given[SIZE + 1, k] = seen.r[i], seen.r[q]
    given[LIGHT, k], given[LIGHT + 1, k] = seen.a[i], seen.a[q]
    for axis, v in enumerate((seen.vx, seen.vy, seen.vz)):
        if v is not None:
            given[SPEED + axis, k] = v[i] - v[q]
    if memory is not None:
        given[KNOWN, k] = memory.state[e]
        for axis in range(3):
            given[KNOWN + 1 + axis, k] = memory.anchor[axis, e]
            if memory.rolled is not None:
                given[WAY + axis, k] = memory.rolled[axis, e]
        if s is not None:
            ri, rq = seen.r[i], seen.r[q]
            for axis, (w, a) in enumerate(((s.wx, s.ax), (s.wy, s.ay), (s.wz, s.az))):
                given[TURN + axis, k] = ri * w[i] + rq * w[q]
                given[ANGLE + axis, k] = ri * a[i] + rq * a[q]
                if memory.rolled is not None:
                    given[SPUN + axis, k] = w[i] - w[q]
                    given[BENT + axis, k] = a[i] - a[q]


def three(rows: Any, first: Any, i: Any) -> Any:
    """Three rows of a column."""
    return rows[first, i], rows[first + 1, i], rows[first + 2, i]


def work_out(each: Any, given: Any, out: Any, i: Any, what: Any) -> None:
    """A contact, from the rows that are gathered to those that are found."""
    dx, dy, dz = three(given, LENGTH, i)
    none = dx - dx
    v = three(given, SPEED, i) if each.seen.vx is not None else (none, none, none)
    r1, r2 = given[SIZE, i], given[SIZE + 1, i]
    light = given[LIGHT, i], given[LIGHT + 1, i]
    p = Pair(dx, dy, dz, v[0], v[1], v[2], none, none, r1, r2, a1=light[0], a2=light[1])
    far = np.sqrt(dx * dx + dy * dy + dz * dz)
    by, reach = type_of(far, 1) / far, r1 + r2
    n = (by * dx, by * dy, by * dz)
    held, turning, rolling = None, None, None
    if each.lists.memory is not None:
        held = Held(given[KNOWN, i], *three(given, KNOWN + 1, i))
        if each.spin is not None:
            turning = Turning(far / reach, three(given, TURN, i), three(given, ANGLE, i))
        if each.lists.memory.rolled is not None:
            rolling = Rolling(three(given, SPUN, i), three(given, BENT, i), three(given, WAY, i))
    at = press(each.law, p, n, reach - far, held, turning, rolling)
    if isinstance(what, Energies):
        out[PUSH, i] = at.energy
    elif isinstance(what, Powers):
        power = at.force[0] * v[0] + at.force[1] * v[1] + at.force[2] * v[2] - at.push * at.rate
        if turning is not None:
            w = three(given, TURN, i)
            power -= at.twist[0] * w[0] + at.twist[1] * w[1] + at.twist[2] * w[2]
        if rolling is not None:
            w = three(given, SPUN, i)
            power += at.moment[0] * w[0] + at.moment[1] * w[1] + at.moment[2] * w[2]
        out[PUSH, i] = power
    else:
        for axis in range(3):
            out[FORCE + axis, i] = at.force[axis]
            if turning is not None:
                out[TWIST + axis, i] = at.twist[axis]
            if rolling is not None:
                out[MOMENT + axis, i] = at.moment[axis]
        if isinstance(what, Settle) and held is not None:
            out[STATE, i], out[ANCHOR, i], out[ANCHOR + 1, i], out[ANCHOR + 2, i] = at.held
            if rolling is not None:
                for axis in range(3):
                    out[ROLLED + axis, i] = at.rolled[axis]


def take_wall(each: Any, c: Any, wall: Any, memory: Any, first: Any, last: Any, t: Any, what: Any) -> Any:
    """What the places of a chunk feel of a collider."""
    near, total, settles = each.near, 0.0, isinstance(what, Settle)
    for k in range(first, last):
        row = near.order[k]
        if row >= 0:
            touches = False
            if is_held_back(wall, c, row):
                touches = wall_gap(wall, c, row, t) < 0
            if touches:
                turn = each.lists.report[ROUND]
                at = press_wall(wall, memory, c, each.a[row], row, t, since(each, t), turn, settles)
                if isinstance(what, Energies):
                    total += float(at.energy)
                elif isinstance(what, Powers):
                    total += float(wall_power(c, row, at))
                else:
                    for axis in range(3):
                        each.pull[k, axis] += at.force[axis]
                        each.pull[k, 3 + axis] += at.torque[axis]
    return total


def wall_power(c: Any, row: Any, at: Any) -> Any:
    """The power of all forces of a wall but the elastic push [W]."""
    power = at.force[0] * c.vx[row] + at.force[1] * c.vy[row] + at.force[2] * c.vz[row] - at.push * at.rate
    if c.spin is not None:
        s = c.spin
        power += at.torque[0] * s.wx[row] + at.torque[1] * s.wy[row] + at.torque[2] * s.wz[row]
    return power


# Chunks whose pairs found no room: slowly, and as if contacts had just begun


class Slowly(NamedTuple):
    """What is made of the pairs of a group, into sums [4, GROUP]."""

    sums: Any
    what: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Add what one of a group feels of another."""
        n = normal_of(p, row, other)
        at = touch(each.law, p, n.overlap)
        rate = p.vx * n.x + p.vy * n.y + p.vz * n.z
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
            self.sums[3, i] += half * (push - at.push) * rate


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


@kernel
def contact_sum(each: Any, c: Any, share: Any, t: Any, what: Any) -> float:
    """A sum over all contacts: `Energies` [J] or `Powers` [W]."""
    look_at(each, c, share, t)
    each.near.report[DUE] = 1
    total = 0.0
    for chunk in range(each.draft.slow.size):
        total += take_chunk(each, c, chunk, t, what)
    return total


# How contacts are laid out


def with_room(lists: Lists, room: int) -> Lists:
    """The same with more room."""

    def longer(array: Any) -> Any:
        if array is None:
            return None
        made = np.zeros((*array.shape[:-1], room), array.dtype)
        made[..., : array.shape[-1]] = array
        return made

    memory = lists.memory
    report = lists.report.copy()
    report[BUILT] = -1
    return lists._replace(
        first=longer(lists.first),
        second=longer(lists.second),
        report=report,
        memory=None if memory is None else Memory(*map(longer, memory)),
    )


def with_masses(site: Site, found: NearPairs) -> NearPairs:
    """Near pairs that know inverse masses, 0 of what is held, as their numbers `a`, and no masses."""
    seen = found.seen._replace(a=np.zeros(found.near.order.size, site.dtype), m=None)
    return found._replace(a=site.inverse_mass().astype(site.dtype), seen=seen)


def contacts_of(site: Site, pairs: PairSet) -> Contacts:
    """Soft contacts among the particles of an island, and with its colliders."""
    found = with_masses(site, near_pairs_of(site, pairs))
    law, places = found.law, found.near.order.size
    room = ROOM * places + SPARE
    memory = None if law.friction is None else new_memory(room, site.dtype, rolls=law.rolling is not None)
    lists = new_lists(places, site.whole.count, room, memory)
    spin = None
    if SPIN in site.whole.parts and memory is not None:
        spin = Spin(*np.zeros((6, places), site.dtype))
    walls, marks = walls_of(site, pairs)
    found = found._replace(pull=np.zeros((places, PULLS), site.dtype))
    return Contacts(*found, lists, draft_for(lists), spin, walls, marks)
