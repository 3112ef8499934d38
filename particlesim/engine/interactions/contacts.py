"""Soft contacts: particles that overlap push each other apart by springs and dampers, and rub each other.

Along the normal forces are those of `laws.contact`. Along the surfaces a spring of stiffness k_t, that is fixed where the
contact began, and a damper resist: f_t = −k_t ξ − γ_t v_t, but no more than μ_s N; what slides feels μ_k N, and the spring
gives way. As particles have no spin, ξ is the way that the centres have gone past each other: a contact remembers its
*anchor* a, and ξ is what a + l, l = x₁ − x₂, has along the surfaces. So forces within a step depend on places alone, and
every method sees the same spring. At the end of every step anchors are brought up to date: springs that slide give way,
contacts that have ended are forgotten.

Each of two remembers their contact for itself, by the row of the other. What they work out is opposite bit by bit, as all
of it is odd in l and v.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import atomic_add, kernel, lanes, on_stack, outlined
from particlesim.compiler.barrier import meet
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site, lone
from particlesim.engine.interactions.near_pairs import (
    NearLists,
    NearPairs,
    bring_up,
    look_in,
    near_pairs_of,
)
from particlesim.engine.interactions.neighbours.record import (
    DUE,
    GROUP,
    TURN,
    Neighbours,
    enlarged,
    forget,
)
from particlesim.engine.interactions.neighbours.search import AT_ONCE
from particlesim.engine.interactions.pair_blocks import Block
from particlesim.engine.interactions.touching import normal_of, touching
from particlesim.engine.state.columns import type_of
from particlesim.interactions import PairSet
from particlesim.laws.contact import touch

KISSING = 12
"""Spheres that touch one of their size at most; room for contacts of a particle among others of about its size."""
MOST_ROOM = 48
"""Contacts per particle, on average, to have room for at first."""
SIDE, LOST = range(2)
"""In `flags` of a memory: which half holds, and whether contacts found no room."""


class Memory(NamedTuple):
    """What contacts remember, for every particle in places [begin[i], begin[i + 1]), of which it uses `used`; all of it
    twice, as a new half is written from the old one.

    `begin` [n + 1], `used` [2, n], `partner` [2, room]: row of the other; `anchor` [2, 3, room] [m]; `slides` [2, room]; and
    `flags`.
    """

    begin: Any
    used: Any
    partner: Any
    anchor: Any
    slides: Any
    flags: Any


class ContactColumns(NamedTuple):
    """Contacts of one law: the first ten as in `NearColumns`; `memory` is None without friction."""

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
    memory: Any


class Contacts(NearLists, ContactColumns):
    """Soft contacts, looked for among near pairs before every sum of forces."""

    __slots__ = ()
    prepares: ClassVar[bool] = True
    concludes: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(ContactColumns._fields) - {"memory"}

    def prepare(self, c: Any, share: Any, t: Any) -> None:
        near, groups = self.near, self.near.begin.size
        changed = bring_up(self, c, share, t)
        if changed or near.report[DUE] != 0:
            while True:
                first = atomic_add(near.report, TURN, AT_ONCE)
                if first >= groups:
                    break
                for g in range(first, min(first + AT_ONCE, groups)):
                    push_on(self, g, t)
            meet(share.gate, share.threads)
            if share.number == 0:
                near.report[DUE] = 0

    def conclude(self, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
        if self.memory is not None:
            near, groups = self.near, self.near.begin.size
            bring_up(self, c, share, t)
            while True:
                first = atomic_add(near.report, TURN, AT_ONCE)
                if first >= groups:
                    break
                for g in range(first, min(first + AT_ONCE, groups)):
                    remember(self, g, t)
            meet(share.gate, share.threads)
            if share.number == 0:
                self.memory.flags[SIDE] = 1 - self.memory.flags[SIDE]
                near.report[DUE] = 1
            meet(share.gate, share.threads)

    def renewed(self) -> Self:
        forget(self.near)
        near, memory = enlarged(self.near), self.memory
        if memory is not None and memory.flags[LOST]:
            memory = resized(memory, 2 * np.diff(memory.begin), np.arange(memory.used.shape[1]))
        if near is self.near and memory is self.memory:
            return self
        return self._replace(near=near, memory=memory)

    def after(self, before: Interaction, place: Ints) -> Self:
        if self.memory is None:
            return self
        assert isinstance(before, Contacts)
        room = np.diff(self.memory.begin)
        kept = np.flatnonzero(place >= 0)
        room[place[kept]] = np.maximum(room[place[kept]], np.diff(before.memory.begin)[kept])
        return self._replace(memory=resized(before.memory, room, place))

    def energy(self, c: Any) -> float:
        return float(contact_sum(self, c._replace(clock=None), lone(c.x.size), 0.0, Energies))

    @property
    def spends(self) -> bool:
        return self.law.beta > 0 or self.memory is not None

    def power(self, c: Any, t: float) -> float:
        return float(contact_sum(self, c, lone(c.x.size), t, Powers))

    def changing(self) -> tuple[NDArray[Any], ...]:
        return () if self.memory is None else tuple(self.memory)

    def with_changed(self, arrays: Sequence[NDArray[Any]]) -> Self:
        return self if self.memory is None else self._replace(memory=Memory(*arrays))


# Forces


def place_in(memory: Any, side: Any, row: Any, other: Any) -> Any:
    """Where a particle remembers its contact with another one; −1: nowhere."""
    begin, found = memory.begin[row], -1
    for k in range(begin, begin + memory.used[side, row]):
        if memory.partner[side, k] == other:
            found = k
    return found


class Grip(NamedTuple):
    """How a contact holds along the surfaces: the stretch ξ of its spring [m], the force of spring and damper [N] and what
    is left of it, 1 where it holds; and whether it slides."""

    x: Any
    y: Any
    z: Any
    fx: Any
    fy: Any
    fz: Any
    part: Any
    slides: Any


def grip_of(each: Any, row: Any, other: Any, p: Any, n: Any, at: Any, push: Any, rate: Any) -> Any:
    """The grip of a contact that is pushed with a force `push` along n and opens at a `rate`."""
    memory, friction, none = each.memory, each.law.friction, push - push
    side = memory.flags[SIDE]
    k = place_in(memory, side, row, other)
    known, slot = k >= 0, max(k, 0)
    x = memory.anchor[side, 0, slot] + p.x if known else none
    y = memory.anchor[side, 1, slot] + p.y if known else none
    z = memory.anchor[side, 2, slot] + p.z if known else none
    slid = known & (memory.slides[side, slot] != 0)
    along = x * n.x + y * n.y + z * n.z
    x, y, z = x - along * n.x, y - along * n.y, z - along * n.z
    fx = -(at.stiffness * x + at.rub * (p.vx - rate * n.x))
    fy = -(at.stiffness * y + at.rub * (p.vy - rate * n.y))
    fz = -(at.stiffness * z + at.rub * (p.vz - rate * n.z))
    size = np.sqrt(fx * fx + fy * fy + fz * fz)
    pressed = max(push, none)
    slides = size > (friction.kinetic if slid else friction.static) * pressed
    one = type_of(push, 1)
    # a static coefficient below the kinetic one must not speed up what slides
    part = min(friction.kinetic * pressed / size, one) if slides else one
    return Grip(x, y, z, fx, fy, fz, part, slides)


def force_between(each: Any, row: Any, other: Any, p: Any) -> Any:
    """Force on the first of a pair that touches, its elastic push, and the rate at which it opens."""
    n = normal_of(p, row, other)
    at = touch(each.law, p, n.overlap)
    rate = p.vx * n.x + p.vy * n.y + p.vz * n.z
    push = at.push - at.damping * rate
    if each.memory is None:
        return push * n.x, push * n.y, push * n.z, at, rate
    g = grip_of(each, row, other, p, n, at, push, rate)
    return push * n.x + g.part * g.fx, push * n.y + g.part * g.fy, push * n.z + g.part * g.fz, at, rate


class Forces(NamedTuple):
    """Forces of contacts, added to sums [3, GROUP]."""

    sums: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Add the force on lane i of a group."""
        fx, fy, fz, _, _ = force_between(each, row, other, p)
        self.sums[0, i] += fx
        self.sums[1, i] += fy
        self.sums[2, i] += fz


