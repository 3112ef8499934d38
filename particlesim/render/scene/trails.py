"""Recent paths of a few particles, as fading lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from particlesim.render.kernels.project import NEAR
from particlesim.render.kernels.records import Array, View
from particlesim.render.scene.source import Frame, FrameSource, sample_indices

AUTOMATIC = 64
"""Trails are drawn unasked for up to this many particles."""

MOST = 1000
"""No more trails than this are drawn; the lowest ids have them."""

FEW = 3
"""Up to this many particles show their whole path, more of them only the recent part, `SHARE` of the
video."""

SHARE = 0.3

SAMPLES = 6000


@dataclass(frozen=True)
class Trails:
    """Where each particle was: `times` [s], shape [f]; `ids`, shape [k]; `points` [m], shape [f, k, 3], NaN
    where absent; `colors`: palette index of each point; `jumps` [f, k]: which points are in another image of a periodic box
    than those before, so that no line leads there."""

    times: Array
    ids: Array
    points: Array
    colors: Array
    span: float
    jumps: Array | None = None

    def segments(
        self, time: float, view: View, center: Array, scale: float, width: float, ids: Array
    ) -> tuple[Array, Array]:
        """Rows for `draw_paths` at this time, for the particles `ids` that live now, and the palette index
        of each."""
        last = int(np.searchsorted(self.times, time * (1 + 1e-12), side="right"))
        first = int(np.searchsorted(self.times, time - self.span))
        if last - first < 2 or not len(ids):
            return np.empty((0, 9), np.float32), np.empty(0, np.int32)
        alive = np.flatnonzero(np.isin(self.ids, ids))
        age = np.clip((time - self.times[first:last]) / self.span, 0, 1)
        alpha = np.broadcast_to((0.9 * (1 - 0.97 * age))[:, None], (last - first, len(alive)))
        with np.errstate(all="ignore"):  # what is not finite is left out below
            points = (self.points[first:last][:, alive] - center) / scale - np.array(view.eye)
            seen = points @ np.array(view.axes).T
            x = 0.5 * view.width + view.focal * seen[..., 0] / seen[..., 2]
            y = 0.5 * view.height - view.focal * seen[..., 1] / seen[..., 2]
        ends = np.stack([x, y, seen[..., 2], alpha], axis=2)
        rows = np.concatenate([ends[:-1], ends[1:], np.full((*ends[1:].shape[:2], 1), 0.5 * width)], axis=2)
        ok = np.isfinite(rows).all(axis=2) & (rows[..., 2] > NEAR) & (rows[..., 6] > NEAR)
        ok &= (np.abs(rows[..., [0, 1, 4, 5]]) < 4e4).all(axis=2) & (rows[..., [2, 6]] < 1e30).all(axis=2)
        if self.jumps is not None:
            ok &= ~self.jumps[first + 1 : last][:, alive]
        color = self.colors[first + 1 : last][:, alive]
        return np.ascontiguousarray(rows[ok], np.float32), np.ascontiguousarray(color[ok])


def collect_trails(source: FrameSource, colors_of: Callable[[Frame], Array]) -> Trails:
    """Read the paths of up to `MOST` particles."""
    frames = list(sample_indices(len(source), SAMPLES))
    boxed = getattr(source, "box", None) is not None
    found: list[tuple[Array, Array, Array, Array | None]] = []
    known: Array = np.empty(0, np.int64)
    for index in frames:
        frame = source[index]
        ids = np.asarray(frame.id)
        image = np.asarray(frame["image"]) if boxed else None
        found.append((ids, np.asarray(frame.position, float), colors_of(frame), image))
        if len(known) < MOST:
            known = np.union1d(known, ids)
    known = known[:MOST]
    points = np.full((len(frames), len(known), 3), np.nan)
    colors = np.zeros(points.shape[:2], np.int32)
    images = np.zeros(points.shape, np.int32) if boxed else None
    for f, (ids, position, color, image) in enumerate(found):
        column = np.minimum(np.searchsorted(known, ids), max(len(known) - 1, 0))
        mine = known[column] == ids if len(known) else np.zeros(len(ids), bool)
        points[f, column[mine]] = position[mine]
        colors[f, column[mine]] = color[mine]
        if images is not None and image is not None:
            images[f, column[mine]] = image[mine]
    times = np.asarray(source.times, float)[frames]
    span = (1.0 if len(known) <= FEW else SHARE) * max(float(times[-1] - times[0]), 0.0)
    jumps = None
    if images is not None:
        jumps = np.zeros(points.shape[:2], np.bool_)
        jumps[1:] = (np.diff(images, axis=0) != 0).any(axis=2)
    return Trails(times, known, points, colors, span or 1.0, jumps)
