"""Springs as runs (i + k, j + k), k = 0 … n − 1, so that kernels read both ends from contiguous memory.

The springs of grids are few long runs, some with holes. Runs are cut at the borders of chunks of particles, which do not
depend on the number of threads, so all first ends of a piece are in one chunk, and all second ends, and each chunk has one
owner. An owner adds to its own particles, piece after piece in one order: sums have the same bits for any number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

FIRST, SECOND, LENGTH, OFFSET, HOLES, HOLES_END, OWNS_FIRST, OWNS_SECOND = range(8)
"""Columns of a table of pieces: row of the first and of the second end, slots, index of the first of them, the range of
its holes in the list of them, and whether the thread adds to the first and to the second end."""

GAP = 4
"""Springs missing in a run that do not end it, such as those between the last particle of a row and the first of the next:
they take slots without a spring, holes."""

CHUNKS = 64
"""Chunks of an island, unless that makes them too small or too large; an island has no more threads than chunks."""
FINEST = 64
"""Particles per chunk at least where there are no pieces of bonds, as among pairs: a few hundred are worth two threads."""
LEAST, MOST = 1024, 4096
"""Particles per chunk: fewer cost too many pieces of bonds, more do not fit into a second-level cache with their forces."""


def chunk_size(count: int, least: int = LEAST) -> int:
    """Particles per chunk of an island, a multiple of 64."""
    return min(max(least, -(-count // (CHUNKS * 64)) * 64), MOST)


class Slots(NamedTuple):
    """Springs in runs: their order, the slot of each spring in that order, both ends in every slot (−1 in holes), the slots
    that are holes, and the table of pieces, shape [pieces, 6], FIRST to HOLES_END."""

    order: Ints
    slot: Ints
    i: Ints
    j: Ints
    holes: Ints
    table: Ints

    def spread(self, values: NDArray[Any], hole: Any = 0) -> NDArray[Any]:
        """The values of a property of springs in the slots of runs, with some value in holes."""
        return self.in_order(values[self.order], hole)

    def in_order(self, values: NDArray[Any], hole: Any = 0) -> NDArray[Any]:
        """The same of values that are in the order of the slots already."""
        out = np.full(len(self.i), hole, values.dtype)
        out[self.slot] = values
        return out


def in_slots(i: Ints, j: Ints, chunk: int) -> Slots:
    """Springs with ends i and j as runs, cut at multiples of `chunk` and sorted by their first ends."""
    if i.size == 0:
        none = np.empty(0, np.int64)
        return Slots(none, none, none, none, none, np.empty((0, 6), np.int64))
    order = np.lexsort((i, j - i))
    i, j = i[order], j[order]
    missing = np.diff(i) - 1
    missing[(np.diff(j - i) != 0) | (missing < 0) | (missing > GAP)] = 0
    slot = np.arange(len(i)) + np.concatenate([[0], np.cumsum(missing)])
    number = int(slot[-1]) + 1
    before = np.searchsorted(slot, np.arange(number), side="right") - 1
    into = np.arange(number) - slot[before]  # 0 in a spring's own slot, 1, 2 ... in the holes after it
    a, b = i[before] + into, j[before] + into
    new = np.ones(number, np.bool_)
    new[1:] = (np.diff(a) != 1) | (np.diff(b) != 1) | (a[1:] % chunk == 0) | (b[1:] % chunk == 0)
    start = np.flatnonzero(new)
    end = np.append(start[1:], number)
    holes = np.flatnonzero(into)
    table = np.stack(
        [a[start], b[start], end - start, start, *(np.searchsorted(holes, x) for x in (start, end))], axis=1
    )
    table = table[np.lexsort((table[:, OFFSET], table[:, FIRST]))]
    return Slots(order, slot, np.where(into, -1, a), np.where(into, -1, b), holes, table)


def owned(table: Ints, first: int, last: int, chunk: int, chunks: int) -> tuple[Ints, Ints]:
    """The pieces with an end among particles [first, last), and where those of every chunk (of first ends) begin.

    Shapes [pieces, 8] and [chunks + 1]; `first` and `last` are borders of chunks, or the end.
    """
    mine = [(table[:, end] >= first) & (table[:, end] < last) for end in (FIRST, SECOND)]
    flagged = np.column_stack([table, *mine])[mine[0] | mine[1]].astype(np.int64)
    begin = np.searchsorted(flagged[:, FIRST], np.arange(chunks + 1) * chunk)
    return flagged, begin.astype(np.int64)


class Order(NamedTuple):
    """In which order a thread goes through its particles while it goes through the chunks of all bonds.

    `front` [chunks]: up to which row forces must have been begun before the bonds of a chunk are added. `ready` [own
    chunks]: the first rows of own chunks, in the order in which nobody needs them in their old places any more; `after`
    [chunks]: how many of them that are when the bonds of a chunk have been added. The others wait for the other threads.
    """

    front: Ints
    ready: Ints
    after: Ints


def order_of(
    tables: Sequence[Ints], first: int, last: int, chunk: int, chunks: int, *, wait: bool = False
) -> Order:
    """The order of a thread that owns particles [first, last), by the pieces that `owned` gives it for every set of bonds.

    With `wait`, all particles wait for the other threads.
    """
    own = np.arange(first // chunk, -(-last // chunk))
    front, done = np.full(chunks, first), np.full(chunks, chunks)
    front[own] = np.minimum((own + 1) * chunk, last)
    done[own] = chunks if wait else own
    for table in tables:
        at = table[:, FIRST] // chunk
        between = table[:, OWNS_FIRST] != table[:, OWNS_SECOND]
        for end, mine in ((FIRST, OWNS_FIRST), (SECOND, OWNS_SECOND)):
            owned_ends = table[:, mine] != 0
            there = table[owned_ends, end] // chunk
            np.maximum.at(front, at[owned_ends], np.minimum((there + 1) * chunk, last))
            np.maximum.at(done, there, np.where(between[owned_ends], chunks, at[owned_ends]))
    ready = own[np.argsort(done[own], kind="stable")]
    after = np.searchsorted(done[ready], np.arange(chunks), side="right")
    return Order(np.maximum.accumulate(front), ready * chunk, after.astype(np.int64))


def shares(count: int, threads: int, chunk: int) -> list[tuple[int, int]]:
    """Ranges of particles for threads: whole chunks, about equally many. No more ranges than chunks."""
    number = -(-count // chunk)
    threads = max(1, min(threads, number))
    borders = [chunk * (number * k // threads) for k in range(threads)] + [count]
    return list(pairwise(borders))
