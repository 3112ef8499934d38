"""How fast things are at the time of their impact within a step, and how fast they rebound in its middle, where impulses are
given."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import WORLD
from particlesim.engine.rigid.contact_rows import speed_along
from particlesim.engine.rigid.narrow import clamped

RESTING = 2.0
"""A contact rebounds only if it approaches faster than this many times the speed that forces give in a step."""


@outlined
def lean(b: Any, k: Any, motion: Any, h: Any) -> None:
    """Where a particle hits a body that lies on something, the kick of the step counts as not given: what it lies on takes
    that back."""
    hit = False
    for c in range(k.number[0]):
        hit |= k.late[0, c] > 0
    if hit:
        for i in range(b.w.size):
            motion.low[i] = 0.0
        for c in range(k.number[0]):
            if k.late[0, c] == 0 and speed_along(k, motion, c, 0) * h < -max(k.gap[c], 0.0):
                motion.low[k.first[c]] = 1.0
                if k.second[c] != WORLD:
                    motion.low[k.second[c]] = 1.0
        for c in range(k.number[0]):
            if motion.low[k.first[c]] > 0 and k.late[0, c] > 0:
                k.late[2, c] = -k.late[2, c]


def kick_along(b: Any, k: Any, motion: Any, c: Any, second: Any, h: Any) -> Any:
    """The speed along the normal of a contact that forces give to its first or second body in a step."""
    i, start = (k.second[c], 12) if second else (k.first[c], 9)
    e, f = k.rows[c, 0], motion.pull[i]
    speed = b.w[i] * (e[0] * f[0] + e[1] * f[1] + e[2] * f[2])
    return h * (speed + e[start] * f[3] + e[start + 1] * f[4] + e[start + 2] * f[5])


@outlined
def find_carried(b: Any, k: Any, motion: Any, h: Any) -> None:
    """Where bodies hit each other with some rebound, which of them lie on something, into `bend`: that takes the kick of
    forces back. `target` still has the speeds before it."""
    hit = False
    for c in range(k.number[0]):
        hit |= rebounds_from_body(b, k, c) and k.target[c] < 0
    for i in range(b.w.size if hit else 0):
        motion.bend[i] = 0.0
    for c in range(k.number[0] if hit else 0):
        now, before = speed_along(k, motion, c, 0), k.target[c]
        meets = now * h < -max(k.gap[c], 0.0) and k.turns[c] == 0 and not k.late[0, c] > 0
        if meets and not before < -RESTING * abs(now - before):
            if kick_along(b, k, motion, c, False, h) < 0:
                motion.bend[k.first[c]] = 1.0
            if k.second[c] != WORLD and kick_along(b, k, motion, c, True, h) > 0:
                motion.bend[k.second[c]] = 1.0
    for c in range(k.number[0]):
        k.late[3, c] = 0.0 if not k.late[0, c] > 0 else k.late[3, c]
        if hit and rebounds_from_body(b, k, c) and motion.bend[k.first[c]] != motion.bend[k.second[c]]:
            second = motion.bend[k.second[c]] > 0
            kick = kick_along(b, k, motion, c, second, h)
            k.late[3, c] = kick if second else -kick


def rebounds_from_body(b: Any, k: Any, c: Any) -> bool:
    """Whether a contact is one of two bodies that something moves, with some rebound."""
    pair = k.second[c] != WORLD and k.turns[c] == 0 and not k.late[0, c] > 0
    return bool(pair and k.surface[0, c] > 0 and b.w[k.first[c]] > 0 and b.w[k.second[c]] > 0)


def restitution_at(k: Any, c: Any, speed: Any) -> Any:
    """Restitution of an impact at a contact with a speed of approach: the smaller one of the laws of both sides."""
    if k.falls is None:
        return k.surface[0, c]
    f = k.falls
    one = f[0, c] * max(speed / f[1, c], 1.0) ** (-f[2, c])
    return min(one, f[3, c] * max(speed / f[4, c], 1.0) ** (-f[5, c]))


def speed_there(before: Any, now: Any, gap: Any, h: Any) -> Any:
    """The speed with which a contact closes (`turned_around`)."""
    middle = 0.5 * (before + now)
    return np.sqrt(middle * middle + 2 * max(before - now, 0.0) * gap / h)


def answered(e: Any, stiff: Any) -> Any:
    """By how much an impact changes the speed of approach u, in units of it: 1 + e, but for what the shift by its impulse
    takes, c (Δu)²/2 with the part c = `stiff` of the energies: (1 + c) (Δu)² − 2 u Δu + (1 − e²) u² = 0. It is stopped at
    least, and gains nothing."""
    c = max(stiff, -0.5)
    square = e * e - c * (1 - e * e)
    return max((1 + (np.sqrt(square) if square > 0 else 0.0)) / (1 + c), min(1.0, 2 / (1 + c)))


def mean_time(when: Any, struck: Any, now: Any, h: Any) -> Any:
    """The mean time of the impulse that stops what hits at a time of a step with a speed `struck`, and then carries it until
    the end of the step, by which forces would have made it `now` one."""
    hit = clamped(struck / now, 0.0, 1.0) if now < 0 else 1.0
    return hit * when + (1 - hit) * 0.5 * (when + h)


def turned_around(before: Any, now: Any, gap: Any, e: Any, h: Any) -> Any:
    """The speed of a rebound in the middle of a step, from a speed `before` the kick of the step that is `now` one, a gap
    before contact, such that it comes as high as if it had gone on: with u² + 2 a s on the way there, e² of that, and the
    same way back. In the middle of the step half of the kick is given. With e = 1 that is −u, as for all e without
    forces."""
    middle, fall = 0.5 * (before + now), max(before - now, 0.0) * gap / h
    square = e * e * (middle * middle + 2 * fall) - 2 * fall
    return now - middle + (np.sqrt(square) if square > 0 else 0.0)
