"""A running simulation: a world in motion, with births, deaths, kicks, and the ledger."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from particlesim.checks.quantities import ROTATION
from particlesim.engine.diagnosis.crossings import Crossings
from particlesim.engine.diagnosis.post_mortem import not_finite, overflowed
from particlesim.engine.diagnosis.undefined_paths import astray, led_are_finite, lost_collider
from particlesim.engine.guard import Guard
from particlesim.engine.islands.base import OWN_STEPS, BaseIsland
from particlesim.engine.islands.births import Births
from particlesim.engine.islands.laps import Laps
from particlesim.engine.islands.meetings import Meetings
from particlesim.engine.ledger.sums import MOTION
from particlesim.engine.ledger.work import total_energy
from particlesim.engine.state.group_state import Deaths
from particlesim.engine.state.table import SPIN
from particlesim.engine.step.records import as_precision
from particlesim.engine.world import World
from particlesim.errors import DivergenceError
from particlesim.laws.registry import has_law, potential
from particlesim.process.threads import Team
from particlesim.scenario.ledger_columns import attribute_totals, pressures, rotations, work_columns
from particlesim.scenario.reach import acts_on, pair_sets
from particlesim.scenario.scenario import Scenario

PIECE = 50_000_000
"""Particle-steps in one call of a kernel: a fraction of a second, so that progress shows and Ctrl-C is heard."""


LAPS = 8
"""Pieces that an island may make in one call, lap by lap."""

RENEWAL = 64
"""Steps after which interactions forget what they have found out, and a run may be resumed, where intervals are of one."""


@dataclass
class Events:
    """Births and deaths since they were last taken."""

    births: list[Births] = field(default_factory=list)
    deaths: list[Deaths] = field(default_factory=list)


class Simulation(World):
    """A world that moves forward.

    `threads` bounds the threads (all cores unless given); results do not depend on it, nor on `block`.
    Raises UsageError when a file that the scenario names cannot be read.
    """

    def __init__(self, scenario: Scenario, *, threads: int | None = None, block: int | None = None) -> None:
        super().__init__(scenario, block=block)
        self.team = Team(threads)
        self.events = Events()
        self.particle_steps = 0
        self._kicks = sorted(
            (round(at / scenario.grid.dt), k)
            for k, kick in enumerate(scenario.impulses)
            for at in kick.times()
        )
        self._meetings = Meetings(scenario, self.islands, self.states)
        self._own = OWN_STEPS if any(island.method.adaptive for island in self.graph.islands) else 1
        # Bodies go first where they have guests.
        self._order = sorted(
            _hearers_last(self.islands), key=lambda k: not self._meetings.concern(self.islands[k])
        )
        self._heard = any(island.listens_to for island in self.islands)
        self._numbers = {c.name: k for k, c in enumerate(scenario.all_colliders) if c.name is not None}
        self._codes = {group.name: -2 - k for k, group in enumerate(scenario.groups)}
        self._labels = scenario.labels
        self._sources = self._ledger_sources()
        self._totals, self._pressures = attribute_totals(scenario), pressures(scenario)
        self._ledger_columns = self._name_columns()
        self.energy_at_start, self.impulse_work = np.full(1, np.nan), np.zeros(1)
        self._energies: list[dict[str, float]] = []
        self._energies_of = -1
        self._guard = Guard(self, self._ledger_columns)
        self._crossings = Crossings(self)

    def begin(self) -> None:
        """Find out what interactions need to know before their first sum, as how exact it is; once is enough.

        Raises UsageError for an accuracy that cannot be had.
        """
        for island in self.islands:
            island.begin(self.team)

    def advance_to(
        self,
        step: int,
        between: Callable[[], None] | None = None,
        asked: Callable[[int], bool] = lambda step: False,
    ) -> None:
        """Move on to the beginning of a step; `between` is called between the pieces of long intervals. A piece ends where
        `asked`, which is told the step, says that somebody wants the state there.

        Raises DivergenceError when a number stops being finite; the particles concerned are then back at the beginning of
        the interval.
        """
        fresh = True
        alone = len(self.islands) == 1 and self.islands[0].makes_laps
        while self.step < step:
            self._kick()
            last = min([step, *(at for at, _ in self._kicks if at > self.step)])
            piece = max(64 // self._own, PIECE // (max(self.count, 1) * self._own))
            singly = bool(self._meetings or self._heard)  # births of impacts are in the same step
            laps = Laps(piece, asked) if alone and not singly else None
            last = min(last, self.step + (1 if singly else piece if laps is None else LAPS * piece))
            for number in self._order:
                if self._meetings.concern(self.islands[number]):
                    self._meetings.invite()
                    self._advance(number, self.step, last, fresh, asked)
                    self._meetings.dismiss()
                else:
                    self._advance(number, self.step, last, fresh, asked, laps)
            if laps is not None and laps.stopped is not None:
                last = laps.stopped
            if (fault := self._meetings.hold_ends(self.step)) is not None:
                raise not_finite(self, self._order[0], fault, self.step)
            self.step = last
            fresh = not singly or last % RENEWAL == 0
            if between is not None and last < step and fresh:
                between()

    def _advance(
        self,
        number: int,
        first: int,
        last: int,
        fresh: bool,
        asked: Callable[[int], bool],
        laps: Laps | None = None,
    ) -> None:
        island = self.islands[number]

        def look(step: int) -> None:
            asked(step)  # which shows how far the run is
            self._glance(number, step)

        island.begin(self.team)
        island.keep(first, fresh=fresh)
        if island.listens_to:
            found = {name: each for other in self.islands for name, each in other.impacts.items()}
            island.hear(found, self._numbers, self._codes)
        while first < last:
            until = island.phase(first, last)
            born, deaths, fault = island.advance(first, until, self.team, laps, look)
            if laps is not None and laps.stopped is not None:
                last = until = laps.stopped
            if fault is not None:
                raise not_finite(self, number, fault, first)
            self.particle_steps += sum(state.count for state in island.states) * (until - first)
            if born is not None and born.ids.size:
                self.events.births.append(born)
            if deaths is not None and deaths.ids.size:
                self.events.deaths.append(deaths)
            first = until

    def _glance(self, number: int, step: int) -> None:
        """Look at the energies of an island in the middle of an interval, where its steps take long: they do so where it
        flies apart. Raises DivergenceError."""
        island, begun = self.islands[number], self.step
        # an energy must not change what interactions have found out, nor count the dead
        if self._guard.judges(number) and not (
            self.graph.islands[number].changes or any(each.prepares for each in island.interactions)
        ):
            self.step = step
            rest = dict.fromkeys(self._ledger_columns, 0.0)
            self._guard.glance(self, number, self._island_energies(number, rest))
            self.step = begun

    def _kick(self) -> None:
        """Impulses that are due at the present step."""
        for at, k in self._kicks:
            if at == self.step:
                kick = self.scenario.impulses[k]
                self._guard.forget()
                before = self._kinetic()
                for group, state in zip(self.scenario.groups, self.states, strict=True):
                    chosen = (
                        state.name in kick.on
                        if kick.on is not None
                        else group.dynamics.type == "second_order"
                    )
                    if chosen:
                        state.kick(kick.impulse)
                for island in self.islands:
                    island.fit()
                self.impulse_work[0] += self._kinetic() - before

    def _kinetic(self) -> float:
        """Kinetic energy of everything with inertia [J], where work is booked; else 0."""
        if not self.scenario.output.work:
            return 0.0
        return sum(state.kinetic() for state in self.states)

    def take_events(self) -> Events:
        """Births and deaths since the last call."""
        events, self.events = self.events, Events()
        return events

    def _ledger_sources(self) -> list[tuple[tuple[int, ...], tuple[Any, ...]]]:
        """For every group, which forces have a potential, and their records in its precision."""
        found = []
        for group, state in zip(self.scenario.groups, self.states, strict=True):
            here = tuple(
                k
                for k, f in enumerate(self.scenario.forces)
                if acts_on(f, group) and has_law(potential, f.record())
            )
            records = tuple(as_precision(self.scenario.forces[k].record(), state.dtype) for k in here)
            found.append((here, records))
        return found

    def _name_columns(self) -> tuple[str, ...]:
        forces = sorted({k for here, _ in self._sources for k in here})
        names = [*(self._labels.forces[k] for k in forces), *self._labels.joints]
        names += [pairs.name for pairs in pair_sets(self.scenario) if pairs.law.stores()]
        potentials = (f"potential.{name}" for name in names)
        work = work_columns(self.scenario) if self.scenario.output.work else ()
        motion = [name for name in MOTION if name != ROTATION]
        return (*motion, *rotations(self.scenario), *potentials, *self._totals, *self._pressures, *work)

    def ledger_columns(self) -> tuple[str, ...]:
        """Names of the ledger's columns: motion, then the potential energy of every force that has one."""
        return self._ledger_columns

    def ledger(self) -> dict[str, float]:
        """Kinetic and potential energies [J], momentum [kg m/s] and angular momentum [kg m²/s] about the origin.

        With `work` under [output] also the work of every cause, and the residual of the balance [J].

        Particles without inertia have potential energy only.
        """
        total = dict.fromkeys(self._ledger_columns, 0.0)
        for name in self._totals:
            attribute = name.partition(".")[0]
            total[name] = float(sum(state.attribute(attribute).sum(dtype=float) for state in self.states))
        self._energies = [self._island_energies(number, total) for number in range(len(self.islands))]
        self._energies_of = self.step
        for energies in self._energies:
            for name, value in energies.items():
                total[name] += value
        for name in self._pressures:
            total[name] = self._pressure(total)
        if self.scenario.output.work:
            self._balance(total)
        return total

    def _pressure(self, row: dict[str, float]) -> float:
        """(2 K + Σ l·f)/(3 V) [Pa], with the energy K of the motion about the centre of mass: the virial theorem.

        K is that of translation, as momentum is what crosses a wall: spheres that turn in place push against none.
        """
        box = self.scenario.simulation.box
        volume = None if box is None else box.as_box().volume
        assert volume is not None
        mass = sum(float(state.mass[: state.count].sum(dtype=float)) for state in self.states)
        drift = sum(row[f"momentum.{axis}"] ** 2 for axis in "xyz") / (2 * mass) if mass > 0 else 0.0
        virial = sum(
            float(np.trace(found))
            for island in self.islands
            for each in island.interactions
            if (found := each.virial(island.island_columns(), self.time)) is not None
        )
        turns = any(SPIN in state.parts for state in self.states)
        kinetic = sum(state.kinetic() for state in self.states) if turns else row["kinetic"]
        return (2 * (kinetic - drift) + virial) / (3 * volume)

    def _balance(self, total: dict[str, float]) -> None:
        """Add the work that has been done and the residual of the balance [J]."""
        for island in self.islands:
            if island.books is not None:
                for name, joule in zip(island.books.names, island.books.totals, strict=True):
                    total[f"work.{name}"] += float(joule)
        if self.scenario.impulses:
            total["work.impulses"] += float(self.impulse_work[0])
        energy = total_energy(total)
        if self.step == 0:
            self.energy_at_start[0] = energy
        done = sum(value for name, value in total.items() if name.startswith("work."))
        total["balance"] = energy - float(self.energy_at_start[0]) - done

    def _island_energies(self, number: int, total: dict[str, float]) -> dict[str, float]:
        """Kinetic and potential energies of an island [J]; its momenta are added to `total`."""
        island, structure = self.islands[number], self.graph.islands[number]
        found = {"kinetic": 0.0}
        for member, group in enumerate(structure.groups):
            forces, records = self._sources[self.scenario.groups.index(group)]
            sums = island.sums(member, records, self.time, self.team).tolist()
            if group.dynamics.type == "second_order":
                found["kinetic"] += sums[0]
                for key, value in zip(MOTION[1:], sums[1:], strict=False):
                    if key in total:
                        total[key] += value
            for k, value in zip(forces, sums[len(MOTION) :], strict=True):
                label = f"potential.{self._labels.forces[k]}"
                found[label] = found.get(label, 0.0) + value
        for name, energy in island.stored().items():
            found[f"potential.{name}"] = energy
        if island.interactions:
            whole = island.island_columns()
            for name, each in zip(island.names, island.interactions, strict=True):
                if (energy := each.energy(whole, self.time)) is not None:
                    found[f"potential.{name}"] = energy
        return found

    def check(self) -> None:
        """Whether the present state makes sense; costs next to nothing.

        Energies are those of the last `ledger`, if it was taken at this step, else taken now and then.
        Raises DivergenceError.
        """
        if not all(map(led_are_finite, self.states)) and (lost := astray(self, self.step)) is not None:
            raise lost
        if (lost := lost_collider(self, self.step)) is not None:
            raise lost
        known = dict(enumerate(self._energies)) if self._energies_of == self.step else {}
        if not known and (wanted := self._guard.wants(self)):
            rest = dict.fromkeys(self._ledger_columns, 0.0)
            known = {number: self._island_energies(number, rest) for number in wanted}
        self._guard.look(self, known)
        self._crossings.look(self)

    def missed_crossings(self) -> int:
        """How often particles or bodies have passed a surface that should have held them back, as far as it was seen: in
        steps that came near, and by who stood on the wrong side at frames."""
        return int(self._crossings.number[0]) + sum(state.missed_crossings() for state in self.states)

    def warnings(self) -> tuple[str, ...]:
        """Notes about the steps so far, although they are valid."""
        return self._guard.warnings(self)

    def overflow(self, quantity: str) -> DivergenceError:
        """The error to raise when a quantity of the ledger is no longer finite: what the fastest particle does."""
        return overflowed(self, quantity)

    def close(self) -> None:
        """End the team of threads."""
        self.team.close()


def _hearers_last(islands: Sequence[BaseIsland]) -> tuple[int, ...]:
    """The numbers of islands in an order in which all come after those whose impacts they hear; it has no circles."""
    owner = {state.name: k for k, island in enumerate(islands) for state in island.states}
    found: dict[int, None] = {}

    def visit(k: int) -> None:
        for name in sorted(islands[k].listens_to):
            visit(owner[name])
        found.setdefault(k)

    for k in range(len(islands)):
        visit(k)
    return tuple(found)
