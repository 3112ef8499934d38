"""Islands as the engine runs them: independent groups in blocks, coupled groups by stages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.bonds import BondSet, SpringRecord, StringRecord
from particlesim.colliders import Plane
from particlesim.emitters import Emitter, Schedule
from particlesim.engine.columns import Clock, Columns, Thermal
from particlesim.engine.coupled import Bonds, Breaking, Part, island_forces, scratch, staged, step_island
from particlesim.engine.independent import BLOCK, Program, step_range
from particlesim.engine.measure import sum_forces
from particlesim.engine.program import as_precision, contacts_record, dynamics_record, group_program
from particlesim.engine.state import AGE, COLD, RECYCLED, Deaths, GroupState
from particlesim.errors import UsageError
from particlesim.forces import Force
from particlesim.graph import Island
from particlesim.groups import Group, Particles
from particlesim.integrators import METHODS
from particlesim.layouts.file import File
from particlesim.scenario.scenario import Scenario
from particlesim.team import Team

WORTH_THREADS = 500_000
"""Particle-steps below which one thread is faster than waking others."""


@dataclass(frozen=True)
class Fault:
    """Where a number stopped being finite: the group's position in the island, the row, and the step that did it.

    The state is that of the step's beginning.
    """

    member: int
    row: int
    step: int


@dataclass
class Births:
    """Particles born in an interval: ids, times [s]."""

    ids: NDArray[np.int64]
    times: NDArray[np.float64]


class IndependentIsland:
    """One group of particles that do not act on each other, with its emitter if it has one."""

    def __init__(
        self,
        scenario: Scenario,
        island: Island,
        state: GroupState,
        births: tuple[int, int],
        block: int = BLOCK,
    ) -> None:
        (group,), (forces,), (planes,) = island.groups, island.forces, island.planes
        self.states = [state]
        self.group = group
        self.dt = scenario.grid.dt
        self.program: Program = group_program(island, forces, planes, group, state.dtype)
        self._columns_of = {
            "radius": group_uses_radius(forces, planes, group),
            "thermal": any(force.needs_temperature() for force in forces),
        }
        self._block = block
        self._fixed = isinstance(group, Particles) and group.pinned is True
        self._source = Source(scenario, group, births) if isinstance(group, Emitter) else None

    @property
    def state(self) -> GroupState:
        """The only group."""
        return self.states[0]

    def columns(self) -> list[Columns]:
        """Columns of every group of the island."""
        return [self.state.columns(**self._columns_of)]

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        """Total force on every particle at a time [N], shape [3, n]."""
        out = np.zeros((3, self.state.count))
        if self.state.count:
            sum_forces(self.program.forces, self.columns()[0], time, 0, self.state.count, out)
        return out

    def phase(self, first: int, last: int) -> int:
        """How far steps may go from `first` towards `last` in one piece."""
        waits = self._source is not None and self._source.waits
        return min(first + 1, last) if waits else last

    def advance(self, first: int, last: int, team: Team) -> tuple[Births | None, Deaths | None, Fault | None]:
        """Steps first … last − 1: births, motion, deaths."""
        born = None
        if self._source is not None:
            born = self._source.emit(self.state, first * self.dt, last * self.dt)
        if self._fixed:  # a backdrop: nothing to step, and no kernel to compile for it
            return None, None, None
        faults = np.zeros(self.state.count, np.bool_)
        if self.state.count:
            columns = self.columns()[0]

            def work(a: int, b: int) -> None:
                step_range(self.program, columns, first, last - first, self.dt, a, b, self._block, faults)

            team.over_range(
                self.state.count, self._block, work, worth=self.state.count * (last - first) >= WORTH_THREADS
            )
        if faults.any():
            return born, None, self._find(np.flatnonzero(faults), first, last)
        deaths = self.state.bury(last * self.dt) if self.state.clocked else None
        return born, deaths, None

    def _find(self, blocks: NDArray[np.intp], first: int, last: int) -> Fault:
        """The first step and particle at which a number stopped being finite; blocks are back at step `first`."""
        columns = self.columns()[0]
        earliest = Fault(0, int(blocks[0]), last)
        for block in blocks[:64]:
            end = min(int(block) + self._block, self.state.count)
            for step in range(first, min(earliest.step, last)):
                fault = np.zeros(self.state.count, np.bool_)
                step_range(self.program, columns, step, 1, self.dt, int(block), end, 1, fault)
                if fault.any():
                    earliest = Fault(0, int(fault.argmax()), step)
                    break
        return earliest


class Source:
    """Gives birth to the particles of an emitter."""

    def __init__(self, scenario: Scenario, emitter: Emitter, births: tuple[int, int]) -> None:
        self.emitter = emitter
        self.streams = scenario.streams(emitter)
        self.schedule = Schedule(emitter, self.streams)
        self.first_id, self.stride = births
        self.born = 0
        self.waits = emitter.limit is not None and emitter.when_full == "wait"

    def emit(self, state: GroupState, begin: float, end: float) -> Births:
        """Births due before `end`; appended to the group with their clocks set."""
        due = self.schedule.before(end)
        if self.waits and self.emitter.limit is not None:
            due = min(due, self.born + self.emitter.limit - state.count)
        first, count = self.born, max(due - self.born, 0)
        times = self.schedule.times(first, first + count)
        if self.waits:
            times = np.maximum(times, begin)  # those that had to wait are born now
        ids = self.first_id + self.stride * np.arange(first, first + count)
        if count:
            self._append(state, first, times, ids)
            self.born += count
        if self.emitter.limit is not None and not self.waits:
            self._recycle(state)
        return Births(ids, times)

    def _append(
        self, state: GroupState, first: int, times: NDArray[np.float64], ids: NDArray[np.int64]
    ) -> None:
        new = slice(state.count, state.count + len(times))
        state.reserve(new.stop)
        born = self.emitter.births(self.streams, first, times)
        state.x[:, new] = born.position
        state.v[:, new] = born.velocity
        state.mass[new] = born.mass
        if self.emitter.has_radius():
            state.radius[new] = born.radius
        state.id[new] = ids
        state.birth[new] = state.start[new] = times
        state.outcome[new] = 0
        for column in state.memory:
            column[new] = 0
        stop, cause = times + born.lifetime, np.full(len(times), AGE, np.uint8)
        if born.temperature is not None:
            state.heat[new] = born.temperature
            cold = times + self._cooling_time(born.temperature)
            cause[cold < stop] = COLD
            stop = np.minimum(stop, cold)
        state.stop[new], state.cause[new] = stop, cause
        state.count = new.stop

    def _cooling_time(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        """How long particles take to cool below the temperature at which they die [s]."""
        emitter = self.emitter
        below = emitter.die.temperature_below if emitter.die is not None else None
        if below is None or emitter.cooling is None:
            return np.full(len(temperature), np.inf)
        ratio = (temperature - emitter.cooling.ambient) / (below - emitter.cooling.ambient)
        return np.asarray(np.log(np.maximum(ratio, 1.0)) / emitter.cooling.rate)

    def _recycle(self, state: GroupState) -> None:
        """The slot of particle k goes to particle k + limit: its life ends at that one's birth."""
        n, limit = state.count, self.emitter.limit or 0
        number = (state.id[:n] - self.first_id) // self.stride
        successor = np.searchsorted(number, number + limit)
        taken = np.flatnonzero(successor < n)
        taken = taken[number[successor[taken]] == number[taken] + limit]
        ends = state.birth[:n][successor[taken]]
        earlier = ends < state.stop[:n][taken]
        state.stop[:n][taken[earlier]] = ends[earlier]
        state.cause[:n][taken[earlier]] = RECYCLED


