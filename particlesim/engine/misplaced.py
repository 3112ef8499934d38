"""Particles that are inside of a plane: at the start that is a mistake, which contact mends at the cost of energy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders import Plane
from particlesim.engine.coupled_island import CoupledIsland
from particlesim.engine.islands import IndependentIsland
from particlesim.engine.state import GroupState
from particlesim.graph import Island
from particlesim.groups import Particles
from particlesim.vectors import unit

TOUCHING = 1e-6
"""Overlap that still counts as touching, as a part of the largest coordinate."""


class Overlap(NamedTuple):
    """A group that is inside of a plane: by how much [m], shape [n]; negative for particles that are outside."""

    state: GroupState
    plane: Plane
    depth: NDArray[np.float64]

    @property
    def number(self) -> int:
        """Particles inside."""
        return int((self.depth > self.margin).sum())

    @property
    def margin(self) -> float:
        """Depth that counts as touching [m]."""
        return TOUCHING * max(float(np.abs(self.state.position).max()), float(self.depth.max()))


def overlaps(island: IndependentIsland | CoupledIsland, structure: Island) -> Iterator[Overlap]:
    """Groups of an island that are inside of planes they bounce from. Backdrops, which never move, are left out."""
    for state, group, planes in zip(island.states, structure.groups, structure.planes, strict=True):
        if not state.count or (isinstance(group, Particles) and group.pinned is True):
            continue
        for plane in planes:
            if plane.contact == "bounce":
                # Not a matrix product: BLAS would leave threads behind that spin while the first steps want all cores.
                depth = state.radius[: state.count].astype(float)
                for x, origin, normal in zip(state.x, plane.point, unit(plane.normal), strict=True):
                    depth -= normal * (x[: state.count].astype(float) - origin)
                found = Overlap(state, plane, depth)
                if found.number:
                    yield found
