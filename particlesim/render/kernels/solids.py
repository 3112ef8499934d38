"""Surfaces and tubes before they are drawn: normals, and the samples or texels that each may touch."""

from __future__ import annotations

from math import floor, isfinite, sqrt

import numpy as np

from particlesim.compiler import kernel
from particlesim.render.kernels.project import NEAR
from particlesim.render.kernels.records import Array, Float32s, Ints, Planes, Triple, View


@kernel
def face_normals(world: Float32s, corner: Ints, start: int, stop: int, face: Float32s) -> None:
    """`face[t]`: the normal of a triangle, as long as twice its area."""
    for t in range(start, stop):
        a, b, c = corner[t, 0], corner[t, 1], corner[t, 2]
        ux, uy, uz = world[b, 0] - world[a, 0], world[b, 1] - world[a, 1], world[b, 2] - world[a, 2]
        vx, vy, vz = world[c, 0] - world[a, 0], world[c, 1] - world[a, 1], world[c, 2] - world[a, 2]
        face[t, 0], face[t, 1], face[t, 2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def smooth_normals(face: Float32s, first: Array, fan: Ints, start: int, stop: int, normal: Float32s) -> None:
    """`normal[k]`: the mean of the faces `fan[first[k]:first[k + 1]]`, weighed by their areas (Gouraud)."""
    for k in range(start, stop):
        x, y, z = 0.0, 0.0, 0.0
        for j in range(first[k], first[k + 1]):
            x += face[fan[j], 0]
            y += face[fan[j], 1]
            z += face[fan[j], 2]
        length = sqrt(x * x + y * y + z * z)
        inv = 1.0 / length if length > 0.0 else 0.0
        normal[k, 0], normal[k, 1], normal[k, 2] = x * inv, y * inv, z * inv


def on_screen(sphere: Float32s, i: int, view: View) -> Triple:
    """Column, row and inverse depth of a particle; the depth must be positive."""
    inv = 1.0 / np.float64(sphere[i, 2])
    return (
        0.5 * view.width + view.focal * sphere[i, 0] * inv,
        0.5 * view.height - view.focal * sphere[i, 1] * inv,
        inv,
    )


def _clip(box: Ints, k: int, low: Triple, high: Triple, width: int, height: int) -> None:
    """Write the samples between two corners that lie inside the picture."""
    if high[0] < 0 or low[0] > width or high[1] < 0 or low[1] > height:
        return
    box[k, 0], box[k, 1] = int(max(floor(low[0]), 0)), int(min(floor(high[0]), width - 1))
    box[k, 2], box[k, 3] = int(max(floor(low[1]), 0)), int(min(floor(high[1]), height - 1))


def _hidden(world: Float32s, i: int, planes: Planes) -> bool:
    """Whether a plane that faces the camera lies before a point."""
    for k in range(len(planes.point)):
        height = (
            (world[i, 0] - planes.point[k, 0]) * planes.normal[k, 0]
            + (world[i, 1] - planes.point[k, 1]) * planes.normal[k, 1]
            + (world[i, 2] - planes.point[k, 2]) * planes.normal[k, 2]
        )
        if planes.facing[k] and height < -1e-4:
            return True
    return False


@kernel
def box_triangles(
    world: Float32s,
    sphere: Float32s,
    corner: Ints,
    start: int,
    stop: int,
    view: View,
    planes: Planes,
    box: Ints,
) -> None:
    """Samples that triangles may touch (first > last: not drawn, as one that reaches behind the camera)."""
    for t in range(start, stop):
        box[t, 0], box[t, 1], box[t, 2], box[t, 3] = 0, -1, 0, -1
        a, b, c = corner[t, 0], corner[t, 1], corner[t, 2]
        if not (sphere[a, 2] > NEAR and sphere[b, 2] > NEAR and sphere[c, 2] > NEAR):
            continue
        if _hidden(world, a, planes) and _hidden(world, b, planes) and _hidden(world, c, planes):
            continue
        p, q, r = on_screen(sphere, a, view), on_screen(sphere, b, view), on_screen(sphere, c, view)
        low = (min(p[0], q[0], r[0]), min(p[1], q[1], r[1]), 0.0)
        high = (max(p[0], q[0], r[0]), max(p[1], q[1], r[1]), 0.0)
        _clip(box, t, low, high, view.width, view.height)


@kernel
def box_tubes(
    world: Float32s,
    sphere: Float32s,
    end: Ints,
    start: int,
    stop: int,
    view: View,
    planes: Planes,
    radius: Float32s,
    least: float,
    box: Ints,
) -> None:
    """Samples that tubes may touch: `radius[t]` [scene units], on the screen at least `least` samples."""
    for t in range(start, stop):
        box[t, 0], box[t, 1], box[t, 2], box[t, 3] = 0, -1, 0, -1
        a, b = end[t, 0], end[t, 1]
        if not (sphere[a, 2] > NEAR and sphere[b, 2] > NEAR):
            continue
        if _hidden(world, a, planes) and _hidden(world, b, planes):
            continue
        p, q = on_screen(sphere, a, view), on_screen(sphere, b, view)
        wide = max(radius[t] * view.focal * max(p[2], q[2]), least) + 0.5
        low = (min(p[0], q[0]) - wide, min(p[1], q[1]) - wide, 0.0)
        high = (max(p[0], q[0]) + wide, max(p[1], q[1]) + wide, 0.0)
        _clip(box, t, low, high, view.width, view.height)


@kernel
def box_on_map(
    disc: Float32s, rows: Ints, start: int, stop: int, margin: Float32s, size: int, box: Ints
) -> None:
    """Texels that triangles or tubes (`rows` of two or three particles), `margin[t]` texels around their points, may touch
    in a parallel projection."""
    for t in range(start, stop):
        box[t, 0], box[t, 1], box[t, 2], box[t, 3] = 0, -1, 0, -1
        u0, v0 = np.float64(disc[rows[t, 0], 0]), np.float64(disc[rows[t, 0], 1])
        u1, v1 = u0, v0
        whole = isfinite(u0 + v0)
        for c in range(1, rows.shape[1]):
            u, v = np.float64(disc[rows[t, c], 0]), np.float64(disc[rows[t, c], 1])
            whole = whole and isfinite(u + v)
            u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
        if whole:
            m = np.float64(margin[t])
            _clip(box, t, (u0 - m, v0 - m, 0.0), (u1 + m, v1 + m, 0.0), size, size)
