"""Particles at random places in a shape."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from particlesim.layouts.base import Layout, Placed
from particlesim.model.units import MetresPerSecond, Vector
from particlesim.sampling.distributions import Sampled, draw
from particlesim.sampling.random_streams import Streams
from particlesim.sampling.shapes import AnyShape


class Random(Layout):
    """Particles spread evenly over a shape."""

    type: Literal["random"] = "random"
    count: Annotated[int, Field(ge=1, le=10**10, strict=True)]
    """Number of particles."""
    shape: AnyShape
    """Where they are."""
    velocity: Vector[Sampled[MetresPerSecond]] = (0.0, 0.0, 0.0)
    """Velocity; each component a number or a distribution."""

    def number(self) -> int:
        return self.count

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        velocity = [draw(v, streams[f"velocity.{k}"], first, count) for k, v in enumerate(self.velocity)]
        return Placed(self.shape.sample(streams, first, count), np.stack(velocity))
