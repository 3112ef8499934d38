"""Interactions of pairs that are near: every particle looks at those that neighbour lists name.

Before every sum of forces all threads together bring the lists up to date, and then take groups of eight neighbours by
turns. The eight are the lanes of vectors, while candidates go by one after the other: sums are vectorised without changing
their order, which is that of the lists, whoever computes them. So results have the same bits for any number of threads.
Each pair is taken twice; the third law holds to rounding, as f(l) and f(−l) are computed one by one. Where nothing has
changed since the last sum, as between two steps of a leapfrog, forces are those of the last sum.

A group whose list has no room finds its candidates at every sum, in the same order: slower, with the same bits.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import atomic_add, kernel, lanes, on_stack, outlined
from particlesim.compiler.barrier import meet
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site, lone
from particlesim.engine.interactions.neighbours.record import (
    DUE,
    FAR,
    GROUP,
    IMAGE_SHIFT,
    MOST,
    NO_ROOM,
    TURN,
    Neighbours,
    enlarged,
    forget,
    new_neighbours,
)
from particlesim.engine.interactions.neighbours.refresh import refresh
from particlesim.engine.interactions.neighbours.search import AT_ONCE, BATCH, search, sieve
from particlesim.engine.interactions.pair_blocks import CHARGE, Block, energy_in, force_in, pair_of
from particlesim.engine.interactions.pair_matrix import Push, add_terms, block_terms, product_terms
from particlesim.engine.interactions.pair_tensors import PairTensors, add_bounds, forces_in, tensor_bounds
from particlesim.engine.interactions.pairs import periods_of, refuse_coincident, spans_of, what_acts
from particlesim.engine.state.columns import type_of
from particlesim.interactions import PairSet
from particlesim.laws.pair import pair_potential
from particlesim.laws.registry import has_law

SPRINGS = 20
"""About how many springs take as long as a particle with its neighbours."""


class NearColumns(NamedTuple):
    """An interaction of near pairs: the record of its law; squares of the distances above which and below which it acts
    [m²]; what it keeps of every particle, [n], and ids, None where the law does not read them: all as in `PairColumns`.

    Then the lists; what laws read of the particles in the order of the lists, [room], None where they do not read it; and
    the forces in that order, [room, 3]; and periods of the box, as in
    `PairColumns`.
    """

    law: tuple[Any, ...]
    least: Any
    most: Any
    a: Any
    b: Any
    ids: Any
    near: Neighbours
    seen: Block
    pull: Any
    box: Any = None


class NearLists(Interaction):
    """What all kinds have in common that find pairs by neighbour lists; their columns begin as `NearColumns` do."""

    __slots__ = ()
    prepares: ClassVar[bool] = True
    law: Any
    near: Neighbours
    pull: Any

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        place, pull = self.near.place, self.pull
        for i in range(first, last):
            k = place[i]
            if k >= 0:
                total[0, i] += pull[k, 0]
                total[1, i] += pull[k, 1]
                total[2, i] += pull[k, 2]

    @property
    def number(self) -> int:
        return int(self.near.count.sum()) * GROUP // 2

    @property
    def effort(self) -> int:
        return SPRINGS * len(self.near.members)

    def linearise(self, c: Any, t: float) -> PairTensors:
        return PairTensors(self, c, t)

    def list_pairs(self, c: Any) -> tuple[Ints, Ints]:
        """Both ends of the pairs in the lists, each pair once."""
        near_forces(self, c, lone(c.x.size), 0.0)
        near, found = self.near, [np.empty((2, 0), np.int64)]
        for g in range(near.begin.size):
            begin = int(near.begin[g])
            others = near.candidates[begin : begin + int(near.count[g])].astype(np.int64) & MOST - 1
            rows = near.order[GROUP * g : GROUP * g + GROUP].astype(np.int64)
            rows = rows[rows >= 0]
            i, j = np.repeat(rows, len(others)), np.tile(near.order[others].astype(np.int64), len(rows))
            found.append(np.stack([i, j])[:, i < j])
        i, j = np.concatenate(found, axis=1)
        if near.box is not None:  # in a small box lists may have two images of a particle
            i, j = np.unique(np.stack([i, j]), axis=1)
        return i, j

    def bounds(self, c: Any, w: Floats, t: float) -> tuple[Ints, Floats, Floats]:
        """Rows of particles, and largest stiffness [1/s²] and damping [1/s] of each; w is 1/m."""
        out = np.zeros((14, len(w)))
        near_bounds(self, c, lone(c.x.size), w, out, t)
        return np.arange(len(w)), *tensor_bounds(out)

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        near_forces(self, c, lone(c.x.size), t)
        k = int(self.near.place[row])
        return np.zeros(3) if k < 0 else np.asarray(self.pull[k].astype(float))


class NearPairs(NearLists, NearColumns):
    """An interaction of pairs with a cutoff, summed over neighbour lists."""

    __slots__ = ()
    follows: ClassVar[frozenset[str]] = frozenset(NearColumns._fields)
    numbers: ClassVar[int] = 9
    """Sums of the matrix, place by place; γ and the time in a place of their own at the end."""
    together: ClassVar[bool] = True

    def stiffen_together(self, form: Any, c: Any, s: Any, share: Any, t: Any, reach: Any) -> None:
        last = form.shape[0] - 1
        form[last, 0], form[last, 1] = reach, type_of(reach, t)
        first, end = groups_of(self, share)
        for g in range(first, end):
            push_on(self, form, g, block_terms, Push(s.lead, reach), type_of(reach, t))

    def stiffen(self, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
        for i in range(first, last):
            k = self.near.place[i]
            if k >= 0:
                add_terms(s, i, form[k])

    def multiply_together(self, form: Any, x: Any, share: Any) -> None:
        last = form.shape[0] - 1
        first, end = groups_of(self, share)
        for g in range(first, end):
            push_on(self, form, g, product_terms, Push(x, form[last, 0]), form[last, 1])

    def multiply(self, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
        for i in range(first, last):
            k = self.near.place[i]
            if k >= 0:
                for axis in range(3):
                    y[axis, i] += form[k, axis]

    def new_form(self, dtype: Any) -> NDArray[Any]:
        return np.zeros((self.near.order.size + 1, self.numbers), dtype)

    def prepare(self, c: Any, share: Any, t: Any) -> None:
        near, groups = self.near, self.near.begin.size
        changed = bring_up(self, c, share, t)
        if self.ids is not None or changed or near.report[DUE] != 0:
            while True:
                first = atomic_add(near.report, TURN, AT_ONCE)
                if first >= groups:
                    break
                for g in range(first, min(first + AT_ONCE, groups)):
                    pull_on(self, g, t)
            meet(share.gate, share.threads)
            if share.number == 0:
                near.report[DUE] = 0

    def renewed(self) -> Self:
        forget(self.near)
        near = enlarged(self.near)
        return self if near is self.near else self._replace(near=near)

    def energy(self, c: Any) -> float | None:
        return None if self.spends else float(near_energy(self, c._replace(clock=None), lone(c.x.size)))

    @property
    def spends(self) -> bool:
        return not has_law(pair_potential, self.law)

    def power(self, c: Any, t: float) -> float:
        return float((forces_in(self, c, t) * np.stack([c.vx, c.vy, c.vz])).sum(dtype=float))

    def summary(self) -> str:
        return f"neighbour lists of {len(self.near.members)} particles"

    def virial(self, c: Any, t: float) -> Floats:
        """Σ l ⊗ f over all pairs [J], shape [3, 3]; the pressure that the forces make is its trace over 3 V."""
        out = np.zeros(9)
        near_virial(self, c._replace(clock=None), lone(c.x.size), t, out)
        return out.reshape(3, 3)


# What laws see of particles in the lists


def bring_up(each: Any, c: Any, share: Any, t: Any, further: Any = (), quiet: Any = ()) -> Any:
    """Lists that hold, and what the law reads of all members, in their order; returns whether any of it has changed. So with
    `further` columns and where they go; those that are `quiet` go there too, and whether they change does not matter."""
    columns, seen = columns_read(each, c), each.seen
    moving, fixed = _read(columns[3:6], seen[3:6]), _read(columns[6:], seen[6:])
    return refresh(each.near, c, share, t, (*moving, *further), fixed, quiet)


def _read(columns: Any, rows: Any) -> Any:
    """Columns that are read, and where what is in them goes."""
    return tuple((column, row) for column, row in zip(columns, rows, strict=True) if row is not None)


def look_in(each: Any, c: Any, share: Any, t: Any) -> None:
    """`bring_up` for others than forces, which are due afterwards."""
    bring_up(each, c, share, t)
    each.near.report[DUE] = 1


def columns_read(each: Any, c: Any) -> Any:
    """The columns of the rows of a `Block`, None where there is none."""
    charge = c.further[CHARGE] if len(c.further) > 0 else None
    return Block(c.x, c.y, c.z, c.vx, c.vy, c.vz, c.m, c.r, charge, each.a, each.b, each.ids)


def members_of(each: Any, g: Any) -> Any:
    """The members of a group as a `Block`, None for what is not read."""
    first, x = GROUP * g, each.near.x
    rows = (x[0], x[1], x[2], *each.seen[3:])
    return Block(*[None if row is None else row[first : first + GROUP] for row in rows])


def lane(block: Any, i: Any) -> Any:
    """One member of a group as a `Block` of numbers."""
    x = block.x[i]
    numbers = [type_of(x, 0) if row is None else row[i] for row in block[:-1]]
    return Block(*(*numbers, None if block.id is None else block.id[i]))


def candidate(each: Any, entry: Any, shifted: Any) -> Any:
    """The place of a candidate, and what it is as a `Block` of numbers, at its image."""
    near = each.near
    q = entry & (MOST - 1) if shifted else entry
    x, y, z = near.x[0, q], near.x[1, q], near.x[2, q]
    if shifted:
        image = entry >> IMAGE_SHIFT
        x += type_of(x, near.images[0, image])
        y += type_of(x, near.images[1, image])
        z += type_of(x, near.images[2, image])
    seen = each.seen
    rest = [type_of(x, 0) if row is None else row[q] for row in seen[3:-1]]
    return q, Block(*(x, y, z, *rest, None if seen.id is None else seen.id[q]))


def groups_of(each: Any, share: Any) -> Any:
    """The groups that a thread takes where their work is known."""
    groups = each.near.begin.size
    return groups * share.number // share.threads, groups * (share.number + 1) // share.threads


# Sums over candidates


class IntoSums(NamedTuple):
    """Candidates that are in no list are added at once to the sums [terms, GROUP] of their group; `entries`: their room."""

    each: Any
    entries: Any
    terms: Any
    sums: Any
    t: Any
    push: Any

    def take(self, near: Any, g: Any, found: Any, number: Any, image: Any) -> None:
        """Add the terms of the candidates in some groups."""
        count = sieve(near, g, found, number, image, self.entries, 0)
        add_candidates(self.each, g, self.entries, 0, count, self.terms, self.sums, self.t, self.push)


def force_terms(each: Any, p: Any, counts: Any) -> Any:
    """Force on the first of a pair."""
    return force_in(each, p)


def energy_terms(each: Any, p: Any, counts: Any) -> Any:
    """Potential energy of a pair, if it counts."""
    return (energy_in(each, p, counts),)


def virial_terms(each: Any, p: Any, counts: Any) -> Any:
    """l ⊗ f of a pair, row by row."""
    f = force_in(each, p)
    return tuple(p.x * y for y in f) + tuple(p.y * y for y in f) + tuple(p.z * y for y in f)


def sum_group(each: Any, g: Any, terms: Any, sums: Any, t: Any, push: Any = None) -> None:
    """Sum up terms of the members of a group with all their candidates, into sums [terms, GROUP]; with a `Push` those of
    the matrix."""
    near = each.near
    for k in range(sums.shape[0]):
        for i in lanes(GROUP):
            sums[k, i] = 0
    if near.count[g] == NO_ROOM:
        entries = on_stack(1, GROUP * BATCH, np.uint32)[0]
        search(near, g, IntoSums(each, entries, terms, sums, t, push))
    else:
        first = near.begin[g]
        add_candidates(each, g, near.candidates, first, first + near.count[g], terms, sums, t, push)


@outlined
def add_candidates(
    each: Any,
    g: Any,
    entries: Any,
    first: Any,
    last: Any,
    terms: Any,
    sums: Any,
    t: Any,
    push: Any,
) -> None:
    """Add the terms of candidates [first, last) of some entries with the members of a group to its sums."""
    if each.near.box is None or first == last or entries[last - 1] >> IMAGE_SHIFT == 0:  # images come last
        _add(each, g, entries, first, last, terms, sums, t, push, False)
    else:
        _add(each, g, entries, first, last, terms, sums, t, push, True)


def _add(
    each: Any,
    g: Any,
    entries: Any,
    first: Any,
    last: Any,
    terms: Any,
    sums: Any,
    t: Any,
    push: Any,
    shifted: Any,
) -> None:
    near, block, own = each.near, members_of(each, g), on_stack(sums.shape[0], GROUP, sums.dtype)
    rows, x = near.order[GROUP * g : GROUP * g + GROUP], block.x
    mine: Any = None if push is None else on_stack(3, GROUP, sums.dtype)
    if push is not None:
        for i in range(GROUP):
            for axis in range(3):
                mine[axis, i] = push.x[axis, max(rows[i], 0)]
    for k in range(own.shape[0]):
        for i in lanes(GROUP):
            own[k, i] = sums[k, i]
    for j in range(first, last):
        place, other = candidate(each, entries[j], shifted)
        part = None if near.part is None else near.part[place]
        row, there = near.order[place], other.x < FAR
        for i in lanes(GROUP):
            counts = (rows[i] != row) & (x[i] < FAR) & there
            p = pair_of(lane(block, i), other, t)
            if push is None:
                for k, term in enumerate(terms(each, p, counts)):
                    own[k, i] += term if part is None else part * term
            else:  # a matrix is symmetric: who is there for a part of the step counts fully
                u = tuple([mine[axis, i] - push.x[axis, max(row, 0)] for axis in range(3)])
                for k, term in enumerate(terms(each, p, counts, u, push.reach)):
                    own[k, i] += term
    for k in range(own.shape[0]):
        for i in lanes(GROUP):
            sums[k, i] = own[k, i]


@outlined
def pull_on(each: Any, g: Any, t: Any) -> None:
    """Sum up the forces on the members of a group."""
    sums = on_stack(3, GROUP, each.near.x.dtype)
    sum_group(each, g, force_terms, sums, t)
    for i in lanes(GROUP):
        for k in range(3):
            each.pull[GROUP * g + i, k] = sums[k, i]


@outlined
def push_on(each: Any, form: Any, g: Any, terms: Any, push: Any, t: Any) -> None:
    """Sum up terms of the matrix for the members of a group."""
    if terms is block_terms:
        _push_on(each, form, g, terms, push, t, on_stack(9, GROUP, each.near.x.dtype))
    else:
        _push_on(each, form, g, terms, push, t, on_stack(3, GROUP, each.near.x.dtype))


def _push_on(each: Any, form: Any, g: Any, terms: Any, push: Any, t: Any, sums: Any) -> None:
    sum_group(each, g, terms, sums, t, push)
    for i in lanes(GROUP):
        for k in range(sums.shape[0]):
            form[GROUP * g + i, k] = sums[k, i]


# For Python, on one thread


@kernel
def near_forces(each: Any, c: Any, share: Any, t: Any) -> None:
    """Bring lists up to date and sum up all forces."""
    type(each).prepare(each, c, share, t)


@kernel
def near_energy(each: Any, c: Any, share: Any) -> float:
    """Potential energy of all pairs [J]: that of all members with their candidates counts every pair twice."""
    look_in(each, c, share, 0.0)
    sums, total = on_stack(1, GROUP, each.near.x.dtype), 0.0
    for g in range(each.near.begin.size):
        sum_group(each, g, energy_terms, sums, 0.0)
        for i in lanes(GROUP):
            total += float(sums[0, i])
    return 0.5 * total


@kernel
def near_virial(each: Any, c: Any, share: Any, t: Any, out: Any) -> None:
    """Σ l ⊗ f over all pairs [J], into out [9]."""
    look_in(each, c, share, t)
    sums = on_stack(9, GROUP, each.near.x.dtype)
    for g in range(each.near.begin.size):
        sum_group(each, g, virial_terms, sums, t)
        for k in range(9):
            for i in lanes(GROUP):
                out[k] += 0.5 * float(sums[k, i])


class IntoBounds(NamedTuple):
    """The steepness of all pairs with a member of group g is taken into account (`add_bounds`), into out [14, n]."""

    each: Any
    entries: Any
    c: Any
    w: Any
    t: Any
    out: Any

    def take(self, near: Any, g: Any, found: Any, number: Any, image: Any) -> None:
        """Take the candidates in some groups into account."""
        count = sieve(near, g, found, number, image, self.entries, 0)
        for place in range(GROUP * g, GROUP * g + GROUP):
            row = near.order[place]
            for k in range(count):
                other = near.order[self.entries[k] & MOST - 1]
                one = is_nearest(near, place, self.entries[k] & MOST - 1, image)
                if (row >= 0) & (row != other) & one:
                    add_bounds(self.each, self.c, self.w, row, other, self.t, self.out[:, row])


def is_nearest(near: Any, place: Any, other: Any, image: Any) -> Any:
    """Whether an image of a member is the one nearest to another; of images that are as near, all are."""
    found = True
    if near.box is not None:
        for axis, period in enumerate(near.box):
            if period is not None:
                d = near.x[axis, place] - near.x[axis, other] - near.images[axis, image]
                found = found & (abs(d) <= 0.5 * period)
    return found


@kernel
def near_bounds(each: Any, c: Any, share: Any, w: Any, out: Any, t: Any) -> None:
    """`add_bounds` for all particles with their candidates."""
    look_in(each, c, share, t)
    entries = on_stack(1, GROUP * BATCH, np.uint32)[0]
    for g in range(each.near.begin.size):
        search(each.near, g, IntoBounds(each, entries, c, w, t, out))


# How an interaction is laid out


def near_pairs_of(site: Site, pairs: PairSet) -> NearPairs:
    """An interaction with a cutoff among the particles of an island.

    Raises UsageError for two at one place, if they have no force there.
    """
    if pairs.law.singular() and site.began:
        with site.scenario.at_interaction(pairs.name):
            refuse_coincident(site, pairs)
    record, _, least, most, a, b, ids = what_acts(site, pairs, spans_of(site, pairs))
    law, names, touching = pairs.law, list(pairs.groups), pairs.law.touching()
    if law.between is None:
        names.sort(key=site.offset.__getitem__)
    rows = [np.arange(site.offset[name], site.offset[name] + site.state[name].count) for name in names]
    largest = (
        max((float(site.state[name].radius.max(initial=0.0)) for name in names), default=0.0)
        if touching
        else 0.0
    )
    reach, periods = law.beyond(largest) if touching else law.reach(), periods_of(site, pairs)
    assert reach is not None
    near = new_neighbours(
        np.concatenate(rows),
        site.whole.count,
        reach,
        radii=touching,
        split=None if law.between is None else len(rows[0]),
        box=periods,
        clocked=site.whole.clocked,
        dtype=site.dtype,
    )
    room, moving, read = near.order.size, law.needs_velocity(), law.needs()
    wanted = (moving, moving, moving, True, "radius" in read, "charge" in read, a is not None, b is not None)
    numbers = [np.zeros(room, site.dtype) if each else None for each in wanted]
    seen = Block(*(None, None, None, *numbers, None if ids is None else np.zeros(room, np.int64)))
    pull = np.zeros((room, 3), site.dtype)
    return NearPairs(record, least, most, a, b, ids, near, seen, pull, periods)
