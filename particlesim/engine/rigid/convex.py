"""The distance or the penetration depth of two convex pieces, and its direction.

The distance of pieces that are apart is found by the algorithm of Gilbert, Johnson and Keerthi (GJK), which searches the
Minkowski difference A − B for the point nearest to the origin. Where the pieces touch or overlap, that point gives no
direction: a first one is that of the pieces shrunk towards their middles until they are apart; then A is moved out along it
until there is a small gap, and the direction is found anew. The right direction is a fixed point of this iteration, as the
point of A − B nearest to a point outside stays the nearest while the latter moves along its normal. So the direction is as
exact for pieces that touch as for pieces apart. Where one is deep in the other there are several such points, and the way
out may be another than that from middle to middle: then many directions are looked at, and the best are refined so.

Sources: E. G. Gilbert, D. W. Johnson, S. S. Keerthi, IEEE J. Robot. Autom. 4, 193 (1988); G. van den Bergen, Collision
Detection in Interactive 3D Environments, 2004, chapter 4; nearest points of simplices: C. Ericson, Real-Time Collision
Detection, 2005, section 5.1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import on_stack, outlined
from particlesim.engine.rigid.pieces import Solid, support
from particlesim.engine.rigid.rotation import cross, dot, to_world

MOST_TURNS = 64
CLOSE = 1e-12
"""Relative slack of the square of a distance at which the search ends."""
TOUCHING = 1e-3
"""Distance below which the direction of the search is not trusted, in units of the smaller piece."""
LIFT = 0.02
"""How far apart pieces are for their direction, in units of the smaller one."""
DRAWN_IN = 0.01
"""How far pieces that overlap are drawn in first, as a part of their size."""
REFINED = 3
DEEP = 0.05
"""Depth from which on the shortest way out is looked for among many directions, in units of the smaller piece."""
MOST_FACES = 96
"""Faces of a hull of which directions are tried."""
MOST_TRIED = 230
"""Room for directions: 26 to the faces, edges and corners of a cube, 6 along the axes of each piece, and its faces."""
STARTS = 8
"""Directions that are refined, of those that are not near a better one."""
NEAR = 0.97
"""Cosine of the angle between directions that count as near."""
TILT = (0.013, 0.031, 0.022)
"""What is added to them: a direction to an edge would stay, though all others beside it are better."""
MOST_REFINED = 40
SETTLED = 1e-9
"""Change of a depth at which its direction stays, in units of the smaller piece."""


def lifted(s: Any, shift: Any) -> Any:
    """A piece that has been moved."""
    return Solid(s.number, s.kind, s.size, (s.x[0] + shift[0], s.x[1] + shift[1], s.x[2] + shift[2]), s.r)


@outlined
def nearest(p: Any, s: Any, o: Any, part: Any, found: Any) -> float:
    """The distance of the cores of two pieces, drawn in to a `part` of their size; 0 where they overlap.

    Into `found` [1, 9]: the unit vector from the second to the first, and the places that are nearest.
    """
    w, trial = on_stack(4, 9, np.float64), on_stack(4, 4, np.float64)
    v = (s.x[0] - o.x[0], s.x[1] - o.x[1], s.x[2] - o.x[2])
    if not dot(v, v) > 0:
        v = (1.0, 0.0, 0.0)
    number, vv, size = 0, np.inf, 0.0
    for _ in range(MOST_TURNS):
        a = drawn(support(p, s, (-v[0], -v[1], -v[2])), s, part)
        c = drawn(support(p, o, v), o, part)
        d = (a[0] - c[0], a[1] - c[1], a[2] - c[2])
        if number > 0 and vv - dot(v, d) <= CLOSE * vv + 1e-30 * size:
            break
        known = False
        for k in range(number):
            known = known or (w[k, 0] == d[0] and w[k, 1] == d[1] and w[k, 2] == d[2])
        if known:
            break
        w[number, 0], w[number, 1], w[number, 2] = d
        w[number, 3], w[number, 4], w[number, 5] = a
        w[number, 6], w[number, 7], w[number, 8] = c
        size = max(size, dot(d, d))
        number += 1
        if number == 4 and around(w):
            return 0.0
        square = reduce_simplex(w, trial, number)
        if not square < vv:
            break  # rounding: as near as it gets
        # what is left of the simplex
        left = 0
        v = (0.0, 0.0, 0.0)
        for k in range(number):
            share = trial[0, k]
            if share > 0:
                for axis in range(9):
                    w[left, axis] = w[k, axis]
                trial[1, left] = share
                v = (v[0] + share * w[left, 0], v[1] + share * w[left, 1], v[2] + share * w[left, 2])
                left += 1
        number, vv = left, dot(v, v)
        for axis in range(6):
            total = 0.0
            for k in range(number):
                total += trial[1, k] * w[k, 3 + axis]
            found[0, 3 + axis] = total
        if vv <= 1e-28 * size:
            return 0.0
    length = np.sqrt(vv)
    found[0, 0], found[0, 1], found[0, 2] = v[0] / length, v[1] / length, v[2] / length
    return float(length)


def drawn(a: Any, s: Any, part: Any) -> Any:
    """A place of a piece, drawn in towards its middle."""
    return (
        s.x[0] + part * (a[0] - s.x[0]),
        s.x[1] + part * (a[1] - s.x[1]),
        s.x[2] + part * (a[2] - s.x[2]),
    )


def point(w: Any, k: Any) -> Any:
    """A corner of the simplex, or another vector that is a row."""
    return w[k, 0], w[k, 1], w[k, 2]


def less(a: Any, c: Any) -> Any:
    """a − c."""
    return a[0] - c[0], a[1] - c[1], a[2] - c[2]


@outlined
def around(w: Any) -> bool:
    """Whether a tetrahedron holds the origin."""
    inside = True
    for k in range(4):
        i, j, m = (k + 1) % 4, (k + 2) % 4, (k + 3) % 4
        a = point(w, i)
        n = cross(less(point(w, j), a), less(point(w, m), a))
        inside = inside and dot(n, a) * dot(n, less(point(w, k), a)) < 0
    return inside


@outlined
def reduce_simplex(w: Any, trial: Any, number: Any) -> float:
    """Shares of the corners in the place of a simplex that is nearest to the origin, into trial[0]; the square of its
    distance."""
    for k in range(4):
        trial[0, k] = 0.0
    if number == 1:
        trial[0, 0] = 1.0
        a = point(w, 0)
        return float(dot(a, a))
    if number == 2:
        a, c = point(w, 0), point(w, 1)
        e = less(c, a)
        t = min(max(-dot(a, e) / dot(e, e), 0.0), 1.0)
        trial[0, 0], trial[0, 1] = 1 - t, t
        q = (a[0] + t * e[0], a[1] + t * e[1], a[2] + t * e[2])
        return float(dot(q, q))
    if number == 3:
        return triangle(w, trial, 0, 1, 2, np.inf)
    best = np.inf
    for k in range(4):
        best = triangle(w, trial, (k + 1) % 4, (k + 2) % 4, (k + 3) % 4, best)
    return float(best)


@outlined
def triangle(w: Any, trial: Any, i: Any, j: Any, m: Any, best: Any) -> float:
    """The same for the triangle of three corners, kept if it is nearer than the best so far; the better of both."""
    a, b, c = point(w, i), point(w, j), point(w, m)
    u, v = less(b, a), less(c, a)
    d1, d2 = -dot(u, a), -dot(v, a)
    d3, d4 = -dot(u, b), -dot(v, b)
    d5, d6 = -dot(u, c), -dot(v, c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        x, y, z = 1.0, 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        x, y, z = 0.0, 1.0, 0.0
    elif d6 >= 0 and d5 <= d6:
        x, y, z = 0.0, 0.0, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        t = d1 / (d1 - d3)
        x, y, z = 1 - t, t, 0.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        t = d2 / (d2 - d6)
        x, y, z = 1 - t, 0.0, t
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        x, y, z = 0.0, 1 - t, t
    else:
        one = 1 / (va + vb + vc)
        y, z = vb * one, vc * one
        x = 1 - y - z
    q = (
        x * a[0] + y * b[0] + z * c[0],
        x * a[1] + y * b[1] + z * c[1],
        x * a[2] + y * b[2] + z * c[2],
    )
    square = dot(q, q)
    if not square < best:
        return float(best)
    for k in range(4):
        trial[0, k] = 0.0
    trial[0, i], trial[0, j], trial[0, m] = x, y, z
    return float(square)


def apart_along(p: Any, s: Any, o: Any, n: Any) -> Any:
    """How far the cores of two pieces are apart along a direction from the second to the first."""
    return dot(n, less(support(p, s, (-n[0], -n[1], -n[2])), support(p, o, n)))


@outlined
def separation(p: Any, s: Any, o: Any, beyond: Any, found: Any) -> float:
    """The distance of the cores of two pieces, negative where they overlap: then how far they are to be moved apart.

    Into `found` [1, 9]: the direction from the second to the first, and the places that are nearest. A distance larger than
    `beyond` may be all that is found.
    """
    scale = min(p.fine[s.number], p.fine[o.number])
    distance = nearest(p, s, o, 1.0, found)
    if distance > beyond or distance > TOUCHING * scale:
        return distance
    part = DRAWN_IN
    while part < 1 and not nearest(p, s, o, 1 - part, found) > TOUCHING * scale:
        part = 4 * part
    if not part < 1:
        d = less(s.x, o.x)
        length = np.sqrt(dot(d, d))
        found[0, 0], found[0, 1], found[0, 2] = (
            (d[0] / length, d[1] / length, d[2] / length) if length > 0 else (0.0, 1.0, 0.0)
        )
    for _ in range(REFINED):
        refine(p, s, o, scale, found)
    apart = float(apart_along(p, s, o, (found[0, 0], found[0, 1], found[0, 2])))
    return way_out(p, s, o, scale, apart, found) if -apart > DEEP * scale else apart


@outlined
def refine(p: Any, s: Any, o: Any, scale: Any, found: Any) -> None:
    """The direction anew, from the first piece moved out along it, and the places that are nearest then, moved back."""
    n = (found[0, 0], found[0, 1], found[0, 2])
    out = LIFT * scale - apart_along(p, s, o, n)
    nearest(p, lifted(s, (out * n[0], out * n[1], out * n[2])), o, 1.0, found)
    for axis in range(3):
        found[0, 3 + axis] -= out * n[axis]


@outlined
def way_out(p: Any, s: Any, o: Any, scale: Any, apart: Any, found: Any) -> float:
    """The least depth of pieces that are deep in each other, negative, and its direction and places into `found`, which has
    those of a depth that may be a local minimum only."""
    ways, trial = on_stack(MOST_TRIED, 4, np.float64), on_stack(1, 9, np.float64)
    number = directions(p, s, o, ways)
    for k in range(number):
        ways[k, 3] = apart_along(p, s, o, point(ways, k))
    best = apart
    for _ in range(STARTS):
        first = 0
        for k in range(1, number):
            first = k if ways[k, 3] > ways[first, 3] else first
        n = point(ways, first)
        for k in range(number):
            ways[k, 3] = -np.inf if dot(n, point(ways, k)) > NEAR else ways[k, 3]
        n = (n[0] + TILT[0], n[1] + TILT[1], n[2] + TILT[2])
        one = 1 / np.sqrt(dot(n, n))
        trial[0, 0], trial[0, 1], trial[0, 2] = one * n[0], one * n[1], one * n[2]
        last = -np.inf
        for _ in range(MOST_REFINED):
            refine(p, s, o, scale, trial)
            now = apart_along(p, s, o, point(trial, 0))
            if now > best:
                best = now
                for axis in range(9):
                    found[0, axis] = trial[0, axis]
            if not now > last + SETTLED * scale:
                break
            last = now
    return float(best)


@outlined
def directions(p: Any, s: Any, o: Any, ways: Any) -> int:
    """Directions that may be the way out, into ways [MOST_TRIED, 4]: all around, and those of axes and faces. Returns how
    many there are."""
    number = 0
    for code in range(27):
        x, y, z = code % 3 - 1.0, code // 3 % 3 - 1.0, code // 9 - 1.0
        if code != 13:
            one = 1 / np.sqrt(x * x + y * y + z * z)
            ways[number, 0], ways[number, 1], ways[number, 2] = one * x, one * y, one * z
            number += 1
    for one in range(2):
        piece = s if one == 0 else o
        for axis in range(6):
            sign = 1.0 - 2.0 * (axis % 2)
            unit = (sign * (axis // 2 == 0), sign * (axis // 2 == 1), sign * (axis // 2 == 2))
            ways[number, 0], ways[number, 1], ways[number, 2] = to_world(piece.r, unit)
            number += 1
        first, faces = p.first_face[piece.number], p.first_face[piece.number + 1] - p.first_face[piece.number]
        stride = (faces + MOST_FACES - 1) // MOST_FACES
        sign = -1.0 if one == 0 else 1.0  # the first piece goes where its face does not look
        for f in range(0, faces, max(stride, 1)):
            n = (p.planes[0, first + f], p.planes[1, first + f], p.planes[2, first + f])
            n = to_world(piece.r, n)
            ways[number, 0], ways[number, 1], ways[number, 2] = sign * n[0], sign * n[1], sign * n[2]
            number += 1
    return number
