"""The impact of a swift body in the midst of a drift.

Contacts of two bodies that touch get the impulses that the solver would give them: restitution along the normal, friction
within its cone, and no gain. Velocities are not those of that time: in the first half of a step forces have not acted since
its beginning, in the second they have acted up to its end. With `late` the time by which a velocity is behind, and a = F/m,
what meets is u + a·late, and the speed along the normal after it −e (u + a·late) − a·late. So an impact takes the part
1 − e² of the energy of motion along the normal whenever it is, and with e = 1 none.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import WORLD, row
from particlesim.engine.rigid.contact_rows import direct, speed_along
from particlesim.engine.rigid.energy import NOISE
from particlesim.engine.rigid.narrow import clamped
from particlesim.engine.rigid.rotation import cross
from particlesim.engine.rigid.stops import tangent
from particlesim.engine.rigid.sweeps import relax
from particlesim.engine.rigid.timing import kick_along, restitution_at


@outlined
def rebound(b: Any, k: Any, motion: Any, i: Any, j: Any, close: Any, late: Any) -> float:
    """Give the impulses of the contacts of bodies i and j, or of i and a collider, that are as close; returns their work
    [J]. First rows of contacts are known, and forces are in `pull`."""
    count, runs = 0, False
    for c in range(k.number[0]):
        if k.gap[c] <= close:
            lay(b, k, motion, c, late)
            runs = runs or k.belt[0, c] != 0 or k.belt[1, c] != 0 or k.belt[2, c] != 0
            k.order[count] = c
            count += 1
    for each in range(2):
        body = i if each == 0 else j
        if body != WORLD:
            save(motion, motion.start, body)
    settle(b, k, motion, i, j, count)
    gained = work_of(b, motion, i, j, late)
    if gained > NOISE * energy_of_pair(b, motion, i, j) and not runs:
        yield_some(b, k, motion, i, j, late, count, gained)
        gained = work_of(b, motion, i, j, late)
    for each in range(2):
        body = i if each == 0 else j
        for axis in range(3 if body != WORLD else 0):
            b.v[axis, body] = motion.now[body, axis]
            b.spin[axis, body] += motion.gained[body, axis]
            motion.gained[body, axis] = 0.0
    return float(gained)


def lay(b: Any, k: Any, motion: Any, c: Any, late: Any) -> None:
    """What impulses do at a contact, and the speed that it is to have: an impact does not roll on (`bending`)."""
    for axis in range(3):
        k.slip[axis, c] = 0.0
    n, at = row(k.normal, c), row(k.point, c)
    one = tangent(n)
    direct(b, k, motion, c, 1, k.first[c], k.second[c], at, one)
    direct(b, k, motion, c, 2, k.first[c], k.second[c], at, cross(n, one))
    for d in range(4):
        k.impulse[c, d] = 0.0
    more = kick_along(b, k, motion, c, False, late)
    if k.second[c] != WORLD:
        more -= kick_along(b, k, motion, c, True, late)
    meets = speed_along(k, motion, c, 0) + more
    k.target[c] = max(-restitution_at(k, c, -meets) * meets - more, 0.0) if meets < 0 else 0.0
    k.struck[c] = max(-meets, 0.0)


@outlined
def settle(b: Any, k: Any, motion: Any, i: Any, j: Any, count: Any) -> None:
    """Find the impulses of the first `count` contacts of `order`, as the solver does for a cluster."""
    motion.contact_from[0], motion.contact_from[1] = 0, count
    motion.body_from[0], motion.body_from[1] = 0, 1 if j == WORLD else 2
    motion.bodies[0], motion.first_component[0], motion.largest[0] = i, -1, 0.0
    if j != WORLD:
        motion.bodies[1] = j
    for at in range(count):
        for d in range(3):
            motion.largest[0] = max(motion.largest[0], abs(speed_along(k, motion, k.order[at], d)))
    relax(b, k, motion, None, 0)


def save(motion: Any, copy: Any, i: Any) -> None:
    """Keep velocities of body i, and what it has gained [n, 9]."""
    for axis in range(6):
        copy[i, axis] = motion.now[i, axis]
    for axis in range(3):
        copy[i, 6 + axis] = motion.gained[i, axis]


def blend(motion: Any, i: Any, part: Any) -> None:
    """Body i has a part of its velocities with a rebound, in `other`, and the rest of those without, in `before`."""
    for axis in range(6):
        low, high = motion.before[i, axis], motion.other[i, axis]
        motion.now[i, axis] = low + part * (high - low)
    for axis in range(3):
        low, high = motion.before[i, 6 + axis], motion.other[i, 6 + axis]
        motion.gained[i, axis] = low + part * (high - low)


def work_of(b: Any, motion: Any, i: Any, j: Any, late: Any) -> float:
    """The work of an impact [J]: what is gained by velocities as they are at that time."""
    total = 0.0
    for each in range(2):
        body = i if each == 0 else j
        if body != WORLD:
            was, now, f = motion.start[body], motion.now[body], motion.pull[body]
            for axis in range(3):
                d, turned = now[axis] - was[axis], now[3 + axis] - was[3 + axis]
                total += 0.5 / b.w[body] * d * (now[axis] + was[axis]) + late * f[axis] * d
                total += 0.5 * motion.gained[body, axis] * (now[3 + axis] + was[3 + axis])
                total += late * f[3 + axis] * turned
    return float(total)


def energy_of_pair(b: Any, motion: Any, i: Any, j: Any) -> float:
    """The energy of motion along before an impact [J], for what rounding may be."""
    total = 0.0
    for each in range(2):
        body = i if each == 0 else j
        for axis in range(3 if body != WORLD else 0):
            was, spin = motion.start[body], b.spin[axis, body]
            total += 0.5 / b.w[body] * was[axis] * was[axis] + 0.5 * abs(spin * was[3 + axis])
    return float(total)


@outlined
def yield_some(b: Any, k: Any, motion: Any, i: Any, j: Any, late: Any, count: Any, gained: Any) -> None:
    """Take back what an impact has `gained` (`solver`): go from the solution without a rebound towards that with one as far
    as it gains nothing, which is a quadratic function of how far."""
    for each in range(2):
        body = i if each == 0 else j
        if body != WORLD:
            save(motion, motion.other, body)
            for axis in range(6):
                motion.now[body, axis] = motion.start[body, axis]
            for axis in range(3):
                motion.gained[body, axis] = 0.0
    for at in range(count):
        c = k.order[at]
        k.target[c] = 0.0
        for d in range(4):
            k.impulse[c, d] = 0.0
    settle(b, k, motion, i, j, count)
    low = work_of(b, motion, i, j, late)
    for each in range(2):
        body = i if each == 0 else j
        if body != WORLD:
            save(motion, motion.before, body)
            blend(motion, body, 0.5)
    bend = 2 * (gained + low - 2 * work_of(b, motion, i, j, late))
    slope = gained - low - bend
    root = np.sqrt(max(slope * slope - 4 * bend * low, 0.0))
    part = clamped((root - slope) / (2 * bend), 0.0, 1.0) if bend > 0 else 0.0
    for each in range(2):
        body = i if each == 0 else j
        if body != WORLD:
            blend(motion, body, part)
