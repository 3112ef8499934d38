"""The narrow phase: points, normals and gaps where two bodies touch or are about to, piece by piece.

Spheres and capsules are a point and a segment with a radius; the signed distance of a box is exact and convex, so the point
of a segment that is nearest to a box is found by sections. Two boxes are tried along the fifteen directions that may
separate them: of the faces of both, and of the products of their edges. Faces that touch are clipped against each other
(Sutherland and Hodgman), crossing edges touch where they are nearest. Of all other pieces nothing but convexity is assumed
(`manifold`).

Sources: S. Gottschalk, M. Lin, D. Manocha, SIGGRAPH 1996 (fifteen axes); C. Ericson, Real-Time Collision Detection, 2005,
chapters 4 and 5; I. Sutherland, G. Hodgman, Comm. ACM 17, 32 (1974).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.bodies.pieces import BOX, CAPSULE, SPHERE
from particlesim.compiler import on_stack, outlined, shared
from particlesim.engine.rigid.bodies import WORLD, add_contact, orientation, place, set_fall, set_surface
from particlesim.engine.rigid.convex import nearest
from particlesim.engine.rigid.manifold import BESIDE, SPAN, convex_contacts
from particlesim.engine.rigid.pieces import solid_of
from particlesim.engine.rigid.rotation import dot, matrix, to_body, to_world

PARALLEL = 1e-6
"""Square of the sine below which edges count as parallel."""
FACE_FIRST = 1e-3
"""Crossing edges must be this much better than faces, in units of the smaller box, to be taken for the contact: faces have
several points, which rest more firmly."""
ROUNDING = 1e-9
"""The same where the first touch counts."""
NEARLY = 0.97
"""Cosine of the angle between two directions, 14 degrees, from which on they count as nearly the same."""
BESIDE_FACE = 4096 + 9
"""Number of the feature of boxes whose nearest places are beside their faces."""
SECTIONS = 40
"""Golden sections of a segment, each of which leaves 0.618 of it."""
GOLDEN = 0.6180339887498949


@shared
def touch(b: Any, k: Any, surfaces: Any, i: Any, j: Any, margin: Any) -> None:
    """Note the contacts of bodies i and j that are nearer than a margin."""
    begin, p = k.number[0], b.pieces
    g, h = b.group[i], b.group[j]
    ri, rj = matrix(orientation(b, i)), matrix(orientation(b, j))
    first, last, others = p.first[h], p.first[h + 1], p.first[h + 1] - p.first[h]
    for one in range(p.first[g], p.first[g + 1]):
        s = solid_of(p, one, place(b, i), ri)
        d = minus(s.x, place(b, j))
        near = p.ball[one] + b.reach[j] + margin
        if dot(d, d) < near * near:
            for two in range(first, last):
                o = solid_of(p, two, place(b, j), rj)
                d = minus(s.x, o.x)
                near = p.ball[one] + p.ball[two] + margin
                if dot(d, d) < near * near:
                    code = SPAN * ((one - p.first[g]) * others + two - first)
                    touch_pieces(k, p, i, j, s, o, margin, code)
    for number in range(begin, k.number[0]):
        set_surface(k, number, surfaces.restitution[g, h], surfaces.static[g, h], surfaces.kinetic[g, h])
        if surfaces.falls is not None:
            set_fall(k, number, 0, surfaces.falls[0, g], surfaces.falls[1, g], surfaces.falls[2, g])
            set_fall(k, number, 3, surfaces.falls[0, h], surfaces.falls[1, h], surfaces.falls[2, h])


def touch_pieces(k: Any, p: Any, i: Any, j: Any, s: Any, o: Any, margin: Any, code: Any) -> None:
    """The contacts of piece s of body i and piece o of body j."""
    if p.corners is not None and (s.kind > CAPSULE or o.kind > CAPSULE):
        convex_contacts(k, p, i, j, s, o, margin, code)
        return
    if s.kind == BOX and o.kind == BOX:
        begin = k.number[0]
        if box_box(k, i, j, s, o, margin, code) and k.number[0] == begin:
            near_boxes(k, p, i, j, s, o, margin, code)
    elif s.kind == BOX:
        core_box(k, j, i, o, s, margin, -1.0, code)
    elif o.kind == BOX:
        core_box(k, i, j, s, o, margin, 1.0, code)
    else:
        core_core(k, i, j, s, o, margin, code)


def half_axis(s: Any) -> Any:
    """From the centre of a sphere or a capsule to an end of its core [m]."""
    if s.kind == SPHERE:
        return 0.0, 0.0, 0.0
    return to_world(s.r, (0.0, 0.0, s.size[1]))


def plus(a: Any, s: Any, c: Any) -> Any:
    """a + s c."""
    return a[0] + s * c[0], a[1] + s * c[1], a[2] + s * c[2]


def minus(a: Any, c: Any) -> Any:
    """a − c."""
    return a[0] - c[0], a[1] - c[1], a[2] - c[2]


def clamped(x: Any, low: Any, high: Any) -> Any:
    """x, or the nearest of the bounds."""
    return min(max(x, low), high)


# ---- spheres and capsules


@outlined
def core_core(k: Any, i: Any, j: Any, s: Any, o: Any, margin: Any, code: Any) -> None:
    """Contacts of two pieces that are points or segments with radii."""
    p, q = s.x, o.x
    u, w = half_axis(s), half_axis(o)
    uu, ww, uw = dot(u, u), dot(w, w), dot(u, w)
    d = minus(p, q)
    du, dw = dot(d, u), dot(d, w)
    # The nearest points p + a u and q + t w with a, t in [−1, 1] (Ericson, 5.1.9).
    slope = uu * ww - uw * uw
    a = clamped((uw * dw - ww * du) / slope, -1.0, 1.0) if slope > PARALLEL * uu * ww else 0.0
    t = clamped((dw + a * uw) / ww, -1.0, 1.0) if ww > 0 else 0.0
    a = clamped((t * uw - du) / uu, -1.0, 1.0) if uu > 0 else 0.0
    near_points(k, i, j, s, o, plus(p, a, u), plus(q, t, w), margin, code)
    if uu > 0 and ww > 0 and slope <= BESIDE * uu * ww:
        # Side by side: both ends of the stretch that they share, too.
        for end in range(2):
            a = 1.0 - 2.0 * end
            t = clamped((dw + a * uw) / ww, -1.0, 1.0)
            a = clamped((t * uw - du) / uu, -1.0, 1.0)
            near_points(k, i, j, s, o, plus(p, a, u), plus(q, t, w), margin, code + 1 + end)


def near_points(k: Any, i: Any, j: Any, s: Any, o: Any, p: Any, q: Any, margin: Any, feature: Any) -> None:
    """A contact of two points with the radii of their pieces."""
    d = minus(p, q)
    distance = np.sqrt(dot(d, d))
    gap = distance - s.size[0] - o.size[0]
    if gap < margin:
        n = (d[0] / distance, d[1] / distance, d[2] / distance) if distance > 0 else (0.0, 1.0, 0.0)
        add_contact(k, i, j, feature, plus(q, o.size[0] + 0.5 * gap, n), n, gap)


# ---- a sphere or a capsule and a box


def box_distance(half: Any, a: Any) -> Any:
    """Signed distance of a point, in the frame of a box, from its surface."""
    x, y, z = abs(a[0]) - half[0], abs(a[1]) - half[1], abs(a[2]) - half[2]
    ox, oy, oz = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return np.sqrt(ox * ox + oy * oy + oz * oz) + min(max(x, max(y, z)), 0.0)


def box_normal(half: Any, a: Any) -> Any:
    """Unit gradient of the distance from a box, in its frame."""
    x, y, z = abs(a[0]) - half[0], abs(a[1]) - half[1], abs(a[2]) - half[2]
    sx, sy, sz = np.copysign(1.0, a[0]), np.copysign(1.0, a[1]), np.copysign(1.0, a[2])
    if x <= 0 and y <= 0 and z <= 0:
        if x >= y and x >= z:
            return sx, 0.0, 0.0
        return (0.0, sy, 0.0) if y >= z else (0.0, 0.0, sz)
    ox, oy, oz = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    one = 1 / np.sqrt(ox * ox + oy * oy + oz * oz)
    return sx * ox * one, sy * oy * one, sz * oz * one


@outlined
def core_box(k: Any, i: Any, j: Any, s: Any, o: Any, margin: Any, sign: Any, code: Any) -> None:
    """Contacts of a point or a segment with a radius, of body i, and a box, of body j; sign −1 notes j as the first."""
    half = o.size
    a = to_body(o.r, minus(s.x, o.x))
    u = to_body(o.r, half_axis(s))
    if s.kind == SPHERE:
        box_point(k, i, j, s, o, a, margin, sign, code)
        return
    for end in range(2):
        box_point(k, i, j, s, o, plus(a, 1.0 - 2.0 * end, u), margin, sign, code + 1 + end)
    low, high = -1.0, 1.0
    for _ in range(SECTIONS):
        c, t = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        if box_distance(half, plus(a, c, u)) < box_distance(half, plus(a, t, u)):
            high = t
        else:
            low = c
    c = 0.5 * (low + high)
    if abs(c) < 0.99:
        box_point(k, i, j, s, o, plus(a, c, u), margin, sign, code + 3)


def box_point(k: Any, i: Any, j: Any, s: Any, o: Any, a: Any, margin: Any, sign: Any, feature: Any) -> None:
    """A contact of a point of piece s, in the frame of box o, with a radius."""
    radius = s.size[0]
    gap = box_distance(o.size, a) - radius
    if gap < margin:
        n = to_world(o.r, box_normal(o.size, a))
        point = plus(plus(o.x, 1.0, to_world(o.r, a)), -(radius + 0.5 * gap), n)
        if sign > 0:
            add_contact(k, i, j, feature, point, n, gap)
        else:
            add_contact(k, j, i, feature, point, (-n[0], -n[1], -n[2]), gap)


# ---- two boxes


def column(r: Any, axis: Any) -> Any:
    """Axis number 0, 1 or 2 of a rotation matrix, a direction in the world."""
    if axis == 0:
        return r[0], r[3], r[6]
    if axis == 1:
        return r[1], r[4], r[7]
    return r[2], r[5], r[8]


def turned(v: Any, sign: Any) -> Any:
    """A direction, or its opposite."""
    return v[0] * sign, v[1] * sign, v[2] * sign


def entry(v: Any, axis: Any) -> Any:
    """A component by a number that is not known."""
    return v[0] if axis == 0 else (v[1] if axis == 1 else v[2])


def extent(r: Any, half: Any, n: Any) -> Any:
    """How far a box reaches from its centre along a direction."""
    a = to_body(r, n)
    return half[0] * abs(a[0]) + half[1] * abs(a[1]) + half[2] * abs(a[2])


@outlined
def box_box(k: Any, i: Any, j: Any, s: Any, o: Any, margin: Any, code: Any) -> bool:
    """Contacts of two boxes; whether none of the directions parts them by more than a margin."""
    ri, rj, hi, hj, first_touch = s.r, o.r, s.size, o.size, k.number[2] > 0
    d = minus(o.x, s.x)
    smallest = min(min(hi[0], min(hi[1], hi[2])), min(hj[0], min(hj[1], hj[2])))
    best, which, slack = -np.inf, 0, (ROUNDING if first_touch else FACE_FIRST) * smallest
    for axis in range(3):
        n = column(ri, axis)
        apart = abs(dot(d, n)) - entry(hi, axis) - extent(rj, hj, n)
        if apart > best:
            best, which = apart, axis
    # Of faces that are as good the first is taken, so that a stack has the same contacts in every step; where one is that of
    # a collider, it is that: a collider may be far larger, and then the other one is worse as soon as the body leans.
    if j == WORLD:
        best -= 2 * slack
    for axis in range(3):
        n = column(rj, axis)
        apart = abs(dot(d, n)) - entry(hj, axis) - extent(ri, hi, n)
        if apart > best + slack:
            best, which = apart, 3 + axis
    if j == WORLD and which < 3:
        best += 2 * slack
    if best > margin:
        return False
    crossing, first, second = -np.inf, 0, 0
    for p in range(3):
        for q in range(3):
            n = cross_of(column(ri, p), column(rj, q))
            length2 = dot(n, n)
            if length2 > PARALLEL:
                apart = (abs(dot(d, n)) - extent(ri, hi, n) - extent(rj, hj, n)) / np.sqrt(length2)
                if apart > crossing:
                    crossing, first, second = apart, p, q
    if crossing > margin:
        return False
    if crossing > best + slack and (first_touch or not nearly_face(ri, rj, which, first, second)):
        edges(k, i, j, s.x, ri, rj, hi, hj, d, first, second, crossing, code)
    elif which < 3:
        faces(k, i, j, s.x, ri, rj, hi, hj, d, which, margin, 1.0, code)
    else:
        faces(k, j, i, o.x, rj, ri, hj, hi, turned(d, -1.0), which - 3, margin, -1.0, code)
    return True


@outlined
def near_boxes(k: Any, p: Any, i: Any, j: Any, s: Any, o: Any, margin: Any, code: Any) -> None:
    """The contact of two boxes that are nearest beside the face which parts them best: at a corner or an edge of it."""
    found = on_stack(1, 9, np.float64)
    gap = nearest(p, s, o, 1.0, found)
    if 0 < gap < margin:
        n = (found[0, 0], found[0, 1], found[0, 2])
        at = plus((found[0, 6], found[0, 7], found[0, 8]), 0.5 * gap, n)
        add_contact(k, i, j, code + BESIDE_FACE, at, n, gap)


def nearly_face(ri: Any, rj: Any, which: Any, first: Any, second: Any) -> bool:
    """Whether the normal of two edges is nearly that of the best face. Then the face is in contact: one point would let
    boxes that lie on each other rock, and sink."""
    n, face = cross_of(column(ri, first), column(rj, second)), column(ri, which)
    if which >= 3:
        face = column(rj, which - 3)
    along = dot(n, face)
    return bool(along * along > NEARLY * NEARLY * dot(n, n))


def cross_of(a: Any, c: Any) -> Any:
    """a × c."""
    return a[1] * c[2] - a[2] * c[1], a[2] * c[0] - a[0] * c[2], a[0] * c[1] - a[1] * c[0]


def edges(
    k: Any,
    i: Any,
    j: Any,
    x: Any,
    ri: Any,
    rj: Any,
    hi: Any,
    hj: Any,
    d: Any,
    p: Any,
    q: Any,
    gap: Any,
    code: Any,
) -> None:
    """The contact of an edge of the box i at x along its axis p and one of box j along its axis q."""
    u, w = column(ri, p), column(rj, q)
    n = cross_of(u, w)
    n = turned(n, np.copysign(1 / np.sqrt(dot(n, n)), -dot(d, n)))  # from j to i
    a = edge_middle(ri, hi, p, turned(n, -1.0))
    c = plus(edge_middle(rj, hj, q, n), 1.0, d)
    # The nearest points of the two lines.
    e = minus(a, c)
    uw = dot(u, w)
    slope = 1 - uw * uw
    s = (uw * dot(e, w) - dot(e, u)) / slope
    t = (dot(e, w) - uw * dot(e, u)) / slope
    one, two = plus(a, s, u), plus(c, t, w)
    middle = ((one[0] + two[0]) * 0.5, (one[1] + two[1]) * 0.5, (one[2] + two[2]) * 0.5)
    add_contact(k, i, j, code + 4096 + 3 * p + q, plus(x, 1.0, middle), n, gap)


def edge_middle(r: Any, half: Any, axis: Any, towards: Any) -> Any:
    """From the centre of a box to the middle of that edge along an axis which is farthest in a direction."""
    a = to_body(r, towards)
    x = 0.0 if axis == 0 else np.copysign(half[0], a[0])
    y = 0.0 if axis == 1 else np.copysign(half[1], a[1])
    z = 0.0 if axis == 2 else np.copysign(half[2], a[2])
    return to_world(r, (x, y, z))


def faces(
    k: Any,
    i: Any,
    j: Any,
    centre: Any,
    ri: Any,
    rj: Any,
    hi: Any,
    hj: Any,
    d: Any,
    axis: Any,
    margin: Any,
    sign: Any,
    code: Any,
) -> None:
    """Contacts of a face of the box i at `centre` across its axis and the face of box j that looks at it; d goes from i
    to j. Sign −1 notes j as the first."""
    n = turned(column(ri, axis), np.copysign(1.0, dot(d, column(ri, axis))))
    towards = to_body(rj, n)
    x, y, z = abs(towards[0]), abs(towards[1]), abs(towards[2])
    facing = 0 if x >= y and x >= z else (1 if y >= z else 2)
    # The corners of the face of j, in the frame of i without the axis: two coordinates u, w; the height h over the face
    # of i.
    one, two = (axis + 1) % 3, (axis + 2) % 3
    corners, clipped = on_stack(4, 16, np.float64), on_stack(4, 16, np.float64)
    number = 4
    for corner in range(4):
        s = 1.0 if corner == 0 or corner == 3 else -1.0
        t = 1.0 if corner < 2 else -1.0
        level = -np.copysign(entry(hj, facing), entry(towards, facing))
        x = level if facing == 0 else (s if facing == 2 else t) * hj[0]
        y = level if facing == 1 else (s if facing == 0 else t) * hj[1]
        z = level if facing == 2 else (s if facing == 1 else t) * hj[2]
        place_in_i = plus(d, 1.0, to_world(rj, (x, y, z)))
        corners[0, corner] = dot(place_in_i, column(ri, one))
        corners[1, corner] = dot(place_in_i, column(ri, two))
        corners[2, corner] = dot(place_in_i, n) - entry(hi, axis)
        corners[3, corner] = corner + 4.0 * facing
    number = clip(corners, clipped, number, 0, 1.0, entry(hi, one), 1)
    number = clip(clipped, corners, number, 0, -1.0, entry(hi, one), 2)
    number = clip(corners, clipped, number, 1, 1.0, entry(hi, two), 3)
    number = clip(clipped, corners, number, 1, -1.0, entry(hi, two), 4)
    for m in range(number):
        gap = corners[2, m]
        if gap < margin:
            at = plus(plus(centre, corners[0, m], column(ri, one)), corners[1, m], column(ri, two))
            at = plus(at, entry(hi, axis) + 0.5 * gap, n)
            feature = code + int(corners[3, m]) + 1024 * axis
            if sign > 0:
                add_contact(k, i, j, feature, at, turned(n, -1.0), gap)
            else:
                add_contact(k, j, i, feature + 8192, at, n, gap)


def clip(given: Any, kept: Any, number: Any, axis: Any, sign: Any, bound: Any, side: Any) -> int:
    """Keep what of a polygon is on one side of a line: sign · coordinate ≤ bound. Returns how many corners are left."""
    left = 0
    for m in range(number):
        after = m + 1 if m + 1 < number else 0
        here, there = sign * given[axis, m] - bound, sign * given[axis, after] - bound
        if here <= 0:
            for c in range(4):
                kept[c, left] = given[c, m]
            left += 1
        if (here < 0 and there > 0) or (here > 0 and there < 0):
            part = here / (here - there)
            for c in range(3):
                kept[c, left] = given[c, m] + part * (given[c, after] - given[c, m])
            low, high = min(given[3, m], given[3, after]), max(given[3, m], given[3, after])
            kept[3, left] = float((int(low) * 29 + int(high) * 13 + side * 101 + 12) % 1009)
            left += 1
    return left
