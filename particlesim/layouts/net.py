"""A rectangular net of strings."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import Field

from particlesim.layouts.base import Placed
from particlesim.layouts.cloth import Pinned, Sheet
from particlesim.layouts.mesh import BEND, STRUCTURAL
from particlesim.model.arrays import Ints
from particlesim.model.units import Metres
from particlesim.sampling.random_streams import Streams

Meshes = Annotated[int, Field(ge=1, le=1000, strict=True)]
Length = Annotated[Metres, Gt(0)]


class Net(Sheet):
    """Strings along a rectangular grid, knotted where they cross; particles row after row from bottom left to top right.

    Structural springs join neighbours along the strings (with `tension_only` they are strings indeed), bend springs every
    other particle of a string.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, BEND)
    can_be_rigid: ClassVar[bool] = True

    type: Literal["net"] = "net"
    size: tuple[Length, Length]
    """Width and height."""
    meshes: tuple[Meshes, Meshes]
    """Openings along the width and along the height."""
    segments: Annotated[int, Field(ge=1, le=100, strict=True)] = 1
    """Links of the string between two knots; more of them let it hang between."""
    pinned: Pinned | None = None
    """What nothing moves: edges or corners by name, rows from the bottom and columns from the left by number ("row 3", from
    the other end "column -1"; links between knots count); one or several."""

    def grid(self) -> Ints:
        """Index of the particle at every place of the fine grid [rows, columns], −1 inside the openings."""
        rows, columns = (n * self.segments + 1 for n in self.meshes[::-1])
        on = (np.arange(rows) % self.segments == 0)[:, None] | (np.arange(columns) % self.segments == 0)
        return np.where(on, np.cumsum(on).reshape(on.shape) - 1, -1)

    def number(self) -> int:
        return int(self.grid().max()) + 1

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        grid = self.grid()
        row, column = (part[first : first + count] for part in np.nonzero(grid >= 0))
        return self.placed(column / (grid.shape[1] - 1), row / (grid.shape[0] - 1))

    def edges(self, kind: str) -> Ints:
        grid, s = self.grid(), 1 if kind == STRUCTURAL else 2
        # Along strings only: two steps from knot to knot must not cross an opening.
        across, along = grid[:: self.segments], grid[:, :: self.segments].T
        pairs = [np.stack([line[:, :-s].ravel(), line[:, s:].ravel()], axis=1) for line in (across, along)]
        return np.concatenate(pairs)
