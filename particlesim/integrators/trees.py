"""Order conditions of Runge–Kutta methods of any order, one for each rooted tree.

A method with coefficients a, b has order p when Σ_i b_i Φ_i(τ) = 1/γ(τ) for all rooted trees τ of up to p nodes, where
Φ_i(τ) is the product of Σ_j a_ij Φ_j over the subtrees at the root, and γ(τ) the number of nodes times the product of
their γ (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, theorem II.2.13). There are 1, 1, 2, 4, 9, 20,
48 and 115 trees of 1 to 8 nodes.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterator, Sequence
from typing import NamedTuple


class Tree(NamedTuple):
    """A rooted tree: the numbers of the trees that hang from its root, its nodes, and its density γ."""

    branches: tuple[int, ...]
    nodes: int
    density: int


class Condition(NamedTuple):
    """One order condition: its order, the sum, and what it must be."""

    order: int
    value: float
    target: float


@functools.cache
def rooted_trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees of up to `order` nodes; the branches of each come before it."""
    trees = [Tree((), 1, 1)]
    for nodes in range(2, order + 1):
        known = tuple(trees)
        for branches in _forests(known, nodes - 1, len(known) - 1):
            density = nodes * math.prod(known[k].density for k in branches)
            trees.append(Tree(branches, nodes, density))
    return tuple(trees)


def _forests(trees: Sequence[Tree], nodes: int, last: int) -> Iterator[tuple[int, ...]]:
    """All ways to take trees, none after number `last` and in falling order, that have so many nodes together."""
    if nodes == 0:
        yield ()
        return
    for k in range(last, -1, -1):
        if trees[k].nodes <= nodes:
            for rest in _forests(trees, nodes - trees[k].nodes, k):
                yield (k, *rest)


@functools.cache
def order_conditions(
    a: tuple[tuple[float, ...], ...], weights: tuple[tuple[float, ...], ...], order: int
) -> tuple[tuple[Condition, ...], ...]:
    """For each row of weights its conditions up to an order; `a` has rows of rising length, zeros left out at their ends."""
    found: list[list[Condition]] = [[] for _ in weights]
    inner: list[list[float]] = []  # Σ_j a_ij Φ_j of every tree
    for tree in rooted_trees(order):
        phi = [math.prod(column) for column in zip(*(inner[k] for k in tree.branches), strict=True)]
        phi = phi or [1.0] * len(a)
        inner.append([_dot(row, phi) for row in a])
        for conditions, row in zip(found, weights, strict=True):
            conditions.append(Condition(tree.nodes, _dot(row, phi), 1 / tree.density))
    return tuple(map(tuple, found))


def _dot(row: Sequence[float], x: Sequence[float]) -> float:
    return sum(map(operator.mul, row, x))
