"""Functions that the compiler turns into single instructions; uncompiled they give the same bits.

Functions of numbers are operations of IEEE 754, exact or rounded once, so they give the same on every machine. Uncompiled
they call the C library, since Python's own raise errors where IEEE 754 gives infinity or NaN.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import sys
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])

LINE = 64
"""Arrays on the stack begin at a cache line [bytes]."""
_X86, _ARM = "llvm.x86.sse2.pause()", "llvm.aarch64.isb(i32 15)"
PAUSE = {"x86_64": _X86, "amd64": _X86, "arm64": _ARM, "aarch64": _ARM}.get(platform.machine().lower(), "")
"""The instruction of a processor for loops that wait, as LLVM calls it."""
REST = 20
"""How long a thread that waits lets others run, at least [µs]."""
SLEEP = "SwitchToThread()" if sys.platform == "win32" else f"usleep(i32 {REST})"
"""The call of the system that lets others run. Windows sleeps for milliseconds only: there the core is yielded."""

_LIBRARY = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)


def _of_library(name: str, count: int) -> Callable[..., float]:
    """A function of the C library that takes and returns float64."""
    function = _LIBRARY[name]
    function.restype = ctypes.c_double
    function.argtypes = [ctypes.c_double] * count
    return function


_fma = _of_library("fma", 3)
_rint = _of_library("rint", 1)
_sqrt = _of_library("sqrt", 1)
_floor = _of_library("floor", 1)
_copysign = _of_library("copysign", 2)


def exact(function: F) -> F:
    """Marks a function in which, with all it calls, every operation is rounded as it is written.

    Elsewhere the compiler may fuse a·b + c, turn a division into a product, or forget the sign of a zero.
    """
    function.exact = True  # type: ignore[attr-defined]
    return function


def outlined(function: F) -> F:
    """Marks a function that kernels call instead of holding its instructions: what is long, or called in many places."""
    function.outlined = True  # type: ignore[attr-defined]
    return function


def shared(function: F) -> F:
    """Marks an outlined function that is compiled once for all kernels that call it: one that is given no laws."""
    function.shared = True  # type: ignore[attr-defined]
    return outlined(function)


def often(function: F) -> F:
    """Marks a function that kernels hold in many places: those that compile quickly call it, which is sooner written."""
    function.often = True  # type: ignore[attr-defined]
    return function


def on_stack(rows: int, columns: int, dtype: Any) -> NDArray[Any]:
    """An array of shape [rows, columns], both known, that lives as long as the kernel runs; its numbers are arbitrary.

    To be called outside of loops; some ten thousand numbers at most, since threads have stacks of half a megabyte on macOS.
    """
    return np.empty((rows, columns), dtype)


def lanes(count: int, abreast: int = 1) -> range:
    """`range(count)` for a short loop over what fits into vectors: it is not written out turn by turn beforehand.

    LLVM writes out loops of a few turns first, and then sees no loop to vectorise. `abreast` vectors are worked on at a
    time, a step of each after the other, where a single one would wait for every result that the next step needs; `count`
    must be as many times the numbers of the widest vector, or a multiple.
    """
    return range(count)


BLOCK = 8
"""Rows and columns of what `transpose` turns over: numbers of the widest vectors."""


def transpose(
    source: NDArray[np.float64], rows: tuple[int, ...], column: int, into: NDArray[np.float64], at: int
) -> None:
    """into[at + k, j] = source[rows[j], column + k] for j, k < BLOCK: rows become columns, as loops over lanes take them.

    Whole vectors are loaded, and their numbers exchanged in registers, which is faster than gathering them one by one.
    The rows of both arrays are contiguous float64.
    """
    into[at : at + BLOCK, :BLOCK] = source[list(rows), column : column + BLOCK].T


def atomic_add(array: NDArray[np.int64], index: int, value: int) -> int:
    """Add to an element of an int64 array atomically; returns its earlier value."""
    before = int(array[index])
    array[index] += value
    return before


def atomic_load(array: NDArray[np.int64], index: int) -> int:
    """An element of an int64 array, and with it all that its writer wrote before."""
    return int(array[index])


def prefetch(array: NDArray[Any], *indices: int) -> None:
    """Have the cache line of an element fetched, which will be read soon; nothing else."""


def pause() -> None:
    """Between looks at what another thread will write: leaves the units of a core to the other thread that runs on it."""


def let_others_run() -> None:
    """Give the core to other threads for some microseconds."""
    time.sleep(1e-6 * REST)


def fma(a: float, b: float, c: float) -> float:
    """a·b + c, rounded once."""
    return _fma(a, b, c)


def nearest(x: float) -> float:
    """The nearest integer, the even one of two; keeps the sign of zero."""
    return _rint(x)


def floor(x: float) -> float:
    """The largest integer that is not above x."""
    return _floor(x)


def sqrt(x: float) -> float:
    """Square root; NaN for x < 0."""
    return _sqrt(x)


def copysign(x: float, y: float) -> float:
    """|x| with the sign of y, that of a zero too."""
    return _copysign(x, y)


def bits_of(x: float) -> int:
    """The 64 bits of a float64 as a signed integer."""
    return int(struct.unpack("<q", struct.pack("<d", x))[0])


def number_of(bits: int) -> float:
    """The float64 that has these 64 bits; higher ones, which a signed 64-bit integer has no room for, are cut off."""
    return float(struct.unpack("<d", struct.pack("<Q", bits & 0xFFFF_FFFF_FFFF_FFFF))[0])
