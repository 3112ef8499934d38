"""Particles that move so far in a step, past others, that soft contact may not see them touch: it looks at where steps end.

Hard ones are followed on their way (`engine.interactions.hard.swift`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.engine.world import World
from particlesim.scenario.reach import interacting


class Haste(NamedTuple):
    """How far a particle moves in a step relative to the mean of all [m], the least sum of its radius and another one [m],
    and the longest step for which that is not more than half of this [s]."""

    way: float
    size: float
    step: float


def haste(world: World) -> dict[str, Haste]:
    """By label, interactions by soft contact in which a particle moves farther in a step than the sum of two radii: whom it
    meets in the middle of the step it has passed at the end."""
    found: dict[str, Haste] = {}
    dt = world.grid.dt
    for each in world.scenario.interactions:
        if not each.touching() or each.by_impulses:
            continue
        groups = interacting(each, world.scenario.groups)
        names = {group.name for group in groups}
        states = [state for state in world.states if state.name in names and state.count]
        count = sum(state.count for state in states)
        if count < 2:
            continue
        mean = sum(state.v[:, : state.count].sum(axis=1, dtype=float) for state in states) / count
        # a point touches no other point, but those that have a radius
        radii = [state.radius[: state.count] for state in states]
        least = min(float(r[r > 0].min(initial=np.inf)) for r in radii)
        for state in states:
            sizes = state.radius[: state.count].astype(float) + least
            with np.errstate(over="ignore"):  # what is infinite is told by others
                ways = dt * np.sqrt(((state.v[:, : state.count] - mean[:, None]) ** 2).sum(axis=0))
            i = int(np.argmax(ways / sizes))
            way, size = float(ways[i]), float(sizes[i])
            known = found.get(each.label)
            if size < way < np.inf and (known is None or way / size > known.way / known.size):
                found[each.label] = Haste(way, size, dt * size / way / 2)
    return found
