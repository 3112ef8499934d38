"""Islands of groups joined by springs and rods, as the engine runs them: by stages, on one thread or several."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
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
from particlesim.engine.interactions.registry import laid_out
from particlesim.engine.islands import assembly
from particlesim.engine.islands.assembly import Interactions, apart
from particlesim.engine.islands.independent import (
    OWN_STEPS,
    attributes_read,
    shortest_step,
)
from particlesim.engine.ledger.particle_work import IslandBooks, Opened, spans, stages
from particlesim.engine.ledger.work import Books, moved
from particlesim.engine.state.columns import Columns, block_of, changing, copied, replaced
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.step.impacts import Simple
from particlesim.graph.graph import Island
from particlesim.integrators import EmbeddedRungeKutta, GaussRadauMethod, ImplicitMethod
from particlesim.interactions import PairSet
from particlesim.process.threads import Team
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

WORTH_SPRINGS = 5_000
"""Springs below which threads would spend their time waiting for each other."""
WORTH_THREADS = 500_000
"""Spring-steps below which one thread is faster than waking others."""


SOLVED_STEP = 50
"""How many times longer a step takes whose equations are solved."""

ROD_IN_SPRINGS = 20
"""About how many springs take the time of a rod."""


class CoupledIsland:
    """Groups joined by springs and rods; their states are stretches of the island's arrays."""

    def __init__(self, scenario: Scenario, island: Island, states: Sequence[GroupState]) -> None:
        self.dt = scenario.grid.dt
        self._method = island.method
        self._join(list(states))
        dtype = self._all.dtype
        self._staged, self._step = assembly.stepper(island, self.states, dtype)
        self._bounds = np.cumsum([0, *(state.count for state in states)]).tolist()
        read = (
            attributes_read(*each)
            for each in zip(island.forces, island.colliders, island.groups, strict=True)
        )
        pairs = (each.law.needs() for each in island.interactions if isinstance(each, PairSet))
        self._read = frozenset[str]().union(*read, *pairs)
        self.parts = assembly.parts_of(island, self._bounds, dtype)
        self._driven = assembly.driven_in(self.states, self._bounds)
        site = Site(scenario, self._all, self.states)
        self.rods = rod_system(scenario, island, self._all, self.states, site.offset)
        self._pinned = site.pinned()
        self.names: tuple[str, ...]
        self.interactions: tuple[Any, ...]
        self.names, self.interactions = laid_out(site, island.interactions)
        self.springs = sum(each.effort for each in self.interactions)
        if self.rods is not None and self.rods.components > 1:
            self.springs += ROD_IN_SPRINGS * self.rods.number
        breakable = any(each.changing() for each in self.interactions)
        self._disturbed = any(island.colliders) or breakable
        looks_back = self.rods is not None or any(part.contacts != Simple(()) for part in self.parts)
        self._work = scratch(self._method, self._all.count, dtype, looks_back=looks_back)
        if isinstance(self._method, GaussRadauMethod):
            self._work = self._work._replace(radau=new_room(self._all.memory[:, : self._all.count]))
        if isinstance(self._method, ImplicitMethod):
            bonds, _ = apart(self.interactions)
            self._work = self._work._replace(
                system=new_system(bonds, self._all.x[:, : self._all.count], dtype)
            )
        self._shares: dict[int, list[tuple[tuple[Any, ...], Work, Share]]] = {}
        self.books = Books(scenario, island, dtype) if scenario.output.work else None
        self._booking = (
            None
            if self.books is None
            else IslandBooks(self.books, island, self._bounds, self._driven, self.names, self._forces_in)
        )
        self._kept: list[NDArray[Any]] = []
        self.kept_from = 0

    def _join(self, states: list[GroupState]) -> None:
        """One set of arrays for the island; the groups become views of it."""
        first = states[0]
        total = sum(state.count for state in states)
        whole = GroupState(
            first.name,
            total,
            dtype=first.dtype,
            memory=len(first.memory),
            parts=frozenset[str]().union(*(state.parts for state in states)),
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

    def _for(self, threads: int) -> list[tuple[tuple[Any, ...], Work, Share]]:
        """What each of some threads works on: its pieces of bonds, scratch, and particles with the other interactions."""
        if threads not in self._shares:
            rods = None if self.rods is None else self.rods.rods
            found = assembly.shared(self._all.count, threads, self._driven, self.interactions, rods)
            self._shares[threads] = [
                (mine, assembly.own_scratch(self._work, share, self._all.dtype), share)
                for mine, share in found
            ]
        return self._shares[threads]

    def topology(self) -> list[Topology]:
        """What a trajectory keeps of all interactions, in the order of the kernel, and then of the rods."""
        ids = self._all.id
        found = [each.topology(name, ids) for name, each in zip(self.names, self.interactions, strict=True)]
        rods = [] if self.rods is None else self.rods.topology(ids)
        return [each for each in (*found, *rods) if each is not None]

    def columns(self) -> list[Columns]:
        """Columns of every group of the island."""
        return self._cut(self.island_columns())

    def island_columns(self) -> Columns:
        """Columns of the whole island."""
        return self._all.columns(self._read)

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        """Total force on every particle at a time [N], shape [3, n]."""
        ((bonds, work, share),) = self._for(1)
        island_forces(self.parts, bonds, self.island_columns(), work, share, time)
        return np.array(work.force)

    def phase(self, first: int, last: int) -> int:
        """How far steps may go from `first` towards `last` in one piece."""
        return last if self._booking is None else min(first + 1, last)

    def advance(self, first: int, last: int, team: Team) -> tuple[None, None, Fault | None]:
        """Steps first … last − 1."""
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
            pace = new_pace(len(shares), self._disturbed, booked)
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
            return None, None, None
        step = first + done[0]
        if pace is not None:
            return None, None, self._stop(step, pace)
        if self._work.before is None:
            self._return_to(step)
        if self._work.system is not None and self._work.system.report[0] == UNSOLVED:
            return None, None, self._unsolved(step)
        return None, None, self._find(step)

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
        member = int(np.searchsorted(self._bounds, row, side="right")) - 1
        p = self.states[member].particle(row - self._bounds[member], time)
        least = shortest_step(self._method, (step + 1) * self.dt)
        return Fault(member, row - self._bounds[member], step, Stop(why, time, p, least))

    def _open(self, step: int) -> Opened | None:
        """The state at the beginning of a step whose work is booked; None where none is."""
        if self.books is None:
            return None
        columns, interactions = self._copied()
        begin, h = spans(columns.clock, self._all.count, step * self.dt, (step + 1) * self.dt)
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
        self._booking.close(opened, columns, opened.interactions, self._cut, last * self.dt, effort)
        self._booking.book_breaking(opened.interactions, self.interactions, columns)

    def _leg(self, pace: Pace) -> tuple[Opened, Interactions, float]:
        """The own step at the end of which an island pauses, the interactions before it, and when it ends [s]."""
        assert isinstance(self._method, EmbeddedRungeKutta)
        began, ended = float(pace.present[BEGAN]), float(pace.present[ENDED])
        free, interactions = self._copied()
        begin, h = spans(free.clock, self._all.count, began, ended)
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
        self._booking.close(opened, columns, interactions, self._cut, ended)
        self._booking.book_breaking(interactions, self.interactions, columns)

    def _cut(self, whole: Columns) -> list[Columns]:
        """Columns of the island cut into those of its groups."""
        return [block_of(whole, a, b) for a, b in pairwise(self._bounds)]

    def _forces_in(self, columns: Columns, interactions: Interactions, time: float) -> NDArray[np.float64]:
        """Total force on every particle in a state and at a time [N], shape [3, n]; led particles go to their places."""
        bonds, work, share = self._alone(interactions)
        island_forces(self.parts, bonds, columns, work, share, time)
        return np.array(work.force, float)

    def keep(self, first: int) -> None:
        """Remember the state at the beginning of an interval, to look for the first sign of what goes wrong in it."""
        renewed = tuple(each.renewed() for each in self.interactions)
        if any(new is not old for new, old in zip(renewed, self.interactions, strict=True)):
            self.interactions, self._shares = renewed, {}
        self.kept_from = first
        now = _changing(self.island_columns(), self.interactions)
        if not self._kept:
            self._kept = [np.empty_like(column) for column in now]
        for mine, column in zip(self._kept, now, strict=True):
            np.copyto(mine, column)

    def go_back(self) -> None:
        """Return to the beginning of the last interval, step `kept_from`."""
        for mine, column in zip(self._kept, _changing(self.island_columns(), self.interactions), strict=True):
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
        return columns, interactions, slice(0, self._all.count)

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
            member = int(np.searchsorted(self._bounds, row, side="right")) - 1
            return Fault(member, row - self._bounds[member], step, unheld=unheld)
        row = int(wild.argmax() if wild.any() else np.abs(work.force).sum(axis=0).argmax())
        member = int(np.searchsorted(self._bounds, row, side="right")) - 1
        return Fault(member, row - self._bounds[member], step)


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
