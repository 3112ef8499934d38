"""What hangs on rods to bodies, where a step has led a particle of it through a collider: it stays before that."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.engine.rigid.bodies import Bodies, Motion
from particlesim.engine.rigid.held_walls import passed
from particlesim.engine.rigid.kernel import Scene, close_joints
from particlesim.engine.rigid.support import Support
from particlesim.engine.rigid.visit import Visitors
from particlesim.model.arrays import Floats

SLACK = 64 * float(np.finfo(float).eps)
"""Rounding of a place by which it may be behind a collider, as a part of the largest coordinate."""
STOPS = 8
"""Turns in which what must not come nearer to a collider is stopped, and its rods share that out."""


class SetOut(NamedTuple):
    """The visitors before a step, and the places [3, n] and orientations [4, n] of bodies and particles on rods."""

    visitors: Visitors
    x: Floats
    turn: Floats


def keep_before_walls(
    scene: Scene, support: Support, begun: SetOut, whole: Bodies, motion: Motion, t: float, h: float
) -> tuple[bool, int]:
    """What hangs together with a particle on rods that a step of h from a time t has led through a thin collider, or deep
    into a thick one, stays before that until the end of the step, and comes no nearer. Whether joints could be held, and
    how many particles that are."""
    visitors, some, component = begun.visitors, slice(begun.visitors.held), scene.joints.component
    n = whole.w.size - visitors.held
    found, how = np.zeros(visitors.held, np.int64), np.zeros((6, visitors.held))
    places = (begun.x[:, n:], np.ascontiguousarray(whole.x[:, n:]))
    gain, slack = np.ascontiguousarray(visitors.gain[:, some]), SLACK * float(np.abs(begun.x).max())
    given = (visitors.kind[some], visitors.radius[some], *places, gain)
    passed(support.walls, *given, slack, t, h, found, how)
    stopped = np.flatnonzero(found)
    for m in stopped.tolist():
        same = component == component[n + m]
        whole.x[:, same], whole.turn[:, same] = begun.x[:, same] + h * how[3:, m, None], begun.turn[:, same]
    normal, lead = how[:3, stopped], how[3:, stopped]
    for _ in range(STOPS if stopped.size else 0):
        come = np.minimum(((whole.v[:, n + stopped] - lead) * normal).sum(axis=0), 0.0)
        whole.v[:, n + stopped] -= come * normal
        if not close_joints(scene, whole, motion):
            return False, 0
    return True, len(stopped)
