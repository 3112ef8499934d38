"""Candidates of every group: all members within the cutoff and the skin of any of its eight.

A group walks down the tree, once for every image of the box within its reach. The members of the groups found there are
tested in single precision about its own centre, with a margin for rounding: lists have all candidates and maybe a few more,
and their users test distances again.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import atomic_add, lanes, on_stack, outlined
from particlesim.engine.interactions.neighbours.record import (
    BLOCK,
    GROUP,
    IMAGE_SHIFT,
    IMAGES,
    NEXT,
    NO_ROOM,
    OVERFLOW,
    POOL,
)

BATCH = 64
"""Groups whose members are looked at together."""
ROUNDING = 1e-6
"""Margin of distances in single precision: some of its units in the last place, for sums of three squares."""
DEEPEST = 10
"""Levels of a tree at most; nodes that wait are at most eight for each."""
AT_ONCE = 8
"""Groups that a thread takes at a time."""
LEVEL_SHIFT = 40
"""Bits of a node that waits which are its number; its level is above them."""


def _apart(low: Any, high: Any, other_low: Any, other_high: Any) -> Any:
    """How far two intervals are apart; 0 where they overlap."""
    gap = max(low - other_high, other_low - high)
    return gap if gap > 0.0 else 0.0


def _others(near: Any, g: Any) -> Any:
    """The groups [first, last) that may hold candidates of group g."""
    groups = near.begin.size
    if near.split is None:
        return 0, groups
    border = (near.split + GROUP - 1) // GROUP
    return (border if g < border else 0), (groups if g < border else border)


@outlined
def sieve(near: Any, g: Any, found: Any, number: Any, image: Any, entries: Any, o: Any) -> Any:
    """Put the candidates of group g in some groups into `entries` from o on, which has room for all; returns the end."""
    base, boxes = near.base, near.boxes
    limit = near.cutoff + near.skin[0] + (0.0 if near.radii is None else near.spread[g])
    unit = 1.0 / limit
    middle = tuple(0.5 * (boxes[axis, g] + boxes[axis + 3, g]) for axis in range(3))
    extent = unit * max(*(boxes[axis + 3, g] - boxes[axis, g] for axis in range(3)))
    margin = np.float32(1.0 + ROUNDING * (2.0 + extent))
    ax, ay, az, best = (on_stack(1, GROUP * BATCH, np.float32)[0] for _ in range(4))
    base_rows = tuple(base[axis] for axis in range(3))
    shift = tuple(near.images[axis, image] - middle[axis] for axis in range(3))
    for b in range(number):
        k = GROUP * found[b]
        for from_x, to_x, away in zip(base_rows, (ax, ay, az), shift, strict=True):
            p, q = from_x[k : k + GROUP], to_x[GROUP * b : GROUP * b + GROUP]
            for i in lanes(GROUP):
                q[i] = unit * (p[i] + away)
    members = GROUP * number
    for j in range(members):
        best[j] = np.float32(np.inf)
    if near.radii is None:
        bar = margin * margin
        for k in range(GROUP * g, GROUP * g + GROUP, 4):
            four = tuple(
                tuple(np.float32(unit * (base[axis, k + i] - middle[axis])) for axis in range(3))
                for i in range(4)
            )
            for j in range(members):
                x, y, z, least = ax[j], ay[j], az[j], best[j]
                for u, v, w in four:
                    dx, dy, dz = x - u, y - v, z - w
                    d = dx * dx + dy * dy + dz * dz
                    least = d if d < least else least
                best[j] = least
    else:
        bar = np.float32(0)
        ar = on_stack(1, GROUP * BATCH, np.float32)[0]
        for b in range(number):
            k = GROUP * found[b]
            p, q = near.radii[k : k + GROUP], ar[GROUP * b : GROUP * b + GROUP]
            for i in lanes(GROUP):
                q[i] = unit * (1.0 + ROUNDING) * p[i]
        for k in range(GROUP * g, GROUP * g + GROUP):
            u, v, w = (np.float32(unit * (base[axis, k] - middle[axis])) for axis in range(3))
            own = np.float32(unit * (near.radii[k] - near.spread[g])) + margin
            for j in range(members):
                dx, dy, dz, h = ax[j] - u, ay[j] - v, az[j] - w, own + ar[j]
                d = dx * dx + dy * dy + dz * dz - h * h
                best[j] = d if d < best[j] else best[j]
    mark = 0 if near.box is None else image << IMAGE_SHIFT
    for b in range(number):
        k = GROUP * found[b] + mark
        hits = best[GROUP * b : GROUP * b + GROUP]
        for i in range(GROUP):
            entries[o] = k + i
            o += 1 if hits[i] < bar else 0
    return o


class IntoLists(NamedTuple):
    """Candidates go to `near.candidates`. `own`: where the list of the group begins and ends, where the room of the thread
    ends, and whether there was none."""

    own: Any

    def take(self, near: Any, g: Any, found: Any, number: Any, image: Any) -> None:
        """Append to the list of group g its candidates in some groups."""
        own, members = self.own, GROUP * number
        if own[END] - own[LAST] < members:
            _move(near, own, members)
        if own[FULL] == 0:
            own[LAST] = sieve(near, g, found, number, image, near.candidates, own[LAST])


BEGIN, LAST, END, FULL = range(4)


@outlined
def _move(near: Any, own: Any, members: Any) -> None:
    """Ask for room for as many further candidates, and take along what the list has so far."""
    length = own[LAST] - own[BEGIN]
    wanted = length + members + BLOCK
    start = atomic_add(near.report, POOL, wanted)
    if start + wanted > near.candidates.size:
        near.report[OVERFLOW] = 1
        own[FULL] = 1
    else:
        for k in range(length):
            near.candidates[start + k] = near.candidates[own[BEGIN] + k]
        own[BEGIN], own[LAST], own[END] = start, start + length, start + wanted


@outlined
def _walk(near: Any, g: Any, image: Any, sink: Any) -> None:
    """Give a sink the groups in which group g may have candidates in an image, some at a time."""
    boxes = near.boxes
    sx, sy, sz = near.images[0, image], near.images[1, image], near.images[2, image]
    x0, y0, z0 = boxes[0, g] - sx, boxes[1, g] - sy, boxes[2, g] - sz
    x1, y1, z1 = boxes[3, g] - sx, boxes[4, g] - sy, boxes[5, g] - sz
    limit = (near.cutoff + near.skin[0]) * (1.0 + ROUNDING)
    if near.radii is not None:
        limit += near.spread[g]
    first, last = _others(near, g)
    waiting, apart, found = (
        on_stack(1, 8 * DEEPEST, np.int64)[0],
        on_stack(1, 8, np.float64)[0],
        on_stack(1, BATCH, np.int64)[0],
    )
    waiting[0] = (near.levels.size - 1) << LEVEL_SHIFT
    top, number = 1, 0
    while top > 0:
        top -= 1
        node = waiting[top]
        level = (node >> LEVEL_SHIFT) - 1
        child = 8 * (node & (1 << LEVEL_SHIFT) - 1)
        k = near.levels[level] + child
        low = tuple(boxes[axis, k : k + 8] for axis in range(3))
        high = tuple(boxes[axis, k : k + 8] for axis in range(3, 6))
        for i in lanes(8):
            dx = _apart(x0, x1, low[0][i], high[0][i])
            dy = _apart(y0, y1, low[1][i], high[1][i])
            dz = _apart(z0, z1, low[2][i], high[2][i])
            reach = limit if near.spread is None else limit + near.spread[k + i]
            apart[i] = dx * dx + dy * dy + dz * dz - reach * reach
        if near.split is not None:
            for i in range(8):
                inside = ((child + i) << 3 * level < last) & ((child + i + 1) << 3 * level > first)
                apart[i] = apart[i] if inside else np.inf
        if level == 0:
            if number > BATCH - 8:
                type(sink).take(sink, near, g, found, number, image)
                number = 0
            for i in range(8):
                found[number] = child + i
                number += 1 if apart[i] <= 0.0 else 0
        else:
            for i in range(7, -1, -1):
                waiting[top] = level << LEVEL_SHIFT | child + i
                top += 1 if apart[i] <= 0.0 else 0
    if number > 0:
        type(sink).take(sink, near, g, found, number, image)


def search(near: Any, g: Any, sink: Any) -> None:
    """Give a sink the groups in which group g may have candidates, image by image of the box."""
    if near.boxes[0, g] <= near.boxes[3, g]:
        if near.box is None:
            _walk(near, g, 0, sink)
        else:
            limit = (near.cutoff + near.skin[0]) * (1.0 + ROUNDING)
            if near.radii is not None:
                limit += near.spread[g] + _largest_radius(near)
            seen = tuple(_periods_seen(near, g, axis, limit) for axis in range(3))
            for image in range(IMAGES):
                if (seen[0] >> image % 3) & (seen[1] >> image // 3 % 3) & (seen[2] >> image // 9) & 1:
                    _walk(near, g, image, sink)


def _periods_seen(near: Any, g: Any, axis: Any, limit: Any) -> Any:
    """Which periods along an axis group g may see: bit 0 its own, bit 1 the next, bit 2 the one before."""
    length = near.box[axis]
    if length is None:
        return 1
    top = near.levels[near.levels.size - 2]
    low, high = np.inf, -np.inf
    for k in range(top, top + 8):
        low, high = min(low, near.boxes[axis, k]), max(high, near.boxes[axis + 3, k])
    least, most = near.boxes[axis, g] - limit, near.boxes[axis + 3, g] + limit
    return (
        (1 if (least <= high) & (most >= low) else 0)
        | (2 if (least <= high + length) & (most >= low + length) else 0)
        | (4 if (least <= high - length) & (most >= low - length) else 0)
    )


def _largest_radius(near: Any) -> Any:
    """The largest radius of all members."""
    top, largest = near.levels[near.levels.size - 2], 0.0
    for k in range(top, top + 8):
        largest = max(largest, near.spread[k])
    return largest


@outlined
def _list_of(near: Any, g: Any, own: Any) -> None:
    """Find the candidates of a group, in the room of a thread."""
    own[BEGIN], own[FULL] = own[LAST], 0
    search(near, g, IntoLists(own))
    near.begin[g] = own[BEGIN]
    near.count[g] = own[LAST] - own[BEGIN] if own[FULL] == 0 else NO_ROOM


@outlined
def find_candidates(near: Any, share: Any) -> None:
    """Lists of all groups; threads take groups one after another. `report[NEXT]` and `report[POOL]` must be 0."""
    groups, own = near.begin.size, on_stack(1, 4, np.int64)[0]
    own[LAST], own[END] = 0, 0
    while True:
        first = atomic_add(near.report, NEXT, AT_ONCE)
        if first >= groups:
            break
        for g in range(first, min(first + AT_ONCE, groups)):
            _list_of(near, g, own)
