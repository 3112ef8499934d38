"""A rope: particles in a row."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import model_validator

from particlesim.layouts.base import Placed
from particlesim.layouts.mesh import ANGLE, BEND, STRUCTURAL, Mesh, Resolution
from particlesim.model.arrays import Ints
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, MetresPerSecond, Vector
from particlesim.sampling.random_streams import Streams


class Rope(Mesh):
    """A straight row of particles from one point to another.

    Structural springs join neighbours, bend springs every other particle.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, BEND, ANGLE)
    can_be_rigid: ClassVar[bool] = True

    type: Literal["rope"] = "rope"
    start: Vector[Metres]
    """Position of the first particle."""
    end: Vector[Metres]
    """Position of the last particle."""
    count: Resolution
    """Number of particles, both ends included."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of all its particles."""
    pinned: Literal["start", "end", "both"] | None = None
    """Which ends nothing moves."""

    @model_validator(mode="after")
    def _length(self) -> Rope:
        if self.start == self.end:
            raise invalid("the rope has no length", at=("end",), also=[(("start",), "the same point")])
        return self

    def shape(self) -> tuple[int, ...]:
        return (self.count,)

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        along = np.arange(first, first + count) / (self.count - 1)
        start, end = np.array(self.start)[:, None], np.array(self.end)[:, None]
        position = start * (1 - along) + end * along
        return Placed(position, np.repeat(np.array(self.velocity)[:, None], count, axis=1))

    def hinges(self, kind: str) -> Ints:
        return np.arange(self.count - 2, dtype=np.int64)[:, None] + np.arange(3)

    def places(self) -> dict[str, Ints]:
        ends = np.array([0, self.count - 1], dtype=np.int64)
        return {"start": ends[:1], "end": ends[1:], "both": ends}
