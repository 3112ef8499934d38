"""A copy of the state of an island at one time, to be kept, stepped on trial, and restored."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.islands.layout import Interactions
from particlesim.engine.state.columns import Columns, changing, mapped, replaced


class Moment(NamedTuple):
    """Columns of an island, and its interactions."""

    columns: Columns
    interactions: Interactions

    def arrays(self) -> list[NDArray[Any]]:
        """All that steps change: motion, what methods remember, clocks, and what changes in interactions."""
        return [*changing(self.columns), *(array for each in self.interactions for array in each.changing())]

    def made_of(self, arrays: Sequence[NDArray[Any]]) -> Moment:
        """The same with other arrays, in that order."""
        rest = iter(arrays)
        columns = replaced(self.columns, rest)
        return Moment(
            columns,
            tuple(each.with_changed([next(rest) for _ in each.changing()]) for each in self.interactions),
        )

    def copied(self) -> Moment:
        """The same with arrays of its own."""
        return self.made_of([array.copy() for array in self.arrays()])

    def with_all_copied(self) -> Moment:
        """The same with copies of all columns, also of those that steps do not change: burials move them."""
        return Moment(mapped(np.copy, self.columns), self.copied().interactions)

    def take(self, arrays: Sequence[NDArray[Any]]) -> None:
        """Set all that steps change. Interactions may have got more room since; they must be `recalled`."""
        for mine, theirs in zip(self.arrays(), arrays, strict=True):
            if mine.shape == theirs.shape:
                np.copyto(mine, theirs)
            else:
                mine[: len(theirs)] = theirs
