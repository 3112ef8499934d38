"""Particles and rigid bodies that touch each other, or that springs join: islands of their own, whose particles are guests
among the bodies for a step (`engine.rigid.grains`, `engine.rigid.ties`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import SPIN
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.reach import meetings_of
from particlesim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from particlesim.engine.islands.rigid import RigidIsland

# What steps bodies is imported where there are some.


class Surfaces(NamedTuple):
    """What contact of a group of particles does, by group of bodies [groups]: whether they touch, restitution, static and
    kinetic friction."""

    touch: Floats
    restitution: Floats
    static: Floats
    kinetic: Floats


class Meetings:
    """All contacts of particles with bodies in a scenario, and springs from ones to the others."""

    def __init__(
        self, scenario: Scenario, islands: Sequence[BaseIsland], states: Sequence[GroupState]
    ) -> None:
        self._dt = scenario.grid.dt
        self._bodies = _bodies_among(islands) if scenario.bodies else None
        self._islands = {
            state.name: island for island in islands for state in island.states if island is not self._bodies
        }
        self._surfaces: dict[str, Surfaces] = {}
        self._states: list[GroupState] = []
        names = [state.name for state in self._bodies.states] if self._bodies is not None else []
        for each in meetings_of(scenario):
            if each.particles not in self._surfaces:
                self._surfaces[each.particles] = Surfaces(*np.zeros((4, len(names))))
                self._states.append(next(state for state in states if state.name == each.particles))
            for column, value in zip(
                self._surfaces[each.particles], (1.0, each.restitution, *each.friction), strict=True
            ):
                column[names.index(each.bodies)] = value
        self._tied = {} if self._bodies is None else self._bodies.ties.rows
        for name in self._tied:
            if name not in self._surfaces:
                self._surfaces[name] = Surfaces(*np.zeros((4, len(names))))
                self._states.append(next(state for state in states if state.name == name))
        self._rows: list[Ints] = []

    def __bool__(self) -> bool:
        return bool(self._states)

    def concern(self, island: BaseIsland) -> bool:
        """Whether an island is that of the bodies which particles touch or are tied to."""
        return bool(self._states) and island is self._bodies

    def invite(self) -> None:
        """Before bodies make a step: particles that may touch them in it, or are tied to them, are their guests."""
        from particlesim.engine.rigid.grains import near_bodies
        from particlesim.engine.rigid.visit import among

        assert self._bodies is not None
        bodies, self._rows = self._bodies.bodies(), []
        for state in self._states:
            n = state.count
            x, v = (np.ascontiguousarray(each[:, :n], float) for each in (state.x, state.v))
            radius, near = state.radius[:n].astype(float), np.zeros(n, np.int64)
            touch = self._surfaces[state.name].touch
            if touch.any():
                near_bodies(bodies, touch, x, v, radius, self._dt, near)
            near[self._tied.get(state.name, [])] = 1
            self._rows.append(np.flatnonzero(near))
        surfaces = np.array([np.array(each) for each in self._surfaces.values()]).transpose(1, 0, 2)
        chosen = list(zip(self._states, self._rows, strict=True))
        self._bodies.visitors = among(chosen, np.ascontiguousarray(surfaces), self._bodies.ties.lean(chosen))

    def dismiss(self) -> None:
        """After it: particles get their new velocities, and methods that remember the old ones start anew."""
        assert self._bodies is not None
        after = self._bodies.left
        self._bodies.visitors = None
        first = 0
        for state, rows in zip(self._states, self._rows, strict=True):
            part = slice(first, first + len(rows))
            first += len(rows)
            changed = after.moved[part]
            rows = rows[changed]
            state.x[:, rows] += after.shift[:, part][:, changed].astype(state.dtype)
            state.v[:, rows] = after.v[:, part][:, changed]
            if SPIN in state.parts:
                state.angular_velocity[:, rows] = after.turning[:, part][:, changed]
            if len(state.memory):
                state.memory[-1, rows] = 0
            if len(rows):
                self._islands[state.name].fit()
        self._bodies.ties.remember()


def _bodies_among(islands: Sequence[BaseIsland]) -> RigidIsland:
    from particlesim.engine.islands.rigid import RigidIsland

    return next(each for each in islands if isinstance(each, RigidIsland))
