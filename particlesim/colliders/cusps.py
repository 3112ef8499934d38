"""Where the slope of a formula of a solid has no bound near its surface, as that of √|x| at x = 0.

No step of a search is short enough there, and no foot is found. Edges of a grid near φ = 0 are halved, always towards where
φ changes most, be it a quarter beyond an end: where there is a bound the slope settles, and where there is none it grows
until the end.
"""

from __future__ import annotations

import numpy as np

from particlesim.expressions import operations as op
from particlesim.expressions.arrays import value_at
from particlesim.model.arrays import Floats

STEEP = (op.Sqrt, op.GeneralPower, op.Asin, op.Acos)
"""Operations whose slope may have no bound."""
HALVINGS = 15
"""Halvings after which the slope is taken, and again after as many more."""
GROWS = 4.0
"""Growth of a slope between both that counts: that of |x|^0.87."""


def cusp(node: op.Node, axes: list[Floats], values: Floats) -> Floats | None:
    """A place near the surface of a formula where its slope has no bound, looked for on the grid of its values; None if
    there seems to be none."""
    if not _roots(node):
        return None
    low, high, rise = _near(axes, values)
    if not len(low):
        return None
    early = slopes = np.zeros(len(low))
    for turn in range(2 * HALVINGS):
        early = slopes if turn == HALVINGS else early
        way = 0.25 * (high - low)
        seen = np.stack([value_at(node, *(low + k * way).T) for k in range(-1, 6)])
        rises = np.nan_to_num(np.abs(np.diff(seen, axis=0)), posinf=0.0)
        halves = rises[:-1] + rises[1:]
        most = np.argmax(halves, axis=0)
        low = low + (most - 1)[:, None] * way
        high = low + 2 * way
        slopes = np.max(halves, axis=0) / (2 * np.linalg.norm(way, axis=1))
    cell = axes[0][1] - axes[0][0]
    off = np.abs(value_at(node, *low.T)) / rise
    found = (slopes > GROWS * np.maximum(early, rise / cell)) & (off <= 1)
    if not found.any():
        return None
    places: Floats = (0.5 * (low + high))[found]
    return places[np.lexsort((np.linalg.norm(places, axis=1), np.round(off[found], 6)))[0]]


def _roots(node: op.Node) -> bool:
    """Whether an expression has an operation whose slope may have no bound."""
    root = isinstance(node, op.Power) and not float(node.b).is_integer()
    return root or isinstance(node, STEEP) or any(isinstance(part, tuple) and _roots(part) for part in node)


def _near(axes: list[Floats], values: Floats) -> tuple[Floats, Floats, float]:
    """Both ends of the edges of a grid near φ = 0, shape [n, 3], and the largest change of φ along an edge."""
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    rise = max(float(np.abs(np.diff(values, axis=k)).max()) for k in range(3))
    ends = []
    for k in range(3):
        first = tuple(slice(None, -1) if axis == k else slice(None) for axis in range(3))
        second = tuple(slice(1, None) if axis == k else slice(None) for axis in range(3))
        near = np.minimum(np.abs(values[first]), np.abs(values[second])) <= rise
        ends.append((nodes[first][near], nodes[second][near]))
    low, high = (np.concatenate(each) for each in zip(*ends, strict=True))
    return low, high, rise