class Energies(NamedTuple):
    """Elastic energies of contacts, half to each of a pair, added to sums [1]."""

    sums: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Add half of the energy of a pair."""
        self.sums[0] += 0.5 * float(touch(each.law, p, normal_of(p, row, other).overlap).energy)


class Powers(NamedTuple):
    """Powers of all forces of contacts but the elastic push, half to each of a pair, added to sums [1]."""

    sums: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Add half of the power of a pair."""
        fx, fy, fz, at, rate = force_between(each, row, other, p)
        self.sums[0] += 0.5 * float(fx * p.vx + fy * p.vy + fz * p.vz - at.push * rate)


@outlined
def push_on(each: Any, g: Any, t: Any) -> None:
    """Sum up the forces on the members of a group."""
    sums = on_stack(3, GROUP, each.near.x.dtype)
    for i in range(GROUP):
        sums[0, i] = sums[1, i] = sums[2, i] = 0
    touching(each, g, Forces(sums), t)
    for i in lanes(GROUP):
        for k in range(3):
            each.pull[GROUP * g + i, k] = sums[k, i]


@kernel
def contact_sum(each: Any, c: Any, share: Any, t: Any, what: Any) -> float:
    """A sum over all contacts: `Energies` [J] or `Powers` [W]."""
    look_in(each, c, share, t)
    sums = on_stack(1, 1, np.float64)[0]
    sums[0] = 0.0
    for g in range(each.near.begin.size):
        touching(each, g, what(sums), t)
    return sums[0]


