"""How near bodies in joints come to a collider that they swing past.

A place of a body that turns about a hinge is on a circle. With its gap g, its speed of approach s and its acceleration
a > 0 along the normal, which joints and turning give it, it comes as far as s²/(2a) and turns around after s/a. So what
comes within a step of h, seen from its middle, does not touch unless

    s > √(2 a g)  where it turns around within the step, √(2 g/a) < h,      s > g/h + a h/2  otherwise.

The corner beside the hinge of a door that closes flush on a wall has s = √(2 a g) at any time, and does not press there. A
part of the speed is allowed for what a changes on the way.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bending import core_of
from particlesim.engine.rigid.bodies import GUEST, WORLD, place, row
from particlesim.engine.rigid.joints import component_of
from particlesim.engine.rigid.narrow import minus
from particlesim.engine.rigid.rotation import angular_velocity, cross, dot

ALLOWED = 0.1
"""By which part the speed of what turns around before a wall may be above that with which it comes up to it."""

MORE = 2.0
"""Its speed after a kick, in units of that before, at most: what forces alone drive does not swing."""


@outlined
def watch_swings(b: Any, k: Any, motion: Any, joints: Any, h: Any) -> None:
    """Note how bodies in joints are accelerated along the normals of contacts with colliders: what joints do there they need
    not do by the bend of the surface (`bending`), and those that are not closed yet swing. Velocities are those in the
    middle of a step of h, before its forces; what joints made of them in the first half is in `joints.before`."""
    for c in range(k.number[0]):
        i = k.first[c]
        if k.second[c] != WORLD or k.turns[c] != 0 or not (k.gap[c] > 0 or k.bend[c] > 0):
            continue
        if component_of(joints, i) < 0:
            continue
        n, now, was = row(k.normal, c), motion.now[i], joints.before[i]
        arm = minus(core_of(b, k, c), place(b, i))
        turning = (now[3], now[4], now[5])
        before = angular_velocity(
            (was[3], was[4], was[5], was[6]), (was[10], was[11], was[12]), row(b.inertia, i)
        )
        gains = (now[0] - was[7], now[1] - was[8], now[2] - was[9])
        joined = 2 / h * (dot(n, gains) + dot(n, cross(minus(turning, before), arm)))
        if k.bend[c] > 0:
            k.bend[c] = max(k.bend[c] - 0.5 * h * joined, 0.0)
        if k.gap[c] > 0:
            k.swing[c] = max(dot(n, cross(turning, cross(turning, arm))) + joined, 0.0)


def room_at(k: Any, c: Any, before: Any, free: Any, h: Any) -> Any:
    """The speed with which a contact may close within a step of h without touching. Its speed is `before` the kick of forces
    and `free` after it; what turns around is faster, and so turns faster, in proportion."""
    gap, swing = max(k.gap[c], 0.0), k.swing[c]
    # A particle is where it is: what would be behind meets.
    allowed = 0.0 if k.names[0, c] == GUEST else ALLOWED
    if swing > 0:
        more = min(free / before, MORE) if free < before < 0 else 1.0
        turn = 0.5 * swing * more * more * h
        if turn * h > gap:
            return (1 + allowed) * np.sqrt(4 * turn / h * gap)
        return (1 + allowed * turn * h / gap) * (gap / h + turn)
    return gap / h
