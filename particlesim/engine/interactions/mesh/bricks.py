"""Particles to the mesh and back, brick by brick.

The mesh is cut into bricks of 8³ cells. Particles are sorted by bricks, and those of a brick are spread over a copy of its
nodes, small enough for the cache that is nearest; then the copy is added to the mesh. As it has a margin of p − 1 ≤ 7 nodes
on the lower side, it overlaps its neighbours: bricks of one parity along every axis do not overlap, so all threads work on
them at the same time, one of the eight parities after the other. Every node gets its parts in an order that depends on the
positions of the particles alone, not on threads. The field is read in the same way.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import atomic_add, lanes, on_stack, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.mesh.fourier import half_of
from particlesim.engine.interactions.mesh.splines import LANES, order_of, weigh
from particlesim.engine.interactions.neighbours.record import FAR

EDGE = 8
"""Cells of a brick along an axis."""
SIDE, ROW = 2 * EDGE - 1, 2 * EDGE
"""Nodes of a copy along the first two axes, and numbers of a row: one more, so that vectors stay inside."""
TURNS = 9
"""Counters for threads that take work one after another: eight for the parities, one for reading."""
LINE = 8
"""Numbers of a cache line: each counter has one of its own."""


class Bricks(NamedTuple):
    """The mesh [n₀, n₁, 2 half], and which particles are where: `begin` [bricks + 1], where those of each brick begin in
    `places` [room], those in the neighbour lists; `counts` [threads, bricks]; `turns`: counters; `push` [bricks, 4]: sums of
    the force on the particles of each brick, and of what share it out (`read`)."""

    mesh: NDArray[np.float64]
    begin: NDArray[np.int64]
    places: NDArray[np.int32]
    counts: NDArray[np.int64]
    turns: NDArray[np.int64]
    push: NDArray[np.float64]


def new_bricks(shape: tuple[int, int, int], room: int, threads: int) -> Bricks:
    """An empty mesh, and room for so many particles; sizes are even multiples of a brick's edge."""
    number = int(np.prod([n // EDGE for n in shape]))
    return Bricks(
        np.zeros((shape[0], shape[1], 2 * half_of(shape[2]))),
        np.zeros(number + 1, np.int64),
        np.zeros(room, np.int32),
        np.zeros((threads, number), np.int64),
        np.zeros(TURNS * LINE, np.int64),
        np.zeros((number, 4)),
    )


def in_cells(x: Any, cells: Any, count: Any) -> Any:
    """A coordinate in cells, in [0, count); `cells` are the cells of a metre."""
    u = float(x) * cells
    u -= count * np.floor(u / count)
    return u if u < count else 0.0


def _brick_of(given: Any, k: Any, shape: Any) -> Any:
    """The brick of the particle in place k."""
    bx, by, bz = (
        int(in_cells(given.x[axis, k], given.cells[axis], shape[axis])) // EDGE for axis in range(3)
    )
    return (bx * (shape[1] // EDGE) + by) * (shape[2] // EDGE) + bz


class Given(NamedTuple):
    """Particles as the mesh sees them: places `x` [3, room] in m, those that are not there at FAR; `weight` [room], mass or
    charge, and the `part` of the step in which each is there, None where always; `cells` of a metre along each axis, and
    `nodes` along each axis."""

    x: Any
    weight: Any
    part: Any
    cells: Any
    nodes: Any


@outlined
def sort_by_bricks(bricks: Any, given: Any, share: Any) -> None:
    """Sort the places by bricks, those of a brick in their order. All threads of the share call it; ends with a `meet`."""
    room, number = bricks.places.size, bricks.begin.size - 1
    first, last = room * share.number // share.threads, room * (share.number + 1) // share.threads
    mine, nodes = bricks.counts[share.number], given.nodes
    mine[:] = 0
    for k in range(first, last):
        if abs(given.x[0, k]) < FAR:
            mine[_brick_of(given, k, nodes)] += 1
    meet(share.gate, share.threads)
    if share.number == 0:
        total = 0
        for b in range(number):
            bricks.begin[b] = total
            for thread in range(share.threads):
                count = bricks.counts[thread, b]
                bricks.counts[thread, b] = total
                total += count
        bricks.begin[number] = total
    meet(share.gate, share.threads)
    for k in range(first, last):
        if abs(given.x[0, k]) < FAR:
            b = _brick_of(given, k, nodes)
            at = mine[b]
            mine[b] = at + 1
            bricks.places[at] = k
    meet(share.gate, share.threads)


class Eight(NamedTuple):
    """Some particles of a brick at a time: the first of their nodes in the copy along each axis [3, LANES], where they are
    in their cells, what each weighs; weights and slopes [3 p, LANES] of the three axes, and those along the last in rows
    [LANES, LANES] by particle."""

    node: Any
    part: Any
    charge: Any
    weights: Any
    slopes: Any
    row: Any
    row_slopes: Any


def _room(spline: Any) -> Any:
    order = order_of(spline)
    return Eight(
        on_stack(3, LANES, np.int64),
        on_stack(3, LANES, np.float64),
        on_stack(1, LANES, np.float64)[0],
        on_stack(3 * order, LANES, np.float64),
        on_stack(3 * order, LANES, np.float64),
        on_stack(LANES, LANES, np.float64),
        on_stack(LANES, LANES, np.float64),
    )


def _take(
    spline: Any, bricks: Any, given: Any, at: Any, number: Any, origin: Any, some: Any, sloped: Any
) -> None:
    """Find the weights of particles `at` to `at` + number − 1 in the order of the bricks; `origin`: the first cell."""
    order = order_of(spline)
    for i in range(LANES):
        k = bricks.places[at + min(i, number - 1)]
        for axis in range(3):
            u = in_cells(given.x[axis, k], given.cells[axis], given.nodes[axis])
            cell = int(u)
            some.node[axis, i] = cell - origin[axis]
            some.part[axis, i] = u - cell
        some.charge[i] = float(given.weight[k])
        if given.part is not None:
            some.charge[i] *= float(given.part[k])
    for axis in range(3):
        rows = some.weights[axis * order : axis * order + order]
        slopes = some.slopes[axis * order : axis * order + order] if sloped else None
        weigh(spline, some.part[axis], rows, slopes)
    for j in range(order):
        for i in range(LANES):
            some.row[i, j] = some.weights[2 * order + j, i]
    if sloped:
        for j in range(order):
            for i in range(LANES):
                some.row_slopes[i, j] = some.slopes[2 * order + j, i]


def _clear(rows: Any) -> None:
    for i in range(LANES):
        for j in lanes(LANES):
            rows[i, j] = 0.0


def _corner(b: Any, nodes: Any) -> Any:
    """The first cell of a brick along each axis."""
    ny, nz = nodes[1] // EDGE, nodes[2] // EDGE
    return EDGE * (b // (ny * nz)), EDGE * (b // nz % ny), EDGE * (b % nz)


@outlined
def _spread_brick(spline: Any, bricks: Any, given: Any, b: Any, some: Any, copy: Any) -> None:
    """Add the particles of a brick to the mesh."""
    order, nodes = order_of(spline), given.nodes
    begin, end, origin = bricks.begin[b], bricks.begin[b + 1], _corner(b, nodes)
    span, row = EDGE + order - 1, on_stack(1, LANES, np.float64)[0]
    for r in range(SIDE * SIDE):
        for j in lanes(ROW):
            copy[r, j] = 0.0
    _clear(some.row)
    for at in range(begin, end, LANES):
        number = min(LANES, end - at)
        _take(spline, bricks, given, at, number, origin, some, False)
        for i in range(number):
            x, y, z = some.node[0, i], some.node[1, i], some.node[2, i]
            for j in lanes(LANES):
                row[j] = some.row[i, j]
            for ix in range(order):
                wx = some.charge[i] * some.weights[ix, i]
                for iy in range(order):
                    w = wx * some.weights[order + iy, i]
                    line = copy[(x + ix) * SIDE + y + iy, z : z + LANES]
                    for j in lanes(LANES):
                        line[j] += w * row[j]
    for ix in range(span):
        x = (origin[0] + ix - (order - 1)) % nodes[0]
        for iy in range(span):
            y = (origin[1] + iy - (order - 1)) % nodes[1]
            line, own = bricks.mesh[x, y], copy[ix * SIDE + iy]
            for iz in range(order - 1):
                line[(origin[2] + iz - (order - 1)) % nodes[2]] += own[iz]
            for j in range(EDGE):
                line[origin[2] + j] += own[order - 1 + j]


@outlined
def _next(bricks: Any, turn: Any) -> Any:
    return atomic_add(bricks.turns, LINE * turn, 1)


def spread(spline: Any, bricks: Any, given: Any, share: Any) -> None:
    """Density of weights on the nodes. All threads of the share call it, with particles sorted; it ends with a `meet`."""
    mesh, nodes = bricks.mesh, given.nodes
    planes = nodes[0]
    for x in range(planes * share.number // share.threads, planes * (share.number + 1) // share.threads):
        for y in range(nodes[1]):
            mesh[x, y] = 0.0
    meet(share.gate, share.threads)
    some, copy = _room(spline), on_stack(SIDE * SIDE, ROW, np.float64)
    nx, ny, nz = nodes[0] // EDGE, nodes[1] // EDGE, nodes[2] // EDGE
    half = (nx // 2) * (ny // 2) * (nz // 2)
    for parity in range(8):
        k = _next(bricks, parity)
        while k < half:
            bx = 2 * (k // ((ny // 2) * (nz // 2))) + (parity & 1)
            by = 2 * (k // (nz // 2) % (ny // 2)) + (parity >> 1 & 1)
            bz = 2 * (k % (nz // 2)) + (parity >> 2)
            b = (bx * ny + by) * nz + bz
            if bricks.begin[b] < bricks.begin[b + 1]:
                _spread_brick(spline, bricks, given, b, some, copy)
            k = _next(bricks, parity)
        meet(share.gate, share.threads)


@outlined
def _read_brick(
    spline: Any, bricks: Any, given: Any, b: Any, some: Any, copy: Any, factor: Any, pull: Any
) -> None:
    """Add the forces on the particles of a brick to `pull`."""
    order, nodes = order_of(spline), given.nodes
    begin, end, origin = bricks.begin[b], bricks.begin[b + 1], _corner(b, nodes)
    span = EDGE + order - 1
    for ix in range(span):
        x = (origin[0] + ix - (order - 1)) % nodes[0]
        for iy in range(span):
            y = (origin[1] + iy - (order - 1)) % nodes[1]
            line, row = bricks.mesh[x, y], copy[ix * SIDE + iy]
            for iz in range(order - 1):
                row[iz] = line[(origin[2] + iz - (order - 1)) % nodes[2]]
            for j in range(EDGE):
                row[order - 1 + j] = line[origin[2] + j]
    _clear(some.row)
    _clear(some.row_slopes)
    sums = on_stack(3, LANES, np.float64)
    straight, across, along = sums[0], sums[1], sums[2]
    fx, fy, fz, total = 0.0, 0.0, 0.0, 0.0
    for at in range(begin, end, LANES):
        number = min(LANES, end - at)
        _take(spline, bricks, given, at, number, origin, some, True)
        for i in range(number):
            x, y, z = some.node[0, i], some.node[1, i], some.node[2, i]
            for j in lanes(LANES):
                straight[j] = 0.0
            for j in lanes(LANES):
                across[j] = 0.0
            for j in lanes(LANES):
                along[j] = 0.0
            for ix in range(order):
                wx, sx = some.weights[ix, i], some.slopes[ix, i]
                for iy in range(order):
                    wy, sy = some.weights[order + iy, i], some.slopes[order + iy, i]
                    line = copy[(x + ix) * SIDE + y + iy, z : z + LANES]
                    for j in lanes(LANES):
                        v = line[j]
                        straight[j] += wx * wy * v
                        across[j] += wx * sy * v
                        along[j] += sx * wy * v
            gx, gy, gz = 0.0, 0.0, 0.0
            for j in range(LANES):
                gx += along[j] * some.row[i, j]
                gy += across[j] * some.row[i, j]
                gz += straight[j] * some.row_slopes[i, j]
            k = bricks.places[at + i]
            q = float(given.weight[k])
            k0, k1, k2 = (factor * q * given.cells[axis] for axis in range(3))
            px, py, pz = k0 * gx, k1 * gy, k2 * gz
            pull[k, 0] += px
            pull[k, 1] += py
            pull[k, 2] += pz
            part = 1.0 if given.part is None else float(given.part[k])
            fx += part * px
            fy += part * py
            fz += part * pz
            total += part * (q * q)
    bricks.push[b, 0], bricks.push[b, 1], bricks.push[b, 2], bricks.push[b, 3] = fx, fy, fz, total


def read(spline: Any, bricks: Any, given: Any, factor: Any, pull: Any, share: Any) -> None:
    """Add `factor` · weight · the gradient of what is on the nodes to `pull` [room, 3]; then share the sum of these forces
    out among the particles, so that momentum is kept: the errors of all forces together, by the squares of their weights, as
    the errors of single ones are. All threads of the share call it; it ends with a `meet`."""
    number = bricks.begin.size - 1
    some, copy = _room(spline), on_stack(SIDE * SIDE, ROW, np.float64)
    for r in range(SIDE * SIDE):  # vectors reach beyond the nodes of splines of low order, with weights of 0
        for j in lanes(ROW):
            copy[r, j] = 0.0
    b = _next(bricks, 8)
    while b < number:
        if bricks.begin[b] < bricks.begin[b + 1]:
            _read_brick(spline, bricks, given, b, some, copy, factor, pull)
        b = _next(bricks, 8)
    meet(share.gate, share.threads)
    if share.number == 0:
        for turn in range(TURNS):
            bricks.turns[LINE * turn] = 0
    fx, fy, fz, total = 0.0, 0.0, 0.0, 0.0
    for b in range(number):
        if bricks.begin[b] < bricks.begin[b + 1]:
            fx += bricks.push[b, 0]
            fy += bricks.push[b, 1]
            fz += bricks.push[b, 2]
            total += bricks.push[b, 3]
    unit = 1.0 / total if total > 0.0 else 0.0
    room = bricks.places.size
    for k in range(room * share.number // share.threads, room * (share.number + 1) // share.threads):
        q = float(given.weight[k])
        back = unit * (q * q)
        pull[k, 0] -= back * fx
        pull[k, 1] -= back * fy
        pull[k, 2] -= back * fz
    meet(share.gate, share.threads)
