"""Whom a swift grain meets next on its way: boxes about the ways of members, and a walk through them (`swift`).

Boxes stand about the ways of members, about eight of these, which are neighbours in space, and about eight boxes each, as in
the search for neighbours; a way is tested against eight boxes at once, as a segment as thick as its particle. So the cost
grows with the number of ways that come near, and not with the volume of a box about a long one.

Two spheres meet when their distance d + g τ is the sum of their radii R: with the point of closest approach q = d + g τ₀,
τ₀ = −d·g/g², that is τ = τ₀ − √((R² − q²)/g²), in which nothing cancels, however long the way is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import lanes, on_stack, outlined, shared
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.hard.ways import (
    BEGUN,
    BEND,
    DUE,
    ENDS,
    IMPACTS,
    LAW,
    MOST_IMPACTS,
    PARTNER,
    SEEN,
    TURNED,
    leg_of,
    place_at,
)

FAST = 0.5
"""Way of two relative to each other in a step, as a part of the sum of their radii, from which on they are followed: others
overlap at its end if they meet."""
HITS = 0.03
"""How far two that meet would come into each other in a step, as a part of the sum of their radii, from which on they are
followed where there are few members, if that is faster than what rests."""
SLOW = 0.01
"""The same where one of them is followed anyway: below it, they lie on each other, or come that far into each other."""
CLOSES, ROUNDING = 1e-9, 1e-12
"""What two that touch come closer in the rest of a step to hit each other, at least, as parts of the sum of their radii, and
of their way relative to each other."""
WIDER = 1e-9
"""By how much boxes are wider than ways, as a part of coordinates."""
DEEPEST, LEVEL_SHIFT = 12, 40
"""Levels of the tree that there is room for; bits of a node in the list of those to look at, below its level."""
STILL = 1e-290
"""Way along an axis below which something stands still along it [m]."""
MOST_IMAGES = 8
"""Images of a periodic box in which a way is looked for, to each side."""


# ---- boxes


def box_ways(f: Any, team: Any, low: Any, high: Any) -> None:
    """Boxes about the ways of all members between two times, and about those of all nodes above; all threads come here."""
    w = f.ways
    if team.number == 0:
        sort_ways(f, 0.5 * (low + high))
    meet(team.gate, team.threads)
    first, last = part_of(team, w.order.size)
    for place in range(first, last):
        clear(w.boxes, place)
        i = w.order[place]
        if i >= 0 and w.when[ENDS, i] > low:
            box_way(f, i, low, high, 1)
    meet(team.gate, team.threads)
    if team.number == 0:
        for level in range(1, w.levels.size - 1):
            for node in range(w.levels[level], w.levels[level + 1]):
                surround(w.boxes, node, w.levels[level - 1] + 8 * (node - w.levels[level]), w.levels[level])
    meet(team.gate, team.threads)


def part_of(team: Any, size: Any) -> Any:
    """Which of so many places are those of a thread."""
    return size * team.number // team.threads, size * (team.number + 1) // team.threads


def clear(boxes: Any, node: Any) -> None:
    """Have a box hold nothing."""
    for axis in range(3):
        boxes[axis, node], boxes[3 + axis, node] = np.inf, -np.inf


def surround(boxes: Any, node: Any, first: Any, last: Any) -> None:
    """The box about the eight below it, from one on, unless that is none below `last`."""
    clear(boxes, node)
    if first < last:
        for axis in range(3):
            low, high = boxes[axis, node], boxes[3 + axis, node]
            for k in range(first, first + 8):
                low, high = min(low, boxes[axis, k]), max(high, boxes[3 + axis, k])
            boxes[axis, node], boxes[3 + axis, node] = low, high


@outlined
def sort_ways(f: Any, s: Any) -> None:
    """Put all members in order by the cells of a grid in which they are at a time, along Morton's curve."""
    w, cells = f.ways, f.ways.cells
    low, high = (np.inf, np.inf, np.inf), (-np.inf, -np.inf, -np.inf)
    for i in range(w.place.size):
        if w.when[ENDS, i] > 0:
            x = seen_at(f, i, s)
            low, high = around(low, high, x)
    side = 1
    while 8 * side * side * side < cells.size:
        side *= 2
    by = tuple(side / (high[k] - low[k]) if high[k] > low[k] else 0.0 for k in range(3))
    for k in range(cells.size):
        cells[k] = 0
    for i in range(w.place.size):
        if w.when[ENDS, i] > 0:
            x, cell, bit = seen_at(f, i, s), 0, 0
            x = tuple(int(min((x[k] - low[k]) * by[k], side - 1.0)) for k in range(3))
            while 1 << bit < side:
                for k in range(3):
                    cell |= (x[k] >> bit & 1) << 3 * bit + k
                bit += 1
            w.cell[i] = cell
            cells[cell + 1] += 1
    for k in range(1, cells.size):
        cells[k] += cells[k - 1]
    for k in range(w.order.size):
        w.order[k] = -1
    for i in range(w.place.size):
        if w.when[ENDS, i] > 0:
            k = cells[w.cell[i]]
            cells[w.cell[i]] += 1
            w.order[k], w.place[i] = i, k


