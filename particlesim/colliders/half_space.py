"""Half-spaces: what is behind a plane, as a part of what is put together."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import field_validator

from particlesim.colliders.plane import HalfSpaceRecord
from particlesim.colliders.solid import Solid
from particlesim.colliders.triangulation import Triangles
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import dot, perpendicular, unit


class HalfSpace(Solid):
    """All that is behind a plane. It has no end, and no grain: those of the parts that it is put together with count."""

    kind: ClassVar[str] = "plane"
    exact: ClassVar[bool] = True

    type: Literal["plane"] = "plane"
    point: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """A point on the plane."""
    normal: VectorOf[float] = (0.0, 1.0, 0.0)
    """Direction out of the solid; its length does not matter."""

    @field_validator("normal")
    @classmethod
    def _has_direction(cls, normal: tuple[float, float, float]) -> tuple[float, float, float]:
        unit(normal)
        return normal

    def geometry(self) -> Any:
        normal = unit(self.normal)
        return HalfSpaceRecord(*normal, dot(normal, self.point))

    def outside(self) -> Any:
        """What is on the other side of the plane, as kernels take it."""
        x, y, z, offset = self.geometry()
        return HalfSpaceRecord(-x, -y, -z, -offset)

    def grain(self) -> float:
        return math.inf

    def farthest(self) -> float:
        return 0.0

    def words(self) -> str:
        x, y, z = self.normal
        return f"normal ({x:g}, {y:g}, {z:g})"

    def within(self, reach: float) -> Triangles:
        """A square of the plane, in which all of it is whose coordinates are up to `reach` [m]."""
        up = np.array(unit(self.normal))
        u, v = (np.array(each) for each in perpendicular(unit(self.normal)))
        middle = self.geometry().offset * up
        corners = [
            middle + math.sqrt(3) * reach * (i * u + j * v) for i, j in ((1, -1), (1, 1), (-1, 1), (-1, -1))
        ]
        return Triangles(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))
