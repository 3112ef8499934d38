"""The surface on which numbers over a grid are zero, as triangles, for pictures.

Every cell of the grid with numbers of both signs has one corner, the mean of the zeros on its edges; every edge with a zero
has a quadrilateral between the corners of its four cells. The surface is closed, since a layer of positive numbers is put
around the grid.

Source: S. F. F. Gibson, Constrained elastic surface nets, MICCAI 1998.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from particlesim.colliders.triangulation import Triangles, without_slivers
from particlesim.model.arrays import Bools, Floats

Function = Callable[[Floats], Floats]
"""Values at places [n, 3], shape [n]."""


def surface_net(numbers: Floats, axes: Sequence[Floats], function: Function) -> Triangles:
    """Triangles about the places where numbers [nx, ny, nz] are negative, fronts outwards.

    `axes` are the coordinates along each axis [m]. Corners are brought onto the zeros of `function`, of which the numbers
    are values at the points of the grid.
    """
    size = max(float(np.ptp(axis)) for axis in axes)
    thin = 1e-9 * size
    values = np.pad(numbers, 1, constant_values=np.inf)
    lines = [np.concatenate([[axis[0] - thin], axis, [axis[-1] + thin]]) for axis in axes]
    inside = values < 0
    cells = tuple(side - 1 for side in values.shape)
    total, weight = np.zeros((*cells, 3)), np.zeros(cells)
    for axis in range(3):
        zeros, found = _zeros(values, inside, lines, axis)
        # through the outermost layers the surface is as good as at the points of the grid, wherever they are
        share = np.ones(zeros.shape[:3])
        border = [slice(None)] * 3
        for end in (0, -1):
            border[axis] = slice(end, None) if end else slice(0, 1)
            share[tuple(border)] = 1e-6
        share *= found
        across = [k for k in range(3) if k != axis]
        for first in (0, 1):
            for second in (0, 1):
                part = [slice(None)] * 3
                for k, shift in zip(across, (first, second), strict=True):
                    part[k] = slice(shift, shift + cells[k])
                total += (share[..., None] * zeros)[tuple(part)]
                weight += share[tuple(part)]
    number = np.cumsum(weight > 0).reshape(cells) - 1
    held = weight > 0
    corners = total[held] / weight[held][:, None]
    free = np.zeros(cells, bool)
    free[1:-1, 1:-1, 1:-1] = True
    corners = _polished(corners, free[held], function, max(float(np.diff(axis).max()) for axis in axes))
    quads = []
    for axis in range(3):
        low, high = _ends(inside, axis)
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for leaves in (True, False):
            where = np.argwhere((low & ~high) if leaves else (~low & high))
            ring = []
            for da, db in ((1, 1), (0, 1), (0, 0), (1, 0)):
                at = where.copy()
                at[:, a] -= da
                at[:, b] -= db
                ring.append(number[tuple(at.T)])
            quads.append(np.stack(ring if leaves else ring[::-1], axis=1))
    quad = np.concatenate(quads)
    faces = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]).astype(np.int64)
    return without_slivers(Triangles(corners, faces))


def _ends(array: Any, axis: int) -> tuple[Any, Any]:
    """The values at both ends of all edges along an axis."""
    low, high = [slice(None)] * 3, [slice(None)] * 3
    low[axis], high[axis] = slice(None, -1), slice(1, None)
    return array[tuple(low)], array[tuple(high)]


def _zeros(values: Floats, inside: Bools, lines: Sequence[Floats], axis: int) -> tuple[Floats, Bools]:
    """Where the edges along an axis cross zero, shape [..., 3], and which do."""
    (a, b), (p, q) = _ends(values, axis), _ends(inside, axis)
    found = p != q
    with np.errstate(all="ignore"):
        part = np.where(
            found, np.where(np.isfinite(a - b), a / (a - b), np.where(np.isfinite(b), 1.0, 0.0)), 0.0
        )
    grid = list(np.meshgrid(*(v[:-1] if k == axis else v for k, v in enumerate(lines)), indexing="ij"))
    step = np.diff(lines[axis])
    shape = [1, 1, 1]
    shape[axis] = -1
    grid[axis] = grid[axis] + part * step.reshape(shape)
    return np.stack(grid, axis=-1), found


def _polished(corners: Floats, free: Bools, function: Function, cell: float) -> Floats:
    """Corners brought onto the zeros of a function by two steps of Newton's method, no farther than half a cell."""
    x = corners[free]
    h = 1e-4 * cell
    for _ in range(2):
        with np.errstate(all="ignore"):
            rise = np.stack(
                [(function(x + h * axis) - function(x - h * axis)) / (2 * h) for axis in np.eye(3)], axis=1
            )
            step = -(function(x) / (rise**2).sum(axis=1))[:, None] * rise
        good = np.isfinite(step).all(axis=1) & (np.linalg.norm(step, axis=1) < 0.5 * cell)
        x = x + np.where(good[:, None], step, 0.0)
    found = corners.copy()
    found[free] = x
    return found
