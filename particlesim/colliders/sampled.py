"""Numbers over a grid as a smooth function: the natural cubic spline through them, in three dimensions.

f(x) = Σ c_ijk B(u − i) B(v − j) B(w − k), with B the cubic B-spline and u, v, w the place in units of the grid. It goes
through all numbers, is linear where they are, and has continuous second derivatives.

Source: C. de Boor, A Practical Guide to Splines (1978), chapter 4; ends without curvature.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, outlined
from particlesim.model.arrays import Floats
from particlesim.model.vectors import Vector3


class SampledRecord(NamedTuple):
    """Coefficients of a spline [nx + 2, ny + 2, nz + 2], one more on each side than there are numbers; distances of the
    numbers from each other along each axis. The first of them is at the origin."""

    coefficients: NDArray[np.float64]
    spacing: tuple[float, float, float]


def spline(numbers: Floats) -> Floats:
    """The coefficients for numbers [nx, ny, nz], two along each axis at least."""
    found = numbers
    for axis in range(3):
        found = np.moveaxis(_along(np.moveaxis(found, axis, 0)), 0, axis)
    return np.ascontiguousarray(found)


def _along(s: Floats) -> Floats:
    """Coefficients along the first axis: (c₋ + 4 c + c₊)/6 = s, and c₋ − 2 c + c₊ = 0 at both ends."""
    from scipy.linalg import solve_banded

    n = len(s)
    inner = 6.0 * s[1:-1].reshape(n - 2, -1)
    c = np.empty((n + 2, *s.shape[1:]))
    c[1], c[n] = s[0], s[-1]
    if n > 2:
        inner[0] -= s[0].reshape(-1)
        inner[-1] -= s[-1].reshape(-1)
        bands = np.array([[1.0], [4.0], [1.0]]) * np.ones(n - 2)
        c[2:n] = solve_banded((1, 1), bands, inner, overwrite_b=True).reshape(n - 2, *s.shape[1:])
    c[0], c[n + 1] = 2 * c[1] - c[2], 2 * c[n] - c[n - 1]
    return c


TO_BEZIER = np.array([[1, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6
"""Bézier coefficients of a cell from those of the B-splines there."""
TO_SLOPE = np.array([[-3, 0, 3, 0], [-1, -4, 5, 0], [0, -5, 4, 1], [0, -3, 0, 3]]) / 6
"""Bézier coefficients of the derivative, as a cubic one, in units of the grid."""
AT_ONCE = 1 << 11
"""Cells that are looked at together: they stay in the cache."""


def cells(coefficients: Floats, spacing: Vector3) -> tuple[Floats, Floats, Floats]:
    """Of every cell of the grid the least and the largest value that a spline may have there, and a bound of its slope:
    values and slopes are means of their Bézier coefficients."""
    windows = np.lib.stride_tricks.sliding_window_view(coefficients, (4, 4, 4)).transpose(3, 4, 5, 0, 1, 2)
    shape = windows.shape[3:]
    low, high, steep = np.empty((3, *shape))
    columns = max(1, AT_ONCE // shape[2])
    for i in range(shape[0]):
        for j in range(0, shape[1], columns):
            part = i, slice(j, j + columns)
            own = np.ascontiguousarray(windows[:, :, :, i, j : j + columns])
            square: Floats = np.zeros(1)
            for axis in range(3):
                turn = [TO_SLOPE if k == axis else TO_BEZIER for k in range(3)]
                square = square + (_turned(own, turn) / spacing[axis]) ** 2
            value = _turned(own, [TO_BEZIER] * 3)
            low[part], high[part] = value.min(axis=0), value.max(axis=0)
            steep[part] = np.sqrt(square.max(axis=0))
    return low, high, steep


def _turned(own: Floats, turn: list[Floats]) -> Floats:
    """The coefficients [4, 4, 4, ...] of cells, multiplied by a matrix along each of the first axes, as [64, ...]."""
    x, y, z = turn
    found = np.matmul(z, own.reshape(16, 4, -1))
    found = np.matmul(y, found.reshape(4, 4, -1))
    return np.matmul(x, found.reshape(4, -1)).reshape(64, *own.shape[3:])


def _cell(u: Any, number: Any) -> Any:
    """The cell of a coordinate in units of the grid, the first or the last one beyond its ends, and the place in it."""
    last = number - 4.0
    v = u if u > 0 else 0.0  # also what is no number
    i = int(v if v < last else last)
    return i, u - i


def _weights(t: Any) -> Any:
    """The four B-splines over a cell."""
    s = 1 - t
    return s * s * s / 6, (t * t * (3 * t - 6) + 4) / 6, (s * s * (3 * s - 6) + 4) / 6, t * t * t / 6


def _slopes(t: Any) -> Any:
    """Their derivatives."""
    s = 1 - t
    return -0.5 * s * s, t * (1.5 * t - 2), s * (2 - 1.5 * s), 0.5 * t * t


def _along_z(c: Any, i: Any, j: Any, k: Any, w: Any) -> Any:
    return c[i, j, k] * w[0] + c[i, j, k + 1] * w[1] + c[i, j, k + 2] * w[2] + c[i, j, k + 3] * w[3]


@outlined
def sampled(f: Any, x: Any, y: Any, z: Any) -> Any:
    """The spline at a place."""
    c = f.coefficients
    i, t = _cell(x / f.spacing[0], c.shape[0])
    j, u = _cell(y / f.spacing[1], c.shape[1])
    k, v = _cell(z / f.spacing[2], c.shape[2])
    wz = _weights(v)
    total = 0.0
    for a, wx in enumerate(_weights(t)):
        for b, wy in enumerate(_weights(u)):
            total += wx * wy * _along_z(c, i + a, j + b, k, wz)
    return total


@outlined
def sampled_slope(f: Any, x: Any, y: Any, z: Any) -> Any:
    """The spline and its gradient at a place."""
    c = f.coefficients
    i, t = _cell(x / f.spacing[0], c.shape[0])
    j, u = _cell(y / f.spacing[1], c.shape[1])
    k, v = _cell(z / f.spacing[2], c.shape[2])
    wz, sz = _weights(v), _slopes(v)
    value, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for a, (wx, sx) in enumerate(zip(_weights(t), _slopes(t), strict=True)):
        for b, (wy, sy) in enumerate(zip(_weights(u), _slopes(u), strict=True)):
            line, rise = _along_z(c, i + a, j + b, k, wz), _along_z(c, i + a, j + b, k, sz)
            value += wx * wy * line
            gx += sx * wy * line
            gy += wx * sy * line
            gz += wx * wy * rise
    return value, gx / f.spacing[0], gy / f.spacing[1], gz / f.spacing[2]


def at_places(f: SampledRecord, places: Floats) -> Floats:
    """The spline at places [n, 3], shape [n]."""
    out = np.empty(len(places))
    fill(f, *np.ascontiguousarray(places.T), out)
    return out


@kernel
def fill(f: Any, x: Any, y: Any, z: Any, out: Any) -> None:
    """`out[i]`: the spline at (x, y, z)[i]."""
    for i in range(out.size):
        out[i] = sampled(f, x[i], y[i], z[i])
