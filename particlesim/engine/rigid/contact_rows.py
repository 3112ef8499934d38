"""What impulses do along the directions of a contact, and how fast its bodies move along them."""

from __future__ import annotations

from typing import Any

from particlesim.engine.rigid.bodies import WORLD, place
from particlesim.engine.rigid.narrow import clamped, minus
from particlesim.engine.rigid.rotation import cross, turned_by
from particlesim.engine.rigid.stops import MOTOR, ROLL


def speed_along(k: Any, motion: Any, c: Any, d: Any) -> Any:
    """Relative velocity of a contact along one of its directions."""
    e, i, j = k.rows[c, d], k.first[c], k.second[c]
    m = motion.now[i]
    u = e[0] * m[0] + e[1] * m[1] + e[2] * m[2] + e[3] * m[3] + e[4] * m[4] + e[5] * m[5]
    if j != WORLD:
        m = motion.now[j]
        u -= e[0] * m[0] + e[1] * m[1] + e[2] * m[2] + e[6] * m[3] + e[7] * m[4] + e[8] * m[5]
    else:
        at = 3 if k.turns[c] == ROLL else 0
        x, y, z = k.belt[0, c] + k.slip[0, c], k.belt[1, c] + k.slip[1, c], k.belt[2, c] + k.slip[2, c]
        u -= e[at] * x + e[at + 1] * y + e[at + 2] * z
    return u


def strike(b: Any, k: Any, motion: Any, c: Any, d: Any, size: Any) -> None:
    """Give a contact an impulse along one of its directions."""
    e, i, j = k.rows[c, d], k.first[c], k.second[c]
    m, g, s = motion.now[i], motion.gained[i], size * b.w[i]
    for axis in range(3):
        m[axis] += s * e[axis]
        m[3 + axis] += size * e[9 + axis]
        g[axis] += size * e[3 + axis]
    if j != WORLD:
        m, g, s = motion.now[j], motion.gained[j], size * b.w[j]
        for axis in range(3):
            m[axis] -= s * e[axis]
            m[3 + axis] -= size * e[12 + axis]
            g[axis] -= size * e[6 + axis]


def direct(b: Any, k: Any, motion: Any, c: Any, d: Any, i: Any, j: Any, at: Any, n: Any) -> None:
    """The row of a contact along a direction."""
    e = k.rows[c, d]
    e[0], e[1], e[2] = n
    arm = cross(minus(at, place(b, i)), n)
    e[3], e[4], e[5] = arm
    e[9], e[10], e[11] = turned_by(motion.inverse[i], arm)
    give = b.w[i] + e[3] * e[9] + e[4] * e[10] + e[5] * e[11]
    if j != WORLD:
        arm = cross(minus(at, place(b, j)), n)
        e[6], e[7], e[8] = arm
        e[12], e[13], e[14] = turned_by(motion.inverse[j], arm)
        give += b.w[j] + e[6] * e[12] + e[7] * e[13] + e[8] * e[14]
    e[15] = 1 / give


def bounded(k: Any, c: Any, impulse: Any) -> Any:
    """The nearest impulse along its first direction that a contact can give."""
    return clamped(impulse, -k.aim[1, c], k.aim[1, c]) if k.turns[c] == MOTOR else max(impulse, 0.0)


def presses(k: Any, c: Any) -> bool:
    """Whether a contact presses in this step, without rebound."""
    return bool(k.turns[c] == 0 and k.impulse[c, 0] > 0 and not k.target[c] > k.bend[c])
