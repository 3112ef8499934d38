"""How the particles of a frame are divided into HDF5 chunks, and the bytes of a chunk.

Every frame starts on a chunk border, so that a chunk is written once and never again: a rewritten compressed
chunk would leave its old bytes behind as a hole (SWMR writers must not reuse them), and a process killed in
the middle could take frames along that were finished before. The rows that fill up the last chunk of a frame
belong to no frame.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

Column = npt.NDArray[Any]

_ONE_CHUNK = 256
_PIECES = 16
_LARGEST = 1 << 16


def chunk_rows(particles: int) -> int:
    """Rows per chunk for frames of up to `particles` particles.

    Small frames are one chunk each. Larger ones are cut in sixteen, so that about 3 % of a frame is filling
    on average. Above 65 536 rows, reading one particle would load too much.
    """
    if particles <= _ONE_CHUNK:
        return max(particles, 1)
    return min(max(-(-particles // _PIECES), _ONE_CHUNK), _LARGEST)


def padded(count: int, rows: int) -> int:
    """`count` rounded up to whole chunks of `rows`."""
    return -(-count // rows) * rows


def cut(column: Column, rows: int) -> Iterator[tuple[int, Column]]:
    """The chunks of `column` with their first row: views, except a last one filled up with zeros."""
    for start in range(0, len(column), rows):
        block = column[start : start + rows]
        if len(block) < rows:
            filled = np.zeros((rows, *column.shape[1:]), column.dtype)
            filled[: len(block)] = block
            block = filled
        yield start, block


def compress(block: Column) -> bytes:
    """The chunk as HDF5's filters "shuffle" and "gzip, level 1" would store it.

    Shuffle puts the first bytes of all numbers together, then all second bytes and so on. Done here and not
    by HDF5, because zlib frees Python's lock and several chunks can be compressed at once.
    """
    as_bytes = block.reshape(-1).view(np.uint8).reshape(-1, block.itemsize)
    return zlib.compress(np.ascontiguousarray(as_bytes.T).data, 1)
