"""Gaps of many particles at once, and places outside."""

from __future__ import annotations

from typing import Any

from particlesim.colliders.response import put_back
from particlesim.compiler import kernel
from particlesim.laws.registry import Particle, gap, gap_and_normal


@kernel
def gaps_of(shape: Any, x: Any, y: Any, z: Any, radius: Any, t: Any, out: Any) -> None:
    """`out[i]`: the gap of a particle at (x, y, z)[i] with a radius to a shape at time t [m]."""
    for i in range(out.size):
        zero = x[i] - x[i]
        out[i] = gap(shape, Particle(x[i], y[i], z[i], zero, zero, zero, zero, radius[i], zero, t, zero))


@kernel
def gaps_and_normals_of(shape: Any, x: Any, y: Any, z: Any, out: Any, normals: Any) -> None:
    """`out[i]`, `normals[i]`: the gap of a place (x, y, z)[i] to a shape at rest [m], and the normal there."""
    for i in range(out.size):
        zero = x[i] - x[i]
        p = Particle(x[i], y[i], z[i], zero, zero, zero, zero, zero, zero, zero, zero)
        out[i], n = gap_and_normal(shape, p)
        for k in range(3):
            normals[i, k] = zero if n[k] is None else n[k]


@kernel
def put_outside(shape: Any, x: Any, radius: Any, free: Any, t: Any) -> None:
    """Particles at x [n, 3] that are inside of a shape at time t go to its surface, but for those with free = 0."""
    for i in range(radius.size):
        if free[i] > 0:
            zero = x[i, 0] - x[i, 0]
            p = Particle(x[i, 0], x[i, 1], x[i, 2], zero, zero, zero, zero, radius[i], zero, t, zero)
            g, n = gap_and_normal(shape, p)
            if g < 0:
                x[i, 0], x[i, 1], x[i, 2] = put_back(shape, p, g, tuple(zero if a is None else a for a in n))
