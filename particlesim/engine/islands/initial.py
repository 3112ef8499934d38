"""The state at time zero: layouts placed, groups sized, pins set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from particlesim.bodies import Bodies
from particlesim.emitters import Emitter, Schedule
from particlesim.engine.rigid.rotation import matrix
from particlesim.engine.state.clinging import Holder
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.prescribed import Driven
from particlesim.engine.state.table import CLINGS, CLOCK, HEARD, ROTATION, SPIN, TRACED, WATCHED
from particlesim.engine.step.records import may_exhaust, may_miss, needs_clock
from particlesim.errors import UsageError
from particlesim.graph.graph import Island
from particlesim.groups.group import Group, Particles
from particlesim.groups.motion import Motion
from particlesim.groups.selection import selected
from particlesim.layouts import CHUNK
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.quaternions import UNTURNED, times
from particlesim.sampling.random_streams import Streams
from particlesim.sampling.shapes import Shape
from particlesim.scenario.reach import codes_of_groups, spins
from particlesim.scenario.scenario import Scenario


def populate(scenario: Scenario, island: Island, group: Group) -> GroupState:
    """The particles of a group at the start, with ids from 0; an emitter's group is empty.

    Raises UsageError for a file that cannot be read, or that has no particle of a pinned index.
    """
    member = island.groups.index(group)
    colliders, motions = island.colliders[member], island.motions[member]
    dtype = np.float64 if scenario.simulation.precision == "double" else np.float32
    if isinstance(group, Particles):
        group = group.model_copy(update={"layout": scenario.opened(group)})
    layout = group.layout if isinstance(group, Particles) else None
    count = (layout.number() or 0) if layout is not None else _capacity(scenario, group)
    clocked = needs_clock(group, colliders, bool(motions))
    sticky = [each for each in colliders if each.contact == "stick"]
    clings = any(each.motion is not None for each in sticky)
    state = GroupState(
        group.name,
        count,
        dtype=dtype,
        memory=island.method.memory,
        parts=[
            *(name for name in ATTRIBUTES if group.has(name)),
            *([CLOCK] if clocked else []),
            *([ROTATION] if isinstance(group, Bodies) else []),
            *([SPIN] if spins(scenario, group) else []),
            *([HEARD] if _heard(scenario, island, member) else []),
            *([CLINGS] if clings else []),
            *([WATCHED] if may_miss(colliders, group) else []),
            *([TRACED] if may_exhaust(colliders, group) else []),
        ],
        cooling=group.cooling,
    )
    if clings:
        state.holders = tuple(Holder(each.body()) for each in sticky)
    if layout is None:
        return state
    streams = scenario.streams(group)
    for first in range(0, count, CHUNK):
        number = min(CHUNK, count - first)
        part = slice(first, first + number)
        placed = layout.place(streams, first, number)
        read = group.sized(placed.attributes) if isinstance(group, Particles) else placed.attributes
        given = {**group.attributes(streams, first, number), **read}
        try:
            with np.errstate(over="raise"):
                state.x[:, part] = placed.position
                state.v[:, part] = placed.velocity
                for name, values in given.items():  # an untouched column takes no memory
                    state.assign(name, part, values)
        except FloatingPointError:
            raise UsageError(
                f"numbers of {group.name!r} are beyond {np.finfo(dtype).max:.2g}, which single precision does not hold",
                'precision = "double" under [simulation] does',
            ) from None
        if not state.mass[part].all():
            raise UsageError(
                f"masses of {group.name!r} are below {np.finfo(dtype).tiny:.2g} kg, the least that numbers hold",
                'precision = "double" under [simulation] reaches further than "single"',
            )
        state.id[part] = np.arange(first, first + number)
    state.count = count
    if state.clocked:
        state.stop[:] = np.inf
    if isinstance(group, Bodies):
        _turn(state, group, streams)
    elif isinstance(group, Particles):
        _pin(scenario, state, group, motions)
        if group.angular_velocity is not None:
            state.angular_velocity[:, :count] = np.transpose(np.atleast_2d(group.angular_velocity))
    return state


def _heard(scenario: Scenario, island: Island, member: int) -> bool:
    """Whether emitters react to impacts of a group."""
    every = [group.name for group in scenario.groups]
    on_groups = codes_of_groups(scenario, [island.groups[member].name], every)
    on_colliders = island.heard[member] if island.heard else ()
    return any(k is not None for k in on_colliders) or bool((on_groups < -1).any())


def _turn(state: GroupState, group: Bodies, streams: Streams) -> None:
    """Give bodies their orientations and angular momenta, L = R I Rᵀ ω."""
    turns, inertia = group.turns(streams, state.count), group.inertia()
    state.axes = tuple(group.axes().tolist())
    if state.axes != UNTURNED:  # kernels turn bodies about their principal axes
        turns = np.array(times(turns, state.axes))
    state.turn[:, : state.count] = turns
    for k in range(state.count):
        rotation = np.reshape(matrix(turns[:, k]), (3, 3))
        state.spin[:, k] = rotation @ (inertia * (rotation.T @ np.asarray(group.angular_velocity)))


def _capacity(scenario: Scenario, group: Group) -> int:
    """Room for the first births of an emitter."""
    assert isinstance(group, Emitter)
    total = Schedule(group, scenario.streams(group)).total(scenario.simulation.duration)
    return max(1, min(total, group.limit or total, 1 << 16))


def _pin(scenario: Scenario, state: GroupState, group: Particles, motions: Sequence[Motion]) -> None:
    """Hold the particles that are pinned, and put those that are led where their paths begin."""
    if not motions and not group.has_pins():
        return
    x = state.x[:, : state.count].astype(float)
    pinned = _existing(state, group.pins(x), "pinned")
    if isinstance(group.pinned, Shape) and not selected(group.pinned, group.layout, x).size:
        raise UsageError(
            f"pinned holds no particle of {group.name!r}: none is in its region",
            "regions are compared with the places at the start",
        )
    led = [
        pinned if m.particles is None else _existing(state, selected(m.particles, group.layout, x), m.label)
        for m in motions
    ]
    for m, rows in zip(motions, led, strict=True):
        if rows.size == 0:
            with scenario.at_motion(m):
                raise UsageError(
                    f"{m.label} leads no particle of {group.name!r}: none is in its region",
                    "regions are compared with the places at the start",
                )
    every, times = np.unique(np.concatenate([np.empty(0, np.int64), *led]), return_counts=True)
    if (times > 1).any():
        raise UsageError(
            f"particle {every[times.argmax()]} of {group.name!r} is led by two motions",
            "name different particles for each, with particles = ...",
        )
    held = np.union1d(pinned, every)
    state.pin(held)
    state.v[:, held] = 0
    state.driven = tuple(
        Driven(m.record(), rows, *np.ascontiguousarray(x[:, rows]))
        for m, rows in zip(motions, led, strict=True)
    )
    if state.driven:
        state.drive(0.0)
        wild = ~(np.isfinite(state.x[:, every]).all(axis=0) & np.isfinite(state.v[:, every]).all(axis=0))
        if wild.any():
            row = every[wild.argmax()]
            by = next(m for m, rows in zip(motions, led, strict=True) if row in rows)
            with scenario.at_motion(by):
                raise UsageError(
                    f"the path of particle {row} of {group.name!r} is not finite at t = 0",
                    "position and velocity must be finite from the start",
                )


def _existing(state: GroupState, rows: NDArray[np.int64], what: str) -> NDArray[np.int64]:
    """Rows, which must be those of particles: the number of particles in a file is not known before it is read."""
    if rows.size and rows[-1] >= state.count:
        raise UsageError(
            f"{what}: {state.name!r} has {state.count} particles; there is no particle {rows[-1]} to pin",
            f"indices go from 0 to {state.count - 1}",
        )
    return rows
