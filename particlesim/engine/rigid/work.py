"""The work on bodies that no potential accounts for, entered in the ledger step by step.

In the middle of a step forces f and impulses P change velocities from v₀ to v₁, and the kinetic energy by exactly
Σ (h f + P)·v̄ with v̄ = (v₀ + v₁)/2. Of this, the work of uniform gravity equals what its potential loses over the
displacement h v̄ of the step. So the work of forces without a potential and of dampers is h f·v̄, with the forces of the
kick, and that of contacts is P·v̄. Joints do no work, as both v₀ and v₁ satisfy them. The work of contact includes the
potential energy that bodies gain where overlaps push them up.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.bonds.spring import Pair
from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import row
from particlesim.engine.rigid.springs import stretched
from particlesim.laws.registry import bond_force, bond_potential


class Work(NamedTuple):
    """For every stretch the laws without a potential, which of the totals each goes to, and the laws with one; which totals
    the dampers of every set of springs and those that break go to (−1: none), which contact, and which motors (−1: none);
    the totals [J]."""

    spent: tuple[tuple[Any, ...], ...]
    cause: tuple[Any, ...]
    stored: tuple[tuple[Any, ...], ...]
    damper: Any
    breaking: Any
    contact: int
    motors: int
    totals: Any


def copy_velocities(now: Any, copy: Any) -> None:
    """Keep velocities and angular velocities [n, 6]."""
    for i in range(len(now)):
        for axis in range(6):
            copy[i, axis] = now[i, axis]


@outlined
def take_means(b: Any, motion: Any, bodies: Any, h: Any) -> float:
    """The means of velocities before and after a kick with its impulses, into `other`, and what impulses have given [J] to
    the first of `b`, the `bodies` and what rods hold at them; other guests have books of their own."""
    total = 0.0
    for i in range(b.w.size):
        was, now, f, mean = motion.came[i], motion.now[i], motion.pull[i], motion.other[i]
        for axis in range(6):
            mean[axis] = 0.5 * (was[axis] + now[axis])
        for axis in range(3 if i < bodies else 0):
            if b.w[i] > 0:  # a guest that is held does not move
                total += ((now[axis] - was[axis]) / b.w[i] - h * f[axis]) * mean[axis]
            total += motion.gained[i, axis] * mean[3 + axis]
    return total


@outlined
def damped_work(springs: Any, b: Any, now: Any, middle: Any) -> float:
    """Power of dampers with the velocities `now` on ends that move as in `middle` [W]."""
    total = 0.0
    for s in range(springs.first.size):
        p, _, _ = stretched(springs, b, now, s)
        q, _, _ = stretched(springs, b, middle, s)
        f = bond_force(springs.law, p)
        g = bond_force(springs.law, Pair(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.k, 0.0, p.rest))
        total += (f[0] - g[0]) * q.vx + (f[1] - g[1]) * q.vy + (f[2] - g[2]) * q.vz
    return total


@outlined
def stored_in(springs: Any, b: Any, now: Any) -> float:
    """Potential energy of springs [J]."""
    total = 0.0
    for s in range(springs.first.size):
        pair, _, _ = stretched(springs, b, now, s)
        total += bond_potential(springs.law, pair)
    return total


@outlined
def kinetic(b: Any, motion: Any, bodies: Any) -> float:
    """Kinetic energy of the first `bodies` with the velocities `now` [J]."""
    total = 0.0
    for i in range(bodies):
        m, spin = motion.now[i], row(b.spin, i)
        if b.w[i] > 0:  # a guest that is held does not move
            total += 0.5 / b.w[i] * (m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
        total += 0.5 * (m[3] * spin[0] + m[4] * spin[1] + m[5] * spin[2])
    return total
