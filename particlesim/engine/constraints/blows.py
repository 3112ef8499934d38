"""Impacts of particles on rods: what hits a collider is all that hangs together.

At the end of a step each particle of a component has bounced for itself: with Δ, normal and friction together, it has
another velocity than at the end v of its free step, and is by s Δ elsewhere, with the time s since its impact. So the
component is led back to the impact, x* = x − s v + s² a/2 and v* = v − s a, with the mean acceleration a of the step. There
an impulse P_j in each direction d = Δ/|Δ| moves all, as rods pass it on at once: with their rows J,

    V = v* + Σ P_j (1 − M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹ J) M⁻¹ d_j,   P_j ≥ 0,   d_j·V ≥ u_j,   one of both with equality,

where u_j is the velocity with which particle j alone leaves. That is a linear complementarity problem of as many unknowns as
have hit something; it is solved by sweeps (Gauss–Seidel, projected). A single impact changes the energy by P d·(v* + V)/2:
by nothing if it is elastic, and none gives any, as no particle alone gains by Δ. From there the rest of the step is one of
RATTLE, of length s, with what a has across the rods.

This is done where something hits, rather than lies: where Δ is above what the step has changed of its velocity besides.
What lies is brought to rest for itself, and to what rods allow afterwards; where that changes it, `lying` finds all of it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import kernel, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.constraints.shake_rattle import (
    ROUNDING,
    assemble,
    eliminate,
    level,
    places,
    shake,
    solve,
)

MOST = 32
"""Particles of a component that may hit something in a step; where there are more, each bounces for itself."""
ROWS = 384
"""Directions at all contacts of a component that lies (`lying`); where there are more, each lies for itself."""
ROOM = 1 << 22
"""Numbers for what impulses do, at most."""
HITS = 2.0
"""What changes a velocity by more than so many times what the step has changed of it otherwise is an impact."""
SWEEPS = 500
SETTLED = 1e-13
"""Sweeps over all impulses at most, and the part of the largest velocity that is no longer looked at."""
STUCK = 1e-10
"""The part of its mobility below which rods leave a particle none."""
NOTICED = 1e-9
"""The part of what a step changes of a velocity up to which rods leave what contact has done."""
HAS_HIT, LIES = 1, 2
"""What a component has done in the step that is looked at again: something of it has hit something, or rods change how it
lies; else 0."""


class Blows(NamedTuple):
    """Room for impacts. Of all slots, places and velocities at the end of the free step, or at the impact, and those after
    contact of each for itself [6, slots], and the acceleration since the impact [3, slots]. Of all components, what they
    have done, and the work on led ends until then [J].

    Of one component at a time: the slots that have hit something, and 1 where they do not lie, or the slots, kinds and
    colliders of rows (`lying`) [3, most]; directions, those of impulses, and of rows those of the
    surface at the beginning of the step [3, most]; the velocity along these that is lacking [m/s], impulses
    [kg m/s], the work of these on led ends for every unit, and, of rows, the velocity that must be, the place of the
    surface along it, and coefficients of friction, the last one that which acts,
    what is left to do, and the impulses of a first look [10, most]; the velocities of slots for
    every unit of an impulse, three rows each [3 most, slots], and, in rows, along which directions [most, most]."""

    free: Any
    own: Any
    pull: Any
    state: Any
    spent: Any
    hit: Any
    direction: Any
    push: Any
    begun: Any
    number: Any
    moves: Any
    matrix: Any


def new_blows(slots: int, components: int, largest: int) -> Blows:
    """Room for so many slots and components, the largest with so many slots."""
    most = max(3, min(ROWS, ROOM // (3 * max(largest, 1))))
    of_slots = (np.zeros((6, slots)), np.zeros((6, slots)), np.zeros((3, slots)))
    of_all = (*of_slots, np.zeros(components, np.int64), np.zeros(components))
    ways = (np.zeros((3, most)), np.zeros((3, most)), np.zeros((3, most)))
    rows = (np.zeros((3, most), np.int64), *ways, np.zeros((10, most)))
    return Blows(*of_all, *rows, np.zeros((3 * most, largest)), np.zeros((most, most)))


def before_contact(rods: Any, c: Any, share: Any) -> None:
    """Keep the end of the free step of all components of a thread; returns when those of all threads are kept."""
    if rods is not None and rods.touched:
        meet(share.gate, share.threads)
        keep_free(rods, places(c))
        meet(share.gate, share.threads)


@kernel
def keep_free(rods: Any, c: Any) -> None:
    """Keep places and velocities of all components of a thread."""
    rig, free = rods.rig, rods.blows.free
    for s in range(rig.slots[rods.first], rig.slots[rods.last]):
        i = rig.rows[s]
        free[0, s], free[1, s], free[2, s] = c.x[i], c.y[i], c.z[i]
        free[3, s], free[4, s], free[5, s] = c.vx[i], c.vy[i], c.vz[i]


@kernel
def pass_blows_on(rods: Any, clock: Any, c: Any, before: Any, h: Any) -> bool:
    """Have all components of a thread that have hit something end the step as a whole, and hold their rods; whether that
    could be done. `before` is the beginning of the step of h."""
    held, blows = True, rods.blows
    for k in range(rods.first, rods.last):
        blows.state[k] = 0
        if has_met(rods, c, k):
            keep_own(rods, c, k)
            blows.spent[k] = rods.effort[k]
            count, since = find_hits(rods, clock, c, before, k), 0.0
            if count > 0:
                since = go_back(rods, c, before, count, k, h)
                find_moves(rods, rods.bench.arm, count, k)
                find_impulses(rods, count)
                go_on(rods, c, count, k, since)
            if shake(rods, c, k, since):
                level(rods, c, k)
                if count > 0:
                    blows.state[k] = HAS_HIT
                elif disagree(rods, clock, c, before, k):
                    blows.state[k] = LIES
            else:
                held = False
    return held


def keep_own(rods: Any, c: Any, k: Any) -> None:
    """Keep what contact has done to a component."""
    rig, own = rods.rig, rods.blows.own
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        own[0, s], own[1, s], own[2, s] = c.x[i], c.y[i], c.z[i]
        own[3, s], own[4, s], own[5, s] = c.vx[i], c.vy[i], c.vz[i]


def disagree(rods: Any, clock: Any, c: Any, before: Any, k: Any) -> bool:
    """Whether rods have changed what contact has done to a component of which nothing has stuck, or is gone."""
    rig, own, free, some = rods.rig, rods.blows.own, rods.blows.free, False
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        if clock is not None and clock.outcome[i] != 0:
            return False
        x, y, z = own[3, s] - free[3, s], own[4, s] - free[4, s], own[5, s] - free[5, s]
        if x * x + y * y + z * z > 0 and rig.inverse[s] > 0:
            x, y, z = c.vx[i] - own[3, s], c.vy[i] - own[4, s], c.vz[i] - own[5, s]
            a, b, d = free[3, s] - before[3, i], free[4, s] - before[4, i], free[5, s] - before[5, i]
            some |= x * x + y * y + z * z > NOTICED * NOTICED * (a * a + b * b + d * d)
            x, y, z = c.x[i] - own[0, s], c.y[i] - own[1, s], c.z[i] - own[2, s]
            a, b, d = free[0, s] - before[0, i], free[1, s] - before[1, i], free[2, s] - before[2, i]
            least = 4 * ROUNDING * (abs(own[0, s]) + abs(own[1, s]) + abs(own[2, s]))
            some |= x * x + y * y + z * z > NOTICED * NOTICED * (a * a + b * b + d * d) + least * least
    return bool(some)


def has_met(rods: Any, c: Any, k: Any) -> bool:
    """Whether contact has moved anything of a component, or has changed its velocity."""
    rig, free, met = rods.rig, rods.blows.free, False
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        same = (c.x[i] == free[0, s]) & (c.y[i] == free[1, s]) & (c.z[i] == free[2, s])
        met |= not (same & (c.vx[i] == free[3, s]) & (c.vy[i] == free[4, s]) & (c.vz[i] == free[5, s]))
    return bool(met)


@outlined
def find_hits(rods: Any, clock: Any, c: Any, before: Any, k: Any) -> int:
    """The slots of a component whose velocity contact has changed; 0 if none has hit anything, if there is no room for all
    or if one has stuck, or is gone."""
    rig, blows, free, count, some = rods.rig, rods.blows, rods.blows.free, 0, False
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        x, y, z = c.vx[i] - free[3, s], c.vy[i] - free[4, s], c.vz[i] - free[5, s]
        change = x * x + y * y + z * z
        if change > 0 and rig.inverse[s] > 0:
            full = count == MOST or count == blows.hit.shape[1]
            if full or (clock is not None and clock.outcome[i] != 0):
                return 0
            a, b, d = free[3, s] - before[3, i], free[4, s] - before[4, i], free[5, s] - before[5, i]
            hits, size = change > HITS * HITS * (a * a + b * b + d * d), np.sqrt(change)
            some = some or hits
            blows.hit[0, count], blows.hit[1, count] = s, 1 if hits else 0
            n = (x / size, y / size, z / size)
            blows.direction[0, count], blows.direction[1, count], blows.direction[2, count] = n
            blows.push[0, count], blows.push[1, count], blows.push[2, count] = n
            blows.number[0, count], blows.number[1, count], blows.number[2, count] = size, 0.0, 0.0
            count += 1
    return count if some else 0


@outlined
def go_back(rods: Any, c: Any, before: Any, count: Any, k: Any, h: Any) -> float:
    """Lead a component back to its first impact, and return the time since that."""
    rig, blows, bench, free = rods.rig, rods.blows, rods.bench, rods.blows.free
    since = 0.0
    for m in range(count):
        s = blows.hit[0, m]
        i = rig.rows[s]
        x, y, z = c.x[i] - free[0, s], c.y[i] - free[1, s], c.z[i] - free[2, s]
        if blows.hit[1, m] > 0:
            since = max(since, min(np.sqrt(x * x + y * y + z * z) / blows.number[0, m], h))
        # The velocity with which it would leave: at the impact, or at the end if it lies.
        blows.number[0, m] += along(blows, free, m)
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        for axis in range(3):
            a = (free[3 + axis, s] - before[3 + axis, i]) / h
            free[axis, s] += since * (0.5 * since * a - free[3 + axis, s])
            free[3 + axis, s] -= since * a
            blows.pull[axis, s] = a
    for m in range(count):
        if blows.hit[1, m] > 0:
            s, d = blows.hit[0, m], blows.direction
            for axis in range(3):
                blows.number[0, m] -= since * d[axis, m] * blows.pull[axis, s]
    for e in range(rig.rods[k], rig.rods[k + 1]):
        for axis in range(3):
            bench.arm[axis, e] = free[axis, rig.first[e]] - free[axis, rig.second[e]]
    assemble(rig, bench, bench.arm, bench.arm, k)
    eliminate(rig, bench, k, rig.looped[k])
    take_away(rig, bench, bench.arm, free, 3, 0, k)
    take_away(rig, bench, bench.arm, blows.pull, 0, 0, k)
    for m in range(count):
        blows.number[0, m] -= along(blows, free, m)
        if blows.hit[1, m] == 0:
            s, d = blows.hit[0, m], blows.direction
            for axis in range(3):
                blows.number[0, m] -= since * d[axis, m] * blows.pull[axis, s]
    return float(since)


def along(blows: Any, free: Any, m: Any) -> Any:
    """The velocity of what has hit something along its direction."""
    s, d = blows.hit[0, m], blows.direction
    return d[0, m] * free[3, s] + d[1, m] * free[4, s] + d[2, m] * free[5, s]


@outlined
def take_away(rig: Any, bench: Any, ways: Any, moves: Any, row: Any, first: Any, k: Any) -> float:
    """Take away what three rows of velocities, from one on, have along the rods of a component, by impulses along `ways`
    [3, rods]; the matrix of both is ready. Their first column is that of slot `first`. Returns the work on led ends."""
    arm, begin, end, effort = bench.arm, rig.rods[k], rig.rods[k + 1], 0.0
    for e in range(begin, end):
        i, j, speed = rig.first[e] - first, rig.second[e] - first, 0.0
        for axis in range(3):
            speed += arm[axis, e] * (moves[row + axis, j] - moves[row + axis, i])
        bench.side[e] = speed
    solve(rig, bench, k)
    for e in range(begin, end):
        i, j, size = rig.first[e] - first, rig.second[e] - first, bench.side[e]
        effort += size * bench.lead[e]
        one, two = rig.inverse[rig.first[e]] * size, rig.inverse[rig.second[e]] * size
        for axis in range(3):
            moves[row + axis, i] += one * ways[axis, e]
            moves[row + axis, j] -= two * ways[axis, e]
    return effort


@outlined
def find_moves(rods: Any, ways: Any, count: Any, k: Any) -> None:
    """What an impulse at every slot that has hit something moves, as rods pass it on along `ways`, and along all of their
    directions."""
    rig, blows, moves, first = rods.rig, rods.blows, rods.blows.moves, rods.rig.slots[k]
    for m in range(count):
        s, d = blows.hit[0, m], blows.push
        for axis in range(3):
            for at in range(rig.slots[k + 1] - first):
                moves[3 * m + axis, at] = 0.0
            moves[3 * m + axis, s - first] = rig.inverse[s] * d[axis, m]
        blows.number[2, m] = take_away(rig, rods.bench, ways, moves, 3 * m, first, k)
    for o in range(count):
        for m in range(count):
            at, d, total = blows.hit[0, m] - first, blows.direction, 0.0
            for axis in range(3):
                total += d[axis, m] * moves[3 * o + axis, at]
            blows.matrix[o, m] = total


@outlined
def find_impulses(rods: Any, count: Any) -> None:
    """The impulses of a component [kg m/s]."""
    rig, blows, number, matrix, largest = rods.rig, rods.blows, rods.blows.number, rods.blows.matrix, 0.0
    for m in range(count):
        largest = max(largest, abs(number[0, m]))
    for _ in range(SWEEPS):
        worst = 0.0
        for m in range(count):
            if matrix[m, m] > STUCK * rig.inverse[blows.hit[0, m]]:
                lacks = number[0, m]
                for o in range(count):
                    lacks -= matrix[o, m] * number[1, o]
                impulse = max(number[1, m] + lacks / matrix[m, m], 0.0)
                worst = max(worst, abs(impulse - number[1, m]) * matrix[m, m])
                number[1, m] = impulse
        if not worst > SETTLED * largest:
            break


@outlined
def go_on(rods: Any, c: Any, count: Any, k: Any, since: Any) -> None:
    """Give a component the impulses, and lead it on for a time since the impact, but for its rods."""
    rig, blows, free, first = rods.rig, rods.blows, rods.blows.free, rods.rig.slots[k]
    for m in range(count):
        rods.effort[k] += blows.number[1, m] * blows.number[2, m]
    for s in range(first, rig.slots[k + 1]):
        i, at = rig.rows[s], s - first
        if rig.inverse[s] > 0:
            for axis in range(3):
                for m in range(count):
                    free[3 + axis, s] += blows.number[1, m] * blows.moves[3 * m + axis, at]
                a = blows.pull[axis, s]
                free[axis, s] += since * (free[3 + axis, s] + 0.5 * since * a)
                free[3 + axis, s] += since * a
            c.x[i], c.y[i], c.z[i] = free[0, s], free[1, s], free[2, s]
            c.vx[i], c.vy[i], c.vz[i] = free[3, s], free[4, s], free[5, s]
