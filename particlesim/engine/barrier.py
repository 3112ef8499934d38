"""Barriers at which the threads of one island wait for each other, inside compiled code.

A barrier is two counters, arrivals and generation, on cache lines of their own. The last thread to arrive opens the next
generation; the others spin for a while, which costs a fraction of a microsecond when each has a core, and then sleep between
tests. So they leave their core to whoever is awaited where there are more threads than cores, or others work on these. To
yield is no way to do that: where others always have work, it gives away a whole time slice, and steps take milliseconds.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import atomic_add, atomic_load, let_others_run, outlined, pause
from particlesim.process.threads import available_cores

ARRIVALS, GENERATION, CORES, SIZE = 0, 8, 9, 16
SHORT, LONG = 100, 5_000
"""Looks at the generation before a thread lets others run: some microseconds where there are more threads than cores, and
else some tenths of a millisecond, more than most serial parts of a step last."""

UNEVEN = False
"""For tests, in a process and a cache of their own: threads leave barriers one after another, as on busy machines."""


class Team(NamedTuple):
    """What of a share depends on no law, for functions that are compiled once for all kernels."""

    first: int
    last: int
    chunk: int
    number: int
    threads: int
    gate: Any


def team_of(share: Any) -> Team:
    """A share's particles, and the threads that it meets."""
    return Team(share.first, share.last, share.chunk, share.number, share.threads, share.gate)


def new_gate() -> NDArray[np.int64]:
    """The counters of a barrier, and how many cores there are."""
    gate = np.zeros(SIZE, np.int64)
    gate[CORES] = available_cores()
    return gate


@outlined
def meet(gate: Any, threads: Any) -> None:
    """Return when all threads have come here; what each wrote before is seen by all."""
    if threads > 1:
        generation = atomic_load(gate, GENERATION)
        if atomic_add(gate, ARRIVALS, 1) == threads - 1:
            atomic_add(gate, ARRIVALS, -threads)
            atomic_add(gate, GENERATION, 1)
            if UNEVEN and generation % 2 == 1:
                let_others_run()
        else:
            patience = LONG if threads <= gate[CORES] else SHORT
            looks = 0
            while atomic_load(gate, GENERATION) == generation:
                looks += 1
                pause()
                if looks > patience:
                    let_others_run()
            if UNEVEN and generation % 2 == 0:
                let_others_run()
