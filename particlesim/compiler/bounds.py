"""`PSIM_KERNELS=checked`: kernels check every index before they use it, and one that is outside of its array ends the
process.

It ends at once, as a wrong index would corrupt memory, and other threads would wait for the one that stopped for ever.
Checked kernels are slow and are not kept on disk.
"""

from __future__ import annotations

import ctypes
import os
import sys
from typing import Any

from particlesim.compiler.unit import CompileError
from particlesim.compiler.values import Number, Unsupported

EXIT_CODE = 70
"""That of a mistake in psim."""
_ANY = 2**63 - 1
_places: list[CompileError] = []


def _stop(place: int, index: int, length: int) -> None:
    error = _places[place]
    error.reason = f"index {index} " + ("is negative" if length == _ANY else f"of an axis of length {length}")
    os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"{error}\n".encode())
    os._exit(EXIT_CODE)


_CALLED = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(_stop)
_ADDRESS = ctypes.cast(_CALLED, ctypes.c_void_p).value


def check(frame: Any, index: Any, length: Any = _ANY) -> None:
    """Write instructions that end the process unless 0 ≤ index < length; -1 and the like, written as numbers, count from the
    end. Raises Unsupported where it is known while compiling."""
    w = frame.w
    if not isinstance(index, Number) and index < 0:
        index = w.binary("Add", length, index)
    if not isinstance(index, Number) and not isinstance(length, Number):
        if not 0 <= index < length:
            raise Unsupported(f"index {index} of an axis of length {length}")
        return
    index, length = w.whole(index), w.whole(length)
    good, bad = w.block("inside"), w.block("outside")
    w.fork(Number(w.emit(f"icmp ult i64 {index}, {length}"), "i1"), good, bad)
    w.at = bad
    w.do(f"call void inttoptr (i64 {_ADDRESS} to ptr)(i64 {len(_places)}, i64 {index}, i64 {length})")
    _places.append(CompileError("", frame.places()))
    w.at = good
