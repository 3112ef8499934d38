"""Whether solids have anything in common, and whether walls leave a place for what they hold.

Each is known by how deep a place is in what it forbids [m], of which the largest counts. That changes by no more than the
way that one goes. So a box in whose middle it is more than half of its diagonal is forbidden wholly; where it may not be,
the box is cut into eight, those first in which the largest depth may be the least.

Where solids only touch, or a part takes off all of another, no number of boxes is enough. Then a place is looked for that is
in all of them, from the best boxes on, each time by the way out of the worst of them and a little more (`_place_in`). Where
there is none, and all are convex, the planes through their nearest points bound the depth from below: F(x) ≥ g + n·(x − y)
for each, so that any mean Σ λ (g + n·(x − y)) is a bound. The best mean and the next place are those of a linear program
(J. E. Kelley, J. SIAM 8, 703 (1960)); the bound holds for any λ ≥ 0 with Σ λ = 1, also for those with rounding errors.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from particlesim.laws.registry import Particle, gap, normal
from particlesim.model.vectors import Vector3

MOST = 2000
"""Boxes that are looked at: what then is in doubt, as where two solids only just touch, passes."""

Depth = Callable[[Particle], float]
"""How deep a particle without radius is in what is forbidden, at least, or −1 times its distance from that at most [m]."""


STARTS, MOVES = 200, 8
"""Boxes from which a place is looked for, and moves on each way."""
WAYS, LOOKS = 4, 24
"""Boxes from which that is done by planes, and looks on each way."""
OVERSHOOTS = (1e-2, 1e-4, 1e-6, 1e-8)
"""How much farther than out of a shape these moves lead, in parts of the size of the solids."""
TOUCHING = 1e-7
"""What of the size of solids they may have in common that only touch."""
SEEN = 1e-14
"""How deep a place is in all shapes that is no rounding error, as a part of coordinates."""
PLANES = 100
"""Planes that are looked at, for each shape, to see that convex solids only touch."""


def surely_apart(shapes: Sequence[Any], reach: float) -> bool:
    """Whether some shapes have no point in common whose coordinates are up to `reach` [m]."""
    return common_of(shapes, reach, reach, convex=False, doubts=False) == "nothing"


def common_of(
    shapes: Sequence[Any], reach: float, size: float, *, convex: bool, doubts: bool = True
) -> Literal["nothing", "touch", "doubt", "something"]:
    """What some shapes of a size have in common whose coordinates are up to `reach` [m]: surely nothing; convex ones touch,
    with nothing in common that is deeper than the part `TOUCHING` of their size; no place was found, without a proof that
    there is none; or there is something, as for all that is not sure without `doubts`."""
    allowed, waiting = _searched([_gap_of(each) for each in shapes], (-reach,) * 3, (reach,) * 3, MOST)
    if allowed:
        return "something"
    if not waiting:
        return "nothing"
    if not doubts or _place_in(shapes, waiting[:: len(waiting) // STARTS + 1], size):
        return "something"
    if convex:
        return _deepest_of(shapes, reach, TOUCHING * size)
    return "something" if any(_descended(shapes, each, size) for each in waiting[:WAYS]) else "doubt"


def _place_in(shapes: Sequence[Any], starts: Sequence[Vector3], size: float) -> bool:
    """Whether a place is found that is in all shapes."""
    for part, start in itertools.product(OVERSHOOTS, starts):
        x = np.array(start)
        for _ in range(MOVES):
            p = _place(*x.tolist())
            gaps = [float(gap(each, p)) for each in shapes]
            worst = int(np.argmax(gaps))
            if gaps[worst] < 0:
                return True
            x = x - (gaps[worst] + part * size) * _normal_of(shapes[worst], p)
    return False


def _deepest_of(shapes: Sequence[Any], reach: float, most: float) -> Literal["touch", "doubt", "something"]:
    """What convex shapes have in common: surely nothing that is deeper than `most` [m], a place in all of them, or neither
    is known."""
    planes, offsets = np.empty((0, 3)), np.empty(0)
    x = np.zeros(3)
    for _ in range(PLANES):
        gaps, out = _planes_at(shapes, x)
        if max(gaps) < 0:
            return "something"
        planes, offsets = np.concatenate([planes, out]), np.concatenate([offsets, gaps - out @ x])
        x, shares = _lowest(planes, offsets, np.full(3, -reach), np.full(3, reach))
        if shares @ offsets - np.abs(shares @ planes).sum() * reach >= -most:
            return "something" if _descended(shapes, x.tolist(), reach, SEEN * reach) else "touch"
    return "something" if _descended(shapes, x.tolist(), reach, SEEN * reach) else "doubt"


def _descended(shapes: Sequence[Any], start: Sequence[float], far: float, deep: float = 0.0) -> bool:
    """Whether a way to where the largest gap is the least leads into all shapes, deeper than `deep` [m]: it goes by their
    planes at each place, no farther than these have turned out to hold, at first `far` [m]."""
    x = np.array(start)
    gaps, out = _planes_at(shapes, x)
    for _ in range(LOOKS):
        if max(gaps) < -deep:
            return True
        there, _ = _lowest(out, gaps - out @ x, x - far, x + far)
        next_gaps, next_out = _planes_at(shapes, there)
        if max(next_gaps) < max(gaps):
            x, gaps, out = there, next_gaps, next_out
        else:
            far /= 4
    return False


def _planes_at(shapes: Sequence[Any], x: Any) -> tuple[Any, Any]:
    """The gaps of shapes at a place [m] and their normals, [n, 3]."""
    p = _place(*x.tolist())
    return np.array([float(gap(each, p)) for each in shapes]), np.array(
        [_normal_of(each, p) for each in shapes]
    )


def _lowest(planes: Any, offsets: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """Where in a box the largest of n·x + c is the least, and the shares of the planes in that."""
    from scipy.optimize import linprog

    middle, unit = (
        0.5 * (low + high),
        0.5 * float((high - low).max()),
    )  # of what is small as exactly as of what is large
    bounds = [*zip((low - middle) / unit, (high - middle) / unit, strict=True), (None, None)]
    rows = np.column_stack([planes, np.full(len(planes), -1.0)])
    found = linprog([0, 0, 0, 1], A_ub=rows, b_ub=-(offsets + planes @ middle) / unit, bounds=bounds)
    if found.x is None:
        return middle, np.full(len(planes), 1 / len(planes))
    shares = np.maximum(-found.ineqlin.marginals, 0.0)
    return middle + unit * found.x[:3], shares / (shares.sum() or 1.0)


def _normal_of(shape: Any, p: Particle) -> Any:
    """The direction out of a shape, shape [3]; laws may leave out components that are 0."""
    return np.array([0.0 if each is None else float(each) for each in normal(shape, p)])


def _gap_of(shape: Any) -> Depth:
    return lambda p: float(gap(shape, p))


def _place(x: float, y: float, z: float) -> Particle:
    """What laws of shapes see: a point at rest."""
    return Particle(x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def surely_forbidden(depths: Sequence[Depth], low: Vector3, high: Vector3, most: int = MOST) -> bool:
    """Whether every place in a box is forbidden by one or another; not sure after `most` boxes."""
    allowed, waiting = _searched(depths, low, high, most)
    return not allowed and not waiting


def _searched(depths: Sequence[Depth], low: Vector3, high: Vector3, most: int) -> tuple[bool, list[Vector3]]:
    """Whether a place in a box was found that is not forbidden; if not, the middles of the boxes, the best first, that are
    in doubt after `most` of them."""
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
        return True, []
    while waiting:
        if next(numbers) > most:
            return False, [middle for _, _, middle, _ in sorted(waiting)]
        _, _, (x, y, z), half = heapq.heappop(waiting)
        u, v, w = (each / 2 for each in half)
        for i, j, k in itertools.product((-1, 1), repeat=3):
            if allowed((x + i * u, y + j * v, z + k * w), (u, v, w)):
                return True, []
    return False, []
