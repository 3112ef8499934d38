"""Where a formula of a solid jumps from one sign to the other: its surface is open there, and no place of it is near.

A condition, `sign`, the cut of `atan2` and the poles of quotients change φ at once where some g of the place passes zero. A
jump does no harm as long as φ is 0 on both sides at the same places, as y (1 if x < 0 else 3) is. So g = 0 is looked for on
a grid, and from there, by Newton's method, the places with g = 0 where φ comes to 0 on one side; it must do so on the other,
too. Kinks pass, as φ is the same on both sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.expressions import operations as op
from particlesim.expressions.arrays import value_at
from particlesim.model.arrays import Floats

BESIDE = 1e-6
"""How far on both sides of a jump φ is looked at, in parts of the longest side of the box."""
HALVINGS = 50
MOST_PLACES = 20_000
"""Places with g = 0 that are looked at, at most."""
TURNS = 8
"""Turns of Newton's method, from within a cell of the grid."""
STEP = 1e-5
"""Height of a step, in parts of the longest side of the box, below which it is taken for rounding."""


class Jump(NamedTuple):
    """Where φ jumps [m], and its values before and after."""

    place: Floats
    values: tuple[float, float]


def jump(node: op.Node, axes: list[Floats], values: Floats) -> Jump | None:
    """Where an expression φ jumps over 0 in a box, looked at on the grid of its values; None if it is not seen to."""
    for g in _changes(node):
        found = _Side(node, g, axes).jump(_crossings(g, axes, values))
        if found is not None:
            return found
    return None


def _changes(node: op.Node) -> Iterator[op.Node]:
    """What passes zero where an expression may jump."""
    if isinstance(node, op.IfLess):
        yield op.Subtract(node.a, node.b)
    elif isinstance(node, op.Sign | op.Atan2):
        yield node.a
    elif isinstance(node, op.Divide) and not isinstance(node.b, op.Constant):
        yield node.b
    elif isinstance(node, op.Tan):
        yield op.Cos(node.a)
    elif isinstance(node, op.Power) and node.b < 0:
        yield node.a
    for part in node:
        if isinstance(part, tuple):
            yield from _changes(part)


def _crossings(g: op.Node, axes: list[Floats], values: Floats) -> Floats:
    """Places [n, 3] with g = 0 on the edges of the cells of a grid near φ = 0."""
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    below = _at(g, nodes) < 0
    rise = max(float(np.abs(np.diff(values, axis=k)).max()) for k in range(3))
    ends = []
    for k in range(3):
        first = tuple(slice(None, -1) if axis == k else slice(None) for axis in range(3))
        second = tuple(slice(1, None) if axis == k else slice(None) for axis in range(3))
        near = np.minimum(np.abs(values[first]), np.abs(values[second])) <= 2 * rise
        crossed = (below[first] != below[second]) & (near | (values[first] * values[second] <= 0))
        ends.append((nodes[first][crossed], nodes[second][crossed]))
    low, high = (np.concatenate(each) for each in zip(*ends, strict=True))
    before = _at(g, low) < 0
    for _ in range(HALVINGS if len(low) else 0):
        middle = 0.5 * (low + high)
        same = ((_at(g, middle) < 0) == before)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)[:: 1 + len(low) // MOST_PLACES]


def _at(node: op.Node, places: Floats) -> Floats:
    """An expression at places [..., 3]."""
    return value_at(node, places[..., 0], places[..., 1], places[..., 2])


def _clean(number: float, rounding: float) -> float:
    """0 for what is rounding."""
    return number if abs(number) > rounding else 0.0


class _Side:
    """φ on both sides of g = 0."""

    def __init__(self, node: op.Node, g: op.Node, axes: list[Floats]) -> None:
        self.node, self.g = node, g
        self.half = np.array([axis[-1] for axis in axes])
        self.size = 2 * float(self.half.max())

    def slope(self, f: op.Node, x: Floats) -> Floats:
        """The gradient of an expression at places [n, 3]."""
        h = 0.1 * BESIDE * self.size
        return np.stack([(_at(f, x + h * e) - _at(f, x - h * e)) / (2 * h) for e in np.eye(3)], axis=-1)

    def across(self, x: Floats) -> Floats:
        """Unit vectors towards where g is positive."""
        up = self.slope(self.g, x)
        return up / np.linalg.norm(up, axis=1)[:, None]

    def beside(self, x: Floats, way: Floats, part: float = 1.0) -> Floats:
        """φ at g = 0, as it is on the side to which a way leads."""
        e = part * BESIDE * self.size * way
        return 2 * _at(self.node, x + e) - _at(self.node, x + 2 * e)

    def jump(self, x: Floats) -> Jump | None:
        """A jump over 0 at, or near, one of the places [n, 3] with g = 0."""
        with np.errstate(all="ignore"):
            for places in (x, self.ends(x, 1.0), self.ends(x, -1.0)):
                n = self.across(places)
                above, below = self.beside(places, n), self.beside(places, -n)
                found = self.jumps(places, n) & (above * below <= 0 if places is x else True)
                if found.any():
                    k = int(np.argmin(np.where(found, np.linalg.norm(places, axis=1), np.inf)))
                    ends = (float(below[k]), float(above[k]))
                    rounding = 1e-9 * max(map(abs, ends))
                    return Jump(places[k], (_clean(ends[0], rounding), _clean(ends[1], rounding)))
        return None

    def jumps(self, x: Floats, n: Floats) -> NDArray[np.bool_]:
        """Whether φ is more than rounding apart on both sides, however near: at a cusp the difference falls."""
        apart = [np.abs(self.beside(x, n, part) - self.beside(x, -n, part)) for part in (1.0, 0.1)]
        e = BESIDE * self.size * n
        steep = np.maximum(*(np.linalg.norm(self.slope(self.node, x + way), axis=1) for way in (e, -e)))
        rounding = 1e-9 * np.maximum(np.abs(self.beside(x, n)), np.abs(self.beside(x, -n)))
        return (apart[1] > 0.8 * apart[0]) & (apart[1] > STEP * self.size * steep + rounding)

    def ends(self, x: Floats, sign: float) -> Floats:
        """Places of the box with g = 0 where φ comes to 0 on one side."""
        for _ in range(TURNS):
            way = sign * self.across(x)
            slopes = np.stack(
                [self.slope(self.g, x), self.slope(self.node, x + BESIDE * self.size * way)], axis=1
            )
            sizes = np.linalg.norm(slopes, axis=2)
            left = np.stack([_at(self.g, x), self.beside(x, way)], axis=1) / sizes
            good = (
                np.isfinite(left).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2)) & (sizes > 0).all(axis=1)
            )
            x, left, slopes = x[good], left[good], (slopes / sizes[:, :, None])[good]
            x = x - np.einsum("nij,nj->ni", np.linalg.pinv(slopes, rcond=1e-6), left)
            inside = (np.abs(x) <= self.half * (1 + 4 * BESIDE)).all(axis=1)
            x, left = x[inside], left[inside]
        return x[np.abs(left).max(axis=1, initial=0.0) < BESIDE * self.size] if len(x) else x
