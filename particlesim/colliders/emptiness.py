"""Whether solids have anything in common, and whether walls leave a place for what they hold.

Each is known by how deep a place is in what it forbids [m], of which the largest counts. That changes by no more than the
way that one goes. So a box in whose middle it is more than half of its diagonal is forbidden wholly; where it may not be,
the box is cut into eight, those first in which the largest depth may be the least.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

from particlesim.laws.registry import Particle, gap
from particlesim.model.vectors import Vector3

MOST = 2000
"""Boxes that are looked at: what then is in doubt, as where two solids only just touch, passes."""

Depth = Callable[[Particle], float]
"""How deep a particle without radius is in what is forbidden, at least, or −1 times its distance from that at most [m]."""


def surely_apart(shapes: Sequence[Any], reach: float) -> bool:
    """Whether some shapes have no point in common whose coordinates are up to `reach` [m]."""
    depths = [_gap_of(shape) for shape in shapes]
    return surely_forbidden(depths, (-reach, -reach, -reach), (reach, reach, reach))


def _gap_of(shape: Any) -> Depth:
    return lambda p: float(gap(shape, p))


def _place(x: float, y: float, z: float) -> Particle:
    """What laws of shapes see: a point at rest."""
    return Particle(x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def surely_forbidden(depths: Sequence[Depth], low: Vector3, high: Vector3, most: int = MOST) -> bool:
    """Whether every place in a box is forbidden by one or another; not sure after `most` boxes."""
    numbers = itertools.count()  # so that no two boxes are compared by their places
    waiting: list[tuple[float, int, Vector3, Vector3]] = []

    def allowed(middle: Vector3, half: Vector3) -> bool:
        """Whether the middle of a box may be allowed; if not, the box waits."""
        p = _place(*middle)
        deepest = -math.inf
        for depth in depths:
            deepest = max(deepest, depth(p))
            if not math.isfinite(deepest):  # sizes out of all proportion, of which nothing is known
                return True
            if deepest > math.hypot(*half):
                return False  # all of it is forbidden: it need not wait
        heapq.heappush(waiting, (deepest - math.hypot(*half), next(numbers), middle, half))
        return deepest < 0

    x, y, z = ((a + b) / 2 for a, b in zip(low, high, strict=True))
    u, v, w = ((b - a) / 2 for a, b in zip(low, high, strict=True))
    if allowed((x, y, z), (u, v, w)):
        return False
    while waiting:
        if next(numbers) > most:
            return False
        _, _, (x, y, z), half = heapq.heappop(waiting)
        u, v, w = (each / 2 for each in half)
        for i, j, k in itertools.product((-1, 1), repeat=3):
            if allowed((x + i * u, y + j * v, z + k * w), (u, v, w)):
                return False
    return True
