"""A world: a scenario, its graph, its islands, the states of its groups, and the time they have reached.

Modules that read particles without moving them, such as stability and diagnosis, take a `World`; `engine/simulation.py`
advances one.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from particlesim.emitters import Emitter
from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.islands.independent import IndependentIsland
from particlesim.engine.islands.initial import populate
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import SPIN
from particlesim.engine.topology import topology
from particlesim.graph.graph import Graph, build_graph
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

if TYPE_CHECKING:
    from particlesim.engine.islands.rigid import RigidIsland
    from particlesim.engine.islands.separation import Separation

# What steps particles that act on each other, and rigid bodies, is imported where there are some.


class World:
    """The particles of a scenario at one time, at first as they are laid out.

    `islands` are what steps together, in the order of the graph's islands; `states` are those of the scenario's groups, in
    its order; `step` is the number of steps that have been made. `block` is the number of particles that step together in
    cache; results do not depend on it.
    Raises UsageError when a file that the scenario names cannot be read.
    """

    def __init__(self, scenario: Scenario, *, block: int | None = None) -> None:
        self.scenario, self.grid = scenario, scenario.grid
        self.graph: Graph = build_graph(scenario)
        self.step = 0
        self.separations: list[Separation] = []
        self.islands = self._populate(block)
        by_name = {state.name: state for island in self.islands for state in island.states}
        self.states: list[GroupState] = [by_name[group.name] for group in scenario.groups]

    def _populate(self, block: int | None) -> list[BaseIsland]:
        emitters = [group for group in self.scenario.groups if isinstance(group, Emitter)]
        states: dict[str, GroupState] = {}
        first_id = 0
        for island in self.graph.islands:
            for group in island.groups:
                if not isinstance(group, Emitter):
                    states[group.name] = populate(self.scenario, island, group)
        # Ids run through the groups in the scenario's order.
        for group in (*self.scenario.particles, *self.scenario.bodies):
            state = states[group.name]
            state.id[: state.count] += first_id
            first_id += state.count
        # Emitters take ids in turn, so that an id says when and where a particle was born, not how runs are cut.
        ids = {group.name: (first_id + k, len(emitters)) for k, group in enumerate(emitters)}
        laid_out = {group.name for group in self.scenario.particles}
        others = {name: state for name, state in states.items() if name in laid_out}
        extra = {} if block is None else {"block": block}
        made: dict[int, BaseIsland] = {}
        bodies: RigidIsland | None = None
        for k in sorted(range(len(self.graph.islands)), key=lambda k: not self.graph.islands[k].rigid):
            island = self.graph.islands[k]
            mine = [
                states.get(group.name) or populate(self.scenario, island, group) for group in island.groups
            ]
            if island.coupled:
                from particlesim.engine.islands.separation import separate

                self.separations += separate(island, mine, self.scenario.simulation.box)
            if island.rigid:
                from particlesim.engine.islands.rigid import RigidIsland

                made[k] = bodies = RigidIsland(self.scenario, island, mine, ids, others)
            elif island.coupled:
                from particlesim.engine.islands.coupled import CoupledIsland

                made[k] = CoupledIsland(self.scenario, island, mine, ids, bodies)
            else:
                made[k] = IndependentIsland(self.scenario, island, mine, ids, **extra)
        return [made[k] for k in range(len(made))]

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.step * self.grid.dt

    @property
    def count(self) -> int:
        """Particles alive."""
        return sum(state.count for state in self.states)

    def broken(self) -> dict[str, tuple[int, int]]:
        """For every set of springs that can break: how many are broken, and how many there were."""
        return {name: (int(np.isfinite(when).sum()), len(when)) for name, when in self.broke().items()}

    def exhausted_steps(self) -> int:
        """In how many steps of one particle each there were more impacts than are followed."""
        return sum(state.exhausted_steps() for state in self.states)

    def stopped_grains(self) -> int:
        """How often a hard grain had more impacts in a step than are followed."""
        return sum(island.stopped_grains() for island in self.islands)

    def stopped_bodies(self) -> int:
        """How often a rigid body had more impacts in half a step than are followed."""
        return sum(island.stopped_bodies() for island in self.islands)

    def kept_back(self) -> int:
        """How often a particle on a rod to a body stayed where it was for a step, not to pass a collider."""
        return sum(island.kept_back() for island in self.islands)

    def methods(self) -> dict[str, str]:
        """How the forces of interactions are summed, by their names in the ledger, where there is something to tell."""
        return {
            name: told
            for island in self.islands
            for name, each in zip(island.names, island.interactions, strict=True)
            if (told := each.summary()) is not None
        }

    def topology(self) -> list[Topology]:
        """Springs by their names in the ledger, surfaces by the names of their groups; particles by their ids."""
        return topology(self.scenario, self.islands, self.states)

    def broke(self) -> dict[str, NDArray[np.float64]]:
        """For every set of springs that can break: when each broke [s], infinity while it holds; in topology's order."""
        return {name: when for island in self.islands for name, when in island.broke().items()}

    def turning(self, state: GroupState) -> NDArray[np.float64]:
        """Angular velocities of the bodies or grains of a group [rad/s], shape [n, 3]; 0 of particles that do not turn."""
        if SPIN in state.parts:
            return state.angular_velocity[:, : state.count].T.astype(float)
        for island in self.islands:
            for member, part in zip(island.states, rows(island.states), strict=True):
                if member is state:
                    return island.turning()[:, part].T
        raise ValueError(f"{state.name} is no group of this simulation")

    def forces_on(self, state: GroupState) -> NDArray[np.floating[Any]]:
        """Sum of all forces on every particle of a group [N], shape [n, 3]."""
        for island in self.islands:
            if any(member is state for member in island.states):
                names = [member.name for member in island.states]
                found = island.forces(self.time)[:, rows(island.states)[names.index(state.name)]].T
                return self._with_ties(state.name, found)
        raise ValueError(f"{state.name} is no group of this simulation")

    def _with_ties(self, name: str, forces: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
        """The forces on a group with those of springs that tie some of its particles to bodies."""
        for island in self.islands:
            if (tied := island.forces_on_tied(self.time).get(name)) is not None:
                forces = forces.copy()
                forces[tied[0]] += tied[1]
        return forces


def rows(states: Sequence[GroupState]) -> list[slice]:
    """Rows of every group in a frame: groups follow each other."""
    ends = np.cumsum([0, *(state.count for state in states)]).tolist()
    return [slice(a, b) for a, b in pairwise(ends)]
