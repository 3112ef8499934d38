"""A small compiler for psim's kernels: scalar Python to machine code, through LLVM.

`docs/compiler.md` explains it. Kernels are ordinary functions: `k.python` is one that runs uncompiled.
"""

from particlesim.compiler.intrinsics import (
    atomic_add,
    atomic_load,
    exact,
    lanes,
    let_others_run,
    often,
    on_stack,
    outlined,
    pause,
    prefetch,
    shared,
    transpose,
)
from particlesim.compiler.kernel import (
    Kernel,
    NotKept,
    compiling_seconds,
    kernel,
    much,
    quickly,
    told_of_compiling,
    uncompiled,
)

__all__ = [
    "Kernel",
    "NotKept",
    "atomic_add",
    "atomic_load",
    "compiling_seconds",
    "exact",
    "kernel",
    "lanes",
    "let_others_run",
    "much",
    "often",
    "on_stack",
    "outlined",
    "pause",
    "prefetch",
    "quickly",
    "shared",
    "told_of_compiling",
    "transpose",
    "uncompiled",
]
