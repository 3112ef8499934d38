"""The rods of an island: which particles they join, how long they are, and whether the start fits them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from particlesim.engine.constraints.constraint import Constraint
from particlesim.engine.constraints.elimination import divided, new_rig, new_rods
from particlesim.engine.constraints.initial_checks import (
    Members,
    members_of,
    require_motion,
    require_once,
    require_speed,
)
from particlesim.engine.constraints.rod_modes import RodTensors, directions, pulls
from particlesim.engine.constraints.shake_rattle import Rods, hold, places, take_aim
from particlesim.engine.faults import Unheld
from particlesim.engine.interactions.coupling import Coupling
from particlesim.engine.interactions.interaction import Site
from particlesim.errors import UsageError
from particlesim.graph.graph import Island
from particlesim.model.arrays import Floats, Ints
from particlesim.trajectory.topology import Topology

ROD_IN_SPRINGS = 20
"""About how many springs take the time of a rod."""


class RodSystem(Constraint):
    """All rods of an island: `rods` as kernels take them, `order` as the sets list them."""

    def __init__(self, members: Sequence[Members], rods: Rods, order: Ints) -> None:
        self.members = tuple(members)
        self.rods = rods
        self.order = order

    @property
    def number(self) -> int:
        return len(self.order)

    @property
    def effort(self) -> int:
        return ROD_IN_SPRINGS * self.number if len(self.rods.failed) > 1 else 0

    @property
    def given(self) -> float:
        return float(self.rods.effort.sum())

    @property
    def ends(self) -> Ints:
        return np.unique(np.concatenate(self._pairs))

    @property
    def _pairs(self) -> tuple[Ints, Ints]:
        """Rows of the first and of the second ends of all rods, set by set."""
        first = np.concatenate([each.first for each in self.members])
        return first, np.concatenate([each.second for each in self.members])

    def records(self, threads: int) -> list[Rods]:
        return divided(self.rods, threads)

    def unheld(self, site: Site) -> tuple[int, Unheld] | None:
        bad = np.flatnonzero(self.rods.failed >= 0)
        if not bad.size:
            return None
        rod = int(self.order[self.rods.failed[bad[0]]])
        borders = np.cumsum([0, *(len(each.first) for each in self.members)])
        each = self.members[k := int(np.searchsorted(borders, rod, side="right")) - 1]
        rod -= int(borders[k])
        a, b = each.indices[rod].tolist()
        miss, rows = float(self.rods.misfit[bad[0]]), (int(each.first[rod]), int(each.second[rod]))
        pinned = site.pinned()
        row = next((row for row in rows if not pinned[row]), rows[0])
        return row, Unheld(each.made.name, (a, b), each.made.groups, float(each.length[rod]), miss)

    def lay_again(self, site: Site, place: Ints) -> None:
        self.members = tuple(
            replace(each, first=place[each.first], second=place[each.second]) for each in self.members
        )
        self.rods = self.rods._replace(rig=self.rods.rig._replace(rows=place[self.rods.rig.rows]))

    def begin(self) -> None:
        self.rods.failed[:] = -1
        self.rods.effort[:] = 0

    def fit(self, columns: Any) -> None:
        self.begin()
        take_aim(self.rods, places(columns))
        hold(self.rods, places(columns), 0.0, True)

    def topology(self, ids: Ints) -> list[Topology]:
        return [
            Topology(
                each.made.name,
                np.stack([ids[each.first], ids[each.second]], axis=1),
                each.length,
                np.full(len(each.length), np.inf),
            )
            for each in self.members
        ]

    def couplings(self, columns: Any, force: Floats, w: Floats) -> Iterator[tuple[str, Coupling]]:
        pull = pulls(self._pairs, self.rods.rig, self.order, columns, force, w)
        begin = 0
        for each in self.members:
            end = begin + len(each.first)
            yield each.made.name, RodTensors(each.first, each.second, pull[begin:end])
            begin = end

    def directions(self, x: Floats) -> Any:
        return directions(self._pairs, x)


def rod_system(site: Site, island: Island) -> RodSystem:
    """The rods of an island. Its particles are put where they fit, and their velocities.

    Raises UsageError (ScenarioError with the place, where that is known) when rods and the particles at the start do not go
    together.
    """
    scenario, whole = site.scenario, site.whole
    count = {name: state.count for name, state in site.state.items()}
    members = [members_of(scenario, each, whole, count, site.offset) for each in island.constraints]
    require_once(scenario, members)
    inverse = site.inverse_mass()
    for each in members:
        require_motion(scenario, each, inverse)
        require_speed(scenario, each, whole)
    first, second, length = (
        np.concatenate([getattr(each, key) for each in members]) for key in ("first", "second", "length")
    )
    rig, order = new_rig(first, second, length, inverse)
    found = RodSystem(members, new_rods(rig, eager=_eager(island), touched=any(island.colliders)), order)
    found.fit(whole.columns(frozenset()))
    if (missed := found.unheld(site)) is not None:
        bad = missed[1]
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
