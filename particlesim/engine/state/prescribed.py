"""Pinned particles on prescribed paths: their positions and velocities at any time."""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.compiler import kernel, shared
from particlesim.laws.registry import Particle, path


class Driven(NamedTuple):
    """Particles that one motion leads: its record, their rows, sorted, and where they were laid out [m], each [n]."""

    law: tuple[Any, ...]
    rows: Any
    x: Any
    y: Any
    z: Any


def drive(motions: Any, x: Any, y: Any, z: Any, vx: Any, vy: Any, vz: Any, t: Any) -> None:
    """Put all driven particles where they are at time t, with their velocities."""
    for each in motions:
        _lead(each, x, y, z, vx, vy, vz, t)


@shared  # formulas are long, and driven from several places of several kernels
def _lead(motion: Any, x: Any, y: Any, z: Any, vx: Any, vy: Any, vz: Any, t: Any) -> None:
    for k in range(motion.rows.size):
        i = motion.rows[k]
        p = Particle(motion.x[k], motion.y[k], motion.z[k], 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, t, 1.0)
        x[i], y[i], z[i], vx[i], vy[i], vz[i] = path(motion.law, p)


@kernel
def drive_to(motions: Any, x: Any, v: Any, t: Any) -> None:
    """Put driven particles where they are at time t; position [m] and velocity [m/s] have shape [3, n]."""
    drive(motions, x[0], x[1], x[2], v[0], v[1], v[2], t)
