"""Particles on a regular lattice."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from pydantic import Field

from particlesim.layouts.base import Layout, Placed
from particlesim.model.units import Metres, MetresPerSecond, Vector
from particlesim.sampling.distributions import Sampled, draw
from particlesim.sampling.random_streams import Streams

Count = Annotated[int, Field(ge=1, le=10**7, strict=True)]


class Lattice(Layout):
    """A rectangular lattice; x runs fastest, then y, then z. With a basis of several places it is a crystal."""

    type: Literal["lattice"] = "lattice"
    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Position of the first particle."""
    counts: tuple[Count, Count, Count]
    """Number of particles along x, y and z."""
    spacing: Annotated[Metres, Gt(0)] | Vector[Annotated[Metres, Gt(0)]]
    """Distance of neighbours, or edge of the cells, one for all axes or one for each."""
    basis: tuple[Vector[float], ...] = Field(default=((0.0, 0.0, 0.0),), min_length=1, max_length=64)
    """Places in every cell, in parts of its edges: [[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]] is centred on
    its faces. Those of a cell follow each other."""
    jitter: Annotated[Metres, Ge(0)] = 0.0
    """Largest random shift of each coordinate."""
    velocity: Vector[Sampled[MetresPerSecond]] = (0.0, 0.0, 0.0)
    """Velocity; each component a number or a distribution."""

    def number(self) -> int:
        return self.counts[0] * self.counts[1] * self.counts[2] * len(self.basis)

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        index = np.arange(first, first + count)
        nx, ny, _ = self.counts
        within, index = index % len(self.basis), index // len(self.basis)
        cell = (
            np.stack([index % nx, index // nx % ny, index // (nx * ny)]) + np.array(self.basis).T[:, within]
        )
        step = np.broadcast_to(np.asarray(self.spacing, dtype=float), 3)
        position = np.asarray(self.origin)[:, None] + cell * step[:, None]
        if self.jitter > 0:
            shift = np.stack([streams[f"jitter.{k}"].uniform(first, count) for k in range(3)])
            position = position + self.jitter * (2 * shift - 1)
        velocity = [draw(v, streams[f"velocity.{k}"], first, count) for k, v in enumerate(self.velocity)]
        return Placed(position, np.stack(velocity))
