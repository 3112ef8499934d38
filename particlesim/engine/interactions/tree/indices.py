"""Multi-indices k = (a, b, c), degree by degree: |k| = a + b + c, k! = a! b! c!, x^k = x^a y^b z^c.

An expansion in kernels is a tuple of its degrees, and each of these a tuple of numbers, one for each multi-index in the
order of `of_degree`; None stands for a degree that is zero. These tables are known while kernels are compiled, so that all
sums over multi-indices are written out.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

Index = tuple[int, int, int]


class Step(NamedTuple):
    """How a number of one degree comes from those of the two degrees below: along `axis`, where the index is `power`."""

    axis: int
    power: int
    below: int
    """Place of k − e among those of the degree below."""
    second: int
    """Place of k − 2e two degrees below; −1 where there is none."""


class Term(NamedTuple):
    """A product in a sum over indices: places of two numbers, each in its degree."""

    degree: int
    place: int
    other_degree: int
    other: int


@functools.cache
def of_degree(n: int) -> tuple[Index, ...]:
    """All multi-indices of degree n."""
    found = ((a, b, c) for a, b, c in itertools.product(range(n + 1), repeat=3) if a + b + c == n)
    return tuple(sorted(found, reverse=True))


@functools.cache
def place(k: Index) -> int:
    """Where a multi-index stands in its degree."""
    return of_degree(sum(k)).index(k)


def _plus(a: Index, b: Index) -> Index:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _minus(a: Index, b: Index) -> Index:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


_AXES: tuple[Index, ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@functools.cache
def steps(n: int) -> tuple[Step, ...]:
    """For every index of degree n, the step that makes it with the fewest terms."""
    found = []
    for k in of_degree(n):
        axis = min((a for a in range(3) if k[a]), key=lambda a: k[a])
        below = _minus(k, _AXES[axis])
        second = place(_minus(below, _AXES[axis])) if k[axis] > 1 else -1
        found.append(Step(axis, k[axis], place(below), second))
    return tuple(found)


@functools.cache
def parts(n: int) -> tuple[tuple[Term, ...], ...]:
    """For every index k of degree n, all i + j = k: the terms of a product of two series, and of a shift of moments."""
    return tuple(
        tuple(
            Term(d, place(i), n - d, place(_minus(k, i)))
            for d in range(n + 1)
            for i in of_degree(d)
            if min(_minus(k, i)) >= 0
        )
        for k in of_degree(n)
    )


@functools.cache
def raised(n: int, d: int) -> tuple[tuple[int, ...], ...]:
    """For every index k of degree n: the places of k + j for all j of degree d."""
    return tuple(tuple(place(_plus(k, j)) for j in of_degree(d)) for k in of_degree(n))


@functools.cache
def weights(n: int) -> tuple[float, ...]:
    """n! k! for every index of degree n: Σ of these times M_k², with M_k = Σ w x^k/k!, is the square of the norm of the
    tensor Σ w x ⊗ … ⊗ x."""
    factorial = math.factorial
    return tuple(float(factorial(n) * factorial(a) * factorial(b) * factorial(c)) for a, b, c in of_degree(n))


@functools.cache
def size(n: int) -> int:
    """How many multi-indices have degree n."""
    return (n + 1) * (n + 2) // 2


def columns(first: int, last: int, without: int = -1) -> tuple[int, ...]:
    """Where degrees begin in a row that holds those from `first` to `last`, but for one; −1 for what it does not hold; at
    the end the length of the row.

    A function that kernels walk through, unlike the tables, which they only call: so they know of this module, and are
    compiled anew when it changes.
    """
    return _columns(first, last, without)


@functools.cache
def _columns(first: int, last: int, without: int) -> tuple[int, ...]:
    begins, total = [], 0
    for n in range(last + 1):
        held = n >= first and n != without
        begins.append(total if held else -1)
        total += size(n) if held else 0
    return (*begins, total)


_PIECE = 60
"""Products in a piece, about: more at once do not fit into registers, and LLVM makes no vectors of very long loops."""


@functools.cache
def pieces(first: int, order: int) -> tuple[tuple[int, tuple[int, ...]], ...]:
    """The indices of degrees `first` to `order`, degree and places, in pieces whose sums over all indices up to the order
    have about as many products."""
    found = []
    for n in range(first, order + 1):
        products = sum(size(j) for j in range(order - n + 1))
        number = max(1, -(-_PIECE // products))
        places = tuple(range(size(n)))
        found += [(n, places[k : k + number]) for k in range(0, size(n), number)]
    return tuple(found)
