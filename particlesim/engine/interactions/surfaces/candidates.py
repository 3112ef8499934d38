"""Which vertices may meet triangles, and which edges edges, until somebody has moved too far.

All threads look for simplices whose spheres overlap (`neighbours`); one then goes through them and keeps those vertices and
triangles, edges and edges whose boxes overlap. A box holds the way of the step that has just been done and is wider by the
radius and by half of the skin; so candidates are complete while no vertex has moved by more than that half from its place,
apart from a motion that all have in common. Of these, only pairs are kept whose distance is small enough, and they are not
looked at again before all relative motion since then, the *odometer*, could have brought them together.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.compiler.barrier import meet
from particlesim.engine.interactions.neighbours.record import FAR, GROUP, MOST, NO_ROOM, lives
from particlesim.engine.interactions.neighbours.refresh import Crew, Where, build
from particlesim.engine.interactions.surfaces.closest import Four, closest_points, relative_motion, widest
from particlesim.engine.interactions.surfaces.record import (
    BUILDS,
    DRIFT,
    EDGES,
    FASTEST,
    LOST,
    ODOMETER,
    REACH,
    SKIN,
    STALE,
    VERTICES,
)

STEPS = 10.0
"""Steps, at the present speed, for which candidates should hold."""
NARROWEST, WIDEST = 0.1, 0.5
"""Bounds of half of the skin, as parts of the length by which it is measured."""


@shared
def measure(s: Any, x: Any, before: Any, tune: Any) -> None:
    """How far particles have come in the step, beside what all have in common: half the diagonal of a box around all
    displacements, which no two differ by twice of."""
    fastest = 0.0
    for k in range(3):
        low, high = np.inf, -np.inf
        for j in range(s.rows.size):
            i = s.rows[j]
            way = float(x[k][i]) - float(before[k, i])
            low, high = min(low, way), max(high, way)
        fastest += 0.25 * (high - low) * (high - low)
        tune[DRIFT + k] = 0.5 * (low + high)
    tune[FASTEST] = np.sqrt(fastest)


@shared
def still_hold(s: Any, found: Any, x: Any, tune: Any) -> Any:
    """Whether candidates are complete for a step that ends at x."""
    half = 0.0
    for k in range(3):
        low, high = np.inf, -np.inf
        for j in range(s.rows.size):
            i = s.rows[j]
            way = float(x[k][i]) - found.base[k, i]
            low, high = min(low, way), max(high, way)
        half += 0.25 * (high - low) * (high - low)
    return half <= tune[SKIN] * tune[SKIN]


@shared
def surround(
    s: Any, found: Any, x: Any, r: Any, before: Any, clock: Any, t: Any, report: Any, tune: Any, roomy: Any
) -> None:
    """Boxes around all particles, edges and simplices on their way, and spheres around these."""
    reach = tune[REACH]
    skin = min(max(STEPS * tune[FASTEST], NARROWEST * reach), WIDEST * reach) if roomy else 0.0
    tune[SKIN] = skin
    for j in range(s.rows.size):
        i = s.rows[j]
        wide, there = float(r[i]) + skin, lives(clock, i, t)
        for k in range(3):
            now, then = float(x[k][i]), float(before[k, i]) + tune[DRIFT + k]
            found.base[k, i] = now
            found.around[i, k] = min(now, then) - wide if there else FAR
            found.around[i, 3 + k] = max(now, then) + wide if there else FAR
    for e in range(s.edges.shape[1]):
        i, j = s.edges[0, e], s.edges[1, e]
        for k in range(3):
            found.edge_boxes[e, k] = min(found.around[i, k], found.around[j, k])
            found.edge_boxes[e, 3 + k] = max(found.around[i, 3 + k], found.around[j, 3 + k])
    for q in range(s.corners.shape[1]):
        a, b, c = s.corners[0, q], s.corners[1, q], s.corners[2, q]
        wide, size = min(float(r[a]), float(r[b]), float(r[c])) + skin, 0.0
        for k in range(3):
            low = min(found.around[a, k], found.around[b, k], found.around[c, k])
            high = max(found.around[a, 3 + k], found.around[b, 3 + k], found.around[c, 3 + k])
            found.boxes[q, k], found.boxes[q, 3 + k] = low, high
            found.middle[k, q] = 0.5 * (low + high) if high < FAR else FAR
            half = (
                0.5 * (high - low) - wide
            )  # a sphere around the corners is widened by less than around the box
            size += half * half
        found.radius[q] = np.sqrt(size) + wide if found.boxes[q, 3] < FAR else 0.0
    report[BUILDS] += 1


def overlap(a: Any, i: Any, b: Any, j: Any) -> Any:
    """Whether box i of some and box j of others overlap."""
    return (
        (a[i, 0] <= b[j, 3])
        & (b[j, 0] <= a[i, 3])
        & (a[i, 1] <= b[j, 4])
        & (b[j, 1] <= a[i, 4])
        & (a[i, 2] <= b[j, 5])
        & (b[j, 2] <= a[i, 5])
    )


def _vertices_on(
    s: Any, found: Any, x: Any, r: Any, before: Any, p: Any, q: Any, report: Any, tune: Any
) -> None:
    """Keep the vertices of simplex p that may meet triangle q."""
    a, b, c = s.corners[0, q], s.corners[1, q], s.corners[2, q]
    for corner in range(3):
        i = s.vertices[corner, p]
        if (i >= 0) & (i != a) & (i != b) & (i != c):  # noqa: SIM102
            if overlap(found.around, i, found.boxes, q):
                far = way_to_go(True, x, r, before, i, a, b, c)
                n = report[VERTICES]
                if far > 2.0 * tune[SKIN]:
                    n = -1
                elif n < found.vertices.shape[1]:
                    found.vertices[0, n], found.vertices[1, n] = i, q
                    found.apart[n] = -1.0
                    report[VERTICES] = n + 1
                else:
                    report[LOST] = 1


def _edges_on(
    s: Any, found: Any, x: Any, r: Any, before: Any, p: Any, q: Any, report: Any, tune: Any
) -> None:
    """Keep the edges of simplex p that may meet edges of simplex q."""
    for one in range(3):
        e = s.sides[one, p]
        if e >= 0:  # noqa: SIM102
            if overlap(found.edge_boxes, e, found.boxes, q):
                i, j = s.edges[0, e], s.edges[1, e]
                for other in range(3):
                    f = s.sides[other, q]
                    if f >= 0:
                        k, m = s.edges[0, f], s.edges[1, f]
                        strange = (i != k) & (i != m) & (j != k) & (j != m)
                        if strange & overlap(found.edge_boxes, e, found.edge_boxes, f):
                            far = way_to_go(False, x, r, before, i, j, k, m)
                            n = report[EDGES]
                            if far > 2.0 * tune[SKIN]:
                                n = -1
                            elif n < found.edges.shape[1]:
                                found.edges[0, n], found.edges[1, n] = e, f
                                found.between[n] = -1.0
                                report[EDGES] = n + 1
                            else:
                                report[LOST] = 1


def way_to_go(face: Any, x: Any, r: Any, before: Any, i: Any, j: Any, k: Any, m: Any) -> Any:
    """How far a pair is from touching at the end of the step, at least [m]."""
    f = Four(i, j, k, m)
    now = closest_points(face, x, before, i, j, k, m, 0.0)
    return now.distance - relative_motion(face, x, before, f) - widest(face, r, f)


@shared
def pair_up(s: Any, found: Any, x: Any, r: Any, before: Any, report: Any, tune: Any) -> None:
    """Go through simplices that are near each other, each pair once."""
    near = found.near
    tune[ODOMETER] = 0.0
    report[VERTICES] = report[EDGES] = report[LOST] = 0
    for g in range(near.begin.size):
        if near.count[g] == NO_ROOM:
            report[LOST] = 1
        else:
            first, last = near.begin[g], near.begin[g] + near.count[g]
            for place in range(GROUP * g, GROUP * g + GROUP):
                p = near.order[place]
                if p >= 0:
                    for k in range(first, last):
                        q = near.order[near.candidates[k] & (MOST - 1)]
                        if p < q:  # noqa: SIM102
                            if overlap(found.boxes, p, found.boxes, q):
                                if s.face[q]:
                                    _vertices_on(s, found, x, r, before, p, q, report, tune)
                                if s.face[p]:
                                    _vertices_on(s, found, x, r, before, q, p, report, tune)
                                _edges_on(s, found, x, r, before, p, q, report, tune)


def find(each: Any, c: Any, before: Any, share: Any, t: Any) -> None:
    """Candidates for the step that has just been done; all threads of an island must call it."""
    s, found, report, tune = each.simplices, each.found, each.report, each.tune
    x = (c.x, c.y, c.z)
    if share.number == 0:
        measure(s, x, before, tune)
        if not still_hold(s, found, x, tune):
            report[STALE] = 1
    meet(share.gate, share.threads)
    if report[STALE] != 0:
        find_anew(each, c, before, Crew(share.number, share.threads, share.gate), t)


def find_again(each: Any, c: Any, before: Any, gate: Any, t: Any) -> None:
    """Candidates after corrections, by one thread, if these have led further than candidates are known."""
    s, found, tune = each.simplices, each.found, each.tune
    x = (c.x, c.y, c.z)
    measure(s, x, before, tune)
    if not still_hold(s, found, x, tune):
        find_anew(each, c, before, Crew(0, 1, gate), t)


@outlined
def find_anew(each: Any, c: Any, before: Any, crew: Any, t: Any) -> None:
    """Candidates of the present step; with a narrower skin if there was no room."""
    s, found, report, tune = each.simplices, each.found, each.report, each.tune
    x = (c.x, c.y, c.z)
    for turn in range(2):
        if crew.number == 0:
            surround(s, found, x, c.r, before, c.clock, t, report, tune, turn == 0)
        meet(crew.gate, crew.threads)
        where = Where(found.middle[0], found.middle[1], found.middle[2], found.radius, None)
        build(found.near, where, crew, t)
        meet(crew.gate, crew.threads)
        if crew.number == 0:
            pair_up(s, found, x, c.r, before, report, tune)
            report[STALE] = 0
        meet(crew.gate, crew.threads)
        if report[LOST] == 0:
            break
