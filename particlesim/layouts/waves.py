"""A lattice with waves of density: x = q + u(q), with u = Σ (k/k²) (a sin k·q − b cos k·q) over waves that fit into a box.

The density is then 1 − ∇·u = 1 + δ to first order, δ = −Σ (a cos k·q + b sin k·q). Amplitudes are random numbers of Gauss,
with a variance in proportion to kⁿ, scaled so that the mean of δ² is as given. Where waves grow as e^(γt), velocities are
γ u: under gravity γ² = 4π G ρ in a medium at rest (Jeans).
Source: Ya. B. Zel'dovich, Astron. Astrophys. 5, 84 (1970); G. Efstathiou et al., ApJS 57, 241 (1985), for lattices.
"""

from __future__ import annotations

from itertools import product
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from pydantic import Field, model_validator

from particlesim.layouts.base import Layout, Placed
from particlesim.layouts.lattice import Count
from particlesim.model.arrays import Floats
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Number, PerSecond, Vector
from particlesim.sampling.random_streams import Streams

ROWS = 4096
"""Particles that are moved together."""


class Waves(Layout):
    """A lattice that fills a periodic box, with random waves of density or a single one."""

    type: Literal["waves"] = "waves"
    counts: tuple[Count, Count, Count]
    """Number of particles along x, y and z."""
    size: Vector[Annotated[Metres, Gt(0)]]
    """Edges of the box, into which all waves fit."""
    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Its lowest corner."""
    contrast: Annotated[Number, Ge(0)]
    """Root of the mean square of the density contrast δ, to first order; lattices are torn where it comes near 1."""
    slope: Number = 0.0
    """n of the power spectrum P(k) ∝ kⁿ: 0 is the same for all waves, negative ones give large structures."""
    shortest: Annotated[int, Field(ge=1, le=16, strict=True)] = 4
    """How often the shortest waves fit into the box along each axis."""
    wave: tuple[int, int, int] | None = None
    """Instead of random waves a single one, δ = √2 contrast cos k·q, by how often it fits into the box along each axis."""
    rate: PerSecond = 0.0
    """γ: velocities are γ times the displacements."""

    @model_validator(mode="after")
    def _one_or_all(self) -> Waves:
        if self.wave is None:
            return self
        if not any(self.wave):
            raise invalid("a wave needs a length greater than 0", at=("wave",), allowed="[1, 0, 0], say")
        for key in ("slope", "shortest"):
            if key in self.model_fields_set:
                raise invalid(f"{key} says something of random waves", at=(key,), also=[(("wave",), "here")])
        return self

    def number(self) -> int:
        return self.counts[0] * self.counts[1] * self.counts[2]

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        index = np.arange(first, first + count)
        nx, ny, _ = self.counts
        cell = np.stack([index % nx, index // nx % ny, index // (nx * ny)])
        edges = np.array(self.size)[:, None]
        q = (cell + 0.5) * edges / np.array(self.counts)[:, None]
        moved = self._displacement(q, *self._amplitudes(streams))
        return Placed(np.array(self.origin)[:, None] + q + moved, self.rate * moved)

    def _amplitudes(self, streams: Streams) -> tuple[Floats, Floats, Floats]:
        """Wave vectors k [3, waves] of a half of space, and their a and b."""
        numbers = [self.wave] if self.wave is not None else self._half()
        k = 2 * np.pi * np.array(numbers, float).T / np.array(self.size)[:, None]
        if self.wave is not None:
            a, b = np.array([-1.0]), np.array([0.0])
        else:
            first, second = (streams[name].uniform(0, len(numbers)) for name in ("length", "phase"))
            strength = np.sqrt(-2 * np.log1p(-first)) * np.sqrt((k**2).sum(axis=0)) ** (self.slope / 2)
            a, b = strength * np.cos(2 * np.pi * second), strength * np.sin(2 * np.pi * second)
        scale = self.contrast / np.sqrt(((a**2 + b**2) / 2).sum())
        return k, scale * a, scale * b

    def _half(self) -> list[tuple[int, int, int]]:
        """Numbers of all waves, one of each pair of opposite ones."""
        ranges = range(-self.shortest, self.shortest + 1)
        return [(x, y, z) for x, y, z in product(ranges, repeat=3) if (x, y, z) > (0, 0, 0)]

    def _displacement(self, q: Floats, k: Floats, a: Floats, b: Floats) -> Floats:
        along = k / (k**2).sum(axis=0)
        found = np.empty_like(q)
        for row in range(0, q.shape[1], ROWS):
            some = slice(row, row + ROWS)
            phase = sum(q[axis, some, None] * k[axis] for axis in range(3))
            depth = a * np.sin(phase) - b * np.cos(phase)
            for axis in range(3):
                found[axis, some] = (depth * along[axis]).sum(axis=1)
        return found
