"""What acts on bodies: forces on points that have their mass, and through their surface.

Laws of forces act on six points on the principal axes of a body, a sixth each, at distances d with 2 d_k²/6 = ∫ x_k² dm/m:
they have its mass, its centre and its moments of inertia, so that forces which grow linearly over the body are exact.
Fluids act through its surface.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import on_stack, outlined
from particlesim.engine.rigid.bodies import orientation, place
from particlesim.engine.rigid.fluids import Swept, Wetted, Whole, act, stored
from particlesim.engine.rigid.narrow import plus
from particlesim.engine.rigid.rotation import cross, matrix
from particlesim.engine.rigid.springs import pull
from particlesim.laws.registry import Particle, force, potential

POINTS = 6


def point_of(scene: Any, b: Any, i: Any, r: Any, now: Any, point: Any, t: Any) -> Any:
    """One of the six points of a body as laws see it, with the whole body's mass and size; and its arm. `now` are its
    velocity and angular velocity."""
    axis = point // 2
    size = scene.arms[axis, i] if point % 2 == 0 else -scene.arms[axis, i]
    arm = (
        size * (r[0] if axis == 0 else (r[1] if axis == 1 else r[2])),
        size * (r[3] if axis == 0 else (r[4] if axis == 1 else r[5])),
        size * (r[6] if axis == 0 else (r[7] if axis == 1 else r[8])),
    )
    return as_particle(scene, b, i, now, arm, t), arm


def as_particle(scene: Any, b: Any, i: Any, now: Any, arm: Any, t: Any) -> Particle:
    """A place of a body as laws see it, with the whole body's mass and size; `now` are its velocity and angular velocity."""
    x, u = plus(place(b, i), 1.0, arm), cross((now[3], now[4], now[5]), arm)
    m = scene.mass[i]
    return Particle(
        x[0],
        x[1],
        x[2],
        now[0] + u[0],
        now[1] + u[1],
        now[2] + u[2],
        m,
        scene.radius[i],
        0.0,
        t,
        1 / m,
        *[0.0 if column is None else column[i] for column in scene.further],
    )


@outlined
def add_forces(scene: Any, forces: Any, b: Any, motion: Any, i: Any, t: Any) -> None:
    """Add the forces and torques of laws on body i to `pull`."""
    r = matrix(orientation(b, i))
    now = motion.now[i]
    fx, fy, fz, gx, gy, gz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for point in range(POINTS):
        p, arm = point_of(scene, b, i, r, now, point, t)
        f = force(forces, p)
        g = cross(arm, f)
        fx, fy, fz, gx, gy, gz = fx + f[0], fy + f[1], fz + f[2], gx + g[0], gy + g[1], gz + g[2]
    k, out = 1 / POINTS, motion.pull[i]
    out[0], out[1], out[2] = out[0] + k * fx, out[1] + k * fy, out[2] + k * fz
    out[3], out[4], out[5] = out[3] + k * gx, out[4] + k * gy, out[5] + k * gz


@outlined
def add_surface_forces(scene: Any, others: Any, b: Any, motion: Any, i: Any, t: Any) -> None:
    """The same of what acts through the surface of body i."""
    r, now, out = matrix(orientation(b, i)), motion.now[i], on_stack(1, 6, np.float64)
    for part in range(6):
        out[0, part] = 0.0
    p = as_particle(scene, b, i, now, (0.0, 0.0, 0.0), t)
    for each in others:
        act(each, p, r, (now[3], now[4], now[5]), out)
    for part in range(6):
        motion.pull[i, part] += out[0, part]


@outlined
def sum_all_forces(scene: Any, b: Any, motion: Any, t: Any) -> None:
    """Forces and torques on all bodies, as they are and move now, into `pull`."""
    for i in range(b.w.size):
        for axis in range(6):
            motion.pull[i, axis] = 0.0
    for stretch in scene.stretches:
        if len(stretch.forces) > 0:
            for i in range(stretch.first, stretch.last):
                add_forces(scene, stretch.forces, b, motion, i, t)
        if len(stretch.others) > 0:
            for i in range(stretch.first, stretch.last):
                add_surface_forces(scene, stretch.others, b, motion, i, t)
    for springs in scene.springs:
        pull(springs, b, motion.now, motion.pull)
    if scene.guests is not None:
        for m in range(scene.guests.radius.size):
            for axis in range(3):
                motion.pull[scene.guests.first + m, axis] += scene.guests.other[axis, m]


@outlined
def power(scene: Any, law: Any, b: Any, motion: Any, i: Any, t: Any) -> float:
    """Power of a law with the velocities `stage` on a body that moves as in `other` [W]."""
    r, total = matrix(orientation(b, i)), 0.0
    if isinstance(law, Whole | Wetted | Swept):
        now, mean, out = motion.stage[i], motion.other[i], on_stack(1, 6, np.float64)
        for part in range(6):
            out[0, part] = 0.0
        p = as_particle(scene, b, i, now, (0.0, 0.0, 0.0), t)
        act(law, p, r, (now[3], now[4], now[5]), out)
        for part in range(6):
            total += out[0, part] * mean[part]
        return total
    for point in range(POINTS):
        p, _ = point_of(scene, b, i, r, motion.stage[i], point, t)
        q, _ = point_of(scene, b, i, r, motion.other[i], point, t)
        f = force((law,), p)
        total += f[0] * q.vx + f[1] * q.vy + f[2] * q.vz
    return total / POINTS


@outlined
def potential_of(scene: Any, law: Any, b: Any, motion: Any, i: Any, t: Any) -> float:
    """Potential energy of body i in a law [J]."""
    r, m, total = matrix(orientation(b, i)), motion.now[i], 0.0
    if isinstance(law, Whole | Wetted):
        return float(stored(law, as_particle(scene, b, i, m, (0.0, 0.0, 0.0), t), r))
    for point in range(POINTS):
        p, _ = point_of(scene, b, i, r, m, point, t)
        total += potential(law, p)
    return total / POINTS
