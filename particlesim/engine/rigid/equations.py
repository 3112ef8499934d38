"""Systems of equations for the velocities of a few bodies."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined

MOST_BODIES = 32
"""Bodies of a cluster that are solved for together: the cost grows with their third power."""
STEEP = 500.0
"""Ratio of masses from which on sweeps need help: below, they get there within some steps."""


class Room(NamedTuple):
    """Room for a system of equations: its matrix [6 m, 6 m], right-hand side, scales of rows, which
    become the solution, their order, and the change of velocities so far [6 m]; where those of each body begin [n]."""

    matrix: Any
    side: Any
    scale: Any
    order: Any
    change: Any
    number: Any


def new_room(bodies: int) -> Room:
    """Room for as many bodies as are solved for together."""
    size = 6 * min(bodies, MOST_BODIES)
    return Room(
        np.zeros((size, size)),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size, np.int64),
        np.zeros(size),
        np.zeros(bodies, np.int64),
    )


@outlined
def eliminate(a: Any, x: Any, scale: Any, order: Any, n: Any) -> None:
    """Solve a system of n equations in place (Gauss, with pivots that are largest in units of their rows)."""
    for r in range(n):
        order[r] = r
        size = 0.0
        for c in range(n):
            size = max(size, abs(a[r, c]))
        scale[r] = 1 / size if size > 0 else 0.0
    for p in range(n):
        best, at = -1.0, p
        for r in range(p, n):
            size = abs(a[order[r], p]) * scale[order[r]]
            if size > best:
                best, at = size, r
        order[p], order[at] = order[at], order[p]
        q = order[p]
        inverse = 1 / a[q, p] if a[q, p] != 0 else 0.0
        for m in range(p + 1, n):
            r = order[m]
            part = a[r, p] * inverse
            if part != 0:
                for c in range(p + 1, n):
                    a[r, c] -= part * a[q, c]
                x[r] -= part * x[q]
    # What is solved for stands in `scale` from here on.
    for back in range(n):
        p = n - 1 - back
        q = order[p]
        total = x[q]
        for c in range(p + 1, n):
            total -= a[q, c] * scale[c]
        scale[p] = total / a[q, p] if a[q, p] != 0 else 0.0
