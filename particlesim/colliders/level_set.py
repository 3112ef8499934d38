"""Level sets: solids where a function φ of the place is negative, inside of a box.

φ need not be a distance. Two things are known of it: its value, and bounds of its slope between levels of φ, so that the
surface is at least ∫dφ/L(φ) away (`levels`). Near the surface the distance is that to the foot of a place (`feet`): as far
as `band`, and where the bound is less than a particle's radius, so that it may touch. Where a ball may touch and no foot is
sure to be the nearest, what the surface leaves free is looked for (`cubes`). Farther away the gap is the bound. Of a φ with
kinks every face is looked at (`folds`).

Feet are looked for from outside of the box, too. Where the box cuts the solid off, they are not: there the gap is √(d² + g²)
with the nearest place of the box d away and g the gap there, which is no more than the distance, and has no jumps.

Source: J. C. Hart, Sphere tracing, The Visual Computer 12, 527 (1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.cubes import nearest_in_cubes
from particlesim.colliders.feet import FormulaRecord, foot, level, level_and_slope
from particlesim.colliders.folds import FoldedRecord, Foot, in_box, nearest_foot
from particlesim.colliders.levels import LevelsRecord, from_surface
from particlesim.colliders.sampled import SampledRecord
from particlesim.colliders.solid import PARTS
from particlesim.colliders.way import longest, marched_contact, way_of
from particlesim.compiler import outlined
from particlesim.laws.registry import (
    Particle,
    Vector,
    apart,
    first_contact,
    gap,
    gap_and_normal,
    law,
    least_gap,
    normal,
    sure_gap,
    thinnest,
)
from particlesim.model.arrays import Floats

BAND = 0.25
"""How far from the surface feet are looked for, in parts of the longest side of the box."""

ROOM = 0.98
"""Part of the radius of balls within which a solid that is cut may be to a side of its box that does not cut it."""
DOUBTFUL = 1.5
"""A foot is looked for elsewhere, too, if it is so many times as far as the bound."""
WIDER = 1.25
"""How far from its place a ball looks for what the surface leaves free, in units of its radius."""
HALVINGS = 20
"""Halvings after which a place of the surface is near enough to begin with."""


class LevelRecord(NamedTuple):
    """φ, the low and the high corner of the box [m]; bounds of its slope, of all of it and by levels; whether the sides of
    the box cut the solid; how far from the surface the distance is looked for, and the shortest step of a search [m]; which
    side particles are on: 1 outside, −1 inside."""

    field: FormulaRecord | SampledRecord
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    steep: float
    levels: LevelsRecord
    cut: bool
    band: float
    grain: float
    side: float


class CreasedRecord(NamedTuple):
    """As `LevelRecord`, of a φ with kinks: what lies on it may meet another part of it."""

    field: FoldedRecord
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    steep: float
    levels: LevelsRecord
    cut: bool
    band: float
    grain: float
    side: float


AnyLevel = LevelRecord | CreasedRecord


def _clamped(x: Any, low: Any, high: Any) -> Any:
    """The nearest number between two."""
    return min(max(x, low), high)


def at_least(c: Any, p: Particle) -> Any:
    """A lower bound of the distance of a place from the surface, on the side of the particles [m]; no loops."""
    x, y, z = float(p.x), float(p.y), float(p.z)
    cx, cy, cz = (_clamped(each, c.low[k], c.high[k]) for k, each in enumerate((x, y, z)))
    near = from_surface(c.levels, level(c.field, cx, cy, cz))
    ox, oy, oz = x - cx, y - cy, z - cz
    out2 = ox * ox + oy * oy + oz * oz
    if c.side > 0:
        above = max(near, 0.0)
        return np.sqrt(out2 + above * above) if out2 > 0 else near
    return min(-near, -_to_faces(c, x, y, z))


def _to_faces(c: Any, x: Any, y: Any, z: Any) -> Any:
    """How far a place is outside of the box by its worst coordinate [m]; negative inside."""
    return max(c.low[0] - x, x - c.high[0], c.low[1] - y, y - c.high[1], c.low[2] - z, z - c.high[2])


@outlined
def foot_of(
    c: Any, x: Any, y: Any, z: Any, sx: Any, sy: Any, sz: Any, scale: Any, far: Any, bound: Any
) -> Any:
    """The foot of a place, looked for from s on, which is the place itself or the nearest one in the box, as `foot` tells of
    it, whether it is sure to be the nearest of the faces looked at, and whether these are all. `bound` is the least that its
    distance can be."""
    if isinstance(c.field, FoldedRecord):
        return nearest_foot(foot, c, x, y, z, sx, sy, sz, scale, far, False, 0.0)
    d, nx, ny, nz, found = foot(c.field, x, y, z, sx, sy, sz, scale, far, False)
    if far and not (
        c.cut and d <= DOUBTFUL * bound
    ):  # where its sides do not cut it, there is no surface beyond them
        found = found and in_box(c, x - d * nx, y - d * ny, z - d * nz)
    if found and far and d > 0 and d > DOUBTFUL * bound:
        # It may be one of several. No other is nearer if the solid has no part in the ball about the place that is so large.
        for k in range(27):
            i, j, m = k % 3 - 1.0, k // 3 % 3 - 1.0, k // 9 - 1.0
            size = np.sqrt(i * i + j * j + m * m)
            way = 0.9 * d / size if size > 0 else 0.0
            ux, uy, uz = x + way * i, y + way * j, z + way * m
            if in_box(c, ux, uy, uz) and level(c.field, ux, uy, uz) < 0:
                e, ex, ey, ez, met = _from_inside(c, x, y, z, ux, uy, uz, scale)
                if met and 0 < e < d and in_box(c, x - e * ex, y - e * ey, z - e * ez):
                    d, nx, ny, nz = e, ex, ey, ez
    return d, nx, ny, nz, found, found, True


@outlined
def _from_inside(c: Any, x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any, scale: Any) -> Any:
    """The foot of a place outside, looked for from where the way to a place u inside meets the surface."""
    near, far = 0.0, 1.0
    for _ in range(HALVINGS):
        half = 0.5 * (near + far)
        solid = level(c.field, x + half * (ux - x), y + half * (uy - y), z + half * (uz - z)) < 0
        near, far = near if solid else half, half if solid else far
    return foot(
        c.field, x, y, z, x + near * (ux - x), y + near * (uy - y), z + near * (uz - z), scale, True, False
    )


@outlined
def distance(c: Any, x: Any, y: Any, z: Any, size: Any) -> Any:
    """The signed distance of a place to the solid [m], and the unit normal outwards. `size` is how large the particle is
    that asks: nearer than that the distance is exact where a foot is found."""
    cx, cy, cz = (_clamped(each, c.low[k], c.high[k]) for k, each in enumerate((x, y, z)))
    ox, oy, oz = x - cx, y - cy, z - cz
    out = np.sqrt(ox * ox + oy * oy + oz * oz)
    scale = (c.high[0] - c.low[0]) + (c.high[1] - c.low[1]) + (c.high[2] - c.low[2])
    v, a, b, d = level_and_slope(c.field, cx, cy, cz)
    if out > 0 and v <= 0:
        return out, ox / out, oy / out, oz / out
    steep2 = a * a + b * b + d * d
    k = 1.0 / np.sqrt(steep2) if steep2 > 0 else 0.0
    g, nx, ny, nz = from_surface(c.levels, v), k * a, (k * b if steep2 > 0 else 1.0), k * d
    least = np.sqrt(out * out + g * g)
    far = least <= size
    if abs(g) - size <= c.band:
        exact, mx, my, mz, found, sure, whole = foot_of(c, cx, cy, cz, cx, cy, cz, scale, far, g)
        if not (sure and whole) and c.side * g > 0 and abs(g) < WIDER * size:
            # nothing touches a bound that is no surface
            first = Foot(exact, mx, my, mz, found)
            nearest, mx, my, mz, sure = nearest_in_cubes(c, cx, cy, cz, WIDER * size, first, scale, g < 0)
            exact = nearest if g > 0 else -nearest
            g = g if sure or nearest < abs(g) else exact
        if sure:
            g, nx, ny, nz = exact, mx, my, mz
            if out > 0 and least - size <= c.band and not c.cut:
                # from the foot of the nearest place of the box on
                sx, sy, sz = cx - g * nx, cy - g * ny, cz - g * nz
                exact, mx, my, mz, _, sure, _ = foot_of(c, x, y, z, sx, sy, sz, scale, far, least)
                if sure and in_box(c, x - exact * mx, y - exact * my, z - exact * mz):
                    return exact, mx, my, mz
    if out > 0:
        # the part of the way along the box, which is all of it that brings the nearest place of the box closer
        gap_ = np.sqrt(out * out + g * g)
        mx = ox if abs(ox) > 0 else g * nx
        my = oy if abs(oy) > 0 else g * ny
        mz = oz if abs(oz) > 0 else g * nz
        length = np.sqrt(mx * mx + my * my + mz * mz)
        return gap_, mx / length, my / length, mz / length
    faces = _to_faces(c, x, y, z)
    if v <= 0 and faces > g:
        nx, ny, nz = 0.0, 0.0, 0.0
        if faces == c.low[0] - x:
            nx = -1.0
        elif faces == x - c.high[0]:
            nx = 1.0
        elif faces == c.low[1] - y:
            ny = -1.0
        elif faces == y - c.high[1]:
            ny = 1.0
        elif faces == c.low[2] - z:
            nz = -1.0
        else:
            nz = 1.0
        return faces, nx, ny, nz
    return g, nx, ny, nz


def level_gap(c: AnyLevel, p: Particle) -> float:
    """Distance of a particle's surface from the solid, or from the wall around it [m]."""
    d, _, _, _ = distance(c, float(p.x), float(p.y), float(p.z), float(p.r))
    return type(p.x)(c.side * d) - p.r


