"""A periodic box in pictures: its edges as thin lines; and frames whose springs and surfaces are not cut by it."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.render.kernels.project import NEAR
from particlesim.render.kernels.records import Array, View
from particlesim.render.scene.source import Frame
from particlesim.trajectory.box import Box

PIECES = 24
"""Segments of an edge: depths are interpolated along each, which perspective bends."""
STRENGTH = 0.55
"""How much of what is behind an edge it hides."""


class BoxEdges:
    """The edges of a box; `corners` [8, 3] in m."""

    def __init__(self, box: Box) -> None:
        unit = np.array(list(product((0.0, 1.0), repeat=3)))
        self.corners: Array = np.array(box.origin) + unit * box.size
        pairs = [(i, j) for i in range(8) for j in range(i) if np.abs(unit[i] - unit[j]).sum() == 1]
        along = np.linspace(0, 1, PIECES + 1)[:, None]
        self._points = np.stack(
            [self.corners[i] + along * (self.corners[j] - self.corners[i]) for i, j in pairs]
        )

    def segments(self, view: View, center: Array, scale: float, width: float) -> Array:
        """Rows for `draw_paths`, for lines of a width [samples]."""
        seen = ((self._points - center) / scale - np.array(view.eye)) @ np.array(view.axes).T
        with np.errstate(all="ignore"):  # what is behind the camera is left out below
            x = 0.5 * view.width + view.focal * seen[..., 0] / seen[..., 2]
            y = 0.5 * view.height - view.focal * seen[..., 1] / seen[..., 2]
        ends = np.stack([x, y, seen[..., 2], np.full(x.shape, STRENGTH)], axis=2)
        half = np.full((*x[:, 1:].shape, 1), 0.5 * width)
        rows = np.concatenate([ends[:, :-1], ends[:, 1:], half], axis=2).reshape(-1, 9)
        ok = np.isfinite(rows).all(axis=1) & (rows[:, 2] > NEAR) & (rows[:, 6] > NEAR)
        ok &= (np.abs(rows[:, [0, 1, 4, 5]]) < 4e4).all(axis=1)
        return np.ascontiguousarray(rows[ok], np.float32)


class AlongPaths:
    """A frame of a run in a periodic box with positions along the paths of particles, not wrapped into the box."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame
        self.time = frame.time
        self.id = frame.id
        path: Any = frame
        self.position: npt.NDArray[Any] = path.unwrapped

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self._frame[name]
