"""The state at time zero: layouts placed, groups sized, pins set."""

from __future__ import annotations

import numpy as np

from particlesim.emitters import Emitter, Schedule
from particlesim.engine.program import needs_clock
from particlesim.engine.state import GroupState
from particlesim.errors import UsageError
from particlesim.graph import Island
from particlesim.groups import Group, Particles
from particlesim.layouts import CHUNK
from particlesim.scenario.scenario import Scenario


def populate(scenario: Scenario, island: Island, group: Group, first_id: int) -> GroupState:
    """The particles of a group at the start; an emitter's group is empty.

    Raises UsageError for a file that cannot be read, or that has no particle of a pinned index.
    """
    planes = island.planes[island.groups.index(group)]
    dtype = np.float64 if scenario.simulation.precision == "double" else np.float32
    layout = group.layout.open(scenario.folder) if isinstance(group, Particles) else None
    count = (layout.number() or 0) if layout is not None else _capacity(scenario, group)
    state = GroupState(
        group.name,
        count,
        dtype=dtype,
        memory=island.method.memory,
        clocked=needs_clock(group, planes),
        warm=group.temperature is not None,
        cooling=group.cooling,
    )
    if layout is None:
        return state
    streams = scenario.streams(group)
    for first in range(0, count, CHUNK):
        number = min(CHUNK, count - first)
        part = slice(first, first + number)
        placed = layout.place(streams, first, number)
        mass, radius = group.size(streams, first, number)
        state.x[:, part] = placed.position
        state.v[:, part] = placed.velocity
        state.mass[part] = mass if placed.mass is None else placed.mass
        if placed.radius is not None or group.has_radius():  # an untouched column takes no memory
            state.radius[part] = radius if placed.radius is None else placed.radius
        state.id[part] = np.arange(first_id + first, first_id + first + number)
        if group.temperature is not None:
            state.heat[part] = group.sample("temperature", streams, first, number)
    state.count = count
    if state.clocked:
        state.stop[:] = np.inf
    _pin(state, group)
    return state


def _capacity(scenario: Scenario, group: Group) -> int:
    """Room for the first births of an emitter."""
    assert isinstance(group, Emitter)
    total = Schedule(group, scenario.streams(group)).total(scenario.simulation.duration)
    return max(1, min(total, group.limit or total, 1 << 16))


def _pin(state: GroupState, group: Group) -> None:
    if not isinstance(group, Particles):
        return
    pinned = group.pins()
    if group.pinned is True:
        state.pin(slice(None))
    elif pinned:
        beyond = [index for index in pinned if index >= state.count]
        if beyond:
            raise UsageError(
                f"{group.name!r} has {state.count} particles; there is no particle {beyond[0]} to pin",
                f"pinned takes indices from 0 to {state.count - 1}",
            )
        state.pin(list(pinned))
    if pinned or group.pinned is True:
        fixed = np.isinf(state.start[: state.count])
        state.v[:, : state.count][:, fixed] = 0
