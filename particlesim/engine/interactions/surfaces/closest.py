"""The distances of a vertex from a triangle and of two edges, and the time at which moving ones come near each other.

Both are differences l = Σ w_k x_k over four rows, the first side with weights that sum to 1, the second to −1: the closest
points of both. For linear motion over a step, x(s) = x₀ + s (x₁ − x₀), the first s at which |l| has come down to a target is
found by conservative advancement: no two points of both sides change their distance by more than L, the largest relative
displacement of two corners, so s may always grow by (|l| − target)/L. This needs distances only, which are exact to
rounding, and never passes an impact.

Source: C. Ericson, Real-Time Collision Detection (2005), sections 5.1.5 and 5.1.9; B. Mirtich, Impulse-based dynamic
simulation of rigid body systems (1996), for conservative advancement; M. Li, D. M. Kaufman, C. Jiang, ACM Trans. Graph. 40,
170 (2021), for the bound by corners.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import shared

NEARLY = 1e-3
"""A search ends when a distance is above its target by that part of it."""
MOST_ADVANCES = 60
"""Bound on the advances of a search; one that is not through then has an impact where it is."""
PARALLEL = 1e-9
"""Square of the sine of the angle below which two edges count as parallel."""


class Closest(NamedTuple):
    """Weights of the four rows at the closest points, and the difference l of these points [m] with its length."""

    w0: Any
    w1: Any
    w2: Any
    w3: Any
    x: Any
    y: Any
    z: Any
    distance: Any


class Four(NamedTuple):
    """Four rows of particles: a vertex and a triangle, or the ends of two edges."""

    i: Any
    j: Any
    k: Any
    m: Any


def place(x: Any, before: Any, i: Any, s: Any) -> Any:
    """Where particle i is after the part s of the step."""
    x0, y0, z0 = float(before[0, i]), float(before[1, i]), float(before[2, i])
    return (
        x0 + s * (float(x[0][i]) - x0),
        y0 + s * (float(x[1][i]) - y0),
        z0 + s * (float(x[2][i]) - z0),
    )


def minus(a: Any, b: Any) -> Any:
    """a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: Any, b: Any) -> Any:
    """a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def unit_interval(s: Any) -> Any:
    """A number brought into [0, 1]."""
    return min(max(s, 0.0), 1.0)


def on_triangle(p: Any, a: Any, b: Any, c: Any) -> Any:
    """Weights of the corners of a triangle at its point closest to p."""
    ab, ac = minus(b, a), minus(c, a)
    ap, bp, cp = minus(p, a), minus(p, b), minus(p, c)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    u, v, w = 1.0, 0.0, 0.0
    if (d1 <= 0) & (d2 <= 0):
        u, v, w = 1.0, 0.0, 0.0
    elif (d3 >= 0) & (d4 <= d3):
        u, v, w = 0.0, 1.0, 0.0
    elif (d6 >= 0) & (d5 <= d6):
        u, v, w = 0.0, 0.0, 1.0
    elif (vc <= 0) & (d1 >= 0) & (d3 <= 0):
        v = d1 / (d1 - d3)
        u = 1.0 - v
    elif (vb <= 0) & (d2 >= 0) & (d6 <= 0):
        w = d2 / (d2 - d6)
        u = 1.0 - w
    elif (va <= 0) & (d4 >= d3) & (d5 >= d6):
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        u, v = 0.0, 1.0 - w
    else:
        total = va + vb + vc
        v, w = vb / total, vc / total
        u = 1.0 - v - w
    return u, v, w


def on_edges(p: Any, q: Any, a: Any, b: Any) -> Any:
    """Where on the edges p–q and a–b their closest points are, 0 to 1; an edge without length is a point."""
    d, e, r = minus(q, p), minus(b, a), minus(p, a)
    dd, ee, de = dot(d, d), dot(e, e), dot(d, e)
    dr, er = dot(d, r), dot(e, r)
    s, t = 0.0, 0.0
    if dd <= 0:
        t = unit_interval(er / ee) if ee > 0 else 0.0
    elif ee <= 0:
        s = unit_interval(-dr / dd)
    else:
        square = dd * ee - de * de
        if square > PARALLEL * dd * ee:
            s = unit_interval((de * er - dr * ee) / square)
        else:  # the middle of the part along which they lie beside each other
            one, other = -dr / dd, (de - dr) / dd
            s = unit_interval(0.5 * (unit_interval(one) + unit_interval(other)))
        t = (de * s + er) / ee
        if t < 0:
            s, t = unit_interval(-dr / dd), 0.0
        elif t > 1:
            s, t = unit_interval((de - dr) / dd), 1.0
    return s, t


def closest(face: Any, x: Any, before: Any, f: Any, s: Any) -> Any:
    """The closest points after the part s of the step: of a vertex and a triangle if `face`, else of two edges."""
    p, q = place(x, before, f.i, s), place(x, before, f.j, s)
    a, b = place(x, before, f.k, s), place(x, before, f.m, s)
    if face:
        u, v, w = on_triangle(p, q, a, b)
        w0, w1, w2, w3 = 1.0, -u, -v, -w
    else:
        at, on = on_edges(p, q, a, b)
        w0, w1, w2, w3 = 1.0 - at, at, on - 1.0, -on
    lx = w0 * p[0] + w1 * q[0] + w2 * a[0] + w3 * b[0]
    ly = w0 * p[1] + w1 * q[1] + w2 * a[1] + w3 * b[1]
    lz = w0 * p[2] + w1 * q[2] + w2 * a[2] + w3 * b[2]
    return Closest(w0, w1, w2, w3, lx, ly, lz, np.sqrt(lx * lx + ly * ly + lz * lz))


def moved_apart(x: Any, before: Any, i: Any, j: Any) -> Any:
    """Square of the relative displacement of two particles in the step."""
    total = 0.0
    for k in range(3):
        d = (float(x[k][i]) - float(before[k, i])) - (float(x[k][j]) - float(before[k, j]))
        total += d * d
    return total


def relative_motion(face: Any, x: Any, before: Any, f: Any) -> Any:
    """By how much the distance of any point of one side from any of the other may change in the step [m]."""
    most = max(moved_apart(x, before, f.i, f.k), moved_apart(x, before, f.i, f.m))
    most = max(most, moved_apart(x, before, f.i, f.j) if face else moved_apart(x, before, f.j, f.k))
    if not face:
        most = max(most, moved_apart(x, before, f.j, f.m))
    return np.sqrt(most)


def thickness(r: Any, f: Any, c: Any) -> Any:
    """How far apart two surfaces are that touch at some closest points: the radii there, between those of the corners."""
    return (
        abs(c.w0) * float(r[f.i])
        + abs(c.w1) * float(r[f.j])
        + abs(c.w2) * float(r[f.k])
        + abs(c.w3) * float(r[f.m])
    )


def widest(face: Any, r: Any, f: Any) -> Any:
    """How far apart two surfaces are that touch, at most."""
    i, j, k, m = float(r[f.i]), float(r[f.j]), float(r[f.k]), float(r[f.m])
    return i + max(j, k, m) if face else max(i, j) + max(k, m)


@shared
def closest_points(face: Any, x: Any, before: Any, i: Any, j: Any, k: Any, m: Any, s: Any) -> Any:
    """`closest` as a function of its own."""
    return closest(face, x, before, Four(i, j, k, m), s)


@shared
def first_nearness(
    face: Any, x: Any, before: Any, i: Any, j: Any, k: Any, m: Any, motion: Any, target: Any
) -> Any:
    """The part of the step after which two sides first are no farther apart than a target [m]; 2 if they never are."""
    f = Four(i, j, k, m)
    s, found, turn = 0.0, 2.0, 0
    while turn < MOST_ADVANCES:
        left = closest(face, x, before, f, s).distance - target
        if left <= NEARLY * target:
            found, turn = s, MOST_ADVANCES
        elif motion * (1.0 - s) < left:
            turn = MOST_ADVANCES
        else:
            s += left / motion
            turn += 1
            found = s if turn == MOST_ADVANCES else found
    return found
