"""From positions in metres to scene units, to the camera, to a light, and into bands of rows."""

from __future__ import annotations

from math import floor, isfinite, sqrt

import numpy as np

from particlesim.compiler import kernel
from particlesim.render.kernels.records import Array, Axes, Float32s, Ints, Planes, View

BAND = 16
"""Rows of one band: the piece of work of one thread."""

NEAR = 1e-3
"""Nothing closer to the camera than this is drawn [scene units]."""


@kernel
def to_scene(position: Array, start: int, stop: int, center: Array, scale: float, world: Float32s) -> int:
    """Write `world[start:stop]` (scene units); returns how many positions are not finite (they stay NaN)."""
    bad = 0
    for i in range(start, stop):
        for c in range(3):
            world[i, c] = (np.float64(position[i, c]) - center[c]) / scale
        if not isfinite(world[i, 0] + world[i, 1] + world[i, 2]):
            bad += 1
            world[i, 0] = np.nan
    return bad


def _behind_a_plane(x: float, y: float, z: float, radius: float, planes: Planes) -> bool:
    for k in range(len(planes.point)):
        if not planes.facing[k]:
            continue
        height = (
            (x - planes.point[k, 0]) * planes.normal[k, 0]
            + (y - planes.point[k, 1]) * planes.normal[k, 1]
            + (z - planes.point[k, 2]) * planes.normal[k, 2]
        )
        if height < -radius:
            return True
    return False


def sunk(view: View, planes: Planes, right: float, up: float, ahead: float) -> bool:
    """Whether a point in camera axes is below a plane that faces the camera."""
    a, eye = view.axes, view.eye
    return _behind_a_plane(
        eye[0] + a[0][0] * right + a[1][0] * up + a[2][0] * ahead,
        eye[1] + a[0][1] * right + a[1][1] * up + a[2][1] * ahead,
        eye[2] + a[0][2] * right + a[1][2] * up + a[2][2] * ahead,
        0.0,
        planes,
    )


@kernel
def to_view(
    world: Float32s,
    radius: Float32s,
    start: int,
    stop: int,
    view: View,
    planes: Planes,
    least: float,
    sphere: Float32s,
    box: Ints,
) -> None:
    """Spheres in camera axes and the samples they may touch.

    `sphere[i]` becomes the centre along right, up, forward and the drawn radius, which is at least `least`
    samples on the screen. `box[i]` becomes the first and last column and row (first > last when nothing is
    to be drawn). The outline of a sphere in a pinhole camera is an ellipse whose extent along an axis x is
    (x z ± r √(x² + z² − r²)) / (z² − r²).
    """
    a = view.axes
    for i in range(start, stop):
        box[i, 0], box[i, 1], box[i, 2], box[i, 3] = 0, -1, 0, -1
        dx, dy, dz = world[i, 0] - view.eye[0], world[i, 1] - view.eye[1], world[i, 2] - view.eye[2]
        x = a[0][0] * dx + a[0][1] * dy + a[0][2] * dz
        y = a[1][0] * dx + a[1][1] * dy + a[1][2] * dz
        z = a[2][0] * dx + a[2][1] * dy + a[2][2] * dz
        r = max(float(radius[i]), least * z / view.focal)
        sphere[i, 0], sphere[i, 1], sphere[i, 2], sphere[i, 3] = x, y, z, r
        if not z - r > NEAR:
            continue
        if _behind_a_plane(world[i, 0], world[i, 1], world[i, 2], radius[i], planes):
            continue
        f = view.focal / (z * z - r * r)
        wide, high = r * sqrt(x * x + z * z - r * r), r * sqrt(y * y + z * z - r * r)
        left, right = 0.5 * view.width + f * (x * z - wide), 0.5 * view.width + f * (x * z + wide)
        top, bottom = 0.5 * view.height - f * (y * z + high), 0.5 * view.height - f * (y * z - high)
        if right < 0 or left > view.width or bottom < 0 or top > view.height:
            continue
        box[i, 0], box[i, 1] = max(floor(left - 0.5), 0), min(floor(right + 0.5), view.width - 1)
        box[i, 2], box[i, 3] = max(floor(top - 0.5), 0), min(floor(bottom + 0.5), view.height - 1)


