"""What hangs on rods to bodies, where a step has led a particle of it through a collider: it stays before that."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.rigid.bodies import Bodies, Motion
from particlesim.engine.rigid.held_walls import passed
from particlesim.engine.rigid.kernel import Scene, close_joints, velocities_of
from particlesim.engine.rigid.support import Support
from particlesim.engine.rigid.visit import Visitors
from particlesim.model.arrays import Floats

SLACK = 64 * float(np.finfo(float).eps)
"""Rounding of a place by which it may be behind a collider, as a part of the largest coordinate."""
STOPS = 8
"""Turns in which what must not come nearer to a collider is stopped, and its rods share that out."""


class SetOut(NamedTuple):
    """The visitors before a step, and places [3, n], velocities [3, n], orientations [4, n] and angular momenta [3, n] of
    bodies and particles on rods."""

    visitors: Visitors
    x: Floats
    v: Floats
    turn: Floats
    spin: Floats


def set_out(visitors: Visitors, whole: Bodies, bodies: int) -> SetOut:
    """How a step begins, with so many bodies."""
    some = slice(bodies + visitors.held)
    return SetOut(visitors, *(each[:, some].copy() for each in whole[:4]))


def keep_before_walls(
    scene: Scene, support: Support, begun: SetOut, whole: Bodies, motion: Motion, t: float, h: float
) -> tuple[bool, int]:
    """What hangs together with a particle on rods that a step of h from a time t has led through a thin collider, or deep
    into a thick one, stays before that until the end of the step, and comes no nearer. As it does not move, it becomes no
    faster than it was, or than forces make it in a step. Whether joints could be held, and how many particles that are."""
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
    for k in np.unique(component[n + stopped]):
        same = (component == k) & (whole.w > 0)
        ends = whole.v[:, same].copy(), whole.spin[:, same].copy()
        now = _kinetic(whole, motion, same)
        whole.v[:, same], whole.spin[:, same] = begun.v[:, same], begun.spin[:, same]
        beads = same[n:]
        most = max(
            _kinetic(whole, motion, same), 0.5 * float(((gain**2)[:, beads] / whole.w[n:][beads]).sum())
        )
        slower = min(1.0, np.sqrt(most / now)) if now > 0 else 1.0
        whole.v[:, same], whole.spin[:, same] = slower * ends[0], slower * ends[1]
    normal, lead = how[:3, stopped], how[3:, stopped]
    for _ in range(STOPS if stopped.size else 0):
        come = np.minimum(((whole.v[:, n + stopped] - lead) * normal).sum(axis=0), 0.0)
        whole.v[:, n + stopped] -= come * normal
        if not close_joints(scene, whole, motion):
            return False, 0
    return True, len(stopped)


def _kinetic(whole: Bodies, motion: Motion, some: NDArray[np.bool_]) -> float:
    """The kinetic energy of some bodies and particles [J]."""
    velocities_of(whole, motion)
    turning = (motion.now[some, 3:].T * whole.spin[:, some]).sum()
    return float(0.5 * ((whole.v[:, some] ** 2 / whole.w[some]).sum() + turning))
