"""A disc of stars on nearly circular ways: surface density ∝ exp(−R/R_d), thickness ∝ sech²(z/h), within a halo.

Speeds are those of circles in a Plummer halo and in the disc itself, taken as if its mass within R were a sphere:
v² = G M_h R²/(R² + a²)^(3/2) + G M(R)/R with M(R) = M (1 − (1 + x) exp(−x)), x = R/R_d. To each component is added a
random part, a fraction of the circular speed.
Source: K. C. Freeman, Astrophys. J. 160, 811 (1970); J. Binney, S. Tremaine, Galactic Dynamics, 2nd ed., sections 2.6 and
4.4.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from pydantic import Field, model_validator

from particlesim.layouts.base import Layout, Placed
from particlesim.layouts.plummer import inverse
from particlesim.model.arrays import Floats
from particlesim.model.constants import GRAVITATIONAL_CONSTANT
from particlesim.model.mistakes import invalid
from particlesim.model.units import (
    GravitationalConstant,
    Kilograms,
    Metres,
    MetresPerSecond,
    Number,
    Vector,
)
from particlesim.sampling.random_streams import Streams


class Disc(Layout):
    """A disc that turns: bodies on nearly circular ways under the gravity of the disc and of a halo around it."""

    type: Literal["disc"] = "disc"
    count: Annotated[int, Field(ge=1, le=10**10, strict=True)]
    """Number of particles."""
    mass: Annotated[Kilograms, Gt(0)]
    """Mass M of the whole disc; each particle has an equal share."""
    radius: Annotated[Metres, Gt(0)]
    """Scale R_d over which the density falls by e."""
    extent: Annotated[Number, Ge(1)] = 5.0
    """No particle is further out than so many R_d."""
    height: Annotated[Metres, Ge(0)] = 0.0
    """Scale h of the thickness."""
    halo_mass: Annotated[Kilograms, Ge(0)] = 0.0
    """Mass M_h of the halo, a Plummer sphere: another group, with `layout.type = "plummer"`."""
    halo_radius: Annotated[Metres, Gt(0)] | None = None
    """Scale a of the halo."""
    dispersion: Annotated[Number, Ge(0)] = 0.05
    """Standard deviation of each component of velocity over the circular speed."""
    axis: Vector[Number] = (0.0, 1.0, 0.0)
    """The way that the disc turns about, by the right hand."""
    center: Vector[Metres] = (0.0, 0.0, 0.0)
    """Where its middle is."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of the whole disc."""
    constant: Annotated[GravitationalConstant, Gt(0)] = GRAVITATIONAL_CONSTANT
    """The constant of gravitation that the speeds are for: that of the interaction."""

    @model_validator(mode="after")
    def _turns_and_has_a_halo(self) -> Disc:
        if not any(self.axis):
            raise invalid("an axis has a direction", at=("axis",))
        if self.halo_mass > 0 and self.halo_radius is None:
            raise invalid("the halo needs a halo_radius", at=("halo_mass",))
        return self

    def number(self) -> int:
        return self.count

    def attributes(self) -> frozenset[str]:
        return frozenset({"mass"})

    def balanced_constant(self) -> float:
        return self.constant

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        x = inverse(lambda x: x * np.exp(-x), streams["radius"].uniform(first, count), self.extent)
        turn = 2 * np.pi * streams["turn"].uniform(first, count)
        across, along = np.cos(turn), np.sin(turn)
        upward = self.height * np.arctanh(
            np.clip(2 * streams["height"].uniform(first, count) - 1, -0.999, 0.999)
        )
        speed = self.circular_speed(self.radius * x)
        e1, e2, axis = frame(self.axis)
        out = across * e1 + along * e2
        around = across * e2 - along * e1
        stray = np.stack([_normal(streams, f"velocity.{k}", first, count) for k in range(3)])
        return Placed(
            np.array(self.center)[:, None] + self.radius * x * out + upward * axis,
            np.array(self.velocity)[:, None] + speed * (around + self.dispersion * stray),
            {"mass": np.full(count, self.mass / self.count)},
        )

    def circular_speed(self, r: Floats) -> Floats:
        """Speed of a circle of radius r [m/s]."""
        x = r / self.radius
        share = (1 - (1 + x) * np.exp(-x)) / (1 - (1 + self.extent) * np.exp(-self.extent))
        square = self.constant * self.mass * share / r
        if self.halo_radius is not None:
            square = square + self.constant * self.halo_mass * r * r / (r * r + self.halo_radius**2) ** 1.5
        return np.asarray(np.sqrt(square))


def frame(axis: Vector[float]) -> tuple[Floats, Floats, Floats]:
    """Three unit vectors at right angles [3, 1], right-handed, the last along an axis."""
    third = np.array(axis, float) / np.linalg.norm(axis)
    other = np.eye(3)[np.abs(third).argmin()]
    first = np.cross(other, third)
    first /= np.linalg.norm(first)
    return first[:, None], np.cross(third, first)[:, None], third[:, None]


def _normal(streams: Streams, name: str, first: int, count: int) -> Floats:
    """Standard normal numbers by Box and Muller."""
    u, v = (streams[f"{name}.{part}"].uniform(first, count) for part in ("size", "phase"))
    return np.asarray(np.sqrt(-2 * np.log(u)) * np.cos(2 * np.pi * v))
