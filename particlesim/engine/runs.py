"""Springs as runs (i + k, j + k), k = 0 … n − 1, so that kernels read both ends from neighbouring places.

The springs of grids are few long runs. Runs are cut at the borders of chunks of particles, which do not depend on the
number of threads, so each end of a piece lies in one chunk, and has one owner. An owner adds to its own particles, piece
after piece in one order: sums have the same bits for any number of threads.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

FIRST, SECOND, LENGTH, OFFSET, OWNS_FIRST, OWNS_SECOND = range(6)
"""Columns of a table of pieces: row of the first and of the second end, springs, index of the first of them, and whether
the thread adds to the first and to the second end."""

CHUNKS = 64
"""Chunks of an island at most, hence threads at most."""
LEAST = 1024
"""Particles per chunk at least."""


def chunk_size(count: int) -> int:
    """Particles per chunk of an island, a multiple of 64."""
    return max(LEAST, -(-count // (CHUNKS * 64)) * 64)


def in_runs(i: Ints, j: Ints) -> Ints:
    """The order of springs in which those of a run follow each other."""
    return np.lexsort((i, j - i))


def pieces(i: Ints, j: Ints, chunk: int) -> Ints:
    """Runs of springs in the order of `in_runs`, cut at multiples of `chunk`, sorted by their first ends.

    Shape [pieces, 4]: FIRST, SECOND, LENGTH, OFFSET.
    """
    new = np.ones(len(i), np.bool_)
    new[1:] = (np.diff(i) != 1) | (np.diff(j) != 1) | (i[1:] % chunk == 0) | (j[1:] % chunk == 0)
    start = np.flatnonzero(new)
    length = np.diff(np.append(start, len(i)))
    table = np.stack([i[start], j[start], length, start], axis=1)
    return table[np.lexsort((table[:, OFFSET], table[:, FIRST]))]


def owned(table: Ints, first: int, last: int, chunk: int, chunks: int) -> tuple[Ints, Ints]:
    """The pieces with an end among particles [first, last), and where those of every chunk (of first ends) begin.

    Shapes [pieces, 6] and [chunks + 1]; `first` and `last` are borders of chunks, or the end.
    """
    mine = [(table[:, end] >= first) & (table[:, end] < last) for end in (FIRST, SECOND)]
    flagged = np.column_stack([table, *mine])[mine[0] | mine[1]].astype(np.int64)
    begin = np.searchsorted(flagged[:, FIRST], np.arange(chunks + 1) * chunk)
    return flagged, begin.astype(np.int64)


def shares(count: int, threads: int) -> list[tuple[int, int]]:
    """Ranges of particles for threads: whole chunks, about equally many. No more ranges than chunks."""
    chunk = chunk_size(count)
    number = -(-count // chunk)
    threads = max(1, min(threads, number))
    borders = [chunk * (number * k // threads) for k in range(threads)] + [count]
    return list(pairwise(borders))
