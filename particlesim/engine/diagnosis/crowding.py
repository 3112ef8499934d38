"""Particles with contact that overlap at the start or at birth: psim warns of them, as they will be pushed apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.emitters import Emitter, Schedule
from particlesim.engine.islands.overlaps import overlapping
from particlesim.engine.world import World
from particlesim.forces.gravity import Gravity
from particlesim.interactions.contact import Contact
from particlesim.model.arrays import Floats
from particlesim.scenario.reach import acts_on, interacting, touches_by_surfaces
from particlesim.scenario.scenario import Scenario

FIRST = 256
"""Births of an emitter that are looked at."""
SQUEEZED = 0.2
"""Overlap at birth, as a part of the smaller radius, from which on contact throws particles apart."""
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


class CrowdedBirths(NamedTuple):
    """An emitter whose particles are born in each other: the interaction, the emitter, how many of how many that were looked
    at, and the deepest overlap as a part of the smaller radius."""

    label: str
    emitter: str
    number: int
    looked_at: int
    depth: float


def crowded_births(world: World) -> list[CrowdedBirths]:
    """Emitters whose first particles are born deep in each other where soft contact acts between them.

    Those that have been born fly freely meanwhile, under uniform gravity: what contacts and other forces do is not known.
    """
    found = []
    for each in world.scenario.interactions:
        if not isinstance(each, Contact) or each.model == "impulse" or each.between is not None:
            continue
        for group in interacting(each, world.scenario.groups):
            if isinstance(group, Emitter) and group.on_impact is None:
                depths = _depths_at_birth(world.scenario, group)
                if (deep := depths > SQUEEZED).any():
                    number = int(deep.sum())
                    found.append(
                        CrowdedBirths(each.label, group.name, number, len(depths), float(depths.max()))
                    )
    return found


def _depths_at_birth(scenario: Scenario, emitter: Emitter) -> Floats:
    """How deep each of the first particles of an emitter is born in one before it, as a part of the smaller radius."""
    streams = scenario.streams(emitter)
    schedule = Schedule(emitter, streams)
    count = min(FIRST, schedule.before(scenario.simulation.duration))
    times = schedule.times(0, count)
    born = emitter.births(streams, 0, times)
    x, v, r = born.position.T, born.velocity.T, born.attributes["radius"]
    forces = (each for each in scenario.forces if isinstance(each, Gravity) and acts_on(each, emitter))
    fall = np.sum([each.acceleration for each in forces], axis=0) if scenario.forces else np.zeros(3)
    depths = np.zeros(count)
    for k in range(1, count):
        age = (times[k] - times[:k])[:, None]
        apart = x[:k] + age * v[:k] + 0.5 * age**2 * fall - x[k]
        overlap = r[:k] + r[k] - np.linalg.norm(apart, axis=1)
        overlap[times[k] - times[:k] > born.lifetime[:k]] = 0
        smaller = np.minimum(r[:k], r[k])
        depths[k] = (overlap[smaller > 0] / smaller[smaller > 0]).max(initial=0.0)
    return depths
