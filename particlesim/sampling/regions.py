"""Regions of space that a check looks into."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Number, Vector
from particlesim.model.variants import Tagged
from particlesim.sampling.shapes import Ball, Box


class HalfSpace(Model):
    """All of space on one side of a plane."""

    type: Literal["half_space"] = "half_space"
    point: Vector[Metres] = (0.0, 0.0, 0.0)
    """A point of the plane that bounds it."""
    normal: Vector[Number] = (0.0, 1.0, 0.0)
    """Direction into it, of any length."""

    @model_validator(mode="after")
    def _directed(self) -> HalfSpace:
        if not any(self.normal):
            raise invalid("a normal of length 0 points nowhere", at=("normal",))
        return self


AnyRegion = Annotated[Box | Ball | HalfSpace, Tagged("type")]


def inside(region: Box | Ball | HalfSpace, position: NDArray[Any]) -> NDArray[np.bool_]:
    """Which positions [m], shape [n, 3], lie in a region; its surface belongs to it."""
    if isinstance(region, Box):
        low, high = np.array(region.min), np.array(region.max)
        return np.asarray(((position >= low) & (position <= high)).all(axis=1))
    if isinstance(region, Ball):
        offset = position - np.array(region.center)
        return np.asarray(np.square(offset).sum(axis=1) <= region.radius**2)
    return np.asarray((position - np.array(region.point)) @ np.array(region.normal) >= 0)
