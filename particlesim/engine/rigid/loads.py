"""What else acts on particles that touch bodies, and presses them onto these in their own step, which comes later.

Impulses of what lies on a body are found as if that had been given, and then it is taken back (`visit.left`): the particle
ends its own step with the velocity that contact has given it, and where contact has put it. What is awaited is h times the
acceleration at the beginning of the step, which moves a particle by as much as its method does under a constant force, and
what the last step gave besides, as forces change on the way. Where that was
more than a part of it something was hit, which is not awaited: what pushes back, as a floor under a particle on which a body
lies, would be taken for a force. What comes otherwise is made good at the end of the step (`kernel.hold_guests`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particlesim.engine.state.group_state import GroupState
from particlesim.model.arrays import Floats, Ints

MOST = 0.5
"""What is awaited besides forces, at most, as a part of them; and beyond half of a path, as a part of it."""


class Loads:
    """Of the particles that were among bodies in the last step, by their ids, which are in order (`id` [n]): what it gave
    besides forces that stay the same (`besides` [6, n]), to velocities [m/s], and to places beyond what these give [m]."""

    def __init__(self) -> None:
        self.id: Ints = np.empty(0, np.int64)
        self.besides: Floats = np.empty((6, 0))
        self._away: list[tuple[GroupState, Ints, Floats, float]] = []

    def awaited(self, ids: Ints) -> Floats:
        """What is to be expected besides forces of particles [6, n]; 0 of those that were not there."""
        if not len(self.id):
            return np.zeros((6, len(ids)))
        at = np.minimum(np.searchsorted(self.id, ids), len(self.id) - 1)
        return np.where(self.id[at] == ids, self.besides[:, at], 0.0)

    def leave(self, chosen: Sequence[tuple[GroupState, Ints]], lags: Sequence[float], forces: Floats) -> None:
        """Particles, rows of groups, are about to make their own steps, in which forces change velocities by so much [m/s],
        shape [3, n]: no number where that is not known; by which parts of a step velocities of each group are late."""
        first, self._away = 0, []
        for (state, rows), lag in zip(chosen, lags, strict=True):
            given = forces[:, first : first + len(rows)]
            start = np.concatenate([state.v[:, rows], state.x[:, rows], given]).astype(float)
            self._away.append((state, state.id[rows].copy(), start, lag))
            first += len(rows)

    def arrive(self, h: float) -> None:
        """They have made steps of length h; those that have died are forgotten."""
        ids, besides = [np.empty(0, np.int64)], [np.empty((6, 0))]
        for state, mine, start, lag in self._away:
            rows = rows_of(state, mine)
            here = rows >= 0
            rows, (v, x, forces) = rows[here], start[:, here].reshape(3, 3, -1)
            gain = state.v[:, rows] - v
            found = np.stack([gain - forces, state.x[:, rows] - x - h * v - (0.5 + lag) * h * gain])
            size = (forces**2).sum(axis=0)
            fits = (found[0] ** 2).sum(axis=0) <= MOST**2 * size
            fits &= (found[1] ** 2).sum(axis=0) <= (1.5 * MOST * h) ** 2 * size
            ids.append(mine[here])
            besides.append(np.where(fits, found, 0.0).reshape(6, -1))
        all_ids = np.concatenate(ids)
        order = np.argsort(all_ids)
        self.id, self.besides = all_ids[order], np.concatenate(besides, axis=1)[:, order]
        self._away = []


def rows_of(state: GroupState, ids: Ints) -> Ints:
    """Where particles are in their group now, −1 for those that are gone."""
    now = state.id[: state.count]
    if not len(now):
        return np.full(len(ids), -1)
    order = None if (now[1:] > now[:-1]).all() else np.argsort(now)
    at = np.minimum(np.searchsorted(now, ids, sorter=order), len(now) - 1)
    found = at if order is None else order[at]
    return np.where(now[found] == ids, found, -1)
