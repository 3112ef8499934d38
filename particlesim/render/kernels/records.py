"""Records that the kernels read. Lengths are in scene units: metres, less the scene's centre, over its half
extent.

So the same float32 kernels draw an orbit of 10¹¹ m and a droplet of 10⁻⁶ m.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Float32s = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Array = npt.NDArray[Any]
Triple = tuple[float, float, float]
Axes = tuple[Triple, Triple, Triple]


def triple(values: npt.ArrayLike) -> Triple:
    """Three numbers for a record: plain scalars, because counting references to arrays costs kernels half
    their time."""
    x, y, z = np.asarray(values, np.float32).tolist()
    return x, y, z


def axes_of(rows: npt.ArrayLike) -> Axes:
    """Three rows of three numbers for a record."""
    right, up, forward = np.asarray(rows)
    return triple(right), triple(up), triple(forward)


BLOCK = 8
"""Texels along a side of the blocks of a shadow map."""


class View(NamedTuple):
    """A pinhole camera: `axes` rows are right, up and forward; `focal` is in (super)samples."""

    eye: Triple
    axes: Axes
    focal: float
    width: int
    height: int


class Planes(NamedTuple):
    """Planes, shape [m, 3] each: a point, the unit normal, and two unit vectors u, v along the grid lines.

    `facing` tells which are drawn: those whose legal side holds the camera. `spacing` is the grid's step.
    """

    point: Float32s
    normal: Float32s
    u: Float32s
    v: Float32s
    facing: npt.NDArray[np.bool_]
    spacing: float


class Light(NamedTuple):
    """Linear RGB of the key light (from `direction`, a unit vector), of the sky above and the ground
    below."""

    direction: Triple
    key: Triple
    sky: Triple
    bounce: Triple
    up: Triple


class Backdrop(NamedTuple):
    """Linear RGB of the background's top and bottom, of the planes and of their grid lines."""

    top: Triple
    bottom: Triple
    ground: Triple
    line: Triple


class ShadowMap(NamedTuple):
    """Distance from the light's plane to the nearest sphere, [size, size], and the `least` of it in and closely around each
    block of BLOCK × BLOCK texels; a map of size 1 casts no shadow."""

    depth: Float32s
    least: Float32s
    axes: Axes
    scale: float


class SkyMap(NamedTuple):
    """Seen from above: blurred mean and mean square of the heights over `base`. `reach`: how far above still
    darkens."""

    mean: Float32s
    square: Float32s
    axes: Axes
    scale: float
    base: float
    reach: float


class Layers(NamedTuple):
    """The two nearest spheres of each sample of a band: view depth and index (−1: none), shape [rows,
    width]."""

    near: Float32s
    near_id: Ints
    far: Float32s
    far_id: Ints


class Paths(NamedTuple):
    """The strongest trail of each sample of a band: opacity, palette index and view depth, shape [rows,
    width]."""

    alpha: Float32s
    color: Ints
    depth: Float32s


class Solids(NamedTuple):
    """Surfaces and tubes of a frame. Their points are the particles, in camera axes beside the drawn radius.

    `corner` [t, 3]: rows of the particles at each triangle's corners; `shade` [t, 3]: rows of `normal` [k, 3], world
    axes, for the same corners; `closed` [t]: whether it belongs to the skin of a body, which has one side only.
    `end` [l, 2]: rows of the particles at a tube's ends; `end_color` [l, 2]: palette index there; `radius` [l] [scene
    units] of each tube. Samples number spheres first, then triangles, then tubes.
    """

    corner: Ints
    shade: Ints
    closed: npt.NDArray[np.bool_]
    normal: Float32s
    end: Ints
    end_color: npt.NDArray[np.uint16]
    radius: Float32s


class Samples(NamedTuple):
    """What is seen in the `SUBSAMPLES` points of each sample of a band: 1 / view depth (0: nothing) and number, shape
    [rows, width, SUBSAMPLES]."""

    inverse: Float32s
    id: Ints