@kernel
def to_map(
    world: Float32s,
    sphere: Float32s,
    start: int,
    stop: int,
    axes: Axes,
    scale: float,
    size: int,
    disc: Float32s,
    box: Ints,
) -> None:
    """Spheres seen along `axes[2]` without perspective: `disc[i]` is column, row, depth, radius in texels."""
    for i in range(start, stop):
        box[i, 0], box[i, 1], box[i, 2], box[i, 3] = 0, -1, 0, -1
        x, y, z = world[i, 0], world[i, 1], world[i, 2]
        u = 0.5 * size + scale * (axes[0][0] * x + axes[0][1] * y + axes[0][2] * z)
        v = 0.5 * size - scale * (axes[1][0] * x + axes[1][1] * y + axes[1][2] * z)
        r = max(scale * sphere[i, 3], 0.71)
        disc[i, 0], disc[i, 1], disc[i, 3] = u, v, r
        disc[i, 2] = axes[2][0] * x + axes[2][1] * y + axes[2][2] * z
        if u + r > 0 and u - r < size and v + r > 0 and v - r < size:
            box[i, 0], box[i, 1] = max(int(u - r), 0), min(int(u + r), size - 1)
            box[i, 2], box[i, 3] = max(int(v - r), 0), min(int(v + r), size - 1)


def bin_bands(box: Ints, order: Ints, height: int) -> tuple[Array, Ints]:
    """Which particles touch which band: `items[first[b]:first[b + 1]]`, in the sequence of `order` (empty:
    by index)."""
    first = np.zeros((height + BAND - 1) // BAND + 1, np.int64)
    count_in_bands(box, first)
    items = np.empty(first[-1], np.int32)
    sort_into_bands(box, order, first[:-1].copy(), items)
    return first, items


@kernel
def count_in_bands(box: Ints, first: Array) -> None:
    """Where the items of each band begin: `first` comes as zeros."""
    for i in range(len(box)):
        if box[i, 0] <= box[i, 1]:
            for b in range(box[i, 2] // BAND, box[i, 3] // BAND + 1):
                first[b + 1] += 1
    for b in range(len(first) - 1):
        first[b + 1] += first[b]


@kernel
def sort_into_bands(box: Ints, order: Ints, cursor: Array, items: Ints) -> None:
    """Write the items of each band; `cursor` is where the next one of each goes."""
    for k in range(len(box)):
        i = order[k] if len(order) > 0 else k
        if box[i, 0] <= box[i, 1]:
            for b in range(box[i, 2] // BAND, box[i, 3] // BAND + 1):
                items[cursor[b]] = i
                cursor[b] += 1


@kernel
def gather(table: Float32s, items: Array, rows: Float32s) -> None:
    """`rows[k] = table[items[k]]`: a short loop, so that many cache misses are under way at once."""
    for k in range(len(items)):
        i = items[k]
        for c in range(4):
            rows[k, c] = table[i, c]


DEPTHS = 65536
"""Steps of depth by which particles are sorted."""


def far_to_near(sphere: Float32s, box: Ints) -> Ints:
    """Indices by falling view depth: a stable counting sort of the depth in 65 536 steps."""
    order = np.empty(len(box), np.int32)
    sort_by_depth(sphere, box, np.zeros(DEPTHS + 1, np.int64), np.zeros(len(box), np.uint16), order)
    return order


@kernel
def sort_by_depth(sphere: Float32s, box: Ints, count: Array, key: Array, order: Ints) -> None:
    """Write `order`; `count` and `key` come as zeros."""
    low, high = np.inf, -np.inf
    for i in range(len(box)):
        if box[i, 0] <= box[i, 1]:
            low, high = min(low, sphere[i, 2]), max(high, sphere[i, 2])
    factor = (DEPTHS - 1) / max(high - low, 1e-30)
    for i in range(len(box)):
        if box[i, 0] <= box[i, 1]:
            key[i] = int((high - sphere[i, 2]) * factor)
        count[key[i] + 1] += 1
    for k in range(DEPTHS):
        count[k + 1] += count[k]
    for i in range(len(box)):
        order[count[key[i]]] = i
        count[key[i]] += 1
