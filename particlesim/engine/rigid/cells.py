"""Cells of a grid in which bodies are, for others that look at what is near to them (`swift`), and for particles (`grains`).

A body counts as a ball about its centre that holds all of it for a time. Those with balls of more than `LARGE` times the
mean size are in no cell, and everybody looks at them. Cells are `WIDE` times as wide as the largest of the others, and have
numbers by a hash of three integers, so that their number is that of bodies, however far these are from each other."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined

FEW, LARGE, WIDE = 8, 2.0, 4.0
"""Up to how many bodies need no cells; balls of how many times the mean size are in none; how wide cells are."""

FAR = 1e15
"""Cells are no farther from the origin, in their width."""


class BodyCells(NamedTuple):
    """The size of the largest ball in a cell, the width of cells, and how many are in none [3]; where balls are [3, n]; for
    each cell where its bodies begin [cells + 1], and them [n]; those that are in none [n], and 1 for each of them [n]."""

    size: Any
    x: Any
    first: Any
    members: Any
    large: Any
    is_large: Any


def new_body_cells(n: int) -> BodyCells:
    """Room for n bodies."""
    cells = 1 << max(n - 1, 1).bit_length()
    whole = (np.zeros(each, np.int64) for each in (cells + 1, n, n, n))
    return BodyCells(np.zeros(3), np.zeros((3, n)), *whole)


@outlined
def sort(c: BodyCells, b: Any, n: Any, h: Any) -> None:
    """Put the first n bodies into cells, for a time h that begins where they are."""
    mean, c.size[0], c.size[2] = 0.0, 0.0, 0.0
    for i in range(n):
        mean += ball(b, i, h) / n
    for k in range(c.first.size):
        c.first[k] = 0
    for i in range(n):
        c.is_large[i] = 0
        size = ball(b, i, h)
        if n <= FEW or not size <= LARGE * mean:
            add_large(c, i)
        else:
            c.size[0] = max(c.size[0], size)
    c.size[1] = WIDE * c.size[0]
    for i in range(n):
        for axis in range(3):
            c.x[axis, i] = b.x[axis, i]
        if c.is_large[i] == 0:
            c.first[cell_of(c, i)] += 1
    for k in range(1, c.first.size):
        c.first[k] += c.first[k - 1]
    for back in range(n):
        i = n - 1 - back
        if c.is_large[i] == 0:
            k = cell_of(c, i)
            c.first[k] -= 1
            c.members[c.first[k]] = i


def ball(b: Any, i: Any, h: Any) -> Any:
    """The radius of a ball about the centre of body i that holds it for a time [m]."""
    v = b.v
    return b.reach[i] + h * np.sqrt(v[0, i] * v[0, i] + v[1, i] * v[1, i] + v[2, i] * v[2, i])


def add_large(c: BodyCells, i: Any) -> None:
    """Everybody looks at body i from now on."""
    if c.is_large[i] == 0:
        c.is_large[i] = 1
        c.large[int(c.size[2])] = i
        c.size[2] += 1


def follow(c: BodyCells, b: Any, i: Any, left: Any) -> None:
    """Body i has another velocity for the rest of a drift, and may leave its ball."""
    d = (b.x[0, i] - c.x[0, i], b.x[1, i] - c.x[1, i], b.x[2, i] - c.x[2, i])
    if not np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) + ball(b, i, left) <= c.size[0]:
        add_large(c, i)


def number_of(c: BodyCells, x: Any, y: Any, z: Any) -> int:
    """The number of a cell by its place along the axes."""
    return int((x * 73856093 + y * 19349663 + z * 83492791) & (c.first.size - 2))


def along(c: BodyCells, x: Any) -> int:
    """The place of a cell along an axis."""
    return int(np.floor(min(max(x / c.size[1], -FAR), FAR)))


def cell_of(c: BodyCells, i: Any) -> int:
    """The cell of body i."""
    return number_of(c, along(c, c.x[0, i]), along(c, c.x[1, i]), along(c, c.x[2, i]))


def gather_near(c: BodyCells, b: Any, i: Any, left: Any, n: Any, near: Any) -> int:
    """The bodies of n that may come near to body i in the rest of a drift, into `near`; how many there are. Some may be
    there twice."""
    return gather_at(c, (b.x[0, i], b.x[1, i], b.x[2, i]), ball(b, i, left), n, near)


@outlined
def gather_at(c: BodyCells, x: Any, reach: Any, n: Any, near: Any) -> int:
    """The same for a ball at x."""
    count, far = int(c.size[2]), reach + c.size[0]
    for k in range(count):
        near[k] = c.large[k]
    if count == n:
        return count
    wide, drop = 2 * far / c.size[1] + 1, (x[0] - x[0]) + (x[1] - x[1]) + (x[2] - x[2])
    if drop == 0 and wide * wide * wide < max(n, 8):  # what is nowhere is in no cell
        for u in range(along(c, x[0] - far), along(c, x[0] + far) + 1):
            for v in range(along(c, x[1] - far), along(c, x[1] + far) + 1):
                for w in range(along(c, x[2] - far), along(c, x[2] + far) + 1):
                    k = number_of(c, u, v, w)
                    for at in range(c.first[k], c.first[k + 1]):
                        if count < n:
                            near[count] = c.members[at]
                        count += 1
        if count <= n:
            return count
    for j in range(n):
        near[j] = j
    return int(n)
