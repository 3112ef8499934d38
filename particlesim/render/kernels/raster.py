"""The sphere visible in each sample, and depth maps for shadows."""

from __future__ import annotations

from math import sqrt

import numpy as np

from particlesim.compiler import kernel
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import BLOCK, Array, Float32s, Ints, Layers, View


@kernel
def clear_layers(layers: Layers) -> None:
    """Begin a band in which nothing is seen."""
    layers.near[:] = np.inf
    layers.near_id[:] = -1
    layers.far[:] = np.inf
    layers.far_id[:] = -1


@kernel
def raster_spheres(sphere: Float32s, box: Ints, items: Array, row0: int, view: View, layers: Layers) -> None:
    """Keep the two nearest spheres of every sample of the band that starts at `row0`.

    Ray (vx, vy, 1) t and sphere (c, r): the ray passes the centre at t₀ = c·d / d², at the distance |q|,
    q = c − t₀ d, and meets the sphere at t₀ − √((r² − q²) / d²). Computing q first keeps far, small spheres
    exact. A sample within half a sample outside the outline counts, at the depth of the outline: shading
    weighs it.
    """
    near, near_id, far, far_id = layers.near, layers.near_id, layers.far, layers.far_id
    rows = min(BAND, view.height - row0)
    inv = 1.0 / view.focal
    for k in range(len(items)):
        i = items[k]
        cx, cy, cz, r = sphere[i, 0], sphere[i, 1], sphere[i, 2], sphere[i, 3]
        reach = r + 0.5 * inv * cz
        reach2, r2 = reach * reach, r * r
        for y in range(max(box[i, 2] - row0, 0), min(box[i, 3] - row0 + 1, rows)):
            vy = (0.5 * view.height - (row0 + y + 0.5)) * inv
            cd, dd = cy * vy + cz, vy * vy + 1.0
            for x in range(box[i, 0], box[i, 1] + 1):
                vx = (x + 0.5 - 0.5 * view.width) * inv
                inv_d2 = 1.0 / (vx * vx + dd)
                t0 = (cx * vx + cd) * inv_d2
                qx, qy, qz = cx - t0 * vx, cy - t0 * vy, cz - t0
                q2 = qx * qx + qy * qy + qz * qz
                if q2 >= reach2:
                    continue
                t = t0 - sqrt(max(r2 - q2, 0.0) * inv_d2)
                if t < near[y, x]:
                    far[y, x], far_id[y, x] = near[y, x], near_id[y, x]
                    near[y, x], near_id[y, x] = t, i
                elif t < far[y, x]:
                    far[y, x], far_id[y, x] = t, i


@kernel
def raster_depth(discs: Float32s, row0: int, scale: float, depth: Float32s) -> None:
    """Depth [scene units] of the nearest sphere in the band of a parallel projection with `scale` texels per
    unit."""
    size = len(depth)
    stop = min(row0 + BAND, size)
    depth[row0:stop] = np.inf
    inv = 1.0 / scale
    for k in range(len(discs)):
        u, v, z, r = discs[k, 0], discs[k, 1], discs[k, 2], discs[k, 3]
        r2 = r * r
        for y in range(max(int(v - r), row0), min(int(v + r) + 1, stop)):
            dy = y + 0.5 - v
            room = r2 - dy * dy
            for x in range(max(int(u - r), 0), min(int(u + r) + 1, size)):
                dx = x + 0.5 - u
                h2 = room - dx * dx
                if h2 > 0.0:
                    d = z - sqrt(h2) * inv
                    if d < depth[y, x]:
                        depth[y, x] = d


def least_around(depth: Float32s) -> Float32s:
    """The least depth among the texels that points in each block of a map are tested against: those of the block, one
    before it and two behind."""
    blocks = -(-len(depth) // BLOCK)
    across, least = np.empty((len(depth), blocks), np.float32), np.empty((blocks, blocks), np.float32)
    least_of_blocks(depth, across, least)
    return least


@kernel
def least_of_blocks(depth: Float32s, across: Float32s, least: Float32s) -> None:
    """Write `least`; `across` [rows, blocks] is scratch."""
    size, blocks = len(depth), len(least)
    for y in range(size):
        for b in range(blocks):
            low = depth[y, b * BLOCK]
            for x in range(max(b * BLOCK - 1, 0), min((b + 1) * BLOCK + 2, size)):
                low = min(low, depth[y, x])
            across[y, b] = low
    for b in range(blocks):
        least[b, :] = across[b * BLOCK, :]
        for y in range(max(b * BLOCK - 1, 0), min((b + 1) * BLOCK + 2, size)):
            for k in range(blocks):
                least[b, k] = min(least[b, k], across[y, k])


def sky_moments(depth: Float32s, base: float, k: int, mean: Float32s, square: Float32s) -> None:
    """Heights above `base` (0 where nothing stands) and their squares, both blurred twice by a box of 2 k +
    1 texels."""
    size = len(depth)
    heights(depth, base, mean, square)
    copy, total = np.empty_like(mean), np.empty(size)
    for image in (mean, square):
        for _ in range(2):
            blur(image, k, copy, total)


@kernel
def heights(depth: Float32s, base: float, mean: Float32s, square: Float32s) -> None:
    """Heights above `base`, and their squares."""
    size = len(depth)
    for y in range(size):
        for x in range(size):
            h = max(-depth[y, x] - base, 0.0)
            mean[y, x] = h
            square[y, x] = h * h


@kernel
def blur(image: Float32s, k: int, copy: Float32s, total: Array) -> None:
    """Mean over 2 k + 1 texels along rows, then along columns; `copy` (like the image) and `total` (a row) are scratch."""
    size = len(image)
    for y in range(size):
        line = copy[y]
        line[:] = image[y]
        along = line[0] * np.float64(k)
        for x in range(k):
            along += line[min(x, size - 1)]
        for x in range(size):
            along += line[min(x + k, size - 1)]
            image[y, x] = along / (2 * k + 1)
            along -= line[max(x - k, 0)]
    copy[:] = image
    for x in range(size):
        total[x] = copy[0, x] * np.float64(k)
    for y in range(k):
        for x in range(size):
            total[x] += copy[min(y, size - 1), x]
    for y in range(size):
        add, drop = min(y + k, size - 1), max(y - k, 0)
        for x in range(size):
            total[x] += copy[add, x]
            image[y, x] = total[x] / (2 * k + 1)
            total[x] -= copy[drop, x]
