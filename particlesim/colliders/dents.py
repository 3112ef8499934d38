"""Shapes with dents: what lies on one part of them may meet another part."""

from __future__ import annotations

from typing import Any

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.pose import ShiftedRecord, TurnedRecord
from particlesim.laws.registry import has_law, thinnest


def dented(shape: Any) -> bool:
    """Whether a shape may have dents, by its type: one that tells how thin its parts are at least, as meshes, containers and
    what is put together do. Of others the end of a step says whether a particle has come to another part of them."""
    if isinstance(shape, (MovingRecord, ShiftedRecord, TurnedRecord)):
        return dented(shape.shape)
    return has_law(thinnest, shape)
