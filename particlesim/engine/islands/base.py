"""The base of all islands: groups that step together, with their births and deaths.

Births and deaths belong to intervals, not to steps. Particles that are born in an interval are appended at its beginning,
with clocks that start later; dead particles are removed at its end. In between, kernels skip particles that are not born yet
or dead (`engine.state.columns.Clock`). An interval is cut short where births wait for deaths, or where work enters the
ledger.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders import Collider
from particlesim.emitters import Emitter
from particlesim.engine.constraints.constraint import Constraint
from particlesim.engine.faults import Fault
from particlesim.engine.islands.births import Births, Source
from particlesim.engine.islands.laps import Laps
from particlesim.engine.ledger.sums import measure
from particlesim.engine.ledger.work import Books
from particlesim.engine.state.columns import Columns
from particlesim.engine.state.group_state import Deaths, GroupState
from particlesim.engine.state.table import HEARD
from particlesim.engine.step.step_size import RESOLVED
from particlesim.forces import Force
from particlesim.graph.graph import Island
from particlesim.groups.group import Group
from particlesim.integrators import EmbeddedRungeKutta, GaussRadauMethod, Method
from particlesim.interactions import PairSet
from particlesim.model.arrays import Floats, Ints
from particlesim.process.threads import Team
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

WORTH_THREADS = 500_000
"""Particle-steps, or spring-steps, below which one thread is faster than waking others."""

OWN_STEPS = 20
"""Steps that an adaptive method is taken to need for one of the grid, when work is shared out."""

Look = Callable[[int], None]
"""What looks at an island between two steps; it is told how many have been made since the start of the run."""


class Intrusion(NamedTuple):
    """A body, by its group and its number there, that is inside of a collider or of another body, and how deep [m]."""

    body: tuple[str, int]
    other: Collider | tuple[str, int]
    depth: float


class BaseIsland:
    """Groups that step together. `ids` are, for every emitter, the id of its first particle and the distance to the next."""

    names: tuple[str, ...] = ()
    """Names of the interactions in the ledger."""
    kept_from: int | None = None
    """The step at which the state was last kept (`keep`); None for islands that can do without."""

    def __init__(
        self,
        scenario: Scenario,
        structure: Island,
        states: Sequence[GroupState],
        ids: Mapping[str, tuple[int, int]],
    ) -> None:
        self.dt = scenario.grid.dt
        self.states = list(states)
        self._method = structure.method
        self._sources = [
            Source(scenario, group, ids[group.name]) if isinstance(group, Emitter) else None
            for group in structure.groups
        ]
        read = (
            attributes_read(*each)
            for each in zip(structure.forces, structure.colliders, structure.groups, strict=True)
        )
        pairs = (each.law.needs() for each in structure.interactions if isinstance(each, PairSet))
        self._read = frozenset[str]().union(*read, *pairs)
        self.impacts: dict[str, NDArray[np.float64]] = {}
        self.books = Books(scenario, structure, states[0].dtype) if scenario.output.work else None

    @property
    def interactions(self) -> tuple[Any, ...]:
        """The interactions between its particles."""
        return ()

    @property
    def constraint(self) -> Constraint | None:
        """The constraint on its particles, None without one."""
        return None

    def phase(self, first: int, last: int) -> int:
        """How far steps may go from `first` towards `last` in one piece."""
        waits = self.books is not None or any(each is not None and each.waits for each in self._sources)
        return min(first + 1, last) if waits else last

    def begin(self, team: Team) -> None:
        """Let interactions measure what they need before the first step. Raises UsageError where a requested accuracy cannot
        be reached."""

    def refuse_wild(self, time: float) -> None:
        """Raise UsageError, which names both, for two particles that have no force or energy where they are."""

    @property
    def makes_laps(self) -> bool:
        """Whether steps in laps, one after the other in one call of `advance`, save time."""
        return False

    def advance(
        self, first: int, last: int, team: Team, laps: Laps | None = None, look: Look | None = None
    ) -> tuple[Births | None, Deaths | None, Fault | None]:
        """Steps first … last − 1: births, motion, deaths. `laps` are for those that make them; `look` is told the step where
        steps pause, as they take long: it may look at what there is, and raise what ends the run."""
        raise NotImplementedError

    def _emit(self, first: int, last: int) -> Births | None:
        """Births in steps first … last − 1; groups must have room for them. None without emitters."""
        born = [
            source.emit(state, first * self.dt, last * self.dt)
            for source, state in zip(self._sources, self.states, strict=True)
            if source is not None
        ]
        if not born:
            return None
        return Births(
            np.concatenate([each.ids for each in born]), np.concatenate([each.times for each in born])
        )

    def _due(self, last: int) -> list[int]:
        """How many particles every group gets before a step."""
        return [
            0 if source is None else source.due(state, last * self.dt)
            for source, state in zip(self._sources, self.states, strict=True)
        ]

    def meets_bodies(self, name: str) -> bool:
        """Whether impacts on rigid bodies of particles of a group that come far in a step may be left to their own step."""
        return False

    def keeps_out_of_bodies(self) -> bool:
        """Whether its own contacts put particles out of bodies that have come deep into these in their step."""
        return False

    def leave(self, name: str, guests: Ints, left: Ints) -> None:
        """Learn which particles of a group have been guests among bodies, and whose impacts on bodies are left to the step
        that comes."""

    def _gather(self) -> None:
        """Keep the impacts of the steps just made for emitters that react to them, also those of particles that died."""
        if any(HEARD in state.parts for state in self.states):
            self.impacts = {state.name: state.take_impacts() for state in self.states}

    def hear(
        self,
        impacts: Mapping[str, NDArray[np.float64]],
        numbers: Mapping[str, int],
        codes: Mapping[str, int],
    ) -> None:
        """Let emitters know of the impacts of groups in the step that comes; `numbers` are those of colliders, `codes` those
        of groups by name."""
        for source in self._sources:
            if source is not None and source.emitter.on_impact is not None:
                source.hear(impacts, numbers, codes)

    @property
    def listens_to(self) -> frozenset[str]:
        """Groups whose impacts its emitters hear."""
        events = (source.emitter.on_impact for source in self._sources if source is not None)
        return frozenset(name for event in events if event is not None for name in event.of)

    def columns(self) -> list[Columns]:
        """Columns of every group of the island."""
        raise NotImplementedError

    def island_columns(self) -> Columns:
        """Columns of the whole island."""
        raise NotImplementedError

    def intrusions(self) -> list[Intrusion]:
        """Bodies that are now inside of colliders or of each other by more than a little, the deepest first."""
        return []

    def crammed(self) -> Intrusion | None:
        """A body that no shift brings out of colliders."""
        return None

    def longest_step(self) -> float:
        """The largest stable step under springs at bodies [s]."""
        return math.inf

    def longest_step_on_orbits(self) -> float:
        """The longest step of a method that follows orbits [s]."""
        return math.inf

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        """Total force on every particle at a time [N], shape [3, n]."""
        raise NotImplementedError

    def forces_on_tied(self, time: float) -> dict[str, tuple[Ints, Floats]]:
        """Forces of its springs on particles of other islands: of every group the rows, and the forces [N], shape [n, 3]."""
        return {}

    def turning(self) -> NDArray[np.float64]:
        """Angular velocities [rad/s], shape [3, n]; particles do not turn."""
        return np.zeros((3, sum(state.count for state in self.states)))

    def sums(self, member: int, records: tuple[Any, ...], time: float, team: Team) -> NDArray[np.float64]:
        """Of a group: kinetic energy [J], momentum [kg m/s], angular momentum [kg m²/s], kinetic energy of rotation [J], and
        the potential energy of each of some laws [J]."""
        return measure(records, self.columns()[member], time, team)

    def stored(self) -> dict[str, float]:
        """Potential energies [J] between its members other than those of interactions, by names in the ledger."""
        return {}

    def broke(self) -> dict[str, NDArray[np.float64]]:
        """For every set of springs that can break: when each broke [s], infinity while it holds; in topology's order."""
        return {
            name: each.broke
            for name, each in zip(self.names, self.interactions, strict=True)
            if each.broke is not None
        }

    def stopped_grains(self) -> int:
        """How often a hard grain had more impacts in a step than are followed."""
        return sum(each.stopped for each in self.interactions)

    def stopped_bodies(self) -> int:
        """How often a rigid body had more impacts than are followed."""
        return 0

    def kept_back(self) -> int:
        """How often a particle on a rod to a body stayed where it was for a step, not to pass a collider."""
        return 0

    def topology(self) -> list[Topology]:
        """The springs, rods and surfaces of its particles, for a trajectory."""
        raise NotImplementedError

    def keep(self, first: int, *, fresh: bool = True) -> None:
        """Keep the state at the beginning of a piece of an interval, to search for the first sign of a divergence in it.
        Where it is `fresh`, a run may be resumed."""
        raise NotImplementedError

    def replay(self, row: int, first: int, steps: int) -> tuple[Columns, tuple[Any, ...], slice]:
        """Particle `row` and those that step with it some steps after `first`, where an interval began; their interactions,
        and which rows these are. Nothing of the island changes."""
        raise NotImplementedError

    def stopped(self, row: int, first: int, steps: int) -> tuple[Columns, tuple[Any, ...], slice]:
        """As `replay`, for particles whose own steps could not go on."""
        return self.replay(row, first, steps)

    def recall(self) -> None:
        """Let it know that what steps change has been set to what it was at another time, as in a checkpoint."""

    def go_back(self) -> None:
        """Return to the beginning of the last interval, if the state then was kept."""

    def resettle(self, ids: Ints) -> None:
        """Fit everything else to groups that have got other particles than those with these ids, as from a checkpoint."""

    def fit(self) -> None:
        """Bring particles to where constraints want them, after something has changed them from outside."""


def shortest_step(method: Method, time: float) -> float:
    """The shortest step of an adaptive method before a time [s]: what is asked for, or what the clock resolves."""
    assert isinstance(method, EmbeddedRungeKutta | GaussRadauMethod)
    return max(method.minimum_step or 0.0, RESOLVED * time)


def attributes_read(forces: Sequence[Force], colliders: Sequence[Collider], group: Group) -> frozenset[str]:
    """Attributes of a group that a kernel must read: those of its laws, and radii where colliders hold back particles that
    have a size."""
    read = frozenset[str]().union(*(force.needs() for force in forces))
    return read | {"radius"} if colliders and group.may_have("radius") else read
