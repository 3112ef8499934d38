"""Particles that are inside of a plane: at the start that is a mistake, which contact mends at the cost of energy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from particlesim.colliders import Plane
from particlesim.engine.islands.coupled import CoupledIsland
from particlesim.engine.islands.independent import IndependentIsland
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.groups.group import Particles
from particlesim.model.vectors import unit

TOUCHING = 1e-6
"""Overlap that still counts as touching, as a part of the largest coordinate."""


PIECE = 1 << 16
"""Particles looked at together: a run needs no more memory for it."""


class Overlap(NamedTuple):
    """A group of which particles are inside of a plane: how many, and the row and depth [m] of the deepest."""

    state: GroupState
    plane: Plane
    number: int
    deepest: int
    depth: float


def overlaps(island: IndependentIsland | CoupledIsland, structure: Island) -> Iterator[Overlap]:
    """Groups of an island that are inside of planes they bounce from. Backdrops, which never move, are left out."""
    for state, group, planes in zip(island.states, structure.groups, structure.planes, strict=True):
        if not state.count or (isinstance(group, Particles) and group.pinned is True):
            continue
        farthest = max(float(state.position.max()), -float(state.position.min()))
        for plane in planes:
            if plane.contact == "bounce":
                found = _overlap(state, plane, TOUCHING * farthest)
                if found.number:
                    yield found


def _overlap(state: GroupState, plane: Plane, margin: float) -> Overlap:
    """How a group lies to a plane; up to `margin` [m] particles only touch it."""
    number, deepest, most = 0, 0, -np.inf
    for first in range(0, state.count, PIECE):
        part = slice(first, min(first + PIECE, state.count))
        # Not a matrix product: BLAS would leave threads behind that spin while the first steps want all cores.
        depth = state.radius[part].astype(float)
        for x, origin, normal in zip(state.x, plane.point, unit(plane.normal), strict=True):
            depth -= normal * (x[part].astype(float) - origin)
        number += int((depth > margin).sum())
        row = int(depth.argmax())
        if depth[row] > most:
            deepest, most = first + row, float(depth[row])
    return Overlap(state, plane, number, deepest, most)
