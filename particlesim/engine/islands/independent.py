"""Islands of independent particles as the engine runs them, with their births and deaths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from threading import get_ident
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.faults import Fault, Stop, Unsolved
from particlesim.engine.independent.adaptive import new_log, step_range_adaptive
from particlesim.engine.independent.kernel import Room, new_room, step_range
from particlesim.engine.islands.base import OWN_STEPS, WORTH_THREADS, BaseIsland, Look, shortest_step
from particlesim.engine.islands.births import Births
from particlesim.engine.islands.laps import Laps
from particlesim.engine.ledger.particle_work import Legs, Opened, ParticleBooks, spans
from particlesim.engine.ledger.sums import sum_forces
from particlesim.engine.ledger.work import unjolted
from particlesim.engine.state.columns import Columns, block_of, changing, copied
from particlesim.engine.state.group_state import Deaths, GroupState
from particlesim.engine.step.clearance import RESTED, lasts
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.newton import unsolved
from particlesim.engine.step.particle_step import Newtonian
from particlesim.engine.step.program import BLOCK, Program
from particlesim.engine.step.records import group_program
from particlesim.forces.base import Force
from particlesim.graph.graph import Island
from particlesim.groups.group import Particles
from particlesim.integrators import EmbeddedRungeKutta, ImplicitMethod
from particlesim.process.threads import Team
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

OWN_COST = 50
"""How many times longer a particle's own step takes than one that it shares with its block: several evaluations, an error
with its roots and powers, a decision."""

BOOKED_TOGETHER = 4096
"""Particles whose own steps are in memory at the same time, to book them."""


def is_steady_force(force: Force) -> bool:
    """Whether a force stays the same as long as a particle stays as it is. Of those that others have written that is not
    known."""
    parts = (force, *getattr(force, "flow", ()))
    known = all(type(part).__module__.startswith("particlesim.") for part in parts)
    return known and not force.changes() and "temperature" not in force.needs()


class IndependentIsland(BaseIsland):
    """One group of particles that do not act on each other, with its emitter if it has one."""

    def __init__(
        self,
        scenario: Scenario,
        structure: Island,
        states: Sequence[GroupState],
        ids: Mapping[str, tuple[int, int]],
        block: int = BLOCK,
    ) -> None:
        super().__init__(scenario, structure, states, ids)
        (self.group,), (forces,), (colliders,) = structure.groups, structure.forces, structure.colliders
        self.program: Program = group_program(structure, forces, colliders, self.group, self.state.dtype)
        self._block = block
        self._steady = isinstance(self.program.dynamics, Newtonian) and all(map(is_steady_force, forces))
        self._adaptive = structure.method.adaptive
        self._fixed = isinstance(self.group, Particles) and self.group.pinned is True
        self._booking = None if self.books is None else ParticleBooks(self.books, self.program.forces)
        self._room = BOOKED_TOGETHER
        self._rooms: dict[int, Room] = {}  # of every thread
        self._rested: NDArray[np.float64] | None = None

    @property
    def state(self) -> GroupState:
        """The only group."""
        return self.states[0]

    def columns(self) -> list[Columns]:
        """Columns of every group of the island."""
        return [self.state.columns(self._read)]

    def island_columns(self) -> Columns:
        """Columns of the only group."""
        return self.columns()[0]

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        """Total force on every particle at a time [N], shape [3, n]."""
        out = np.zeros((3, self.state.count))
        if self.state.count:
            sum_forces(self.program.forces, self.columns()[0], time, 0, self.state.count, out)
        return out

    def topology(self) -> list[Topology]:
        """What a trajectory keeps of its interactions: nothing."""
        return []

    def advance(
        self, first: int, last: int, team: Team, laps: Laps | None = None, look: Look | None = None
    ) -> tuple[Births | None, Deaths | None, Fault | None]:
        self.state.reserve(self.state.count + sum(self._due(last)))
        born = self._emit(first, last)
        opened = self._open(born, first)
        self.state.drive(last * self.dt)  # nobody else sees where they are in between
        if self._fixed:  # a backdrop: nothing to step, and no kernel to compile for it
            self._close(opened, last)
            return None, None, None
        faults = self._no_faults(self.state.count)
        if self.state.count:
            self._move(opened, first, last, team, faults)
        if faults.any():
            return born, None, self._find(np.flatnonzero(faults), first, last)
        self._carry(last * self.dt)
        self._close(opened, last)
        self._gather()
        deaths = self.state.bury(last * self.dt) if self.state.clocked else None
        return born, deaths, None

    def _move(self, opened: Opened | None, first: int, last: int, team: Team, faults: NDArray[Any]) -> None:
        """Steps first … last − 1 of all particles."""
        columns, number = self.columns()[0], self.state.count
        if lasts(self.program.contacts, columns.memory) and (
            self._rested is None or self._rested.shape[1] < number
        ):
            self._rested = np.zeros((RESTED, self.state.x.shape[1]))
        if opened is not None and self._adaptive:
            for a in range(0, number, BOOKED_TOGETHER):
                self._move_booked(opened, columns, first, slice(a, min(a + BOOKED_TOGETHER, number)), faults)
            return

        def work(a: int, b: int) -> None:
            self._step(columns, first, last - first, a, b, self._block, faults)

        ahead = number * (last - first) * (OWN_STEPS * OWN_COST if self._adaptive else 1)
        team.over_range(number, self._block, work, worth=ahead >= WORTH_THREADS)

    def _move_booked(
        self, opened: Opened, columns: Columns, step: int, part: slice, faults: NDArray[Any]
    ) -> None:
        """A step of an adaptive method for some particles, and the work in their own steps."""
        while True:  # with a log that turns out too small once more, with a larger one
            log = new_log(self._room)
            range_ = (part.start, part.stop, self._block, True, faults, np.zeros(1), log)
            step_range_adaptive(self.program, columns, step, 1, self.dt, *range_)
            taken = int(log.number[0])
            if taken <= self._room:
                break
            self._room = taken + taken // 4
            for mine, kept in zip(changing(columns), changing(opened.columns), strict=True):
                mine[part] = kept[part]
        if self._booking is None or faults.any() or not taken:
            return
        assert isinstance(self._method, EmbeddedRungeKutta)
        begin, h = log.spans[1, :taken], log.spans[2, :taken]
        rows = log.spans[0, :taken].astype(np.intp)
        order = np.lexsort((begin, rows))  # whatever the blocks
        states = (log.states[6 * k : 6 * k + 6, order] for k in range(3))
        self._booking.book_legs(Legs(rows[order], begin[order], h[order], *states), columns, self._method)

    def _open(self, born: Births | None, step: int) -> Opened | None:
        """The state at the beginning of a step whose work is booked; None where work is not."""
        if self._booking is None or not self.state.count:
            return None
        columns, n = self.columns()[0], self.state.count
        if born is not None:
            self._booking.born(columns, born.ids.size, born.times)
        begin, h = spans(columns.clock, n, step * self.dt, (step + 1) * self.dt)
        kept, free = snapshot(columns, slice(0, n)), None
        touches = self.books is not None and "contact" in self.books.names
        if touches and not self._fixed and not self._adaptive:
            free = snapshot(columns, slice(0, n))
            program = self.program._replace(contacts=Simple(()))
            room = new_room(free, self._block)
            step_range(program, free, step, 1, self.dt, 0, n, self._block, np.zeros(n, np.bool_), room)
        jolts = () if self.books is None or self._adaptive else self.books.jolts
        return Opened(unjolted(kept, jolts), begin, h, free)

    def _carry(self, end: float) -> None:
        """Colliders that move take along what has stuck to them; of steps that particles make for themselves that is not
        booked with the step."""
        apart = self._adaptive and self.books is not None and "contact" in self.books.names
        if not self.state.holders or not self.state.count:
            return
        before = self._energy(end) if apart else 0.0
        self.state.carry(end)
        if apart and self.books is not None:
            self.books.add("contact", self._energy(end) - before)

    def _energy(self, time: float) -> float:
        """The kinetic and potential energy of all particles [J], where it is booked."""
        assert self.books is not None
        columns = self.columns()[0]
        return float(self.books.energies(0, columns, np.full(len(columns.m), time)).sum())

    def _close(self, opened: Opened | None, last: int) -> None:
        """Book the step that has been taken."""
        if self._booking is not None and opened is not None:
            if not self._adaptive:
                self._booking.book_step(opened, self.columns()[0])
            self._booking.close(opened, self.columns()[0], self.state.driven, last * self.dt)

    def _no_faults(self, number: int) -> NDArray[Any]:
        """For every particle whether its steps failed, as the kernel takes it; adaptive ones say why."""
        return np.zeros(number, np.int8 if self._adaptive else np.bool_)

    def _step(
        self, columns: Columns, first: int, steps: int, a: int, b: int, block: int, faults: NDArray[Any]
    ) -> None:
        """Steps from `first` on for particles [a, b)."""
        if self._adaptive:
            last = (a, b, block, True, faults, np.zeros(1), new_log())
            step_range_adaptive(self.program, columns, first, steps, self.dt, *last)
        else:
            room = new_room(columns, block) if block != self._block else self._own_room(columns)
            rested = self._rested if block == self._block else None
            range_ = (a, b, block, faults, room, rested, self._steady)
            step_range(self.program, columns, first, steps, self.dt, *range_)

    def _own_room(self, columns: Columns) -> Room:
        """Room for a block, of this thread."""
        thread = get_ident()
        if thread not in self._rooms:
            self._rooms[thread] = new_room(columns, self._block)
        return self._rooms[thread]

    def keep(self, first: int, *, fresh: bool = True) -> None:
        """Nothing: where something goes wrong, single blocks are looked at."""

    def replay(self, row: int, first: int, steps: int) -> tuple[Columns, tuple[()], slice]:
        """The block of particle `row` some steps after `first`, where the interval began; no interactions, and which rows.

        The block must be back at `first`. Nothing of the island changes.
        """
        low = row - row % self._block
        part = slice(low, min(low + self._block, self.state.count))
        return self._stepped(part, first, steps)[0], (), part

    def _stepped(self, part: slice, first: int, steps: int) -> tuple[Columns, NDArray[Any]]:
        """A copy of some particles after some steps, each for itself, and which of them broke down (and stayed)."""
        columns = snapshot(self.columns()[0], part)
        number = part.stop - part.start
        faults = self._no_faults(number)
        self._step(columns, first, steps, 0, number, 1, faults)
        return columns, faults

    def _find(self, blocks: NDArray[np.intp], first: int, last: int) -> Fault:
        """The first step and particle at which a number stopped being finite; blocks are back at step `first`."""
        row, end = int(blocks[0]), last
        for block in blocks[:64]:
            part = slice(int(block), min(int(block) + self._block, self.state.count))
            low, high = first, end
            faults = self._stepped(part, first, high - first)[1]
            if not faults.any():
                continue
            while high - low > 1:  # all is fine after the steps up to `low`, not after those up to `high`
                middle = (low + high) // 2
                there = self._stepped(part, first, middle - first)[1]
                low, high, faults = (low, middle, there) if there.any() else (middle, high, faults)
            row, end = part.start + int((faults != 0).argmax()), high
        step = end - 1
        if self._adaptive:
            return Fault(0, row, step, stop=self._stop(row, first, step))
        return Fault(0, row, step, unsolved=self._unsolved(row, first, step))

    def _unsolved(self, row: int, first: int, step: int) -> Unsolved | None:
        """The residual of an implicit step whose equations were not solved."""
        if not isinstance(self._method, ImplicitMethod):
            return None
        columns, _, part = self.replay(row, first, step - first)
        time, end = step * self.dt, (step + 1) * self.dt
        left, iterations = unsolved(self.program, columns, row - part.start, time, end, self.dt)
        return Unsolved(self._method.label, left, iterations) if iterations and np.isfinite(left) else None

    def _stop(self, row: int, first: int, step: int) -> Stop:
        """Why, when and where a particle's own steps could not go on: that step once more."""
        columns, _, part = self.replay(row, first, step - first)
        number, i = part.stop - part.start, row - part.start
        fault, moment = np.zeros(number, np.int8), np.zeros(1)
        alone = (i, i + 1, 1, False, fault, moment, new_log())
        step_range_adaptive(self.program, columns, step, 1, self.dt, *alone)
        p = self.state.particle(row, moment[0])
        place = {name: float(getattr(columns, name)[i]) for name in ("x", "y", "z", "vx", "vy", "vz")}
        least = shortest_step(self._method, (step + 1) * self.dt)
        return Stop(int(fault[i]), float(moment[0]), p._replace(**place), least)


def snapshot(c: Columns, part: slice) -> Columns:
    """Some rows of columns; what steps change is copied."""
    return copied(block_of(c, part.start, part.stop))
