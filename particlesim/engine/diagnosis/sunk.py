"""Hard grains that have sunk into each other: impulses of deep heaps are more than the turns of a step find."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from particlesim.engine.interactions.hard.impulses import SINK_TURNS
from particlesim.engine.islands.overlaps import overlapping
from particlesim.engine.world import World
from particlesim.interactions.contact import Contact
from particlesim.scenario.reach import interacting, touches_by_surfaces

DEEP = 0.1
"""Overlap, as a part of the smaller radius, that is told."""
STEPS = 10
"""Steps for which the present relative velocity would have to last, at least, to bring it about: impacts are deep, too."""


def sunk(world: World) -> Iterator[str]:
    """A sentence for every contact by impulses whose grains lie deep in each other."""
    for each in world.scenario.interactions:
        if not isinstance(each, Contact) or not each.by_impulses or each.liveliness >= 1:
            continue
        groups = interacting(each, world.scenario.groups)
        if touches_by_surfaces(each, groups):
            continue
        names = [group.name for group in groups]
        states = [state for state in world.states if state.name in names and state.count]
        if not states:
            continue
        x = np.concatenate([state.position.astype(float) for state in states])
        r = np.concatenate([state.radius[: state.count].astype(float) for state in states])
        v = np.concatenate([state.v[:, : state.count].T.astype(float) for state in states])
        side = np.repeat([names.index(state.name) for state in states], [state.count for state in states])
        i, j, depth = overlapping(x, r, world.scenario.simulation.box)
        deep = depth > DEEP * np.minimum(r[i], r[j])
        deep &= STEPS * world.grid.dt * np.linalg.norm(v[i] - v[j], axis=1) < depth
        deep &= (v[i] != 0).any(axis=1) | (v[j] != 0).any(axis=1)  # else both may be pinned
        if each.between is not None:
            deep &= side[i] != side[j]
        if deep.any():
            number, most = int(deep.sum()), float(depth[deep].max())
            have = "pair {} has" if number == 1 else "pairs {} have"
            yield (
                f"{number} {have.format(f'of {each.label}')} sunk into each other, by up to {most:.3g} m: "
                f"{SINK_TURNS} turns do not find the impulses of so many layers; "
                f'try a smaller dt, such as {world.grid.dt / 4:.3g} s, or springs (model = "linear")'
            )
