"""What kernels can say that Python cannot: each is an instruction of the machine, and an ordinary function here."""

from __future__ import annotations

import ctypes
import ctypes.util
import math
import os
import struct
import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., Any])

LINE = 64
"""Arrays on the stack begin at a cache line [bytes]."""
YIELD = "SwitchToThread" if sys.platform == "win32" else "sched_yield"


def exact(function: F) -> F:
    """Decorator: every operation in this function, and in those it calls, is rounded as it is written."""
    function.exact = True  # type: ignore[attr-defined]
    return function


def outlined(function: F) -> F:
    """Decorator: kernels call this function instead of having its instructions, for what is long or called in many places."""
    function.outlined = True  # type: ignore[attr-defined]
    return function


def on_stack(rows: int, columns: int, dtype: Any) -> NDArray[Any]:
    """An array of shape [rows, columns], both known, that lives as long as the kernel runs; its numbers are arbitrary.

    To be called outside of loops; some ten thousand numbers at most, since threads have stacks of half a megabyte on macOS.
    """
    return np.empty((rows, columns), dtype)


def atomic_add(array: NDArray[np.int64], index: int, value: int) -> int:
    """Add to an element of an int64 array as one indivisible act; returns what was there."""
    before = int(array[index])
    array[index] += value
    return before


def atomic_load(array: NDArray[np.int64], index: int) -> int:
    """An element of an int64 array, and with it all that its writer wrote before."""
    return int(array[index])


def let_others_run() -> None:
    """Give the core to another thread."""
    if hasattr(os, "sched_yield"):
        os.sched_yield()


def sqrt(x: float) -> float:
    """√x."""
    return math.sqrt(x)


def floor(x: float) -> float:
    """The largest integer that is not above x."""
    return float(np.floor(x))


def nearest(x: float) -> float:
    """The nearest integer, the even one of two."""
    return float(np.rint(x))


def copysign(x: float, y: float) -> float:
    """|x| with the sign of y."""
    return math.copysign(x, y)


def _library_fma() -> Callable[[float, float, float], float]:
    library = ctypes.CDLL(ctypes.util.find_library("m") or None)
    function = library.fma
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * 3
    return function  # type: ignore[no-any-return]


def fma(a: float, b: float, c: float) -> float:
    """a b + c in one rounding."""
    global _fma
    if _fma is None:
        _fma = getattr(math, "fma", None) or _library_fma()
    return _fma(a, b, c)


_fma: Callable[[float, float, float], float] | None = None


def bits_of(x: float) -> int:
    """The 64 bits of a float64, as a signed integer."""
    return int(struct.unpack("<q", struct.pack("<d", x))[0])


def number_of(bits: int) -> float:
    """The float64 with these 64 bits."""
    return float(struct.unpack("<d", struct.pack("<q", bits))[0])
