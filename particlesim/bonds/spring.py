"""Spring-dampers between listed pairs of particles.

    f on 1 = −k (|l| − L₀) e − c ((v₁ − v₂)·e) e,   l = x₁ − x₂,  e = l/|l|,   f on 2 = −f on 1

with U = ½ k (|l| − L₀)². Coincident ends have no direction and feel nothing. The sign of the damper matters: with
(v₂ − v₁)·e it would feed energy in.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge
from pydantic import Field, model_validator

from particlesim.crossfield import invalid
from particlesim.laws import bond_force, bond_potential, law
from particlesim.model import Model, Name
from particlesim.units import KilogramsPerSecond, Metres, NewtonsPerMetre

Index = Annotated[int, Field(ge=0, strict=True)]


class Springs(Model):
    """Springs between pairs of particles, within one group or from one group to another."""

    name: Name = "springs"
    """Name for the ledger and for messages."""
    on: Name | None = None
    """The group whose particles are joined."""
    between: tuple[Name, Name] | None = None
    """Two groups instead of one: the first index of a pair is in the first, the second in the second."""
    pairs: tuple[tuple[Index, Index], ...] = Field(min_length=1)
    """Indices of the joined particles, a pair for every spring."""
    stiffness: Annotated[NewtonsPerMetre, Ge(0)]
    """Stiffness k."""
    damping: Annotated[KilogramsPerSecond, Ge(0)] = 0.0
    """Damping c along the spring."""
    rest_length: Annotated[Metres, Ge(0)] | None = None
    """Rest length L₀; the distance at the start unless given."""

    @model_validator(mode="after")
    def _joins(self) -> Springs:
        if (self.on is None) == (self.between is None):
            raise invalid("joins one group or two", allowed='on = "chain", or between = ["hook", "chain"]')
        seen: dict[frozenset[int] | tuple[int, int], int] = {}
        within = self.between is None or self.between[0] == self.between[1]
        for k, (a, b) in enumerate(self.pairs):
            if within and a == b:
                raise invalid(f"joins particle {a} to itself", at=("pairs", k))
            key = frozenset((a, b)) if within else (a, b)
            if key in seen:
                raise invalid(
                    "this pair is already joined", at=("pairs", k), also=[(("pairs", seen[key]), "here")]
                )
            seen[key] = k
        return self

    def record(self) -> SpringRecord:
        """The parameters as kernels take them."""
        return SpringRecord(self.stiffness, self.damping)

    def groups(self) -> tuple[Name, Name]:
        """Groups of the first and second ends."""
        if self.between is not None:
            return self.between
        assert self.on is not None
        return self.on, self.on


class SpringRecord(NamedTuple):
    """k [N/m], c [kg/s]."""

    k: float
    c: float


class Pair(NamedTuple):
    """Ends of a bond: l = x₁ − x₂ [m], v₁ − v₂ [m/s], rest length [m]."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    rest: float


@law(bond_force, SpringRecord)
def spring_force(f: SpringRecord, b: Pair) -> tuple[float, float, float]:
    length = np.sqrt(b.x * b.x + b.y * b.y + b.z * b.z)
    inverse = 1 / length if length > 0 else 0.0
    along = (b.vx * b.x + b.vy * b.y + b.vz * b.z) * inverse
    s = -(f.k * (length - b.rest) + f.c * along) * inverse
    return s * b.x, s * b.y, s * b.z


@law(bond_potential, SpringRecord)
def spring_potential(f: SpringRecord, b: Pair) -> float:
    stretch = np.sqrt(b.x * b.x + b.y * b.y + b.z * b.z) - b.rest
    return 0.5 * f.k * stretch * stretch
