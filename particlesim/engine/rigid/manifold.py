"""Contact points of two convex pieces: the corners of the intersection of a face with the feature that is opposite to it.

The reference face is the face of either piece that separates them better, if it does so as well as the direction of least
distance; the opposite feature of the other piece, a face, an edge or a vertex, is clipped against its sides (Sutherland and
Hodgman). Otherwise two edges cross, or a round surface touches, at one point.

Sources: I. Sutherland, G. Hodgman, Comm. ACM 17, 32 (1974); C. Ericson, Real-Time Collision Detection, 2005, chapter 5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.bodies.pieces import BOX, CAPSULE, CONE, CYLINDER, HULL, SPHERE
from particlesim.compiler import on_stack, outlined
from particlesim.engine.rigid.bodies import WORLD, add_contact
from particlesim.engine.rigid.convex import apart_along, less, separation
from particlesim.engine.rigid.pieces import corner, roundness
from particlesim.engine.rigid.rotation import cross, dot, to_body, to_world

FACE_FIRST = 1e-3
"""A face may be this much worse than the best direction, in units of the smaller piece, and is still taken: faces have
several contacts, which rest more firmly."""
ROUND_FIRST = 1e-5
"""The same where what looks at it is round."""
PARALLEL = 1e-6
"""Square of the sine below which edges count as parallel."""
BESIDE = 0.03
"""Square of the sine, that of 10 degrees, below which what is round lies along each other: nearest in one place, but at both
ends of the stretch that they share by a little farther only."""
AROUND = 16
"""Corners for the flat end of a cylinder or a cone."""
MOST = 32
"""Corners of a face that are looked at."""
ROOM = 80
"""Room for a face that has been clipped."""
LEANING = 1e-3
"""Sine of the angle between an end and a face above which the corners of the end begin with its lowest place."""
SPAN = 1 << 16
"""Numbers for the features of a pair of pieces."""
OTHER = 1 << 15
"""What is added where the face is that of the second piece."""


@outlined
def convex_contacts(k: Any, p: Any, i: Any, j: Any, s: Any, o: Any, margin: Any, code: Any) -> None:
    """Contacts of any two pieces s of body i and o of body j that are nearer than a margin."""
    found = on_stack(1, 9, np.float64)
    wide = roundness(s) + roundness(o)
    core = separation(p, s, o, margin + wide, found)
    if core - wide >= margin:
        return
    n = (found[0, 0], found[0, 1], found[0, 2])
    begin = k.number[0]
    if s.kind != SPHERE and o.kind != SPHERE:
        rounds = s.kind == CAPSULE or o.kind == CAPSULE
        slack = (ROUND_FIRST if rounds else FACE_FIRST) * min(p.fine[s.number], p.fine[o.number])
        best, which = core - slack, 0
        one, m_one = facing(p, s, (-n[0], -n[1], -n[2]))
        if one >= 0:
            apart = apart_along(p, s, o, (-m_one[0], -m_one[1], -m_one[2]))
            if apart >= best:
                # a collider may be far larger: of faces that are as good its own is taken
                best, which = apart + (slack if j != WORLD else -slack), 1
        two, m_two = facing(p, o, n)
        if two >= 0 and apart_along(p, s, o, m_two) >= best:
            which = 2
        if which == 1:
            face_contacts(k, p, i, j, s, o, one, m_one, margin, code, -1.0)
        elif which == 2:
            face_contacts(k, p, i, j, o, s, two, m_two, margin, code + OTHER, 1.0)
        elif along_each_other(k, p, i, j, s, o, n, margin, code):
            return
        else:
            begin += beside_each_other(k, i, j, s, o, margin, code)
    if k.number[0] == begin:
        # In the middle between both surfaces.
        gap = core - wide
        a = roundness(o) + 0.5 * gap
        at = (found[0, 6] + a * n[0], found[0, 7] + a * n[1], found[0, 8] + a * n[2])
        add_contact(k, i, j, code + 1, at, n, gap)


# ---- what looks along a direction


def end_faces(s: Any, d: Any) -> bool:
    """Whether it is a flat end of a cylinder or a cone that looks along a direction of its frame, rather than its side."""
    across = np.sqrt(d[0] * d[0] + d[1] * d[1])
    if s.kind == CYLINDER:
        return bool(abs(d[2]) > across)
    return bool(-d[2] * np.sqrt(s.size[0] ** 2 + s.size[1] ** 2) > s.size[1] * across + s.size[0] * d[2])


@outlined
def facing(p: Any, s: Any, d: Any) -> Any:
    """The flat side of a piece that looks along a direction: its number, −1 if there is none, and its normal."""
    a = to_body(s.r, d)
    if s.kind == BOX:
        x, y, z = abs(a[0]), abs(a[1]), abs(a[2])
        axis = 0 if x >= y and x >= z else (1 if y >= z else 2)
        n = (
            np.copysign(1.0, a[0]) if axis == 0 else 0.0,
            np.copysign(1.0, a[1]) if axis == 1 else 0.0,
            np.copysign(1.0, a[2]) if axis == 2 else 0.0,
        )
        return axis, to_world(s.r, n)
    if s.kind == HULL:
        best, face = -np.inf, 0
        for f in range(p.first_face[s.number], p.first_face[s.number + 1]):
            along = p.planes[0, f] * a[0] + p.planes[1, f] * a[1] + p.planes[2, f] * a[2]
            if along > best:
                best, face = along, f
        return face, to_world(s.r, (p.planes[0, face], p.planes[1, face], p.planes[2, face]))
    if (s.kind == CYLINDER or s.kind == CONE) and end_faces(s, a):
        return 0, to_world(s.r, (0.0, 0.0, np.copysign(1.0, a[2])))
    return -1, (0.0, 0.0, 0.0)


@outlined
def outline(p: Any, s: Any, d: Any, corners: Any) -> int:
    """The corners of what looks along a direction, counterclockwise from outside, in the world, and their numbers, into
    corners [4, ROOM]: a face, the ends of an edge, or a place. Returns how many there are."""
    a = to_body(s.r, d)
    if s.kind == HULL:
        face, _ = facing(p, s, d)
        first, number = p.loop[face], p.loop[face + 1] - p.loop[face]
        stride = (number + MOST - 1) // MOST
        count = 0
        for m in range(0, number, stride):
            c = p.loops[first + m]
            put(corners, count, corner(p, s, c), c - p.first_corner[s.number])
            count += 1
        return count
    if s.kind == BOX:
        axis, _ = facing(p, s, d)
        level = np.copysign(1.0, a[0] if axis == 0 else (a[1] if axis == 1 else a[2]))
        for m in range(4):
            u = 1.0 if m == 0 or m == 3 else -1.0
            v = level if m < 2 else -level
            # with the two other axes in turn, the corners go round counterclockwise
            x = level if axis == 0 else (v if axis == 1 else u)
            y = level if axis == 1 else (u if axis == 0 else v)
            z = level if axis == 2 else (v if axis == 0 else u)
            own = (x * s.size[0], y * s.size[1], z * s.size[2])
            name = (1 if x > 0 else 0) + (2 if y > 0 else 0) + (4 if z > 0 else 0)
            put(corners, m, in_world(s, own), name)
        return 4
    if s.kind == SPHERE:
        put(corners, 0, s.x, 0)
        return 1
    if s.kind == CAPSULE:
        put(corners, 0, in_world(s, (0.0, 0.0, s.size[1])), 0)
        put(corners, 1, in_world(s, (0.0, 0.0, -s.size[1])), 1)
        return 2
    across = np.sqrt(a[0] * a[0] + a[1] * a[1])
    c, e = (a[0] / across, a[1] / across) if across > 0 else (1.0, 0.0)
    low = -s.size[1] if s.kind == CYLINDER else -0.25 * s.size[1]
    high = s.size[1] if s.kind == CYLINDER else 0.75 * s.size[1]
    if end_faces(s, a):
        if across < LEANING * abs(a[2]):
            c, e = 1.0, 0.0
        side = np.copysign(1.0, a[2])
        for m in range(AROUND):
            turn = side * 2 * np.pi * m / AROUND
            u, v = np.cos(turn), np.sin(turn)
            own = (s.size[0] * (c * u - e * v), s.size[0] * (e * u + c * v), high if side > 0 else low)
            put(corners, m, in_world(s, own), m)
        return AROUND
    tip = s.size[0] if s.kind == CYLINDER else 0.0
    put(corners, 0, in_world(s, (tip * c, tip * e, high)), 0)
    put(corners, 1, in_world(s, (s.size[0] * c, s.size[0] * e, low)), 1)
    return 2


def put(corners: Any, number: Any, x: Any, name: Any) -> None:
    """Note a corner."""
    corners[0, number], corners[1, number], corners[2, number] = x
    corners[3, number] = float(name)


def in_world(s: Any, a: Any) -> Any:
    """A place in the frame of a piece."""
    b = to_world(s.r, a)
    return s.x[0] + b[0], s.x[1] + b[1], s.x[2] + b[2]


# ---- clipping


@outlined
def clip_by(given: Any, kept: Any, number: Any, n: Any, level: Any, side: Any) -> int:
    """Keep what of a polygon, or of a line of two corners, is on one side of a plane: n·x ≤ level. Returns how many corners
    are left."""
    left = 0
    last = number if number != 2 else 1
    if number == 1:
        last = 0
        if n[0] * given[0, 0] + n[1] * given[1, 0] + n[2] * given[2, 0] <= level:
            for row in range(4):
                kept[row, 0] = given[row, 0]
            left = 1
    for m in range(last):
        after = m + 1 if m + 1 < number else 0
        here = n[0] * given[0, m] + n[1] * given[1, m] + n[2] * given[2, m] - level
        there = n[0] * given[0, after] + n[1] * given[1, after] + n[2] * given[2, after] - level
        if here <= 0:
            for row in range(4):
                kept[row, left] = given[row, m]
            left += 1
        if (here < 0 and there > 0) or (here > 0 and there < 0):
            part = here / (here - there)
            for row in range(3):
                kept[row, left] = given[row, m] + part * (given[row, after] - given[row, m])
            low, high = min(given[3, m], given[3, after]), max(given[3, m], given[3, after])
            kept[3, left] = float(8192 + (int(low) * 29 + int(high) * 13 + side * 101 + 12) % 8191)
            left += 1
        if number == 2 and there <= 0:
            for row in range(4):
                kept[row, left] = given[row, after]
            left += 1
    return left


@outlined
def face_contacts(
    k: Any,
    p: Any,
    i: Any,
    j: Any,
    s: Any,
    o: Any,
    face: Any,
    n: Any,
    margin: Any,
    code: Any,
    sign: Any,
) -> None:
    """Contacts of a flat side of piece s, with the normal n, and what of piece o looks at it. The sign is 1 where s is of
    the second body, j, so that contacts have the normal n, and −1 where it is of the first."""
    sides = on_stack(4, ROOM, np.float64)
    one, two = on_stack(4, ROOM, np.float64), on_stack(4, ROOM, np.float64)
    around = outline(p, s, n, sides)
    number = outline(p, o, (-n[0], -n[1], -n[2]), one)
    origin = (sides[0, 0], sides[1, 0], sides[2, 0])
    for m in range(around):
        after = m + 1 if m + 1 < around else 0
        a = (sides[0, m], sides[1, m], sides[2, m])
        edge = (sides[0, after] - a[0], sides[1, after] - a[1], sides[2, after] - a[2])
        out = cross(edge, n)
        if m % 2 == 0:
            number = clip_by(one, two, number, out, dot(out, a), m)
        else:
            number = clip_by(two, one, number, out, dot(out, a), m)
    radius = roundness(o)
    level = dot(n, origin)
    for m in range(number):
        if around % 2 == 1:
            x, name = (two[0, m], two[1, m], two[2, m]), two[3, m]
        else:
            x, name = (one[0, m], one[1, m], one[2, m]), one[3, m]
        gap = dot(n, x) - level - radius
        if gap < margin:
            back = radius + 0.5 * gap
            at = (x[0] - back * n[0], x[1] - back * n[1], x[2] - back * n[2])
            add_contact(k, i, j, code + 2 + int(name), at, (sign * n[0], sign * n[1], sign * n[2]), gap)


@outlined
def along_each_other(k: Any, p: Any, i: Any, j: Any, s: Any, o: Any, n: Any, margin: Any, code: Any) -> bool:
    """Contacts at both ends of the stretch that two parallel edges share; whether they are parallel."""
    one, two = on_stack(4, ROOM, np.float64), on_stack(4, ROOM, np.float64)
    if outline(p, s, (-n[0], -n[1], -n[2]), one) != 2 or outline(p, o, n, two) != 2:
        return False
    a, c = (one[0, 0], one[1, 0], one[2, 0]), (two[0, 0], two[1, 0], two[2, 0])
    u = (one[0, 1] - a[0], one[1, 1] - a[1], one[2, 1] - a[2])
    w = (two[0, 1] - c[0], two[1, 1] - c[1], two[2, 1] - c[2])
    uu, ww, uw = dot(u, u), dot(w, w), dot(u, w)
    if not uu * ww - uw * uw <= PARALLEL * uu * ww:
        return False
    # The stretch of the first edge beside the second: parts s of its length.
    d = less(c, a)
    begin, end = dot(d, u) / uu, (dot(d, u) + uw) / uu
    low, high = max(min(begin, end), 0.0), min(max(begin, end), 1.0)
    if not low < high:
        return False
    wide = roundness(s) + roundness(o)
    for m in range(2):
        part = low if m == 0 else high
        x = (a[0] + part * u[0], a[1] + part * u[1], a[2] + part * u[2])
        along = dot(less(x, c), w) / ww
        y = (c[0] + along * w[0], c[1] + along * w[1], c[2] + along * w[2])
        gap = dot(n, less(x, y)) - wide
        if gap < margin:
            back = roundness(s) + 0.5 * gap
            at = (x[0] - back * n[0], x[1] - back * n[1], x[2] - back * n[2])
            add_contact(k, i, j, code + 2 + m, at, n, gap)
    return True


@outlined
def beside_each_other(k: Any, i: Any, j: Any, s: Any, o: Any, margin: Any, code: Any) -> int:
    """Contacts at both ends of the stretch that two round pieces share which are nearly parallel; returns how many there
    are."""
    begin = k.number[0]
    if (s.kind != CYLINDER and s.kind != CAPSULE) or (o.kind != CYLINDER and o.kind != CAPSULE):
        return 0
    u, w = to_world(s.r, (0.0, 0.0, s.size[1])), to_world(o.r, (0.0, 0.0, o.size[1]))
    uu, ww, uw = dot(u, u), dot(w, w), dot(u, w)
    if not uu * ww - uw * uw <= BESIDE * uu * ww:
        return 0
    # The stretch of the first axis beside the second: parts of its half.
    d = less(o.x, s.x)
    begins, ends = (dot(d, u) - uw) / uu, (dot(d, u) + uw) / uu
    low, high = max(min(begins, ends), -1.0), min(max(begins, ends), 1.0)
    for m in range(2 if low < high else 0):
        part = low if m == 0 else high
        x = (s.x[0] + part * u[0], s.x[1] + part * u[1], s.x[2] + part * u[2])
        along = max(min(dot(less(x, o.x), w) / ww, 1.0), -1.0)
        e = less(x, (o.x[0] + along * w[0], o.x[1] + along * w[1], o.x[2] + along * w[2]))
        distance = np.sqrt(dot(e, e))
        gap = distance - s.size[0] - o.size[0]
        if gap < margin and distance > 0:
            n, back = (e[0] / distance, e[1] / distance, e[2] / distance), s.size[0] + 0.5 * gap
            at = (x[0] - back * n[0], x[1] - back * n[1], x[2] - back * n[2])
            add_contact(k, i, j, code + 2 + m, at, n, gap)
    return int(k.number[0] - begin)
