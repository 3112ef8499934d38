"""The decorators of the renderer's compiled functions.

The order of operations is fixed when a kernel is compiled, so the same machine gives the same bits for any number of
threads. NaN and infinity keep their meaning (no nnan, no ninf).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from particlesim.engine.cache import FAST, INLINE, kernel, keep_on_disk

F = TypeVar("F", bound=Callable[..., Any])


def lean(function: F) -> F:
    """A kernel that makes no arrays: no references are counted, which would be a third of the time of a sample."""
    compiled = numba.njit(nogil=True, fastmath=FAST, error_model="numpy", _nrt=False)(function)
    return keep_on_disk(compiled)


def inlined(function: F) -> F:
    """For what kernels call per sample: a call would copy every array descriptor of the records it passes."""
    compiled: F = numba.njit(**INLINE, _nrt=False)(function)
    return compiled


__all__ = ["inlined", "kernel", "lean"]
