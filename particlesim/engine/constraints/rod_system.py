"""The rods of an island: which particles they join, how long they are, and whether the start fits them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.constraints.elimination import new_rig, new_rods
from particlesim.engine.constraints.initial_checks import (
    Members,
    members_of,
    require_motion,
    require_once,
    require_speed,
)
from particlesim.engine.constraints.shake_rattle import Rods, hold, places, take_aim
from particlesim.engine.faults import Unheld
from particlesim.engine.state.group_state import GroupState
from particlesim.errors import UsageError
from particlesim.graph.graph import Island
from particlesim.model.arrays import Ints
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology


class RodSystem:
    """All rods of an island: `rods` as kernels take them, `order` as the sets list them."""

    def __init__(self, members: Sequence[Members], offset: dict[str, int], rods: Rods, order: Ints) -> None:
        self.members = tuple(members)
        self.rods = rods
        self.order = order
        self._offset = offset

    @property
    def number(self) -> int:
        """How many rods there are."""
        return len(self.order)

    @property
    def pairs(self) -> tuple[Ints, Ints]:
        """Rows of the first and of the second ends of all rods, set by set."""
        first = np.concatenate([each.first for each in self.members])
        return first, np.concatenate([each.second for each in self.members])

    @property
    def ends(self) -> Ints:
        """Rows of all particles on rods, sorted."""
        return np.unique(np.concatenate(self.pairs))

    @property
    def components(self) -> int:
        """Sets of rods that hang together."""
        return len(self.rods.failed)

    @property
    def effort(self) -> float:
        """The energy that rods have given to led ends since `begin` [J]."""
        return float(self.rods.effort.sum())

    def unheld(self) -> Unheld | None:
        """The first rod that could not be held in the last steps."""
        bad = np.flatnonzero(self.rods.failed >= 0)
        if not bad.size:
            return None
        rod = int(self.order[self.rods.failed[bad[0]]])
        borders = np.cumsum([0, *(len(each.first) for each in self.members)])
        each = self.members[k := int(np.searchsorted(borders, rod, side="right")) - 1]
        rod -= int(borders[k])
        a, b = each.indices[rod].tolist()
        miss = float(self.rods.misfit[bad[0]])
        return Unheld(each.made.name, (a, b), each.made.groups, float(each.length[rod]), miss)

    def row_of(self, unheld: Unheld, free: NDArray[np.bool_]) -> int:
        """The row of an end of a rod in the island, one of the `free` ones."""
        rows = [self._offset[name] + k for name, k in zip(unheld.groups, unheld.particles, strict=True)]
        return next((row for row in rows if free[row]), rows[0])

    def lay_again(self, offset: dict[str, int], place: Ints) -> None:
        """The same rods among other rows: what was in row k is in row `place[k]` now, and groups begin at rows `offset`."""
        self._offset = offset
        self.members = tuple(
            replace(each, first=place[each.first], second=place[each.second]) for each in self.members
        )
        self.rods = self.rods._replace(rig=self.rods.rig._replace(rows=place[self.rods.rig.rows]))

    def begin(self) -> None:
        """Forget what earlier steps have left: rods that could not be held, and work on led ends."""
        self.rods.failed[:] = -1
        self.rods.effort[:] = 0

    def fit(self, columns: Any) -> None:
        """Bring particles to the nearest places and velocities that fit."""
        self.begin()
        take_aim(self.rods, places(columns))
        hold(self.rods, places(columns), 0.0, True)

    def topology(self, ids: Ints) -> list[Topology]:
        """The rods of every set as a trajectory keeps them; `ids` are those of the island's rows."""
        return [
            Topology(
                each.made.name,
                np.stack([ids[each.first], ids[each.second]], axis=1),
                each.length,
                np.full(len(each.length), np.inf),
            )
            for each in self.members
        ]


def rod_system(
    scenario: Scenario,
    island: Island,
    whole: GroupState,
    states: Sequence[GroupState],
    offset: dict[str, int],
) -> RodSystem | None:
    """The rods of an island, None where there are none. Its particles are put where they fit, and their velocities.

    `offset` are the first rows of its groups in `whole`. Raises UsageError (ScenarioError with the place, where that is
    known) when rods and the particles at the start do not go together.
    """
    if not island.rods:
        return None
    count = {state.name: state.count for state in states}
    members = [members_of(scenario, each, whole, count, offset) for each in island.rods]
    require_once(scenario, members)
    inverse = 1 / whole.mass[: whole.count].astype(float)
    if whole.clocked:
        inverse[np.isinf(whole.start[: whole.count])] = 0
    for each in members:
        require_motion(scenario, each, inverse)
        require_speed(scenario, each, whole)
    first, second, length = (
        np.concatenate([getattr(each, key) for each in members]) for key in ("first", "second", "length")
    )
    rig, order = new_rig(first, second, length, inverse)
    found = RodSystem(
        members, offset, new_rods(rig, eager=_eager(island), touched=any(island.colliders)), order
    )
    found.fit(whole.columns(frozenset()))
    if (bad := found.unheld()) is not None:
        a, b = bad.particles
        raise UsageError(
            f"{bad.name}: rods do not fit each other at the start; that between particles {a} and {b} misses its length "
            f"by {bad.misfit * bad.length:.3g} m",
            "give places that all lengths fit, or leave length out",
        )
    return found


def _eager(island: Island) -> bool:
    """Whether a force on the island depends on velocities."""
    return any(each.needs_velocity() for each in island.interactions) or any(
        force.needs_velocity() for forces in island.forces for force in forces
    )
