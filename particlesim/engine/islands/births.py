"""Births: which particles of an emitter are due, and their columns when they are born."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from particlesim.emitters import Emitter, Schedule
from particlesim.emitters.emitter import Impacts
from particlesim.engine.state.group_state import AGE, COLD, RECYCLED, GroupState
from particlesim.engine.state.table import HIT
from particlesim.scenario.scenario import Scenario

SPEED, COLLIDER, PLACE, OTHER = (HIT.index(name) for name in ("speed", "collider", "x", "other"))


@dataclass
class Births:
    """Particles born in an interval: ids, times [s]."""

    ids: NDArray[np.int64]
    times: NDArray[np.float64]


class Source:
    """Gives birth to the particles of an emitter. `ids` are the id of the first and the distance to the next."""

    def __init__(self, scenario: Scenario, emitter: Emitter, ids: tuple[int, int]) -> None:
        self.emitter = emitter
        self.streams = scenario.streams(emitter)
        self.schedule = Schedule(emitter, self.streams)
        self.first_id, self.stride = ids
        self.born = 0
        self.heard: Impacts | None = None
        """Impacts of the present step that give birth in it."""
        self.waits = emitter.limit is not None and emitter.when_full == "wait"

    def hear(
        self,
        impacts: Mapping[str, NDArray[np.float64]],
        numbers: Mapping[str, int],
        codes: Mapping[str, int],
    ) -> None:
        """Impacts of groups in the present step, by the rows of `table.HIT` with radius and id, which give birth in it;
        `numbers` are those of colliders and `codes` those of groups, by name."""
        event = self.emitter.on_impact
        assert event is not None
        some = np.concatenate([impacts[name] for name in event.of if name in impacts], axis=1)
        met = some[COLLIDER]
        places = None if event.at is None else [numbers[name] for name in event.at]
        chosen = (met >= 0) & (event.against is None if places is None else np.isin(met, places))
        chosen |= np.isin(met, [codes[name] for name in event.against or ()])
        some = once_each(some[:, chosen & (some[SPEED] >= event.above)])
        some = some[:, np.lexsort((some[-1], some[0]))].repeat(event.count, axis=1)
        place, normal, velocity = (
            some[PLACE : PLACE + 3],
            some[PLACE + 3 : PLACE + 6],
            some[PLACE + 6 : PLACE + 9],
        )
        self.heard = Impacts(some[0], place - some[-2] * normal, normal, velocity)

    def due(self, state: GroupState, end: float) -> int:
        """How many are to be born before `end`."""
        if self.heard is not None:
            return self.heard.times.size
        due = self.schedule.before(end)
        if self.waits and self.emitter.limit is not None:
            due = min(due, self.born + self.emitter.limit - state.count)
        return max(due - self.born, 0)

    def emit(self, state: GroupState, begin: float, end: float) -> Births:
        """Births due before `end`; appended to the group, which has room for them, with their clocks set."""
        first, count = self.born, self.due(state, end)
        heard, self.heard = self.heard, None
        times = self.schedule.times(first, first + count) if heard is None else heard.times
        if self.waits:
            times = np.maximum(times, begin)  # those that had to wait are born now
        ids = self.first_id + self.stride * np.arange(first, first + count)
        if count:
            self._append(state, first, times, ids, heard)
            self.born += count
        if self.emitter.limit is not None and not self.waits:
            self._recycle(state)
        return Births(ids, times)

    def _append(
        self,
        state: GroupState,
        first: int,
        times: NDArray[np.float64],
        ids: NDArray[np.int64],
        heard: Impacts | None,
    ) -> None:
        new = slice(state.count, state.count + len(times))
        if heard is None:
            born = self.emitter.births(self.streams, first, times)
        else:
            born = self.emitter.births_of(self.streams, first, heard)
        state.x[:, new] = born.position
        state.v[:, new] = born.velocity
        for name, values in born.attributes.items():
            state.assign(name, new, values)
        state.id[new] = ids
        state.birth[new] = state.start[new] = times
        state.outcome[new] = 0
        state.memory[:, new] = 0
        for counted in (state.missed, state.exhausted, state.held):  # where others have been before
            counted[..., new] = 0
        stop, cause = times + born.lifetime, np.full(len(times), AGE, np.uint8)
        if "temperature" in born.attributes:
            cold = times + self._cooling_time(born.attributes["temperature"])
            cause[cold < stop] = COLD
            stop = np.minimum(stop, cold)
        state.stop[new], state.cause[new] = stop, cause
        state.count = new.stop

    def _cooling_time(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        """How long particles take to cool below the temperature at which they die [s]."""
        emitter = self.emitter
        below = emitter.die.temperature_below if emitter.die is not None else None
        if below is None or emitter.cooling is None:
            return np.full(len(temperature), np.inf)
        ratio = (temperature - emitter.cooling.ambient) / (below - emitter.cooling.ambient)
        return np.asarray(np.log(np.maximum(ratio, 1.0)) / emitter.cooling.rate)

    def _recycle(self, state: GroupState) -> None:
        """The slot of particle k goes to particle k + limit: its life ends at that one's birth."""
        n, limit = state.count, self.emitter.limit or 0
        number = (state.id[:n] - self.first_id) // self.stride
        successor = np.searchsorted(number, number + limit)
        taken = np.flatnonzero(successor < n)
        taken = taken[number[successor[taken]] == number[taken] + limit]
        ends = state.birth[:n][successor[taken]]
        earlier = ends < state.stop[:n][taken]
        state.stop[:n][taken[earlier]] = ends[earlier]
        state.cause[:n][taken[earlier]] = RECYCLED


def once_each(impacts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Impacts without the second of each two that are the same, told by both particles: that of the higher id goes."""
    mine, other, time = impacts[-1], impacts[OTHER], impacts[0]
    both = {(t, i, j) for t, i, j in zip(time, mine, other, strict=True) if 0 <= i < j}
    twice = [j < i and (t, j, i) in both for t, i, j in zip(time, mine, other, strict=True)]
    return impacts[:, ~np.array(twice, bool)]
