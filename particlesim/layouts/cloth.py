"""A rectangular cloth."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import Field, model_validator

from particlesim.crossfield import invalid
from particlesim.layouts.base import Placed
from particlesim.layouts.mesh import BEND, SHEAR, STRUCTURAL, Ints, Mesh, Resolution, grid_triangles
from particlesim.streams import Streams
from particlesim.units import Metres, MetresPerSecond, Number, Vector
from particlesim.vectors import dot, unit

Place = Literal[
    "corners", "left", "right", "top", "bottom", "top_left", "top_right", "bottom_left", "bottom_right"
]


class Cloth(Mesh):
    """A rectangle of particles; along its width they run fastest, from left to right and then from bottom to top.

    Structural springs join neighbours, shear springs the diagonals of each square, bend springs every other particle.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, SHEAR, BEND)

    type: Literal["cloth"] = "cloth"
    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Position of the bottom left corner."""
    size: tuple[Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)]]
    """Width and height."""
    resolution: tuple[Resolution, Resolution]
    """Particles along the width and along the height."""
    right: Vector[Number] = (1.0, 0.0, 0.0)
    """Direction of its width."""
    up: Vector[Number] = (0.0, 1.0, 0.0)
    """Direction of its height, at a right angle to the width."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of all its particles."""
    pinned: Place | Annotated[tuple[Place, ...], Field(min_length=1)] | None = None
    """Which edges or corners nothing moves: one name, or several."""

    @model_validator(mode="after")
    def _directions(self) -> Cloth:
        for name in ("right", "up"):
            if not any(getattr(self, name)):
                raise invalid("this vector has no direction", at=(name,))
        if abs(dot(unit(self.right), unit(self.up))) > 1e-9:
            raise invalid("up is not at a right angle to right", at=("up",), also=[(("right",), "right")])
        return self

    def shape(self) -> tuple[int, ...]:
        return self.resolution[1], self.resolution[0]

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        nx, ny = self.resolution
        index = np.arange(first, first + count)
        across, along = index % nx / (nx - 1) * self.size[0], index // nx / (ny - 1) * self.size[1]
        right, up = np.array(unit(self.right)), np.array(unit(self.up))
        position = np.array(self.origin)[:, None] + np.outer(right, across) + np.outer(up, along)
        return Placed(position, np.repeat(np.array(self.velocity)[:, None], count, axis=1))

    def triangles(self) -> Ints:
        nx, ny = self.resolution
        return grid_triangles(np.arange(nx * ny, dtype=np.int64).reshape(ny, nx))

    def places(self) -> dict[str, Ints]:
        nx, ny = self.resolution
        index = np.arange(nx * ny, dtype=np.int64).reshape(ny, nx)
        return {
            "left": index[:, 0],
            "right": index[:, -1],
            "bottom": index[0],
            "top": index[-1],
            "bottom_left": index[0, :1],
            "bottom_right": index[0, -1:],
            "top_left": index[-1, :1],
            "top_right": index[-1, -1:],
            "corners": index[:: ny - 1, :: nx - 1].ravel(),
        }
