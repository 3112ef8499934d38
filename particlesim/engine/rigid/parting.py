"""What overlaps by more than the slop is pushed apart by velocities of its own, which move bodies in this step and are then
forgotten, so that they give no energy.

Source: split impulses, E. Coumans, GDC 2006.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import shared
from particlesim.engine.rigid.bodies import GUEST, WORLD
from particlesim.engine.rigid.braced import level_there
from particlesim.engine.rigid.grains import CARRIED
from particlesim.engine.rigid.solver import level_all

PUSHES = 12
"""Sweeps that push apart."""
PART = 0.2
"""Part of an overlap that is taken away in a step."""


@shared
def push_apart(b: Any, k: Any, motion: Any, joints: Any, guests: Any, slop: Any, h: Any) -> bool:
    """Velocities, into `apart`, that take away a part of what overlaps; whether there are any. What lies on something does
    not give way to what lies on it."""
    deep = False
    for c in range(k.number[0]):
        deep = deep or (k.gap[c] < -slop and k.names[0, c] != GUEST)
    if not deep:
        return False
    if guests is not None:
        note_carried(guests, k)
    for i in range(b.w.size):
        for axis in range(6):
            motion.apart[i, axis] = 0.0
    for turn in range(PUSHES):
        for place_in in range(k.number[0]):
            c = k.number[0] - 1 - place_in if turn % 2 == 1 else place_in
            if k.gap[c] < -slop and k.names[0, c] != GUEST:
                m = -1 if guests is None else k.second[c] - guests.first
                stays = m >= 0 and guests.rests[m] == CARRIED and not k.target[c] > 0
                nudge(b, k, motion, c, PART * (-k.gap[c] - slop) / h, stays)
                if joints is not None and k.braced[c] > 0:
                    level_there(b, k, joints, motion.apart, motion.other, c)
        for cluster in range(motion.clusters[0]):
            level_all(b, motion, motion.apart, motion.other, joints, cluster)
    return True


def note_carried(guests: Any, k: Any) -> None:
    """Note which particles others, or colliders, carry in this step."""
    for c in range(k.number[0]):
        if k.names[0, c] == GUEST and k.turns[c] == 0 and k.impulse[c, 0] > 0:
            for i in (k.first[c], k.second[c]):
                if i >= 0:
                    guests.rests[i - guests.first] = CARRIED


def nudge(b: Any, k: Any, motion: Any, c: Any, speed: Any, stays: Any) -> None:
    """Bring the bodies of a contact to separate at a speed; a second one that stays, where it is, is a particle."""
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
