"""Particles on rods that lie on colliders: what lies is all that hangs together.

Contact of a particle by itself cancels what presses it; what rods add, of the weight of others, it does not know. So where
rods change what contact has done, the contact forces of a component are found together with those of its rods
(`contact_forces`), from the velocity v of the free step to V, after contact (Moreau and Jean's time-stepping). The normal
velocity must be that of the surface for what touches it, less for what is above it by a gap. Places change by θ h (V − v),
where θ is how the method has moved them by what it has added to velocities: ½ for velocity Verlet, 1 for symplectic Euler.
So what lies stays where it was.

Rods are of second order: what has come into a collider as they were put right is moved out of it along normals in the same
manner, by lengths instead of velocities.

Sources: M. Jean, Comput. Methods Appl. Mech. Eng. 177, 235 (1999); J. J. Moreau, ibid. 177, 329 (1999).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.constraints.blows import LIES, pass_blows_on
from particlesim.engine.constraints.contact_forces import find_forces
from particlesim.engine.constraints.shake_rattle import aim, hold, level, load, places, shake
from particlesim.engine.constraints.touching import Look, find_depths, find_touch, hard
from particlesim.engine.state.columns import fetch, type_of
from particlesim.engine.step.crossing import passed, thin
from particlesim.laws.registry import moved_to

TURNS = 4
"""How often what is inside of a collider is put out, and rods put right after that."""
NEAR = 8.0
"""Gap up to which a particle takes part, in ways that forces move the fastest in a step."""
STRETCHED = 1e-11
"""The part of the largest velocity by which rods may be stretched."""


def after_contact(parts: Any, rods: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """Pass on what components of a thread have hit in a step of h that has begun at `before`, find what lies, and hold their
    rods; returns when those of all threads are held."""
    if rods is not None and rods.touched:
        meet(share.gate, share.threads)
        here = places(c)
        if c.spin is not None:  # what impulses do to spheres that turn is not known here
            held = hold(rods, here, 0.0, True)
        else:
            held = pass_blows_on(rods, c.clock, here, before, h)
            held = held and settle(parts, rods, c, before, t, end, h)
        if not held:
            share.wild[8 * share.number] = 1
        meet(share.gate, share.threads)


def settle(parts: Any, rods: Any, c: Any, before: Any, t: Any, end: Any, h: Any) -> bool:
    """Find what lies on colliders anew in all components of a thread for which contact and rods disagree, and put out of
    colliders what rods have led there; whether rods could be held."""
    held = True
    if any(len(hard(part.contacts)) > 0 for part in parts):
        for k in range(rods.first, rods.last):
            state = rods.blows.state[k]
            if state > 0:
                held = _settle(parts, rods, c, before, k, state, t, end, h) and held
    return held


@outlined
def _settle(parts: Any, rods: Any, c: Any, before: Any, k: Any, state: Any, t: Any, end: Any, h: Any) -> bool:
    held = True
    if state == LIES:
        part, change = lateness(rods, before, k, h)
        look = Look(before, t, end, part * h, NEAR * h * change)
        held = find_touch(parts, rods, c, look, k) == 0 or lie(parts, rods, c, look, k)
    else:
        look = Look(before, t, end, 0.0, h * fastest(rods, k))
        if find_touch(parts, rods, c, look, k) > 0:
            held = lift_out(parts, rods, c, k, end)
            if held:
                level(rods, places(c), k)
    if held and c.missed is not None:
        count_missed(parts, rods, c, before, k, end, h)
    return held


@outlined
def lateness(rods: Any, before: Any, k: Any, h: Any) -> Any:
    """θ of a component in the free step, and the largest change of a velocity in it [m/s]."""
    rig, free, way, all_of_it, most = rods.rig, rods.blows.free, 0.0, 0.0, 0.0
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i, square = rig.rows[s], 0.0
        if rig.inverse[s] > 0:
            for axis in range(3):
                a = free[3 + axis, s] - before[3 + axis, i]
                way += a * (free[axis, s] - before[axis, i] - h * before[3 + axis, i]) / rig.inverse[s]
                square += a * a
            all_of_it += h * square / rig.inverse[s]
            most = max(most, square)
    return (min(max(way / all_of_it, 0.0), 1.0) if all_of_it > 0 else 0.5), np.sqrt(most)


def fastest(rods: Any, k: Any) -> Any:
    """The largest speed in a component before or after contact [m/s]."""
    rig, free, own, most = rods.rig, rods.blows.free, rods.blows.own, 0.0
    for s in range(rig.slots[k], rig.slots[k + 1]):
        a, b = 0.0, 0.0
        for axis in range(3, 6):
            a, b = a + free[axis, s] * free[axis, s], b + own[axis, s] * own[axis, s]
        most = max(most, a, b)
    return np.sqrt(most)


@outlined
def lie(parts: Any, rods: Any, columns: Any, look: Any, k: Any) -> bool:
    """End the step of a component anew, from its free one, with the forces of its contacts; whether its rods could be
    held."""
    c = places(columns)
    rig, touch, free, own = rods.rig, rods.blows.touch, rods.blows.free, rods.blows.own
    first, begin, number = rig.slots[k], rig.rods[k], rig.rods[k + 1] - rig.rods[k]
    rods.effort[k] = rods.blows.spent[k]
    put(rods, c, free, k)
    load(rig, rods.bench, c, k)
    aim(rig, rods.bench, c, k)
    for e in range(number):
        touch.force[e] = 0.0
    ask_velocities(rods, c, touch.land, k)
    if find_forces(rods, rods.bench.arm, k, True) < np.inf:
        shift(rods, c, k, look.late)
    else:  # contacts ask for what rods do not allow: each for itself, and rods after that
        put(rods, c, own, k)
    for e in range(number):
        touch.kept[e] = touch.force[e]
    if not (shake(rods, c, k, 0.0) and lift_out(parts, rods, columns, k, look.end)):
        return False
    throw(rods, c, free, k)
    level(rods, c, k)
    for e in range(number):
        touch.force[e] = touch.kept[e]
    aim_along_means(rods, look.before, k)
    ask_velocities(rods, c, touch.need, k)
    left = find_forces(rods, rods.bench.reach, k, True)
    if left < np.inf:
        for e in range(number):
            rods.effort[k] += touch.force[e] * rods.bench.lead[begin + e]
        for s in range(first, rig.slots[k + 1]):
            i, at = rig.rows[s], s - first
            if rig.inverse[s] > 0:
                c.vx[i], c.vy[i], c.vz[i] = touch.after[0, at], touch.after[1, at], touch.after[2, at]
    else:
        throw(rods, c, own, k)
    if left > STRETCHED:
        level(rods, c, k)
    return True


def put(rods: Any, c: Any, of: Any, k: Any) -> None:
    """Give a component the places and velocities of an array [6, slots]."""
    for s in range(rods.rig.slots[k], rods.rig.slots[k + 1]):
        i = rods.rig.rows[s]
        if rods.rig.inverse[s] > 0:
            c.x[i], c.y[i], c.z[i] = of[0, s], of[1, s], of[2, s]
    throw(rods, c, of, k)


def throw(rods: Any, c: Any, of: Any, k: Any) -> None:
    """Give a component the velocities of such an array."""
    for s in range(rods.rig.slots[k], rods.rig.slots[k + 1]):
        i = rods.rig.rows[s]
        if rods.rig.inverse[s] > 0:
            c.vx[i], c.vy[i], c.vz[i] = of[3, s], of[4, s], of[5, s]


def ask_velocities(rods: Any, c: Any, least: Any, k: Any) -> None:
    """Ask for the `least` normal velocities of all contacts, from the velocities that a component has, by forces along the
    means of normals."""
    rig, touch, first = rods.rig, rods.blows.touch, rods.rig.slots[k]
    for s in range(first, rig.slots[k + 1]):
        i, at = rig.rows[s], s - first
        touch.base[0, at], touch.base[1, at], touch.base[2, at] = c.vx[i], c.vy[i], c.vz[i]
    for m in range(touch.first[rig.slots[k + 1] - first]):
        touch.goal[m], square = least[m], 0.0
        for axis in range(3):
            touch.push[axis, m] = 0.5 * (touch.normal[axis, m] + touch.begun[axis, m])
            square += touch.push[axis, m] * touch.push[axis, m]
        for axis in range(3):
            touch.push[axis, m] /= np.sqrt(square)


def aim_along_means(rods: Any, before: Any, k: Any) -> None:
    """Set `reach` to the means of where rods are and were at the beginning of the step: what turns them does no work."""
    rig, bench = rods.rig, rods.bench
    for e in range(rig.rods[k], rig.rods[k + 1]):
        i, j = rig.rows[rig.first[e]], rig.rows[rig.second[e]]
        for axis in range(3):
            was = before[axis, i] - before[axis, j]
            bench.reach[axis, e] = 0.5 * (bench.arm[axis, e] + was)


def shift(rods: Any, c: Any, k: Any, late: Any) -> None:
    """Move a component by what contact changes of its velocities, in a time."""
    rig, touch, first = rods.rig, rods.blows.touch, rods.rig.slots[k]
    for s in range(first, rig.slots[k + 1]):
        i, at = rig.rows[s], s - first
        if rig.inverse[s] > 0:
            x, y, z = (touch.after[axis, at] - touch.base[axis, at] for axis in range(3))
            c.x[i], c.y[i], c.z[i] = c.x[i] + late * x, c.y[i] + late * y, c.z[i] + late * z


@outlined
def lift_out(parts: Any, rods: Any, columns: Any, k: Any, end: Any) -> bool:
    """Put what is inside of a collider, or behind one, out of it along normals; whether rods could be held."""
    c = places(columns)
    rig, touch = rods.rig, rods.blows.touch
    slots = rig.slots[k + 1] - rig.slots[k]
    for _ in range(TURNS):
        deepest, slack = find_depths(parts, rods, columns, k, end)
        if not deepest > slack:
            break
        for at in range(slots):
            for axis in range(3):
                touch.base[axis, at] = 0.0
        for m in range(touch.first[slots]):
            for axis in range(3):
                touch.push[axis, m] = touch.normal[axis, m]
        for e in range(rig.rods[k + 1] - rig.rods[k]):
            touch.force[e] = 0.0
        if find_forces(rods, rods.bench.arm, k, False) == np.inf:  # rods do not let it out
            break
        shift(rods, c, k, 1.0)
        if not shake(rods, c, k, 0.0):
            return False
    return True


@outlined
def count_missed(parts: Any, rods: Any, c: Any, before: Any, k: Any, end: Any, h: Any) -> None:
    """Count particles of a component that are on the other side of something thin than at the beginning of the step."""
    for s in range(rods.rig.slots[k], rods.rig.slots[k + 1]):
        i = rods.rig.rows[s]
        if rods.rig.inverse[s] > 0:
            for part in parts:
                if len(thin(part.contacts)) > 0:
                    mine = (part.first <= i) & (i < part.last)
                    if mine:
                        q = fetch(c, i, end)
                        x, y, z = before[0, i], before[1, i], before[2, i]
                        p = moved_to(q, x, y, z, before[3, i], before[4, i], before[5, i], end - h)
                        c.missed[i] += passed(part.contacts, p, q, type_of(q.x, h))