def level_gap_and_normal(c: AnyLevel, p: Particle) -> tuple[float, Vector]:
    """Both by one search."""
    d, x, y, z = distance(c, float(p.x), float(p.y), float(p.z), float(p.r))
    like = type(p.x)
    return like(c.side * d) - p.r, (like(c.side * x), like(c.side * y), like(c.side * z))


def level_normal(c: AnyLevel, p: Particle) -> Vector:
    """The way from the surface to the side that particles are on."""
    return level_gap_and_normal(c, p)[1]


def level_least_gap(c: AnyLevel, p: Particle, need: float) -> float:
    """The bound by φ, without a search."""
    return at_least(c, p) - p.r


def level_sure_gap(c: AnyLevel, p: Particle) -> float:
    """The bound for a particle without radius, which inside of the solid is no farther from a side of the box either."""
    near = at_least(c, p)
    return near if c.side < 0 or near > 0 else max(near, _to_faces(c, p.x, p.y, p.z))


@outlined
def level_apart(c: AnyLevel, p: Particle, q: Particle, h: float, slack: float) -> bool:
    """Whether the bounds at both ends keep the way free."""
    return at_least(c, p) + at_least(c, q) - 2 * p.r >= longest(way_of(p, q, h))


def level_first_contact(c: AnyLevel, p: Particle, q: Particle, h: float, slack: float) -> float:
    """The part of a step at which a particle first touches the surface."""
    return marched_contact(c, p, q, h, slack, type(p.x)(c.grain))


