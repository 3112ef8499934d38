"""The surface, tube or sphere visible at each point of a sample, and their depth maps for shadows.

A sample of a picture with surfaces is tested at `SUBSAMPLES` points, so that silhouettes are smooth wherever spheres, tubes
and triangles meet. The points are like eight queens on a board of 8 × 8, so that edges that are nearly horizontal or
vertical pass them one by one. Inverse depth is linear on the screen along anything flat.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from particlesim.compiler import kernel
from particlesim.render.kernels.project import BAND, sunk
from particlesim.render.kernels.records import Array, Float32s, Ints, Planes, Samples, Solids, Triple, View
from particlesim.render.kernels.solids import on_screen

SUBSAMPLES = 8

_X = np.array([5, 1, 6, 3, 0, 7, 2, 4], np.float32) / np.float32(8) - np.float32(7 / 16)
_Y = np.array([0, 1, 2, 3, 4, 5, 6, 7], np.float32) / np.float32(8) - np.float32(7 / 16)
_REACH = 7 / 16


@kernel
def clear_samples(samples: Samples) -> None:
    """Begin a band in which nothing is seen."""
    samples.inverse[:] = 0.0
    samples.id[:] = -1


def _edge(p: Triple, q: Triple, sign: float) -> Triple:
    """a, b, c of the function a x + b y + c that is 0 on the line from p to q and positive to one side."""
    a, b = sign * (p[1] - q[1]), sign * (q[0] - p[0])
    return a, b, -(a * p[0] + b * p[1])


@kernel
def raster_triangles(
    sphere: Float32s,
    solids: Solids,
    base: int,
    box: Ints,
    items: Array,
    row0: int,
    view: View,
    samples: Samples,
) -> None:
    """Keep what is nearest in every point of the band; triangle t is numbered base + t. Both sides are seen."""
    inverse, ids = samples.inverse, samples.id
    rows = min(BAND, view.height - row0)
    for k in range(len(items)):
        t = items[k]
        p = on_screen(sphere, solids.corner[t, 0], view)
        q = on_screen(sphere, solids.corner[t, 1], view)
        r = on_screen(sphere, solids.corner[t, 2], view)
        area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        if area == 0.0:
            continue
        sign = 1.0 if area > 0.0 else -1.0
        e0, e1, e2 = _edge(q, r, sign), _edge(r, p, sign), _edge(p, q, sign)
        inv = sign / area
        wx = (e0[0] * p[2] + e1[0] * q[2] + e2[0] * r[2]) * inv
        wy = (e0[1] * p[2] + e1[1] * q[2] + e2[1] * r[2]) * inv
        m0 = _REACH * (abs(e0[0]) + abs(e0[1]))
        m1 = _REACH * (abs(e1[0]) + abs(e1[1]))
        m2 = _REACH * (abs(e2[0]) + abs(e2[1]))
        a0, b0, a1, b1 = np.float32(e0[0]), np.float32(e0[1]), np.float32(e1[0]), np.float32(e1[1])
        a2, b2, dx, dy = np.float32(e2[0]), np.float32(e2[1]), np.float32(wx), np.float32(wy)
        for y in range(max(box[t, 2] - row0, 0), min(box[t, 3] - row0 + 1, rows)):
            py = row0 + y + 0.5
            for x in range(box[t, 0], box[t, 1] + 1):
                px = x + 0.5
                d0 = e0[0] * px + e0[1] * py + e0[2]
                d1 = e1[0] * px + e1[1] * py + e1[2]
                d2 = e2[0] * px + e2[1] * py + e2[2]
                if d0 < -m0 or d1 < -m1 or d2 < -m2:
                    continue
                c0, c1, c2 = np.float32(d0), np.float32(d1), np.float32(d2)
                w = np.float32(p[2] + wx * (px - p[0]) + wy * (py - p[1]))
                for s in range(SUBSAMPLES):
                    sx, sy = _X[s], _Y[s]
                    within = (c0 + a0 * sx + b0 * sy >= 0) & (c1 + a1 * sx + b1 * sy >= 0)
                    within &= c2 + a2 * sx + b2 * sy >= 0
                    here = w + dx * sx + dy * sy
                    within &= here > inverse[y, x, s]
                    inverse[y, x, s] = here if within else inverse[y, x, s]
                    ids[y, x, s] = base + t if within else ids[y, x, s]


@kernel
def raster_tubes(
    sphere: Float32s,
    solids: Solids,
    least: float,
    base: int,
    box: Ints,
    items: Array,
    row0: int,
    view: View,
    samples: Samples,
) -> None:
    """The same for tubes with round ends: tube t is numbered base + t. They are at least `least` samples in radius."""
    inverse, ids = samples.inverse, samples.id
    rows = min(BAND, view.height - row0)
    for k in range(len(items)):
        t = items[k]
        p = on_screen(sphere, solids.end[t, 0], view)
        q = on_screen(sphere, solids.end[t, 1], view)
        radius = solids.radius[t] * view.focal
        wide0, wide1 = max(radius * p[2], least), max(radius * q[2], least)
        dx, dy = q[0] - p[0], q[1] - p[1]
        inv = 1.0 / max(dx * dx + dy * dy, 1e-12)
        most = max(wide0, wide1) + 0.7
        for y in range(max(box[t, 2] - row0, 0), min(box[t, 3] - row0 + 1, rows)):
            py = row0 + y + 0.5 - p[1]
            for x in range(box[t, 0], box[t, 1] + 1):
                px = x + 0.5 - p[0]
                middle = min(max((px * dx + py * dy) * inv, 0.0), 1.0)
                ex, ey = px - middle * dx, py - middle * dy
                if ex * ex + ey * ey > most * most:
                    continue
                for s in range(SUBSAMPLES):
                    sx, sy = px + _X[s], py + _Y[s]
                    along = min(max((sx * dx + sy * dy) * inv, 0.0), 1.0)
                    ex, ey = sx - along * dx, sy - along * dy
                    wide = wide0 + along * (wide1 - wide0)
                    room = wide * wide - ex * ex - ey * ey
                    if room <= 0.0:
                        continue
                    # The round front stands out towards the camera by as much as it is away from the outline.
                    w = p[2] + along * (q[2] - p[2])
                    w = w / (1.0 - min(sqrt(room) / view.focal, 0.5))
                    if w > inverse[y, x, s]:
                        inverse[y, x, s] = w
                        ids[y, x, s] = base + t


@kernel
def raster_balls(
    sphere: Float32s,
    box: Ints,
    items: Array,
    row0: int,
    view: View,
    planes: Planes | None,
    samples: Samples,
) -> None:
    """The same for spheres, numbered by themselves (see `raster.raster_spheres` for the geometry), but for what is below
    `planes`, if given."""
    inverse, ids = samples.inverse, samples.id
    rows = min(BAND, view.height - row0)
    inv = 1.0 / view.focal
    for k in range(len(items)):
        i = items[k]
        cx, cy, cz = np.float64(sphere[i, 0]), np.float64(sphere[i, 1]), np.float64(sphere[i, 2])
        r2 = np.float64(sphere[i, 3]) * sphere[i, 3]
        for y in range(max(box[i, 2] - row0, 0), min(box[i, 3] - row0 + 1, rows)):
            for x in range(box[i, 0], box[i, 1] + 1):
                for s in range(SUBSAMPLES):
                    vx = (x + 0.5 + _X[s] - 0.5 * view.width) * inv
                    vy = (0.5 * view.height - (row0 + y + 0.5 + _Y[s])) * inv
                    inv_d2 = 1.0 / (vx * vx + vy * vy + 1.0)
                    t0 = (cx * vx + cy * vy + cz) * inv_d2
                    qx, qy, qz = cx - t0 * vx, cy - t0 * vy, cz - t0
                    room = r2 - (qx * qx + qy * qy + qz * qz)
                    if room <= 0.0:
                        continue
                    t = t0 - sqrt(room * inv_d2)
                    if planes is not None and sunk(view, planes, vx * t, vy * t, t):
                        continue
                    w = 1.0 / t
                    if w > inverse[y, x, s]:
                        inverse[y, x, s] = w
                        ids[y, x, s] = i


@kernel
def nearest_depth(samples: Samples, depth: Float32s) -> None:
    """View depth of the nearest thing in each sample, infinity where there is none; shape [rows, width]."""
    for y in range(depth.shape[0]):
        for x in range(depth.shape[1]):
            best = np.float32(0.0)
            for s in range(SUBSAMPLES):
                best = max(best, samples.inverse[y, x, s])
            depth[y, x] = 1.0 / best if best > 0.0 else np.inf


@kernel
def depth_of_triangles(
    disc: Float32s, corner: Ints, box: Ints, items: Array, row0: int, depth: Float32s
) -> None:
    """Lower `depth` in the band of a parallel projection to the triangles: `disc` holds column, row, depth."""
    stop = min(row0 + BAND, len(depth))
    for k in range(len(items)):
        t = items[k]
        a, b, c = corner[t, 0], corner[t, 1], corner[t, 2]
        p = (np.float64(disc[a, 0]), np.float64(disc[a, 1]), np.float64(disc[a, 2]))
        q = (np.float64(disc[b, 0]), np.float64(disc[b, 1]), np.float64(disc[b, 2]))
        r = (np.float64(disc[c, 0]), np.float64(disc[c, 1]), np.float64(disc[c, 2]))
        area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        if area == 0.0:
            continue
        sign = 1.0 if area > 0.0 else -1.0
        e0, e1, e2 = _edge(q, r, sign), _edge(r, p, sign), _edge(p, q, sign)
        inv = sign / area
        for y in range(max(box[t, 2], row0), min(box[t, 3] + 1, stop)):
            for x in range(box[t, 0], box[t, 1] + 1):
                d0 = e0[0] * (x + 0.5) + e0[1] * (y + 0.5) + e0[2]
                d1 = e1[0] * (x + 0.5) + e1[1] * (y + 0.5) + e1[2]
                d2 = e2[0] * (x + 0.5) + e2[1] * (y + 0.5) + e2[2]
                if d0 < 0.0 or d1 < 0.0 or d2 < 0.0:
                    continue
                z = (d0 * p[2] + d1 * q[2] + d2 * r[2]) * inv
                if z < depth[y, x]:
                    depth[y, x] = z


@kernel
def depth_of_tubes(
    disc: Float32s, end: Ints, wide: Float32s, box: Ints, items: Array, row0: int, depth: Float32s
) -> None:
    """The same for tubes, `wide[t]` texels in radius."""
    stop = min(row0 + BAND, len(depth))
    for k in range(len(items)):
        t = items[k]
        a, b = end[t, 0], end[t, 1]
        u, v, z = np.float64(disc[a, 0]), np.float64(disc[a, 1]), np.float64(disc[a, 2])
        du, dv, dz = disc[b, 0] - u, disc[b, 1] - v, disc[b, 2] - z
        inv = 1.0 / max(du * du + dv * dv, 1e-12)
        for y in range(max(box[t, 2], row0), min(box[t, 3] + 1, stop)):
            for x in range(box[t, 0], box[t, 1] + 1):
                px, py = x + 0.5 - u, y + 0.5 - v
                along = min(max((px * du + py * dv) * inv, 0.0), 1.0)
                ex, ey = px - along * du, py - along * dv
                if ex * ex + ey * ey < wide[t] * wide[t] and z + along * dz < depth[y, x]:
                    depth[y, x] = z + along * dz
