"""A rectangular cloth."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from annotated_types import Gt
from pydantic import Field, model_validator

from particlesim.layouts.base import Line, Placed
from particlesim.layouts.mesh import BEND, DIHEDRAL, SHEAR, STRUCTURAL, Mesh, Resolution, grid_triangles
from particlesim.model.arrays import Floats, Ints
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, MetresPerSecond, Number, Vector
from particlesim.model.vectors import dot, unit
from particlesim.sampling.random_streams import Streams

Place = Literal[
    "corners", "left", "right", "top", "bottom", "top_left", "top_right", "bottom_left", "bottom_right"
]
Pinned = Place | Line | Annotated[tuple[Place | Line, ...], Field(min_length=1)]


AXES = ("row", "column")


class Sheet(Mesh):
    """A lattice of particles in a rectangle."""

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

    @model_validator(mode="after")
    def _has_lines(self) -> Self:
        pinned = getattr(self, "pinned", None)
        for k, name in enumerate((pinned,) if isinstance(pinned, str) else pinned or ()):
            if self.part(name) is None:
                raise invalid(
                    f"there is no {name}",
                    at=("pinned",) if isinstance(pinned, str) else ("pinned", k),
                    allowed=self.lines(),
                )
        return self

    def grid(self) -> Ints:
        """Index of the particle at every place of its grid [rows, columns], −1 where there is none."""
        raise NotImplementedError

    def places(self) -> dict[str, Ints]:
        return self.borders(self.grid())

    def part(self, name: str) -> Ints | None:
        axis, _, number = name.partition(" ")
        if axis not in AXES or not number:
            return super().part(name)
        grid = self.grid() if axis == "row" else self.grid().T
        k = int(number)
        if not -len(grid) <= k < len(grid):
            return None
        return np.asarray(grid[k][grid[k] >= 0])

    def part_names(self) -> tuple[str, ...]:
        return *super().part_names(), self.lines()

    def lines(self) -> str:
        """Its rows and columns, in words."""
        rows, columns = self.grid().shape
        return f"row 0 (the bottom) to row {rows - 1} or -1 (the top), column 0 (left) to column {columns - 1} or -1 (right)"

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
    folds: ClassVar[float] = 2**0.5

    type: Literal["cloth"] = "cloth"
    resolution: tuple[Resolution, Resolution]
    """Particles along the width and along the height."""
    pinned: Pinned | None = None
    """What nothing moves: edges or corners by name, rows from the bottom and columns from the left by number ("row 3", from
    the other end "column -1"); one or several."""

    def shape(self) -> tuple[int, ...]:
        return self.resolution[1], self.resolution[0]

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        nx, ny = self.resolution
        index = np.arange(first, first + count)
        return self.placed(index % nx / (nx - 1), index // nx / (ny - 1))

    def triangles(self) -> Ints:
        return grid_triangles(self.grid())

    def grid(self) -> Ints:
        return np.arange(math.prod(self.shape()), dtype=np.int64).reshape(self.shape())
