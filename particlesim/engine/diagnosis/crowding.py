"""Particles with contact that overlap each other at the start: psim warns of them, as they will be pushed apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.engine.islands.overlaps import overlapping
from particlesim.engine.world import World
from particlesim.interactions.contact import Contact
from particlesim.scenario.reach import interacting, touches_by_surfaces

TOUCHING = 1e-6
"""Overlap that still counts as touching, as a part of the sum of both radii."""


class Crowding(NamedTuple):
    """Pairs that overlap at the start: the interaction, how many, ids of the deepest two and how deep they are [m]."""

    label: str
    number: int
    ids: tuple[int, int]
    depth: float


def crowded(world: World) -> list[Crowding]:
    """The pairs of every contact interaction that overlap in the present state."""
    found = []
    for each in world.scenario.interactions:
        if not isinstance(each, Contact):
            continue
        groups = interacting(each, world.scenario.groups)
        if touches_by_surfaces(each, groups):
            continue  # `tangles`
        names = [group.name for group in groups]
        states = [state for name in names for state in world.states if state.name == name and state.count]
        if not states:
            continue
        x = np.concatenate([state.position.astype(float) for state in states])
        r = np.concatenate([state.radius[: state.count].astype(float) for state in states])
        ids = np.concatenate([state.id[: state.count] for state in states])
        side = np.repeat([names.index(state.name) for state in states], [state.count for state in states])
        i, j, depth = overlapping(x, r, world.scenario.simulation.box)
        deep = depth > TOUCHING * (r[i] + r[j])
        if each.between is not None:
            deep &= side[i] != side[j]
        if deep.any():
            k = int(np.argmax(np.where(deep, depth, -np.inf)))
            found.append(
                Crowding(each.label, int(deep.sum()), (int(ids[i[k]]), int(ids[j[k]])), float(depth[k]))
            )
    return found
