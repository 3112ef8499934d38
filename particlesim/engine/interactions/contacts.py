"""Soft contacts: particles that overlap push each other apart by springs and dampers, with friction and rotation.

The forces of a contact are those of `laws.contact` along the normal, and of `pressing` along the surfaces. Once in a step,
at its end, the memory of contacts is updated: tangential springs that slide are shortened, contacts that have ended are
forgotten. Forces are computed at the same time, for a method that starts its next step with them.

Threads share chunks of pairs (`contact_lists`). Of every chunk, some pairs at a time are tested; those that touch are
gathered in rows, so that contacts are computed in vectors; then forces are added to the particles of the chunk, in the order
of the list, which depends on the state alone.

Colliders act by the same laws (`contact_walls`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, outlined, prefetch
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.contact_lists import (
    BUILT,
    FRESH,
    ROOM,
    ROUND,
    WANTED,
    Draft,
    Lists,
    Memory,
    chunk_groups,
    chunks_of,
    contacts_in,
    draft_for,
    lists_of,
    made,
    new_lists,
    new_memory,
)
from particlesim.engine.interactions.contact_pairs import (
    ANGLE,
    QUAD,
    TORQUE,
    TURN,
    Energies,
    Powers,
    Settle,
    Sum,
    Virial,
    seen_in,
    take_pairs,
    take_slowly,
    turning_in,
)
from particlesim.engine.interactions.contact_walls import (
    Marks,
    Wall,
    drifted,
    holds_on,
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
    OVERFLOW,
    Neighbours,
    enlarged,
    forget,
    found_again,
    lasting,
    renumbered,
    take_over,
    with_lasting,
)
from particlesim.engine.interactions.pair_blocks import Block
from particlesim.engine.state.columns import held, in_step, motion
from particlesim.engine.state.table import SPIN
from particlesim.interactions import PairSet
from particlesim.interactions.contact import JkrRecord, jumps
from particlesim.model.arrays import packed

AHEAD, LINE = 64, 8
"""Particles whose sums are asked for ahead, and how many there are in a cache line of a column."""
SPARE = 512
"""Pairs to have room for beyond those of each particle."""
USES = 20, 100
"""For how many sums neighbour lists should hold: sums read the pairs that are taken out of them, and are fast."""


class ContactColumns(NamedTuple):
    """Contacts of one law: the first ten as in `NearColumns`, with forces and torques [places and chunks, 8], the last rows
    for what belongs to other chunks; lists of pairs, and room to make them; what the law sees of members, in the order of
    the lists (`contact_pairs`), and `turns`: None where they do not turn; colliders and what each remembers."""

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
    rows: Any
    turns: Any
    walls: tuple[Wall, ...]
    marks: tuple[Marks | None, ...]


class Contacts(NearLists, ContactColumns):
    """Soft contacts, looked for among near pairs before every sum of forces."""

    __slots__ = ()
    prepares: ClassVar[bool] = True
    concludes: ClassVar[bool] = True
    resumes: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(ContactColumns._fields) - {"near", "lists", "marks"}

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

    def add_settled(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        place, pull = self.near.place, self.pull
        for i in range(first, last):
            k = place[i]
            prefetch(pull, max(place[min(i + AHEAD, place.size - 1)], 0), 0)
            if i % LINE == 0:  # what moves next
                for column in (*motion(c), c.m, c.r):
                    prefetch(column, i)
            if k >= 0:
                for axis in range(3):
                    total[axis, i - first] += pull[k, axis]
                if c.spin is not None:
                    for axis in range(3):
                        total[3 + axis, i - first] += pull[k, TORQUE + axis]

    def renewed(self) -> Self:
        forget(self.near)
        return self.roomier()

    def recalled(self) -> Self:
        near, lists, draft = found_again(self.near), self.lists, self.draft
        lists.report[FRESH], lists.report[BUILT] = 0, -1
        if draft.first.size != lists.first.size:
            draft = draft_for(lists)
        return self if near is self.near and draft is self.draft else self._replace(near=near, draft=draft)

    def roomier(self) -> Self:
        near, lists, draft = enlarged(self.near), self.lists, self.draft
        lists.report[FRESH], lists.report[BUILT] = 0, -1
        if lists.report[WANTED] > lists.first.size:
            lists = with_room(lists, int(lists.report[WANTED]) * 5 // 4)
        if draft.first.size != lists.first.size:
            draft = draft_for(lists)
        if near is self.near and lists is self.lists and draft is self.draft:
            return self
        return self._replace(near=near, lists=lists, draft=draft)

    @property
    def cramped(self) -> bool:
        return bool(self.near.report[OVERFLOW] or self.lists.report[WANTED] > self.lists.first.size)

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

    def among(self, rows: Ints, place: Ints) -> Self:
        walls = tuple(
            wall if wall.members is None else wall._replace(members=wall.members[rows]) for wall in self.walls
        )
        marks = tuple(each and each.moved(place) for each in self.marks)
        lists = renumbered(self.lists, rows, place)
        return super().among(rows, place)._replace(lists=lists, walls=walls, marks=marks)

    def bring_back(self, there: Self, rows: Ints, place: Ints) -> None:
        super().bring_back(there, rows, place)
        take_over(self.lists, renumbered(there.lists, place, rows))
        for mine, theirs in zip(self.marks, there.marks, strict=True):
            if mine is not None and theirs is not None:
                theirs.move_to(mine, rows)

    def energy(self, c: Any, t: float) -> float:
        return float(contact_sum(self, c._replace(clock=None), lone(c.x.size), t, Energies()))

    @property
    def spends(self) -> bool:
        laws = (self.law, *(wall.law for wall in self.walls))
        moved = any(hasattr(wall.shape, "path") or wall.belt is not None for wall in self.walls)
        return moved or any(law.beta > 0 or law.friction is not None for law in laws)

    @property
    def abrupt(self) -> bool:
        return any(law.beta > 0 for law in (self.law, *(wall.law for wall in self.walls)))

    def power(self, c: Any, t: float) -> float:
        return float(contact_sum(self, c, lone(c.x.size), t, Powers()))

    def snapped(self, before: Interaction, c: Any) -> float:
        if not isinstance(self.law, JkrRecord):
            return 0.0
        assert isinstance(before, Contacts)
        was, now = holding(before), holding(self)
        began = (
            np.setdiff1d(now, was) if before.lists.report[ROUND] > 1 else now[:0]
        )  # others were there from the start
        rows = len(self.lists.place)
        work = 0.0
        for changed, at in ((began, 0), (np.setdiff1d(was, now), 1)):
            first, second = changed // rows, changed % rows
            radius = np.where(first < rows, 1 / (1 / c.r[first % rows] + 1 / c.r[second]), c.r[second])
            work += float(jumps(self.law, radius)[at].sum())
        return work

    def virial(self, c: Any, t: float) -> NDArray[np.float64]:
        """Σ l ⊗ f over all pairs [J], shape [3, 3]."""
        out = np.zeros(9)
        contact_sum(self, c._replace(clock=None), lone(c.x.size), t, Virial(out))
        return out.reshape(3, 3)

    def changing(self) -> tuple[NDArray[Any], ...]:
        lists = [*self.lists[:8], *(self.lists.memory or ())]
        arrays = [*lists, *(each for memory in self.marks for each in memory or ()), *lasting(self.near)]
        return tuple(each for each in arrays if each is not None)

    def with_changed(self, arrays: Sequence[NDArray[Any]]) -> Self:
        rest = iter(arrays)

        def again(memory: Any) -> Any:
            if memory is None:
                return None
            return type(memory)(*(None if each is None else next(rest) for each in memory))

        lists = Lists(*[next(rest) for _ in range(8)], memory=None)  # type: ignore[misc]
        lists = lists._replace(memory=again(self.lists.memory))
        marks = tuple(again(memory) for memory in self.marks)
        near = found_again(with_lasting(self.near, rest))
        return self._replace(near=near, lists=lists, marks=marks)


def holding(each: Contacts) -> NDArray[np.int64]:
    """Contacts as numbers: a pair of rows i < j of n is i n + j, row j at wall k is (n + k) n + j."""
    lists, rows = each.lists, len(each.lists.place)
    i, j, _ = contacts_in(lists)
    found = [np.minimum(i, j) * rows + np.maximum(i, j)]
    for k, marks in enumerate(each.marks):
        if marks is not None:
            found.append((rows + k) * rows + np.flatnonzero(marks.state >> 1 == lists.report[ROUND]))
    return np.concatenate(found)


def remembers(each: Any) -> bool:
    """Whether there is something to remember from one step to the next."""
    return each.lists.memory is not None or any(memory is not None for memory in each.marks)


def look_at(each: Any, c: Any, share: Any, t: Any) -> Any:
    """Neighbour lists, lists of pairs, and all that the law reads of the members; returns whether any of it has changed."""
    hold_stuck(each, c, share)
    changed = bring_up(each, c, share, t, (), turning_in(each, c))
    changed = changed | (each.law.beta > 0) | (each.law.friction is not None)
    made(each.lists, each.draft, each.near, share)
    meet(share.gate, share.threads)
    return changed


def take_chunks(each: Any, c: Any, share: Any, t: Any, what: Any) -> None:
    """All chunks. Those of a thread follow each other, so that what they read and write mostly stays in the cache of a core
    from step to step, and have about as many pairs and places as those of any other."""
    lists, size, chunks = each.lists, GROUP * chunk_groups(each.near.begin.size), each.draft.slow.size
    total = size * chunks
    if chunks > 0:
        last = lists.begin.size - 1
        total += lists.begin[last] + max(lists.count[last], 0)
    for chunk in range(chunks):
        before = lists.begin[size * chunk // GROUP] + size * chunk
        if before * share.threads // total == share.number:
            take_chunk(each, c, chunk, t, what)


def since(each: Any, t: Any) -> Any:
    """How long ago the present step began [s]."""
    return t - each.lists.time[0]


@outlined
def take_chunk(each: Any, c: Any, chunk: Any, t: Any, what: Any) -> Any:
    """Contacts of the places of a chunk: a sum, where one is asked for."""
    size = GROUP * chunk_groups(each.near.begin.size)
    first, last = size * chunk, min(size * (chunk + 1), each.near.order.size)
    spare, total = each.near.order.size + chunk, 0.0
    if isinstance(what, Sum | Settle):
        for k in range(first, last):
            for axis in range(each.pull.shape[1]):
                each.pull[k, axis] = 0
    if each.draft.slow[chunk] != 0:
        total += take_slowly(each, first // GROUP, last // GROUP, t, what)
    elif each.near.box is None:
        total += take_pairs(each, first, last, spare, what, False, since(each, t))
    else:
        total += take_pairs(each, first, last, spare, what, True, since(each, t))
    if len(each.walls) > 0 and not isinstance(what, Virial):
        drift, begin, end = drifted(each.near), first // GROUP, last // GROUP
        ball = surrounding(each, drift, begin, end)
        for wall, memory in zip(each.walls, each.marks, strict=True):
            if not is_clear(wall, ball, each.near.cutoff, t):
                for g in range(begin, end):
                    if not is_clear(wall, surrounding(each, drift, g, g + 1), each.near.cutoff, t):
                        total += take_wall(each, c, wall, memory, GROUP * g, GROUP * (g + 1), t, what)
    return total


def take_wall(each: Any, c: Any, wall: Any, memory: Any, first: Any, last: Any, t: Any, what: Any) -> Any:
    """What some places feel of a collider."""
    near, total, settles = each.near, 0.0, isinstance(what, Settle)
    for k in range(first, last):
        row = near.order[k]
        if row >= 0:
            touches, turn = False, each.lists.report[ROUND]
            if is_held_back(wall, c, row):
                touches = wall_gap(wall, c, row, t) < holds_on(wall, memory, c.r[row], row, turn)
            if touches:
                at = press_wall(wall, memory, c, each.a[row], row, t, since(each, t), turn, settles)
                if isinstance(what, Energies):
                    total += float(at.energy)
                elif isinstance(what, Powers):
                    total += float(wall_power(c, row, at))
                else:
                    for axis in range(3):
                        each.pull[k, axis] += at.force[axis]
                        each.pull[k, TORQUE + axis] += at.torque[axis]
    return total


def wall_power(c: Any, row: Any, at: Any) -> Any:
    """The power of all forces of a wall but the elastic push [W]."""
    power = at.force[0] * c.vx[row] + at.force[1] * c.vy[row] + at.force[2] * c.vz[row] - at.push * at.rate
    if c.spin is not None:
        s = c.spin
        power += at.torque[0] * s.wx[row] + at.torque[1] * s.wy[row] + at.torque[2] * s.wz[row]
    return power


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
        made = packed((room, *array.shape[1:]), array.dtype)
        made[: len(array)] = array
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
    """Near pairs that know inverse masses, 0 of what is pinned, as their numbers `a`, and no masses."""
    seen = found.seen._replace(a=np.zeros(found.near.order.size, site.dtype), m=None)
    return found._replace(a=site.inverse_mass().astype(site.dtype), seen=seen)


def hold_stuck(each: Any, c: Any, share: Any) -> None:
    """Particles that have stuck to a collider count as infinitely heavy, as pinned ones do."""
    if c.clock is not None:
        for i in range(share.first, share.last):
            if held(c.clock, i) & (each.a[i] > 0):
                each.a[i] = 0
                if each.near.place[i] >= 0:
                    each.seen.a[each.near.place[i]] = 0


def contacts_of(site: Site, pairs: PairSet) -> Contacts:
    """Soft contacts among the particles of an island, and with its colliders."""
    found = with_masses(site, near_pairs_of(site, pairs, USES))
    law, places = found.law, found.near.order.size
    room = ROOM * places + SPARE
    keeps = law.friction is not None or isinstance(law, JkrRecord)
    memory = new_memory(room, site.dtype, rolls=law.rolling is not None) if keeps else None
    lists = new_lists(places, site.whole.count, room, memory)
    turns = True if SPIN in site.whole.parts and memory is not None else None
    rows = packed((places, TURN if turns is None else ANGLE + QUAD), site.dtype)
    rows[:, :3] = FAR
    walls, marks = walls_of(site, pairs)
    found = found._replace(near=found.near._replace(x=rows[:, :3].T), seen=seen_in(rows, found.seen))
    found = found._replace(pull=packed((places + chunks_of(places), QUAD + TORQUE), site.dtype))
    return Contacts(*found, lists, draft_for(lists), rows, turns, walls, marks)
