"""Depth maps: the scene as the light sees it, and the sky."""

from __future__ import annotations

import numpy as np

from particlesim.process.threads import Team
from particlesim.render.kernels import project, raster
from particlesim.render.kernels.multisample import depth_of_triangles, depth_of_tubes
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import Array, Axes, Ints
from particlesim.render.kernels.solids import box_on_map
from particlesim.render.scene.draw_list import NO_BOX, Cast

CHUNK = 1 << 16
"""Particles of one piece of work."""

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
