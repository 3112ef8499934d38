"""Impacts of particles on rods: what hits a collider is all that hangs together.

At the end of a step each particle of a component has bounced for itself: with Δ, normal and friction together, it has
another velocity than at the end v of its free step, and is by s Δ elsewhere, with the time s since its impact. So the
component is led back to the impact, x* = x − s v + s² a/2 and v* = v − s a, with the mean acceleration a of the step. There
an impulse P_j in each direction d = Δ/|Δ| moves all, as rods pass it on at once: with their rows J,

    V = v* + Σ P_j (1 − M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹ J) M⁻¹ d_j,   P_j ≥ 0,   d_j·V ≥ u_j,   one of both with equality,

where u_j is the velocity with which particle j alone leaves. That is a linear complementarity problem of as many unknowns as
have hit something (`contact_forces`). A single impact changes the energy by P d·(v* + V)/2:
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
from particlesim.engine.constraints.contact_forces import Touch, find_forces
from particlesim.engine.constraints.shake_rattle import (
    ROUNDING,
    assemble,
    eliminate,
    level,
    places,
    shake,
    solve,
)

HITS = 2.0
"""What changes a velocity by more than so many times what the step has changed of it otherwise is an impact."""
NOTICED = 1e-9
"""The part of what a step changes of a velocity up to which rods leave what contact has done."""
HAS_HIT, LIES = 1, 2
"""What a component has done in the step that is looked at again: something of it has hit something, or rods change how it
lies; else 0."""


class Blows(NamedTuple):
    """Room for impacts. Of all slots, places and velocities at the end of the free step, or at the impact, and those after
    contact of each for itself [6, slots], and the acceleration since the impact [3, slots]. Of all components, what they
    have done, and the work on led ends until then [J]. Of one component at a time, contacts, one for each slot that has hit
    something, and whether it does not lie."""

    free: Any
    own: Any
    pull: Any
    state: Any
    spent: Any
    touch: Touch


def new_blows(slots: int, components: int, touch: Touch) -> Blows:
    """Room for so many slots and components."""
    of_slots = (np.zeros((6, slots)), np.zeros((6, slots)), np.zeros((3, slots)))
    return Blows(*of_slots, np.zeros(components, np.int64), np.zeros(components), touch)


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
                since = go_back(rods, c, before, k, h)
                find_forces(rods, rods.bench.arm, k, False)
                go_on(rods, c, k, since)
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
    """The slots of component k whose velocity contact has changed, as contacts in the direction of that; 0 if none has hit
    anything, or if one has stuck, or is gone."""
    rig, touch, free, count, some = rods.rig, rods.blows.touch, rods.blows.free, 0, False
    first = rig.slots[k]
    for s in range(first, rig.slots[k + 1]):
        i = rig.rows[s]
        touch.first[s - first] = count
        x, y, z = c.vx[i] - free[3, s], c.vy[i] - free[4, s], c.vz[i] - free[5, s]
        change = x * x + y * y + z * z
        if change > 0 and rig.inverse[s] > 0:
            if clock is not None and clock.outcome[i] != 0:
                return 0
            a, b, d = free[3, s] - before[3, i], free[4, s] - before[4, i], free[5, s] - before[5, i]
            hits, size = change > HITS * HITS * (a * a + b * b + d * d), np.sqrt(change)
            some = some or hits
            touch.slot[count], touch.collider[count] = s - first, 1 if hits else 0
            for axis, way in enumerate((x / size, y / size, z / size)):
                touch.normal[axis, count] = touch.push[axis, count] = way
            touch.need[count] = size
            count += 1
    touch.first[rig.slots[k + 1] - first] = count
    return count if some else 0


@outlined
def go_back(rods: Any, c: Any, before: Any, k: Any, h: Any) -> float:
    """Lead a component back to its first impact, and return the time since that."""
    rig, touch, bench, free, pull = rods.rig, rods.blows.touch, rods.bench, rods.blows.free, rods.blows.pull
    first, since = rig.slots[k], 0.0
    count = touch.first[rig.slots[k + 1] - first]
    for m in range(count):
        s = first + touch.slot[m]
        i = rig.rows[s]
        x, y, z = c.x[i] - free[0, s], c.y[i] - free[1, s], c.z[i] - free[2, s]
        if touch.collider[m] > 0:
            since = max(since, min(np.sqrt(x * x + y * y + z * z) / touch.need[m], h))
        # The velocity with which it would leave: at the impact, or at the end if it lies.
        touch.need[m] += along(touch, free, 3, s, m)
    for s in range(first, rig.slots[k + 1]):
        i = rig.rows[s]
        for axis in range(3):
            a = (free[3 + axis, s] - before[3 + axis, i]) / h
            free[axis, s] += since * (0.5 * since * a - free[3 + axis, s])
            free[3 + axis, s] -= since * a
            pull[axis, s] = a
    for m in range(count):
        if touch.collider[m] > 0:
            touch.need[m] -= since * along(touch, pull, 0, first + touch.slot[m], m)
    for e in range(rig.rods[k], rig.rods[k + 1]):
        for axis in range(3):
            bench.arm[axis, e] = free[axis, rig.first[e]] - free[axis, rig.second[e]]
    factor(rig, bench, k)
    take_away(rig, bench, free, 3, k)
    take_away(rig, bench, pull, 0, k)
    for m in range(count):
        touch.goal[m], touch.static[m], touch.kinetic[m] = touch.need[m], 0.0, 0.0
        if touch.collider[m] == 0:
            touch.goal[m] -= since * along(touch, pull, 0, first + touch.slot[m], m)
    for s in range(first, rig.slots[k + 1]):
        for axis in range(3):
            touch.base[axis, s - first] = free[3 + axis, s]
    for e in range(rig.rods[k + 1] - rig.rods[k]):
        touch.force[e] = 0.0
    return float(since)


def along(touch: Any, of: Any, row: Any, s: Any, m: Any) -> Any:
    """Three rows of slot s, from one on, along the direction of contact m."""
    d = touch.normal
    return d[0, m] * of[row, s] + d[1, m] * of[row + 1, s] + d[2, m] * of[row + 2, s]


def factor(rig: Any, bench: Any, k: Any) -> None:
    """Get the matrix of a component ready that is aimed at where it is."""
    assemble(rig, bench, bench.arm, bench.arm, k)
    eliminate(rig, bench, k, rig.looped[k])


@outlined
def take_away(rig: Any, bench: Any, moves: Any, row: Any, k: Any) -> None:
    """Take away what three rows of velocities of slots, from one on, have along the rods of a component, whose matrix is
    ready."""
    arm, begin, end = bench.arm, rig.rods[k], rig.rods[k + 1]
    for e in range(begin, end):
        i, j, speed = rig.first[e], rig.second[e], 0.0
        for axis in range(3):
            speed += arm[axis, e] * (moves[row + axis, j] - moves[row + axis, i])
        bench.side[e] = speed
    solve(rig, bench, k)
    for e in range(begin, end):
        i, j, size = rig.first[e], rig.second[e], bench.side[e]
        for axis in range(3):
            moves[row + axis, i] += rig.inverse[i] * size * arm[axis, e]
            moves[row + axis, j] -= rig.inverse[j] * size * arm[axis, e]


@outlined
def go_on(rods: Any, c: Any, k: Any, since: Any) -> None:
    """Give a component the velocities after its impacts, and lead it on for a time since then, but for its rods."""
    rig, blows, touch, first = rods.rig, rods.blows, rods.blows.touch, rods.rig.slots[k]
    free, begin = blows.free, rig.rods[k]
    for e in range(rig.rods[k + 1] - begin):
        rods.effort[k] += touch.force[e] * rods.bench.lead[begin + e]
    for s in range(first, rig.slots[k + 1]):
        i, at = rig.rows[s], s - first
        if rig.inverse[s] > 0:
            for axis in range(3):
                a = blows.pull[axis, s]
                free[axis, s] += since * (touch.after[axis, at] + 0.5 * since * a)
                free[3 + axis, s] = touch.after[axis, at] + since * a
            c.x[i], c.y[i], c.z[i] = free[0, s], free[1, s], free[2, s]
            c.vx[i], c.vy[i], c.vz[i] = free[3, s], free[4, s], free[5, s]
