"""The objects of one frame, and the scratch memory of a thread that draws a band of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from particlesim.render.kernels.multisample import SUBSAMPLES
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import (
    Array,
    Layers,
    Paths,
    Planes,
    Samples,
    ShadowMap,
    SkyMap,
    Solids,
    View,
)
from particlesim.render.scene.source import BallShape

NO_BOX = np.array([0, -1, 0, -1], np.int32)
"""First and last column and row of what is not drawn."""


@dataclass(frozen=True)
class Balls:
    """Spheres that do not move: centres [k, 3] and radii [k] in scene units."""

    center: Array
    radius: Array

    @staticmethod
    def of(shapes: tuple[BallShape, ...], center: Array, scale: float) -> Balls:
        """In a scene about a centre [m] with a unit of length [m]."""
        place = np.array([ball.center for ball in shapes], float).reshape(-1, 3)
        radius = np.array([ball.radius for ball in shapes], float)
        return Balls(((place - center) / scale).astype(np.float32), (radius / scale).astype(np.float32))


@dataclass(frozen=True)
class Cast:
    """A frame's particles and then its balls, surfaces and tubes: `world` [scene units], `sphere` (camera axes and drawn
    radius), palette index, which particles are not drawn, which triangles are whole; boxes: the samples that each may
    touch."""

    world: Array
    sphere: Array
    box: Array
    color: Array
    hidden: Array
    solids: Solids
    whole: Array
    triangle_box: Array
    tube_box: Array


@dataclass(frozen=True)
class Act:
    """All that the bands of a picture share."""

    view: View
    planes: Planes
    shadow: ShadowMap
    sky: SkyMap
    cast: Cast
    haze: tuple[float, float, float, float, float]
    trails: tuple[Array, Array] | None


@dataclass(frozen=True)
class Buffers:
    """The samples of one band of a picture, `image` in linear light."""

    image: Array
    layers: Layers
    paths: Paths
    samples: Samples

    @staticmethod
    def of(width: int, solids: bool) -> Buffers:
        """For pictures of this width, with room for `samples` where there are solids."""
        shape = (BAND, width)
        floats, ints = np.empty((5, *shape), np.float32), np.empty((3, *shape), np.int32)
        points = (*shape, SUBSAMPLES) if solids else (0, 0, 0)
        return Buffers(
            np.empty((*shape, 3), np.float32),
            Layers(floats[0], ints[0], floats[1], ints[1]),
            Paths(floats[2], ints[2], floats[3]),
            Samples(np.empty(points, np.float32), np.empty(points, np.int32)),
        )