def around(low: Any, high: Any, x: Any) -> Any:
    """Both corners of a box that holds a place, too."""
    return (
        (min(low[0], x[0]), min(low[1], x[1]), min(low[2], x[2])),
        (max(high[0], x[0]), max(high[1], x[1]), max(high[2], x[2])),
    )


def seen_at(f: Any, i: Any, s: Any) -> Any:
    """Where a particle is at a time, or was born or has died, in the image of the box in which others are."""
    w = f.ways
    x = place_at(w, i, min(max(s, w.when[BEGUN, i]), w.when[ENDS, i]))
    return x[0] + w.wrap[0, i], x[1] + w.wrap[1, i], x[2] + w.wrap[2, i]


@shared
def box_way(f: Any, i: Any, low: Any, high: Any, levels: Any) -> None:
    """Widen the boxes that a particle is in, in so many levels, so that they hold its way between two times."""
    w = f.ways
    legs = 2 if w.when[BEND, i] < high else 1
    for leg in range(legs):
        begin = max(low, w.when[BEGUN, i])
        begin = begin if leg == 0 else max(begin, w.when[BEND, i])
        end = min(high, w.when[ENDS, i])
        end = end if leg == legs - 1 else min(end, w.when[BEND, i])
        if end >= begin:
            begun, x, go = leg_of(w, i, begin)
            for axis in range(3):
                wrap = w.wrap[axis, i]
                one = x[axis] + (begin - begun) * go[axis] + wrap
                other = x[axis] + (end - begun) * go[axis] + wrap
                more = float(f.r[i]) + WIDER * (abs(one) + abs(other))
                widen(w, axis, w.place[i], min(one, other) - more, max(one, other) + more, levels)


def widen(w: Any, axis: Any, place: Any, low: Any, high: Any, levels: Any) -> None:
    """Widen the box of a member, and those above it in so many levels, along an axis."""
    node, level, wider = place, 0, True
    while wider & (level < levels):
        k = w.levels[level] + node
        wider = (low < w.boxes[axis, k]) | (high > w.boxes[3 + axis, k])
        w.boxes[axis, k], w.boxes[3 + axis, k] = min(low, w.boxes[axis, k]), max(high, w.boxes[3 + axis, k])
        node, level = node // 8, level + 1


# ---- two on their ways


def meets_at(f: Any, i: Any, j: Any, image: Any, low: Any, high: Any) -> float:
    """When particle i, on one leg between two times, meets particle j, displaced by an image; infinite if it does not."""
    w, best, reach = f.ways, np.inf, float(f.r[i]) + float(f.r[j])
    begin, last = max(low, w.when[BEGUN, j]), min(high, w.when[ENDS, j])
    while (begin < last) & (best == np.inf):
        end = min(last, w.when[BEND, j]) if begin < w.when[BEND, j] else last
        best = meet_between(w, i, j, image, begin, end, reach)
        begin = end
    return float(best)


