"""Energy, momentum and angular momentum of a group: the ledger.

Sums are taken over fixed chunks of particles and then over the chunks in order, so that they have the same bits for any
number of threads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.checks.quantities import ROTATION
from particlesim.compiler import kernel
from particlesim.engine.state.columns import block_of, fetch
from particlesim.laws.registry import force, potential
from particlesim.process.threads import Team

CHUNK = 4096

MOTION = (
    "kinetic",
    "momentum.x",
    "momentum.y",
    "momentum.z",
    "angular_momentum.x",
    "angular_momentum.y",
    "angular_momentum.z",
    ROTATION,
)
"""Ledger columns of the motion, in the order of the kernel; potentials follow."""


def tally(potentials: Any, p: Any, row: Any, k: Any) -> None:
    """Add the potential energy in each force to row[k], row[k + 1] ..."""
    for n, each in enumerate(potentials):
        row[k + n] += potential(each, p)


def inertia_of(p: Any) -> Any:
    """Moment of inertia of a sphere, 2/5 m r² [kg m²]."""
    return 0.4 * float(p.m) * float(p.r) * float(p.r)


@kernel
def sum_chunks(potentials: Any, columns: Any, t: Any, first: Any, last: Any, rows: Any) -> None:
    """Sums over each chunk of CHUNK particles from `first`: kinetic energy, momentum, angular momentum, kinetic energy of
    rotation, potentials; spin is part of the first and the third."""
    for lo in range(first, last, CHUNK):
        c = block_of(columns, lo, min(last, lo + CHUNK))
        row = rows[lo // CHUNK]
        for i in range(c.x.size):
            p = fetch(c, i, t)
            m = float(p.m)
            x, y, z = float(p.x), float(p.y), float(p.z)
            u, v, w = float(p.vx), float(p.vy), float(p.vz)
            row[0] += 0.5 * m * (u * u + v * v + w * w)
            row[1] += m * u
            row[2] += m * v
            row[3] += m * w
            row[4] += m * (y * w - z * v)
            row[5] += m * (z * u - x * w)
            row[6] += m * (x * v - y * u)
            if c.spin is not None:
                inertia = inertia_of(p)
                a, b, d = float(c.spin.wx[i]), float(c.spin.wy[i]), float(c.spin.wz[i])
                turning = 0.5 * inertia * (a * a + b * b + d * d)
                row[0] += turning
                row[7] += turning
                row[4] += inertia * a
                row[5] += inertia * b
                row[6] += inertia * d
            tally(potentials, p, row, 8)


@kernel
def sum_forces(forces: Any, c: Any, t: Any, first: Any, last: Any, out: Any) -> None:
    """Total one-particle force on every particle of [first, last), into out [3, n]."""
    for i in range(first, last):
        out[0, i], out[1, i], out[2, i] = force(forces, fetch(c, i, t))


def measure(
    potentials: tuple[Any, ...], columns: Any, time: float, team: Team, workers_from: int = 100_000
) -> NDArray[np.float64]:
    """Kinetic energy [J], momentum [kg m/s], angular momentum [kg m²/s], kinetic energy of rotation [J] and potentials [J],
    in the order of the kernel."""
    n = columns.x.size
    rows = np.zeros((-(-n // CHUNK), len(MOTION) + len(potentials)))
    if n:
        team.over_range(
            n, CHUNK, lambda a, b: sum_chunks(potentials, columns, time, a, b, rows), worth=n >= workers_from
        )
    total = np.zeros(rows.shape[1])
    for row in rows:
        total += row
    return total


@kernel
def each_energy(potentials: Any, c: Any, times: Any, out: Any) -> None:
    """Kinetic energy and potentials of every particle at a time of its own [J], into out [1 + potentials, n]."""
    for i in range(c.x.size):
        p = fetch(c, i, times[i])
        u, v, w = float(p.vx), float(p.vy), float(p.vz)
        out[0, i] = 0.5 * float(p.m) * (u * u + v * v + w * w)
        if c.spin is not None:
            a, b, d = float(c.spin.wx[i]), float(c.spin.wy[i]), float(c.spin.wz[i])
            out[0, i] += 0.5 * inertia_of(p) * (a * a + b * b + d * d)
        tally(potentials, p, out[:, i], 1)


def tally_power(forces: Any, p: Any, row: Any, k: Any) -> None:
    """Put the power f·v of each force into row[k], row[k + 1] ..."""
    for n, each in enumerate(forces):
        fx, fy, fz = force(each, p)
        row[k + n] = float(fx) * p.vx + float(fy) * p.vy + float(fz) * p.vz


@kernel
def each_power(forces: Any, c: Any, times: Any, out: Any) -> None:
    """Power of every force on every particle at a time of its own [W], into out [forces, n]."""
    for i in range(c.x.size):
        tally_power(forces, fetch(c, i, times[i]), out[:, i], 0)


@kernel
def each_force(forces: Any, c: Any, times: Any, out: Any) -> None:
    """Total one-particle force on every particle at a time of its own [N], into out [3, n]."""
    for i in range(c.x.size):
        out[0, i], out[1, i], out[2, i] = force(forces, fetch(c, i, times[i]))
