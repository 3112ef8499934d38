"""Springs and rods at rigid bodies, as lines between points of these, particles and the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from particlesim.render.kernels.records import Array
from particlesim.render.scene.props import poses
from particlesim.render.scene.source import Frame


class Links:
    """Sets of a topology that have `points`, with the number of the owner of each set.

    `owner` [l]: that of every link; `rest` [l]: rest lengths [m]; `world` [w, 3]: places of the world that links begin
    or end at [m].
    """

    def __init__(self, sets: Sequence[tuple[int, Any]]) -> None:
        def joined(first: Array, parts: list[Array]) -> Array:
            return np.concatenate([first, *parts])

        self.owner = joined(np.empty(0, np.int64), [np.full(len(each.pairs), k) for k, each in sets])
        self.rest = joined(np.empty(0), [each.rest for _, each in sets])
        self._broke = joined(np.empty(0), [each.broke for _, each in sets])
        self._pairs = joined(np.empty((0, 2), np.int64), [each.pairs for _, each in sets])
        self._points = joined(np.empty((0, 2, 3)), [each.points for _, each in sets])
        self.world = self._points[self._pairs < 0]

    def at(self, frame: Frame, rows: Callable[[Frame, Array], Array]) -> tuple[Array, Array, Array]:
        """Ends of the links that are there [m], shape [l, 2, 3], their strains [l] and their owners [l]; `rows` finds
        particles of a frame by their ids."""
        if not len(self.owner):
            return np.empty((0, 2, 3)), np.empty(0), np.empty(0, np.int64)
        row, fixed = rows(frame, self._pairs), self._pairs < 0
        there = (self._broke > frame.time) & (fixed | (row >= 0)).all(axis=1)
        row, fixed, ends = row[there], fixed[there], self._points[there].copy()
        place, rotation = poses(frame, row[~fixed])
        ends[~fixed] = place + np.einsum("nij,nj->ni", rotation, ends[~fixed])
        length, rest = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), self.rest[there]
        strain = np.divide(length - rest, rest, out=np.zeros_like(length), where=rest > 0)
        return ends, strain, self.owner[there]
