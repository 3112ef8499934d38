"""A running simulation: islands, time, births, deaths, kicks, and the ledger."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.emitters import Emitter
from particlesim.engine.corners import sum_hinges
from particlesim.engine.coupled_island import CoupledIsland
from particlesim.engine.islands import OWN_STEPS, Births, Fault, IndependentIsland, Unsolved
from particlesim.engine.measure import MOTION, bond_energy, measure
from particlesim.engine.pace import MOST_STEPS, NOT_FINITE, TOO_MANY, TOO_SHORT
from particlesim.engine.populate import populate
from particlesim.engine.program import as_precision
from particlesim.engine.state import Deaths, GroupState
from particlesim.engine.topology import topology
from particlesim.errors import DivergenceError
from particlesim.graph import Graph, build_graph
from particlesim.laws import Particle, force, has_law, potential
from particlesim.scenario.scenario import Scenario, acts_on
from particlesim.team import Team
from particlesim.trajectory.topology import Topology

PIECE = 50_000_000
"""Particle-steps in one call of a kernel: a fraction of a second, so that progress shows and Ctrl-C is heard."""

WHY = {
    NOT_FINITE: (
        "feels a force that is not finite at t = {t:.9g} s",
        "keep it away from where a force has no value",
    ),
    TOO_SHORT: (
        "needs steps below {least:.3g} s at t = {t:.9g} s",
        "a force grows without bound there, or jumps: soften it, or allow more error (tolerance) or "
        "shorter steps (minimum_step)",
    ),
    TOO_MANY: (
        f"has taken {MOST_STEPS:,} steps within one dt by t = {{t:.9g}} s",
        "allow more error (tolerance), use a method of higher order, or a smaller dt",
    ),
}
"""What is told of a particle whose own steps could not go on, and what to do about it."""


@dataclass
class Events:
    """Births and deaths since they were last taken."""

    births: list[Births] = field(default_factory=list)
    deaths: list[Deaths] = field(default_factory=list)


class Simulation:
    """The state of a scenario, and how to move it forward.

    `threads` bounds the threads (all cores unless given). `block` is the number of particles that step together in
    cache; results do not depend on either.
    Raises UsageError when a file that the scenario names cannot be read.
    """

    def __init__(self, scenario: Scenario, *, threads: int | None = None, block: int | None = None) -> None:
        self.scenario = scenario
        self.graph: Graph = build_graph(scenario)
        self.team = Team(threads)
        self.step = 0
        self._dt = scenario.grid.dt
        self.events = Events()
        self.particle_steps = 0
        self._islands = self._populate(block)
        by_name = {state.name: state for island in self._islands for state in island.states}
        self.states: list[GroupState] = [by_name[group.name] for group in scenario.groups]
        self._kicks = sorted(
            (round(at / scenario.grid.dt), k)
            for k, kick in enumerate(scenario.impulses)
            for at in kick.times()
        )
        self._own = OWN_STEPS if any(island.method.adaptive for island in self.graph.islands) else 1
        self._labels = scenario.force_labels()
        self._sources = self._ledger_sources()
        self._ledger_columns = self._name_columns()

    def _populate(self, block: int | None) -> list[IndependentIsland | CoupledIsland]:
        emitters = [group for group in self.scenario.groups if isinstance(group, Emitter)]
        states: dict[str, GroupState] = {}
        first_id = 0
        for island in self.graph.islands:
            for group in island.groups:
                if not isinstance(group, Emitter):
                    states[group.name] = populate(self.scenario, island, group, 0)
        for group in self.scenario.particles:  # ids run through the groups in the scenario's order
            state = states[group.name]
            state.id[: state.count] += first_id
            first_id += state.count
        islands: list[IndependentIsland | CoupledIsland] = []
        for island in self.graph.islands:
            if island.coupled:
                islands.append(CoupledIsland(self.scenario, island, [states[g.name] for g in island.groups]))
                continue
            (group,) = island.groups
            # Emitters take ids in turn, so that an id says when and where a particle was born, not how runs are cut.
            births = (
                (first_id + emitters.index(group), len(emitters)) if isinstance(group, Emitter) else (0, 1)
            )
            state = states.get(group.name) or populate(self.scenario, island, group, 0)
            extra = {} if block is None else {"block": block}
            islands.append(IndependentIsland(self.scenario, island, state, births, **extra))
        return islands

    @property
    def islands(self) -> Sequence[IndependentIsland | CoupledIsland]:
        """What steps together, in the order of the graph's islands."""
        return self._islands

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.step * self._dt

    @property
    def count(self) -> int:
        """Particles alive."""
        return sum(state.count for state in self.states)

    def advance_to(self, step: int, between: Callable[[], None] | None = None) -> None:
        """Move on to the beginning of a step; `between` is called between the pieces of long intervals.

        Raises DivergenceError when a number stops being finite; the state is then that of the step's beginning for the
        particles concerned.
        """
        while self.step < step:
            self._kick()
            last = min([step, *(at for at, _ in self._kicks if at > self.step)])
            last = min(last, self.step + max(64 // self._own, PIECE // (max(self.count, 1) * self._own)))
            for island in self._islands:
                self._advance(island, self.step, last)
            self.step = last
            if between is not None and last < step:
                between()

    def _advance(self, island: IndependentIsland | CoupledIsland, first: int, last: int) -> None:
        while first < last:
            until = island.phase(first, last)
            born, deaths, fault = island.advance(first, until, self.team)
            if fault is not None:
                raise self._divergence(island, fault)
            self.particle_steps += sum(state.count for state in island.states) * (until - first)
            if born is not None and born.ids.size:
                self.events.births.append(born)
            if deaths is not None and deaths.ids.size:
                self.events.deaths.append(deaths)
            first = until

    def _kick(self) -> None:
        """Impulses that are due at the present step."""
        for at, k in self._kicks:
            if at == self.step:
                kick = self.scenario.impulses[k]
                for group, state in zip(self.scenario.groups, self.states, strict=True):
                    chosen = (
                        state.name in kick.on
                        if kick.on is not None
                        else group.dynamics.type == "second_order"
                    )
                    if chosen:
                        state.kick(kick.impulse)

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
        bonds = range(len(self.scenario.forces), len(self._labels))
        return (*MOTION, *(f"potential.{self._labels[k]}" for k in (*forces, *bonds)))

    def ledger_columns(self) -> tuple[str, ...]:
        """Names of the ledger's columns: motion, then the potential energy of every force that has one."""
        return self._ledger_columns

    def ledger(self) -> dict[str, float]:
        """Kinetic and potential energies [J], momentum [kg m/s] and angular momentum [kg m²/s] about the origin.

        Particles without inertia have potential energy only.
        """
        total = dict.fromkeys(self._ledger_columns, 0.0)
        columns = {
            state.name: c
            for island in self._islands
            for state, c in zip(island.states, island.columns(), strict=True)
        }
        for (forces, records), group in zip(self._sources, self.scenario.groups, strict=True):
            sums = measure(records, columns[group.name], self.time, self.team).tolist()
            if group.dynamics.type == "second_order":
                for key, value in zip(MOTION, sums, strict=False):
                    total[key] += value
            for k, value in zip(forces, sums[len(MOTION) :], strict=True):
                total[f"potential.{self._labels[k]}"] += value
        for island, structure in zip(self._islands, self.graph.islands, strict=True):
            if isinstance(island, CoupledIsland):
                energies = bond_energy(island.bonds, island.island_columns())
                for bonds, energy in zip(structure.bonds, energies, strict=True):
                    total[f"potential.{bonds.name}"] += energy
                for hinges, made in zip(structure.hinges, island.hinges, strict=True):
                    total[f"potential.{hinges.name}"] += float(sum_hinges(made, island.island_columns()))
        return total

    def broken(self) -> dict[str, tuple[int, int]]:
        """For every set of springs that can break: how many are broken, and how many there were."""
        found = {}
        for island, structure in zip(self._islands, self.graph.islands, strict=True):
            if isinstance(island, CoupledIsland):
                for bonds, made in zip(structure.bonds, island.bonds, strict=True):
                    if made.breaking is not None:
                        found[bonds.name] = (
                            int(np.isfinite(made.breaking.when).sum()),
                            made.i.size - made.holes.size,
                        )
        return found

    def topology(self) -> list[Topology]:
        """Springs by their names in the ledger, surfaces by the names of their groups; particles by their ids."""
        return topology(self.scenario, self.graph, self._islands, self.states)

    def broke(self) -> dict[str, NDArray[np.float64]]:
        """For every set of springs that can break: when each broke [s], infinity while it holds; in topology's order."""
        found = {}
        for island, structure in zip(self._islands, self.graph.islands, strict=True):
            if isinstance(island, CoupledIsland):
                for bonds, made in zip(structure.bonds, island.bonds, strict=True):
                    if made.breaking is not None:
                        found[bonds.name] = made.breaking.when[made.i >= 0]
        return found

    def forces_on(self, state: GroupState) -> NDArray[np.floating[Any]]:
        """Sum of all forces on every particle of a group [N], shape [n, 3]."""
        for island in self._islands:
            if any(member is state for member in island.states):
                names = [member.name for member in island.states]
                return island.forces(self.time)[:, rows(island.states)[names.index(state.name)]].T
        raise ValueError(f"{state.name} is no group of this simulation")

    def _divergence(self, island: IndependentIsland | CoupledIsland, fault: Fault) -> DivergenceError:
        """Which particle, when, where, and the force that did most."""
        state = island.states[fault.member]
        time = fault.step * self.scenario.grid.dt
        row = fault.row
        if fault.unsolved is not None:
            return _unsolved(fault.unsolved, time, f"particle {state.id[row]} of {state.name!r}")
        p = state.particle(row, time) if fault.stop is None else fault.stop.particle
        pulls: tuple[tuple[str, float], ...] = ()
        what = f"is no longer finite after the step from t = {time:.9g} s"
        hint = f"try a smaller step than dt = {self.scenario.grid.dt:.6g} s"
        if fault.stop is not None:
            what, hint = WHY[fault.stop.why]
            what = what.format(t=fault.stop.time, least=fault.stop.least)
            names = [bonds.name for bonds in self.graph.islands[self._islands.index(island)].bonds]
            pulls = tuple(zip(names, fault.stop.bonds, strict=False))
        situation = self._situation(state.name, p, pulls)
        return DivergenceError(f"particle {state.id[row]} of {state.name!r} {what}; it was {situation}", hint)

    def overflow(self, quantity: str) -> DivergenceError:
        """The error to raise when a quantity of the ledger is no longer finite: what the fastest particle does."""
        fastest = [(np.abs(s.v[:, : s.count]).max(axis=0), s) for s in self.states if s.count]
        speeds, state = max(fastest, key=lambda pair: pair[0].max())
        row = int(speeds.argmax())
        message = (
            f"the ledger's {quantity} is no longer finite at t = {self.time:.9g} s; particle {state.id[row]} of "
            f"{state.name!r} was {self._situation(state.name, state.particle(row, self.time))}"
        )
        hint = f"try a smaller step than dt = {self.scenario.grid.dt:.6g} s, or smaller forces"
        return DivergenceError(message, hint)

    def _situation(self, group_name: str, p: Particle, pulls: tuple[tuple[str, float], ...] = ()) -> str:
        """Where a particle is, how fast, and under which force; `pulls` are those of springs [N]."""
        where = (
            f"at ({p.x:.6g}, {p.y:.6g}, {p.z:.6g}) m with velocity ({p.vx:.6g}, {p.vy:.6g}, {p.vz:.6g}) m/s"
        )
        name, size = self._strongest(group_name, p)
        for spring, pull in pulls:
            if pull > size:
                name, size = spring, pull
        return (
            where if name is None else f"{where}, and the strongest force on it was {name} with {size:.6g} N"
        )

    def _strongest(self, group_name: str, p: Particle) -> tuple[str | None, float]:
        group = next(g for g in self.scenario.groups if g.name == group_name)
        best: tuple[str | None, float] = (None, -1.0)
        for label, law in zip(self._labels, self.scenario.forces, strict=False):
            if acts_on(law, group) and not law.on_surfaces:
                try:
                    with np.errstate(all="ignore"):
                        size = float(np.sqrt(np.square(np.array(force(law.record(), p), dtype=float)).sum()))
                except (ArithmeticError, ValueError):  # what compiled code answers with an infinity or a NaN
                    return label, float("nan")
                if not np.isfinite(size):
                    return label, size
                if size > best[1]:
                    best = (label, size)
        return best

    def close(self) -> None:
        """End the team of threads."""
        self.team.close()


def _unsolved(missed: Unsolved, time: float, particle: str) -> DivergenceError:
    """The error of an implicit step without a solution."""
    spent = f"{missed.iterations} Newton iterations"
    if missed.linear:
        spent += f" with {missed.linear} iterations of the linear solver"
    return DivergenceError(
        f"{missed.method} found no solution of the step from t = {time:.9g} s: after {spent} a residual of "
        f"{missed.residual:.3g} of the first was left, most of it at {particle}",
        "try a smaller dt, a larger tolerance, or more iterations",
    )


def rows(states: Sequence[GroupState]) -> list[slice]:
    """Rows of every group in a frame: groups follow each other."""
    ends = np.cumsum([0, *(state.count for state in states)]).tolist()
    return [slice(a, b) for a, b in pairwise(ends)]
