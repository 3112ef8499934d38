"""The colour of samples, in linear light: light on spheres and planes, trails, dots."""

from __future__ import annotations

from math import floor, sqrt

import numpy as np

from particlesim.compiler import kernel, on_stack
from particlesim.model.vectors import dot
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import (
    BLOCK,
    Array,
    Float32s,
    Layers,
    Light,
    Paths,
    ShadowMap,
    SkyMap,
    Triple,
    View,
)

RGB = Triple

TILE = 128
"""Samples of a row that are in work together: their numbers stay in the first-level cache."""


def row_of(array: Float32s, k: int) -> Triple:
    """A row of three as scalars: a slice would count references, in an atomic that the threads share."""
    return array[k, 0], array[k, 1], array[k, 2]


def ball_of(sphere: Float32s, i: int) -> tuple[float, float, float, float]:
    """Centre in camera axes and radius of sphere i."""
    return sphere[i, 0], sphere[i, 1], sphere[i, 2], sphere[i, 3]


def to_world(view: View, x: float, y: float, z: float) -> Triple:
    """A vector in camera axes as one of the scene."""
    a = view.axes
    return (
        a[0][0] * x + a[1][0] * y + a[2][0] * z,
        a[0][1] * x + a[1][1] * y + a[2][1] * z,
        a[0][2] * x + a[1][2] * y + a[2][2] * z,
    )


def _on_map(map_: ShadowMap | SkyMap, size: int, x: float, y: float, z: float) -> Triple:
    """Column and row of a point on a map of `size` texels, and its depth."""
    a, p = map_.axes, (x, y, z)
    return (
        0.5 * size + map_.scale * dot(a[0], p) - 0.5,
        0.5 * size - map_.scale * dot(a[1], p) - 0.5,
        dot(a[2], p),
    )


def light_share(shadow: ShadowMap, x: float, y: float, z: float) -> float:
    """Share of the key light that reaches a point."""
    size = len(shadow.depth)
    u, v, deep = _on_map(shadow, size, x, y, z)
    if not (1.0 <= u < size - 3 and 1.0 <= v < size - 3):
        return 1.0
    return light_at(shadow, u, v, deep)


