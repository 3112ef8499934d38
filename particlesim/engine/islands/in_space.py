"""Particles in an order in which neighbours in space are neighbours in memory, for the steps of an interval.

A kernel that reads a particle's neighbours loads whole cache lines of eight particles each, seven of which are wasted where
neighbours in space are scattered in memory, as after grains have been poured or stirred. So for many steps of many particles
all columns are copied into the order of a space-filling curve, stepped there, and copied back. Interactions know their
particles by other rows meanwhile (`Interaction.among`), and do the same in the same order: the bits are the same as without.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from particlesim.engine.coupled.workspace import Share
from particlesim.engine.islands.layout import Interactions, Layout
from particlesim.engine.state.columns import Columns, changing, mapped
from particlesim.model.arrays import Ints

WORTH_PARTICLES, WORTH_STEPS = 4_096, 64
"""Particles of which each core of two has some to itself (more do not even fit into its cache), and steps that make up for
what copies take."""
NEAR, DISORDERED = 64, 0.1
"""Places apart at which two rows still share what is in the cache, and the part of rows that may be further apart."""


class InSpace(NamedTuple):
    """Columns and interactions in another order: row k is row `rows[k]` of the island, whose row i is row `place[i]`."""

    rows: Ints
    place: Ints
    columns: Columns
    elements: Interactions

    @classmethod
    def of(cls, layout: Layout, columns: Columns, steps: int) -> Self | None:
        """Another order, if it is worth it for so many steps of an island: None where the order is good, or no better one is
        known."""
        if steps < WORTH_STEPS or not in_order(layout):
            return None
        rows = rows_in_space(layout)
        if rows is None:
            return None
        place = np.empty_like(rows)
        place[rows] = np.arange(len(rows))
        elements = tuple(each.among(rows, place) for each in layout.interactions)
        return cls(rows, place, mapped(lambda x: x[rows], columns), elements)

    def share(self, share: Share) -> Share:
        """The share of a thread in this order."""
        return share._replace(elements=self.elements)

    def bring_back(self, layout: Layout, columns: Columns) -> None:
        """Give the island what steps have changed."""
        for mine, theirs in zip(changing(columns), changing(self.columns), strict=True):
            mine[self.rows] = theirs
        for each, there in zip(layout.interactions, self.elements, strict=True):
            each.bring_back(there, self.rows, self.place)


def in_order(layout: Layout) -> bool:
    """Whether an order in space is worth it for some number of steps."""
    return layout.count >= WORTH_PARTICLES and layout.movable


def rows_in_space(layout: Layout) -> Ints | None:
    """Rows of an island in the order in which its largest interaction had them last, group by group; None where they are
    near that already, or it has not looked at them yet."""
    near = max((each.near for each in layout.interactions), key=lambda each: each.members.size)
    known = near.place >= 0
    if not known.any() or (np.abs(np.diff(near.place[known])) > NEAR).mean() < DISORDERED:
        return None
    last = np.where(known, near.place, near.order.size)
    return np.concatenate(
        [
            a + np.argsort(last[a:b], kind="stable")
            for a, b in zip(layout.bounds, layout.bounds[1:], strict=False)
        ]
    )
