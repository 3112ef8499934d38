"""Positions and lists of neighbours updated, by all threads of an island together.

Lists hold while no member has moved by more than half of the skin since they were built. A motion common to all does not
count: where members have moved further, displacements are measured from the middle between the smallest and the largest.
These are extremes, which do not depend on the order of members, so it does not depend on threads whether lists hold.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined, prefetch, shared
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.neighbours.record import (
    BUILDS,
    CHANGED,
    FAR,
    FURTHEST,
    FURTHEST_DRIFTED,
    GROUP,
    LIVED,
    LOST,
    MOVED,
    MOVED_HIGH,
    NEXT,
    POOL,
    SLICES,
    STALE,
    TURN,
    lives,
    slice_of,
    within_sight,
)
from particlesim.engine.interactions.neighbours.search import find_candidates
from particlesim.engine.interactions.neighbours.sort import over_slices, place_of, sort_members
from particlesim.engine.interactions.neighbours.tree import grow_tree
from particlesim.engine.state.columns import presence, type_of

AHEAD = 64
"""Members that are asked for ahead."""


def _ask_for(near: Any, c: Any, k: Any, carried: Any, quiet: Any) -> None:
    """Have what `_gather` needs of the members at place k and after it fetched into the cache: processors that see streams
    coming see some, and here are more."""
    i = max(near.order[k], 0)
    for column in (c.x, c.y, c.z, *[each for each, _ in (*carried, *quiet)]):
        prefetch(column, i)
    for axis in range(3):
        prefetch(near.base, axis, k)


@outlined
def _gather(near: Any, c: Any, share: Any, t: Any, carried: Any, quiet: Any = ()) -> None:
    """Present places of all members, and how far they have moved since the lists were built, slice by slice.

    For each pair of columns in `carried` and `quiet`, what is in a row of the first goes to its place in the second; that
    those of the second kind have changed is not noted.
    """
    nowhere = type_of(near.x[0, 0], FAR)
    places = (near.x[0], near.x[1], near.x[2])
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(near.order.size, s)
        x0 = y0 = z0 = type_of(nowhere, np.inf)
        x1 = y1 = z1 = far = type_of(nowhere, -np.inf)
        changed = False
        for k in range(first, last):
            i = near.order[k]
            if k % GROUP == 0:
                _ask_for(near, c, min(k + AHEAD, last - 1), carried, quiet)
            if i >= 0:
                x, y, z = c.x[i], c.y[i], c.z[i]
                if near.wrap is not None:
                    x, y, z = x + near.wrap[0, k], y + near.wrap[1, k], z + near.wrap[2, k]
                part = presence(c.clock, i)
                here = part > 0
                if near.part is not None:
                    changed = changed | (near.part[k] != part)
                    near.part[k] = part
                for number, goes_to in zip(
                    (x if here else nowhere, y if here else nowhere, z if here else nowhere),
                    places,
                    strict=True,
                ):
                    changed = changed | (goes_to[k] != number)
                    goes_to[k] = number
                for column, goes_to in carried:
                    changed = changed | (goes_to[k] != column[i])
                    goes_to[k] = column[i]
                for column, goes_to in quiet:
                    goes_to[k] = column[i]
                dx, dy, dz = x - near.base[0, k], y - near.base[1, k], z - near.base[2, k]
                d = dx * dx + dy * dy + dz * dz
                x0, x1 = dx if (dx < x0) & here else x0, dx if (dx > x1) & here else x1
                y0, y1 = dy if (dy < y0) & here else y0, dy if (dy > y1) & here else y1
                z0, z1 = dz if (dz < z0) & here else z0, dz if (dz > z1) & here else z1
                far = d if (d > far) & here else far
        slot = near.slots[s]
        slot[MOVED], slot[MOVED + 1], slot[MOVED + 2] = x0, y0, z0
        slot[MOVED_HIGH], slot[MOVED_HIGH + 1], slot[MOVED_HIGH + 2] = x1, y1, z1
        slot[FURTHEST] = far
        slot[CHANGED] = 1.0 if changed else 0.0


@outlined
def _measure_from(near: Any, share: Any, dx: Any, dy: Any, dz: Any) -> None:
    """The largest displacement about a common one, slice by slice."""
    nowhere = type_of(near.x[0, 0], FAR)
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(near.order.size, s)
        far = -np.inf
        for k in range(first, last):
            u = near.x[0, k] - near.base[0, k] - dx
            v = near.x[1, k] - near.base[1, k] - dy
            w = near.x[2, k] - near.base[2, k] - dz
            d = u * u + v * v + w * w
            far = d if (d > far) & (near.x[0, k] != nowhere) else far
        near.slots[s, FURTHEST_DRIFTED] = far


def drifts(near: Any) -> Any:
    """Whether a common way of all members has been taken from how far they have moved; after `refresh`."""
    _, far = over_slices(near, FURTHEST)
    return far > 0.25 * near.skin[0] * near.skin[0]


def drift_of(near: Any) -> Any:
    """The middle between the smallest and the largest displacement of members [m]."""
    found = [
        over_slices(near, MOVED + axis)[0] + over_slices(near, MOVED_HIGH + axis)[1] for axis in range(3)
    ]
    return 0.5 * found[0], 0.5 * found[1], 0.5 * found[2]


@outlined
def _hold(near: Any, share: Any) -> Any:
    """Whether the lists hold; the same for all threads, all of which must call it."""
    if near.report[STALE] != 0:
        return False
    bar = 0.25 * near.skin[0] * near.skin[0]
    _, far = over_slices(near, FURTHEST)
    if far <= bar:
        return True
    x0, _ = over_slices(near, MOVED)
    y0, _ = over_slices(near, MOVED + 1)
    z0, _ = over_slices(near, MOVED + 2)
    _, x1 = over_slices(near, MOVED_HIGH)
    _, y1 = over_slices(near, MOVED_HIGH + 1)
    _, z1 = over_slices(near, MOVED_HIGH + 2)
    if not max(x1 - x0, y1 - y0, z1 - z0) <= near.skin[0]:  # then some have moved apart by more than that
        return False
    _measure_from(near, share, 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1))
    meet(share.gate, share.threads)
    _, far = over_slices(near, FURTHEST_DRIFTED)
    return far <= bar


@outlined
def _arrange(near: Any, c: Any, share: Any, t: Any, at: Any) -> None:
    """Give every member its place, in the order of row `at` of the sorted numbers."""
    nowhere = type_of(near.x[0, 0], FAR)
    m = near.members.size
    split = m if near.split is None else near.split
    filling = (GROUP - split % GROUP) % GROUP
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(m, s)
        for j in range(first, last):
            i = near.members[near.index[at, j]]
            k = j if j < split else j + filling
            near.order[k] = i
            near.place[i] = k
            x, y, z = place_of(near, c, i)
            if near.wrap is not None:
                near.wrap[0, k] = x - c.x[i]
                near.wrap[1, k] = y - c.y[i]
                near.wrap[2, k] = z - c.z[i]
            there = lives(c.clock, i, t) & within_sight(x, y, z)
            near.base[0, k] = x if there else nowhere
            near.base[1, k] = y if there else nowhere
            near.base[2, k] = z if there else nowhere
            if near.radii is not None:
                near.radii[k] = c.r[i]


class Where(NamedTuple):
    """What lists are built from: columns of places, radii or None, and clocks. No laws: it is the same for all of them."""

    x: Any
    y: Any
    z: Any
    r: Any
    clock: Any


class Crew(NamedTuple):
    """A thread among those that work together, and where they meet."""

    number: Any
    threads: Any
    gate: Any


@shared
def build(near: Any, c: Any, share: Any, t: Any) -> None:
    """Order, tree and lists anew. All threads must call it, when all particles are in their places."""
    at = sort_members(near, c, share, t)
    _arrange(near, c, share, t, at)
    if share.number == 0:
        near.report[POOL] = 0
        near.report[NEXT] = 0
        near.report[STALE] = 0
        near.report[BUILDS] += 1
        near.report[LIVED] = 0
    meet(share.gate, share.threads)
    grow_tree(near, share)
    find_candidates(near, share)


@shared
def find_again(near: Any, c: Any, share: Any) -> None:
    """The lists as they were built last, in the same order. All threads must call it."""
    meet(share.gate, share.threads)
    if share.number == 0:
        near.report[POOL] = 0
        near.report[NEXT] = 0
        near.report[STALE] = 0
    if near.radii is not None:
        for s in range(share.number, SLICES, share.threads):
            first, last = slice_of(near.order.size, s)
            for k in range(first, last):
                if near.order[k] >= 0:
                    near.radii[k] = c.r[near.order[k]]
    meet(share.gate, share.threads)
    grow_tree(near, share)
    find_candidates(near, share)


def refresh(near: Any, c: Any, share: Any, t: Any, moving: Any = (), fixed: Any = (), quiet: Any = ()) -> Any:
    """Present places of all members, and lists that hold; returns whether anything has changed since the last time.

    For each pair of columns in `moving`, what is in a row of the first goes to its place in the second; for those in
    `fixed`, which steps do not change, only when places are new; changes of those in `quiet` do not count.
    All threads of an island must call it, when all particles are in their places. It sets `report[TURN]` to 0.
    """
    _gather(near, c, share, t, moving, quiet)
    if share.number == 0:
        near.report[TURN] = 0
        near.report[LIVED] += 1
    meet(share.gate, share.threads)
    where = Where(c.x, c.y, c.z, None if near.radii is None else c.r, c.clock)
    crew = Crew(share.number, share.threads, share.gate)
    lost = near.report[STALE] == LOST
    if lost:
        find_again(near, where, crew)
    if not _hold(near, share):
        build(near, where, crew, t)
    elif not lost:
        _, changed = over_slices(near, CHANGED)
        return changed > 0.0
    _gather(near, c, share, t, (*moving, *fixed), quiet)
    meet(share.gate, share.threads)
    return True
