"""Connected components of rods, with an order of elimination and its pattern, found once.

Rods that share a free particle are coupled; held particles couple nothing. Of the rods that are left, the one that is
coupled to the fewest others is eliminated next (minimum degree), which takes chains and trees from their ends, without fill.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.constraints.blows import new_blows
from particlesim.engine.constraints.contact_forces import Touch, new_touch
from particlesim.engine.constraints.shake_rattle import Bench, Rig, Rods
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints

MOST_UPDATES = 50_000_000
"""Operations of an elimination beyond which rods are too entangled."""


class Pattern(NamedTuple):
    """The elimination of all rods: their order (components one after the other), the borders of components, and for each
    rod in that order the places of those in its row that come later."""

    order: Ints
    borders: Ints
    later: list[Ints]


def new_rig(first: Ints, second: Ints, length: Floats, inverse: Floats) -> tuple[Rig, Ints]:
    """Rods with ends in rows `first` and `second` of an island and lengths [m]; `inverse` is 1/m of all its particles, 0 for
    those that are held. Also which of the rods each one of the rig is.

    Raises UsageError for rods that are connected in too many ways.
    """
    coupled = _links(first, second, inverse)
    pattern = _pattern(len(first), coupled, _components(first, second, inverse))
    order = pattern.order
    first, second, length = first[order], second[order], length[order]
    component = np.repeat(np.arange(len(pattern.borders) - 1), np.diff(pattern.borders))
    rows, slots, ends = _slots(first, second, component)
    pointer = np.concatenate([[0], np.cumsum([len(each) for each in pattern.later], dtype=np.int64)])
    later = np.concatenate([np.empty(0, np.int64), *pattern.later])
    target, turn = _targets(pointer, pattern.later)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    one, other, shared, sign = (coupled[0], coupled[1], coupled[2], coupled[3])
    one, other = np.minimum(place[one], place[other]), np.maximum(place[one], place[other])
    turns = np.lexsort((other, one))
    one, other, shared, sign = one[turns], other[turns], shared[turns], sign[turns]
    entry = np.array(
        [
            pointer[e] + np.searchsorted(pattern.later[e], f)
            for e, f in zip(one.tolist(), other.tolist(), strict=True)
        ],
        np.int64,
    )
    mobile = inverse[rows]
    rig = Rig(
        rows,
        mobile,
        ends[0],
        ends[1],
        length**2,
        pointer,
        later,
        target,
        turn,
        one,
        other,
        entry,
        sign * inverse[shared],
        pattern.borders,
        slots,
        np.searchsorted(one, pattern.borders),
        np.minimum.reduceat(length, pattern.borders[:-1]),
        _looped(mobile, slots, ends, pattern.borders),
    )
    return rig, order


def new_rods(rig: Rig, *, eager: bool, touched: bool) -> Rods:
    """All rods of a rig, with scratch arrays, for one thread."""
    rods, slots, entries = len(rig.first), len(rig.rows), len(rig.later)
    components = len(rig.looped)
    bench = Bench(
        np.zeros((3, slots)),
        np.zeros((3, rods)),
        np.zeros((3, rods)),
        np.zeros(rods),
        np.zeros(rods),
        np.zeros(rods),
        np.zeros(rods),
        np.zeros(rods),
        np.ones(rods, np.bool_),
        np.zeros(entries),
        np.zeros(entries),
    )
    effort, failed = np.zeros(components), np.full(components, -1)
    blows = new_blows(slots, components, _room(rig)) if touched else new_blows(0, 0, new_touch(0, 0))
    return Rods(rig, bench, 0, components, eager, touched, effort, failed, np.zeros(components), blows)


def divided(rods: Rods, threads: int) -> list[Rods]:
    """The rods for some threads: whole components, about equally much work."""
    rig = rods.rig
    cost = np.cumsum(np.concatenate([[0.0], _work(rig)]))
    borders = np.searchsorted(cost, cost[-1] * np.arange(1, threads) / threads)

    def part(a: int, b: int) -> Rods:
        touch = _room(rig) if rods.touched else rods.blows.touch
        return rods._replace(first=a, last=b, blows=rods.blows._replace(touch=touch))

    return [part(a, b) for a, b in pairwise([0, *borders.tolist(), len(rig.looped)])]


def _room(rig: Rig) -> Touch:
    """Room for the contacts of one component at a time."""
    return new_touch(int(np.diff(rig.slots).max(initial=0)), int(np.diff(rig.rods).max(initial=0)))


def _work(rig: Rig) -> Floats:
    """About how much work every component is."""
    total = np.arange(len(rig.first) + 1) * 8.0 + rig.pointer + rig.turn
    return np.diff(total[rig.rods])


def _links(first: Ints, second: Ints, inverse: Floats) -> tuple[Ints, Ints, Ints, Floats]:
    """Pairs of rods that share a free particle, the particle, and whether both begin or both end there (1) or not (−1)."""
    rods = np.tile(np.arange(len(first)), 2)
    ends = np.concatenate([first, second])
    sign = np.repeat([1.0, -1.0], len(first))
    free = np.flatnonzero(inverse[ends] > 0)
    by_particle = free[np.argsort(ends[free], kind="stable")]
    rods, ends, sign = rods[by_particle], ends[by_particle], sign[by_particle]
    found = []
    for apart in range(1, int(np.bincount(ends).max(initial=0))):
        k = np.flatnonzero(ends[apart:] == ends[:-apart])
        found.append((rods[k], rods[k + apart], ends[k], sign[k] * sign[k + apart]))
    if not found:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    one, other, shared, signs = (np.concatenate(part) for part in zip(*found, strict=True))
    return one, other, shared, signs


def _components(first: Ints, second: Ints, inverse: Floats) -> Ints:
    """The number of the component of every rod, in the order of their first rods."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rods, count = len(first), len(inverse)
    ends, own = np.concatenate([first, second]), np.tile(np.arange(rods), 2)
    free = inverse[ends] > 0
    graph = coo_array(
        (np.ones(int(free.sum()), np.int8), (own[free], rods + ends[free])),
        shape=(rods + count, rods + count),
    )
    label = connected_components(graph, directed=False)[1][:rods]
    _, begins, number = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty_like(begins)
    rank[np.argsort(begins)] = np.arange(len(begins))
    return np.asarray(rank[number.ravel()])


