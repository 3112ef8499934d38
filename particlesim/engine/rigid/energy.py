"""The energy that impulses at contacts give in a step, and what takes it back where they give any."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import GUEST, WORLD
from particlesim.engine.rigid.clusters import root, unite
from particlesim.engine.rigid.contact_rows import speed_along
from particlesim.engine.rigid.narrow import clamped
from particlesim.engine.rigid.stops import MOTOR, turn_rate

NOISE = 2.0**-40
"""The part of the energy of motion that a gain may be by rounding."""
UNNOTICED, FREED = 1e-3, 1.0
"""What impulses that have been found may add, as a part of what all of them would add one by one; and what those that a step
begins with add of it, at least, where bodies have come free."""


def keep(now: Any, gained: Any, copy: Any) -> None:
    """Copy velocities and angular momenta from contact [n, 9]."""
    for i in range(len(now)):
        for axis in range(6):
            copy[i, axis] = now[i, axis]
        for axis in range(3):
            copy[i, 6 + axis] = gained[i, axis]


def against_forces(motion: Any, i: Any, h: Any) -> float:
    """What forces do less, by half a drift with other velocities, than they gave in the kick of a step: ½ h F·Δv [J].

    A body that forces take down, and an impact up, goes up by what the kick has given it besides.
    """
    done, was, now, f = 0.0, motion.start[i], motion.now[i], motion.pull[i]
    for axis in range(6):
        done += 0.5 * h * f[axis] * (now[axis] - was[axis])
    return done


def of_time(b: Any, k: Any, motion: Any, c: Any, h: Any) -> float:
    """What forces do less, besides, as the impact of a particle was not in the middle of a step of h [J]; 0 for others.

    Its body is moved by −ΔV t, with t the time from the middle on, and the particle by −Δv τ, with τ that from the beginning
    on (`grains`). That takes work against the forces that act on them in the kick, and on the particle alone.
    """
    if not k.late[0, c] > 0:
        return 0.0
    i, j, away = k.first[c], k.second[c], 0.0
    for axis in range(3):
        total = 0.0
        for d in range(3):
            total += k.rows[c, d, axis] * k.impulse[c, d]
        away += total * (motion.pull[i, axis] * b.w[i] - motion.pull[j, axis] * b.w[j])
    return (0.5 * h - abs(k.late[2, c])) * away - k.late[3, c] * k.late[1, c] * k.impulse[c, 0]


def gained_by(b: Any, motion: Any, i: Any, h: Any) -> float:
    """The energy that impulses in a step of h give to a body, with what forces do less then [J]."""
    was, now, m, work = motion.start[i], motion.now[i], 1 / b.w[i], 0.0
    for axis in range(3):
        work += 0.5 * m * (now[axis] - was[axis]) * (now[axis] + was[axis])
        work += 0.5 * (motion.gained[i, axis] - was[6 + axis]) * (now[3 + axis] + was[3 + axis])
    return work - against_forces(motion, i, h)


@outlined
def taken(b: Any, k: Any, motion: Any, h: Any) -> float:
    """The energy that the impulses of a step of h take, all together [J]."""
    total = 0.0
    for i in range(b.w.size):
        if b.w[i] > 0:
            total -= gained_by(b, motion, i, h)
    for c in range(k.number[0]):
        total += of_time(b, k, motion, c, h)
    return total


@outlined
def gains(b: Any, k: Any, motion: Any, joints: Any, h: Any) -> bool:
    """Whether some set of bodies that touch each other gains energy in a step of h; `gain` is that of each, at the body that
    stands for it. Surfaces that run may give energy: what they touch counts as not gaining. The work of a motor is
    its own, up to that at the speed which it is to have: a brake does none that is positive."""
    parent, gain = motion.parent, motion.gain
    for i in range(b.w.size):
        parent[i] = i
        gain[i] = 0.0
    for c in range(k.number[0]):
        if k.impulse[c, 0] > 0 and k.second[c] != WORLD:
            unite(parent, k.first[c], k.second[c])
    if joints is not None:
        for g in range(joints.first.size):
            if joints.second[g] != WORLD:
                unite(parent, joints.first[g], joints.second[g])
    for i in range(b.w.size):
        if not b.w[i] > 0:
            continue  # a guest that nothing moves
        had, was = 0.0, motion.start[i]
        for axis in range(3):
            had += 0.5 * (1 / b.w[i]) * was[axis] * was[axis]
        gain[root(parent, i)] += gained_by(b, motion, i, h) - NOISE * had
    for c in range(k.number[0]):
        gain[root(parent, k.first[c])] -= of_time(b, k, motion, c, h)
    for c in range(k.number[0]):
        if k.turns[c] == MOTOR:
            mean = 0.5 * (turn_rate(k, motion.start, c) + turn_rate(k, motion.now, c))
            gain[root(parent, k.first[c])] -= min(k.impulse[c, 0] * mean, k.impulse[c, 0] * k.aim[0, c])
    for c in range(k.number[0]):
        if k.belt[0, c] != 0 or k.belt[1, c] != 0 or k.belt[2, c] != 0:
            gain[root(parent, k.first[c])] = -np.inf
    gained = False
    for i in range(b.w.size):
        gained = gained or (parent[i] == i and gain[i] > 0)
    return gained


# ---- clusters that gain from nothing
#
# What parts with a speed w before forces turn it around, and is stopped by an impulse P then, has half of the kick less to
# fall from higher: it gains P w/2. Clusters that would gain by that let it come back as fast as it has left.
#
# Impulses that have been found have P·(u − s) ≤ 0 with the velocities u that they give and those that they are to give, s:
# what presses does so with u = s, and friction acts against sliding. What P·(u − s) is above that is energy from nothing, as
# far as there is a gain at all.


@outlined
def start_anew(b: Any, k: Any, motion: Any, h: Any) -> None:
    """Have clusters begin without the impulses of the last step that would add more energy than all of them one by one, as
    those of bodies that were jammed and have come free would. Joints have not had theirs yet."""
    for cluster in range(motion.clusters[0]):
        if motion.first_component[cluster] < 0 and not is_driven(k, motion, cluster):
            gain, bend, _ = account(b, k, motion, cluster, h)
            if gain > FREED * bend:  # less is what they have not been found to
                shrink(k, motion, cluster, 0.0)


@outlined
def let_back(b: Any, k: Any, motion: Any, cluster: Any, h: Any) -> bool:
    """Where a cluster without rebounds gains energy in a step of h, let what has parted in it come back as fast; whether
    there is some. Surfaces that run and motors may give energy."""
    found = False
    if part_that_gains(b, k, motion, cluster, h) > 0:
        for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
            c = k.order[at]
            before = parted(b, k, motion, c, h) if k.turns[c] == 0 and k.impulse[c, 0] > 0 else 0.0
            if -before < k.target[c]:
                k.target[c], found = -before, True
    return found


@outlined
def let_slide(b: Any, k: Any, motion: Any, cluster: Any, h: Any) -> None:
    """Where such a cluster still gains, as what slides uphill is stopped by friction while forces turn it around, make all
    of its impulses smaller; but not below joints, and of particles, whose colliders hold them in their own step."""
    free = motion.first_component[cluster] < 0
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        free = free and k.names[0, c] != GUEST and k.names[1, c] != GUEST
    part = part_that_gains(b, k, motion, cluster, h) if free else 0.0
    if part > 0:
        shrink(k, motion, cluster, max(1.0 - part, 0.0))


def part_that_gains(b: Any, k: Any, motion: Any, cluster: Any, h: Any) -> float:
    """What a cluster without rebounds gains from nothing in a step of h, as a part of what its impulses alone would, 0 if
    that is next to nothing."""
    rebounds = False
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        rebounds = rebounds or k.target[c] > k.bend[c]
    if rebounds or is_driven(k, motion, cluster):
        return 0.0
    gain, bend, _ = account(b, k, motion, cluster, h)
    return gain / bend if gain > UNNOTICED * 2 * bend else 0.0


def parted(b: Any, k: Any, motion: Any, c: Any, h: Any) -> Any:
    """How fast both of a contact part before the kick of a step of h."""
    e, i, j = k.rows[c, 0], k.first[c], k.second[c]
    m, f = motion.start[i], motion.pull[i]
    u = 0.0
    for axis in range(3):
        u += (
            e[axis] * (m[axis] - h * b.w[i] * f[axis])
            + e[3 + axis] * m[3 + axis]
            - h * e[9 + axis] * f[3 + axis]
        )
    if j != WORLD:
        m, f = motion.start[j], motion.pull[j]
        for axis in range(3):
            u -= e[axis] * (m[axis] - h * b.w[j] * f[axis])
            u -= e[6 + axis] * m[3 + axis] - h * e[12 + axis] * f[3 + axis]
    return u


@outlined
def hold_back(b: Any, k: Any, motion: Any, h: Any) -> None:
    """Take back energy from nothing in clusters whose impulses were not found, in a step of h: all of their impulses are
    made smaller, θ P with the largest θ ≤ 1 that does it. Surfaces that run and motors may give energy."""
    for cluster in range(motion.clusters[0]):
        if motion.unsettled[cluster] != 0 and not is_driven(k, motion, cluster):
            part = bearable(b, k, motion, cluster, h)
            if part < 1:
                shrink(k, motion, cluster, part)


def is_driven(k: Any, motion: Any, cluster: Any) -> bool:
    """Whether surfaces that run, or motors, act in a cluster."""
    driven = False
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        driven = driven or k.turns[c] == MOTOR or k.belt[0, c] != 0 or k.belt[1, c] != 0 or k.belt[2, c] != 0
    return driven


@outlined
def account(b: Any, k: Any, motion: Any, cluster: Any, h: Any) -> Any:
    """What a cluster gains in a step of h, what its impulses alone would, and the energy of motion that it has had [J]."""
    gain = bend = had = 0.0
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        if b.w[i] > 0:  # a guest that is held does not move
            was, now, m = motion.start[i], motion.now[i], 1 / b.w[i]
            for axis in range(3):
                dv, dw = now[axis] - was[axis], now[3 + axis] - was[3 + axis]
                e = motion.gained[i, axis] - was[6 + axis]
                gain += 0.5 * m * dv * (now[axis] + was[axis]) + 0.5 * e * (now[3 + axis] + was[3 + axis])
                bend += 0.5 * m * dv * dv + 0.5 * e * dw
                had += 0.5 * m * was[axis] * was[axis]
            gain -= against_forces(motion, i, h)
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        gain -= of_time(b, k, motion, k.order[at], h)
    return gain, bend, had


def bearable(b: Any, k: Any, motion: Any, cluster: Any, h: Any) -> float:
    """The largest part of the impulses of a cluster with which it gains nothing from nothing."""
    gain, bend, had = account(b, k, motion, cluster, h)
    wrong = 0.0
    if not gain > NOISE * had:
        return 1.0
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            if k.impulse[c, d] != 0:
                wrong += k.impulse[c, d] * (speed_along(k, motion, c, d) - (k.target[c] if d == 0 else 0.0))
    if not (wrong > 0 and bend > 0):
        return 1.0
    # what is gained = slope θ + bend θ², which is `gain` at θ = 1
    slope, bears = gain - bend, max(gain - wrong, 0.0)
    return clamped((np.sqrt(slope * slope + 4 * bend * bears) - slope) / (2 * bend), 0.0, 1.0)


def shrink(k: Any, motion: Any, cluster: Any, part: Any) -> None:
    """Leave a part of the impulses of a cluster."""
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        for axis in range(6):
            motion.now[i, axis] = motion.start[i, axis] + part * (motion.now[i, axis] - motion.start[i, axis])
        for axis in range(3):
            had = motion.start[i, 6 + axis]
            motion.gained[i, axis] = had + part * (motion.gained[i, axis] - had)
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        for d in range(3):
            k.impulse[k.order[at], d] *= part
