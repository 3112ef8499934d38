"""Islands of groups whose particles act on each other, as the engine runs them: by stages, on one thread or several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.constraints.rod_system import rod_system
from particlesim.engine.coupled.adaptive import BEGAN, ENDED, Pace, new_pace
from particlesim.engine.coupled.forces import island_forces
from particlesim.engine.coupled.gauss_radau import new_room
from particlesim.engine.coupled.workspace import Part, Share, Work, scratch
from particlesim.engine.faults import Fault, Stop, Unsolved
from particlesim.engine.implicit.kernel import StagedImplicit
from particlesim.engine.implicit.krylov import INDEFINITE, UNSOLVED, General
from particlesim.engine.implicit.linear_system import new_system
from particlesim.engine.interactions.interaction import Site
from particlesim.engine.interactions.registry import laid_again, laid_out
from particlesim.engine.islands import assembly
from particlesim.engine.islands.assembly import Interactions, apart
from particlesim.engine.islands.base import OWN_STEPS, WORTH_THREADS, BaseIsland, shortest_step
from particlesim.engine.islands.births import Births
from particlesim.engine.islands.joined import Joined
from particlesim.engine.ledger.particle_work import IslandBooks, Opened, spans, stages
from particlesim.engine.ledger.work import moved
from particlesim.engine.state.columns import Columns, changing, copied, replaced
from particlesim.engine.state.group_state import Deaths, GroupState
from particlesim.engine.step.impacts import Simple
from particlesim.graph.graph import Island
from particlesim.integrators import EmbeddedRungeKutta, GaussRadauMethod, ImplicitMethod
from particlesim.model.arrays import Ints
from particlesim.process.threads import Team
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

WORTH_SPRINGS = 5_000
"""Springs below which threads would spend their time waiting for each other."""

SOLVED_STEP = 50
"""How many times longer a step takes whose equations are solved."""

ROD_IN_SPRINGS = 20
"""About how many springs take the time of a rod."""


class CoupledIsland(BaseIsland):
    """Groups whose particles act on each other; their states are stretches of the island's arrays.

    What kernels take is laid out for the particles that there are, and again whenever there are others.
    """

    def __init__(
        self,
        scenario: Scenario,
        structure: Island,
        states: Sequence[GroupState],
        ids: Mapping[str, tuple[int, int]],
    ) -> None:
        super().__init__(scenario, structure, states, ids)
        self._scenario, self._structure = scenario, structure
        self._joined = Joined(self.states)
        dtype = self._joined.whole.dtype
        self._staged, self._step = assembly.stepper(structure, self.states, dtype)
        self._site = Site(scenario, self._joined.whole, self.states)
        self.rods = rod_system(scenario, structure, self._joined.whole, self.states, self._site.offset)
        self._sets, self.interactions = laid_out(self._site, structure.interactions)
        self.names = tuple(each.name for each in self._sets)
        self._changes = structure.changes
        self._disturbed = (
            self._changes or any(structure.colliders) or any(each.changing() for each in self.interactions)
        )
        self._kept: list[NDArray[Any]] = []
        self.kept_from = 0
        self._assemble()

    def _assemble(self) -> None:
        """Put together what kernels take for the particles and interactions that there are."""
        whole = self._joined.whole
        self._bounds, self._driven = self._joined.bounds, self._joined.driven
        self.parts = assembly.parts_of(self._structure, self._bounds, whole.dtype)
        self._pinned = self._site.pinned()
        self.springs = sum(each.effort for each in self.interactions)
        if self.rods is not None and self.rods.components > 1:
            self.springs += ROD_IN_SPRINGS * self.rods.number
        looks_back = (
            self.rods is not None
            or any(part.contacts != Simple(()) for part in self.parts)
            or any(each.looks_back for each in self.interactions)
        )
        self._work = scratch(self._method, whole.count, whole.dtype, looks_back=looks_back)
        if isinstance(self._method, GaussRadauMethod):
            self._work = self._work._replace(radau=new_room(whole.memory[:, : whole.count]))
        self._new_system()
        self._booking = (
            None
            if self.books is None
            else IslandBooks(
                self.books, self._structure, self._bounds, self._driven, self.names, self._forces_in
            )
        )
        self._cooling = assembly.cooling_of(self._structure.groups, self._bounds)

    def _new_system(self) -> None:
        """Equations of implicit steps."""
        self._shares: dict[int, list[tuple[tuple[Any, ...], Work, Share]]] = {}
        if isinstance(self._method, ImplicitMethod):
            bonds, _ = apart(self.interactions)
            x = self._joined.whole.x[:, : self._joined.whole.count]
            self._work = self._work._replace(system=new_system(bonds, x, self._joined.whole.dtype))

    def _lay_again(self, place: NDArray[np.int64]) -> None:
        """Lay out all after births and deaths: what was in row k is in row `place[k]` now, and gone if that is −1."""
        self._site = Site(self._scenario, self._joined.whole, self.states, began=False)
        self.interactions = laid_again(self._site, self._sets, self.interactions, place)
        if self.rods is not None:
            self.rods.lay_again(self._site.offset, place)
        self._kept = []
        self._assemble()

    def resettle(self, ids: Ints) -> None:
        if not self._changes:
            return
        self._joined.close_ranks()
        self._lay_again(self._joined.rows_of(ids))

    def _for(self, threads: int) -> list[tuple[tuple[Any, ...], Work, Share]]:
        """What each of some threads works on: its pieces of bonds, scratch, and particles with the other interactions."""
        if threads not in self._shares:
            rods = None if self.rods is None else self.rods.rods
            interactions = tuple(each.in_team(threads) for each in self.interactions)
            found = assembly.shared(self._joined.whole.count, threads, self._driven, interactions, rods)
            self._shares[threads] = [
                (mine, assembly.own_scratch(self._work, share, self._joined.whole.dtype), share)
                for mine, share in found
            ]
        return self._shares[threads]

    def topology(self) -> list[Topology]:
        """What a trajectory keeps of all interactions, in the order of the kernel, and then of the rods."""
        ids = self._joined.whole.id
        found = [each.topology(name, ids) for name, each in zip(self.names, self.interactions, strict=True)]
        rods = [] if self.rods is None else self.rods.topology(ids)
        return [each for each in (*found, *rods) if each is not None]

    def columns(self) -> list[Columns]:
        """Columns of every group of the island."""
        return self._joined.cut(self.island_columns())

    def island_columns(self) -> Columns:
        """Columns of the whole island."""
        found = self._joined.whole.columns(self._read)
        if found.thermal is None or self._cooling is None:
            return found
        rate, ambient = self._cooling
        return found._replace(thermal=found.thermal._replace(rate=rate, ambient=ambient))

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        """Total force on every particle at a time [N], shape [3, n]."""
        ((bonds, work, share),) = self._for(1)
        island_forces(self.parts, bonds, self.island_columns(), work, share, time)
        return np.array(work.force)

    def advance(self, first: int, last: int, team: Team) -> tuple[Births | None, Deaths | None, Fault | None]:
        born = self._births(first, last)
        fault = self._move(first, last, team) if self._joined.whole.count else None
        deaths = self._deaths(last) if fault is None and self._changes else None
        return born, deaths, fault

    def begin(self, team: Team) -> None:
        """Let interactions find out what they need to know before the first step. Raises UsageError where one cannot do what
        was asked for."""
        for name, each in zip(self.names, self.interactions, strict=True):
            with self._scenario.at_interaction(name):
                each.calibrate(self.island_columns(), team)

    def _births(self, first: int, last: int) -> Births | None:
        """Births in steps first … last − 1."""
        if not self._changes:
            return None
        due = self._due(last)
        if not any(due):
            if isinstance(self._method, ImplicitMethod):
                self._new_system()
            return self._emit(first, last)
        before = self._stored()
        place = self._joined.make_room(due)
        born = self._emit(first, last)
        self._lay_again(place)
        self.keep(first)
        if self._booking is not None and born is not None:
            self._booking.book_births(self.columns(), due, self._stored() - before)
        return born

    def _deaths(self, last: int) -> Deaths | None:
        """Take out who has died by the end of step last − 1."""
        whole, end = self._joined.whole, last * self.dt
        dead = whole.stop[: whole.count] <= end
        if not dead.any():
            return None
        before = self._stored()
        if self._booking is not None:
            self._booking.book_dead(self.columns(), end)
        place = np.where(dead, -1, np.cumsum(~dead) - 1)
        found = [state.bury(end) for state in self.states]
        self._joined.close_ranks()
        self._lay_again(place)
        self.kept_from = last
        if self._booking is not None:
            self._booking.books.add("deaths", self._stored() - before)
        return Deaths(
            *(np.concatenate([getattr(each, name) for each in found]) for name in ("ids", "times", "causes"))
        )

    def _stored(self) -> float:
        """The potential energy of all interactions [J], where work is booked; else 0."""
        if self._booking is None:
            return 0.0
        columns = self.island_columns()
        return sum(each.energy(columns) or 0.0 for each in self.interactions)

    def _move(self, first: int, last: int, team: Team) -> Fault | None:
        """Steps first … last − 1 of the particles that there are."""
        steps = last - first
        in_a_step = (
            OWN_STEPS if self._method.adaptive else SOLVED_STEP if self._work.system is not None else 1
        )
        worth = self.springs >= WORTH_SPRINGS and self.springs * steps * in_a_step >= WORTH_THREADS
        shares = self._for(team.threads if worth else 1)
        columns = self.island_columns()
        done = [0] * len(shares)
        booked, pace = self._booking is not None, None
        if self._method.adaptive:
            events = self._joined.events(self.dt) if self._changes else np.empty(0)
            pace = new_pace(len(shares), events, disturbed=self._disturbed, pauses=booked)
        opened = self._open(first) if booked and pace is None else None
        if self.rods is not None:
            self.rods.begin()

        def work(k: int) -> None:
            bonds, scratch, share = shares[k]
            given = (self._staged, self.parts, bonds, columns, scratch, share)
            if pace is not None:
                done[k] = self._step(*given, pace, first, steps, self.dt)
            else:
                done[k] += self._step(*given, first + done[k], steps - done[k], self.dt)

        team.each(work, len(shares))
        while booked and pace is not None and done[0] < steps and not pace.stuck:
            leg = self._leg(pace)
            team.each(work, len(shares))
            self._close_leg(leg, pace, arrived=done[0] == steps)
        if pace is None and done[0] < steps and self._solves_more():
            team.each(work, len(shares))
        if done[0] == steps:
            self._close(opened, last)
            return None
        step = first + done[0]
        if pace is not None:
            return self._stop(step, pace)
        if self._work.before is None:
            self._return_to(step)
        if self._work.system is not None and self._work.system.report[0] == UNSOLVED:
            return self._unsolved(step)
        return self._find(step)

    def fit(self) -> None:
        """Bring particles on rods to velocities that keep lengths, after something has changed them from outside."""
        if self.rods is not None:
            self.rods.fit(self.island_columns())

    def _solves_more(self) -> bool:
        """Whether the last step met equations that are not symmetric and positive definite: from now on the kernel solves
        these, too."""
        if not isinstance(self._staged, StagedImplicit) or isinstance(self._staged.solver, General):
            return False
        if self._work.system.report[0] != INDEFINITE:
            return False
        self._staged = self._staged._replace(solver=General())
        return True

    def _step_copy(
        self, parts: tuple[Part, ...], interactions: Interactions, columns: Columns, first: int, steps: int
    ) -> None:
        """Steps of a copy of the particles and interactions, on one thread."""
        bonds, work, share = self._alone(interactions)
        if self.rods is not None:
            self.rods.begin()
        given = (parts, bonds, columns, work, share)
        done = self._step(self._staged, *given, first, steps, self.dt)
        if done < steps and self._solves_more():
            self._step(self._staged, *given, first + done, steps - done, self.dt)

    def _stop(self, step: int, pace: Pace) -> Fault:
        """Which particle could not go on; the island is where and when it was."""
        why, time, row = int(pace.report[0]), float(pace.report[1]), int(pace.report[2])
        member, k = self._joined.member_of(row)
        least = shortest_step(self._method, (step + 1) * self.dt)
        return Fault(member, k, step, Stop(why, time, self.states[member].particle(k, time), least))

    def _open(self, step: int) -> Opened | None:
        """The state at the beginning of a step whose work is booked; None where none is."""
        if self.books is None:
            return None
        columns, interactions = self._copied()
        begin, h = spans(columns.clock, self._joined.whole.count, step * self.dt, (step + 1) * self.dt)
        free, effort = None, 0.0
        if "contact" in self.books.names:
            free, copies = self._copied()
            parts = tuple(part._replace(contacts=Simple(())) for part in self.parts)
            self._step_copy(parts, copies, free, step, 1)
            effort = 0.0 if self.rods is None else self.rods.effort
        return Opened(columns, begin, h, free, interactions=interactions, effort=effort)

    def _copied(self) -> tuple[Columns, Interactions]:
        """Columns and interactions as they are, to be changed or kept."""
        columns = self.island_columns()
        now = _changing(columns, self.interactions)
        return _with(columns, self.interactions, [column.copy() for column in now])

    def _alone(self, interactions: Interactions) -> tuple[tuple[Any, ...], Work, Share]:
        """What one thread works on, with interactions in another state: bonds, scratch and particles."""
        ((mine, work, share),) = self._for(1)
        bonds, elements = apart(interactions)
        bonds = tuple(each.with_changed(now.changing()) for each, now in zip(mine, bonds, strict=True))
        elements = tuple(
            each.with_changed(now.changing()) for each, now in zip(share.elements, elements, strict=True)
        )
        return bonds, work, share._replace(elements=elements)

    def _close(self, opened: Opened | None, last: int) -> None:
        """Book the step that has been taken."""
        if self._booking is None or opened is None:
            return
        columns = self.island_columns()
        effort = opened.effort if opened.free is not None or self.rods is None else self.rods.effort
        self._booking.close(opened, columns, opened.interactions, self._joined.cut, last * self.dt, effort)
        self._booking.book_breaking(opened.interactions, self.interactions, columns)

    def _leg(self, pace: Pace) -> tuple[Opened, Interactions, float]:
        """The own step at the end of which an island pauses, the interactions before it, and when it ends [s]."""
        assert isinstance(self._method, EmbeddedRungeKutta)
        began, ended = float(pace.present[BEGAN]), float(pace.present[ENDED])
        free, interactions = self._copied()
        begin, h = spans(free.clock, self._joined.whole.count, began, ended)
        start = self._work.before.astype(float)
        before = moved(free, start, np.zeros((6, 1)))
        path = stages(before, (start, self._work.slopes), (began, ended), h, self._method)
        return Opened(before, begin, h, free, path), interactions, ended

    def _close_leg(self, leg: tuple[Opened, Interactions, float], pace: Pace, *, arrived: bool) -> None:
        """Book an own step, of which it is known by now what contact and breaking springs made of its end."""
        opened, interactions, ended = leg
        if self._booking is None or pace.stuck:
            return
        columns = self.island_columns()
        if not arrived:  # the next step has been tried already, from there
            columns = moved(columns, self._work.before.astype(float), np.zeros((6, 1)))
        self._booking.close(opened, columns, interactions, self._joined.cut, ended)
        self._booking.book_breaking(interactions, self.interactions, columns)

    def _forces_in(self, columns: Columns, interactions: Interactions, time: float) -> NDArray[np.float64]:
        """Total force on every particle in a state and at a time [N], shape [3, n]; led particles go to their places."""
        bonds, work, share = self._alone(interactions)
        island_forces(self.parts, bonds, columns, work, share, time)
        return np.array(work.force, float)

    def keep(self, first: int) -> None:
        """Remember the state at the beginning of an interval, to look for the first sign of what goes wrong in it."""
        renewed = tuple(each.renewed() for each in self.interactions)
        if any(new is not old for new, old in zip(renewed, self.interactions, strict=True)):
            self.interactions, self._shares, self._kept = renewed, {}, []
        self.kept_from = first
        now = _changing(self.island_columns(), self.interactions)
        if not self._kept:
            self._kept = [np.empty_like(column) for column in now]
        for mine, column in zip(self._kept, now, strict=True):
            np.copyto(mine, column)

    def go_back(self) -> None:
        """Return to the beginning of the last interval, step `kept_from`; not if there have been births or deaths since."""
        now = _changing(self.island_columns(), self.interactions) if self._kept else []
        for mine, column in zip(self._kept, now, strict=True):
            np.copyto(column, mine)

    def _return_to(self, step: int) -> None:
        """Bring the island to the beginning of a step of the present interval."""
        columns, interactions, _ = self.replay(0, self.kept_from, step - self.kept_from)
        mine = _changing(self.island_columns(), self.interactions)
        for column, found in zip(mine, _changing(columns, interactions), strict=True):
            np.copyto(column, found)

    def replay(self, row: int, first: int, steps: int) -> tuple[Columns, Interactions, slice]:
        """The particles some steps after `first`, the beginning of the last interval; their interactions, and which rows
        these are.

        Nothing of the island changes.
        """
        for each in self.interactions:
            each.renewed()
        kept = [column.copy() for column in self._kept]
        columns, interactions = _with(self.island_columns(), self.interactions, kept)
        self._step_copy(self.parts, interactions, columns, first, steps)
        return columns, interactions, slice(0, self._joined.whole.count)

    def _unsolved(self, step: int) -> Fault:
        """Where the equations of a step miss most."""
        system = self._work.system
        row = int(np.abs(system.residual).sum(axis=0).argmax())
        member = int(np.searchsorted(self._bounds, row, side="right")) - 1
        unsolved = Unsolved(self._method.label, float(system.report[1]), *map(int, system.report[2:]))
        return Fault(member, row - self._bounds[member], step, unsolved=unsolved)

    def _find(self, step: int) -> Fault:
        """Which particle, or rod: step once more on a copy, and look."""
        columns = self.island_columns()
        ((_, work, _),) = self._for(1)
        self._step_copy(self.parts, self.interactions, copied(columns), step, 1)
        wild = ~np.isfinite(work.force).all(axis=0)
        unheld = None if self.rods is None else self.rods.unheld()
        if self.rods is not None and unheld is not None and np.isfinite(unheld.misfit):
            row = self.rods.row_of(unheld, ~self._pinned)
            return Fault(*self._joined.member_of(row), step, unheld=unheld)
        row = int(wild.argmax() if wild.any() else np.abs(work.force).sum(axis=0).argmax())
        return Fault(*self._joined.member_of(row), step)


def _changing(c: Columns, interactions: Interactions) -> list[NDArray[Any]]:
    """All that steps change: motion, what methods remember, clocks, and what changes in interactions."""
    return [*changing(c), *(array for each in interactions for array in each.changing())]


def _with(
    c: Columns, interactions: Interactions, arrays: Sequence[NDArray[Any]]
) -> tuple[Columns, Interactions]:
    """Columns and interactions made of other arrays, in the order of `_changing`."""
    rest = iter(arrays)
    columns = replaced(c, rest)
    made = tuple(each.with_changed([next(rest) for _ in each.changing()]) for each in interactions)
    return columns, made
