"""Height fields: the ground as a picture or an array of heights, solid down to a base.

Between the numbers the surface is made of triangles, two to a cell, with alternating diagonals; walls and a floor close it.
So it is a mesh, with the same exact distances.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import model_validator

from particlesim.colliders.base import Collider
from particlesim.colliders.mesh import TriangleSolid, without_flat
from particlesim.colliders.triangulation import Triangles, grid_faces
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3

BASE = 0.1
"""Depth of the base under the lowest place, in parts of the longest side."""


class HeightField(TriangleSolid):
    """The ground, from the grey values of a PNG picture (black 0, white 1) or the numbers of a NPY array.

    Rows of the picture follow each other along z, and columns along x: the upper left corner has the smallest x and z.
    """

    kind: ClassVar[str] = "height_field"
    endings: ClassVar[tuple[str, ...]] = (".png", ".npy")

    type: Literal["height_field"] = "height_field"
    center: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Middle of the field, at the height where its numbers are 0."""
    size: tuple[Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)]]
    """Its sides along x and z, from the first to the last row and column."""
    height: Metres = 1.0
    """Height that the number 1 stands for: white in a picture."""
    base: Metres | None = None
    """Height of its floor, from the center; a tenth of the longest side below its lowest place unless given."""

    @model_validator(mode="after")
    def _has_heights(self) -> HeightField:
        if self.height == 0:
            raise invalid("a height field needs a height", at=("height",), allowed="any but 0")
        return self

    def take(self, content: Floats) -> None:
        """Heights [rows, columns]. Raises UsageError for another form, and for a base that is not below them."""
        if content.ndim != 2 or min(content.shape) < 2:
            raise UsageError(
                f"{self.path} has the shape {content.shape}",
                "a height field has two axes, [rows, columns], with two rows and two columns at least",
            )
        y = self.height * content
        base = float(y.min()) - BASE * max(self.size) if self.base is None else self.base
        if base >= y.min():
            raise UsageError(
                f"the base at {base:g} m is not below the lowest place of {self.path}, at {float(y.min()):g} m",
                "give a lower base, or none",
            )
        surface = block(y, self.size, base)
        corners = surface.corners + np.asarray(self.center)
        self._surface = Triangles(corners, without_flat(corners, surface.faces)[0])
        self._content = content

    def words(self) -> str:
        a, b = self.size
        return f"{a:g} × {b:g} m of {self.path}"


class HeightFieldCollider(HeightField, Collider):
    """The ground, from the grey values of a PNG picture (black 0, white 1) or the numbers of a NPY array.

    Rows of the picture follow each other along z, and columns along x: the upper left corner has the smallest x and z.
    """

    costly: ClassVar[bool] = True

    def shape(self) -> Any:
        return self.geometry()

    def pivot(self) -> Vector3:
        return self.center

    def reach(self) -> float:
        return self.farthest()

    def describe(self) -> str:
        return self.words()


def block(y: Floats, size: tuple[float, float], base: float) -> Triangles:
    """Heights [rows, columns] over the sides (x, z) about the origin, with walls down to a floor at `base`."""
    rows, columns = y.shape
    x, z = np.linspace(-size[0] / 2, size[0] / 2, columns), np.linspace(-size[1] / 2, size[1] / 2, rows)
    top = np.stack([np.broadcast_to(x, y.shape), y, np.broadcast_to(z[:, None], y.shape)], axis=-1)
    floor = top.copy()
    floor[..., 1] = base
    index = np.arange(y.size).reshape(y.shape)
    # around the field, seen from above: every edge of the top's border, in the direction that its triangle runs
    ring = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    after = np.roll(ring, -1)
    middle = len(ring)  # the floor is a fan about its middle, between copies of the ring
    low = y.size + np.arange(middle)
    low_after = np.roll(low, -1)
    hub = y.size + middle
    walls = np.concatenate(
        [np.stack([ring, after, low_after], axis=1), np.stack([ring, low_after, low], axis=1)]
    )
    under = np.stack([low, low_after, np.full(middle, hub)], axis=1)
    corners = np.concatenate([top.reshape(-1, 3), floor.reshape(-1, 3)[ring], [[0.0, base, 0.0]]])
    return Triangles(corners, np.concatenate([grid_faces(index), walls, under]))
