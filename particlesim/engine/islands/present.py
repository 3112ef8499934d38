"""The potential energy of some particles of an island without the others: the energy that births and deaths in the middle of
a step add and remove."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.interactions.interaction import Interaction, Site
from particlesim.engine.interactions.registry import laid_again
from particlesim.engine.islands.joined import Joined
from particlesim.engine.islands.moment import Moment
from particlesim.engine.state.columns import mapped
from particlesim.engine.state.group_state import GroupState
from particlesim.scenario.scenario import Scenario

Which = NDArray[np.bool_]


class Stored:
    """What the interactions of an island have stored among some of its particles."""

    def __init__(self, scenario: Scenario, joined: Joined, sets: Sequence[Any]) -> None:
        self._scenario, self._joined, self._sets = scenario, joined, sets

    def among(self, moment: Moment, time: float, here: Sequence[Which]) -> list[float]:
        """Potential energy at a moment and its time [s] among particles `here` [J], shape [n], for each such choice; what
        joins only groups that are alike in all of them is left out."""
        unlike = np.any([one != here[0] for one in here], axis=0)
        bounds = self._joined.bounds
        changed = {
            state.name
            for state, (a, b) in zip(self._joined.states, pairwise(bounds), strict=True)
            if unlike[a:b].any()
        }
        chosen = [(one, each) for one, each in self._with_energy(moment) if changed & set(one.groups)]
        return [self._among(moment, time, one, chosen) for one in here]

    def whole(self, moment: Moment, time: float, here: Which) -> float:
        """Potential energy of all interactions at a moment and its time [s] among particles `here` [J], shape [n]."""
        return self._among(moment, time, here, self._with_energy(moment))

    def _with_energy(self, moment: Moment) -> list[tuple[Any, Interaction]]:
        pairs = zip(self._sets, moment.interactions, strict=True)
        return [(one, each) for one, each in pairs if type(each).energy is not Interaction.energy]

    def _among(
        self, moment: Moment, time: float, here: Which, chosen: Sequence[tuple[Any, Interaction]]
    ) -> float:
        if not (chosen and here.any()):
            return 0.0
        columns, interactions = moment.columns, tuple(each for _, each in chosen)
        if not here.all():
            columns = mapped(lambda array: array[here], columns)
            whole, states = self._without_others(here)
            for row, column in zip(
                (*whole.x, *whole.v),
                (columns.x, columns.y, columns.z, columns.vx, columns.vy, columns.vz),
                strict=True,
            ):
                row[:] = column
            site = Site(self._scenario, whole, states, began=False)
            place = np.where(here, np.cumsum(here) - 1, -1)
            interactions = laid_again(site, [one for one, _ in chosen], interactions, place)
        return sum(each.energy(columns, time) or 0.0 for each in interactions)

    def _without_others(self, here: Which) -> tuple[GroupState, list[GroupState]]:
        """Copies of the groups with particles `here` alone, and all of these as one."""
        copies = []
        for state, (a, b) in zip(self._joined.states, pairwise(self._joined.bounds), strict=True):
            rows = here[a:b]
            copy = GroupState(
                state.name,
                int(rows.sum()),
                dtype=state.dtype,
                memory=len(state.memory),
                parts=state.parts,
                cooling=state.cooling,
            )
            copy.count = copy.capacity
            for mine, theirs in zip(copy.arrays(), state.arrays(), strict=True):
                if mine.size:
                    mine[:] = theirs[: state.count][rows]
            copies.append(copy)
        return Joined(copies).whole, copies
