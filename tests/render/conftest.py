"""Trajectories made of arrays, for the renderer's tests."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from particlesim.render import Camera, PlaneShape, RenderSettings


@dataclass
class ArrayFrame:
    time: float
    position: np.ndarray
    values: dict = field(default_factory=dict)

    @property
    def id(self):
        return np.arange(len(self.position))

    def __getitem__(self, name):
        return self.values[name]


class ArraySource:
    """A FrameSource from a list of frames."""

    def __init__(self, frames, **extra):
        self.frames = frames
        self.times = np.array([frame.time for frame in frames])
        self.fields = tuple(frames[0].values) if frames else ()
        self.__dict__.update(extra)

    def __len__(self):
        return len(self.frames)

    def __getitem__(self, index):
        return self.frames[index]


def single(position, **values):
    """One frame with these positions and fields."""
    position = np.atleast_2d(np.asarray(position, float))
    return ArraySource([ArrayFrame(0.0, position, {k: np.asarray(v) for k, v in values.items()})])


@pytest.fixture
def plain():
    """Settings without text or shadows, 160 × 120, camera on +z at a distance of 10 m with a focal length of
    200."""

    def make(**changes):
        fov = 2 * np.degrees(np.arctan(60 / 200))
        base = {
            "size": (160, 120),
            "camera": Camera(eye=(0, 0, 10), target=(0, 0, 0), fov=fov),
            "legend": False,
            "time_label": False,
            "title": False,
            "shadows": False,
            "trails": False,
        }
        return RenderSettings(**{**base, **changes})

    return make


@pytest.fixture
def cloud():
    """Twelve frames of 300 particles that fall, with velocity."""
    rng = np.random.default_rng(5)
    start, velocity = rng.uniform(0.2, 2.0, (300, 3)), rng.normal(0, 1, (300, 3))
    return ArraySource(
        [
            ArrayFrame(k / 30, np.abs(start + velocity * k / 30), {"velocity": velocity * (1 + 0.1 * k)})
            for k in range(12)
        ]
    )


FLOOR = (PlaneShape((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),)
