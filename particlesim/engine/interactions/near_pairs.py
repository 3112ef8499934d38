"""Interactions of near pairs, summed over neighbour lists.

Before every sum of forces all threads together update the lists; then each takes groups of eight neighbours, one after
another. The eight are the lanes of vectors, and candidates follow one by one: sums are vectorised without changing their
order, which is that of the lists on any thread. So results have the same bits for any number of threads. Each pair is
computed twice; the third law holds to rounding, as f(l) and f(−l) are computed separately. Where nothing has changed since
the last sum, as between two steps of a leapfrog, its forces are used again.

A group whose list has no room finds its candidates at every sum, in the same order: slower, with the same bits.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, lanes, on_stack
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.coincident import refuse_coincident
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site, lone
from particlesim.engine.interactions.near_sums import (
    energy_terms,
    groups_of,
    pull_all,
    push_on,
    sum_group,
    virial_terms,
)
from particlesim.engine.interactions.neighbours.record import (
    DUE,
    GROUP,
    MOST,
    USES,
    Neighbours,
    enlarged,
    forget,
    new_neighbours,
    renumbered,
    take_over,
)
from particlesim.engine.interactions.neighbours.refresh import refresh
from particlesim.engine.interactions.neighbours.search import BATCH, search, sieve
from particlesim.engine.interactions.pair_blocks import CHARGE, Block
from particlesim.engine.interactions.pair_matrix import Push, add_terms, block_terms, product_terms
from particlesim.engine.interactions.pair_tensors import PairTensors, add_bounds, power_of, tensor_bounds
from particlesim.engine.interactions.pairs import periods_of, spans_of, what_acts
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
    """Base of all kinds that find pairs by neighbour lists; their columns begin as `NearColumns` do."""

    __slots__ = ()
    prepares: ClassVar[bool] = True
    settled: ClassVar[bool] = True
    movable: ClassVar[bool] = True
    law: Any
    a: Any
    b: Any
    ids: Any
    near: Neighbours
    pull: Any

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        type(self).add_settled(self, c, total[:, first:last], first, last, t)

    def add_settled(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        place, pull = self.near.place, self.pull
        for i in range(first, last):
            k = place[i]
            if k >= 0:
                total[0, i - first] += pull[k, 0]
                total[1, i - first] += pull[k, 1]
                total[2, i - first] += pull[k, 2]

    def among(self, rows: Ints, place: Ints) -> Self:
        each: Any = self
        near = renumbered(self.near, rows, place)
        near = near._replace(members=place[near.members])
        a, b, ids = (None if each is None else each[rows] for each in (self.a, self.b, self.ids))
        return cast("Self", each._replace(near=near, a=a, b=b, ids=ids))

    def bring_back(self, there: Self, rows: Ints, place: Ints) -> None:
        take_over(self.near, renumbered(there.near, place, rows))

    @property
    def lasts(self) -> bool:
        return True

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
        near, changed = self.near, bring_up(self, c, share, t)
        if self.ids is not None or changed or near.report[DUE] != 0:
            pull_all(self, t)
            meet(share.gate, share.threads)
            if share.number == 0:
                near.report[DUE] = 0

    def renewed(self) -> Self:
        forget(self.near)
        near = enlarged(self.near)
        return self if near is self.near else self._replace(near=near)

    def energy(self, c: Any, t: float) -> float | None:
        return None if self.spends else float(near_energy(self, c._replace(clock=None), lone(c.x.size)))

    @property
    def spends(self) -> bool:
        return not has_law(pair_potential, self.law)

    def power(self, c: Any, t: float) -> float:
        return power_of(self, c, t)

    def summary(self) -> str:
        return f"neighbour lists of {len(self.near.members)} particles"

    def virial(self, c: Any, t: float) -> Floats:
        """Σ l ⊗ f over all pairs [J], shape [3, 3]; the pressure that the forces make is its trace over 3 V."""
        out = np.zeros(9)
        near_virial(self, c._replace(clock=None), lone(c.x.size), t, out)
        return out.reshape(3, 3)


# Lists that hold, and what laws read of their members


def bring_up(each: Any, c: Any, share: Any, t: Any, further: Any = (), quiet: Any = ()) -> Any:
    """Lists that hold, and what the law reads of all members, in their order; returns whether any of it has changed. So with
    `further` columns and where they go; those that are `quiet` go there too, and whether they change does not matter."""
    columns, seen = columns_read(each, c), each.seen
    moving, fixed = _read(columns[3:6], seen[3:6]), _read(columns[6:], seen[6:])
    return refresh(each.near, c, share, t, (*moving, *further), fixed, quiet)


def _read(columns: Any, rows: Any) -> Any:
    """Columns that are read, and where what is in them goes."""
    return tuple((column, row) for column, row in zip(columns, rows, strict=True) if row is not None)


def pull_on(each: Any, i: Any) -> float:
    """How large its last force on particle i is [N]."""
    k = each.near.place[i]
    if k < 0:
        return 0.0
    x, y, z = float(each.pull[k, 0]), float(each.pull[k, 1]), float(each.pull[k, 2])
    return float(np.sqrt(x * x + y * y + z * z))


def look_in(each: Any, c: Any, share: Any, t: Any) -> None:
    """`bring_up` for others than forces, which are due afterwards."""
    bring_up(each, c, share, t)
    each.near.report[DUE] = 1


def columns_read(each: Any, c: Any) -> Any:
    """The columns of the rows of a `Block`, None where there is none."""
    charge = c.further[CHARGE] if len(c.further) > 0 else None
    return Block(c.x, c.y, c.z, c.vx, c.vy, c.vz, c.m, c.r, charge, each.a, each.b, each.ids)


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
                if (row >= 0) & (other >= 0) & (row != other) & one:  # the last group is filled up
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


def near_pairs_of(site: Site, pairs: PairSet, uses: tuple[int, int] = USES) -> NearPairs:
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
        uses=uses,
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
