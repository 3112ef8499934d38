"""The decorators of the renderer's compiled functions.

The order of operations is fixed when a kernel is compiled, so the same machine gives the same bits for any number of
threads. NaN and infinity keep their meaning (no nnan, no ninf).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

from particlesim.engine.cache import INLINE, kernel


def inlined(function: Callable[..., Any]) -> Any:
    """For what a kernel calls per sample: a call would copy every array descriptor of the records it passes."""
    return numba.njit(**INLINE)(function)


__all__ = ["inlined", "kernel"]
