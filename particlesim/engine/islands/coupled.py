"""Islands of groups whose particles act on each other, as the engine runs them: by stages, on one thread or several."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.constraints.constraint import Constraint
from particlesim.engine.constraints.registry import held
from particlesim.engine.coupled.adaptive import Pace
from particlesim.engine.coupled.forces import island_forces
from particlesim.engine.coupled.wisdom_holman import gravity_among, longest_step
from particlesim.engine.faults import Fault, Stop, Unsolved
from particlesim.engine.implicit.krylov import UNSOLVED
from particlesim.engine.interactions.beginnings import refuse_wild
from particlesim.engine.interactions.coincident import refuse_coincident_births
from particlesim.engine.interactions.interaction import Site, tired_elements
from particlesim.engine.interactions.registry import laid_again, laid_out
from particlesim.engine.islands.base import BaseIsland, Look, shortest_step
from particlesim.engine.islands.births import Births
from particlesim.engine.islands.booking import Bookkeeper
from particlesim.engine.islands.in_space import InSpace, in_order
from particlesim.engine.islands.joined import Joined
from particlesim.engine.islands.laps import Laps
from particlesim.engine.islands.layout import Interactions, Layout
from particlesim.engine.islands.moment import Moment
from particlesim.engine.islands.present import Stored
from particlesim.engine.islands.stepping import Stepper
from particlesim.engine.state.columns import Columns, copied
from particlesim.engine.state.group_state import Deaths, GroupState
from particlesim.graph.graph import Island
from particlesim.integrators import WisdomHolmanMethod
from particlesim.interactions import PairSet
from particlesim.model.arrays import Ints
from particlesim.process.threads import Team
from particlesim.scenario.reach import interacting, touches_by_surfaces
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

if TYPE_CHECKING:
    from particlesim.engine.islands.rigid import RigidIsland

# What steps bodies is imported where there are some.


class CoupledIsland(BaseIsland):
    """Groups whose particles act on each other; their states are stretches of the island's arrays (`joined`).

    What kernels take (`layout`) is made for the particles that there are, and again whenever there are others.
    """

    def __init__(
        self,
        scenario: Scenario,
        structure: Island,
        states: Sequence[GroupState],
        ids: Mapping[str, tuple[int, int]],
        bodies: RigidIsland | None = None,
    ) -> None:
        super().__init__(scenario, structure, states, ids)
        self._scenario, self._structure = scenario, structure
        self._obstacles = None if bodies is None else bodies.in_the_way_of([each.name for each in states])
        self._left: dict[str, tuple[Ints, Ints]] = {}
        self._joined = Joined(self.states)
        self._stepper = Stepper(structure, self.states, self.dt)
        self._site = self._new_site(began=True)
        constraint = held(self._site, structure)
        self._sets, interactions = laid_out(self._site, structure.interactions)
        self.names = tuple(each.name for each in self._sets)
        self._changes = structure.changes
        touched = any(structure.colliders) or any(each.changing() for each in interactions)
        self._disturbed = self._changes or touched
        self._lay_out(interactions, constraint)

    def _new_site(self, *, began: bool) -> Site:
        """Where interactions are laid out for the particles that there are."""
        obstacles = self._obstacles
        if obstacles is not None:
            counts = [state.count for state in self.states]
            kind = np.repeat(np.arange(len(counts)), counts)
            obstacles = obstacles._replace(kind=kind, left=np.zeros_like(kind), guests=np.zeros_like(kind))
        return Site(self._scenario, self._joined.whole, self.states, began=began, obstacles=obstacles)

    def _lay_out(self, interactions: Interactions, constraint: Constraint | None) -> None:
        """Make what kernels take for the particles and interactions that there are."""
        self._kept: list[NDArray[Any]] = []
        with self._at_gravity(interactions):
            self.layout = Layout(self._structure, self._joined, interactions, constraint)
        self._books = None
        if self.books is not None:
            given = (self._structure, self.names, self._joined, self.layout, self._stepper)
            stored = Stored(self._scenario, self._joined, self._sets)
            self._books = Bookkeeper(self.books, *given, stored)

    def _at_gravity(self, interactions: Interactions) -> AbstractContextManager[None]:
        """The place in the scenario for errors about bodies that follow orbits."""
        if not isinstance(self._method, WisdomHolmanMethod):
            return nullcontext()
        return self._scenario.at_interaction(self.names[gravity_among(interactions)])

    def _lay_again(self, place: Ints) -> None:
        """Lay out all anew after births and deaths: row k has become row `place[k]`, and is gone if that is −1."""
        self._site = self._new_site(began=False)
        if self.constraint is not None:
            self.constraint.lay_again(self._site, place)
        self._lay_out(laid_again(self._site, self._sets, self.interactions, place), self.constraint)

    def resettle(self, ids: Ints) -> None:
        if self._changes:
            self._joined.close_ranks()
            self._lay_again(self._joined.rows_of(ids))

    # ---- what there is

    @property
    def interactions(self) -> Interactions:
        return self.layout.interactions

    @property
    def constraint(self) -> Constraint | None:
        return self.layout.constraint

    def island_columns(self) -> Columns:
        return self.layout.cooled(self._joined.whole.columns(self._read))

    def longest_step_on_orbits(self) -> float:
        orbits = self.layout.work.orbits
        return math.inf if orbits is None else longest_step(orbits, self.island_columns())

    def columns(self) -> list[Columns]:
        return self._joined.cut(self.island_columns())

    def topology(self) -> list[Topology]:
        """The topology of all interactions for a trajectory, in the order of the kernel, and then that of constraints."""
        ids = self._joined.whole.id
        found = [each.topology(name, ids) for name, each in zip(self.names, self.interactions, strict=True)]
        held = [] if self.constraint is None else self.constraint.topology(ids)
        return [each for each in (*found, *held) if each is not None]

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        columns, interactions = self._now().copied()  # a tree remembers how large its field was
        bonds, work, share = self.layout.alone(interactions)
        island_forces(self.layout.parts, bonds, columns, work, share, time)
        return np.array(work.force[:3])

    def fit(self) -> None:
        if self.constraint is not None:
            self.constraint.fit(self.island_columns())

    def _now(self) -> Moment:
        """The present state."""
        return Moment(self.island_columns(), self.interactions)

    # ---- an interval: births, motion, deaths

    def begin(self, team: Team) -> None:
        found = []
        for name, each in zip(self.names, self.interactions, strict=True):
            with self._scenario.at_interaction(name):
                found.append(each.calibrate(self.island_columns(), team))
        self.layout.take(tuple(found))

    def refuse_wild(self, time: float) -> None:
        for name, each in zip(self.names, self.interactions, strict=True):
            with self._scenario.at_interaction(name):
                refuse_wild(each, name, self.states, self.island_columns(), time)

    def advance(
        self, first: int, last: int, team: Team, laps: Laps | None = None, look: Look | None = None
    ) -> tuple[Births | None, Deaths | None, Fault | None]:
        born = self._births(first, last) if self._changes else None
        if self._site.obstacles is not None:
            self._note_left()
        fault = self._move(first, last, team, laps, look) if self.layout.count else None
        self._gather()
        deaths = self._deaths(last) if fault is None and self._changes else None
        if born is not None and born.ids.size and fault is None:
            self._refuse_coincident(born.ids, last * self.dt)
        return born, deaths, fault

    def meets_bodies(self, name: str) -> bool:
        hard = (each for each in self._sets if isinstance(each, PairSet) and each.law.by_impulses)
        mine = (each for each in hard if name in each.groups)
        # contacts of surfaces follow nobody along its way, as those of grains do (`hard.swift`)
        follows = (
            not touches_by_surfaces(each.law, interacting(each.law, self._scenario.groups)) for each in mine
        )
        return self._obstacles is not None and not self._obstacles.waits[0] and any(follows)

    def keeps_out_of_bodies(self) -> bool:
        return any(isinstance(each, PairSet) and each.law.by_impulses for each in self._sets)

    def leave(self, name: str, guests: Ints, left: Ints) -> None:
        self._left[name] = guests, left

    def _note_left(self) -> None:
        """Note who has been among bodies, and whose impacts on these are left to the step that comes; births have come after
        the rows of their groups that were there."""
        notes, none = (self._site.obstacles.guests, self._site.obstacles.left), (np.empty(0, np.int64),) * 2
        for note in notes:
            note[:] = 0
        for state, first in zip(self.states, self._joined.bounds, strict=False):
            for note, rows in zip(notes, self._left.pop(state.name, none), strict=True):
                note[first + rows] = 1

    def _refuse_coincident(self, born: Ints, time: float) -> None:
        """Raise DivergenceError for births at the place of another particle, where the force between them has no value."""
        for each in self._sets:
            if isinstance(each, PairSet) and each.law.singular():
                refuse_coincident_births(self._site, each, born, time)

    def _births(self, first: int, last: int) -> Births | None:
        """Births in steps first … last − 1."""
        due = self._due(last)
        if not any(due):
            self.layout.place_equations(
                self._joined
            )  # as after births, and as a run that is resumed here does
            return self._emit(first, last)
        before = self._now()
        place = self._joined.make_room(due)
        born = self._emit(first, last)
        self._lay_again(place)
        self.keep(first)
        if self._books is not None:
            self._books.book_births(before, self._now(), due, first * self.dt)
        return born

    def _deaths(self, last: int) -> Deaths | None:
        """Take out the particles that have died by the end of step last − 1."""
        whole, end = self._joined.whole, last * self.dt
        dead = whole.stop[: whole.count] <= end
        if not dead.any():
            return None
        before = self._now()
        if self._books is not None:
            before = before.with_all_copied()
            self._books.book_dead(before, end)
        found = [state.bury(end) for state in self.states]
        self._joined.close_ranks()
        self._lay_again(np.where(dead, -1, np.cumsum(~dead) - 1))
        self.keep(last, fresh=False)
        if self._books is not None:
            self._books.book_deaths(before, dead, self._now(), end)
        return Deaths(
            *(np.concatenate([getattr(each, name) for each in found]) for name in ("ids", "times", "causes"))
        )

    @property
    def makes_laps(self) -> bool:
        # what is not in checkpoints is forgotten where a run may be resumed, which laps must not depend on
        goes_on = not self._changes and all(each.resumes for each in self.interactions)
        return goes_on and self.books is None and not self._method.adaptive and in_order(self.layout)

    def _move(
        self, first: int, last: int, team: Team, laps: Laps | None = None, look: Look | None = None
    ) -> Fault | None:
        """Steps first … last − 1 of the particles that there are."""
        steps, layout, stepper, books = last - first, self.layout, self._stepper, self._books
        done = [0] * len(layout.shares(stepper.threads(layout, steps, team)))
        events = self._joined.events(self.dt) if self._changes else np.empty(0)
        pace = stepper.pace(len(done), events, disturbed=self._disturbed, pauses=books is not None)
        opened = books.open(self._now(), first) if books is not None and pace is None else None
        kept = None if books is None else books.kept()
        if layout.constraint is not None:
            layout.constraint.begin()
        if laps is not None:
            steps = self._make_laps(first, steps, done, team, laps)
        else:
            columns = self.island_columns()
            there = InSpace.of(layout, columns, steps) if pace is None else None
            work = stepper.work(layout, columns, first, steps, done, pace, there)
            self._go_on(work, first, steps, done, team, look)
            if there is not None:
                there.bring_back(layout, columns)
        while books is not None and pace is not None and done[0] < steps and not pace.stuck:
            leg = books.open_leg(self._now(), pace)
            team.each(work, len(done))
            if not pace.stuck:
                books.close_leg(leg, self._now(), arrived=done[0] == steps)
        if pace is None and done[0] < steps and stepper.solves_more(layout):
            work = stepper.work(layout, self.island_columns(), first, steps, done, pace)
            self._go_on(work, first, steps, done, team, look)
        if any(each.cramped for each in self.interactions):
            layout.take(tuple(each.roomier() if each.cramped else each for each in self.interactions))
            self.go_back()
            if books is not None and kept is not None:
                books.go_back(kept)
            return self._move(first, last, team, laps, look)
        if done[0] < steps:
            return self._fault(first + done[0], pace)
        if books is not None and opened is not None:
            books.close(opened, self._now(), last)
        return None

    def _go_on(
        self,
        work: Callable[[int], None],
        first: int,
        steps: int,
        done: list[int],
        team: Team,
        look: Look | None,
    ) -> None:
        """Have threads work until all steps are done, or one cannot be, or room is short; in pauses others `look`."""
        made = done[0]
        team.each(work, len(done))
        while made < done[0] < steps and tired_elements(self.interactions):
            if any(each.cramped for each in self.interactions):
                return
            made = done[0]
            if look is not None:
                look(first + made)
            team.each(work, len(done))

    def _make_laps(self, first: int, steps: int, done: list[int], team: Team, laps: Laps) -> int:
        """The same lap by lap, until one is not good or somebody wants the state; returns how many steps were to be made."""
        layout, columns, there = self.layout, self.island_columns(), None
        for begin in range(0, steps, laps.steps):
            end = min(begin + laps.steps, steps)
            there = there or InSpace.of(layout, columns, steps - begin)  # not known before the first one
            work = self._stepper.work(layout, columns, first, end, done, None, there)
            team.each(work, len(done))
            cramped = any(each.cramped for each in layout.interactions)
            if done[0] < end or cramped or (end < steps and not laps.goes_on(first + end)):
                steps = end
                break
        if there is not None:
            there.bring_back(layout, columns)
        return steps

    # ---- what went wrong

    def _fault(self, step: int, pace: Pace | None) -> Fault:
        """Why a step could not be made, and by whom; the island is at its beginning then, or where own steps ended."""
        if pace is not None:
            why, time, row = int(pace.report[0]), float(pace.report[1]), int(pace.report[2])
            member, k = self._joined.member_of(row)
            least = shortest_step(self._method, (step + 1) * self.dt)
            return Fault(member, k, step, Stop(why, time, self.states[member].particle(k, time), least))
        work = self.layout.work
        if work.before is None:
            self._return_to(step)
        if work.system is not None and work.system.report[0] == UNSOLVED:
            row = int(np.abs(work.system.residual).sum(axis=0).argmax())
            left, iterations, linear = work.system.report[1:4].tolist()
            unsolved = Unsolved(self._method.label, left, int(iterations), int(linear))
            return Fault(*self._joined.member_of(row), step, unsolved=unsolved)
        return self._find(step)

    def _find(self, step: int) -> Fault:
        """What holds particles, or which of them: for that, step once more on a copy, and look."""
        layout = self.layout
        missed = None if self.constraint is None else self.constraint.unheld(self._site)
        force, columns = self.forces(step * self.dt), copied(self.island_columns())
        wild = ~np.isfinite(force).all(axis=0)
        if not wild.any():
            self._stepper.copy(layout, layout.parts, self.interactions, columns, step, 1)
            moved = (columns.x, columns.y, columns.z, columns.vx, columns.vy, columns.vz)
            wild = ~np.isfinite(moved).all(axis=0)
        if missed is not None and (np.isfinite(missed[1].misfit) or not wild.any()):
            row, unheld = missed
            return Fault(*self._joined.member_of(row), step, unheld=unheld)
        row = int(wild.argmax() if wild.any() else np.abs(force).sum(axis=0).argmax())
        return Fault(*self._joined.member_of(row), step)

    # ---- back to the beginning of an interval

    def keep(self, first: int, *, fresh: bool = True) -> None:
        self.layout.renew(fresh=fresh)
        self.kept_from = first
        now = self._now().arrays()
        sizes = [[column.shape for column in columns] for columns in (self._kept, now)]
        if sizes[0] != sizes[1]:  # what remembers may grow
            self._kept = [np.empty_like(column) for column in now]
        for mine, column in zip(self._kept, now, strict=True):
            np.copyto(mine, column)

    def recall(self) -> None:
        self.layout.recall()

    def go_back(self) -> None:
        """Return to the beginning of the last interval, or to the last births or deaths in it."""
        if self._kept:
            self._now().take(self._kept)
            self.recall()

    def _return_to(self, step: int) -> None:
        """Bring the island to the beginning of a step of the present interval."""
        assert self.kept_from is not None
        columns, interactions, _ = self.replay(0, self.kept_from, step - self.kept_from)
        self._now().take(Moment(columns, interactions).arrays())
        self.recall()

    def replay(self, row: int, first: int, steps: int) -> tuple[Columns, Interactions, slice]:
        columns, interactions = self._now().made_of([column.copy() for column in self._kept])
        self.recall()  # steps of a copy find out what it has not
        self._stepper.copy(self.layout, self.layout.parts, interactions, columns, first, steps)
        return columns, interactions, slice(0, self.layout.count)

    def stopped(self, row: int, first: int, steps: int) -> tuple[Columns, Interactions, slice]:
        return *self._now(), slice(0, self.layout.count)
