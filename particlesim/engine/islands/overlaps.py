"""Pairs of spheres that overlap, for any ratio of sizes.

Each class of sizes has a grid of its own, with cells as wide as two of its largest spheres. A sphere is looked up in the
grids of its own class and of larger ones, in 27 cells of each at most. Cells are entries of a hash table, as spheres may be
far apart (M. Teschner, B. Heidelberger, M. Müller, D. Pomeranets, M. Gross, Optimized Spatial Hashing for Collision
Detection of Deformable Objects, VMV 2003).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import kernel
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.box import PeriodicBox
from particlesim.trajectory.box import in_period

CLASSES = 2.0
"""Ratio of radii within a class of sizes."""
FEW = 300
"""Spheres of which all pairs are looked at: there are no more than 45 000."""
FARTHEST = 2.0**40
"""Cells from the origin of a grid beyond which all are one."""
ROUNDING = 1e-6
"""By how much a sphere looks further than it has to, for what rounding does to cells."""
MIX = (73_856_093, 19_349_663)
"""Factors of cells along x and y in the hash; cells along z follow each other in memory."""
ROOM = 8
"""Pairs for each sphere to have room for at first."""


class Grid(NamedTuple):
    """Spheres of a class in the order of their places in the table: centres and radii [n, 4], whose they are and in which
    cells [n, 3]; where each place begins [places + 1]; along each axis, how many cells a period has, 0 for no period."""

    spheres: Any
    rows: Any
    cells: Any
    begin: Any
    counts: Any


def overlapping(x: Floats, r: Floats, box: PeriodicBox | None = None) -> tuple[Ints, Ints, Floats]:
    """All pairs of spheres at x [n, 3] with radii r [n] that overlap, each once, and how deep [m]."""
    periods = np.zeros(3) if box is None else np.asarray(box.as_box().steps, float)
    if box is not None:
        x = in_period(x - box.as_box().origin, periods)
    there = np.flatnonzero((r > 0) & np.isfinite(r) & np.isfinite(x).all(axis=1))
    if len(there) <= FEW:
        return _among_few(x, r, there, periods)
    sizes = np.floor(np.log(r[there]) / np.log(CLASSES)).astype(np.int64)
    classes = [there[sizes == size] for size in np.unique(sizes)]
    found = []
    for k, rows in enumerate(classes):
        largest = float(r[rows].max())
        lowest = x[rows].min(axis=0)
        counts = np.maximum(np.floor(periods / (2 * largest)), np.where(periods > 0, 1.0, 0.0))
        edge = np.where(periods > 0, periods / np.maximum(counts, 1.0), 2 * largest)
        origin = np.where(periods > 0, 0.0, lowest)
        grid = _grid(x, r, rows, origin, edge, counts.astype(np.int64))
        found += [
            _between(x, r, smaller, grid, origin, edge, largest, periods, smaller is rows)
            for smaller in classes[: k + 1]
        ]
    i, j, depth = (np.concatenate([each[part] for each in found]) for part in range(3))
    return i, j, depth


def _among_few(x: Floats, r: Floats, there: Ints, periods: Floats) -> tuple[Ints, Ints, Floats]:
    """All pairs one by one."""
    a, b = np.triu_indices(len(there), 1)
    i, j = there[a], there[b]
    way = x[i] - x[j]
    way -= periods * np.round(way / np.where(periods > 0, periods, np.inf))
    with np.errstate(over="ignore"):
        depth = r[i] + r[j] - np.sqrt((way**2).sum(axis=1))
    touch = depth > 0
    return i[touch], j[touch], depth[touch]


def _cells(places: Floats, origin: Floats, edge: Floats) -> Ints:
    """Cells of places."""
    cells = np.floor((places - origin) / edge)
    return np.clip(cells, -FARTHEST, FARTHEST).astype(np.int64)


def _grid(x: Floats, r: Floats, rows: Ints, origin: Floats, edge: Floats, counts: Ints) -> Grid:
    """The spheres of a class in their cells."""
    cells = _cells(x[rows], origin, edge)
    cells = np.where(counts > 0, np.minimum(cells, counts - 1), cells)
    places = 1 << int(2 * len(rows)).bit_length()
    place = (cells[:, 0] * MIX[0] + cells[:, 1] * MIX[1] + cells[:, 2]) & (places - 1)
    order = np.argsort(place, kind="stable")
    begin = np.concatenate([[0], np.cumsum(np.bincount(place, minlength=places))])
    rows = rows[order]
    return Grid(_spheres(x, r, rows), rows, np.ascontiguousarray(cells[order]), begin, counts)


def _spheres(x: Floats, r: Floats, rows: Ints) -> Floats:
    return np.ascontiguousarray(np.column_stack([x[rows], r[rows]]))


def _between(
    x: Floats,
    r: Floats,
    rows: Ints,
    grid: Grid,
    origin: Floats,
    edge: Floats,
    largest: float,
    periods: Floats,
    same: bool,
) -> tuple[Ints, Ints, Floats]:
    """Pairs of some spheres with those of a grid, which are the same or others."""
    rows = grid.rows if same else rows
    spheres = _spheres(x, r, rows)
    far = (1 + ROUNDING) * (spheres[:, 3:] + largest)
    low, high = (_cells(spheres[:, :3] + side * far, origin, edge) for side in (-1, 1))
    around = (grid.counts > 0) & (high - low + 1 >= grid.counts)
    low, high = np.where(around, 0, low), np.where(around, grid.counts - 1, high)
    room = ROOM * len(rows)
    while True:
        ends, depth = np.empty((room, 2), np.int64), np.empty(room)
        number = np.zeros(1, np.int64)
        _look(spheres, rows, low, high, grid, same, periods, ends, depth, number)
        if number[0] <= room:
            return ends[: number[0], 0], ends[: number[0], 1], depth[: number[0]]
        room = int(number[0])


@kernel
def _look(
    spheres: Any,
    rows: Any,
    low: Any,
    high: Any,
    grid: Any,
    same: Any,
    periods: Any,
    ends: Any,
    depth: Any,
    number: Any,
) -> None:
    """Write the pairs for which there is room, and how many there are."""
    n0, n1, n2 = grid.counts[0], grid.counts[1], grid.counts[2]
    mask, room, end = grid.begin.size - 2, depth.size, 0
    for k in range(rows.size):
        x, y, z, r, row = spheres[k, 0], spheres[k, 1], spheres[k, 2], spheres[k, 3], rows[k]
        for i in range(low[k, 0], high[k, 0] + 1):
            u = i % n0 if n0 > 0 else i
            for j in range(low[k, 1], high[k, 1] + 1):
                v = j % n1 if n1 > 0 else j
                for h in range(low[k, 2], high[k, 2] + 1):
                    w = h % n2 if n2 > 0 else h
                    place = (u * MIX[0] + v * MIX[1] + w) & mask
                    for m in range(grid.begin[place], grid.begin[place + 1]):
                        here = (grid.cells[m, 0] == u) & (grid.cells[m, 1] == v) & (grid.cells[m, 2] == w)
                        other = grid.rows[m]
                        if here & ((not same) | (row < other)):
                            dx = _nearest(periods[0], x - grid.spheres[m, 0])
                            dy = _nearest(periods[1], y - grid.spheres[m, 1])
                            dz = _nearest(periods[2], z - grid.spheres[m, 2])
                            d = dx * dx + dy * dy + dz * dz
                            reach = r + grid.spheres[m, 3]
                            if d < reach * reach:
                                deep = reach - np.sqrt(d)
                                if (deep > 0) & (end < room):
                                    ends[end, 0], ends[end, 1], depth[end] = row, other, deep
                                end += 1 if deep > 0 else 0
    number[0] = end


def _nearest(period: Any, d: Any) -> Any:
    """The shortest way to a place or one of its images."""
    return d - period * np.floor(d / period + 0.5) if period > 0 else d
