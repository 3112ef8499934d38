"""Shapes with dents: what lies on one part of them may meet another part."""

from __future__ import annotations

from typing import Any

from particlesim.colliders.mesh import MeshRecord, thickness
from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.pose import ShiftedRecord, TurnedRecord


def dented(shape: Any) -> bool:
    """Whether a shape may have dents, by its type: a surface of triangles. Of others the end of a step says whether a
    particle has come to another part of them, as their parts are not thin."""
    if isinstance(shape, (MovingRecord, ShiftedRecord, TurnedRecord)):
        return dented(shape.shape)
    return isinstance(shape, MeshRecord)


def thinnest(shape: Any) -> Any:
    """A length that a particle must move to get through any part of a shape with dents [m]."""
    if isinstance(shape, (MovingRecord, ShiftedRecord, TurnedRecord)):
        return thinnest(shape.shape)
    return thickness(shape)
