"""Shapes about an axis from one point to another: what capsules, cylinders and cones have in common."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Gt
from pydantic import model_validator

from particlesim.colliders.pose import Rows, along
from particlesim.colliders.solid import GRAIN, Solid
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3, norm, parallel


class AxialSolid(Solid):
    """A solid about an axis."""

    start: VectorOf[Metres]
    """Where its axis begins."""
    end: VectorOf[Metres]
    """Where its axis ends."""
    radius: Annotated[Metres, Gt(0)]
    """Its radius."""

    @model_validator(mode="after")
    def _has_length(self) -> AxialSolid:
        if self.start == self.end:
            raise invalid(
                f"a {self.kind} needs a length",
                at=("end",),
                also=[(("start",), "the same place")],
                allowed="any place but that of its start",
            )
        return self

    def length(self) -> float:
        """Of its axis [m]."""
        return norm(self._axis())

    def middle(self) -> Vector3:
        """Of its axis [m]."""
        a, b = self.start, self.end
        return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2

    def rotation(self) -> Rows:
        """Turns the y axis into its own."""
        return along(self._axis())

    def round_about(self, axis: Vector3) -> bool:
        return parallel(axis, self._axis())

    def _axis(self) -> Vector3:
        a, b = self.start, self.end
        return b[0] - a[0], b[1] - a[1], b[2] - a[2]

    def grain(self) -> float:
        return GRAIN * min(self.radius, self.length())

    def waist(self) -> float:
        return min(2 * self.radius, self.length())

    def farthest(self) -> float:
        return max(map(abs, (*self.start, *self.end))) + self.radius

    def words(self) -> str:
        (x, y, z), (u, v, w) = self.start, self.end
        return f"radius {self.radius:g} m from ({x:g}, {y:g}, {z:g}) to ({u:g}, {v:g}, {w:g})"
