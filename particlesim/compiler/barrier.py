"""Barriers at which the threads of one island wait for each other, inside compiled code.

A barrier is two counters, arrivals and generation, on cache lines of their own. The last thread to arrive opens the next
generation; the others spin for a while, which costs a fraction of a microsecond when each has a core, and then yield their
core after every test, so that more threads than cores make progress, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import atomic_add, atomic_load, let_others_run, outlined

ARRIVALS, GENERATION, SIZE = 0, 8, 16
SPINS = 2000
"""Looks at the generation before a thread lets others run: some microseconds."""


def new_gate() -> NDArray[np.int64]:
    """The counters of a barrier."""
    return np.zeros(SIZE, np.int64)


@outlined
def meet(gate: Any, threads: Any) -> None:
    """Return when all threads have come here; what each wrote before is seen by all."""
    if threads > 1:
        generation = atomic_load(gate, GENERATION)
        if atomic_add(gate, ARRIVALS, 1) == threads - 1:
            atomic_add(gate, ARRIVALS, -threads)
            atomic_add(gate, GENERATION, 1)
        else:
            looks = 0
            while atomic_load(gate, GENERATION) == generation:
                looks += 1
                if looks > SPINS:
                    let_others_run()
