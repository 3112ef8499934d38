"""A survey of the whole trajectory before the first picture: extents of positions, sizes and values.

Frames and particles are sampled, so that this takes a moment for any trajectory. Positions that are not
finite, or hardly so, are left out, and a few particles that escape far from the others do not shrink the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from particlesim.render.kernels.records import Array
from particlesim.render.scene.source import Frame, FrameSource, sample_indices

FRAMES = 25
PARTICLES = 20_000
FARTHEST = 1e100
"""Positions [m] and values beyond it are left out like those that are not finite: their squares are."""


@dataclass(frozen=True)
class Survey:
    """Sampled centres [m], shape [k, 3], their robust bounds [m], the largest number of particles in a
    frame, the
    recorded radii [m] (median and maximum, 0 when there are none), and the range of the coloured values."""

    points: Array
    low: Array
    high: Array
    count: int
    radius: float
    largest: float
    values: tuple[float, float]

    @property
    def center(self) -> Array:
        """The middle of the scene [m], shape [3]."""
        return 0.5 * (self.low + self.high)

    def with_points(self, points: Array) -> Survey:
        """The same with some more places [m], shape [k, 3], that pictures have to show."""
        low, high = (edge(points, axis=0) for edge in (np.min, np.max))
        return replace(
            self,
            points=np.concatenate([self.points, points]),
            low=np.minimum(self.low, low),
            high=np.maximum(self.high, high),
        )

    @property
    def half_extent(self) -> float:
        """Half the longest side of the bounds [m]; positive also when nothing moves or nothing is there."""
        half = 0.5 * float(np.max(self.high - self.low))
        floor = max(4.0 * self.largest, 1e-13 * float(np.abs(self.center).max()))
        return max(half, floor) or 1.0


def survey(
    source: FrameSource,
    values_of: Callable[[Frame], Array | None],
    as_drawn: Callable[[Frame], Frame] = lambda frame: frame,
) -> Survey:
    """Sample all frames, as they are drawn. `values_of` gives the coloured values of a frame, one for each particle
    or for each of other things, or None."""
    points, values, radii = [np.empty((0, 3))], [np.empty(0)], [np.empty(0)]
    count = 0
    for index in sample_indices(len(source), FRAMES):
        frame = as_drawn(source[index])
        count = max(count, len(frame.position))
        some = slice(None, None, max(1, -(-len(frame.position) // PARTICLES)))
        position = np.asarray(frame.position[some], float)
        good = (np.abs(position) < FARTHEST).all(axis=1)
        points.append(position[good])
        radii.append(_radii(source, frame, some)[good])
        value = values_of(frame)
        if value is not None:
            few = value[some]
            values.append(few[good] if len(value) == len(frame.position) else few)
    every = np.concatenate(points)
    low, high = _robust_bounds(every)
    inside = ((every >= low) & (every <= high)).all(axis=1)
    radius = np.concatenate(radii)
    radius = radius[np.isfinite(radius) & (radius > 0)]
    return Survey(
        every[inside],
        low,
        high,
        count,
        float(np.median(radius)) if len(radius) else 0.0,
        float(radius.max()) if len(radius) else 0.0,
        _value_range(np.concatenate(values)),
    )


def foreseen(source: FrameSource, bounds: tuple[Sequence[float], Sequence[float]]) -> Survey:
    """A survey of what is known before the last frame is: these bounds [m], the number of particles that the run expected,
    and the radii of those that come first. Values are not known: 0 to 1.

    For old trajectories, which do not tell that number, the number of particles in the fullest frame.
    """
    most: int | None = getattr(source, "most", None)
    if most is None:
        most = max(len(source[k].position) for k in range(len(source)))
    low, high = np.array(bounds, float)
    points = np.array(list(product(*zip(low, high, strict=True))))
    radius = np.empty(0)
    for k in range(len(source)):
        frame = source[k]
        if len(frame.position):
            radius = _radii(source, frame, slice(None))
            radius = radius[np.isfinite(radius) & (radius > 0)]
            break
    typical, largest = (float(np.median(radius)), float(radius.max())) if len(radius) else (0.0, 0.0)
    return Survey(points, low, high, most, typical, largest, (0.0, 1.0))


def _radii(source: FrameSource, frame: Frame, some: slice) -> Array:
    if "radius" not in source.fields:
        return np.zeros(len(frame.position[some]))
    return np.asarray(frame["radius"][some], float)


def _robust_bounds(points: Array) -> tuple[Array, Array]:
    """Per axis: the whole range, unless the outermost half percent reach far (a quarter of the rest) beyond
    the rest."""
    if not len(points):
        return np.zeros(3), np.zeros(3)
    low, high = points.min(axis=0), points.max(axis=0)
    if len(points) >= 1000:
        inner_low, inner_high = np.quantile(points, [0.005, 0.995], axis=0)
        margin = 0.25 * (inner_high - inner_low)
        low = np.where(low < inner_low - margin, inner_low - margin, low)
        high = np.where(high > inner_high + margin, inner_high + margin, high)
    return low, high


def _value_range(values: Array) -> tuple[float, float]:
    """From the 1st to the 99th percentile, or all where these are close to the extremes; zero where it is
    near."""
    values = values[np.abs(values) < FARTHEST]
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    inner_low, inner_high = (float(q) for q in np.quantile(values, [0.01, 0.99]))
    margin = 0.15 * (inner_high - inner_low)
    low, high = max(low, inner_low - margin), min(high, inner_high + margin)
    if 0.0 < low < 0.15 * high:
        low = 0.0
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        half = 0.5 * abs(high) or 0.5
        return low - half, high + half
    return low, high
