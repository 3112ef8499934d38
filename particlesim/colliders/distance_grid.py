"""Distance grids: solids whose signed distance is sampled on a grid, as segmentations and other programs give them."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import PrivateAttr

from particlesim.colliders.content import SolidFromFile
from particlesim.colliders.level_set import BAND, LevelRecord, early, is_cut, where_early
from particlesim.colliders.levels import LevelsRecord, levels_of
from particlesim.colliders.pose import UNTURNED, Orientation, Rows, placed
from particlesim.colliders.sampled import SampledRecord, at_places, cells, spline
from particlesim.colliders.solid import GRAIN, SolidCollider
from particlesim.colliders.surface_net import surface_net
from particlesim.colliders.triangulation import Triangles
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3, norm

DRAWN = 96
"""Cells of the grid along its longest side that pictures show, at most."""


class DistanceGrid(SolidFromFile):
    """A solid from its signed distance, sampled on a grid: an array [nx, ny, nz] in a NPY file, negative inside.

    Between the samples it is a smooth spline through them; the solid ends where the grid does.
    """

    kind: ClassVar[str] = "distance_grid"
    convex: ClassVar[bool] = False
    endings: ClassVar[tuple[str, ...]] = (".npy",)

    type: Literal["distance_grid"] = "distance_grid"
    origin: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Place of the first sample."""
    spacing: (
        Annotated[Metres, Gt(0)]
        | tuple[Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)], Annotated[Metres, Gt(0)]]
    )
    """Distance of samples from each other: one number, or three for x, y and z."""
    orientation: Orientation | None = None
    """How it is turned about its origin."""

    _field: SampledRecord | None = PrivateAttr(default=None)
    _steep: float = PrivateAttr(default=1.0)
    _levels: LevelsRecord | None = PrivateAttr(default=None)

    @property
    def steps(self) -> Vector3:
        """Distance of samples along each axis [m]."""
        return self.spacing if isinstance(self.spacing, tuple) else (self.spacing,) * 3

    def take(self, content: Floats) -> None:
        """Distances [nx, ny, nz] in metres. Raises UsageError for another form, and where there is no surface."""
        if content.ndim != 3 or min(content.shape) < 2:
            raise UsageError(
                f"{self.path} has the shape {content.shape}",
                "a distance grid has three axes, x, y and z, with two samples at least along each",
            )
        if not (content < 0).any() or not (content > 0).any():
            sign = "positive" if not (content < 0).any() else "negative"
            raise UsageError(
                f"{self.path} has no surface: none of its distances is {'negative' if sign == 'positive' else 'positive'}",
                "distances are negative inside of the solid and positive outside",
            )
        coefficients = spline(content)
        self._field = SampledRecord(coefficients, self.steps)
        low, high, steep = cells(coefficients, self.steps)
        self._steep, self._levels = float(steep.max()), levels_of(low, high, steep)
        self._content = content

    def extent(self) -> Vector3:
        """Edges of the box that the samples fill [m]."""
        assert self._content is not None, "the file has not been read"
        x, y, z = (step * (n - 1) for step, n in zip(self.steps, self._content.shape, strict=True))
        return x, y, z

    def rotation(self) -> Rows:
        """From the axes of the grid to those of the world."""
        return UNTURNED if self.orientation is None else self.orientation.rotation()

    def level(self, side: float) -> Any:
        """The solid, or its inside (−1), as kernels take it."""
        assert self._field is not None, "the file has not been read"
        assert self._levels is not None, "the file has not been read"
        size = self.extent()
        band, low, cut = BAND * max(size), (0.0, 0.0, 0.0), is_cut(self._content)
        level = LevelRecord(self._field, low, size, self._steep, self._levels, cut, band, self.grain(), side)
        return placed(level, self.origin, self.rotation())

    def geometry(self) -> Any:
        return self.level(1.0)

    def grain(self) -> float:
        return GRAIN * min(self.steps)

    def farthest(self) -> float:
        return max(map(abs, self.origin)) + norm(self.extent())

    def early(self, radius: float) -> float:
        """How much too early balls of a radius may touch it [m]."""
        axes = [step * np.arange(n) for step, n in zip(self.steps, self._content.shape, strict=True)]
        return early(self._content, axes, radius)

    def early_where(self, radius: float) -> str:
        """Where that is, and what avoids it."""
        return where_early(radius)

    def words(self) -> str:
        x, y, z = self.origin
        return f"{self.path} at ({x:g}, {y:g}, {z:g})"

    def triangles(self) -> Triangles:
        assert self._field is not None, "the file has not been read"
        content, axes = self._content, []
        for k, step in enumerate(self.steps):
            number = content.shape[k]
            stride = max(1, -(-max(content.shape) // DRAWN))
            rows = np.unique(np.append(np.arange(0, number, stride), number - 1))
            content = np.take(content, rows, axis=k)
            axes.append(step * rows.astype(float))
        field = self._field
        return surface_net(content, axes, lambda x: at_places(field, x)).placed(self.origin, self.rotation())


class DistanceGridCollider(DistanceGrid, SolidCollider):
    """A solid from its signed distance, sampled on a grid: an array [nx, ny, nz] in a NPY file, negative inside.

    Between the samples it is a smooth spline through them; the solid ends where the grid does.
    """

    costly: ClassVar[bool] = True

    def shape(self) -> Any:
        return self.level(-1.0 if self.inside else 1.0)
