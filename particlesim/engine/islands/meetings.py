"""Particles that touch rigid bodies, or that springs and rods join to them. They belong to islands of their own, and are
guests among the bodies for a step (`engine.rigid.grains`, `engine.rigid.ties`)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.faults import Fault
from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.rigid.touching import contacts_of, no_contact
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import SPIN
from particlesim.graph.graph import methods_of
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from particlesim.engine.islands.rigid import RigidIsland
    from particlesim.engine.rigid.tied_rebounds import Flight

# What steps bodies is imported where there are some.

ENOUGH, EACH = 20_000, 20
"""Particles that touch each other below bodies, from which on no others are sought for to be among these for a step; and how
many for each of those that touch a body, where that is more."""


class Meetings:
    """All contacts of particles with bodies in a scenario, and springs and rods from ones to the others."""

    def __init__(
        self, scenario: Scenario, islands: Sequence[BaseIsland], states: Sequence[GroupState]
    ) -> None:
        self._dt = scenario.grid.dt
        self._lag = {name: method.lag for name, method in methods_of(scenario).items()}
        self._bodies = _bodies_among(islands) if scenario.bodies else None
        self._islands = {
            state.name: island for island in islands for state in island.states if island is not self._bodies
        }
        names = [state.name for state in self._bodies.states] if self._bodies is not None else []
        self._surfaces = contacts_of(scenario, names)
        self._states = [next(state for state in states if state.name == name) for name in self._surfaces]
        ties = None if self._bodies is None else self._bodies.ties
        self._tied, self._held = ({}, {}) if ties is None else (ties.rows, ties.held)
        held = [(name, self._held.get(name, np.empty(0, np.int64))) for name in self._tied]
        hang = {name: np.setdiff1d(self._tied[name], rows) for name, rows in held}
        self._hang = {name: rows for name, rows in hang.items() if len(rows)}
        for name in self._tied:
            if name not in self._surfaces:
                self._surfaces[name] = no_contact(len(names))
                self._states.append(next(state for state in states if state.name == name))
        if self._bodies is not None and self._states:
            self._add_what_is_below(scenario, states, len(names))
        self._chosen: list[tuple[GroupState, Ints]] = []
        self._worked: list[float] = []
        self._there: list[tuple[GroupState, Ints]] = []
        self._slow = np.empty(0, np.bool_)
        self._flights: list[Flight] = []
        if self._held and ties is not None:
            ties.expect(self._dt * self._pulls_on_rods(0.0))

    def __bool__(self) -> bool:
        return bool(self._states)

    def _add_what_is_below(self, scenario: Scenario, states: Sequence[GroupState], bodies: int) -> None:
        """Groups whose particles touch those that touch bodies, too, and so on; and what all of them lie on."""
        from particlesim.engine.islands.rigid_scene import support_of

        assert self._bodies is not None
        kinds = [state.name for state in states if state.name in self._islands]
        touch, reached = support_of(scenario, kinds).pairs.touch > 0, np.isin(kinds, list(self._surfaces))
        for _ in kinds:
            reached |= touch[reached].any(axis=0)
        for name in np.array(kinds)[reached].tolist():
            if name not in self._surfaces:
                self._surfaces[name] = no_contact(bodies)
                self._states.append(next(state for state in states if state.name == name))
        self._bodies.support = support_of(scenario, (*self._held, *self._surfaces))

    def concern(self, island: BaseIsland) -> bool:
        """Whether an island is that of the bodies which particles touch or are tied to."""
        return bool(self._states) and island is self._bodies

    def invite(self) -> None:
        """Before bodies make a step: particles that may touch them in it, or are tied to them, are their guests."""
        from particlesim.engine.rigid.cells import new_body_cells
        from particlesim.engine.rigid.grains import near_bodies
        from particlesim.engine.rigid.visit import among

        assert self._bodies is not None
        bodies, ties = self._bodies.bodies(), self._bodies.ties
        self._chosen = ties.on_rods()
        held = [np.zeros(len(rows), np.int64) for _, rows in self._chosen]
        (swift, found), count = ([*held], []), bodies.w.size
        cells, around = new_body_cells(count), np.zeros(count, np.int64)
        for state in self._states:
            n = state.count
            x, v = (np.ascontiguousarray(each[:, :n], float) for each in (state.x, state.v))
            radius, near = state.radius[:n].astype(float), np.zeros(n, np.int64)
            touch = self._surfaces[state.name].touch
            if touch.any():
                slop, dt = self._bodies.slop, self._dt
                near_bodies(bodies, touch, x, v, radius, slop, dt, cells, around, near)
            tied = self._tied.get(state.name, np.empty(0, np.int64))
            near[tied] = np.maximum(near[tied], 1)
            near[self._held.get(state.name, [])] = 0
            found.append(near)
        below = self._below(found)
        for state, near, lies in zip(self._states, found, below, strict=True):
            rows = np.flatnonzero((near > 0) | (lies > 0))
            alone = self._islands[state.name].meets_bodies(state.name)
            swift.append(np.where(near[rows] == 3, alone, 0))
            self._chosen.append((state, rows))
        names = (*self._held, *self._surfaces)
        surfaces = np.array([np.array(self._surfaces[name]) for name in names]).transpose(1, 0, 2)
        number = sum(len(rows) for rows in self._held.values())
        on_ties = [np.isin(rows, self._tied.get(state.name, [])) for state, rows in self._chosen]
        hang = np.concatenate(on_ties).astype(np.int64)
        stands = [lies[rows] for (_, rows), lies in zip(self._chosen[len(held) :], below, strict=True)]
        ids = np.concatenate([state.id[rows] for state, rows in self._chosen])
        gain, besides = ties.gain(self._chosen), self._bodies.loads.awaited(ids)
        load = np.where(hang > 0, np.concatenate([gain, np.zeros_like(gain)]), besides)
        lag = [np.full(len(rows), self._lag[state.name]) for state, rows in self._chosen]
        load = np.concatenate([load, [np.concatenate(lag)]])
        self._bodies.guests = tuple(state.name for state, _ in self._chosen)
        flags = (hang, np.concatenate(swift), np.concatenate([*(each + 1 for each in held), *stands]))
        self._bodies.visitors = among(self._chosen, np.ascontiguousarray(surfaces), load, number, *flags)
        self._bodies.pull_on = self._accelerations

    def _below(self, found: Sequence[Ints]) -> list[Ints]:
        """Which particles touch a body, or others that do, from how near they are to bodies: of every group, 1 of those
        that do [n]."""
        from particlesim.engine.rigid.support import gather, new_cells

        assert self._bodies is not None
        below = np.concatenate([np.empty(0, np.int64), *found]) == 2
        if not below.any():
            return [np.zeros_like(each) for each in found]
        states, first = self._states, len(self._held)
        x = np.concatenate([state.x[:, : state.count].astype(float) for state in states], axis=1)
        radius = np.concatenate([state.radius[: state.count].astype(float) for state in states])
        kind = np.concatenate([np.full(state.count, first + k) for k, state in enumerate(states)])
        may = np.concatenate([self._may(state) for state in states])
        touch, enough = self._bodies.support.pairs.touch, max(ENOUGH, EACH * int(below.sum()))
        lies = below.astype(np.int64)
        gather(new_cells(radius), touch, x, radius, kind, may, lies, np.empty_like(kind), enough)
        return np.split(lies, np.cumsum([len(each) for each in found])[:-1])

    def _may(self, state: GroupState) -> Ints:
        """Which particles of a group may lie below bodies: 1, 2 where nothing moves them, 0 of those that rods hold at
        bodies, and that are there anyway."""
        may = np.ones(state.count, np.int64)
        if state.clocked:
            may[~np.isfinite(state.start[: state.count])] = 2
        may[self._held.get(state.name, [])] = 0
        return may

    def _accelerations(self, time: float, probe: Floats | None) -> tuple[Floats, Floats]:
        """How much what else acts on visitors accelerates them at a time [m/s²] if all are shifted, and how far they were
        [3, visitors], which is rounded as places are."""
        if probe is None:
            return self._pulls(time), np.zeros((3, sum(len(rows) for _, rows in self._chosen)))
        kept, first = [], 0
        for state, rows in self._chosen:
            kept.append(state.x[:, rows].copy())
            state.x[:, rows] += probe[:, first : first + len(rows)].astype(state.dtype)
            first += len(rows)
        pull = self._pulls(time)
        moved = [
            (state.x[:, rows] - was).astype(float)
            for (state, rows), was in zip(self._chosen, kept, strict=True)
        ]
        for (state, rows), was in zip(self._chosen, kept, strict=True):
            state.x[:, rows] = was
        return pull, np.concatenate(moved, axis=1)

    def _pulls(self, time: float) -> Floats:
        """How much what else acts on visitors accelerates them at a time [m/s²], shape [3, visitors]; 0 of those that
        springs or rods join to bodies: what acts on those takes part in the step of bodies, as it did in the last one."""
        parts = [np.zeros((3, len(rows))) for _, rows in self._chosen]
        for part, (state, rows) in zip(parts, self._chosen, strict=True):
            free = np.isin(rows, self._tied.get(state.name, []), invert=True)
            if free.any():
                mine, first = rows[free], self._first_row(state)
                part[:, free] = self._islands[state.name].forces(time)[:, first + mine] / state.mass[mine]
        return np.concatenate(parts, axis=1)

    def dismiss(self) -> None:
        """After it: particles get their new velocities, and methods that remember the old ones start anew."""
        from particlesim.engine.rigid.hearing import tell_particles
        from particlesim.engine.rigid.tied_rebounds import flights_of

        assert self._bodies is not None
        after, visitors = self._bodies.left, self._bodies.visitors
        assert visitors is not None
        self._bodies.visitors = self._bodies.pull_on = None
        self._forget_jolts()
        if self._bodies.told is not None:
            tell_particles(self._bodies.told, self._chosen)
        first = 0
        for state, rows in self._chosen:
            part = slice(first, first + len(rows))
            first += len(rows)
            changed = after.moved[part]
            self._islands[state.name].leave(state.name, rows, rows[after.alone[part]])
            rows = rows[changed]
            if state.name in self._tied:
                self._note(state, rows, after.shift[:, part][:, changed], after.v[:, part][:, changed])
            had = state.v[:, rows].copy()
            state.x[:, rows] += after.shift[:, part][:, changed].astype(state.dtype)
            state.v[:, rows] = after.v[:, part][:, changed]
            if SPIN in state.parts:
                state.angular_velocity[:, rows] = after.turning[:, part][:, changed]
            state.let_know(rows, state.v[:, rows] - had)
            if len(rows):
                self._islands[state.name].fit()
        self._bodies.ties.leave(after.v - visitors.v, visitors.gain, after)
        self._flights = []
        if self._hang:
            held, touch = len(self._held), self._bodies.support.pairs.touch
            gains = (after.v - visitors.v, visitors.gain, after.pressed)
            self._flights = flights_of(self._chosen, self._hang, held, touch, *gains)
        loose = [
            (state, rows[np.isin(rows, self._tied.get(state.name, []), invert=True)])
            for state, rows in self._chosen
        ]
        self._there = [(state, state.id[rows]) for state, rows in self._chosen]
        self._slow = visitors.swift == 0
        lags = [self._lag[state.name] for state, _ in loose]
        self._bodies.loads.leave(loose, lags, after.forces[:, visitors.tied == 0])
        self._worked = self._contact_work()

    def hold_ends(self, step: int) -> Fault | None:
        """After all islands have made a step: rods from bodies to particles fit again."""
        if self._bodies is None or not self._states:
            return None
        self._bodies.take_blows()
        self._put_right((step + 1) * self._dt)
        self._bodies.loads.arrive(self._dt)
        self._hold()
        if not self._bodies.ties:
            return None
        pulls, touched = self._pulls_on_rods, self._contact_work() != self._worked
        return self._bodies.hold_ends(step, lambda: pulls((step + 1) * self._dt), touched=touched)

    def _pulls_on_rods(self, time: float) -> Floats:
        """How much forces accelerate particles on rods to bodies [m/s²], shape [3, held]."""
        assert self._bodies is not None
        return np.concatenate(
            [
                self._islands[state.name].forces(time)[:, self._first_row(state) + rows] / state.mass[rows]
                for state, rows in self._bodies.ties.on_rods()
            ],
            axis=1,
        ).astype(float)

    def _put_right(self, time: float) -> None:
        """Particles on springs that have hit something in their own step, until this time, get the velocities that they
        should have."""
        from particlesim.engine.rigid.tied_rebounds import put_right

        bodies = self._bodies
        assert bodies is not None
        work = put_right(self._flights, bodies.support, lambda: bodies.forces_on_tied(time), time, self._dt)
        for name, joule in work.items():
            island = self._islands[name]
            island.fit()
            if island.books is not None and "contact" in island.books.names:
                island.books.add("contact", joule)
        self._flights = []

    def _hold(self) -> None:
        """Particles that lie on bodies get the velocities that contact has aimed at, as far as what they did since then
        came otherwise than expected."""
        assert self._bodies is not None
        rows = [_moving(state, ids) for state, ids in self._there]
        number = sum(len(each) for each in rows)
        x, v, turning = np.zeros((3, 3, number))
        first = 0
        for (state, _), mine in zip(self._there, rows, strict=True):
            there = np.flatnonzero(mine >= 0)
            at, now = first + there, mine[there]
            x[:, at], v[:, at] = state.x[:, now], state.v[:, now]
            if SPIN in state.parts:
                turning[:, at] = state.angular_velocity[:, now]
            first += len(mine)
        here = np.concatenate([np.empty(0, np.int64), *rows]) >= 0
        here &= self._slow  # others may have left since
        own = [self._islands[state.name].keeps_out_of_bodies() for state, _ in self._there]
        loose = here & ~np.repeat(own, [len(each) for each in rows])
        if loose.any() and self._bodies.put_out(x, loose.astype(np.int64)):
            self._place(rows, x, loose)
        found = self._bodies.hold_guests(x, v, turning, here.astype(np.int64)) if number else None
        if found is None:
            return
        first = 0
        for (state, _), mine in zip(self._there, rows, strict=True):
            part = slice(first, first + len(mine))
            first += len(mine)
            changed = here[part] & (found[0][:, part] != v[:, part]).any(axis=0)
            had = state.v[:, mine[changed]].copy()
            state.v[:, mine[changed]] = found[0][:, part][:, changed]
            if SPIN in state.parts:
                state.angular_velocity[:, mine[changed]] = found[1][:, part][:, changed]
            state.let_know(mine[changed], state.v[:, mine[changed]] - had)

    def _place(self, rows: Sequence[Ints], x: Floats, here: NDArray[np.bool_]) -> None:
        """Particles that were guests, in these rows of their groups, are at x [3, n] if they are `here` [n]."""
        first = 0
        for (state, _), mine in zip(self._there, rows, strict=True):
            part = slice(first, first + len(mine))
            first += len(mine)
            moved = here[part] & (x[:, part] != state.x[:, mine]).any(axis=0)
            state.x[:, mine[moved]] = x[:, part][:, moved]

    def _note(self, state: GroupState, rows: Ints, shift: Floats, v: Floats) -> None:
        """Note for the account of work what springs and rods do to particles before these make their own step."""
        books = self._islands[state.name].books
        if books is not None:
            change = np.concatenate([shift, v - state.v[:, rows]])
            books.jolts.append((self._first_row(state) + rows, change))

    def _first_row(self, state: GroupState) -> int:
        """The row of the first particle of a group in its island."""
        before = takewhile(lambda each: each is not state, self._islands[state.name].states)
        return sum(each.count for each in before)

    def _forget_jolts(self) -> None:
        for name in self._tied:
            books = self._islands[name].books
            if books is not None:
                books.jolts.clear()

    def _contact_work(self) -> list[float]:
        """The work that contact has done on groups of particles which rods hold [J], where that is booked."""
        books = (self._islands[name].books for name in self._held)
        return [each.work_of("contact") for each in books if each is not None]


def _moving(state: GroupState, ids: Ints) -> Ints:
    """Where particles are in their group now, −1 for those that have died, or are held since."""
    from particlesim.engine.rigid.loads import rows_of

    rows = rows_of(state, ids)
    if state.clocked and state.count:
        rows = np.where(np.isfinite(state.start[rows]), rows, -1)
    return rows


def _bodies_among(islands: Sequence[BaseIsland]) -> RigidIsland:
    from particlesim.engine.islands.rigid import RigidIsland

    return next(each for each in islands if isinstance(each, RigidIsland))
