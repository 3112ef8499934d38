"""Bodies that move and turn freely, and how fast they are."""

from __future__ import annotations

from typing import Any

from particlesim.engine.rigid.bodies import orientation, row
from particlesim.engine.rigid.rotation import turned_by, turned_freely, world_inverse


def own(scene: Any, b: Any) -> int:
    """How many bodies there are without guests."""
    return int(b.w.size if scene.guests is None else scene.guests.first)


def move(b: Any, i: Any, h: Any) -> None:
    """Move and turn a body freely."""
    for axis in range(3):
        b.x[axis, i] += h * b.v[axis, i]
    q = turned_freely(orientation(b, i), row(b.spin, i), row(b.inertia, i), h)
    b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q


def velocity_of(b: Any, motion: Any, i: Any) -> None:
    """Velocity and angular velocity of body i as it is, into `now`; impulses have given it nothing yet."""
    world_inverse(orientation(b, i), row(b.inertia, i), motion.inverse[i])
    turning = turned_by(motion.inverse[i], row(b.spin, i))
    for axis in range(3):
        motion.now[i, axis] = b.v[axis, i]
        motion.gained[i, axis] = 0.0
    motion.now[i, 3], motion.now[i, 4], motion.now[i, 5] = turning
