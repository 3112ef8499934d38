"""One trajectory, one look: everything that stays the same between frames, and the way from a frame to
pixels."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.render import colormaps, project, raster, shade
from particlesim.render.camera import Viewpoint, choose_viewpoint
from particlesim.render.fields import choose_coloring, color_indices
from particlesim.render.lighting import (
    choose_light,
    choose_theme,
    grid_planes,
    is_light,
    readable,
    tone_curve,
)
from particlesim.render.overlay import Overlay
from particlesim.render.project import BAND
from particlesim.render.scene import Frame, FrameSource, PlaneShape
from particlesim.render.stage import (
    Array,
    Axes,
    Layers,
    Light,
    Paths,
    Planes,
    ShadowMap,
    SkyMap,
    Triple,
    View,
    axes_of,
)
from particlesim.render.survey import survey
from particlesim.render.trails import AUTOMATIC, collect_trails
from particlesim.scenario.rendering import RenderSettings
from particlesim.team import Team

Picture = npt.NDArray[np.uint8]

CHUNK = 1 << 16
"""Particles of one piece of work."""

SKY_SIZE = 512
MAP_REACH = 1.25
"""Half width of shadow and sky map in half extents of the scene's diagonal."""

_NO_PATHS = Paths(np.empty((0, 0), np.float32), np.empty((0, 0), np.int32), np.empty((0, 0), np.float32))


