"""A block of jelly."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import Field

from particlesim.layouts.base import Placed
from particlesim.layouts.mesh import BEND, SHEAR, STRUCTURAL, Mesh, Resolution, grid_triangles
from particlesim.model.arrays import Ints
from particlesim.model.units import Metres, MetresPerSecond, Vector
from particlesim.sampling.random_streams import Streams

Length = Annotated[Metres, Gt(0)]
Place = Literal["corners", "left", "right", "bottom", "top", "back", "front"]


class Jelly(Mesh):
    """A box filled with a lattice of particles; x runs fastest, then y, then z.

    Structural springs join neighbours, shear springs the diagonals of the faces and of the space of each cell, bend
    springs every other particle.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, SHEAR, BEND)
    folds: ClassVar[float] = 3**0.5

    type: Literal["jelly"] = "jelly"
    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Position of the corner where x, y and z are least."""
    size: tuple[Length, Length, Length]
    """Lengths of its edges along x, y and z."""
    resolution: tuple[Resolution, Resolution, Resolution]
    """Particles along x, y and z."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of all its particles."""
    pinned: Place | Annotated[tuple[Place, ...], Field(min_length=1)] | None = None
    """Which sides nothing moves (left and right along x, bottom and top along y, back and front along z)."""

    def shape(self) -> tuple[int, ...]:
        return self.resolution[::-1]

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        nx, ny, nz = self.resolution
        index = np.arange(first, first + count)
        cell = np.stack([index % nx / (nx - 1), index // nx % ny / (ny - 1), index // (nx * ny) / (nz - 1)])
        position = np.array(self.origin)[:, None] + cell * np.array(self.size)[:, None]
        return Placed(position, np.repeat(np.array(self.velocity)[:, None], count, axis=1))

    def triangles(self) -> Ints:
        nx, ny, nz = self.resolution
        index = np.arange(nx * ny * nz, dtype=np.int64).reshape(nz, ny, nx)
        # Each side with the axes that make its normal columns × rows point outwards.
        sides = [
            index[-1],
            index[0].T,
            index[:, 0],
            index[:, -1].T,
            index[:, :, 0].T,
            index[:, :, -1],
        ]
        return np.concatenate([grid_triangles(side) for side in sides])

    def places(self) -> dict[str, Ints]:
        nx, ny, nz = self.resolution
        index = np.arange(nx * ny * nz, dtype=np.int64).reshape(nz, ny, nx)
        places = {
            "left": index[:, :, 0],
            "right": index[:, :, -1],
            "bottom": index[:, 0],
            "top": index[:, -1],
            "back": index[0],
            "front": index[-1],
            "corners": index[:: nz - 1, :: ny - 1, :: nx - 1],
        }
        return {name: part.ravel() for name, part in places.items()}
