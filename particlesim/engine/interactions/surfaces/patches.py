"""Edges and triangles at colliders: what lies between particles stays out, too.

Corners have met their colliders as particles before. Between them an edge or a triangle can get deeper only where a
collider bulges or is thin, so planes and containers without dents are left out. For each of the others near a patch, the
first time of the step is found at which its deepest point is nearer than `CLOSE` of its thickness, by conservative
advancement in the frame of the collider. That point, x = Σ w_k x_k with Σ w_k = 1, then gets the contact n·x ≥ n·x_s of a
particle with a collider: no impact where it ends above, else with the restitution and friction of the collider. Points next
to a corner, up to half of the thickness, are left to the corner, and those next to an edge to the edge; and so is what lies
on a flat side. A patch is a quarter thinner than its corners, so that on what bulges little, such as a ball much larger than
it, the corners carry all: that they do is known from the planes through what is nearest to them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord, frame_at, out_of, ride
from particlesim.colliders.response import bounce_at
from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.walls import colliders_of, whole
from particlesim.engine.interactions.surfaces.deepest import (
    Patch,
    at_point,
    deepest,
    is_convex,
    lowest_on_edge,
    own_shape,
    point_on,
    size_of,
)
from particlesim.engine.interactions.surfaces.record import CONTACTS, LOST
from particlesim.engine.interactions.surfaces.response import (
    CALM,
    CORE,
    GENTLY,
    KINETIC,
    LOSS,
    PUSH,
    REBOUND,
    REST,
    STATIC,
)
from particlesim.engine.interactions.surfaces.walls import carried_by, velocity_of
from particlesim.engine.state.columns import fetch, type_of
from particlesim.laws.registry import PASS, bend, gap_and_normal, sure_gap

THINNER = 0.75
"""The thickness of a patch over that of its corners."""
CLOSE = 0.25
"""Gap over the thickness of a patch at which it gets a contact."""
KEPT = 0.3
"""Gap over the thickness up to which is found out how near a patch is to what is not convex, to know it for later steps."""
MOST_ADVANCES = 40
"""Bound on the advances of a search; what is not through then has a contact where it is."""
FLAT = 1e-2
"""By which part of its thickness a point must be deeper than if its corners lay on a flat side, to be no
matter of theirs."""


def bulges(collider: Any) -> Any:
    """Whether what lies between legal places may be inside of a collider."""
    return bend(own_shape(collider.shape)) >= 0


def has_bulges(parts: Any) -> Any:
    """Whether any group has such a collider."""
    return any(any(bulges(collider) for collider in colliders_of(part)) for part in parts)


def add_patches(each: Any, parts: Any, c: Any, before: Any, t: Any, h: Any, again: Any) -> Any:
    """Contacts of edges and triangles with colliders; returns how fast forces make them approach at most [m/s], and how many
    there are. With `again` only of those that would come too close in spite of the contacts that they have."""
    most, number, rough = 0.0, each.report[CONTACTS], 0
    for part in parts:
        for collider in colliders_of(part):
            if bulges(collider):
                found = _add_beside(each, collider, rough, c, before, t, h, part.first, part.last, again)
                most = max(most, found)
                rough += 0 if is_convex(own_shape(collider.shape)) else 1
    return most, each.report[CONTACTS] - number


@outlined
def _add_beside(
    each: Any,
    collider: Any,
    k: Any,
    c: Any,
    before: Any,
    t: Any,
    h: Any,
    first: Any,
    last: Any,
    again: Any,
) -> Any:
    """`add_patches` for the particles of a group and a collider, the k-th that is not convex if it is not."""
    most, s, at, shape = 0.0, each.simplices, each.beside.at, own_shape(collider.shape)
    hard = (collider.response.outcome == PASS) & (collider.response.yielding is None)
    if hard & (last > first):
        reach = lay_beside(each, collider.shape, c, before, t, h, first, last)
        if reach < 0:
            note_gaps(at, shape, c, t, first, last)
            for e in range(s.edges.shape[1]):
                i, j = s.edges[0, e], s.edges[1, e]
                near = (first <= i) & (i < last) & (i != j)
                if near and not is_convex(shape) and not again:
                    follow(each.beside, k, e, i, j, j)
                if near and comes_near(each.beside, shape, c.r, k, e, i, j, j):
                    most = max(most, _meet(each, collider, False, k, e, i, j, j, c, before, t, h, again))
            for q in range(s.corners.shape[1]):
                e, i, j, m = s.edges.shape[1] + q, s.corners[0, q], s.corners[1, q], s.corners[2, q]
                near = (s.face[q] != 0) & (first <= i) & (i < last)
                if near and not is_convex(shape) and not again:
                    follow(each.beside, k, e, i, j, m)
                if near and comes_near(each.beside, shape, c.r, k, e, i, j, m):
                    most = max(most, _meet(each, collider, True, k, e, i, j, m, c, before, t, h, again))
            if not is_convex(shape) and not again:
                for i in range(first, last):
                    for axis in range(3):
                        each.beside.last[k, axis, i] = at[axis, i]
    return most


def follow(beside: Any, k: Any, e: Any, i: Any, j: Any, m: Any) -> None:
    """What no gap of patch e to a collider is below at the beginning of the step, from what that was a step before."""
    most = 0.0
    for p in (i, j, m):
        x, y, z = (beside.at[axis, p] - beside.last[k, axis, p] for axis in range(3))
        most = max(most, x * x + y * y + z * z)
    beside.clear[k, e] -= np.sqrt(most)


def lay_beside(each: Any, shape: Any, c: Any, before: Any, t: Any, h: Any, first: Any, last: Any) -> Any:
    """Write down where particles [first, last) are in the frame of a collider at the beginning and at the end of the step;
    returns the gap of a ball around all of that [m]."""
    at, thick = each.beside.at, 0.0
    for i in range(first, last):
        there = fetch(c, i, t)
        zero = there.x - there.x
        come = at_point((before[0, i], before[1, i], before[2, i], zero), zero, t - h)
        gone = at_point((there.x, there.y, there.z, zero), zero, t)
        if isinstance(shape, MovingRecord):
            come, gone = ride(shape, come), ride(shape, gone)
        at[0, i], at[1, i], at[2, i] = come.x, come.y, come.z
        at[3, i], at[4, i], at[5, i] = gone.x, gone.y, gone.z
        thick = max(thick, float(c.r[i]))
    (x, dx), (y, dy), (z, dz) = (extent(at, axis, first, last) for axis in range(3))
    ball = at_point((x, y, z, np.sqrt(dx * dx + dy * dy + dz * dz) + thick), c.x[first], t)
    return float(sure_gap(own_shape(shape), ball))


def note_gaps(at: Any, shape: Any, c: Any, t: Any, first: Any, last: Any) -> None:
    """Write down the gaps of particles at the beginning of the step, and beside a convex shape its normals there."""
    for i in range(first, last):
        like, place = c.x[i], (at[0, i], at[1, i], at[2, i], float(c.r[i]))
        if is_convex(shape):
            g, axes = gap_and_normal(shape, at_point(place, like, t))
            at[6, i] = g
            at[7, i], at[8, i], at[9, i] = whole(axes, g)
        else:
            at[6, i] = sure_gap(shape, at_point(place, like, t))


def comes_near(beside: Any, shape: Any, r: Any, n: Any, e: Any, i: Any, j: Any, k: Any) -> Any:
    """Whether a patch may touch in the step: no gap in it is less than in the plane through what is nearest to a corner, or,
    where a shape is not convex, than by the distance from a corner."""
    at, low, thin = beside.at, -np.inf, min(float(r[i]), float(r[j]), float(r[k]))
    for p in (i, j, k):
        least = 0.0
        for q in (i, j, k):
            x, y, z = at[0, q] - at[0, p], at[1, q] - at[1, p], at[2, q] - at[2, p]
            less = float(r[p]) - float(r[q])
            if is_convex(shape):
                least = min(least, at[7, p] * x + at[8, p] * y + at[9, p] * z + less)
            else:
                least = min(least, less - np.sqrt(x * x + y * y + z * z))
        low = max(low, at[6, p] + least)
    low += (1.0 - THINNER) * thin
    if not is_convex(shape):
        low = max(low, beside.clear[n, e])
    return low < farthest_way(at, i, j, k)


def extent(at: Any, axis: Any, first: Any, last: Any) -> Any:
    """The middle and half of the length of what particles [first, last) cover along an axis [m]."""
    low, high = np.inf, -np.inf
    for i in range(first, last):
        low, high = min(low, at[axis, i], at[3 + axis, i]), max(high, at[axis, i], at[3 + axis, i])
    return 0.5 * (low + high), 0.5 * (high - low)


def patch_at(at: Any, r: Any, i: Any, j: Any, k: Any, s: Any) -> Patch:
    """The patch of three particles after the part s of the step."""
    a, b, d = (tuple(at[m, q] + s * (at[3 + m, q] - at[m, q]) for m in range(3)) for q in (i, j, k))
    return Patch(a, b, d, THINNER * float(r[i]), THINNER * float(r[j]), THINNER * float(r[k]))


def farthest_way(at: Any, i: Any, j: Any, k: Any) -> Any:
    """How far the corners of a patch go in the step at most [m]."""
    most = 0.0
    for q in (i, j, k):
        d = (at[3, q] - at[0, q]) ** 2 + (at[4, q] - at[1, q]) ** 2 + (at[5, q] - at[2, q]) ** 2
        most = max(most, d)
    return np.sqrt(most)


def inside(face: Any, patch: Patch, thick: Any) -> Any:
    """Up to which part of the way to its corners a patch is more than half of its thickness away from its border; 0 where it
    is not at all."""
    a, b, d = patch.a, patch.b, patch.c
    u, v = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (d[0] - a[0], d[1] - a[1], d[2] - a[2])
    length = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    if not face:
        return max(1.0 - thick / length, 0.0) if length > 0 else 0.0
    x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    twice = np.sqrt(x * x + y * y + z * z)
    other = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    last = np.sqrt((v[0] - u[0]) ** 2 + (v[1] - u[1]) ** 2 + (v[2] - u[2]) ** 2)
    # heights over the three sides, from the middle at a third of which the patch shrinks
    height = twice / max(length, other, last) if max(length, other, last) > 0 else 0.0
    return max(1.0 - 1.5 * thick / height, 0.0) if height > 0 else 0.0


@outlined
def _meet(
    each: Any,
    collider: Any,
    face: Any,
    n: Any,
    e: Any,
    i: Any,
    j: Any,
    k: Any,
    c: Any,
    before: Any,
    t: Any,
    h: Any,
    again: Any,
) -> Any:
    """`add_patches` for patch e, an edge or a triangle, and a collider, the n-th of those that are not convex."""
    desk, at, shape, like = each.desk, each.beside.at, own_shape(collider.shape), c.x[i]
    lightest = min(desk.inverse[i], desk.inverse[j], desk.inverse[k])
    heaviest = max(desk.inverse[i], desk.inverse[j], desk.inverse[k])
    result = 0.0
    if (lightest >= 0) & (heaviest > 0):
        patch, way = patch_at(at, c.r, i, j, k, 0.0), farthest_way(at, i, j, k)
        thick = max(patch.ra, patch.rb, patch.rc)
        deep = (1.0 - CORE) * thick if again else 0.0
        inner = inside(face, patch, thick)
        if (inner > 0) & (thick > 0):
            beyond = way - deep  # what is farther away cannot come there in the step
            if not is_convex(shape):
                beyond += KEPT * thick
            found = deepest(face, shape, patch, inner, beyond, thick, like, t)
            if not is_convex(shape):
                each.beside.clear[n, e] = found.safe
            s, going, turn, began, goal = 0.0, True, 0, found.gap, -deep
            if again:
                goal = min(goal, 0.5 * (began - thick))
                going = began > -thick
            close = goal + CLOSE * thick
            if again:  # what has begun closer than that is not nearer for that
                close = min(close, 0.5 * (goal + began))
            while going & (found.gap > close) & (turn < MOST_ADVANCES):
                going = found.safe - way * (1.0 - s) < goal
                if going:
                    s = min(s + (found.safe - 0.5 * (goal + close)) / way, 1.0)
                    patch = patch_at(at, c.r, i, j, k, s)
                    found = deepest(face, shape, patch, inner, beyond, thick, like, t)
                    going = (s < 1.0) | (found.gap <= close)
                    turn += 1
            if going & (found.safe - way * (1.0 - s) < goal):
                if face or not is_convex(shape):
                    result = _note(
                        each, collider, patch, found.v, found.w, s, began, i, j, k, c, before, t, h
                    )
                else:  # both ends of what lies on it, as one spot would be the other in each step
                    v, first, last = lowest_on_edge(shape, patch, inner, FLAT * thick, like, t)
                    if (last - first) * size_of(patch, 0.5, 0.0) > 0.5 * thick:
                        v = last
                        result = _note(each, collider, patch, first, 0.0, s, began, i, j, k, c, before, t, h)
                    more = _note(each, collider, patch, v, 0.0, s, began, i, j, k, c, before, t, h)
                    result = max(result, more)
    return result


def _note(
    each: Any,
    collider: Any,
    patch: Any,
    v: Any,
    w: Any,
    s: Any,
    began: Any,
    i: Any,
    j: Any,
    k: Any,
    c: Any,
    before: Any,
    t: Any,
    h: Any,
) -> Any:
    """Write down the contact of a patch with a collider that begins after the part s of the step, unless its corners keep it
    out; `began` is its least gap at the beginning of the step [m]."""
    touches, report, response, number = each.touches, each.report, collider.response, each.report[CONTACTS]
    shape, u, like = own_shape(collider.shape), 1.0 - v - w, c.x[i]
    heights = tuple(
        float(sure_gap(shape, at_point((*x, r), like, t)))
        for x, r in ((patch.a, patch.ra), (patch.b, patch.rb), (patch.c, patch.rc))
    )
    x = point_on(patch, v, w)
    if (
        float(sure_gap(shape, at_point(x, like, t)))
        > u * heights[0] + v * heights[1] + w * heights[2] - FLAT * x[3]
    ):
        return 0.0
    if number >= touches.rows.shape[1]:
        report[LOST] = max(report[LOST], 1)
        return 0.0
    g, axes = gap_and_normal(shape, at_point(x, like, t))
    n, place = whole(axes, g), (type_of(g, x[0]), type_of(g, x[1]), type_of(g, x[2]))
    if isinstance(collider.shape, MovingRecord):
        frame, moved = frame_at(collider.shape, t, like), collider.shape
        n = out_of(frame.rows, n)
        place = out_of(frame.rows, (place[0] - moved.x, place[1] - moved.y, place[2] - moved.z))
        place = place[0] + frame.x, place[1] + frame.y, place[2] + frame.z
    here = at_point((*place, 0.0), like, t)
    drift, carried = velocity_of(collider, here, n), carried_by(collider.shape, here, h)
    goal = min(began + GENTLY * x[3], 0.0) - float(g)
    for corner, (row, weight) in enumerate(((i, u), (j, v), (k, w), (i, 0.0))):
        touches.rows[corner, number], touches.weights[corner, number] = row, weight
        each.desk.mark[row] |= 1
    now = then = 0.0
    for axis, (column, speeds) in enumerate(((c.x, c.vx), (c.y, c.vy), (c.z, c.vz))):
        way = speed = past = 0.0
        for row, weight in ((i, u), (j, v), (k, w)):
            way += weight * (float(column[row]) - float(before[axis, row]))
            speed += weight * float(speeds[row])
            past += weight * float(before[3 + axis, row])
        normal, belt = float(n[axis]), float(drift[axis])
        touches.normal[axis, number] = normal
        touches.drift[axis, number] = belt
        touches.rubbed[axis, number], touches.carried[axis, number] = 0.0, float(carried[axis])
        touches.shift[axis, number] = s * way + (1.0 - s) * belt * float(h)
        goal += normal * float(place[axis])
        now += normal * (speed - belt)
        then += normal * (past - belt)
    touches.normal[3, number] = goal
    change, faster = abs(now - then), (now < 0) & (now < then)
    approach = type_of(like, min(now, 0.0))
    bounces = float(bounce_at(response, approach)) - 1.0
    friction = response.friction
    touches.bound[STATIC, number] = 0.0 if friction is None else float(friction.static)
    touches.bound[KINETIC, number] = 0.0 if friction is None else float(friction.kinetic)
    touches.bound[REBOUND, number] = bounces * (max(-then, 0.0) / -now if faster else 1.0)
    touches.bound[CALM, number] = REST * change
    touches.bound[LOSS, number] = float(response.loss)
    touches.bound[PUSH, number] = 0.0
    report[CONTACTS] = number + 1
    return change
