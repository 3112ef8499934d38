"""Feet on surfaces φ = 0: where on it a place is nearest to it.

The foot s of a place x has φ(s) = 0, and x − s along ∇φ(s). It is found by going to the foot of x on the tangent plane at s,
again and again,

    s' = x − (φ(s) + ∇φ(s)·(x − s)) ∇φ(s)/|∇φ(s)|²,

which converges quadratically on the surface, and by the factor d/R at a distance d from it, with R its radius of curvature.
Where it does not converge, as beyond R, the way along the surface is taken in part only, (s' − s)_t ω: that is a descent of
the distance, whose part ω, by Barzilai and Borwein, is found from the last two turns, ω = Δs²/Δs·(Δt − Δt'). On a
surface, which has two dimensions, that converges faster than by any factor.

Sources: E. Hartmann, On the curvature of curves and surfaces defined by normalforms, Computer Aided Geometric Design 16, 355
(1999): feet of points on implicit surfaces; J. Barzilai, J. M. Borwein, Two-point step size gradient methods, IMA Journal of
Numerical Analysis 8, 141 (1988).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.folds import FaceRecord, aside, face_and_slope
from particlesim.colliders.sampled import SampledRecord, sampled, sampled_slope
from particlesim.compiler import outlined
from particlesim.expressions.operations import Ray, slope, value
from particlesim.laws.registry import Particle

MOST_TURNS = 32
"""Turns of the search for a foot: enough up to half the radius of curvature."""
MORE_TURNS = 64
"""Turns of the descent: a foot ten radii of curvature away takes about 15."""
FIRST = 0.125
"""Part of the way along the surface that is taken before its curvature is known."""
CLOSE = 1e-3
"""How far from the surface a place on it may be, in parts of the distance to it, where the descent does not converge."""
FURTHER = 2.0
"""How much farther than in the turn before it may go along the surface, whose curvature there is not known yet."""

BENT = 1e-6
"""Square of the change of a slope beside a place, in units of the slope, from which on it has none there."""
SAME = 1 - 1e-12
"""Square of the cosine between slopes of one face where its foot is found."""


class FormulaRecord(NamedTuple):
    """An expression of x, y and z."""

    formula: Any


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
def foot(f: Any, x: Any, y: Any, z: Any, sx: Any, sy: Any, sz: Any, scale: Any, far: Any, deep: Any) -> Any:
    """The signed distance of a place from the surface φ = 0 [m], the unit normal there, and whether they were found, looked
    for from s on; if that is another place, `deep` says whether the first one is inside. `far`: whether also by descent."""
    d, nx, ny, nz, found = 0.0, 0.0, 1.0, 0.0, False
    there = (sx == x) & (sy == y) & (sz == z)
    if there or not far:  # else it would go far off, if the surface is round
        d, nx, ny, nz, found = _by_planes(f, x, y, z, sx, sy, sz, scale, deep)
    if far and not found:
        d, nx, ny, nz, found = _by_descent(f, x, y, z, sx, sy, sz, scale, deep)
    return d, nx, ny, nz, found


def _begin(f: Any, x: Any, y: Any, z: Any, scale: Any) -> Any:
    """Where a search begins that is to begin at a place, and φ and its gradient there: beside an axis, where √(x² + y²) has
    no slope, it has one."""
    v, a, b, c = level_and_slope(f, x, y, z)
    if isinstance(f, SampledRecord):
        return x, y, z, v, a, b, c
    sx, sy, sz = aside(x, y, z, scale)
    w, e, g, k = level_and_slope(f, sx, sy, sz)
    change2 = (e - a) * (e - a) + (g - b) * (g - b) + (k - c) * (k - c)
    bent = change2 > BENT * (e * e + g * g + k * k)
    x, y, z = sx if bent else x, sy if bent else y, sz if bent else z
    return x, y, z, w if bent else v, e if bent else a, g if bent else b, k if bent else c


@outlined
def _by_planes(f: Any, x: Any, y: Any, z: Any, sx: Any, sy: Any, sz: Any, scale: Any, deep: Any) -> Any:
    """`foot`, all of the way to the foot on the tangent plane in every turn."""
    tiny, there = 2.0**-51 * scale, (sx == x) & (sy == y) & (sz == z)
    sx, sy, sz, v, a, b, c = _begin(f, sx, sy, sz, scale)
    outside = (not deep) & ((not there) | (v + a * (x - sx) + b * (y - sy) + c * (z - sz) > 0))
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
    bent = isinstance(f, FaceRecord)
    return _seen_from(x, y, z, sx, sy, sz, a, b, c, outside, found, bent, tiny)


@outlined
def _by_descent(f: Any, x: Any, y: Any, z: Any, sx: Any, sy: Any, sz: Any, scale: Any, deep: Any) -> Any:
    """`foot`, on to the tangent plane, and a part of the way along it, in every turn. On edges of samples, which have
    ripples, it may not converge: then it is the nearest place of the surface that it has come by."""
    tiny, there = 2.0**-51 * scale, (sx == x) & (sy == y) & (sz == z)
    sx, sy, sz, v, a, b, c = _begin(f, sx, sy, sz, scale)
    outside = (not deep) & ((not there) | (v + a * (x - sx) + b * (y - sy) + c * (z - sz) > 0))
    found = False
    part = FIRST
    nearest, hx, hy, hz = 4 * scale, sx, sy, sz
    lx, ly, lz, px, py, pz = sx, sy, sz, 0.0, 0.0, 0.0  # where it was, and the way along the surface there
    for turn in range(MORE_TURNS):
        steep2 = a * a + b * b + c * c
        t = (v + a * (x - sx) + b * (y - sy) + c * (z - sz)) / steep2
        down = v / steep2
        # along the surface: to the foot on the tangent plane, less the way down to that
        wx, wy, wz = x - sx + (down - t) * a, y - sy + (down - t) * b, z - sz + (down - t) * c
        if turn > 1:
            mx, my, mz = sx - lx, sy - ly, sz - lz
            bend = mx * (px - wx) + my * (py - wy) + mz * (pz - wz)
            moved2, w2 = mx * mx + my * my + mz * mz, wx * wx + wy * wy + wz * wz
            part = moved2 / bend if bend > 0 else FIRST
            leap2 = FURTHER * FURTHER * moved2
            part = part if part * part * w2 <= leap2 else np.sqrt(leap2 / w2)
        ox, oy, oz = x - sx, y - sy, z - sz
        size, below = np.sqrt(ox * ox + oy * oy + oz * oz), abs(down) * np.sqrt(steep2)
        if size < nearest and below <= CLOSE * size:
            nearest, hx, hy, hz = size, sx, sy, sz
        left = np.sqrt(wx * wx + wy * wy + wz * wz) + below
        if left <= 1e-9 * abs(t) * np.sqrt(steep2) + tiny:
            found = True
            break
        lx, ly, lz, px, py, pz = sx, sy, sz, wx, wy, wz
        sx, sy, sz = sx - down * a + part * wx, sy - down * b + part * wy, sz - down * c + part * wz
        if not left < 4 * scale:
            break
        v, a, b, c = level_and_slope(f, sx, sy, sz)
    rough = (not found) and nearest < 4 * scale
    if rough:
        sx, sy, sz, found = hx, hy, hz, True
    return _seen_from(x, y, z, sx, sy, sz, a, b, c, outside, found, rough or isinstance(f, FaceRecord), tiny)


@outlined
def _seen_from(
    x: Any,
    y: Any,
    z: Any,
    sx: Any,
    sy: Any,
    sz: Any,
    a: Any,
    b: Any,
    c: Any,
    outside: Any,
    found: Any,
    bent: Any,
    tiny: Any,
) -> Any:
    """What `foot` returns of a foot s at which the slope is (a, b, c), if it was found; `bent`, if that may be none, or any,
    as on an edge."""
    steep = np.sqrt(a * a + b * b + c * c)
    nx, ny, nz = a / steep, b / steep, c / steep
    ox, oy, oz = x - sx, y - sy, z - sz
    far = np.sqrt(ox * ox + oy * oy + oz * oz)
    if bent and far > 8 * tiny:
        k = (1.0 if outside else -1.0) / far
        nx, ny, nz = k * ox, k * oy, k * oz
    d = ox * nx + oy * ny + oz * nz
    return d, nx, ny, nz, found & ((d > 0) == outside or abs(d) <= 8 * tiny)