def meet_between(w: Any, i: Any, j: Any, image: Any, low: Any, high: Any, reach: Any) -> float:
    """When two meet between two times at which neither's way bends, unless they move as one."""
    (bi, xi, gi), (bj, xj, gj) = leg_of(w, i, low), leg_of(w, j, low)
    d = tuple(xi[k] + (low - bi) * gi[k] - xj[k] - (low - bj) * gj[k] + image[k] for k in range(3))
    g = tuple(gi[k] - gj[k] for k in range(3))
    along = d[0] * g[0] + d[1] * g[1] + d[2] * g[2]
    square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
    far = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    if (along >= 0) | (square <= SLOW * SLOW * reach * reach) | (far == 0):
        return np.inf
    left = high - low
    if far <= reach * reach:  # which touch, and hit each other if they still come closer
        closes = -along / np.sqrt(far) * left
        return low if closes > CLOSES * reach + ROUNDING * np.sqrt(square) else np.inf
    nearest = -along / square
    q = tuple(d[k] + nearest * g[k] for k in range(3))
    deep = reach * reach - (q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    if deep <= 0:
        return np.inf
    after = max(nearest - np.sqrt(deep / square), 0.0)
    return low + after if after <= left else np.inf


# ---- the next impact of one


@shared
def find_next(f: Any, i: Any, now: Any, high: Any) -> None:
    """Find the first impact of particle i between two times."""
    w = f.ways
    if w.when[DUE, i] < np.inf:  # another thread may look at a neighbour: what stays is not written
        w.when[DUE, i] = np.inf
    low, end = max(now, w.when[BEGUN, i]), min(high, w.when[ENDS, i])
    if w.when[BEND, i] < end:
        if low < w.when[BEND, i]:
            look_along(f, i, low, w.when[BEND, i])
        low = max(low, w.when[BEND, i])
    if (low < end) & (w.when[DUE, i] == np.inf):
        look_along(f, i, low, end)


@outlined
def look_along(f: Any, i: Any, low: Any, high: Any) -> None:
    """Find the first impact of particle i on a leg between two times, in all images of the box."""
    w = f.ways
    begun, x, go = leg_of(w, i, low)
    by = low - begun
    x = (x[0] + by * go[0], x[1] + by * go[1], x[2] + by * go[2])
    if f.box is None:
        walk(f, i, x, go, (0.0, 0.0, 0.0), low, high)
    else:
        x = tuple(x[axis] + w.wrap[axis, i] for axis in range(3))
        first, last = images_of(f, x, go, float(f.r[i]), high - low)
        for a in range(first[0], last[0] + 1):
            for b in range(first[1], last[1] + 1):
                for d in range(first[2], last[2] + 1):
                    walk(f, i, x, go, shift_of(f.box, (a, b, d)), low, high)


def shift_of(box: Any, steps: Any) -> Any:
    """The displacement of an image [m]."""
    return tuple(0.0 if period is None else period * step for period, step in zip(box, steps, strict=True))


def images_of(f: Any, x: Any, go: Any, r: Any, lasts: Any) -> Any:
    """By how many periods a way may be displaced, at least and at most, along each axis, to come near to some member."""
    found = tuple(
        (0, 0)
        if period is None
        else images_along(f.ways, axis, period, x[axis], x[axis] + lasts * go[axis], r)
        for axis, period in enumerate(f.box)
    )
    return tuple(each[0] for each in found), tuple(each[1] for each in found)


def images_along(w: Any, axis: Any, period: Any, one: Any, other: Any, r: Any) -> Any:
    """`images_of` along one axis, on which a way leads from one place to another."""
    low, high = np.inf, -np.inf
    for k in range(w.levels[w.levels.size - 2], w.boxes.shape[1]):
        low, high = min(low, w.boxes[axis, k]), max(high, w.boxes[3 + axis, k])
    least = max(np.ceil((low - max(one, other) - r) / period), float(-MOST_IMAGES))
    most = min(np.floor((high - min(one, other) + r) / period), float(MOST_IMAGES))
    return int(least), int(most)


@outlined
def walk(f: Any, i: Any, x: Any, go: Any, shift: Any, low: Any, high: Any) -> None:
    """Look at all members whose boxes a way comes near to, displaced by a shift, and keep the first that it meets."""
    w, levels = f.ways, f.ways.levels
    waiting, near = on_stack(1, 8 * DEEPEST, np.int64)[0], on_stack(1, 8, np.float64)[0]
    x, r = (x[0] + shift[0], x[1] + shift[1], x[2] + shift[2]), float(f.r[i])
    pace = tuple(1.0 / by if abs(by) > STILL else 1.0 / STILL for by in go)
    waiting[0], top = (levels.size - 1) << LEVEL_SHIFT, 1
    while top > 0:
        top -= 1
        level, child = (waiting[top] >> LEVEL_SHIFT) - 1, 8 * (waiting[top] & (1 << LEVEL_SHIFT) - 1)
        pass_through(w.boxes, levels[level] + child, x, pace, r, min(high, w.when[DUE, i]) - low, near)
        for k in range(8):
            if near[k] > 0:
                if level > 0:
                    waiting[top] = level << LEVEL_SHIFT | child + k
                    top += 1
                else:
                    look_at(f, i, w.order[child + k], shift, low, high)


def pass_through(boxes: Any, first: Any, x: Any, pace: Any, r: Any, lasts: Any, near: Any) -> None:
    """Whether a way that lasts so long, as thick as a radius, passes through each of eight boxes: 1 or 0 into `near`.
    `pace`: one over its components, or something large for what stands still along an axis."""
    low = tuple(boxes[axis, first : first + 8] for axis in range(3))
    high = tuple(boxes[axis, first : first + 8] for axis in range(3, 6))
    for k in lanes(8):
        enters, leaves = 0.0, lasts
        for axis in range(3):
            one = (low[axis][k] - r - x[axis]) * pace[axis]
            other = (high[axis][k] + r - x[axis]) * pace[axis]
            enters, leaves = max(enters, min(one, other)), min(leaves, max(one, other))
        # boxes of nothing, from infinity to -infinity, hold all else
        near[k] = 1.0 if (enters <= leaves * (1 + WIDER)) & (low[0][k] <= high[0][k]) else 0.0


def look_at(f: Any, i: Any, j: Any, shift: Any, low: Any, high: Any) -> None:
    """Keep member j if particle i meets it first; of those that it meets at once the one with the smallest row."""
    w, law = f.ways, law_of(f, i, j)
    if law >= 0:
        image = image_of(f, i, j, shift)
        s = meets_at(f, i, j, image, low, high)
        sooner = s < w.when[DUE, i]
        if sooner | ((s == w.when[DUE, i]) & (s < np.inf) & (j < w.what[PARTNER, i])):
            w.when[DUE, i], w.what[PARTNER, i], w.what[SEEN, i] = s, j, w.what[TURNED, j]
            w.what[LAW, i] = law
            for axis in range(3):
                w.image[axis, i] = image[axis]


def law_of(f: Any, i: Any, j: Any) -> Any:
    """The number of the first contact that acts between two members, -1 if there is none."""
    w, found = f.ways, -1
    for number, side in enumerate(f.sides):
        found = number if (found < 0) & ((side[i] & side[j] >> 2 & 3) != 0) else found
    return found if (i != j) & (goes_on(w, i) | goes_on(w, j)) else -1


def goes_on(w: Any, i: Any) -> Any:
    """Whether impulses move a particle, which has not had too many."""
    return (w.light[i] > 0) & (w.what[IMPACTS, i] < MOST_IMPACTS)


def image_of(f: Any, i: Any, j: Any, shift: Any) -> Any:
    """What to add to the difference of the places of two for an image, whole periods [m]."""
    if f.box is None:
        return 0.0, 0.0, 0.0
    w = f.ways
    found = tuple(shift[axis] + w.wrap[axis, i] - w.wrap[axis, j] for axis in range(3))
    return tuple(
        0.0 if period is None else period * np.rint(by / period)
        for period, by in zip(f.box, found, strict=True)
    )
