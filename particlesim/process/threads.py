"""A team of threads for kernels that release the interpreter lock.

Work is cut into pieces that write to places of their own, so results do not depend on how many threads there are or on
who did what.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from itertools import pairwise
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from particlesim.process.signals import held_signals

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

PIECES_PER_THREAD = 4
"""Ranges per thread: when another program takes a core, the other threads take over its share."""
_LONGEST_START = 1.0
"""Seconds that a thread waits for its siblings at most."""


def available_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Team:
    """`threads` workers, all cores unless given; with one, and after `close`, its caller does it.

    They begin with their first work.
    """

    def __init__(self, threads: int | None = None) -> None:
        self.threads = available_cores() if threads is None else max(1, threads)
        self._pool: ThreadPoolExecutor | None = None

    def each(self, work: Callable[[int], Any], count: int) -> None:
        """Call work(0) … work(count − 1), in any order, and return when all are done."""
        if self.threads == 1 or count < 2:
            for piece in range(count):
                work(piece)
            return
        for _ in self.started().map(work, range(count)):
            pass

    def started(self) -> ThreadPoolExecutor:
        """The threads, which begin now if they have not."""
        if self._pool is None:
            # A thread that a signal cuts off from its pool in the moment of its birth would never hear of its end.
            with held_signals():
                self._pool = _started_pool(self.threads)
        return self._pool

    def over_range(
        self, count: int, grain: int, work: Callable[[int, int], Any], *, worth: bool = True
    ) -> None:
        """Call work(first, last) for ranges that cover [0, count) and begin at multiples of `grain`.

        With `worth` False everything is done in one call by the caller's thread.
        """
        grains = -(-count // grain)
        if self.threads == 1 or not worth or grains < 2:
            work(0, count)
            return
        pieces = min(self.threads * PIECES_PER_THREAD, grains)
        ranges = list(pairwise([*(grain * (grains * k // pieces) for k in range(pieces)), count]))
        self.each(lambda k: work(*ranges[k]), pieces)

    def close(self) -> None:
        """End the threads; work that has not begun is dropped. What outlives them, such as a last frame, works alone."""
        pool, self._pool, self.threads = self._pool, None, 1
        if pool is not None:
            with held_signals():
                pool.shutdown(cancel_futures=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _started_pool(threads: int) -> ThreadPoolExecutor:
    """A pool whose threads have all begun: one that is born with work stays for milliseconds on the core of its parent."""
    from concurrent.futures import ThreadPoolExecutor

    pool = ThreadPoolExecutor(threads, "psim")
    begun = threading.Event()
    try:
        for _ in range(threads):
            pool.submit(begun.wait, _LONGEST_START)  # an idle thread would take the work of the next
    finally:
        begun.set()
    return pool