class Renderer:
    """Draws frames of `source`; `draw` may be called from several threads at once.

    Raises UsageError when the settings ask for something that the trajectory does not hold.
    """

    def __init__(
        self,
        source: FrameSource,
        settings: RenderSettings,
        *,
        planes: tuple[PlaneShape, ...] = (),
        title: str = "",
        first: int = 0,
        last: int | None = None,
        team: Team,
    ) -> None:
        if len(source) == 0:
            raise UsageError("the trajectory holds no frame", "Run the scenario again; nothing was recorded.")
        last = len(source) - 1 if last is None else last
        self.settings, self.team = settings, team
        self.coloring = choose_coloring(source, settings.color_by)
        self.scene = survey(source, self.coloring, first, last)
        self.center, self.scale = self.scene.center, self.scene.half_extent
        low, high = self.scene.values if settings.color_range == "auto" else settings.color_range
        self.range = (float(low), float(high))
        self.samples = settings.supersampling
        self.width, self.height = (side * self.samples for side in settings.size)
        self.use_radius = "radius" in source.fields and settings.look == "spheres"
        self.radius = self._drawn_radius()
        aspect = self.width / self.height
        shapes = planes if settings.ground else ()
        radius = max(self.radius, self.scene.largest if self.use_radius else 0.0)
        self.viewpoint = choose_viewpoint(settings.camera, self.scene, radius, shapes, aspect)
        self.light: Light = choose_light(settings, self.viewpoint)
        self.theme = choose_theme(settings)
        self.planes = grid_planes(shapes, self.center, self.scale)
        groups = getattr(source, "groups", ())
        srgb = self._palette_srgb(len(groups))
        self.palette = colormaps.to_linear(srgb).astype(np.float32)
        self.overlay = Overlay(
            settings, self.coloring, self.range, srgb, tuple(groups), title, self.scene.count
        )
        self.curve = tone_curve()
        wanted = settings.trails
        few = self.scene.count <= AUTOMATIC and last > first
        draws = wanted is True or (wanted == "auto" and few)
        self.trails = collect_trails(source, first, last, self._colors) if draws else None
        self.bad_positions = 0
        self._lock = threading.Lock()
        self._scratch = threading.local()

    def _drawn_radius(self) -> float:
        """Radius [m] of particles that have none of their own."""
        if self.settings.particle_radius is not None:
            return self.settings.particle_radius
        if self.use_radius and self.scene.radius > 0:
            return self.scene.radius
        crowd = max(self.scene.count, 1) ** (-1 / 3)
        share = (
            np.clip(0.24 * crowd, 0.0012, 0.03)
            if self.settings.look == "spheres"
            else np.clip(0.12 * crowd, 0.001, 0.012)
        )
        return float(share) * self.scale

    def _palette_srgb(self, groups: int) -> Array:
        if self.coloring.kind == "none":
            return np.array([colormaps.PLAIN])
        if self.coloring.kind == "group":
            return colormaps.group_colors(max(groups, 12))
        return readable(colormaps.colormap(self.settings.colormap, 1024), is_light(self.settings))

    @property
    def least(self) -> float:
        """Smallest drawn radius [samples]: a lone ball stays a ball, a million dots stay apart."""
        at_1080 = np.interp(np.log10(max(self.scene.count, 1)), [0.3, 1.8, 4.0], [11.0, 6.0, 1.0])
        return float(max(at_1080 * self.height / 1080, 0.75 * self.samples))

    def draw(self, frame: Frame, turn: float = 0.0) -> Picture:
        """The picture of one frame, [height, width, 3] sRGB; the camera turned by `turn` degrees about its
        target."""
        viewpoint = self.viewpoint.turned(turn) if turn else self.viewpoint
        view = viewpoint.view(self.center, self.scale, self.width, self.height)
        planes = _towards(self.planes, view)
        particles = self._place(frame, view, planes)
        shadow, sky = self._maps(particles)
        dots = self.settings.look == "dots"
        order = project.far_to_near(particles.sphere, particles.box) if dots else np.empty(0, np.int32)
        first, items = project.bin_bands(particles.box, order, view.height)
        segments = self._trail_segments(frame, view)
        width, height = self.settings.size
        out = np.empty((height, width, 3), np.uint8)

        haze = self._haze(viewpoint)

        def band(b: int) -> None:
            row0 = b * BAND
            rows = min(BAND, view.height - row0)
            layers, image, paths = self._buffers(view.width)
            mine = items[first[b] : first[b + 1]]
            raster.clear_layers(layers)
            if not dots:
                raster.raster_spheres(particles.sphere, particles.box, mine, row0, view, layers)
            if segments is None:
                paths = _NO_PATHS
            else:
                shade.draw_paths(*segments, row0, rows, paths)
            shade.shade_band(
                row0, view, planes, self.light, self.theme, shadow, sky, particles.sphere, particles.color,
                self.palette, layers, paths, image,
            )  # fmt: skip
            if dots:
                spheres = np.empty((len(mine), 4), np.float32)
                project.gather(particles.sphere, mine, spheres)
                shade.draw_dots(row0, view, haze, spheres, mine, particles.color, self.palette, image)
            top, bottom = row0 // self.samples, (row0 + rows) // self.samples
            shade.develop(
                image, bottom - top, self.samples, self.settings.exposure, self.curve, out[top:bottom]
            )

        self.team.each(band, len(first) - 1)
        self.overlay.draw(out, float(frame.time))
        return out

    def _haze(self, viewpoint: Viewpoint) -> tuple[float, float, float, float, float]:
        """Colour and depth range of the fog on dots: from the scene's near side to its far side."""
        away = float(np.linalg.norm(viewpoint.eye - self.center)) / self.scale
        return (*self.theme.bottom, away - 1.0, 0.5)

    def _place(self, frame: Frame, view: View, planes: Planes) -> Particles:
        position = np.ascontiguousarray(frame.position)
        n = len(position)
        radius = np.full(n, self.radius / self.scale, np.float32)
        if self.use_radius and self.settings.particle_radius is None:
            own = np.asarray(frame["radius"], np.float64) / self.scale
            np.copyto(radius, own.astype(np.float32), where=np.isfinite(own) & (own > 0))
        world, sphere = np.empty((n, 3), np.float32), np.empty((n, 4), np.float32)
        box = np.empty((n, 4), np.int32)
        chunks = -(-n // CHUNK)
        bad = [0] * chunks

        def piece(c: int) -> None:
            start, stop = c * CHUNK, min((c + 1) * CHUNK, n)
            bad[c] = project.to_scene(position, start, stop, self.center, self.scale, world)
            project.to_view(world, radius, start, stop, view, planes, self.least, sphere, box)

        self.team.each(piece, chunks)
        with self._lock:
            self.bad_positions += sum(bad)
        return Particles(world, sphere, box, self._colors(frame))

    def _colors(self, frame: Frame) -> Array:
        return color_indices(frame, self.coloring, *self.range, len(self.palette))

    def _maps(self, particles: Particles) -> tuple[ShadowMap, SkyMap]:
        """Depth seen from the light, and the blurred heights seen from above."""
        flat = np.full((1, 1), np.inf, np.float32)
        light = self.light
        dots_alone = self.settings.look == "dots" and not len(
            self.planes.point
        )  # nothing shows their shadows
        if not self.settings.shadows or not len(particles.world) or dots_alone:
            axes = _map_axes(light.direction)
            return ShadowMap(flat, axes, 1.0), SkyMap(flat, flat, axes, 1.0, 0.0, 1.0)
        reach = MAP_REACH * float(np.linalg.norm(self.scene.high - self.scene.low)) / (2 * self.scale)
        reach = max(reach, 0.3) + 2 * self.radius / self.scale
        typical = max(self.radius / self.scale, 1e-3)
        size = 2048 if typical * 512 / reach < 2.5 and self.height > 600 else 1024
        axes = _map_axes(light.direction)
        shadow = ShadowMap(self._depth_map(particles, axes, size, reach), axes, 0.5 * size / reach)
        axes, scale = _map_axes(light.up), 0.5 * SKY_SIZE / reach
        depth = self._depth_map(particles, axes, SKY_SIZE, reach)
        blur = int(np.clip(round(1.2 * typical * scale), 2, 24))
        mean, square = np.empty_like(depth), np.empty_like(depth)
        base = self._lowest()
        raster.sky_moments(depth, base, blur, mean, square)
        return shadow, SkyMap(mean, square, axes, scale, base, max(2.0 * typical, 2.0 * blur / scale))

    def _lowest(self) -> float:
        """Height of the floor, or of the scene's bottom [scene units]."""
        up = np.array(self.light.up)
        heights = self.planes.point.astype(float) @ up
        floors = heights[(self.planes.normal @ up) > 0.7]
        return (
            float(floors.max())
            if len(floors)
            else -float(np.abs(up) @ (self.scene.high - self.scene.low)) / (2 * self.scale)
        )

    def _depth_map(self, particles: Particles, axes: Axes, size: int, reach: float) -> Array:
        n, scale = len(particles.world), 0.5 * size / reach
        disc, box = np.empty((n, 4), np.float32), np.empty((n, 4), np.int32)

        def piece(c: int) -> None:
            span = c * CHUNK, min((c + 1) * CHUNK, n)
            project.to_map(particles.world, particles.sphere, *span, axes, scale, size, disc, box)

        self.team.each(piece, -(-n // CHUNK))
        first, items = project.bin_bands(box, np.empty(0, np.int32), size)
        depth = np.empty((size, size), np.float32)

        def band(b: int) -> None:
            mine = items[first[b] : first[b + 1]]
            discs = np.empty((len(mine), 4), np.float32)
            project.gather(disc, mine, discs)
            raster.raster_depth(discs, b * BAND, scale, depth)

        self.team.each(band, len(first) - 1)
        return depth

    def _trail_segments(self, frame: Frame, view: View) -> tuple[Array, Array] | None:
        if self.trails is None:
            return None
        width = max(3.6 * self.height / 1080, 1.5 * self.samples)
        segments = self.trails.segments(
            float(frame.time), view, self.center, self.scale, width, np.asarray(frame.id)
        )
        return segments if len(segments[0]) else None

    def _buffers(self, width: int) -> tuple[Layers, Array, Paths]:
        """This thread's samples of one band."""
        scratch: Any = self._scratch
        if not hasattr(scratch, "buffers"):
            shape = (BAND, width)
            floats, ints = (np.empty((5, *shape), np.float32), np.empty((3, *shape), np.int32))
            scratch.buffers = (
                Layers(floats[0], ints[0], floats[1], ints[1]),
                np.empty((*shape, 3), np.float32),
                Paths(floats[2], ints[2], floats[3]),
            )
        buffers: tuple[Layers, Array, Paths] = scratch.buffers
        return buffers


class Particles:
    """A frame's particles: `world` and `sphere` (camera axes and drawn radius) in scene units, samples,
    colours."""

    def __init__(self, world: Array, sphere: Array, box: Array, color: Array) -> None:
        self.world, self.sphere, self.box, self.color = world, sphere, box, color


def _towards(planes: Planes, view: View) -> Planes:
    """The planes with those marked that have the camera on their legal side."""
    height = np.einsum("ij,ij->i", np.array(view.eye) - planes.point, planes.normal)
    return planes._replace(facing=height > 1e-6)


def _map_axes(towards: Triple) -> Axes:
    """Axes of a map seen from `towards`: right, up, and away from there."""
    forward = -np.array(towards)
    side = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    return axes_of([side, np.cross(side, forward), forward])