class CoupledIsland:
    """Groups joined by springs; their states are stretches of the island's arrays."""

    def __init__(self, scenario: Scenario, island: Island, states: Sequence[GroupState]) -> None:
        self.dt = scenario.grid.dt
        self._method = METHODS[island.method]
        self._staged = staged(self._method)
        self._join(list(states))
        dtype = self._all.dtype
        bounds = np.cumsum([0, *(state.count for state in states)]).tolist()
        self._bounds = bounds
        self._radius = any(
            group_uses_radius(island.forces[k], island.planes[k], g) for k, g in enumerate(island.groups)
        )
        self._thermal = any(force.needs_temperature() for forces in island.forces for force in forces)
        self.parts = tuple(
            as_precision(
                Part(
                    dynamics_record(group),
                    tuple(force.record() for force in island.forces[k]),
                    contacts_record(island.planes[k], group, dtype),
                    bounds[k],
                    bounds[k + 1],
                ),
                dtype,
            )
            for k, group in enumerate(island.groups)
        )
        offset = {group.name: bounds[k] for k, group in enumerate(island.groups)}
        self.bonds = tuple(self._bonds_of(bonds, offset) for bonds in island.bonds)
        self._work = scratch(self._method, self._all.count, dtype)

    def _join(self, states: list[GroupState]) -> None:
        """One set of arrays for the island; the groups become views of it."""
        first = states[0]
        total = sum(state.count for state in states)
        whole = GroupState(
            first.name,
            total,
            dtype=first.dtype,
            memory=len(first.memory),
            clocked=any(state.clocked for state in states),
            warm=any(state.warm for state in states),
        )
        whole.count = total
        if whole.clocked:
            whole.stop[:] = np.inf
        self.states: list[GroupState] = []
        begin = 0
        for state in states:
            part = slice(begin, begin + state.count)
            begin = part.stop
            for mine, theirs in zip(whole.arrays(), state.arrays(), strict=True):
                if mine.size and theirs.size:
                    mine[part] = theirs[: state.count]
            self.states.append(whole.stretch(state, part))
        self._all = whole

    def _bonds_of(self, bonds: BondSet, offset: dict[str, int]) -> Bonds:
        """Bonds as the kernel takes them: ends in rows of the island, constants in the precision of the run."""
        law = bonds.law
        states = [next(state for state in self.states if state.name == name) for name in bonds.groups]
        pairs = bonds.find(*(state.position.T.astype(float) for state in states))
        for end, state in enumerate(states):
            if pairs[:, end].max() >= state.count:
                raise UsageError(
                    f"{bonds.name}: {state.name!r} has {state.count} particles, "
                    f"there is no particle {int(pairs[:, end].max())}"
                )
        i, j = (pairs[:, end] + offset[state.name] for end, state in enumerate(states))
        x = self._all.x.astype(float)
        rest = np.sqrt(((x[:, i] - x[:, j]) ** 2).sum(axis=0))
        if law.rest_length is not None:
            rest = np.full(len(pairs), law.rest_length)
        elif law.break_strain is not None and not rest.all():
            a, b = pairs[int(np.argmin(rest))]
            raise UsageError(
                f"{bonds.name}: particles {a} and {b} are at the same place; a strain needs a length to compare with",
                "give a rest_length, or break_force instead of break_strain",
            )
        k, c = law.constants(self._reduced_mass(i, j))
        dtype = self._all.dtype
        if law.by_mass or law.breaks:
            k, c = k.astype(dtype), c.astype(dtype)
        else:
            k, c = dtype.type(law.stiffness), dtype.type(law.damping)
        breaking = None
        if law.breaks:
            strain, pull = (
                dtype.type(np.inf if x is None else x) for x in (law.break_strain, law.break_force)
            )
            breaking = Breaking(strain, pull, np.zeros(len(pairs), np.bool_))
        record = StringRecord() if law.tension_only else SpringRecord()
        return Bonds(record, i, j, k, c, rest.astype(dtype), breaking)

    def _reduced_mass(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.float64]:
        """m₁ m₂/(m₁ + m₂) of both ends [kg]; a pinned end is infinitely heavy, and of two pinned ends nothing moves."""
        inverse = 1 / self._all.mass[: self._all.count].astype(float)
        if self._all.clocked:
            inverse[np.isinf(self._all.start[: self._all.count])] = 0
        total = inverse[i] + inverse[j]
        return np.divide(1, total, out=np.zeros_like(total), where=total > 0)

    def columns(self) -> list[Columns]:
        """Columns of every group of the island."""
        whole = self.island_columns()
        return [_stretch(whole, a, b) for a, b in pairwise(self._bounds)]

    def island_columns(self) -> Columns:
        """Columns of the whole island."""
        return self._all.columns(radius=self._radius, thermal=self._thermal)

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        """Total force on every particle at a time [N], shape [3, n]."""
        total = np.zeros_like(self._work.force)
        island_forces(self.parts, self.bonds, self.island_columns(), total, time)
        return total

    def phase(self, first: int, last: int) -> int:
        """How far steps may go from `first` towards `last` in one piece."""
        return last

    def advance(self, first: int, last: int, team: Team) -> tuple[None, None, Fault | None]:
        """Steps first … last − 1."""
        done = step_island(
            self._staged,
            self.parts,
            self.bonds,
            self.island_columns(),
            self._work,
            first,
            last - first,
            self.dt,
        )
        if done == last - first:
            return None, None, None
        return None, None, self._find(first + done)

    def _find(self, step: int) -> Fault:
        """Which particle: step once more on a copy, and look."""
        columns = self.island_columns()
        copy = copied(columns)
        step_island(self._staged, self.parts, self.bonds, copy, self._work, step, 1, self.dt)
        wild = ~np.isfinite(self._work.force).all(axis=0)
        row = int(wild.argmax() if wild.any() else np.abs(self._work.force).sum(axis=0).argmax())
        member = int(np.searchsorted(self._bounds, row, side="right")) - 1
        return Fault(member, row - self._bounds[member], step)


