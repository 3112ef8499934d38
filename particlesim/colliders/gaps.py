"""Gaps of many particles at once."""

from __future__ import annotations

from typing import Any

from particlesim.compiler import kernel
from particlesim.laws.registry import Particle, gap


@kernel
def gaps_of(shape: Any, x: Any, y: Any, z: Any, radius: Any, t: Any, out: Any) -> None:
    """`out[i]`: the gap of a particle at (x, y, z)[i] with a radius to a shape at time t [m]."""
    for i in range(out.size):
        zero = x[i] - x[i]
        out[i] = gap(shape, Particle(x[i], y[i], z[i], zero, zero, zero, zero, radius[i], zero, t, zero))
