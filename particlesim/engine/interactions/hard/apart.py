"""Displacements that make overlaps of hard grains smaller, and leave velocities as they are (`impulses`).

Overlaps are halved some times, by displacements in inverse proportion to the masses. A step makes an overlap smaller by at
most a part of the smaller radius, so that particles that overlap at the start do not fly apart; what the step has added to
it goes whole. A slack is left, by which what rests on each other is found in the next step, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import (
    FIRST,
    FOUND,
    GIVEN,
    LEFT,
    NUMBER,
    RATE,
    SCALE,
    SECOND,
    STANDS,
    root,
)
from particlesim.engine.interactions.hard.bench import COUNT, KEPT, PAIRED
from particlesim.engine.interactions.hard.memory import way_by
from particlesim.engine.interactions.touching import line_between
from particlesim.engine.state.columns import let_know, type_of

DONE = -1.0
"""In place of what a pair has been given: that it has been moved apart."""
SLACK, ROUGHLY = 1e-4, 1e-3
"""Overlap, as a part of the smaller radius, that contacts at rest keep; how exactly displacements are found at once."""
TURNS_APART, MUCH, FAR = (4, 20, 100), (0.005, 0.02), 0.1
"""Turns in which overlaps are made smaller, at least, and up to which they go on while some move by much, and by more than
that; the parts of the smaller radius that are much [2], and above which particles may come into colliders that they were not
near."""


@outlined
def move_on(each: Any, c: Any, h: Any) -> None:
    """Displace all particles in pairs as impulses do that act in the step as forces do, in its middle for most methods: what
    rests does not sink by the fall of a step, and angular momentum and energy are kept."""
    mark, s = each.bench.mark, each.bench.start
    for i in range(mark.size):
        if (mark[i] & PAIRED) != 0:
            dx, dy, dz = float(c.vx[i]) - s[0, i], float(c.vy[i]) - s[1, i], float(c.vz[i]) - s[2, i]
            speed = np.sqrt(dx * dx + dy * dy + dz * dz)
            if speed > 0:
                way = way_by(each.bench, c, i, speed, h)
                c.x[i] += type_of(c.x[i], way * dx)
                c.y[i] += type_of(c.y[i], way * dy)
                c.z[i] += type_of(c.z[i], way * dz)
                let_know(c.memory, i, dx, dy, dz)


def moves_apart(turn: Any, most: Any) -> bool:
    """Whether there is another turn after so many, the last of which has moved none by more than `most`, a part of the
    smaller radius."""
    least, some, many = TURNS_APART
    return bool((turn < least) | ((turn < some) & (most > MUCH[0])) | ((turn < many) & (most > MUCH[1])))


@outlined
def move_apart(each: Any, c: Any, turn: Any) -> float:
    """Make overlaps smaller by a half of what is to go of them in the step; returns how much that was at most, as a part of
    the smaller radius. After some turns only in what stands on something: what flies comes apart by itself, and to be moved
    changes its angular momentum."""
    bench, r, most, cluster = each.bench, c.r, 0.0, each.bench.desk.cluster
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        wi, wj = each.a[i], each.a[j]
        if (turn >= TURNS_APART[1]) and cluster[STANDS, root(cluster, i if wi > 0 else j)] == 0:
            continue
        both = wi + wj
        x, y, z, apart = line_between(c, i, j, bench.shift, k)
        least = min(r[i], r[j])
        overlap = r[i] + r[j] - apart - max(bench.normal[KEPT, k], type_of(apart, SLACK) * least)
        if (overlap > 0) & (both > 0) & (bench.desk.contacts[GIVEN, k] != DONE):
            most = max(most, float(overlap / least))
            by = type_of(apart, 0.5) * overlap / both
            c.x[i] += by * wi * x
            c.y[i] += by * wi * y
            c.z[i] += by * wi * z
            c.x[j] -= by * wj * x
            c.y[j] -= by * wj * y
            c.z[j] -= by * wj * z
    return most


@outlined
def begin_apart(each: Any, c: Any, chosen: Any) -> Any:
    """Ask for displacements that halve what of overlaps is more than a slack, or as much as may be in a step; returns the
    most that is asked for [m]."""
    bench, row, of, r, most = each.bench, each.bench.desk.contacts, each.bench.desk.of, c.r, 0.0
    for k in range(chosen.pairs + chosen.walls):
        row[RATE, k] = row[LEFT, k] = row[GIVEN, of[NUMBER, k]] = 0.0
    for k in range(chosen.pairs):
        i, j = of[FIRST, k], of[SECOND, k]
        least = min(r[i], r[j])
        _, _, _, apart = line_between(c, i, j, bench.shift, of[NUMBER, k])
        overlap = r[i] + r[j] - apart - type_of(apart, SLACK) * least
        if overlap > 0:
            may = r[i] + r[j] - apart - bench.normal[KEPT, of[NUMBER, k]]
            by = float(min(type_of(apart, 0.5) * overlap, may))
            row[RATE, k] = -row[SCALE, k] * by
            most = max(most, by)
    return most


@outlined
def shift_pairs(each: Any, c: Any, pairs: Any) -> None:
    """Displace all pairs as has been found at once."""
    bench = each.bench
    for k in range(pairs):
        i, j, by = bench.rows[0, k], bench.rows[1, k], type_of(c.x[0], bench.desk.contacts[FOUND, k])
        if by != 0:
            both = each.a[i] + each.a[j]
            shift(c, i, by * each.a[i] / both, bench.normal, k)
            shift(c, j, -by * each.a[j] / both, bench.normal, k)


@outlined
def shift_from_walls(each: Any, c: Any, pairs: Any, walls: Any) -> None:
    """Displace all particles at walls as has been found at once."""
    bench = each.bench
    for q in range(walls):
        by = type_of(c.x[0], bench.desk.contacts[FOUND, pairs + q])
        if by != 0:
            shift(c, bench.wall[q], by, bench.wall_normal, q)


def shift(c: Any, i: Any, by: Any, normal: Any, k: Any) -> None:
    """Move a particle along a normal."""
    c.x[i] += by * normal[0, k]
    c.y[i] += by * normal[1, k]
    c.z[i] += by * normal[2, k]
