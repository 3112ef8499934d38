"""How adaptive methods choose their steps: the size of an error, and the next step from it.

The formulas are those of `particlesim.integrators.adaptive`; `method` is a record with its numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.engine.state.columns import type_of

NOT_FINITE, TOO_SHORT, TOO_MANY = 1, 2, 3
"""Why a particle's steps ended: its force is not finite, the step fell below the least, or there was no end of steps."""

MOST_STEPS = 10_000_000
"""Own steps of a particle within one grid step: seconds of work, after which a run had better say so."""
RESOLVED = 16 * 2.0**-52
"""Shortest step over the time that it leads to: shorter ones are lost in the rounding of the clock."""
SAFETY = 0.9
SMALLEST = 1e-4
"""Errors below this do not count as history (Hairer and Wanner)."""


def scales(method: Any, p: Any, q: Any) -> Any:
    """Inverse squares of the errors of position and velocity that a step from p to q may have."""
    x2 = max(p.x * p.x + p.y * p.y + p.z * p.z, q.x * q.x + q.y * q.y + q.z * q.z)
    v2 = max(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz, q.vx * q.vx + q.vy * q.vy + q.vz * q.vz)
    one = type_of(p.x, 1)
    x, v = method.position + method.tolerance * np.sqrt(x2), method.velocity + method.tolerance * np.sqrt(v2)
    return one / (x * x), one / (v * v)


def size2(r: Any, sx: Any, sv: Any) -> Any:
    """Square of a rate's length in units of the allowed errors."""
    return sx * (r.x * r.x + r.y * r.y + r.z * r.z) + sv * (r.vx * r.vx + r.vy * r.vy + r.vz * r.vz)


def combined(h: Any, first: Any, second: Any) -> Any:
    """The error of a step from the squared sizes of one estimate, or of two."""
    if second is None:
        return h * np.sqrt(first)
    below = first + type_of(first, 0.01) * second
    return h * first / np.sqrt(below if below > 0 else type_of(first, 1))


def factor(method: Any, error: Any, previous: Any, again: Any) -> float:
    """h_new/h after a try of a certain error; `previous` is 0 where there is no history, `again` after a rejection."""
    if not error < np.inf:
        return float(method.shrink)
    wish = SAFETY * max(error, 1e-300) ** -method.alpha
    if previous > 0:
        wish *= previous**method.beta
    most = 1.0 if again or error > 1 else method.grow
    return float(min(max(wish, method.shrink), most))


def why_short(slope: Any) -> int:
    """Why steps fall below the least: the slope at their beginning is not finite, or the error does not get smaller."""
    drop = (slope.x - slope.x) + (slope.y - slope.y) + (slope.z - slope.z)
    drop += (slope.vx - slope.vx) + (slope.vy - slope.vy) + (slope.vz - slope.vz)
    return TOO_SHORT if drop == 0 else NOT_FINITE
