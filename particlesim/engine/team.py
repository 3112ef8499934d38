"""A team of threads for kernels that release the GIL."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

PIECES_PER_THREAD = 4
"""Ranges per thread: when another program takes a core, the other threads take over its share."""


def available_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Team:
    """Runs a function over ranges of particles. Results must not depend on how the ranges are cut."""

    def __init__(self, threads: int | None = None) -> None:
        self.threads = available_cores() if threads is None else threads
        self._pool = ThreadPoolExecutor(self.threads, "psim") if self.threads > 1 else None

    def over_range(
        self, count: int, grain: int, work: Callable[[int, int], Any], *, worth: bool = True
    ) -> None:
        """Call work(first, last) for ranges that cover [0, count) and begin at multiples of `grain`.

        With `worth` False, or one thread, everything is done in one call by the caller's thread.
        """
        grains = -(-count // grain)
        if self._pool is None or not worth or grains < 2:
            work(0, count)
            return
        pieces = min(self.threads * PIECES_PER_THREAD, grains)
        cuts = [grain * (grains * k // pieces) for k in range(pieces)] + [count]
        self._wait(self._pool.submit(work, a, b) for a, b in pairwise(cuts))

    def each(self, jobs: Iterable[Callable[[], Any]], *, worth: bool = True) -> None:
        """Run jobs that do not depend on each other."""
        if self._pool is None or not worth:
            for job in jobs:
                job()
            return
        self._wait(self._pool.submit(job) for job in jobs)

    @staticmethod
    def _wait(futures: Iterable[Any]) -> None:
        for future in list(futures):
            future.result()

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
