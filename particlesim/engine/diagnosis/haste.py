"""Particles that move so far in a step, past others, that contact may not see them touch: it looks at where steps end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.engine.world import World
from particlesim.scenario.reach import interacting, touches_by_surfaces


class Haste(NamedTuple):
    """How far a particle moves in a step relative to the mean of all [m], the least sum of its radius and another one [m],
    and the longest step for which that is not more than half of this [s]."""

    way: float
    size: float
    step: float


def haste(world: World) -> dict[str, Haste]:
    """By label, interactions by contact in which a particle moves farther in a step than the sum of two radii: whom it meets
    in the middle of the step it has passed at the end."""
    found: dict[str, Haste] = {}
    dt = world.grid.dt
    for each in world.scenario.interactions:
        groups = interacting(each, world.scenario.groups)
        if not each.touching() or touches_by_surfaces(each, groups):
            continue
        names = {group.name for group in groups}
        states = [state for state in world.states if state.name in names and state.count]
        count = sum(state.count for state in states)
        if count < 2:
            continue
        mean = sum(state.v[:, : state.count].sum(axis=1, dtype=float) for state in states) / count
        least = min(float(state.radius[: state.count].min()) for state in states)
        for state in states:
            speed2 = ((state.v[:, : state.count] - mean[:, None].astype(state.dtype)) ** 2).sum(axis=0)
            sizes = state.radius[: state.count] + state.dtype.type(least)
            i = int(np.argmax(speed2 / sizes**2))
            way, size = dt * float(np.sqrt(speed2[i])), float(sizes[i])
            if way > size and (
                each.label not in found or way / size > found[each.label].way / found[each.label].size
            ):
                found[each.label] = Haste(way, size, dt * size / way / 2)
    return found
