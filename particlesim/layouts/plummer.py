"""A Plummer sphere in equilibrium: density ∝ (1 + r²/a²)^(−5/2), potential −G M/√(r² + a²), velocities isotropic.

The mass within r is M (1 + a²/r²)^(−3/2), and speeds v = q v_esc have the density q² (1 − q²)^(7/2), with
v_esc = √(2 G M) (r² + a²)^(−1/4).
Source: H. C. Plummer, MNRAS 71, 460 (1911); S. J. Aarseth, M. Hénon, R. Wielen, Astron. Astrophys. 37, 183 (1974).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from pydantic import Field

from particlesim.layouts.base import Layout, Placed
from particlesim.model.arrays import Floats
from particlesim.model.constants import GRAVITATIONAL_CONSTANT
from particlesim.model.units import (
    GravitationalConstant,
    Kilograms,
    Metres,
    MetresPerSecond,
    Number,
    Vector,
)
from particlesim.sampling.random_streams import Streams

_TABLE = 4096
"""Points of the tables of distribution functions: linear between them, within 1e-6."""


class Plummer(Layout):
    """A ball of bodies that hold each other together: a Plummer sphere in equilibrium under its own gravity."""

    type: Literal["plummer"] = "plummer"
    count: Annotated[int, Field(ge=1, le=10**10, strict=True)]
    """Number of particles."""
    mass: Annotated[Kilograms, Gt(0)]
    """Mass M of the whole sphere; each particle has an equal share."""
    radius: Annotated[Metres, Gt(0)]
    """Scale a; half of the mass is within 1.3 a."""
    extent: Annotated[Number, Ge(1)] = 10.0
    """No particle is further out than so many a; within 10 a are 98.5 % of an endless sphere."""
    center: Vector[Metres] = (0.0, 0.0, 0.0)
    """Where its middle is."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of the whole sphere."""
    constant: Annotated[GravitationalConstant, Gt(0)] = GRAVITATIONAL_CONSTANT
    """The constant of gravitation that the speeds are for: that of the interaction."""

    def number(self) -> int:
        return self.count

    def attributes(self) -> frozenset[str]:
        return frozenset({"mass"})

    def balanced_constant(self) -> float:
        return self.constant

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        most = (1 + 1 / self.extent**2) ** -1.5
        u = most * streams["radius"].uniform(first, count)
        r = self.radius / np.sqrt(u ** (-2 / 3) - 1)
        escape = np.sqrt(2 * self.constant * self.mass) / (r * r + self.radius**2) ** 0.25
        q = inverse(speeds, streams["speed"].uniform(first, count), 1.0)
        way = directions(streams, "place", first, count)
        heading = directions(streams, "velocity", first, count)
        return Placed(
            np.array(self.center)[:, None] + r * way,
            np.array(self.velocity)[:, None] + q * escape * heading,
            {"mass": np.full(count, self.mass / self.count)},
        )


def speeds(q: Floats) -> Floats:
    """Density of q = v/v_esc."""
    return q * q * (1 - q * q) ** 3.5


def inverse(density: Callable[[Floats], Floats], u: Floats, last: float) -> Floats:
    """Where the integral of a density over [0, last] reaches the parts u of the whole."""
    x = np.linspace(0, last, _TABLE)
    y = density(x)
    total = np.concatenate([[0.0], np.cumsum(y[1:] + y[:-1])])
    return np.asarray(np.interp(u, total / total[-1], x))


def directions(streams: Streams, name: str, first: int, count: int) -> Floats:
    """Unit vectors evenly over the sphere, shape [3, count]."""
    z = 2 * streams[f"{name}.height"].uniform(first, count) - 1
    turn = 2 * np.pi * streams[f"{name}.turn"].uniform(first, count)
    level = np.sqrt(1 - z * z)
    return np.stack([level * np.cos(turn), level * np.sin(turn), z])