def group_uses_radius(forces: Sequence[Force], planes: Sequence[Plane], group: Group) -> bool:
    """Whether a kernel must read the radii of a group: a law does, or planes hold back particles that have a size."""
    from_file = isinstance(group, Particles) and isinstance(group.layout, File)
    return any(force.needs_radius() for force in forces) or (
        bool(planes) and (group.has_radius() or from_file)
    )


def _stretch(c: Columns, a: int, b: int) -> Columns:
    """Rows [a, b) of columns."""
    clock = None if c.clock is None else Clock(*(column[a:b] for column in c.clock))
    heat = c.thermal
    if heat is not None:
        heat = Thermal(heat.start[a:b], heat.birth[a:b], heat.rate, heat.ambient)
    return c._replace(
        **{name: getattr(c, name)[a:b] for name in ("x", "y", "z", "vx", "vy", "vz", "m")},
        r=None if c.r is None else c.r[a:b],
        thermal=heat,
        clock=clock,
        memory=tuple(column[a:b] for column in c.memory),
    )


def copied(c: Columns) -> Columns:
    """Columns with position, velocity and memory copied."""
    return c._replace(
        **{name: getattr(c, name).copy() for name in ("x", "y", "z", "vx", "vy", "vz")},
        memory=tuple(column.copy() for column in c.memory),
    )
