"""Feet on surfaces with creases and edges: φ = 0 of an expression with kinks.

Each piece of φ, from kink to kink, is a smooth face, which goes on beyond the kinks where it is no part of the surface. So
the nearest place of the surface is looked for on all faces whose kinks are near enough, and counts where φ itself is 0.
Where a foot is beyond a kink k, so that the face has ended before it, the nearest place may be on the edge φ = 0, a_k = 0,
and beyond another one on the corner φ = a_k = a_j = 0. Both are found as the feet are, by Newton's method. The sides of the
box, which cut the solid off, end faces as kinks do.

In a crease, where two faces meet in a dent, one search would find the face whose piece decides at the place, not the nearer;
on an edge it would go from one face to the other for ever.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.expressions.kinks import Spot
from particlesim.expressions.operations import Ray, slope, value

MOST_KINKS = 16
"""Kinks of an expression up to which its faces are looked at one by one."""
SIDES = 6
"""Sides of a box."""
MOST_FACES = 64
"""Faces about a place that are looked at, at most."""
MOST_TURNS = 32
"""Turns of the search for an edge or a corner."""
SPREAD = 4
"""How many times as far as its face an edge may be, if it is sharp."""
ASIDE = (2.0**-40, 0.6 * 2.0**-40, 0.8 * 2.0**-40)
"""How far from a place a search begins that has no side to go to, as on the axis of a tube, in units of the box."""
ON = 2.0**-46
"""How far from φ = 0 a place of the surface may be, by rounding, in units of the box."""


class KinkRecord(NamedTuple):
    """What changes its sign at a kink, and a bound of its slope."""

    argument: Any
    steep: float


class FoldedRecord(NamedTuple):
    """An expression of x, y and z; the same by its pieces; its kinks."""

    formula: Any
    pieces: Any
    kinks: tuple[KinkRecord, ...]


class FaceRecord(NamedTuple):
    """One piece of an expression, everywhere."""

    pieces: Any
    piece: int


class Foot(NamedTuple):
    """The signed distance from a place of the surface [m], the unit vector from there, and whether there is one."""

    d: Any
    nx: Any
    ny: Any
    nz: Any
    found: Any


def number(f: Any, x: Any, y: Any, z: Any, piece: Any = 0) -> Any:
    """An expression, by its pieces or as written, at a place."""
    p: Any = Spot(x, y, z, piece)
    return value(f, p)


def number_and_slope(f: Any, x: Any, y: Any, z: Any, piece: Any) -> Any:
    """An expression by its pieces, and its gradient, at a place."""
    p: Any = Spot(x, y, z, piece)
    a: Any = Spot(1.0, 0.0, 0.0, piece)
    b: Any = Spot(0.0, 1.0, 0.0, piece)
    c: Any = Spot(0.0, 0.0, 1.0, piece)
    return value(f, p), slope(f, Ray(p, a)), slope(f, Ray(p, b)), slope(f, Ray(p, c))


def aside(x: Any, y: Any, z: Any, scale: Any) -> Any:
    """Where a search begins that has no side to go to at a place."""
    return x + ASIDE[0] * scale, y + ASIDE[1] * scale, z + ASIDE[2] * scale


@outlined
def face_and_slope(f: Any, x: Any, y: Any, z: Any) -> Any:
    """φ of a face and its gradient at a place."""
    return number_and_slope(f.pieces, x, y, z, f.piece)


@outlined
def _end_and_slope(c: Any, k: Any, x: Any, y: Any, z: Any, piece: Any) -> Any:
    """What changes its sign at kink k, or at a side of the box after the last one, and its gradient."""
    a, b, d, e = 1.0, 0.0, 0.0, 0.0
    for j, kink in enumerate(c.field.kinks):
        if j == k:
            a, b, d, e = number_and_slope(kink.argument, x, y, z, piece)
    first = len(c.field.kinks)
    for axis, u in enumerate((x, y, z)):
        if k == first + 2 * axis or k == first + 2 * axis + 1:
            a = u - (c.low[axis] if k == first + 2 * axis else c.high[axis])
            b, d, e = float(axis == 0), float(axis == 1), float(axis == 2)
    return a, b, d, e


@outlined
def _beyond(c: Any, x: Any, y: Any, z: Any, piece: Any) -> Any:
    """The kinks, and the sides of the box after them, beyond which a place is that should be on a piece, as bits."""
    bits = 0
    for k, kink in enumerate(c.field.kinks):
        a = number(kink.argument, x, y, z, piece)
        wrong = a < 0 if ((piece >> k) & 1) > 0 else a > 0
        bits = bits | (1 << k) if wrong else bits
    first = len(c.field.kinks)
    for axis, u in enumerate((x, y, z)):
        bits = bits | (1 << (first + 2 * axis)) if u < c.low[axis] else bits
        bits = bits | (1 << (first + 2 * axis + 1)) if u > c.high[axis] else bits
    return bits


@outlined
def _edge(
    ends: Any, piece: Any, k: Any, x: Any, y: Any, z: Any, sx: Any, sy: Any, sz: Any, scale: Any
) -> Any:
    """The nearest place with φ = 0 on a piece and at kink k, or side, looked for from s on, and whether it was found."""
    face, tiny = FaceRecord(ends.field.pieces, piece), 2.0**-51 * scale
    found = False
    for turn in range(MOST_TURNS):
        v, a, b, c = face_and_slope(face, sx, sy, sz)
        w, d, e, g = _end_and_slope(ends, k, sx, sy, sz, piece)
        ox, oy, oz = x - sx, y - sy, z - sz
        v, w = v + a * ox + b * oy + c * oz, w + d * ox + e * oy + g * oz
        aa, ad, dd = a * a + b * b + c * c, a * d + b * e + c * g, d * d + e * e + g * g
        spread = aa * dd - ad * ad
        if not spread > 1e-12 * aa * dd:
            if turn > 0:
                break
            sx, sy, sz = aside(sx, sy, sz, scale)
            continue
        i, j = (dd * v - ad * w) / spread, (aa * w - ad * v) / spread
        ux, uy, uz = x - i * a - j * d, y - i * b - j * e, z - i * c - j * g
        moved = np.sqrt((ux - sx) * (ux - sx) + (uy - sy) * (uy - sy) + (uz - sz) * (uz - sz))
        far = np.sqrt((ux - x) * (ux - x) + (uy - y) * (uy - y) + (uz - z) * (uz - z))
        sx, sy, sz = ux, uy, uz
        if moved <= 1e-9 * far + tiny:
            found = True
            break
        if not moved < 4 * scale:
            break
    return sx, sy, sz, found


@outlined
def _corner(ends: Any, piece: Any, k: Any, j: Any, x: Any, y: Any, z: Any, scale: Any) -> Any:
    """The place with φ = 0 on a piece and at two kinks or sides, and whether it was found."""
    face, tiny = FaceRecord(ends.field.pieces, piece), 2.0**-51 * scale
    found = False
    for _ in range(MOST_TURNS):
        v, a, b, c = face_and_slope(face, x, y, z)
        w, d, e, g = _end_and_slope(ends, k, x, y, z, piece)
        u, i, m, n = _end_and_slope(ends, j, x, y, z, piece)
        # p, q and r are perpendicular to two of the three slopes each
        px, py, pz = e * n - g * m, g * i - d * n, d * m - e * i
        qx, qy, qz = m * c - n * b, n * a - i * c, i * b - m * a
        rx, ry, rz = b * g - c * e, c * d - a * g, a * e - b * d
        whole = a * px + b * py + c * pz
        sizes = (a * a + b * b + c * c) * (d * d + e * e + g * g) * (i * i + m * m + n * n)
        if not whole * whole > 1e-12 * sizes:
            break
        mx, my, mz = (
            (v * px + w * qx + u * rx) / whole,
            (v * py + w * qy + u * ry) / whole,
            (v * pz + w * qz + u * rz) / whole,
        )
        x, y, z = x - mx, y - my, z - mz
        moved = np.sqrt(mx * mx + my * my + mz * mz)
        if moved <= tiny:
            found = True
            break
        if not moved < 4 * scale:
            break
    return x, y, z, found


def in_box(c: Any, x: Any, y: Any, z: Any) -> Any:
    """Whether a place is in the box of a level set, but for rounding."""
    e = ON * (c.high[0] - c.low[0] + c.high[1] - c.low[1] + c.high[2] - c.low[2])
    wide = (x >= c.low[0] - e) & (x <= c.high[0] + e) & (y >= c.low[1] - e) & (y <= c.high[1] + e)
    return wide & (z >= c.low[2] - e) & (z <= c.high[2] + e)


def on_surface(c: Any, x: Any, y: Any, z: Any, scale: Any) -> Any:
    """Whether a place is on the surface of a solid: a face may have ended before it."""
    here = number(c.field.formula, x, y, z)
    return in_box(c, x, y, z) & (abs(here) <= ON * scale * c.steep)


def nearer(best: Any, x: Any, y: Any, z: Any, sx: Any, sy: Any, sz: Any, outside: Any) -> Any:
    """The nearer foot of a place: the best so far or one at s, an edge or a corner."""
    ox, oy, oz = x - sx, y - sy, z - sz
    far = np.sqrt(ox * ox + oy * oy + oz * oz)
    better = (far > 0) & ((not best.found) | (far < abs(best.d)))
    k = (1.0 if outside else -1.0) / far if far > 0 else 0.0
    return Foot(
        (far if outside else -far) if better else best.d,
        k * ox if better else best.nx,
        k * oy if better else best.ny,
        k * oz if better else best.nz,
        better | best.found,
    )


@outlined
def at_edges(
    c: Any,
    piece: Any,
    best: Any,
    x: Any,
    y: Any,
    z: Any,
    px: Any,
    py: Any,
    pz: Any,
    foot: Any,
    outside: Any,
    scale: Any,
) -> Any:
    """The best foot so far, or a nearer place on edges and corners, looked for from the place or from p on, of a face that
    ends before the foot of a place on it; and whether there is any such place."""
    count, ended = len(c.field.kinks) + SIDES, False
    ends = _beyond(c, x - foot.d * foot.nx, y - foot.d * foot.ny, z - foot.d * foot.nz, piece)
    for k in range(count):
        if ((ends >> k) & 1) > 0:
            cx, cy, cz = (min(max(u, c.low[j]), c.high[j]) for j, u in enumerate((x, y, z)))
            sx, sy, sz, found = _edge(c, piece, k, x, y, z, cx, cy, cz, scale)
            if not found and not ((px == cx) & (py == cy) & (pz == cz)):
                sx, sy, sz, found = _edge(c, piece, k, x, y, z, px, py, pz, scale)
            if found and on_surface(c, sx, sy, sz, scale):
                best, ended = nearer(best, x, y, z, sx, sy, sz, outside), True
            elif found:
                more = _beyond(c, sx, sy, sz, piece) & ~(1 << k)
                for j in range(count):
                    if ((more >> j) & 1) > 0:
                        ux, uy, uz, met = _corner(c, piece, k, j, sx, sy, sz, scale)
                        if met and on_surface(c, ux, uy, uz, scale):
                            best, ended = nearer(best, x, y, z, ux, uy, uz, outside), True
    return best, ended


def own_piece(f: Any, x: Any, y: Any, z: Any) -> Any:
    """The piece that decides at a place."""
    piece = 0
    for k, kink in enumerate(f.kinks):
        above = number(kink.argument, x, y, z, piece) >= 0
        piece = piece | (1 << k) if above else piece
    return piece


def close_kinks(f: Any, piece: Any, x: Any, y: Any, z: Any, reach: Any) -> Any:
    """The kinks that may be within a distance of a place on a piece, as bits."""
    bits = 0
    for k, kink in enumerate(f.kinks):
        a = number(kink.argument, x, y, z, piece)
        bits = bits | (1 << k) if abs(a) <= kink.steep * reach else bits
    return bits


def few(bits: Any) -> Any:
    """Whether kinks have no more faces about them than are looked at."""
    faces = 1
    for k in range(MOST_KINKS):
        faces = 2 * faces if ((bits >> k) & 1) > 0 else faces
    return faces <= MOST_FACES


@outlined
def nearest_foot(
    foot: Any,
    c: Any,
    x: Any,
    y: Any,
    z: Any,
    px: Any,
    py: Any,
    pz: Any,
    scale: Any,
    far: Any,
    deep: Any,
    about: Any,
) -> Any:
    """The signed distance of a place from the surface φ = 0 [m], the unit normal there, whether they were found, whether it
    is sure to be the least of the faces that were looked at, and whether these are all; p is the place, or one in the box
    where the search begins, and then `deep` says whether the place is inside. `foot` finds them for a face, if `far` by
    descent, too. Of faces those count that are within `about` of p, if they are few, or, if that is 0, as near as the best
    foot."""
    f = c.field
    own, tiny = own_piece(f, px, py, pz), 2.0**-48 * scale
    out = np.sqrt((x - px) * (x - px) + (y - py) * (y - py) + (z - pz) * (z - pz))
    outside = (not deep) & ((out > 0) | (number(f.formula, px, py, pz) > 0))
    best, sure = Foot(0.0, 0.0, 1.0, 0.0, False), True
    near, turned, looks = 0, 0, 0
    while looks < MOST_FACES:
        piece = own ^ turned
        at = Foot(*foot(FaceRecord(f.pieces, piece), x, y, z, px, py, pz, scale, far, deep))
        ended = False
        if at.found and ((not best.found) or abs(at.d) < abs(best.d)):
            if not on_surface(c, x - at.d * at.nx, y - at.d * at.ny, z - at.d * at.nz, scale):
                best, ended = at_edges(c, piece, best, x, y, z, px, py, pz, at, outside, scale)
            elif (at.d > 0) == outside or abs(at.d) <= tiny:
                best, ended = at, True
        if looks == 0:
            # What decides at the place ends somewhere near; where is not known if it is too bent to tell.
            sure = ended
            reach = abs(best.d) if best.found else (SPREAD * abs(at.d) if at.found else scale)
            near = close_kinks(f, own, px, py, pz, about if about > 0 else reach + out + tiny)
            turned = near
            if about > 0 and not few(near):
                break
        else:
            turned = (turned - 1) & near
        looks += 1
        if turned == 0:
            break
    return best.d, best.nx, best.ny, best.nz, best.found, best.found and sure, turned == 0