def _pattern(rods: int, coupled: tuple[Ints, Ints, Ints, Floats], component: Ints) -> Pattern:
    """Eliminate rods by minimum degree, those of a component together."""
    near: list[set[int]] = [set() for _ in range(rods)]
    for a, b in zip(coupled[0].tolist(), coupled[1].tolist(), strict=True):
        near[a].add(b)
        near[b].add(a)
    of = component.tolist()
    heap = [(of[e], len(near[e]), e) for e in range(rods)]
    heapify(heap)
    order: list[int] = []
    rows: list[set[int]] = []
    done = bytearray(rods)
    updates = 0
    while heap:
        _, degree, e = heappop(heap)
        if done[e] or degree != len(near[e]):
            continue
        done[e] = 1
        order.append(e)
        left = near[e]
        rows.append(left)
        updates += degree * degree // 2
        if updates > MOST_UPDATES:
            raise UsageError(
                f"{rods:,} rods are connected in too many ways: holding them takes more than {MOST_UPDATES:,} operations a "
                "step",
                "use springs for most of them",
            )
        for f in left:
            others = near[f]
            others |= left
            others.discard(e)
            others.discard(f)
            heappush(heap, (of[f], len(others), f))
    place = np.empty(rods, np.int64)
    place[order] = np.arange(rods)
    later = [np.sort(place[list(row)]) if row else np.empty(0, np.int64) for row in rows]
    borders = np.concatenate([[0], np.cumsum(np.bincount(component))]).astype(np.int64)
    return Pattern(np.array(order, np.int64), borders, later)


def _targets(pointer: Ints, later: list[Ints]) -> tuple[Ints, Ints]:
    """Entries that every elimination changes, and where those of every rod begin."""
    found, turn = [np.empty(0, np.int64)], [0]
    for row in later:
        for k, e in enumerate(row[:-1].tolist()):
            found.append(pointer[e] + np.searchsorted(later[e], row[k + 1 :]))
        turn.append(turn[-1] + len(row) * (len(row) - 1) // 2)
    return np.concatenate(found), np.array(turn, np.int64)


def _slots(first: Ints, second: Ints, component: Ints) -> tuple[Ints, Ints, tuple[Ints, Ints]]:
    """Rows of the particles of every component, where those of each begin, and the slots of both ends of every rod."""
    number = int(max(first.max(), second.max())) + 1
    keys = [component * number + end for end in (first, second)]
    distinct = np.unique(np.concatenate(keys))
    slots = np.searchsorted(distinct // number, np.arange(component[-1] + 2))
    one, other = (np.searchsorted(distinct, key) for key in keys)
    return distinct % number, slots, (one, other)


def _looped(mobile: Floats, slots: Ints, ends: tuple[Ints, Ints], borders: Ints) -> NDArray[np.bool_]:
    """Whether rods of a component may depend on each other: they close a loop, or join two held places by a chain."""
    held = mobile == 0
    free = np.diff(np.concatenate([[0], np.cumsum(~held)])[slots])
    tied = np.diff(np.concatenate([[0], np.cumsum(held[ends[0]] | held[ends[1]])])[borders]) > 0
    # A tree of free particles has one rod less than particles, one that hangs on a single held place as many.
    return np.asarray(np.diff(borders) > free - 1 + tied)
