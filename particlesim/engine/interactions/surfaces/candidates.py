"""Candidates of contact: pairs of a vertex and a triangle, or of two edges, which hold until a vertex leaves its course.

All threads look for simplices whose spheres overlap (`neighbours`); one then goes through them and keeps pairs whose boxes
overlap. The *course* of a vertex is its displacement in the last step and the continuation of that over some steps. A box
holds courses, and is wider by the radius and by half of the skin; so candidates are complete while no vertex has left its
course by more than that half, apart from a motion that all have in common. Of these only pairs are kept that can meet before
candidates are found anew.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.neighbours.record import FAR, GROUP, MOST, NO_ROOM, lives
from particlesim.engine.interactions.neighbours.refresh import Crew, Where, build
from particlesim.engine.interactions.surfaces.closest import Four
from particlesim.engine.interactions.surfaces.record import (
    AGE,
    ANEW,
    BUILDS,
    COURSE,
    CROWDED,
    DRIFT,
    EDGES,
    EFFORT,
    FACES,
    FASTEST,
    HORIZON,
    LOST,
    REACH,
    SKIN,
    STALE,
    TURNED,
    WAY,
)
from particlesim.engine.interactions.surfaces.sieve import AT_ONCE, choose_near

STEPS = 32.0
"""Steps for which candidates should hold."""
NARROWEST, WIDEST = 0.1, 0.25
"""Bounds of half of the skin, as parts of the length by which it is measured."""
LONGEST = 0.5
"""Bound on the way that particles typically go while candidates hold, likewise."""


@shared
def measure(s: Any, found: Any, x: Any, before: Any, report: Any, tune: Any) -> None:
    """The displacements of particles in the step, their change since the step before, and their deviations from the course,
    each without what all have in common: half the diagonal of a box around all values, twice of which bounds the difference
    of any two. Candidates are stale where the deviations are too large."""
    age = float(report[AGE])
    way, turn, off = 0.0, 0.0, 0.0
    for k in range(3):
        low_way = low_turn = low_off = np.inf
        high_way = high_turn = high_off = -np.inf
        for j in range(s.rows.size):
            i = s.rows[j]
            d = float(x[k][i]) - float(before[k, i])
            a = d - found.last[k, i]
            e = float(x[k][i]) - found.base[k, i] - age * found.way[k, i]
            found.last[k, i] = d
            low_way, high_way = min(low_way, d), max(high_way, d)
            low_turn, high_turn = min(low_turn, a), max(high_turn, a)
            low_off, high_off = min(low_off, e), max(high_off, e)
        way += (high_way - low_way) * (high_way - low_way)
        turn += (high_turn - low_turn) * (high_turn - low_turn)
        off += (high_off - low_off) * (high_off - low_off)
        tune[DRIFT + k] = 0.5 * (low_way + high_way)
    tune[FASTEST], tune[TURNED] = 0.5 * np.sqrt(way), 0.5 * np.sqrt(turn)
    tune[COURSE] += 2.0 * tune[TURNED]
    if (not 0.25 * off <= tune[SKIN] * tune[SKIN]) | (age > tune[HORIZON]):
        report[STALE] = 1


@shared
def look_ahead(s: Any, x: Any, before: Any, h: Any, tune: Any) -> None:
    """For how many steps candidates are to hold, and how far particles may leave their course until then: as far as they do
    if they go on to turn as in this step."""
    reach, typical, turn = tune[REACH], 0.0, 0.0
    for k in range(3):
        low, high = np.inf, -np.inf
        for j in range(s.rows.size):
            i = s.rows[j]
            d = float(x[k][i]) - float(before[k, i])
            typical += (d - tune[DRIFT + k]) * (d - tune[DRIFT + k])
            a = d - float(h) * float(before[3 + k, i])
            low, high = min(low, a), max(high, a)
        turn += 0.25 * (high - low) * (high - low)
    typical, turn, steps, most = np.sqrt(typical / s.rows.size), np.sqrt(turn), STEPS, WIDEST * reach
    if typical * steps > LONGEST * reach:
        steps = LONGEST * reach / typical
    if min(turn * steps, tune[FASTEST]) * steps > most:
        steps = max(np.sqrt(most / turn), most / tune[FASTEST])
    tune[HORIZON] = float(int(steps))
    tune[SKIN] = min(max(min(turn * steps, tune[FASTEST]) * steps, NARROWEST * reach), most)


@shared
def surround(s: Any, found: Any, x: Any, r: Any, before: Any, clock: Any, t: Any, tune: Any) -> None:
    """Boxes around all particles, edges and simplices on their course, and spheres around these."""
    skin, ahead = tune[SKIN], tune[HORIZON]
    for j in range(s.rows.size):
        i = s.rows[j]
        wide, there = float(r[i]) + skin, lives(clock, i, t)
        for k in range(3):
            now = float(x[k][i])
            found.base[k, i] = now
            found.way[k, i] = now - float(before[k, i])
            way = found.way[k, i] - tune[DRIFT + k]
            found.around[i, k] = now + min(-way, ahead * way) - wide if there else FAR
            found.around[i, 3 + k] = now + max(-way, ahead * way) + wide if there else FAR
    for e in range(s.edges.shape[1]):
        i, j = s.edges[0, e], s.edges[1, e]
        for k in range(3):
            found.edge_boxes[e, k] = min(found.around[i, k], found.around[j, k])
            found.edge_boxes[e, 3 + k] = max(found.around[i, 3 + k], found.around[j, 3 + k])
    for q in range(s.corners.shape[1]):
        a, b, c = s.corners[0, q], s.corners[1, q], s.corners[2, q]
        # a sphere around the corners is widened by less than one around the box
        wide, size = min(float(r[a]), float(r[b]), float(r[c])) + skin, 0.0
        for k in range(3):
            low = min(found.around[a, k], found.around[b, k], found.around[c, k])
            high = max(found.around[a, 3 + k], found.around[b, 3 + k], found.around[c, 3 + k])
            found.boxes[q, k], found.boxes[q, 3 + k] = low, high
            found.middle[k, q] = 0.5 * (low + high) if high < FAR else FAR
            half = 0.5 * (high - low) - wide
            size += half * half
        found.radius[q] = np.sqrt(size) + wide if found.boxes[q, 3] < FAR else 0.0


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


class Finder(NamedTuple):
    """What is needed to go through pairs of simplices."""

    s: Any
    found: Any
    x: Any
    r: Any
    before: Any
    report: Any
    tune: Any


def _vertices_on(each: Any, p: Any, q: Any) -> None:
    """Write down the vertices of simplex p that may meet triangle q."""
    s, found = each.s, each.found
    a, b, c = s.corners[0, q], s.corners[1, q], s.corners[2, q]
    for corner in range(3):
        i = s.vertices[corner, p]
        if (i >= 0) & (i != a) & (i != b) & (i != c):  # noqa: SIM102
            if overlap(found.around, i, found.boxes, q):
                _write(found.faces, each.report, FACES, i, q, Four(i, a, b, c))


def _edges_on(each: Any, p: Any, q: Any) -> None:
    """Write down the edges of simplex p that may meet edges of simplex q."""
    s, found = each.s, each.found
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
                            _write(found.edges, each.report, EDGES, e, f, Four(i, j, k, m))


def _write(pairs: Any, report: Any, sort: Any, one: Any, other: Any, f: Any) -> None:
    """Append a pair, if there is room."""
    n = report[sort]
    if n < pairs.until.size:
        pairs.of[0, n], pairs.of[1, n] = one, other
        pairs.rows[0, n], pairs.rows[1, n], pairs.rows[2, n], pairs.rows[3, n] = f.i, f.j, f.k, f.m
        report[sort] = n + 1
    else:
        report[LOST] = max(report[LOST], 1)


def _choose(each: Any, face: Any, kept: Any, most: Any) -> Any:
    """Keep those of the pairs from number `kept` on that may meet, where there are more than `most`; returns how many have
    been looked at."""
    sort, pairs = (FACES, each.found.faces) if face else (EDGES, each.found.edges)
    if each.report[sort] - kept > most:
        kept = choose_near(
            face, pairs, kept, each.report[sort], each.x, each.r, each.before, each.report, each.tune
        )
        each.report[sort] = kept
    return kept


@shared
def pair_up(s: Any, found: Any, x: Any, r: Any, before: Any, report: Any, tune: Any) -> None:
    """Go through simplices that are near each other, each pair once."""
    near, each = found.near, Finder(s, found, x, r, before, report, tune)
    tune[WAY] = tune[COURSE] = 0.0
    report[FACES] = report[EDGES] = report[AGE] = report[STALE] = faces = edges = 0
    report[BUILDS] += 1
    for g in range(near.begin.size):
        if near.count[g] == NO_ROOM:
            report[LOST] = CROWDED
        else:
            first, last = near.begin[g], near.begin[g] + near.count[g]
            report[EFFORT] += GROUP * near.count[g]
            for place in range(GROUP * g, GROUP * g + GROUP):
                p = near.order[place]
                if p >= 0:
                    for k in range(first, last):
                        q = near.order[near.candidates[k] & (MOST - 1)]
                        if p < q:  # noqa: SIM102
                            if overlap(found.boxes, p, found.boxes, q):
                                if s.face[q]:
                                    _vertices_on(each, p, q)
                                if s.face[p]:
                                    _vertices_on(each, q, p)
                                _edges_on(each, p, q)
                                faces = _choose(each, True, faces, AT_ONCE - 6)
                                edges = _choose(each, False, edges, AT_ONCE - 9)
    _choose(each, True, faces, 0)
    _choose(each, False, edges, 0)


def find(each: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
    """Candidates for the step that has just been done; all threads of an island must call it."""
    report, tune = each.report, each.tune
    if share.number == 0:
        report[AGE] += 1
        tune[WAY] += tune[COURSE]
        measure(each.simplices, each.found, (c.x, c.y, c.z), before, report, tune)
        report[ANEW] = report[STALE]
    meet(share.gate, share.threads)
    # not STALE: the first thread may be further on, and have changed that, before another has looked
    if report[ANEW] != 0:
        find_anew(each, c, before, Crew(share.number, share.threads, share.gate), t, h)


def find_again(each: Any, c: Any, before: Any, gate: Any, t: Any, h: Any) -> None:
    """Candidates after corrections, by one thread, if these have led further than candidates are known."""
    measure(each.simplices, each.found, (c.x, c.y, c.z), before, each.report, each.tune)
    if each.report[STALE] != 0:
        find_anew(each, c, before, Crew(0, 1, gate), t, h)


@outlined
def find_anew(each: Any, c: Any, before: Any, crew: Any, t: Any, h: Any) -> None:
    """Candidates of the present step and some more."""
    s, found, report, tune = each.simplices, each.found, each.report, each.tune
    x = (c.x, c.y, c.z)
    if crew.number == 0:
        look_ahead(s, x, before, h, tune)
        surround(s, found, x, c.r, before, c.clock, t, tune)
    meet(crew.gate, crew.threads)
    where = Where(found.middle[0], found.middle[1], found.middle[2], found.radius, None)
    build(found.near, where, crew, t)
    meet(crew.gate, crew.threads)
    if crew.number == 0:
        pair_up(s, found, x, c.r, before, report, tune)
    meet(crew.gate, crew.threads)
