"""A team of threads for kernels that release the interpreter lock.

Work is cut into pieces that write to places of their own, so results do not depend on how many threads there are or on
who did what.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from types import TracebackType
from typing import Any, Self

PIECES_PER_THREAD = 4
"""Ranges per thread: when another program takes a core, the other threads take over its share."""


def available_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Team:
    """`threads` workers, all cores unless given; with one, the work is done by the caller."""

    def __init__(self, threads: int | None = None) -> None:
        self.threads = available_cores() if threads is None else max(1, threads)
        self._pool = ThreadPoolExecutor(self.threads, "psim") if self.threads > 1 else None
        if self._pool is not None:
            # Start them all now: a thread that is born with work stays for milliseconds on the core of its parent.
            together = threading.Barrier(self.threads)
            for _ in range(self.threads):
                self._pool.submit(together.wait)

    def each(self, work: Callable[[int], Any], count: int) -> None:
        """Call work(0) … work(count − 1), in any order, and return when all are done."""
        if self._pool is None or count < 2:
            for piece in range(count):
                work(piece)
            return
        for _ in self._pool.map(work, range(count)):
            pass

    def over_range(
        self, count: int, grain: int, work: Callable[[int, int], Any], *, worth: bool = True
    ) -> None:
        """Call work(first, last) for ranges that cover [0, count) and begin at multiples of `grain`.

        With `worth` False everything is done in one call by the caller's thread.
        """
        grains = -(-count // grain)
        if self._pool is None or not worth or grains < 2:
            work(0, count)
            return
        pieces = min(self.threads * PIECES_PER_THREAD, grains)
        ranges = list(pairwise([*(grain * (grains * k // pieces) for k in range(pieces)), count]))
        self.each(lambda k: work(*ranges[k]), pieces)

    def close(self) -> None:
        """End the threads; work that has not begun is dropped."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
