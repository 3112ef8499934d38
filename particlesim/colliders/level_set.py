"""Level sets: solids where a function φ of the place is negative, inside of a box.

φ need not be a distance. Two things are known of it: its value, and a bound L of its slope, so that the surface is at least
|φ|/L away. Near the surface the distance is that to the foot s of a place x, where φ(s) = 0 and x − s is along ∇φ(s): s is
brought there by going to the foot of x on the tangent plane at s, again and again,

    s' = x − (φ(s) + ∇φ(s)·(x − s)) ∇φ(s)/|∇φ(s)|²,

which converges quadratically on the surface, and by the factor d/R at a distance d from it, with R its radius of curvature.
Farther away, and where that does not converge, the gap is the bound. Of a φ with kinks every face is looked at (`folds`).

Outside of the box, which cuts the solid off, the gap is √(d² + g²) with the nearest place of the box d away and g the gap
there.

Sources: J. C. Hart, Sphere tracing, The Visual Computer 12, 527 (1996); E. Hartmann, On the curvature of curves and surfaces
defined by normalforms, Computer Aided Geometric Design 16, 355 (1999): feet of points on implicit surfaces.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.folds import FaceRecord, FoldedRecord, face_and_slope, nearest_foot
from particlesim.colliders.sampled import SampledRecord, sampled, sampled_slope
from particlesim.colliders.solid import PARTS
from particlesim.colliders.way import longest, marched_contact, way_of
from particlesim.compiler import outlined
from particlesim.expressions.operations import Ray, slope, value
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
    thinnest,
)

MOST_TURNS = 32
"""Turns of the search for a foot: enough up to half the radius of curvature."""

SAME = 1 - 1e-12
"""Square of the cosine between slopes of one face where its foot is found."""

BAND = 0.25
"""How far from the surface feet are looked for, in parts of the longest side of the box."""


class FormulaRecord(NamedTuple):
    """An expression of x, y and z."""

    formula: Any


class LevelRecord(NamedTuple):
    """φ, the low and the high corner of the box [m]; a bound of its slope; how far from the surface the distance is looked
    for, and the shortest step of a search [m]; which side particles are on: 1 outside, −1 inside."""

    field: FormulaRecord | SampledRecord
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    steep: float
    band: float
    grain: float
    side: float


class CreasedRecord(NamedTuple):
    """As `LevelRecord`, of a φ with kinks: what lies on it may meet another part of it."""

    field: FoldedRecord
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    steep: float
    band: float
    grain: float
    side: float


AnyLevel = LevelRecord | CreasedRecord


def level(f: Any, x: Any, y: Any, z: Any) -> Any:
    """φ at a place."""
    if isinstance(f, SampledRecord):
        return sampled(f, x, y, z)
    return value(f.formula, Particle(x, y, z, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))


@outlined
def level_and_slope(f: Any, x: Any, y: Any, z: Any) -> Any:
    """φ and its gradient at a place."""
    if isinstance(f, SampledRecord):
        return sampled_slope(f, x, y, z)
    if isinstance(f, FaceRecord):
        return face_and_slope(f, x, y, z)
    p = Particle(x, y, z, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    return (
        value(f.formula, p),
        slope(f.formula, Ray(p, Particle(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))),
        slope(f.formula, Ray(p, Particle(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))),
        slope(f.formula, Ray(p, Particle(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))),
    )


@outlined
def foot(f: Any, x: Any, y: Any, z: Any, scale: Any) -> Any:
    """The signed distance of a place from the surface φ = 0 [m], the unit normal there, and whether they were found."""
    tiny = 2.0**-51 * scale
    v, a, b, c = level_and_slope(f, x, y, z)
    outside = v > 0
    sx, sy, sz = x, y, z
    found = False
    for _ in range(MOST_TURNS):
        steep2 = a * a + b * b + c * c
        t = (v + a * (x - sx) + b * (y - sy) + c * (z - sz)) / steep2
        ux, uy, uz = x - t * a, y - t * b, z - t * c
        moved = np.sqrt((ux - sx) * (ux - sx) + (uy - sy) * (uy - sy) + (uz - sz) * (uz - sz))
        sx, sy, sz = ux, uy, uz
        far = abs(t) * np.sqrt(steep2)
        # What is left along the surface, moved², is of second order in the distance.
        if moved <= 1e-9 * far + tiny:
            found = True
            break
        if not moved < 4 * scale:
            break
        if isinstance(f, FaceRecord):
            # √(a² + b²), as edges of formulas have it, has no slope, or any, where it is 0.
            v, e, g, k = level_and_slope(f, sx, sy, sz)
            lean, size2 = a * e + b * g + c * k, e * e + g * g + k * k
            if v * v <= tiny * tiny * steep2 and not lean * abs(lean) > SAME * size2 * steep2:
                found = True
                break
            a, b, c = e, g, k
        else:
            v, a, b, c = level_and_slope(f, sx, sy, sz)
    steep = np.sqrt(a * a + b * b + c * c)
    nx, ny, nz = a / steep, b / steep, c / steep
    if isinstance(f, FaceRecord):
        # ... and no one direction there
        ox, oy, oz = x - sx, y - sy, z - sz
        far = np.sqrt(ox * ox + oy * oy + oz * oz)
        if far > 8 * tiny:
            k = (1.0 if outside else -1.0) / far
            nx, ny, nz = k * ox, k * oy, k * oz
    d = (x - sx) * nx + (y - sy) * ny + (z - sz) * nz
    found = found & ((d > 0) == outside or abs(d) <= 8 * tiny)
    return d, nx, ny, nz, found


def _clamped(x: Any, low: Any, high: Any) -> Any:
    """The nearest number between two."""
    return min(max(x, low), high)


def at_least(c: Any, p: Particle) -> Any:
    """A lower bound of the distance of a place from the surface, on the side of the particles [m]; no loops."""
    x, y, z = float(p.x), float(p.y), float(p.z)
    cx, cy, cz = (_clamped(each, c.low[k], c.high[k]) for k, each in enumerate((x, y, z)))
    near = level(c.field, cx, cy, cz) / c.steep
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
    g, nx, ny, nz = v / c.steep, k * a, (k * b if steep2 > 0 else 1.0), k * d
    if abs(g) - size <= c.band:
        if isinstance(c.field, FoldedRecord):
            exact, mx, my, mz, found = nearest_foot(foot, c, cx, cy, cz, scale)
        else:
            exact, mx, my, mz, found = foot(c.field, cx, cy, cz, scale)
        if found:
            g, nx, ny, nz = exact, mx, my, mz
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
    law(apart, _record)(level_apart)
    law(first_contact, _record)(level_first_contact)


@law(thinnest, CreasedRecord)
def creased_thinnest(c: CreasedRecord) -> float:
    return c.grain * PARTS
