"""How long kernels have been compiled: a first run spends more time on that than on steps."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event


class _Watch(event.Listener):  # type: ignore[misc]
    """Adds up the wall-clock time in which this process compiles; one thread at a time does, kernels within kernels."""

    def __init__(self) -> None:
        self.depth, self.began, self.total = 0, 0.0, 0.0
        self.listeners: list[Callable[[bool], None]] = []

    def on_start(self, event: Any) -> None:
        self.depth += 1
        if self.depth == 1:
            self.began = time.perf_counter()
            self.tell(True)

    def on_end(self, event: Any) -> None:
        self.depth -= 1
        if self.depth == 0:
            self.total += time.perf_counter() - self.began
            self.tell(False)

    def tell(self, busy: bool) -> None:
        for listener in tuple(self.listeners):
            listener(busy)


_WATCH = _Watch()
event.register("numba:compile", _WATCH)


def compiling_seconds() -> float:
    """Wall-clock time that this process has spent on compiling so far [s]."""
    now = time.perf_counter() - _WATCH.began if _WATCH.depth else 0.0
    return _WATCH.total + now


@contextmanager
def told_of_compiling(listener: Callable[[bool], None]) -> Iterator[None]:
    """Calls `listener` with True when this process begins to compile and with False when it ends, in whatever thread."""
    _WATCH.listeners.append(listener)
    try:
        yield
    finally:
        _WATCH.listeners.remove(listener)
