"""Impacts of particles on rods: what hits a collider is all that hangs together.

At the end of a step each particle of a component has bounced for itself: with Δ, normal and friction together, it has
another velocity than at the end v of its free step, and is by s Δ elsewhere, with the time s since its impact. So the
component is led back to the first impact, x* = x − s v + s² a/2 and v* = v − s a, with the mean acceleration a of the step.
There an impulse P_j in each direction d = Δ/|Δ| moves all, as rods pass it on at once: with their rows J,

    V = v* + Σ P_j (1 − M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹ J) M⁻¹ d_j,   P_j ≥ 0,   d_j·V ≥ u_j,   one of both with equality,

where u_j is the part of its approach −d_j·v* with which particle j has left alone. That is a linear complementarity problem
of as many unknowns as touch something then (`contact_forces`). A single impact changes the energy by P d·(v* + V)/2:
by nothing if it is elastic, and none gives any, as no particle alone gains by Δ. From there the rest of the step is one of
RATTLE, of length s, with what a has across the rods; or of several, from impact to impact, as those that come later do it
from where they touch.

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

TOGETHER, LEGS = 1e-3, 8
"""The part of a step within which impacts are at once; times at which a component hits something in a step, at most: at the
last one all that is left does."""
HITS = 2.0
"""What changes a velocity by more than so many times what the step has changed of it otherwise is an impact."""
NOTICED = 1e-9
"""The part of what a step changes of a velocity up to which rods leave what contact has done."""
HAS_HIT, LIES = 1, 2
"""What a component has done in the step that is looked at again: something of it has hit something, or rods change how it
lies; else 0."""


class Blows(NamedTuple):
    """Room for impacts. Of all slots, places and velocities at the end of the free step, or at an impact, those after
    contact of each for itself, and at the first impact (`back`) [6, slots], and the acceleration since that [3, slots]. Of
    all components, what they have done, and the work on led ends until then [J]. Of one component at a time, contacts, one
    for each slot that has hit something: whether it does not lie (`collider`), how far it is from there (`place`) [m], the
    part of its approach that it keeps (`keep`), and the time since its impact, or the velocity at the end of what lies
    (`need`)."""

    free: Any
    own: Any
    back: Any
    pull: Any
    state: Any
    spent: Any
    touch: Touch


def new_blows(slots: int, components: int, touch: Touch) -> Blows:
    """Room for so many slots and components."""
    free, own, back = (np.zeros((6, slots)) for _ in range(3))
    state = np.zeros(components, np.int64)
    return Blows(free, own, back, np.zeros((3, slots)), state, np.zeros(components), touch)


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
            count = find_hits(rods, clock, c, before, k)
            if rebound(rods, c, before, k, h) if count > 0 else shake(rods, c, k, 0.0):
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
def rebound(rods: Any, c: Any, before: Any, k: Any, h: Any) -> bool:
    """Lead component k from its first impact through all others to the end of the step; whether its rods could be held.
    Where they cannot be held from impact to impact, as in a whip, all that has hit something does it at once."""
    rig, blows = rods.rig, rods.blows
    since, effort = go_back(rods, c, before, k, h), rods.effort[k]
    for s in range(rig.slots[k], rig.slots[k + 1]):
        for n in range(6):
            blows.back[n, s] = blows.free[n, s]
    if go_on(rods, c, k, since, TOGETHER * h):
        return True
    rods.failed[k], rods.effort[k] = -1, effort
    for s in range(rig.slots[k], rig.slots[k + 1]):
        for n in range(6):
            blows.free[n, s] = blows.back[n, s]
    take_aim_at(rods, k)
    hit(rods, k, since, 0.0, True)
    fly(rods, c, k, since)
    return bool(shake(rods, c, k, since))


@outlined
def go_on(rods: Any, c: Any, k: Any, since: Any, near: Any) -> bool:
    """Lead component k from impact to impact to the end of the step, `since` after the first; whether its rods could be
    held."""
    left = since
    for leg in range(LEGS):
        hit(rods, k, left, near, leg == LEGS - 1)
        way = max(next_impact(rods, k), near)
        if leg == LEGS - 1 or not way < left:
            break
        if leg == 0:  # the way back has not held rods
            fly(rods, c, k, 0.0)
            if not shake(rods, c, k, 0.0):
                return False
            keep_places(rods, c, k)
        fly(rods, c, k, way)
        if not shake(rods, c, k, way):
            return False
        level(rods, c, k)
        come_nearer(rods, c, k)
        left -= way
    fly(rods, c, k, left)
    return bool(shake(rods, c, k, left))


def hit(rods: Any, k: Any, left: Any, near: Any, last: Any) -> None:
    """Give a component the velocities after the impacts of a time, from those before; the end of the step is `left` after
    it."""
    rig, blows, bench = rods.rig, rods.blows, rods.bench
    first = rig.slots[k]
    factor(rig, bench, k)
    take_away(rig, bench, blows.free, 3, k)
    take_away(rig, bench, blows.pull, 0, k)
    ask_rebounds(rods, k, left, near, last)
    find_forces(rods, bench.arm, k, False)
    for e in range(rig.rods[k + 1] - rig.rods[k]):
        rods.effort[k] += blows.touch.force[e] * bench.lead[rig.rods[k] + e]
    for s in range(first, rig.slots[k + 1]):
        if rig.inverse[s] > 0:
            for axis in range(3):
                blows.free[3 + axis, s] = blows.touch.after[axis, s - first]


def keep_places(rods: Any, c: Any, k: Any) -> None:
    """Go on from where a component is, with the velocities that are kept."""
    rig, free = rods.rig, rods.blows.free
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        free[0, s], free[1, s], free[2, s] = c.x[i], c.y[i], c.z[i]


def come_nearer(rods: Any, c: Any, k: Any) -> None:
    """Go on from where a component is; what it has hit has come nearer by as much as it has moved."""
    rig, touch, free = rods.rig, rods.blows.touch, rods.blows.free
    first = rig.slots[k]
    for m in range(touch.first[rig.slots[k + 1] - first]):
        s = first + touch.slot[m]
        touch.place[m] -= along(touch, free, 0, s, m)
    keep_places(rods, c, k)
    for m in range(touch.first[rig.slots[k + 1] - first]):
        s = first + touch.slot[m]
        touch.place[m] += along(touch, free, 0, s, m)
    for s in range(first, rig.slots[k + 1]):
        i = rig.rows[s]
        free[3, s], free[4, s], free[5, s] = c.vx[i], c.vy[i], c.vz[i]


@outlined
def go_back(rods: Any, c: Any, before: Any, k: Any, h: Any) -> float:
    """Lead a component back to its first impact, and return the time since that."""
    rig, touch, free, pull = rods.rig, rods.blows.touch, rods.blows.free, rods.blows.pull
    first, since = rig.slots[k], 0.0
    count = touch.first[rig.slots[k + 1] - first]
    for s in range(first, rig.slots[k + 1]):
        i = rig.rows[s]
        for axis in range(3):
            pull[axis, s] = (free[3 + axis, s] - before[3 + axis, i]) / h
    for m in range(count):
        s = first + touch.slot[m]
        i, size, end = rig.rows[s], touch.need[m], along(touch, free, 3, s, m)
        touch.place[m], touch.keep[m] = 0.0, 0.0
        if touch.collider[m] > 0:
            x, y, z = c.x[i] - free[0, s], c.y[i] - free[1, s], c.z[i] - free[2, s]
            touch.need[m] = min(np.sqrt(x * x + y * y + z * z) / size, h)
            since = max(since, touch.need[m])
            approach = touch.need[m] * along(touch, pull, 0, s, m) - end
            touch.keep[m] = min(max(size / approach - 1, 0.0), 1.0) if approach > 0 else 0.0
        else:
            touch.need[m] = end + size
    for m in range(count):
        if touch.collider[m] > 0:
            s, ahead = first + touch.slot[m], since - touch.need[m]
            a = along(touch, pull, 0, s, m)
            touch.place[m] = -ahead * (along(touch, free, 3, s, m) - since * a + 0.5 * ahead * a)
    for s in range(first, rig.slots[k + 1]):
        for axis in range(3):
            a = pull[axis, s]
            free[axis, s] += since * (0.5 * since * a - free[3 + axis, s])
            free[3 + axis, s] -= since * a
    take_aim_at(rods, k)
    return float(since)


def take_aim_at(rods: Any, k: Any) -> None:
    """Aim the rods of a component at the places that are kept."""
    rig, free, arm = rods.rig, rods.blows.free, rods.bench.arm
    for e in range(rig.rods[k], rig.rods[k + 1]):
        for axis in range(3):
            arm[axis, e] = free[axis, rig.first[e]] - free[axis, rig.second[e]]


def ask_rebounds(rods: Any, k: Any, left: Any, near: Any, last: Any) -> None:
    """Ask for rebounds of what touches something, to a time; of all that comes to something at the `last` time. What lies
    has its velocity at the end of the step, which is `left`."""
    rig, touch, free, first = rods.rig, rods.blows.touch, rods.blows.free, rods.rig.slots[k]
    for s in range(first, rig.slots[k + 1]):
        for axis in range(3):
            touch.base[axis, s - first] = free[3 + axis, s]
    for e in range(rig.rods[k + 1] - rig.rods[k]):
        touch.force[e] = 0.0
    for m in range(touch.first[rig.slots[k + 1] - first]):
        s = first + touch.slot[m]
        approach = -along(touch, free, 3, s, m)
        touch.static[m], touch.kinetic[m] = 0.0, 0.0
        if touch.collider[m] == 0:
            touch.goal[m] = touch.need[m] - left * along(touch, rods.blows.pull, 0, s, m)
        elif last or touch.place[m] <= near * max(approach, 0.0):
            touch.goal[m] = max(touch.keep[m] * approach, 0.0)
        else:
            touch.goal[m] = -np.inf


def next_impact(rods: Any, k: Any) -> float:
    """The time until something of a component that flies on comes to what it has hit alone; infinite if nothing does."""
    touch, first, least = rods.blows.touch, rods.rig.slots[k], np.inf
    for m in range(touch.first[rods.rig.slots[k + 1] - first]):
        if touch.collider[m] > 0:
            approach = -along(touch, rods.blows.free, 3, first + touch.slot[m], m)
            if approach > 0:
                least = min(least, max(touch.place[m], 0.0) / approach)
    return float(least)


def fly(rods: Any, c: Any, k: Any, way: Any) -> None:
    """Lead a component on for a time, but for its rods."""
    rig, free, pull = rods.rig, rods.blows.free, rods.blows.pull
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        if rig.inverse[s] > 0:
            x, y, z = (
                free[axis, s] + way * (free[3 + axis, s] + 0.5 * way * pull[axis, s]) for axis in range(3)
            )
            c.x[i], c.y[i], c.z[i] = x, y, z
            x, y, z = (free[3 + axis, s] + way * pull[axis, s] for axis in range(3))
            c.vx[i], c.vy[i], c.vz[i] = x, y, z


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
