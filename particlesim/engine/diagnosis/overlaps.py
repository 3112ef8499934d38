"""Particles that are inside of a collider: at the start that is a mistake, which contact mends at the cost of energy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from particlesim.colliders import Collider
from particlesim.colliders.gaps import gaps_of
from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.groups.group import Particles

TOUCHING = 1e-6
"""Overlap that still counts as touching, as a part of the largest coordinate."""


PIECE = 1 << 16
"""Particles looked at together: a run needs no more memory for it."""


class Overlap(NamedTuple):
    """A group of which particles are inside of a collider: how many, and the row and depth [m] of the deepest."""

    state: GroupState
    collider: Collider
    number: int
    deepest: int
    depth: float


def overlaps(island: BaseIsland, structure: Island) -> Iterator[Overlap]:
    """Groups of an island that are inside of colliders they bounce from. Backdrops, which never move, are left out; rigid
    bodies know themselves where they are inside (`RigidIsland.intrusions`)."""
    if structure.rigid:
        return
    for state, group, colliders in zip(island.states, structure.groups, structure.colliders, strict=True):
        if not state.count or (isinstance(group, Particles) and group.pinned is True):
            continue
        farthest = max(float(state.position.max()), -float(state.position.min()))
        for collider in colliders:
            if collider.contact == "bounce":
                found = _overlap(state, collider, TOUCHING * farthest)
                if found.number:
                    yield found


def _overlap(state: GroupState, collider: Collider, margin: float) -> Overlap:
    """How a group lies to a collider; up to `margin` [m] particles only touch it."""
    shape = collider.body()
    number, deepest, most = 0, 0, -np.inf
    for first in range(0, state.count, PIECE):
        part = slice(first, min(first + PIECE, state.count))
        x, y, z, radius = (column[part].astype(float) for column in (*state.x, state.radius))
        depth = np.empty(x.size)
        gaps_of(shape, x, y, z, radius, 0.0, depth)
        depth *= -1
        number += int((depth > margin).sum())
        row = int(depth.argmax())
        if depth[row] > most:
            deepest, most = first + row, float(depth[row])
    return Overlap(state, collider, number, deepest, most)
