"""What a frame holds: the columns of a simulation's present state, for the recorder or in memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.simulation import Simulation
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.world import rows
from particlesim.trajectory.fields import FIELDS
from particlesim.trajectory.frame import Frame

Array = NDArray[Any]
Buffer = Callable[[str, int], Array]


def column(
    simulation: Simulation, field: str, out: Array, overflowed: Callable[[str], None] | None = None
) -> Array:
    """Fill `out`, of shape [n] or [n, 3], with a field of all particles, group after group; positions are those in the box.

    Beyond 3.4e38 a float32 is infinite; the state is not, and the run goes on. `overflowed(field)` is called then.
    """

    def note(*_: object) -> None:
        if overflowed is not None:
            overflowed(field)

    with np.errstate(over="call", call=note):
        for k, (state, part) in enumerate(zip(simulation.states, rows(simulation.states), strict=True)):
            if state.count:
                _fill(simulation, state, k, field, out[part], note)
    return out


def _fill(
    simulation: Simulation,
    state: GroupState,
    number: int,
    field: str,
    out: Array,
    note: Callable[..., None],
) -> None:
    n, time = state.count, simulation.time
    box = simulation.scenario.simulation.box
    if field == "position" and box is not None:
        out[:] = box.as_box().wrapped(state.x[:, :n].T)
    elif field == "position":
        _interleave(simulation, state.x, out, note)
    elif field == "image":
        out[:] = 0 if box is None else box.as_box().images(state.x[:, :n].T)
    elif field == "velocity":
        _interleave(simulation, state.v, out, note)
    elif field == "force":
        out[:] = simulation.forces_on(state)
    elif field == "acceleration":
        out[:] = simulation.forces_on(state) / state.mass[:n, None]
    elif field == "orientation":
        out[:] = state.orientations().T
    elif field == "angular_velocity":
        out[:] = simulation.turning(state)
    elif field == "speed":
        out[:] = np.sqrt((state.v[:, :n].astype(float) ** 2).sum(axis=0))
    elif field == "temperature":
        out[:] = state.temperature(time)
    elif field == "age":
        out[:] = state.age(time)
    elif field == "group":
        out[:] = number
    else:
        out[:] = state.id[:n] if field == "id" else state.attribute(field)


def _interleave(simulation: Simulation, arrays: Array, out: Array, note: Callable[..., None]) -> None:
    """Structure of arrays [3, n] to rows [n, 3], by pieces that stay in cache."""

    def work(first: int, last: int) -> None:
        with np.errstate(over="call", call=note):  # each thread has its own
            out[first:last] = arrays[:, first:last].T

    simulation.team.over_range(len(out), 1 << 14, work, worth=len(out) >= 1 << 17)


def columns_of(
    simulation: Simulation,
    fields: tuple[str, ...],
    buffer: Buffer,
    overflowed: Callable[[str], None] | None = None,
) -> dict[str, Array]:
    """All columns of a frame, in arrays from `buffer(field, n)`; `overflowed` as in `column`."""
    n = simulation.count
    return {
        name: column(simulation, name, buffer(name, n), overflowed) for name in ("position", "id", *fields)
    }


def frame_of(simulation: Simulation, index: int) -> Frame:
    """The present state as a frame in memory, in the run's own precision; fields are made when they are asked for."""
    count = simulation.count
    precision, box = simulation.scenario.simulation.precision, simulation.scenario.simulation.box

    def load(field: str) -> Array:
        spec = FIELDS[field]
        return column(simulation, field, np.empty(spec.shape(count), spec.dtype(precision)))

    return Frame(
        index=index,
        time=simulation.time,
        step=simulation.step,
        count=count,
        fields=tuple(name for name in FIELDS if name != "image" or box is not None),
        groups=tuple(group.name for group in simulation.scenario.groups),
        load=load,
        box=None if box is None else box.as_box(),
    )