# Memory


class Anchors(NamedTuple):
    """New anchors of contacts go to the other half of the memory."""

    side: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Remember a contact; springs that slide give way."""
        memory, none = each.memory, p.x - p.x
        k = memory.begin[row] + memory.used[self.side, row]
        if k >= memory.begin[row + 1]:
            memory.flags[LOST] = 1
        else:
            n = normal_of(p, row, other)
            at = touch(each.law, p, n.overlap)
            rate = p.vx * n.x + p.vy * n.y + p.vz * n.z
            push = at.push - at.damping * rate
            g = grip_of(each, row, other, p, n, at, push, rate)
            pull = at.stiffness * np.sqrt(g.x * g.x + g.y * g.y + g.z * g.z)
            limit = each.law.friction.kinetic * max(push, none)
            keep = limit / pull if g.slides & (pull > limit) else type_of(none, 1)
            memory.partner[self.side, k] = other
            memory.anchor[self.side, 0, k] = keep * g.x - p.x
            memory.anchor[self.side, 1, k] = keep * g.y - p.y
            memory.anchor[self.side, 2, k] = keep * g.z - p.z
            memory.slides[self.side, k] = 1 if g.slides else 0
            memory.used[self.side, row] += 1


@outlined
def remember(each: Any, g: Any, t: Any) -> None:
    """Write the new half of the memory for the members of a group."""
    side = 1 - each.memory.flags[SIDE]
    for i in range(GROUP):
        row = each.near.order[GROUP * g + i]
        if row >= 0:
            each.memory.used[side, row] = 0
    touching(each, g, Anchors(side), t)


def new_memory(room: Ints, dtype: Any) -> Memory:
    """A memory of nothing, with room for some contacts of every particle."""
    begin = np.concatenate([[0], np.cumsum(room)]).astype(np.int64)
    size = int(begin[-1])
    return Memory(
        begin,
        np.zeros((2, len(room)), np.int64),
        np.zeros((2, size), np.int64),
        np.zeros((2, 3, size), dtype),
        np.zeros((2, size), np.int8),
        np.zeros(2, np.int64),
    )


def resized(memory: Memory, room: Ints, place: Ints) -> Memory:
    """What holds of a memory, of which row k is row `place[k]` now, −1 if it is gone, with other room."""
    made = new_memory(room, memory.anchor.dtype)
    side = int(memory.flags[SIDE])
    used = memory.used[side]
    rows = np.repeat(np.arange(len(used)), used)
    at = memory.begin[rows] + np.arange(len(rows)) - np.repeat(np.cumsum(used) - used, used)
    partner = memory.partner[side, at]
    left = (place[rows] >= 0) & (place[partner] >= 0)
    at, rows, partner = at[left], place[rows[left]], place[partner[left]]
    order = np.argsort(rows, kind="stable")
    at, rows, partner = at[order], rows[order], partner[order]
    count = np.bincount(rows, minlength=len(room))
    to = made.begin[rows] + np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
    made.used[0] = count
    made.partner[0, to] = partner
    made.anchor[0][:, to] = memory.anchor[side][:, at]
    made.slides[0, to] = memory.slides[side, at]
    return made


def room_for(radius: Floats) -> Ints:
    """Contacts to have room for, by radii: as many spheres of the least size as find place on one, while that is not too
    many in all."""
    if not radius.size:
        return np.zeros(0, np.int64)
    least = radius.min()
    while True:
        room = np.ceil(KISSING / 4 * (1 + np.maximum(radius / least, 1)) ** 2).astype(np.int64)
        if room.mean() <= MOST_ROOM:
            return room
        least *= 1.25


def with_masses(site: Site, found: NearPairs) -> NearPairs:
    """Near pairs that know inverse masses, 0 of what is held, as their numbers `a`."""
    seen = found.seen._replace(a=np.zeros(found.near.order.size, site.dtype))
    return found._replace(a=site.inverse_mass().astype(site.dtype), seen=seen)


def contacts_of(site: Site, pairs: PairSet) -> Contacts:
    """Soft contacts among the particles of an island."""
    found, memory = with_masses(site, near_pairs_of(site, pairs)), None
    if pairs.law.record().friction is not None:  # type: ignore[attr-defined]
        memory = new_memory(room_for(site.whole.radius[: site.whole.count].astype(float)), site.dtype)
    return Contacts(*found, memory)
