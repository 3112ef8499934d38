"""Whether solids have anything in common.

The largest of their gaps changes by no more than the way that one goes. So a cube in whose middle it is more than half of
its diagonal holds no common point; where it may, the cube is cut into eight, those first in which it may be deepest.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from typing import Any

from particlesim.laws.registry import Particle, gap

MOST = 2000
"""Cubes that are looked at: what then is in doubt, as where two solids only just touch, passes."""


def surely_apart(shapes: Sequence[Any], reach: float) -> bool:
    """Whether some shapes have no point in common whose coordinates are up to `reach` [m]."""
    numbers = itertools.count()  # so that no two cubes are compared by their places
    waiting: list[tuple[float, int, tuple[float, float, float], float]] = []

    def look(x: float, y: float, z: float, half: float) -> bool:
        """Whether they may have the middle of a cube in common; if not, the cube waits."""
        p = Particle(x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        largest = max(float(gap(shape, p)) for shape in shapes)
        if not math.isfinite(largest):  # sizes out of all proportion, of which nothing is known
            return True
        heapq.heappush(waiting, (largest - math.sqrt(3) * half, next(numbers), (x, y, z), half))
        return largest < 0

    if look(0.0, 0.0, 0.0, reach):
        return False
    while waiting[0][0] <= 0:
        if next(numbers) > MOST:
            return False
        _, _, (x, y, z), half = heapq.heappop(waiting)
        half /= 2
        for u, v, w in itertools.product((-half, half), repeat=3):
            if look(x + u, y + v, z + w, half):
                return False
    return True
