"""A rectangular cloth."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from annotated_types import Gt
from pydantic import Field, model_validator

from particlesim.crossfield import invalid
from particlesim.layouts.base import Floats, Placed
from particlesim.layouts.mesh import BEND, DIHEDRAL, SHEAR, STRUCTURAL, Ints, Mesh, Resolution, grid_triangles
from particlesim.streams import Streams
from particlesim.units import Metres, MetresPerSecond, Number, Vector
from particlesim.vectors import dot, unit

Place = Literal[
    "corners", "left", "right", "top", "bottom", "top_left", "top_right", "bottom_left", "bottom_right"
]


class Sheet(Mesh):
    """What lies in a rectangle."""

    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Position of the bottom left corner."""
    size: tuple[Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)]]
    """Width and height."""
    right: Vector[Number] = (1.0, 0.0, 0.0)
    """Direction of its width."""
    up: Vector[Number] = (0.0, 1.0, 0.0)
    """Direction of its height, at a right angle to the width."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of all its particles."""

    @model_validator(mode="after")
    def _directions(self) -> Self:
        for name in ("right", "up"):
            if not any(getattr(self, name)):
                raise invalid("this vector has no direction", at=(name,))
        if abs(dot(unit(self.right), unit(self.up))) > 1e-9:
            raise invalid("up is not at a right angle to right", at=("up",), also=[(("right",), "right")])
        return self

    def placed(self, across: Floats, along: Floats) -> Placed:
        """Particles at parts of the width and of the height, 0 to 1, shape [n]."""
        right, up = np.array(unit(self.right)), np.array(unit(self.up))
        position = np.array(self.origin)[:, None]
        position = position + np.outer(right, across * self.size[0]) + np.outer(up, along * self.size[1])
        return Placed(position, np.repeat(np.array(self.velocity)[:, None], len(across), axis=1))

    @staticmethod
    def borders(index: Ints) -> dict[str, Ints]:
        """The edges and corners of a grid of particles [rows, columns], from the bottom row."""
        return {
            "left": index[:, 0],
            "right": index[:, -1],
            "bottom": index[0],
            "top": index[-1],
            "bottom_left": index[0, :1],
            "bottom_right": index[0, -1:],
            "top_left": index[-1, :1],
            "top_right": index[-1, -1:],
            "corners": index[[0, 0, -1, -1], [0, -1, 0, -1]],
        }


class Cloth(Sheet):
    """A rectangle of particles; along its width they run fastest, from left to right and then from bottom to top.

    Structural springs join neighbours, shear springs the diagonals of each square, bend springs every other particle;
    dihedrals resist the folding of two triangles at their edge.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, SHEAR, BEND, DIHEDRAL)

    type: Literal["cloth"] = "cloth"
    resolution: tuple[Resolution, Resolution]
    """Particles along the width and along the height."""
    pinned: Place | Annotated[tuple[Place, ...], Field(min_length=1)] | None = None
    """Which edges or corners nothing moves: one name, or several."""

    def shape(self) -> tuple[int, ...]:
        return self.resolution[1], self.resolution[0]

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        nx, ny = self.resolution
        index = np.arange(first, first + count)
        return self.placed(index % nx / (nx - 1), index // nx / (ny - 1))

    def triangles(self) -> Ints:
        return grid_triangles(self._index())

    def places(self) -> dict[str, Ints]:
        return self.borders(self._index())

    def _index(self) -> Ints:
        return np.arange(math.prod(self.shape()), dtype=np.int64).reshape(self.shape())
