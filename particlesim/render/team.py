"""A team of threads that works through numbered pieces of a frame.

The pieces (bands of rows, chunks of particles) are the same for any number of threads and write to places of their
own, so the picture does not depend on who did what. Kernels release the interpreter lock.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Self


def default_threads() -> int:
    """How many processors this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


class Team:
    """`threads` workers; with one, the work is done by the caller."""

    def __init__(self, threads: int | None = None) -> None:
        self.threads = default_threads() if threads is None else max(1, threads)
        self._pool = ThreadPoolExecutor(self.threads, "render") if self.threads > 1 else None

    def each(self, work: Callable[[int], None], count: int) -> None:
        """Call `work(0) ... work(count - 1)`, in any order, and return when all are done."""
        if self._pool is None or count < 2:
            for piece in range(count):
                work(piece)
            return
        for _ in self._pool.map(work, range(count)):
            pass

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