def light_at(shadow: ShadowMap, u: float, v: float, deep: float) -> float:
    """Share of the key light in a column and row of its map: 4 × 4 depth tests weighed by a bilinear filter of width 3.

    Most points have nothing over them far and wide, which a single test tells.
    """
    depth = shadow.depth
    i, j, d = int(u), int(v), np.float32(deep)
    if shadow.least[j // BLOCK, i // BLOCK] >= d:
        return 1.0
    fu, fv = u - i, v - j
    total = 0.0
    for q in range(4):
        row = j - 1 + q
        left, right = depth[row, i - 1] >= d, depth[row, i + 2] >= d
        n = 1.0 * (depth[row, i] >= d) + (depth[row, i + 1] >= d) + (1.0 - fu) * left + fu * right
        weight = 1.0 - fv if q == 0 else (fv if q == 3 else 1.0)
        total += weight * n
    return total * (1.0 / 9.0)


def open_sky(sky: SkyMap, x: float, y: float, z: float) -> float:
    """Share of the sky that a point sees."""
    size = len(sky.mean)
    if size < 2:
        return 1.0
    u, v, deep = _on_map(sky, size, x, y, z)
    if not (0.0 <= u < size - 1 and 0.0 <= v < size - 1):
        return 1.0
    return sky_at(sky, u, v, -deep - sky.base)


def sky_at(sky: SkyMap, u: float, v: float, h: float) -> float:
    """Share of the sky that a point at height h sees in a column and row of its map.

    With mean μ > h and mean square s of the heights around, a share f = (μ − h)² / (s − 2 h μ + h²) stands above it
    (Chebyshev; exact for two heights) at a mean distance H = (s − 2 h μ + h²) / (μ − h). What stands far above darkens
    little.
    """
    i, j = int(u), int(v)
    fu, fv = u - i, v - j
    w00, w01, w10, w11 = (1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv
    m, s = sky.mean, sky.square
    mu = w00 * m[j, i] + w01 * m[j, i + 1] + w10 * m[j + 1, i] + w11 * m[j + 1, i + 1]
    rise = mu - h
    if rise <= 5e-4:
        return 1.0
    sq = w00 * s[j, i] + w01 * s[j, i + 1] + w10 * s[j + 1, i] + w11 * s[j + 1, i + 1]
    spread = max(sq - 2.0 * h * mu + h * h, rise * rise)
    away = spread / rise / sky.reach
    sure = min((rise - 5e-4) / (0.03 * sky.reach), 1.0)  # the moments carry rounding errors
    shaded: float = 0.9 * sure * rise * rise / spread / (1.0 + 0.25 * away * away)
    return 1.0 - shaded


def shaded(light: Light, albedo: Triple, key: float, ambient: float, up: float, shine: float) -> RGB:
    """Colour of a surface under shares of the key light, of the light from around (`up`: 1 from the sky, 0 from the ground)
    and of its own shine."""
    k, s, b = light.key, light.sky, light.bounce
    return (
        albedo[0] * (k[0] * key + ambient * (b[0] + up * (s[0] - b[0]))) + shine * k[0],
        albedo[1] * (k[1] * key + ambient * (b[1] + up * (s[1] - b[1]))) + shine * k[1],
        albedo[2] * (k[2] * key + ambient * (b[2] + up * (s[2] - b[2]))) + shine * k[2],
    )


def shade_sphere(
    view: View,
    light: Light,
    shadow: ShadowMap,
    sky: SkyMap,
    c: tuple[float, float, float, float],
    albedo: Triple,
    vx: float,
    vy: float,
) -> tuple[float, float, float, float]:
    """Colour of a sphere in the sample (vx, vy) of the picture plane at distance 1, and how much of it is
    covered."""
    inv_d2 = 1.0 / (vx * vx + vy * vy + 1.0)
    inv_d = sqrt(inv_d2)
    t0 = (c[0] * vx + c[1] * vy + c[2]) * inv_d2
    qx, qy, qz = c[0] - t0 * vx, c[1] - t0 * vy, c[2] - t0
    q2 = qx * qx + qy * qy + qz * qz
    r = np.float64(c[3])
    cover = min(max((r - sqrt(q2)) * view.focal / c[2] + 0.5, 0.0), 1.0)
    h = sqrt(max(r * r - q2, 0.0)) * inv_d
    # From the centre to the hit, in camera axes: −q − h d; outside the outline the rim's normal is taken.
    nx, ny, nz = -qx - h * vx, -qy - h * vy, -qz - h
    s = 1.0 / sqrt(max(nx * nx + ny * ny + nz * nz, 1e-30))
    nx, ny, nz = nx * s, ny * s, nz * s
    facing = -(nx * vx + ny * vy + nz) * inv_d
    a, e, direction = view.axes, view.eye, light.direction
    wx, wy, wz = to_world(view, nx, ny, nz)
    px = e[0] + a[0][0] * c[0] + a[1][0] * c[1] + a[2][0] * c[2] + r * wx
    py = e[1] + a[0][1] * c[0] + a[1][1] * c[1] + a[2][1] * c[2] + r * wy
    pz = e[2] + a[0][2] * c[0] + a[1][2] * c[1] + a[2][2] * c[2] + r * wz
    lambert = wx * direction[0] + wy * direction[1] + wz * direction[2]
    shine = 0.0
    if lambert > 0.0:
        # Tested a little outside the sphere and towards the light, so that it does not shade itself.
        off, to = 0.3 * r, 2.0 / shadow.scale
        lit = light_share(
            shadow,
            px + off * wx + to * direction[0],
            py + off * wy + to * direction[1],
            pz + off * wz + to * direction[2],
        )
        dx, dy, dz = to_world(view, vx, vy, 1.0)
        hx, hy, hz = direction[0] - dx * inv_d, direction[1] - dy * inv_d, direction[2] - dz * inv_d
        gloss = (wx * hx + wy * hy + wz * hz) / sqrt(max(hx * hx + hy * hy + hz * hz, 1e-12))
        gloss = max(gloss, 0.0) ** 2
        gloss = gloss * gloss * gloss * gloss
        gloss = gloss * gloss * gloss
        lambert *= lit
        shine = 0.22 * gloss * lit
    else:
        lambert = 0.0
    rim = 1.0 - min(max(facing, 0.0), 1.0)
    rim = rim * rim * rim
    up = 0.5 + 0.5 * (wx * light.up[0] + wy * light.up[1] + wz * light.up[2])
    ambient = open_sky(sky, px, py, pz)
    shine += 0.16 * rim * up * ambient
    red, green, blue = shaded(light, albedo, lambert, ambient, up, shine)
    return red, green, blue, cover


@kernel
def shade_band(
    row0: int,
    view: View,
    light: Light,
    shadow: ShadowMap,
    sky: SkyMap,
    sphere: Float32s,
    color: Array,
    palette: Float32s,
    layers: Layers,
    paths: Paths,
    image: Float32s,
) -> None:
    """Blend trails, second and first sphere over the background in the band's samples, `image` [rows, width, 3], in linear
    light."""
    inv = 1.0 / view.focal
    near_depth, near_id, far_id = layers.near, layers.near_id, layers.far_id
    trail_alpha, trail_depth, trail_color = paths.alpha, paths.depth, paths.color
    trails = len(trail_alpha) > 0
    for y in range(min(BAND, view.height - row0)):
        vy = (0.5 * view.height - (row0 + y + 0.5)) * inv
        for x in range(view.width):
            vx = (x + 0.5 - 0.5 * view.width) * inv
            near, far = near_id[y, x], far_id[y, x]
            trail = float(trail_alpha[y, x]) if trails else 0.0
            if near < 0 and trail <= 0.0:
                continue
            cr, cg, cb, cover = 0.0, 0.0, 0.0, 0.0
            if near >= 0:
                cr, cg, cb, cover = shade_sphere(
                    view, light, shadow, sky, ball_of(sphere, near), row_of(palette, color[near]), vx, vy
                )
            over = trail > 0.0 and trail_depth[y, x] < near_depth[y, x]
            r, g, b = 0.0, 0.0, 0.0
            if cover < 1.0:
                r, g, b = image[y, x, 0], image[y, x, 1], image[y, x, 2]
                if trail > 0.0 and not over:
                    r, g, b = mix(r, g, b, row_of(palette, trail_color[y, x]), trail)
                if far >= 0:
                    fr, fg, fb, fc = shade_sphere(
                        view, light, shadow, sky, ball_of(sphere, far), row_of(palette, color[far]), vx, vy
                    )
                    # Behind an outline more spheres than these two may lie: the second counts in full sooner.
                    fc = min(1.5 * fc, 1.0)
                    r, g, b = r + fc * (fr - r), g + fc * (fg - g), b + fc * (fb - b)
            r, g, b = r + cover * (cr - r), g + cover * (cg - g), b + cover * (cb - b)
            if over:
                r, g, b = mix(r, g, b, row_of(palette, trail_color[y, x]), trail)
            image[y, x, 0], image[y, x, 1], image[y, x, 2] = r, g, b


def mix(r: float, g: float, b: float, over: Triple, share: float) -> RGB:
    """A colour with a share of another one over it."""
    return r + share * (over[0] - r), g + share * (over[1] - g), b + share * (over[2] - b)


@kernel
def draw_dots(
    row0: int,
    view: View,
    haze: tuple[float, float, float, float, float],
    spheres: Float32s,
    items: Array,
    color: Array,
    palette: Float32s,
    solid: Float32s,
    image: Float32s,
) -> None:
    """Blend round dots over `image`: `spheres` are those of `items`, far to near.

    `solid` [rows, width] is the view depth behind which nothing is seen; without rows everything is.

    `haze` is r, g, b and the depth range over which dots sink into it by at most a third.
    """
    rows, width = min(BAND, view.height - row0), view.width
    hides = len(solid) > 0
    for k in range(len(items)):
        z = np.float64(spheres[k, 2])
        f = view.focal / z
        cx, cy = 0.5 * width + spheres[k, 0] * f, 0.5 * view.height - spheres[k, 1] * f - row0
        rad = spheres[k, 3] * f
        fog = 0.35 * min(max((z - haze[3]) * haze[4], 0.0), 1.0)
        c = row_of(palette, color[items[k]])
        r, g, b = mix(c[0], c[1], c[2], (haze[0], haze[1], haze[2]), fog)
        reach, falloff = rad + 0.5, 0.28 / (rad * rad)
        for y in range(max(int(cy - reach), 0), min(int(cy + reach) + 1, rows)):
            dy = y + 0.5 - cy
            for x in range(max(int(cx - reach), 0), min(int(cx + reach) + 1, width)):
                dx = x + 0.5 - cx
                d2 = dx * dx + dy * dy
                if d2 < reach * reach and not (hides and solid[y, x] < z):
                    cover = min(reach - sqrt(d2), 1.0)
                    tone = cover * (1.08 - d2 * falloff)
                    image[y, x, 0] += r * tone - cover * image[y, x, 0]
                    image[y, x, 1] += g * tone - cover * image[y, x, 1]
                    image[y, x, 2] += b * tone - cover * image[y, x, 2]


@kernel
def draw_paths(segments: Float32s, color: Array, row0: int, rows: int, paths: Paths) -> None:
    """Trails: `segments` rows are x0, y0, z0, alpha0, x1, y1, z1, alpha1, half width, all in samples but z.

    The strongest segment of a sample wins, so overlapping joints leave no beads.
    """
    best = paths.alpha
    best[:] = 0.0
    width = best.shape[1]
    for s in range(len(segments)):
        x0, y0, z0, a0 = segments[s, 0], segments[s, 1], segments[s, 2], segments[s, 3]
        x1, y1, z1, a1 = segments[s, 4], segments[s, 5], segments[s, 6], segments[s, 7]
        w = segments[s, 8]
        dx, dy = x1 - x0, y1 - y0
        inv = 1.0 / max(dx * dx + dy * dy, 1e-12)
        top, bottom = floor(min(y0, y1) - w - 1), floor(max(y0, y1) + w + 1)
        for y in range(max(top - row0, 0), min(bottom - row0 + 1, rows)):
            py = row0 + y + 0.5 - y0
            left, right = min(x0, x1) - w - 1, max(x0, x1) + w + 1
            for x in range(max(int(left), 0), min(int(right) + 1, width)):
                px = x + 0.5 - x0
                t = min(max((px * dx + py * dy) * inv, 0.0), 1.0)
                ex, ey = px - t * dx, py - t * dy
                cover = w + 0.5 - sqrt(ex * ex + ey * ey)
                if cover <= 0.0:
                    continue
                alpha = min(cover, 1.0) * (a0 + t * (a1 - a0))
                if alpha > best[y, x]:
                    best[y, x] = alpha
                    paths.color[y, x] = color[s]
                    paths.depth[y, x] = z0 + t * (z1 - z0)


@kernel
def develop(image: Float32s, rows: int, samples: int, exposure: float, curve: Float32s, out: Array) -> None:
    """Average samples², tone-map and encode as sRGB by `curve` (indexed by √(light / 4)), dither, write 8
    bits.

    The dither, a fixed pattern of half a step (interleaved gradient noise), keeps dark gradients free of
    bands.
    """
    top, width = len(curve) - 1, out.shape[1]
    share = 0.25 * exposure / (samples * samples)
    room = on_stack(2, TILE, np.float64)
    value, noise = room[0], room[1]
    # One thing after another for some samples of a row: loops without branches, which become vector instructions.
    for y in range(rows):
        for start in range(0, width, TILE):
            n = min(TILE, width - start)
            for x in range(n):
                place = 0.06711056 * (start + x) + 0.00583715 * y
                pattern = 52.9829189 * (place - np.floor(place))
                noise[x] = pattern - np.floor(pattern)
            for c in range(3):
                for x in range(n):
                    value[x] = 0.0
                for q in range(samples):
                    for p in range(samples):
                        for x in range(n):
                            value[x] += image[y * samples + q, (start + x) * samples + p, c]
                for x in range(n):
                    value[x] = sqrt(min(max(value[x] * share, 0.0), 1.0)) * top
                for x in range(n):
                    value[x] = curve[int(value[x])]
                for x in range(n):
                    out[y, start + x, c] = int(min(value[x] + noise[x], 255.0))
