"""Groups that step together, as contiguous parts of one set of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from particlesim.engine.state.columns import Columns, block_of
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.prescribed import Driven
from particlesim.model.arrays import Floats, Ints

NEAR = 1e-6
"""Part of a grid step that is not worth a step of its own."""


class Joined:
    """The groups of an island in one set of arrays, one after the other without gaps; the groups become views of it.

    Whenever a group gets or loses particles, all are copied into new arrays: a few milliseconds for 50 000.
    """

    def __init__(self, states: Sequence[GroupState]) -> None:
        self.states = list(states)
        self.whole: GroupState
        self._cut: tuple[Columns, list[int], list[Columns]] | None = None
        self._join([0] * len(self.states))

    @property
    def bounds(self) -> list[int]:
        """The borders of the groups' rows."""
        return np.cumsum([0, *(state.count for state in self.states)]).tolist()

    @property
    def driven(self) -> tuple[Driven, ...]:
        """The led particles of all groups by their rows in the island."""
        return tuple(
            each._replace(rows=each.rows + first)
            for first, state in zip(self.bounds, self.states, strict=False)
            for each in state.driven
        )

    def member_of(self, row: int) -> tuple[int, int]:
        """The group that a row belongs to, and which of its particles it is."""
        bounds = self.bounds
        member = int(np.searchsorted(bounds, row, side="right")) - 1
        return member, row - bounds[member]

    def rows_of(self, ids: Ints) -> Ints:
        """The rows of particles with some ids, −1 of those that are not there."""
        now = self.whole.id[: self.whole.count]
        if not now.size:
            return np.full(len(ids), -1)
        order = np.argsort(now)
        at = np.minimum(np.searchsorted(now, ids, sorter=order), now.size - 1)
        return np.where(now[order[at]] == ids, order[at], -1)

    def events(self, dt: float) -> Floats:
        """When particles are born, or will die of what is known beforehand [s], sorted; a part NEAR of dt from a multiple of
        dt counts as there, and from the one before as none."""
        n = self.whole.count
        times = np.concatenate([self.whole.start[:n], self.whole.stop[:n]])
        times = times[np.isfinite(times)]
        whole = np.round(times / dt)
        times = np.unique(np.where(np.abs(times / dt - whole) <= NEAR, whole * dt, times))
        return times[np.diff(times, prepend=-np.inf) > NEAR * dt]

    def cut(self, whole: Columns) -> list[Columns]:
        """Columns of the island cut into those of its groups: the same tuples, which kernels know, when they come again."""
        bounds = self.bounds
        if self._cut is None or self._cut[0] is not whole or self._cut[1] != bounds:
            self._cut = whole, bounds, [block_of(whole, a, b) for a, b in pairwise(bounds)]
        return self._cut[2]

    def make_room(self, more: Sequence[int]) -> Ints:
        """Room for more particles behind those of every group, which are about to be born. Returns the new row of each."""
        place = np.concatenate(
            [
                np.arange(a, b) + shift
                for (a, b), shift in zip(pairwise(self.bounds), np.cumsum([0, *more]).tolist(), strict=False)
            ]
        )
        self._join(more)
        return place

    def close_ranks(self) -> None:
        """One set of arrays again, after groups have lost particles."""
        self._join([0] * len(self.states))

    def _join(self, more: Sequence[int]) -> None:
        first = self.states[0]
        sizes = [state.count + room for state, room in zip(self.states, more, strict=True)]
        whole = GroupState(
            first.name,
            sum(sizes),
            dtype=first.dtype,
            memory=len(first.memory),
            parts=frozenset[str]().union(*(state.parts for state in self.states)),
        )
        whole.count = sum(sizes)
        if whole.clocked:
            whole.stop[:] = np.inf
        end = 0
        for state, size in zip(self.states, sizes, strict=True):
            part = slice(end, end + size)
            end = part.stop
            for mine, theirs in zip(whole.arrays(), state.arrays(), strict=True):
                if mine.size and theirs.size:
                    mine[part][: state.count] = theirs[: state.count]
            state.move_into(whole, part)
        self.whole = whole
