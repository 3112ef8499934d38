"""How the impulses of a cluster of bodies that touch each other are found (`solver`): contact by contact until none changes
(projected Gauss and Seidel), forwards and backwards in turn; sweeps are the steps of a method of conjugate gradients.

Large heaps get fewer sweeps, and go on with them in the next step. Where some bodies are much heavier than others, what
sweeps do not find is looked for directly (`multipliers`).

A contact with two coefficients of friction holds if it can with that at rest, while all others do, too. So impulses are
found with those; what slides even so gets that of motion, and they are found again, until nothing else begins to slide.

Source: M. Silcowitz, S. Niebe, K. Erleben, Visual Computer 26, 893 (2010) (conjugate gradients).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.braced import brace, level_there
from particlesim.engine.rigid.contact_rows import bounded, speed_along, strike
from particlesim.engine.rigid.equations import MOST_BODIES, STEEP
from particlesim.engine.rigid.joints import level
from particlesim.engine.rigid.multipliers import begin_anew, correct, keep_impulses, set_bounds
from particlesim.engine.rigid.stops import ROLL

WORK = 40_000
"""Looks at contacts of a cluster in a step at most, all sweeps together, beyond the least number of sweeps."""
LEAST_SWEEPS, MOST_SWEEPS = 16, 1000
"""Sweeps over a cluster of any size, and over the smallest."""
TURNS, APART = 24, 4
"""Turns of the direct method at most, and those after which it is tried again to have friction go with what presses."""
SETTLED = 1e-9
"""Change of speed in a sweep, relative to the largest one that contact has to deal with, below which nothing changes
any more."""
SLIDES, MAY_SLIDE, SLOWER, GIVING_WAY = 1e-5, 1e-3, 0.1, 8
"""Sliding, as a part of the largest speed that contact has to deal with, below which a contact holds; the same where
impulses have not been found to the end, and what friction may lack there of all that it can be; the part of the speed
that less friction would bring, below which it holds there, too; and how often in a solve others may begin to slide, as
some do."""
ROUNDING = 32 * float(np.finfo(float).eps)
"""Part of an impulse that rounding of some others makes."""


@outlined
def relax(b: Any, k: Any, motion: Any, joints: Any, cluster: Any) -> None:
    """Find the impulses of a cluster. All that it can hold at rest with the friction that this has stays at rest: only what
    slides even so has the friction of motion, which may let others slide, and so have impacts."""
    searches = 1
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        k.friction[c] = k.surface[2 if k.struck[c] > 0 else 1, c]
        searches = 2 if k.surface[2, c] < k.surface[1, c] else searches
    settled = search(b, k, motion, joints, cluster, searches)
    again = GIVING_WAY if settled else 1
    while again > 0 and give_way(k, motion, cluster, settled):
        settled = search(b, k, motion, joints, cluster, searches)
        again -= 1


@outlined
def give_way(k: Any, motion: Any, cluster: Any, settled: Any) -> bool:
    """Let contacts of a cluster that slide, though their friction is all that it can be at rest, have that of motion;
    whether there are any. Where impulses have not `settled` slow sliding may be what they lack: less than a part of what it
    would become by that."""
    found, still = False, (SLIDES if settled else MAY_SLIDE) * motion.largest[cluster]
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        if k.surface[2, c] < k.friction[c]:
            p, q, most = k.impulse[c, 1], k.impulse[c, 2], (1 - MAY_SLIDE) * k.friction[c] * k.impulse[c, 0]
            u, w = speed_along(k, motion, c, 1), speed_along(k, motion, c, 2)
            less = (k.friction[c] - k.surface[2, c]) * k.impulse[c, 0] / k.rows[c, 1, 15]
            slow = still if settled else max(still, SLOWER * less)
            if p * p + q * q >= most * most and u * u + w * w > slow * slow:
                k.friction[c], found = k.surface[2, c], True
    return found


@outlined
def search(b: Any, k: Any, motion: Any, joints: Any, cluster: Any, searches: Any) -> bool:
    """Sweep over a cluster until nothing changes any more, or its share of work is done, one of so many `searches`; whether
    it was the former. Joints are solved for as a whole after each sweep.

    Sweeps are taken for steps of a descent, and followed by one in the direction conjugate to them (Fletcher and Reeves),
    which is dropped where changes grow.
    """
    settled = SETTLED * motion.largest[cluster]
    work = WORK // searches // (motion.contact_from[cluster + 1] - motion.contact_from[cluster])
    most = min(max(work, LEAST_SWEEPS // searches), MOST_SWEEPS)
    worst = descend(b, k, motion, joints, cluster, settled, most)
    motion.unsettled[cluster] = 0
    if not worst > settled:
        return True
    # Joints and friction may hold the same, which the direct method does not tell apart.
    if joints is not None and motion.first_component[cluster] >= 0:
        if brace(b, k, motion, joints, cluster):
            worst = descend(b, k, motion, joints, cluster, settled, most)
        motion.unsettled[cluster] = 1 if worst > settled else 0
        return not worst > settled
    if steepness(b, motion, cluster) >= STEEP:
        found = complete(b, k, motion, cluster, worst)
        motion.unsettled[cluster] = 0 if found else 1
        return found
    return False


@outlined
def descend(b: Any, k: Any, motion: Any, joints: Any, cluster: Any, settled: Any, most: Any) -> float:
    """Sweep over a cluster until speeds change by less than `settled`, or as often as may be at most; returns the change in
    the last sweep."""
    first, last = motion.contact_from[cluster], motion.contact_from[cluster + 1]
    size, worst = 0.0, 0.0
    for turn in range(most):
        if turn % 2 == 0:
            note(k, motion, cluster)
        worst = sweep(b, k, motion, joints, first, last, turn % 2 == 1)
        level_all(b, motion, motion.now, motion.gained, joints, cluster)
        if not worst > settled or turn == most - 1:
            break
        if turn % 2 == 1:
            size = go_on(k, motion, cluster, size)
    return float(worst)


@outlined
def sweep(b: Any, k: Any, motion: Any, joints: Any, first: Any, last: Any, backwards: Any) -> float:
    """One look at every contact of a cluster; returns the largest change of a speed."""
    worst = 0.0
    for turn in range(first, last):
        c = k.order[first + last - 1 - turn if backwards else turn]
        e = k.rows[c]
        had, press = k.impulse[c, 0], 0.0
        if k.turns[c] == ROLL:
            press = k.impulse[int(k.aim[0, c]), 0]
        else:
            wish = had - e[0, 15] * (speed_along(k, motion, c, 0) - k.target[c])
            press = bounded(k, c, wish)
            if press != had:
                strike(b, k, motion, c, 0, press - had)
                k.impulse[c, 0] = press
                worst = max(worst, abs(press - had) / e[0, 15])
                if joints is not None and k.braced[c] > 0:
                    level_there(b, k, joints, motion.now, motion.gained, c)
        if k.surface[1, c] > 0 and (press > 0 or k.impulse[c, 1] != 0 or k.impulse[c, 2] != 0):
            p, q = k.impulse[c, 1], k.impulse[c, 2]
            u, w, most = speed_along(k, motion, c, 1), speed_along(k, motion, c, 2), k.friction[c] * press
            one, two = p - e[1, 15] * u, q - e[2, 15] * w
            if one * one + two * two > most * most:
                # What slides is slowed against its way: both directions with the same mass, or they would turn it.
                mass = min(e[1, 15], e[2, 15])
                one, two = p - mass * u, q - mass * w
                size = np.sqrt(one * one + two * two)
                part = most / size if size > most else 1.0
                one, two = one * part, two * part
            strike(b, k, motion, c, 1, one - p)
            strike(b, k, motion, c, 2, two - q)
            k.impulse[c, 1], k.impulse[c, 2] = one, two
            worst = max(worst, max(abs(one - p) / e[1, 15], abs(two - q) / e[2, 15]))
            if joints is not None and k.braced[c] > 0:
                level_there(b, k, joints, motion.now, motion.gained, c)
    return float(worst)


def level_all(b: Any, motion: Any, now: Any, gained: Any, joints: Any, cluster: Any) -> None:
    """Take away what bodies of a cluster have along their joints."""
    if joints is not None:
        component = motion.first_component[cluster]
        while component >= 0:
            level(joints, b, now, gained, component)
            component = joints.next[component]


def note(k: Any, motion: Any, cluster: Any) -> None:
    """Impulses and velocities before a sweep."""
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            k.before[c, d] = k.impulse[c, d]
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        for d in range(6):
            motion.before[i, d] = motion.now[i, d]
        for d in range(3):
            motion.before[i, 6 + d] = motion.gained[i, d]


def go_on(k: Any, motion: Any, cluster: Any, size: Any) -> float:
    """After a sweep, go on in the direction of those before it; `size` is the square of the change before, 0 for none.
    Returns that of this one."""
    change = 0.0
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            moved = k.impulse[c, d] - k.before[c, d]
            change += moved * moved / k.rows[c, d, 15]
    part = change / size if 0 < change <= size else 0.0
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            extra = part * k.onward[c, d] if part > 0 else 0.0
            k.onward[c, d] = extra + k.impulse[c, d] - k.before[c, d]
            k.impulse[c, d] += extra
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        for d in range(6):
            extra = part * motion.onward[i, d] if part > 0 else 0.0
            motion.onward[i, d] = extra + motion.now[i, d] - motion.before[i, d]
            motion.now[i, d] += extra
        for d in range(3):
            extra = part * motion.onward[i, 6 + d] if part > 0 else 0.0
            motion.onward[i, 6 + d] = extra + motion.gained[i, d] - motion.before[i, 6 + d]
            motion.gained[i, d] += extra
    return float(change)


def complete(b: Any, k: Any, motion: Any, cluster: Any, worst: Any) -> bool:
    """Find what sweeps have not found in a cluster without joints, directly and by sweeps in turn; whether it is found.
    Clusters of many bodies stay as they are."""
    if motion.body_from[cluster + 1] - motion.body_from[cluster] > MOST_BODIES:
        return False
    settled, best = max(SETTLED, ROUNDING * steepness(b, motion, cluster)) * motion.largest[cluster], worst
    keep_impulses(k, motion, cluster)
    begin_anew(b, k, motion, cluster, 0.0)
    again = 1
    for turn in range(TURNS):
        coupled = False
        if turn >= again:
            set_bounds(k, motion, cluster, True)
            coupled = correct(b, k, motion, cluster, False, True)
            again = turn + 1 if coupled else turn + APART
        if not coupled:
            if turn > 0:
                set_bounds(k, motion, cluster, False)
            if not correct(b, k, motion, cluster, turn == 0, False):
                break
            continue
        left = sweep_twice(b, k, motion, cluster)
        if not left > settled:
            return True
        if left < best:
            best = left
            keep_impulses(k, motion, cluster)
    begin_anew(b, k, motion, cluster, 1.0)
    return False


def sweep_twice(b: Any, k: Any, motion: Any, cluster: Any) -> float:
    """Sweep forwards and backwards; returns the largest change of a speed in the second sweep."""
    worst = 0.0
    first, last = motion.contact_from[cluster], motion.contact_from[cluster + 1]
    for backwards in range(2):
        worst = sweep(b, k, motion, None, first, last, backwards == 1)
    return float(worst)


def steepness(b: Any, motion: Any, cluster: Any) -> float:
    """Ratio of the heaviest to the lightest of the bodies of a cluster."""
    heavy, light = 0.0, np.inf
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        w = b.w[motion.bodies[at]]
        if w > 0:
            heavy, light = max(heavy, 1 / w), min(light, 1 / w)
    return float(heavy / light)
