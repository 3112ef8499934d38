"""What overlaps by more than the slop is pushed apart by velocities of its own, which move bodies in this step and are then
forgotten, so that they give no energy.

Source: split impulses, E. Coumans, GDC 2006.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import shared
from particlesim.engine.rigid.bodies import GUEST, WORLD
from particlesim.engine.rigid.braced import level_there
from particlesim.engine.rigid.contact_rows import presses
from particlesim.engine.rigid.solver import level_all
from particlesim.engine.rigid.support import CARRIED, note_carried
from particlesim.engine.rigid.timing import kick_along

FAST = 2.0
"""Speed of approach in units of what forces bring about in a step from which on a contact closes fast."""
PUSHES, MOST_PUSHES = 12, 400
"""Sweeps that push apart; where all of an overlap is to be taken away, at most."""
APART = 1e-3
"""Change of a speed that ends them then, as a part of it."""
PART = 0.2
"""Part of an overlap that is taken away in a step."""


@shared
def push_apart(b: Any, k: Any, motion: Any, joints: Any, guests: Any, slop: Any, h: Any) -> bool:
    """Velocities, into `apart`, that take away a part of what overlaps; whether there are any. What lies on something does
    not give way to what lies on it. Particles among bodies move apart from each other, and from colliders, in their own
    step."""
    count, turns = 0, PUSHES
    if guests is not None:
        note_carried(guests, k)
    for c in range(k.number[0]):
        if k.names[0, c] != GUEST:
            m = -1 if guests is None else k.second[c] - guests.first
            stays = m >= 0 and guests.crowd.rests[m] == CARRIED and presses(k, c)
            back = way_back(b, k, motion, c, h) if stays and not k.late[0, c] > 0 else 0.0
            over = -k.gap[c] - (slop if k.gap[c] < 0 else 0.0)
            if over > 0 or over + back > 0:
                # What came fast has lost more than it costs to lift all of the overlap.
                fast = back > 0.5 * FAST * h * abs(kick_along(b, k, motion, c, False, h))
                k.order[count] = -1 - c if stays else c
                k.before[c, 0] = ((over if fast or over < 0 else PART * over) + back) / h
                turns = MOST_PUSHES if back > 0 else turns
                count += 1
    if count == 0:
        return False
    for i in range(b.w.size):
        for axis in range(6):
            motion.apart[i, axis] = 0.0
    turn, going = 0, True
    while turn < turns and going:
        going = turn < PUSHES
        for place_in in range(count):
            at = k.order[count - 1 - place_in if turn % 2 == 1 else place_in]
            c = at if at >= 0 else -1 - at
            changed = nudge(b, k, motion, c, k.before[c, 0], at < 0)
            going = going or changed > APART * k.before[c, 0]
            if joints is not None and k.braced[c] > 0:
                level_there(b, k, joints, motion.apart, motion.other, c)
        for cluster in range(motion.clusters[0]):
            level_all(b, motion, motion.apart, motion.other, joints, cluster)
        turn += 1
    return True


def way_back(b: Any, k: Any, motion: Any, c: Any, h: Any) -> Any:
    """How far a body has gone on in the half of a step that is over towards a particle which is carried. To lift it as far
    again costs what that has given."""
    e, m, o = k.rows[c, 0], motion.start[k.first[c]], motion.start[k.second[c]]
    u = 0.0
    for axis in range(3):
        u += e[axis] * (m[axis] - o[axis]) + e[3 + axis] * m[3 + axis] - e[6 + axis] * o[3 + axis]
    u += kick_along(b, k, motion, c, True, h) - kick_along(b, k, motion, c, False, h)
    return 0.5 * h * max(-u, 0.0)


def nudge(b: Any, k: Any, motion: Any, c: Any, speed: Any, stays: Any) -> Any:
    """Bring the bodies of a contact to separate at a speed; a second one that stays, where it is, is a particle. Returns by
    how much that changes the speed."""
    e, i, j = k.rows[c, 0], k.first[c], k.second[c]
    m = motion.apart[i]
    u = e[0] * m[0] + e[1] * m[1] + e[2] * m[2] + e[3] * m[3] + e[4] * m[4] + e[5] * m[5]
    if j != WORLD:
        o = motion.apart[j]
        u -= e[0] * o[0] + e[1] * o[1] + e[2] * o[2] + e[6] * o[3] + e[7] * o[4] + e[8] * o[5]
    had = k.impulse[c, 3]
    mass = 1 / (1 / e[15] - b.w[j]) if stays else e[15]
    press = max(had - mass * (u - speed), 0.0)
    k.impulse[c, 3] = press
    size = press - had
    for axis in range(3):
        m[axis] += size * b.w[i] * e[axis]
        m[3 + axis] += size * e[9 + axis]
    if j != WORLD and not stays:
        o = motion.apart[j]
        for axis in range(3):
            o[axis] -= size * b.w[j] * e[axis]
            o[3 + axis] -= size * e[12 + axis]
    return abs(size) / mass
