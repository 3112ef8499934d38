"""Particles one by one."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from particlesim.layouts.base import Layout, Placed
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, MetresPerSecond, Vector
from particlesim.sampling.random_streams import Streams


class Points(Layout):
    """A list of positions, with one velocity for all or one for each."""

    type: Literal["points"] = "points"
    position: tuple[Vector[Metres], ...] = Field(min_length=1)
    """Positions of the particles."""
    velocity: tuple[Vector[MetresPerSecond], ...] = Field(default=((0.0, 0.0, 0.0),), min_length=1)
    """Velocities: as many as positions, or a single one for all."""

    @model_validator(mode="after")
    def _as_many(self) -> Points:
        if len(self.velocity) not in (1, len(self.position)):
            raise invalid(
                f"{len(self.velocity)} velocities for {len(self.position)} positions",
                at=("velocity",),
                also=[(("position",), "the positions are here")],
                allowed="one velocity for all, or one for each position",
            )
        return self

    def number(self) -> int:
        return len(self.position)

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        position = np.asarray(self.position, dtype=float).T[:, first : first + count]
        velocity = np.asarray(self.velocity, dtype=float).T
        if velocity.shape[1] == 1:
            return Placed(position, np.repeat(velocity, count, axis=1))
        return Placed(position, velocity[:, first : first + count])
