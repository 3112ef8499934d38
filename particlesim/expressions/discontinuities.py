"""Where a written force jumps: it has no derivative there, and no implicit method finds a balance with it.

A condition, `sign`, or the slope of `abs`, `min` and `max` in a potential changes at once where some expression g of the
state passes zero. Whether the force jumps with it is looked at: on lines between pairs of states with g of opposite signs,
whose coordinates run through many orders of magnitude, the zero is found by bisection and the force compared on both sides.
So v |v| written as sign(v)*v**2, or a spring that begins at a wall, counts as what it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from particlesim.expressions.operations import (
    VX,
    VY,
    VZ,
    Abs,
    IfLess,
    Maximum,
    Minimum,
    Node,
    Sign,
    Subtract,
    Time,
    X,
    Y,
    Z,
)
from particlesim.expressions.parser import on_arrays
from particlesim.model.arrays import Floats

PAIRS = 1024
"""Lines that are looked at."""
DECADES = 4.0
"""Coordinates are between 10⁻⁴ and 10⁴ m or m/s."""
STATE = (X, Y, Z, VX, VY, VZ)

CALLED: dict[type, str] = {Sign: "sign", IfLess: "a condition", Abs: "abs", Minimum: "min", Maximum: "max"}


def jumping(force: Sequence[Node]) -> tuple[int, str] | None:
    """Which component of a force jumps, and by what; None if none is seen to."""
    return _first(force, (Sign, IfLess), _steps)


def creased(potential: Node) -> str | None:
    """By what the slope of a potential jumps; None if it is not seen to."""
    found = _first([potential], tuple(CALLED), _creases)
    return None if found is None else found[1]


class _Lines:
    """Lines between pairs of states: both ends, shape [6, pairs], and what is the same at both."""

    def __init__(self, start: Floats, end: Floats) -> None:
        self.start, self.end = start, end
        self._time = np.logspace(-DECADES, DECADES, start.shape[1])

    def value(self, node: Node, s: Floats) -> Floats:
        """An expression at parts s of the lines, shape [pairs]."""
        here = self.start + s * (self.end - self.start)

        def variable(leaf: Node) -> Floats:
            if type(leaf) in STATE:
                return np.asarray(here[STATE.index(type(leaf))])
            return self._time if type(leaf) is Time else np.ones(len(s))

        return np.broadcast_to(on_arrays(node, variable), s.shape).astype(float)


Look = Callable[[_Lines, Node, Floats, Floats], NDArray[np.bool_]]


def _lines() -> _Lines:
    """The same ones every time; on every other line a single coordinate changes."""
    rng = np.random.default_rng(0)
    start, end = rng.choice([-1.0, 1.0], (2, 6, PAIRS)) * 10 ** rng.uniform(-DECADES, DECADES, (2, 6, PAIRS))
    kept = np.arange(6)[:, None] != rng.integers(0, 6, PAIRS)
    kept[:, ::2] = False
    return _Lines(start, np.where(kept, start, end))


def _first(nodes: Sequence[Node], kinds: tuple[type, ...], look: Look) -> tuple[int, str] | None:
    lines = _lines()
    for k, node in enumerate(nodes):
        for kind, g in edges(node, kinds):
            low, high = _zero(lines, g)
            found = low < high
            if found.any() and look(lines, node, low, high)[found].any():
                return k, CALLED[kind]
    return None


def edges(node: Node, kinds: tuple[type, ...]) -> Iterator[tuple[type, Node]]:
    """All parts of an expression that change at once, and what passes zero when they do."""
    if isinstance(node, kinds):
        alone = isinstance(node, Sign | Abs)
        yield type(node), node[0] if alone else Subtract(node[0], node[1])
    for part in node:
        if isinstance(part, tuple):
            yield from edges(part, kinds)


def _zero(lines: _Lines, g: Node) -> tuple[Floats, Floats]:
    """Parts of the lines just before and after g passes zero; 0 and 0 where it does not."""
    low, high = np.zeros(PAIRS), np.ones(PAIRS)
    first = lines.value(g, low) < 0
    crosses = np.isfinite(lines.value(g, low) - lines.value(g, high)) & (first != (lines.value(g, high) < 0))
    high[~crosses] = 0.0
    for _ in range(52):
        middle = 0.5 * (low + high)
        same = (lines.value(g, middle) < 0) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.where(crosses, low, 0.0), np.where(crosses, high, 0.0)


def _steps(lines: _Lines, node: Node, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Where an expression differs from one side to the other by more than rounding."""
    before, after = lines.value(node, low), lines.value(node, high)
    ends = [lines.value(node, np.full(PAIRS, s)) for s in (0.0, 1.0)]
    with np.errstate(all="ignore"):
        scale = np.abs(ends).max(axis=0) + np.abs(before) + np.abs(after)
        return np.asarray(np.abs(after - before) > 1e-9 * scale)


def _creases(lines: _Lines, node: Node, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Where the slope of an expression differs from one side to the other: the second difference falls with the way, not
    with its square, and is more than rounding."""
    way, shorter = 1e-4, 8.0
    with np.errstate(all="ignore"):

        def second_difference(h: float) -> Floats:
            before = lines.value(node, low) - lines.value(node, low - h)
            return np.asarray(np.abs(lines.value(node, high + h) - lines.value(node, high) - before))

        far, near = second_difference(way), second_difference(way / shorter)
        scale = np.abs([lines.value(node, np.full(PAIRS, s)) for s in (0.0, 1.0)]).max(axis=0)
        return np.asarray((near * shorter > 0.5 * far) & (near > 1e-9 * scale))