for _record in (LevelRecord, CreasedRecord):
    law(gap, _record)(level_gap)
    law(gap_and_normal, _record)(level_gap_and_normal)
    law(normal, _record)(level_normal)
    law(least_gap, _record)(level_least_gap)
    law(sure_gap, _record)(level_sure_gap)
    law(apart, _record)(level_apart)
    law(first_contact, _record)(level_first_contact)


def sides(values: Floats) -> list[Floats]:
    """The numbers over a grid that lie in each of its sides, in the order of `cramped`."""
    return [np.take(values, end, axis=axis) for axis in range(3) for end in (0, -1)]


def is_cut(values: Floats) -> bool:
    """Whether the sides of its box cut off a solid with these values of φ."""
    return any(bool((each <= 0).any()) for each in sides(values))


def where_early(radius: float) -> str:
    """Where balls may touch a level set too early, and what avoids it."""
    return (
        "beyond the sides of its box, as others cut the solid off; "
        f"a box that reaches {radius:.3g} m beyond it avoids that"
    )


def early(values: Floats, axes: Sequence[Floats], radius: float) -> float:
    """How much too early balls may touch a solid with these values of φ over a grid [m]: beyond a side of the box of one
    that is cut by others, where the way out of the box and that to the surface count as if they were at right angles."""
    if not is_cut(values):
        return 0.0
    most, solid = 0.0, values <= 0
    for k, each in enumerate(sides(values)):
        axis, end = divmod(k, 2)
        if (each > 0).all():
            filled = solid.any(axis=tuple(other for other in range(3) if other != axis))
            there = axes[axis][filled]
            room = float(axes[axis][-1] - there.max() if end else there.min() - axes[axis][0])
            if room < ROOM * radius:
                way = max(room, radius / np.sqrt(2))
                most = max(most, float(way + np.sqrt(radius * radius - way * way) - radius))
    return most


@law(thinnest, CreasedRecord)
def creased_thinnest(c: CreasedRecord) -> float:
    return c.grain * PARTS
