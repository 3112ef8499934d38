"""Particles and rigid bodies that touch each other: both are in islands of their own, and meet between steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.rigid.grains import Grains, Touches, exchange, find_touches, new_touches
from particlesim.engine.state.group_state import GroupState
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.reach import Meeting, meetings_of
from particlesim.scenario.scenario import Scenario

ROOM = 256
"""Contacts that there is room for at first."""


class Meetings:
    """All contacts of particles with bodies in a scenario.

    `known`: for every meeting the pairs that touched in the last step, the id of the particle and that of the body [2, n].
    """

    def __init__(
        self, scenario: Scenario, islands: Sequence[BaseIsland], states: Sequence[GroupState]
    ) -> None:
        self._meetings = meetings_of(scenario)
        self._by_name = {state.name: state for state in states}
        self._bodies = next((each for each in islands if isinstance(each, RigidIsland)), None)
        self._islands = islands
        self._touches = new_touches(ROOM)
        self.known: list[Ints] = [np.empty((2, 0), np.int64) for _ in self._meetings]

    def __bool__(self) -> bool:
        return bool(self._meetings)

    def exchange(self, dt: float) -> None:
        """Give the impulses of all contacts that there are now, or would be in the coming step."""
        for number, meeting in enumerate(self._meetings):
            self.known[number] = self._meet(meeting, self.known[number], dt)

    def _meet(self, meeting: Meeting, known: Ints, dt: float) -> Ints:
        assert self._bodies is not None
        state = self._by_name[meeting.particles]
        bodies, rows = self._bodies.bodies(), self._bodies.rows_of(meeting.bodies)
        grains = _grains_of(state)
        touches = self._found(bodies, rows, grains, dt)
        count = int(touches.number[0])
        if not count:
            return np.empty((2, 0), np.int64)
        ids = self._bodies.ids()
        pairs = np.stack([grains.id[touches.grain[:count]], ids[touches.body[:count]]])
        before = {(a, b) for a, b in known.T.tolist()}
        met = np.array([(a, b) in before for a, b in pairs.T.tolist()])
        exchange(bodies, grains, touches, met, meeting.restitution, *meeting.friction, dt)
        self._give_back(state, grains, touches)
        pressed = (touches.impulse[:count] != 0).any(axis=1)
        return np.ascontiguousarray(np.unique(pairs[:, pressed], axis=1))

    def _found(self, bodies: object, rows: tuple[int, int], grains: Grains, dt: float) -> Touches:
        """All contacts, with room for them."""
        while True:
            self._touches.number[:] = 0
            find_touches(bodies, *rows, grains, self._touches, dt)
            if not self._touches.number[1]:
                return self._touches
            self._touches = new_touches(2 * int(self._touches.number.sum()))

    def _give_back(self, state: GroupState, grains: Grains, touches: Touches) -> None:
        """Particles get their new places and velocities; methods that remember the velocity start anew."""
        rows = np.unique(touches.grain[: touches.number[0]])
        state.x[:, rows] = grains.x[:, rows]
        state.v[:, rows] = grains.v[:, rows]
        if len(state.memory):
            state.memory[-1, rows] = 0
        for island in self._islands:
            if any(each is state for each in island.states):
                island.fit()


def _grains_of(state: GroupState) -> Grains:
    """The particles of a group that are there; those that are held, or whose way has ended, do not move."""
    n = state.count
    weight: Floats = 1 / state.mass[:n].astype(float)
    if state.clocked:
        weight[~np.isfinite(state.start[:n])] = 0.0
    x, v = (np.ascontiguousarray(each[:, :n], float) for each in (state.x, state.v))
    return Grains(x.copy(), v.copy(), state.radius[:n].astype(float), weight, state.id[:n])
