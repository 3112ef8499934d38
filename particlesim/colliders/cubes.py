"""Feet looked for in cubes: what the surface φ = 0 leaves free about a place, where no search from the place itself is sure.

Such a place is where rooms overlap, as the face whose piece of φ decides there goes on in free space, or beyond the centre
of a hollow. A bound of φ alone would hold a ball back there, as a wall that is none. So a cube about the ball is divided
into eight, and these again and again: a cube in which φ is larger than its steepest slope allows has no surface in it. From
those that are left feet are looked for, and what is farther than the best one is left out. That is as sure as the bound of
slopes; where a small cube stays in doubt, the surface may be there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.feet import foot, level, level_and_slope
from particlesim.colliders.folds import FoldedRecord, Foot, in_box, nearest_foot
from particlesim.colliders.levels import from_surface
from particlesim.compiler import outlined
from particlesim.compiler.intrinsics import on_stack

ROOT3 = 3.0**0.5
FIRST = 2.0**-3
"""Half of the first cube about a place, in parts of the last one: what is far takes long only if nothing is near."""
LARGEST = 2.0**-2
"""Half the edge of cubes from which feet are looked for, at most, in parts of that of the first."""
LIKELY = 1.8
"""How far from the middle of a cube the surface may be by its slope for that, in units of half its edge."""
SMALL = 2.0**-4
"""From cubes as small as that the way to a foot may lead out of them."""
SMALLEST = 2.0**-7
"""Half the edge of the smallest cubes, likewise."""
WAITING = 64
"""Cubes that may wait: 7 of each size, and one more."""
MOST_LOOKS = 16384
"""Cubes that are looked at, at most; the rest stays in doubt."""
DEAR = 32
"""How many of them a search for a foot counts as."""
ABOUT = 4.0
"""How far from the middle of a cube faces and feet count as its own, in units of half its edge."""
NEXT = 2.0
"""How far the middle of a cube may be from a foot, likewise, if what is in the cube goes on to that."""


@outlined
def _least(c: Any, x: Any, y: Any, z: Any) -> Any:
    """A lower bound of the distance of any place from the surface [m]."""
    cx, cy, cz = (min(max(u, c.low[k]), c.high[k]) for k, u in enumerate((x, y, z)))
    near = from_surface(c.levels, level(c.field, cx, cy, cz))
    return np.sqrt((x - cx) * (x - cx) + (y - cy) * (y - cy) + (z - cz) * (z - cz) + near * near)


@outlined
def _is_likely(c: Any, x: Any, y: Any, z: Any, reach: Any) -> Any:
    """Whether the surface is within a reach of a place, and there, as far as φ and its slope tell: a face that has ended
    before it is none."""
    cx, cy, cz = (min(max(u, c.low[k]), c.high[k]) for k, u in enumerate((x, y, z)))
    v, a, b, d = level_and_slope(c.field, cx, cy, cz)
    steep2 = a * a + b * b + d * d
    near = v * v <= reach * reach * steep2
    if near and steep2 > 0:
        t = v / steep2
        near = abs(level(c.field, cx - t * a, cy - t * b, cz - t * d)) <= 0.5 * abs(v)
    return near


@outlined
def _foot_from(
    c: Any, x: Any, y: Any, z: Any, px: Any, py: Any, pz: Any, scale: Any, deep: Any, about: Any
) -> Any:
    """The foot of a place, looked for from a place p on, and whether it is sure to be the nearest about there."""
    sx, sy, sz = (min(max(u, c.low[k]), c.high[k]) for k, u in enumerate((px, py, pz)))
    if isinstance(c.field, FoldedRecord):
        d, nx, ny, nz, found, sure, whole = nearest_foot(
            foot, c, x, y, z, sx, sy, sz, scale, True, deep, about
        )
        sure = sure and whole
    else:
        d, nx, ny, nz, found = foot(c.field, x, y, z, sx, sy, sz, scale, True, deep)
        found = found and in_box(c, x - d * nx, y - d * ny, z - d * nz)
        sure = found
    return Foot(d, nx, ny, nz, found), sure


@outlined
def nearest_in_cubes(c: Any, x: Any, y: Any, z: Any, reach: Any, first: Any, scale: Any, deep: Any) -> Any:
    """The distance of a place from the surface, as far as `reach`, or what is sure of it [m]; the foot there, if there is
    one. `first` is a foot of which it is not known whether there is a nearer one; `deep` whether the place is inside."""
    part, best, free, clear = FIRST * reach, first, 0.0, True
    while clear and part < reach and not (best.found and abs(best.d) <= free):
        part = 2 * part
        best, more = _in_cube(c, x, y, z, part, best, scale, deep)
        free, clear = max(free, more), more >= part
    found = best.found and abs(best.d) <= free
    return abs(best.d) if found else free, best.nx, best.ny, best.nz, found


@outlined
def _in_cube(c: Any, x: Any, y: Any, z: Any, reach: Any, first: Any, scale: Any, deep: Any) -> Any:
    """The best foot in a cube about a place, or the first one, and how far there is sure to be no other one."""
    waiting = on_stack(WAITING, 4, np.float64)
    waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3] = x, y, z, reach
    number, looks = 1, 0
    best, near_it = first, False
    doubt = reach
    while number > 0:
        number -= 1
        mx, my, mz, h = waiting[number, 0], waiting[number, 1], waiting[number, 2], waiting[number, 3]
        ox, oy, oz = max(abs(x - mx) - h, 0.0), max(abs(y - my) - h, 0.0), max(abs(z - mz) - h, 0.0)
        near = np.sqrt(ox * ox + oy * oy + oz * oz)
        free = near >= doubt or (best.found and near >= abs(best.d))
        if not free:
            looks += 1
            free = _least(c, mx, my, mz) > ROOT3 * h
        likely = h <= 2 * SMALLEST * reach or (not free and _is_likely(c, mx, my, mz, LIKELY * h))
        if not free and h <= LARGEST * reach and looks < MOST_LOOKS and likely:
            free = near_it and _apart(x, y, z, best, mx, my, mz) <= NEXT * h
            if not free:
                looks += DEAR
                at, sure = _foot_from(c, x, y, z, mx, my, mz, scale, deep, ABOUT * h)
                slid = h <= SMALL * reach and abs(at.d) <= near + 2 * ROOT3 * h
                free = sure and (slid or _apart(x, y, z, at, mx, my, mz) <= ABOUT * h)
                if at.found and ((not best.found) or abs(at.d) < abs(best.d)):
                    best, near_it = at, free
        if not free and (h <= SMALLEST * reach or looks >= MOST_LOOKS):
            doubt = near
        elif not free:
            half = 0.5 * h
            # the nearest of the eight is looked at first
            towards = (1 if x > mx else 0) + (2 if y > my else 0) + (4 if z > mz else 0)
            for k in range(8):
                part = (7 - k) ^ towards
                waiting[number, 0] = mx + (half if (part & 1) > 0 else -half)
                waiting[number, 1] = my + (half if (part & 2) > 0 else -half)
                waiting[number, 2] = mz + (half if (part & 4) > 0 else -half)
                waiting[number, 3] = half
                number += 1
    return best, doubt


def _apart(x: Any, y: Any, z: Any, at: Any, mx: Any, my: Any, mz: Any) -> Any:
    """How far a foot of a place is from another place [m]."""
    sx, sy, sz = x - at.d * at.nx - mx, y - at.d * at.ny - my, z - at.d * at.nz - mz
    return np.sqrt(sx * sx + sy * sy + sz * sz)
