"""A preconditioner of several levels, which carries corrections across an island in few iterations.

With the 3 × 3 blocks of single particles alone, an iteration of a solver carries a correction to the nearest neighbours, and
as many iterations as there are particles along the way carry it across an island. Lattices of growing pitch over the initial
positions shorten that: residuals are summed to the nodes with trilinear weights, multiplied by the inverse of the 3 × 3
block of each node, and carried back, M⁻¹ = Σ P D⁻¹ Pᵀ. The lattices are nested, so that each is reached from the one below.
With Q the inertia and the springs to pinned particles, and B the other springs at a particle, of mean squared length ℓ², the
block of a node of pitch H is about

    D = ½ Σ w Q + ⅔ Σ w (ℓ/H)² B,

the squares of the weights and of their slopes on the mean. M is positive definite whatever the state of the island.
Source: J. Bramble, J. Pasciak, J. Xu, Mathematics of Computation 55, 1 (1990).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.barrier import meet
from particlesim.engine.state.columns import type_of
from particlesim.model.arrays import Floats, Ints

PITCH = 3.0
"""Pitch of the finest lattice in lengths of springs."""
RATIO = 4.0
"""Pitch of each lattice over that of the one below."""
LEVELS = 12
"""Lattices at most: more than any island has."""
FEW = 8
"""Nodes that need no coarser lattice."""
INERTIA, SPRINGS = 0.5, 2 / 3
"""Mean of the weights' squares over the mean of the weights, and of their slopes' squares times H² and ½."""


class Links(NamedTuple):
    """For every row a list of items with weights: items begin[k] … begin[k + 1] − 1 belong to row k.

    Items are unsigned: kernels look whether a signed index is negative, at a quarter of the cost of these loops.
    """

    begin: Any
    item: Any
    weight: Any


class Lattices(NamedTuple):
    """All nodes of all lattices, the finest first: `first` is where those of each lattice begin, `pitch` [m] its pitch.

    `up`: for every node what it gathers from, particles or nodes of the lattice below; `down`: the nodes above it;
    `leaves`: for every particle its nodes of the finest lattice; `square`: ℓ² of every particle [m²]. Of nodes: `residual`
    and `result` [3, nodes], `moment`: Σ w Q and Σ w ℓ² B [12, nodes], `inverse` of D [6, nodes].
    """

    first: Any
    pitch: Any
    up: Links
    down: Links
    leaves: Links
    square: Any
    residual: Any
    result: Any
    moment: Any
    inverse: Any


def new_lattices(place: Floats, i: Ints, j: Ints, weight: Floats, dtype: Any) -> Lattices:
    """Lattices over particles at `place` [3, n] that springs i–j of some stiffness join; none over a few particles."""
    count = place.shape[1]
    square = ((place[:, i] - place[:, j]) ** 2).sum(axis=0)
    total, moment = (
        np.bincount(i, part, count) + np.bincount(j, part, count) for part in (weight, weight * square)
    )
    pitch = PITCH * float(np.sqrt(np.median(square))) if square.size else 0.0
    points, first = place.T - place.min(axis=1, initial=np.inf), [0]
    pitches: list[float] = []
    below: list[tuple[Ints, Ints, Floats]] = []
    while pitch > 0 and len(points) > FEW and len(pitches) < LEVELS:
        rows, nodes, weights, above = _lattice(points, pitch)
        if 2 * len(above) <= len(points):
            below.append((rows, nodes, weights))
            first.append(first[-1] + len(above))
            pitches.append(pitch)
            points = above
        elif pitch > 2 * float(points.max()):
            break
        pitch *= RATIO
    nodes_of = first[-1]
    up, down, leaves = _linked(below, first, count, dtype)
    return Lattices(
        np.array(first),
        np.array(pitches),
        up,
        down,
        leaves,
        np.divide(moment, total, out=np.zeros(count), where=total > 0).astype(dtype),
        *(np.zeros((number, nodes_of), dtype) for number in (3, 3, 12, 6)),
    )


def _lattice(points: Floats, pitch: float) -> tuple[Ints, Ints, Floats, Floats]:
    """Trilinear weights of points [m, 3] on a lattice: rows, nodes and weights, and the places of the nodes in use."""
    scaled = points / pitch
    cell = np.floor(scaled + 1e-9).astype(np.int64)
    t = np.clip(scaled - cell, 0, 1)
    extent = cell.max(axis=0) + 2
    rows, keys, weights = [], [], []
    for corner in np.ndindex(2, 2, 2):
        w = np.prod(np.where(corner, t, 1 - t), axis=1)
        used = np.flatnonzero(w > 1e-6)
        x, y, z = (cell[used] + corner).T
        rows.append(used)
        keys.append((x * extent[1] + y) * extent[2] + z)
        weights.append(w[used])
    known, nodes = np.unique(np.concatenate(keys), return_inverse=True)
    places = np.stack(
        [known // (extent[1] * extent[2]), known // extent[2] % extent[1], known % extent[2]], axis=1
    )
    return np.concatenate(rows), nodes, np.concatenate(weights), places * pitch


def _linked(
    below: list[tuple[Ints, Ints, Floats]], first: list[int], count: int, dtype: Any
) -> tuple[Links, Links, Links]:
    """Links up to nodes, down to nodes and to particles."""
    nothing = (np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))
    ups, downs, leaves = [nothing], [nothing], nothing
    for level, (rows, nodes, weights) in enumerate(below):
        ups.append((nodes + first[level], rows if level == 0 else rows + first[level - 1], weights))
        if level == 0:
            leaves = (rows, nodes, weights)
        else:
            downs.append((rows + first[level - 1], nodes + first[level], weights))
    up, down = (tuple(map(np.concatenate, zip(*parts, strict=True))) for parts in (ups, downs))
    return (
        _by_row(up, first[-1], dtype),
        _by_row(down, first[-1], dtype),
        _by_row(leaves, count, dtype),
    )


def _by_row(entries: tuple[Any, ...], count: int, dtype: Any) -> Links:
    """Rows, items and weights as lists of `count` rows."""
    rows, items, weights = entries
    order = np.lexsort((items, rows))
    begin = np.searchsorted(rows[order], np.arange(count + 1))
    return Links(begin, items[order].astype(np.uint32), weights[order].astype(dtype))


def inverse_of(xx: Any, yy: Any, zz: Any, xy: Any, xz: Any, yz: Any) -> Any:
    """Inverse of a symmetric 3 × 3 matrix, and whether it is positive definite."""
    cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * cx + xy * cy + xz * cz
    good = (xx > 0) & (xx * yy - xy * xy > 0) & (determinant > 0)
    k = type_of(xx, 1) / determinant
    return good, (
        k * cx,
        k * (xx * zz - xz * xz),
        k * (xx * yy - xy * xy),
        k * cy,
        k * cz,
        k * (xy * xz - xx * yz),
    )


def nodes_between(g: Any, level: Any, team: Any) -> Any:
    """The nodes of a lattice that a thread owns."""
    begin = g.first[level]
    number = g.first[level + 1] - begin
    return begin + number * team.number // team.threads, begin + number * (team.number + 1) // team.threads


@outlined
def moments_of_particles(g: Any, free: Any, anchor: Any, block: Any, row: Any, lo: Any, hi: Any) -> None:
    """One row of both moments of nodes [lo, hi) of the finest lattice."""
    for node in range(lo, hi):
        q = b = type_of(anchor[0], 0)
        for k in range(g.up.begin[node], g.up.begin[node + 1]):
            i = g.up.item[k]
            u = g.up.weight[k] * free[i]
            q += u * anchor[i]
            b += u * g.square[i] * (block[i] - anchor[i])
        g.moment[row, node], g.moment[6 + row, node] = q, b


@outlined
def moments_of_nodes(g: Any, row: Any, lo: Any, hi: Any) -> None:
    """One row of the moments of nodes [lo, hi) of a lattice from those of the lattice below."""
    below = g.moment[row]
    for node in range(lo, hi):
        total = type_of(below[0], 0)
        for k in range(g.up.begin[node], g.up.begin[node + 1]):
            total += g.up.weight[k] * below[g.up.item[k]]
        below[node] = total


@shared
def gather_blocks(g: Any, free: Any, anchor: Any, block: Any, team: Any) -> None:
    """The blocks of all nodes from those of the particles, which must not be inverted yet; all threads go on together."""
    levels = g.first.size - 1
    meet(team.gate, team.threads)
    for level in range(levels):
        lo, hi = nodes_between(g, level, team)
        if level == 0:
            for row in range(6):
                moments_of_particles(g, free, anchor[row], block[row], row, lo, hi)
        else:
            for row in range(12):
                moments_of_nodes(g, row, lo, hi)
        meet(team.gate, team.threads)
        slope = type_of(g.moment[0, 0], SPRINGS / (g.pitch[level] * g.pitch[level]))
        half = type_of(slope, INERTIA)
        for node in range(lo, hi):
            m = g.moment[:, node]
            good, inverse = inverse_of(
                half * m[0] + slope * m[6],
                half * m[1] + slope * m[7],
                half * m[2] + slope * m[8],
                half * m[3] + slope * m[9],
                half * m[4] + slope * m[10],
                half * m[5] + slope * m[11],
            )
            for row, entry in enumerate(inverse):
                g.inverse[row, node] = entry if good else half - half


@outlined
def carry(g: Any, free: Any, r: Any, z: Any, team: Any) -> None:
    """z += Σ P D⁻¹ Pᵀ r for the particles of a share; all of r must be written, and need not be in place."""
    levels = g.first.size - 1
    if levels > 0:
        meet(team.gate, team.threads)
        for level in range(levels):
            lo, hi = nodes_between(g, level, team)
            gather(g, free, r, level, lo, hi)
            meet(team.gate, team.threads)
        for step in range(levels):
            lo, hi = nodes_between(g, levels - 1 - step, team)
            spread(g, lo, hi)
            meet(team.gate, team.threads)
        for i in range(team.first, team.last):
            if free[i] > 0:
                zx, zy, zz = z[0, i], z[1, i], z[2, i]
                for k in range(g.leaves.begin[i], g.leaves.begin[i + 1]):
                    node, w = g.leaves.item[k], g.leaves.weight[k]
                    zx += w * g.result[0, node]
                    zy += w * g.result[1, node]
                    zz += w * g.result[2, node]
                z[0, i], z[1, i], z[2, i] = zx, zy, zz


@outlined
def gather(g: Any, free: Any, r: Any, level: Any, lo: Any, hi: Any) -> None:
    """Residuals of nodes [lo, hi) of a lattice from those below."""
    for node in range(lo, hi):
        x = y = z = type_of(g.residual[0, node], 0)
        for k in range(g.up.begin[node], g.up.begin[node + 1]):
            i, w = g.up.item[k], g.up.weight[k]
            if level == 0:
                w = w * free[i]
                x += w * r[0, i]
                y += w * r[1, i]
                z += w * r[2, i]
            else:
                x += w * g.residual[0, i]
                y += w * g.residual[1, i]
                z += w * g.residual[2, i]
        g.residual[0, node], g.residual[1, node], g.residual[2, node] = x, y, z


@outlined
def spread(g: Any, lo: Any, hi: Any) -> None:
    """Results of nodes [lo, hi): their own, and the contribution of the lattice above."""
    for node in range(lo, hi):
        rx, ry, rz = g.residual[0, node], g.residual[1, node], g.residual[2, node]
        x = g.inverse[0, node] * rx + g.inverse[3, node] * ry + g.inverse[4, node] * rz
        y = g.inverse[3, node] * rx + g.inverse[1, node] * ry + g.inverse[5, node] * rz
        z = g.inverse[4, node] * rx + g.inverse[5, node] * ry + g.inverse[2, node] * rz
        for k in range(g.down.begin[node], g.down.begin[node + 1]):
            above, w = g.down.item[k], g.down.weight[k]
            x += w * g.result[0, above]
            y += w * g.result[1, above]
            z += w * g.result[2, above]
        g.result[0, node], g.result[1, node], g.result[2, node] = x, y, z
