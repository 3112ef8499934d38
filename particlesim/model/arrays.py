"""Arrays of numbers, as annotations name them, and where in memory they begin."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LINE = 64
"""Bytes of a cache line, which are those of the longest vectors."""


def zeros(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Zeros, every row of which begins with a cache line: vectors that straddle two are a tenth slower in all. They take no
    memory before they are written."""
    *outer, size = shape
    item = np.dtype(dtype).itemsize
    stride = -(-size * item // LINE) * LINE
    raw = _memory(int(np.prod(outer, dtype=int)) * stride)
    return raw.view(dtype).reshape(*outer, stride // item)[..., :size]


def packed(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Zeros without gaps, that begin with a cache line, so that rows of half a line's length, or of one, are in one."""
    return _memory(int(np.prod(shape, dtype=int)) * np.dtype(dtype).itemsize).view(dtype).reshape(shape)


def _memory(size: int) -> NDArray[np.uint8]:
    """Bytes from the beginning of a cache line on, 0 each."""
    raw = np.zeros(size + LINE, np.uint8)
    first = -raw.ctypes.data % LINE
    return raw[first : first + size]
