"""What bounces in a step gives springs no energy: their forces, and what `step.rebounds` makes of them.

Forces are looked at five times: with all particles where they would be without the impacts of the step, where they are with
these, halfway between, and about half a step behind and ahead of there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.coupled.forces import evaluate
from particlesim.engine.interactions.interaction import prepare_elements
from particlesim.engine.state.columns import in_step, span, type_of
from particlesim.engine.step.rebounds import NEAR, slowed_along

FREE, HIT, BETWEEN, BEHIND, AHEAD = range(5)
"""Where forces are looked at: without impacts, with them, halfway between, and from there half a step back and ahead."""
WITHOUT, WITH_SERIES = (FREE, HIT, BETWEEN), (FREE, HIT, BETWEEN, BEHIND, AHEAD)
"""Those that methods need of which only the energy is known, and those of which it is known what they keep."""


def note_rebound(rebounds: Any, share: Any, i: Any, way: Any, q: Any) -> None:
    """List particle i of a share, which has bounced in a step that would have ended at q."""
    k = share.first + share.struck[8 * share.number]
    share.struck[8 * share.number] += 1
    rebounds.rows[k] = i
    for axis, number in enumerate((q.x, q.y, q.z, q.vx, q.vy, q.vz)):
        rebounds.free[axis, k] = number
    for axis, number in enumerate((*way.turn, *way.late)):
        rebounds.way[axis, k] = number


def exchange(c: Any, i: Any, other: Any, k: Any) -> None:
    """Exchange the motion of particle i with column k of `other` [6, n]."""
    for axis, column in enumerate((c.x, c.y, c.z, c.vx, c.vy, c.vz)):
        here = column[i]
        column[i] = other[axis, k]
        other[axis, k] = here


@outlined
def settle_rebounds(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """Take from what has bounced in a step what springs have gained by it; all threads of an island come here."""
    room = work.rebounds
    meet(share.gate, share.threads)
    if share.struck.sum() > 0:
        first, last = share.first, share.first + share.struck[8 * share.number]
        for k in range(first, last):
            exchange(c, room.rows[k], room.free, k)
        _look(parts, bonds, c, work, share, t, end, FREE)
        for k in range(first, last):
            exchange(c, room.rows[k], room.free, k)
        _look(parts, bonds, c, work, share, t, end, HIT)
        for k in range(first, last):
            halve(c, room, k)
        _look(parts, bonds, c, work, share, t, end, BETWEEN)
        if room.home is not None:
            lead(room, c, share, t, end, h, BEHIND)
            _look(parts, bonds, c, work, share, t, end, BEHIND)
            lead(room, c, share, t, end, h, AHEAD)
            _look(parts, bonds, c, work, share, t, end, AHEAD)
            lead(room, c, share, t, end, h, BETWEEN)
        for k in range(first, last):
            exchange(c, room.rows[k], room.hit, k)
        if room.home is not None:
            meet(share.gate, share.threads)
            prepare_elements(share.elements, c, share, end)  # to know what is where particles are
        if room.around is not None:
            keep_time(room, c, share, t, end, h)
        for k in range(first, last):
            _, hi = span(c.clock, room.rows[k], t, end, h)
            if room.lies[room.rows[k]]:
                slide_on(c, room, k, hi)
            else:
                slow_down(c, room, k, hi)


@outlined
def _look(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, where: int) -> None:
    """Keep the forces with all particles where they are: on what has bounced, and those on all, if they are asked for."""
    room = work.rebounds
    meet(share.gate, share.threads)
    evaluate(parts, bonds, in_step(c, t, end), work, share, end, None)
    for k in range(share.first, share.first + share.struck[8 * share.number]):
        for axis in range(3):
            room.forces[3 * where + axis, k] = work.force[axis, room.rows[k]]
    if room.around is not None and where <= HIT:
        for axis in range(3):
            for i in range(share.first, share.last):
                room.around[3 * where + axis, i] = work.force[axis, i] / c.m[i]


def halve(c: Any, room: Any, k: Any) -> None:
    """Put the particle of column k halfway between its motions with impacts and without, and keep the former."""
    i = room.rows[k]
    for axis, column in enumerate((c.x, c.y, c.z, c.vx, c.vy, c.vz)):
        room.hit[axis, k] = column[i]
        column[i] = type_of(column[i], 0.5) * (column[i] + room.free[axis, k])


@outlined
def lead(room: Any, c: Any, share: Any, t: Any, end: Any, h: Any, where: int) -> None:
    """Take the particles of a share near to where they were a step before or will be after, and back home."""
    begun, aside, near = type_of(h, room.begun), type_of(h, room.aside), type_of(h, NEAR)
    for axis, (places, speeds) in enumerate(((c.x, c.vx), (c.y, c.vy), (c.z, c.vz))):
        for i in range(share.first, share.last):
            _, hi = span(c.clock, i, t, end, h)
            free, hit = room.around[axis, i], room.around[3 + axis, i]
            way, fall = near * hi * (speeds[i] + begun * hi * free), aside * (near * hi) ** 2 * (free + hit)
            if where == BEHIND:
                room.home[axis, i] = places[i]
                places[i] += fall - way
            elif where == AHEAD:
                places[i] = room.home[axis, i] + fall + way
            else:
                places[i] = room.home[axis, i]


def keep_time(room: Any, c: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """Impacts change the forces at the end of a step, not the velocities of the places there: those that are older, or lie
    between places, change by the opposite."""
    speeds = (c.vx, c.vy, c.vz) if room.between is None else c.memory
    part = room.begun if room.between is None else room.old
    for axis in (0, 1, 2):
        for i in range(share.first, share.last):
            _, hi = span(c.clock, i, t, end, h)
            if not room.lies[i]:
                speeds[axis][i] += type_of(h, part) * hi * (room.around[axis, i] - room.around[3 + axis, i])


def slide_on(c: Any, room: Any, k: Any, h: Any) -> None:
    """What `keep_time` does for the particle of column k, which has landed: along the surface."""
    i, square, along = room.rows[k], 0.0, 0.0
    places, speeds, m = (c.x, c.y, c.z), (c.vx, c.vy, c.vz), np.float64(c.m[i])
    for axis in (0, 1, 2):
        d = np.float64(places[axis][i]) - np.float64(room.free[axis, k])
        change = np.float64(room.forces[3 * FREE + axis, k]) - np.float64(room.forces[3 * HIT + axis, k])
        square, along = square + d * d, along + change * d
    if square > 0:
        part = room.begun * np.float64(h) / m
        for axis in (0, 1, 2):
            d = np.float64(places[axis][i]) - np.float64(room.free[axis, k])
            change = np.float64(room.forces[3 * FREE + axis, k]) - np.float64(room.forces[3 * HIT + axis, k])
            speeds[axis][i] += type_of(h, part * (change - along / square * d))


@outlined
def slow_down(c: Any, room: Any, k: Any, h: Any) -> None:
    """Change the speed along its displacement of the particle of column k."""
    i = room.rows[k]
    m = np.float64(c.m[i])
    end = _row((c.x[i], c.y[i], c.z[i]))
    places, v = _column(room.free, 0, k), _column(room.free, 3, k)
    d = tuple(b - a for a, b in zip(places, end, strict=True))
    w, _ = slowed_along(
        d,
        v,
        _row((c.vx[i], c.vy[i], c.vz[i])),
        _column(room.way, 0, k),
        _column(room.way, 3, k),
        tuple(
            tuple(f / m for f in _column(room.forces, 3 * where, k))
            for where in (WITH_SERIES if room.home is not None else WITHOUT)
        ),
        (room.old, room.begun),
        (room.series, room.beyond),
        np.float64(h),
    )
    for speeds, speed in zip((c.vx, c.vy, c.vz), w, strict=True):
        speeds[i] = type_of(h, speed)


def _row(numbers: Any) -> Any:
    return tuple(np.float64(each) for each in numbers)


def _column(rows: Any, first: int, k: Any) -> Any:
    """Three numbers of column k, from the row `first` on."""
    return np.float64(rows[first, k]), np.float64(rows[first + 1, k]), np.float64(rows[first + 2, k])
