"""The background: a vertical gradient, and planes with their grid, shadows and the darkening below objects.

It is computed for whole rows, a tile of samples at a time and one operation after another, by loops without branches, which
become vector instructions. That takes a quarter of the time of a loop that does everything sample by sample.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from particlesim.compiler import kernel, on_stack
from particlesim.model.vectors import dot
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import (
    Array,
    Backdrop,
    Float32s,
    Light,
    Planes,
    ShadowMap,
    SkyMap,
    Triple,
    View,
)
from particlesim.render.kernels.shade import (
    TILE,
    light_at,
    mix,
    row_of,
    shaded,
    sky_at,
    to_world,
)

FAINT = 0.004
"""A plane of less than this opacity is not drawn."""
STEEP = -1e-7
"""Rays meet a plane whose normal they run against by more than this."""
EDGE = 1e-3
"""Texels by which positions stay within a map."""


def clipped(x: float, low: float, high: float) -> float:
    """x, brought into [low, high]."""
    return min(max(x, low), high)


class Tile(NamedTuple):
    """What is known of some samples of a row, shape [TILE] each: colour, ray from the camera, how far along it a plane is
    and which one (−1: none); and of the plane in work: its point there, its opacity, the shares of the light from around and
    of the key light that reach it, and column, row and depth of the point on a map."""

    r: Array
    g: Array
    b: Array
    dx: Array
    dy: Array
    dz: Array
    way: Array
    which: Array
    px: Array
    py: Array
    pz: Array
    cover: Array
    ambient: Array
    lit: Array
    u: Array
    v: Array
    deep: Array


@kernel
def paint_background(
    row0: int,
    view: View,
    planes: Planes,
    light: Light,
    backdrop: Backdrop,
    shadow: ShadowMap,
    sky: SkyMap,
    image: Float32s,
) -> None:
    """Write all samples of the band that starts at `row0` to `image` [rows, width, 3], in linear light."""
    room = on_stack(17, TILE, np.float64)
    tile = Tile(
        room[0], room[1], room[2], room[3], room[4], room[5], room[6],
        room[7], room[8], room[9], room[10], room[11], room[12], room[13],
        room[14], room[15], room[16],
    )  # fmt: skip
    inv = 1.0 / view.focal
    for y in range(min(BAND, view.height - row0)):
        vy = (0.5 * view.height - (row0 + y + 0.5)) * inv
        for start in range(0, view.width, TILE):
            n = min(TILE, view.width - start)
            _gradient(backdrop, view, start, row0 + y, tile, n)
            for x in range(n):
                vx = (start + x + 0.5 - 0.5 * view.width) * inv
                tile.dx[x], tile.dy[x], tile.dz[x] = to_world(view, vx, vy, 1.0)
                tile.way[x], tile.which[x] = np.inf, -1.0
            for k in range(len(planes.point)):
                if planes.facing[k]:
                    _meet(planes, view.eye, k, tile, n)
            for k in range(len(planes.point)):
                if planes.facing[k] and _reach(view.eye, k, tile, n):
                    _paint_plane(view, planes, light, backdrop, shadow, sky, k, tile, n)
            for x in range(n):
                image[y, start + x, 0], image[y, start + x, 1] = tile.r[x], tile.g[x]
                image[y, start + x, 2] = tile.b[x]


def _gradient(backdrop: Backdrop, view: View, start: int, y: int, tile: Tile, n: int) -> None:
    """A vertical gradient that darkens a little towards the corners."""
    sy = (y + 0.5) / view.height
    s = sy * sy * (3.0 - 2.0 * sy)
    t, b, inv = backdrop.top, backdrop.bottom, 1.0 / view.width
    for x in range(n):
        sx = (start + x + 0.5) * inv - 0.5
        dim = 1.0 - 0.35 * (sx * sx + (sy - 0.5) * (sy - 0.5))
        tile.r[x] = (t[0] + (b[0] - t[0]) * s) * dim
        tile.g[x] = (t[1] + (b[1] - t[1]) * s) * dim
        tile.b[x] = (t[2] + (b[2] - t[2]) * s) * dim


def _meet(planes: Planes, eye: Triple, k: int, tile: Tile, n: int) -> None:
    """Where rays from the camera meet plane k, if they meet none of the others before."""
    normal, p = row_of(planes.normal, k), row_of(planes.point, k)
    away = dot(normal, (p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]))
    for x in range(n):
        slope = dot(normal, (tile.dx[x], tile.dy[x], tile.dz[x]))
        t, before = away / slope, tile.way[x]
        first = slope <= STEEP and t < before
        tile.way[x] = t if first else before
        tile.which[x] = k if first else tile.which[x]


def _reach(eye: Triple, k: int, tile: Tile, n: int) -> bool:
    """The points in which plane k is met, and its opacity there, which ends far away; whether any is to be seen."""
    seen = 0
    for x in range(n):
        met = tile.which[x] == k
        t = tile.way[x] if met else 0.0
        px, py, pz = eye[0] + t * tile.dx[x], eye[1] + t * tile.dy[x], eye[2] + t * tile.dz[x]
        beyond = max(sqrt(px * px + py * py + pz * pz) - 1.2, 0.0)
        fade = exp(-beyond * beyond * 0.16)
        there = met and fade >= FAINT
        tile.px[x], tile.py[x], tile.pz[x] = px, py, pz
        tile.cover[x], tile.ambient[x], tile.lit[x] = (fade if there else 0.0), 1.0, 1.0
        seen += 1 if there else 0
    return seen > 0


def _paint_plane(
    view: View,
    planes: Planes,
    light: Light,
    backdrop: Backdrop,
    shadow: ShadowMap,
    sky: SkyMap,
    k: int,
    tile: Tile,
    n: int,
) -> None:
    """Blend plane k over the samples."""
    normal = row_of(planes.normal, k)
    for j in range(len(planes.point)):
        if j != k:
            _meet_other(view, planes, k, j, tile, n)
    lambert = max(dot(normal, light.direction), 0.0)
    if lambert > 0.0 and len(shadow.depth) > 3:
        _cast_shadows(shadow, normal, tile, n)
    if len(sky.mean) > 1:
        _darken(sky, tile, n)
    up = 0.5 + 0.5 * dot(normal, light.up)
    ground, grid = backdrop.ground, backdrop.line
    for x in range(n):
        line = _grid(view, planes, k, tile, x)
        albedo = mix(ground[0], ground[1], ground[2], grid, line)
        over = shaded(light, albedo, lambert * tile.lit[x], tile.ambient[x], up, 0.0)
        cover, r, g, b = tile.cover[x], tile.r[x], tile.g[x], tile.b[x]
        drawn = cover > 0.0
        tile.r[x] = r + cover * (over[0] - r) if drawn else r
        tile.g[x] = g + cover * (over[1] - g) if drawn else g
        tile.b[x] = b + cover * (over[2] - b) if drawn else b


def _footprint(view: View, normal: Triple, tile: Tile, x: int) -> tuple[Triple, Triple]:
    """How the point on a plane moves by one sample right and down.

    The point p = e + t d stays on the plane when the ray turns: dp = t (dd − d (n·dd) / (n·d)).
    """
    d, a, s = (tile.dx[x], tile.dy[x], tile.dz[x]), view.axes, tile.way[x] / view.focal
    inv = 1.0 / dot(normal, d)
    na, nd = dot(normal, a[0]) * inv, dot(normal, a[1]) * inv
    along = (s * (a[0][0] - d[0] * na), s * (a[0][1] - d[1] * na), s * (a[0][2] - d[2] * na))
    down = (s * (a[1][0] - d[0] * nd), s * (a[1][1] - d[1] * nd), s * (a[1][2] - d[2] * nd))
    return along, down


def _meet_other(view: View, planes: Planes, k: int, j: int, tile: Tile, n: int) -> None:
    """What plane j does to plane k: one that is not drawn cuts it off, another darkens it nearby."""
    normal, other, q = row_of(planes.normal, k), row_of(planes.normal, j), row_of(planes.point, j)
    if planes.facing[j]:
        for x in range(n):
            away = dot(other, (tile.px[x] - q[0], tile.py[x] - q[1], tile.pz[x] - q[2]))
            tile.ambient[x] *= 1.0 - 0.4 * exp(-9.0 * max(away, 0.0))
        return
    for x in range(n):
        away = dot(other, (tile.px[x] - q[0], tile.py[x] - q[1], tile.pz[x] - q[2]))
        along, down = _footprint(view, normal, tile, x)
        step = abs(dot(other, along)) + abs(dot(other, down))
        tile.cover[x] *= clipped(away / max(step, 1e-7) + 0.5, 0.0, 1.0)


def _cast_shadows(shadow: ShadowMap, normal: Triple, tile: Tile, n: int) -> None:
    """The share of the key light that reaches the points."""
    a, size = shadow.axes, len(shadow.depth)
    column, row, deep = tile.u, tile.v, tile.deep
    middle, last = 0.5 * size - 0.5, size - 3.0 - EDGE
    for x in range(n):
        p = (
            tile.px[x] + 2e-3 * normal[0],
            tile.py[x] + 2e-3 * normal[1],
            tile.pz[x] + 2e-3 * normal[2],
        )
        u, v = middle + shadow.scale * dot(a[0], p), middle - shadow.scale * dot(a[1], p)
        cu, cv = clipped(u, 1.0, last), clipped(v, 1.0, last)
        column[x], row[x], deep[x] = cu, cv, dot(a[2], p)
        deep[x] = deep[x] if u == cu and v == cv else -np.inf
    for x in range(n):
        tile.lit[x] = light_at(shadow, column[x], row[x], deep[x])


def _darken(sky: SkyMap, tile: Tile, n: int) -> None:
    """Multiply the light from around by the share of the sky that the points see."""
    a, size = sky.axes, len(sky.mean)
    column, row, height = tile.u, tile.v, tile.deep
    middle, last = 0.5 * size - 0.5, size - 1.0 - EDGE
    for x in range(n):
        p = (tile.px[x], tile.py[x], tile.pz[x])
        u, v = middle + sky.scale * dot(a[0], p), middle - sky.scale * dot(a[1], p)
        cu, cv = clipped(u, 0.0, last), clipped(v, 0.0, last)
        column[x], row[x] = cu, cv
        height[x] = -dot(a[2], p) - sky.base if u == cu and v == cv else np.inf
    for x in range(n):
        tile.ambient[x] *= sky_at(sky, column[x], row[x], height[x])


def _lines(x: float, footprint: float, width: float) -> float:
    """Coverage of lines of `width` at the integers, averaged over `footprint`: the integral's difference
    quotient."""
    w = max(footprint, 1e-4)
    a, b = x + 0.5 * width + 0.5 * w, x + 0.5 * width - 0.5 * w
    fa, fb = np.floor(a), np.floor(b)
    return (fa * width + min(a - fa, width) - fb * width - min(b - fb, width)) / w


def _grid(view: View, planes: Planes, k: int, tile: Tile, x: int) -> float:
    """Opacity of the grid of plane k at its point in sample x."""
    along, down = _footprint(view, row_of(planes.normal, k), tile, x)
    u, v, inv = row_of(planes.u, k), row_of(planes.v, k), 1.0 / planes.spacing
    p = (tile.px[x], tile.py[x], tile.pz[x])
    gu, gv = dot(p, u) * inv, dot(p, v) * inv
    fu, fv = (abs(dot(along, u)) + abs(dot(down, u))) * inv, (abs(dot(along, v)) + abs(dot(down, v))) * inv
    fine = max(_lines(gu, fu, 0.016), _lines(gv, fv, 0.016))
    bold = max(_lines(0.2 * gu, 0.2 * fu, 0.0042), _lines(0.2 * gv, 0.2 * fv, 0.0042))
    return min(0.42 * fine + 0.5 * bold, 1.0)
