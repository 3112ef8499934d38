"""Depth maps: the scene as the light sees it, and the sky."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from particlesim.process.threads import Team
from particlesim.render.kernels import project, raster
from particlesim.render.kernels.multisample import depth_of_triangles, depth_of_tubes
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import (
    Array,
    Axes,
    Ints,
    Light,
    Planes,
    ShadowMap,
    SkyMap,
    Triple,
    axes_of,
)
from particlesim.render.kernels.solids import box_on_map
from particlesim.render.scene.draw_list import NO_BOX, Cast

CHUNK = 1 << 16
"""Particles of one piece of work."""

SKY_SIZE = 512
MAP_REACH = 1.25
"""Half width of shadow and sky map in half extents of the scene's diagonal."""

THINNEST = 0.71
"""Radius [texels] of a tube that no texel misses."""

_AS_IT_IS = np.empty(0, np.int32)


def depth_map(cast: Cast, axes: Axes, size: int, reach: float, team: Team) -> Array:
    """Depth [scene units] along `axes[2]` of what is nearest, float32 [size, size], over ± `reach` scene units."""
    n, scale = len(cast.world), 0.5 * size / reach
    disc, box = np.empty((n, 4), np.float32), np.empty((n, 4), np.int32)

    def piece(start: int, stop: int) -> None:
        project.to_map(cast.world, cast.sphere, start, stop, axes, scale, size, disc, box)

    team.over_range(n, CHUNK, piece)
    box[cast.hidden] = NO_BOX
    solids = cast.solids
    wide = np.maximum(scale * solids.radius, THINNEST).astype(np.float32)
    triangle_box = _boxes(disc, solids.corner, np.zeros(len(solids.corner), np.float32), size)
    triangle_box[~cast.whole] = NO_BOX
    tube_box = _boxes(disc, solids.end, wide, size)
    spheres, triangles, tubes = (
        project.bin_bands(each, _AS_IT_IS, size) for each in (box, triangle_box, tube_box)
    )
    depth = np.empty((size, size), np.float32)

    def band(b: int) -> None:
        mine = _of_band(spheres, b)
        discs = np.empty((len(mine), 4), np.float32)
        project.gather(disc, mine, discs)
        raster.raster_depth(discs, b * BAND, scale, depth)
        if len(mine := _of_band(triangles, b)):
            depth_of_triangles(disc, solids.corner, triangle_box, mine, b * BAND, depth)
        if len(mine := _of_band(tubes, b)):
            depth_of_tubes(disc, solids.end, wide, tube_box, mine, b * BAND, depth)

    team.each(band, len(spheres[0]) - 1)
    return depth


def _boxes(disc: Array, rows: Ints, margin: Array, size: int) -> Array:
    box = np.empty((len(rows), 4), np.int32)
    box_on_map(disc, rows, 0, len(rows), margin, size, box)
    return box


def _of_band(bins: tuple[Array, Array], b: int) -> Array:
    first, items = bins
    return items[first[b] : first[b + 1]]


@dataclass(frozen=True)
class Lamp:
    """What shadows and the light of the sky depend on in all frames alike: light, planes, extents of the scene [m] and what
    a scene unit is [m], the drawn radius of particles and the size of what is typical [scene units]; whether there are
    shadows at all, and whether their map is a fine one."""

    light: Light
    planes: Planes
    extent: Array
    scale: float
    radius: float
    typical: float
    shadows: bool
    fine: bool

    def maps(self, cast: Cast, team: Team) -> tuple[ShadowMap, SkyMap]:
        """Depth seen from the light, and the blurred heights seen from above."""
        axes = _map_axes(self.light.direction)
        if not self.shadows or not len(cast.world):
            flat = np.full((1, 1), np.inf, np.float32)
            return ShadowMap(flat, flat, axes, 1.0), SkyMap(flat, flat, axes, 1.0, 0.0, 1.0)
        reach = MAP_REACH * float(np.linalg.norm(self.extent)) / (2 * self.scale)
        reach = max(reach, 0.3) + 2 * self.radius
        size = 2048 if self.typical * 512 / reach < 2.5 and self.fine else 1024
        depth = depth_map(cast, axes, size, reach, team)
        shadow = ShadowMap(depth, raster.least_around(depth), axes, 0.5 * size / reach)
        axes, scale = _map_axes(self.light.up), 0.5 * SKY_SIZE / reach
        depth = depth_map(cast, axes, SKY_SIZE, reach, team)
        blur = int(np.clip(round(1.2 * self.typical * scale), 2, 24))
        mean, square = np.empty_like(depth), np.empty_like(depth)
        base = self._lowest(cast)
        raster.sky_moments(depth, base, blur, mean, square)
        return shadow, SkyMap(mean, square, axes, scale, base, max(2.0 * self.typical, 2.0 * blur / scale))

    def _lowest(self, cast: Cast) -> float:
        """Height of the floor, or of the bottom of the scene and of what stands in it [scene units]."""
        up = np.array(self.light.up)
        floors = (self.planes.point.astype(float) @ up)[(self.planes.normal @ up) > 0.7]
        if len(floors):
            return float(floors.max())
        return min(-float(np.abs(up) @ self.extent) / (2 * self.scale), float((cast.world @ up).min()))


def _map_axes(towards: Triple) -> Axes:
    """Axes of a map seen from `towards`: right, up, and away from there."""
    forward = -np.array(towards)
    side = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    return axes_of([side, np.cross(side, forward), forward])
