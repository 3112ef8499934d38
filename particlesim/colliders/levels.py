"""Bounds of distances from levels of a function φ.

Whoever goes from φ = v to φ = 0 passes all levels between, and needs at least dφ/L(φ) for each, with L(φ) the largest slope
on the level φ. So the surface is at least ∫₀ᵛ dφ/L(φ) away: levels far from the surface, as the steep ones about the middle
of a sampled distance, count for nobody who is nearer, and those on the other side of it for nobody at all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.model.arrays import Floats

SHELLS = 32
"""Intervals of φ on each side of the surface, for each of which the largest slope is known."""


class LevelsRecord(NamedTuple):
    """How far levels of φ are from the surface at least, [2, SHELLS + 1], in equal steps of φ outwards and inwards; these
    steps."""

    distances: NDArray[np.float64]
    step: tuple[float, float]

    def __eq__(self, other: object) -> bool:
        # models that hold it are compared
        if not isinstance(other, LevelsRecord):
            return NotImplemented
        return self.step == other.step and np.array_equal(self.distances, other.distances)

    def __hash__(self) -> int:
        return hash(self.step)


def levels_of(low: Floats, high: Floats, steep: Floats) -> LevelsRecord:
    """The bounds from cells, in each of which φ is between two numbers and its slope has a bound."""
    distances, steps = np.zeros((2, SHELLS + 1)), []
    for side, (first, last) in enumerate(((low, high), (-high, -low))):
        there = last > 0
        begin, end, slope = np.maximum(first[there], 0.0), last[there], steep[there]
        step = float(end.max(initial=0.0)) / SHELLS or 1.0
        shell = np.minimum((begin / step).astype(int), SHELLS - 1)
        last_shell = np.minimum((end / step).astype(int), SHELLS - 1)
        largest = np.zeros(SHELLS)
        while len(shell):
            np.maximum.at(largest, shell, slope)
            more = shell < last_shell
            shell, last_shell, slope = shell[more] + 1, last_shell[more], slope[more]
        whole = float(largest.max()) or 1.0
        distances[side, 1:] = np.cumsum(step / np.where(largest > 0, largest, whole))
        steps.append(step)
    return LevelsRecord(distances, (steps[0], steps[1]))


def from_surface(levels: Any, v: Any) -> Any:
    """How far a place with φ = v is from the surface at least, negative inside [m]; no branches."""
    side = 0 if v > 0 else 1
    u = abs(v) / (levels.step[0] if v > 0 else levels.step[1])
    k = int(u if u < SHELLS - 1 else SHELLS - 1.0)  # what is beyond the last one goes on like it
    near = levels.distances[side, k]
    far = near + (u - k) * (levels.distances[side, k + 1] - near)
    return far if v > 0 else -far
