"""Pairs that may touch, and the memory of their contacts, both contiguous.

Whenever neighbour lists are new, the pairs whose gap is smaller than the skin are taken out of them. The order of particles
in the neighbour lists is cut into *chunks*; a pair within a chunk is listed once, and a pair of two chunks in both, so that
one thread sums the forces on a chunk without the others. The memory of such a pair is the same in both: when the two
particles are exchanged, forces and anchors change their sign, and the rolling displacement stays as it is.

A pair and its memory have the same index. New lists look up the memory of their pairs in the old ones, which therefore keep
the order in which they were made.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import lanes, on_stack, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.interaction import Ints
from particlesim.engine.interactions.neighbours.record import (
    BUILDS,
    FAR,
    GROUP,
    IMAGE_SHIFT,
    MOST,
    NO_ROOM,
    SLICES,
    slice_of,
)
from particlesim.model.arrays import packed

CHUNK_GROUPS, LARGE_CHUNK, MANY = 64, 256, 32
"""Groups of a chunk: as many as leave most pairs inside, but few enough for threads to share their work; the larger number
where that leaves many chunks."""
ROOM = 8
"""Pairs for each particle to have room for at first: those of a dense heap, of which some are in two chunks."""
APART, HOLDS, SLIDES = range(3)
"""Whether a pair touches, and how."""
KNOWN = 3
"""In `anchor`: where that stands."""
BUILT, WANTED, FRESH, ROUND = range(4)
"""In `report`: the number of the neighbour lists that these are made from, how many pairs there have been at most, whether
forces are those of the present state since it was concluded, and how often memories have been brought up to date, from 1
on."""

Array = NDArray[Any]


class Memory(NamedTuple):
    """What contacts remember: `anchor` [room, 4], the stretch of the spring along the surfaces less the distance of the
    centres [m], and whether and how they touch; `rolled` [room, 4], the way rolled [m], None without rolling friction."""

    anchor: Any
    rolled: Any

    @property
    def state(self) -> Array:
        """Whether pairs touch, and how."""
        return np.asarray(self.anchor[:, KNOWN])


class Lists(NamedTuple):
    """Pairs of every group, at `begin` [groups], as many as `count`, NO_ROOM if there was none: `first` and `second` [room]
    are their places, that of the second as in neighbour lists with the number of its image.

    `order` [places] and `place` [n] are those of the neighbour lists that they are made from; `time` [1]: the end of the
    last step [s]; `report`. `memory`: None where contacts need none.
    """

    begin: Any
    count: Any
    first: Any
    second: Any
    order: Any
    place: Any
    time: Any
    report: Any
    memory: Any


class Draft(NamedTuple):
    """Where new lists are made, as in `Lists`; `slow` [chunks]: whether a chunk lacks the pairs of a group."""

    begin: Any
    count: Any
    first: Any
    second: Any
    slow: Any
    memory: Any


def chunk_groups(groups: Any) -> Any:
    """Groups of a chunk, of as many groups."""
    return LARGE_CHUNK if groups >= MANY * LARGE_CHUNK else CHUNK_GROUPS


def chunks_of(places: int) -> int:
    """How many chunks there are."""
    groups = places // GROUP
    return int(-(-groups // chunk_groups(groups)))


def new_memory(room: int, dtype: Any, *, rolls: bool) -> Memory:
    """A memory of nothing."""
    return Memory(packed((room, 4), dtype), packed((room, 4), dtype) if rolls else None)


def new_lists(places: int, particles: int, room: int, memory: Memory | None) -> Lists:
    """Lists of nothing."""
    groups = places // GROUP
    report = np.zeros(8, np.int64)
    report[BUILT], report[ROUND] = -1, 1
    return Lists(
        np.zeros(groups, np.int64),
        np.zeros(groups, np.int64),
        packed((room,), np.int32),
        packed((room,), np.uint32),
        np.full(places, -1, np.int32),
        np.full(particles, -1, np.int32),
        np.zeros(1),
        report,
        memory,
    )


def draft_for(lists: Lists) -> Draft:
    """Room to make new lists in."""
    groups, places, room, memory = len(lists.begin), lists.order.size, lists.first.size, lists.memory
    return Draft(
        np.zeros(groups, np.int64),
        np.zeros(groups, np.int64),
        packed((room,), np.int32),
        packed((room,), np.uint32),
        np.zeros(chunks_of(places), np.int8),
        None if memory is None else new_memory(room, memory.anchor.dtype, rolls=memory.rolled is not None),
    )


def lists_of(
    members: Ints, places: int, particles: int, room: int, pairs: tuple[Ints, Ints], memory: Memory, at: Ints
) -> Lists:
    """Lists of members in the order of their rows, that hold what pairs of rows (i, j) have at places `at` of a memory,
    from which the lists of a next step are made. A pair may be among them once or twice."""
    place = np.full(particles, -1)
    place[members] = np.arange(len(members))
    i, j = (place[each] for each in pairs)
    chunk = GROUP * chunk_groups(places // GROUP)
    once = (i // chunk == j // chunk) & (i > j)  # is listed with the smaller one there
    sign = np.where(once, -1, 1)
    i, j = np.where(once, j, i), np.where(once, i, j)
    _, kept = np.unique(i * (particles + 1) + j, return_index=True)
    i, j, at, sign = i[kept], j[kept], at[kept], sign[kept]
    room = max(room, len(i))
    remembered = new_memory(room, memory.anchor.dtype, rolls=memory.rolled is not None)
    lists = new_lists(places, particles, room, remembered)
    lists.order[: len(members)] = members
    lists.place[:] = place
    count = np.bincount(i // GROUP, minlength=len(lists.count))
    lists.count[:] = count
    lists.begin[:] = np.cumsum(count) - count
    lists.first[: len(i)], lists.second[: len(i)] = i, j
    for mine, theirs in zip(remembered, memory, strict=True):
        if mine is not None:
            mine[: len(i)] = theirs[at]
    remembered.anchor[: len(i), :KNOWN] *= sign[:, None]  # not the way rolled (`_copy`)
    return lists


def contacts_in(lists: Lists) -> tuple[Ints, Ints, Ints]:
    """Rows of both ends of all pairs that touch, and their places in the lists."""
    count = np.maximum(lists.count, 0)
    at = np.repeat(lists.begin - np.cumsum(count) + count, count) + np.arange(count.sum())
    at = at[lists.memory.state[at] != APART]
    return (
        lists.order[lists.first[at]].astype(np.int64),
        lists.order[lists.second[at] & MOST - 1].astype(np.int64),
        at,
    )


# Kernels


def made(lists: Any, draft: Any, near: Any, share: Any) -> None:
    """Bring the lists up to the neighbour lists. All threads must call it, when neighbour lists hold."""
    if lists.report[BUILT] != near.report[BUILDS]:
        _make(lists, draft, near, share)


@outlined
def _make(lists: Any, draft: Any, near: Any, share: Any) -> None:
    groups = near.begin.size
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(groups, s)
        for g in range(first, last):
            draft.count[g] = _pairs(draft, near, g, 0, False)
    meet(share.gate, share.threads)
    if share.number == 0:
        end, room = 0, min(lists.first.size, draft.first.size)
        for chunk in range(draft.slow.size):
            draft.slow[chunk] = 0
        for g in range(groups):
            draft.begin[g] = end
            number = draft.count[g]
            fits = (number >= 0) & (end + max(number, 0) <= room)
            end += max(number, 0)
            if not fits:
                draft.count[g] = NO_ROOM
                draft.slow[g // chunk_groups(groups)] = 1
        # a later, shorter list does not make good for it
        lists.report[WANTED] = max(lists.report[WANTED], end)
    meet(share.gate, share.threads)
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(groups, s)
        for g in range(first, last):
            if draft.count[g] > 0:
                _pairs(draft, near, g, draft.begin[g], True)
                if lists.memory is not None:
                    _recall(lists, draft, near, g)
    meet(share.gate, share.threads)
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(groups, s)
        for g in range(first, last):
            lists.begin[g], lists.count[g] = draft.begin[g], draft.count[g]
            for k in range(draft.begin[g], draft.begin[g] + max(draft.count[g], 0)):
                lists.first[k], lists.second[k] = draft.first[k], draft.second[k]
                if lists.memory is not None:
                    _copy(lists.memory, k, draft.memory, k, 1)
            for k in range(GROUP * g, GROUP * g + GROUP):
                row = near.order[k]
                lists.order[k] = row
                if row >= 0:
                    lists.place[row] = k
    if share.number == 0:
        lists.report[BUILT] = near.report[BUILDS]
    meet(share.gate, share.threads)


def _pairs(draft: Any, near: Any, g: Any, at: Any, keeps: Any) -> Any:
    """Count the pairs of a group, and, if it `keeps` them, write them from `at` on."""
    if near.box is None:
        return _pairs_of(draft, near, g, at, keeps, False)
    return _pairs_of(draft, near, g, at, keeps, True)


@outlined
def _pairs_of(draft: Any, near: Any, g: Any, at: Any, keeps: Any, shifted: Any) -> Any:
    if near.count[g] == NO_ROOM:
        return NO_ROOM
    begin, end, size = near.begin[g], at, chunk_groups(near.begin.size)
    low = g // size * size * GROUP
    high = low + size * GROUP
    base, radii, skin = near.base, near.radii, near.cutoff + near.skin[0]
    first = GROUP * g
    x, y, z, r = (row[first : first + GROUP] for row in (base[0], base[1], base[2], radii))
    depth = on_stack(1, GROUP, np.float64)[0]
    for j in range(begin, begin + near.count[g]):
        entry = near.candidates[j]
        q = entry & (MOST - 1)
        u, v, w, s = float(base[0, q]), float(base[1, q]), float(base[2, q]), float(radii[q]) + skin
        if shifted:
            image = entry >> IMAGE_SHIFT
            u, v, w = u + near.images[0, image], v + near.images[1, image], w + near.images[2, image]
        least = q if (low <= q) & (q < high) else MOST
        for i in lanes(GROUP):
            dx, dy, dz, reach = x[i] - u, y[i] - v, z[i] - w, r[i] + s
            there = (first + i < least) & (x[i] < FAR) & (u < FAR)
            depth[i] = reach * reach - (dx * dx + dy * dy + dz * dz) if there else -1.0
        for i in range(GROUP):
            hit = depth[i] > 0.0
            if hit & keeps:
                draft.first[end] = first + i
                draft.second[end] = entry
            end += 1 if hit else 0
    return end - at


@outlined
def _recall(lists: Any, draft: Any, near: Any, g: Any) -> None:
    """Look up what the pairs of a group remember."""
    chunk = GROUP * chunk_groups(near.begin.size)
    for k in range(draft.begin[g], draft.begin[g] + draft.count[g]):
        row, other = near.order[draft.first[k]], near.order[draft.second[k] & (MOST - 1)]
        draft.memory.anchor[k, KNOWN] = APART
        p, q, sign = lists.place[row], lists.place[other], 1
        if (p >= 0) & (q >= 0):
            if (p // chunk == q // chunk) & (q < p):
                p, q, sign = q, p, -1
            begin = lists.begin[p // GROUP]
            end = begin + max(lists.count[p // GROUP], 0)
            # the last of those that are the pair, in vectors, and how many are: with several images, one may touch
            found, number = -1, 0
            for j in range(begin, end):
                same = (lists.first[j] == p) & ((lists.second[j] & (MOST - 1)) == q)
                found = max(found, j if same else -1)
                number += 1 if same else 0
            while (number > 1) & (found > begin) and not _touches(lists, p, q, found):
                found -= 1
            if found >= begin and _touches(lists, p, q, found):
                _copy(draft.memory, k, lists.memory, found, sign)


def _touches(lists: Any, p: Any, q: Any, j: Any) -> Any:
    """Whether the pair j is that of two places, and touches."""
    same = (lists.first[j] == p) & ((lists.second[j] & (MOST - 1)) == q)
    return same & (lists.memory.anchor[j, KNOWN] != APART)


def _copy(memory: Any, k: Any, other: Any, j: Any, sign: Any) -> None:
    """Memory k as another one has it; `sign` is −1 for a pair that is the other way around.

    The anchor changes its sign with the pair. The way rolled, R ∫ (ω₁ − ω₂) × n dt, does not, as both factors do.
    """
    for axis in range(KNOWN):
        memory.anchor[k, axis] = sign * other.anchor[j, axis]
    memory.anchor[k, KNOWN] = other.anchor[j, KNOWN]
    if memory.rolled is not None:
        for axis in range(KNOWN + 1):
            memory.rolled[k, axis] = other.rolled[j, axis]
