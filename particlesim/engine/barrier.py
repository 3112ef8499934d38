"""Where threads that step one island wait for each other, inside compiled code.

A barrier is two counters, arrivals and generation, on cache lines of their own. The last thread to arrive opens the next
generation; the others spin for a while, which costs a fraction of a microsecond when each has a core, and then give up
their core at every look, so that more threads than cores still get on.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from particlesim.engine.compile import outline, stub

ARRIVALS, GENERATION, SIZE = 0, 8, 16
SPINS = 2000
"""Looks at the generation before a thread lets others run: some microseconds."""


def new_gate() -> NDArray[np.int64]:
    """The counters of a barrier."""
    return np.zeros(SIZE, np.int64)


@intrinsic  # type: ignore[untyped-decorator]  # the compiler has no types
def atomic_add(context: Any, array: Any, index: Any, value: Any) -> Any:
    """Add to an element of an int64 array as one indivisible act; returns what was there."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.atomic_rmw("add", builder.gep(data, [arguments[1]]), arguments[2], "seq_cst")

    return types.int64(array, types.intp, types.int64), codegen


@intrinsic  # type: ignore[untyped-decorator]  # the compiler has no types
def atomic_load(context: Any, array: Any, index: Any) -> Any:
    """An element of an int64 array, and with it all that its writer wrote before."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.load_atomic(builder.gep(data, [arguments[1]]), "acquire", 8)

    return types.int64(array, types.intp), codegen


# Resolved when the kernel is loaded, so that it can be kept on disk.
_let_others_run = types.ExternalFunction(
    "SwitchToThread" if sys.platform == "win32" else "sched_yield", types.int32()
)


def meet(gate: Any, threads: Any) -> Any:
    """Return when all threads have come here; what each wrote before is seen by all."""
    return stub()


@outline(meet)
def _meet(gate: Any, threads: Any) -> Any:
    def impl(gate: Any, threads: Any) -> None:
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
                        _let_others_run()

    return impl
