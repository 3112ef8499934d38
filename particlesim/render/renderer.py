"""The renderer of one trajectory with one set of settings: what is the same for all frames, and how a frame becomes
pixels."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.process.threads import Team
from particlesim.render.kernels import project, raster, shade
from particlesim.render.kernels.background import paint_background
from particlesim.render.kernels.multisample import (
    clear_samples,
    nearest_depth,
    raster_balls,
    raster_triangles,
    raster_tubes,
)
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import (
    Array,
    Light,
    Paths,
    Planes,
    Solids,
    View,
)
from particlesim.render.kernels.shade_solids import shade_samples
from particlesim.render.kernels.solids import box_triangles, box_tubes
from particlesim.render.overlay import Overlay
from particlesim.render.scene import colormaps
from particlesim.render.scene.bodies import Bodies
from particlesim.render.scene.box_edges import AlongPaths, BoxEdges
from particlesim.render.scene.camera import Viewpoint, choose_viewpoint
from particlesim.render.scene.coloring import NOTHING, choose_coloring, color_indices, quantized, values_of
from particlesim.render.scene.draw_list import NO_BOX, Act, Balls, Buffers, Cast
from particlesim.render.scene.extents import Survey, foreseen, survey
from particlesim.render.scene.lighting import (
    choose_light,
    choose_theme,
    grid_planes,
    is_light,
    readable,
    tone_curve,
)
from particlesim.render.scene.props import Props
from particlesim.render.scene.shadow_maps import Lamp
from particlesim.render.scene.sizes import Sizes
from particlesim.render.scene.source import BallShape, Frame, FrameSource, MeshShape, PlaneShape
from particlesim.render.scene.trails import AUTOMATIC, collect_trails
from particlesim.scenario.rendering import RenderSettings
from particlesim.trajectory.box import Box

Picture = npt.NDArray[np.uint8]

CHUNK = 1 << 16
"""Particles of one piece of work."""

SEA = 1.6
"""Half a side of such a surface, in half extents of the scene."""

_AS_IT_IS = np.empty(0, np.int32)
_NOTHING = np.empty((0, 0), np.float32)
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
        balls: tuple[BallShape, ...] = (),
        meshes: tuple[MeshShape, ...] = (),
        title: str = "",
        team: Team,
    ) -> None:
        if len(source) == 0:
            raise UsageError("the trajectory holds no frame", "Run the scenario again; nothing was recorded.")
        self.settings, self.team = settings, team
        self.bodies = Bodies(source, settings)
        groups = tuple(getattr(source, "groups", ()))
        self.own_colors = {**self._cloth(), **settings.colors}
        self.coloring = choose_coloring(source, settings.color_by)
        if settings.color_by == "auto" and groups and set(self.own_colors) >= set(groups):
            self.coloring = NOTHING  # nothing is left that a value could colour
        box: Box | None = getattr(source, "box", None)
        self.box = None if box is None or self.bodies else BoxEdges(box)
        self._follows_paths = box is not None and self.box is None
        self.scene = self._extents(source)
        if self.box is not None:
            self.scene = self.scene.with_points(self.box.corners)
        if len(self.bodies.links.world):
            self.scene = self.scene.with_points(self.bodies.links.world)
        self.center, self.scale = self.scene.center, self.scene.half_extent
        low, high = self.scene.values if settings.color_range == "auto" else settings.color_range
        self.range = (float(low), float(high))
        self.samples = settings.supersampling
        self.width, self.height = (side * self.samples for side in settings.size)
        self.use_radius = "radius" in source.fields and settings.look == "spheres"
        self.sizes = Sizes(settings, self.scene, self.bodies, self.scale, self.use_radius)
        self.radius, self.line_radii = self.sizes.radius(), self.sizes.line_radii()
        aspect = self.width / self.height
        shapes = planes if settings.ground else ()
        solid = balls if settings.ground else ()
        stage = tuple(each for each in meshes if settings.ground or each.group is not None)
        radius = max(self.radius, self.scene.largest if self.use_radius else 0.0)
        still = tuple(each for each in stage if not each.fluid)
        self.viewpoint = choose_viewpoint(settings.camera, self.scene, radius, shapes, aspect, solid, still)
        self.light: Light = choose_light(settings, self.viewpoint)
        self.theme = choose_theme(settings)
        self.planes = grid_planes(shapes, self.center, self.scale)
        self.balls = Balls.of(solid, self.center, self.scale)
        stage = tuple(each.spread(self.center, SEA * self.scale) for each in stage)
        self.props = Props(stage, self.center, self.scale, source[0])
        srgb = self._palette_srgb(groups)
        self.shades = len(srgb)
        own = np.array(list(self.own_colors.values()), float).reshape(-1, 3)
        self.palette = colormaps.to_linear(
            np.concatenate([srgb, own, [colormaps.WATER, colormaps.STONE]])
        ).astype(np.float32)
        self.paint = {name: self.shades + k for k, name in enumerate(self.own_colors)}
        self._has_groups = "group" in source.fields
        self._group_paint = np.array([self.paint.get(name, -1) for name in groups])
        self._sheer = self._seen_through()
        longest = float(np.abs(source.times).max(initial=0.0))
        self.overlay = Overlay(
            settings, self.coloring, self.range, srgb, groups, title, self.scene.count, longest
        )
        self.curve = tone_curve()
        wanted = settings.trails
        few = self.scene.count <= AUTOMATIC and len(source) > 1 and not self.bodies
        draws = wanted is True or (wanted == "auto" and few)
        self.trails = collect_trails(source, self._colors) if draws else None
        self.bad_positions = 0
        self._lock = threading.Lock()
        self._scratch = threading.local()

    def _seen_through(self) -> list[tuple[float, Array]]:
        """What hides only a part of what is behind it: which part, and which triangles [t]."""
        clear, skin, skins = self.props.opacity, self.bodies.skin, self.bodies.skins
        found = [
            (share, np.concatenate([skin == list(skins).index(name), np.zeros(len(clear), np.bool_)]))
            for name, share in self.settings.opacity.items()
            if share < 1 and name in skins
        ]
        shares = np.unique(clear[clear < 1]).tolist()
        return found + [
            (share, np.concatenate([np.zeros(len(skin), np.bool_), clear == share])) for share in shares
        ]

    def _extents(self, source: FrameSource) -> Survey:
        """What pictures have to show: of all frames, or as the settings say, and then without a look at frames to come if
        they say the range of the colours, too."""
        bounds, value = self.settings.bounds, self.coloring.kind in ("value", "strain")
        known = None if bounds is None else foreseen(source, bounds)
        if known is not None and not (value and self.settings.color_range == "auto"):
            return known
        seen = survey(source, self._values, self._as_drawn)
        return seen if known is None else replace(known, values=seen.values)

    @property
    def _multisampled(self) -> bool:
        """Whether there is more than particles, whose outlines meet."""
        drawn = (self.balls.radius, self.bodies.links.owner)
        return bool(self.bodies) or any(map(len, drawn)) or self.props.number > 0

    def _cloth(self) -> dict[str, tuple[float, float, float]]:
        """Plain colours of surfaces, where nothing else is asked for."""
        if self.settings.color_by != "auto":
            return {}
        cloth = colormaps.CLOTH
        return {name: cloth[k % len(cloth)] for k, name in enumerate(self.bodies.skins)}

    def _palette_srgb(self, groups: tuple[str, ...]) -> Array:
        if self.coloring.kind == "none":
            return np.array([colormaps.PLAIN])
        if self.coloring.kind == "group":
            found = colormaps.group_colors(max(len(groups), 12))
            for k, name in enumerate(groups):
                found[k] = self.own_colors.get(name, found[k])
            return found
        colors = colormaps.colormap(self.settings.colormap, 1024)
        return readable(colors, is_light(self.settings), shaded=bool(self.bodies))

    def draw(self, frame: Frame, turn: float = 0.0) -> Picture:
        """The picture of one frame, [height, width, 3] sRGB; the camera turned by `turn` degrees about its
        target."""
        frame = self._as_drawn(frame)
        viewpoint = self.viewpoint.turned(turn) if turn else self.viewpoint
        view = viewpoint.view(self.center, self.scale, self.width, self.height)
        planes = _towards(self.planes, view)
        cast = self._place(frame, view, planes)
        bare = _without(cast, [mask for _, mask in self._sheer])
        shadow, sky = self._lamp().maps(bare, self.team)
        act = Act(view, planes, shadow, sky, bare, self._haze(viewpoint), self._lines(frame, view))
        out = self._paint(act)
        for share, mask in self._sheer:
            others = [other for _, other in self._sheer if other is not mask]
            out = _mixed(out, self._paint(replace(act, cast=_without(cast, others))), share)
        self.overlay.draw(out, float(frame.time))
        return out

    def _paint(self, act: Act) -> Picture:
        """The picture without its overlay."""
        view, cast = act.view, act.cast
        spheres = project.bin_bands(cast.box, self._order(cast), view.height)
        triangles = project.bin_bands(cast.triangle_box, _AS_IT_IS, view.height)
        tubes = project.bin_bands(cast.tube_box, _AS_IT_IS, view.height)
        width, height = self.settings.size
        out = np.empty((height, width, 3), np.uint8)

        def band(b: int) -> None:
            row0 = b * BAND
            image = self._buffers(view.width).image
            paint_background(row0, view, act.planes, self.light, self.theme, act.shadow, act.sky, image)
            mine = [items[first[b] : first[b + 1]] for first, items in (spheres, triangles, tubes)]
            if self._multisampled:
                self._paint_solids(act, row0, mine)
            else:
                self._paint_particles(act, row0, mine[0])
            rows = min(BAND, view.height - row0)
            top, bottom = row0 // self.samples, (row0 + rows) // self.samples
            shade.develop(
                image, bottom - top, self.samples, self.settings.exposure, self.curve, out[top:bottom]
            )

        self.team.each(band, len(spheres[0]) - 1)
        return out

    def _order(self, cast: Cast) -> Array:
        """In which order particles are drawn: dots from far to near, spheres in any."""
        if self.settings.look == "dots":
            return np.asarray(project.far_to_near(cast.sphere, cast.box))
        return _AS_IT_IS

    def _paint_particles(self, act: Act, row0: int, spheres: Array) -> None:
        """The samples of one band where there is nothing but particles."""
        cast, view, buffers = act.cast, act.view, self._buffers(act.view.width)
        raster.clear_layers(buffers.layers)
        dots = self.settings.look == "dots"
        if not dots:
            raster.raster_spheres(cast.sphere, cast.box, spheres, row0, view, buffers.layers)
        shade.shade_band(
            row0, view, self.light, act.shadow, act.sky, cast.sphere, cast.color, self.palette,
            buffers.layers, self._paths(act, row0), buffers.image,
        )  # fmt: skip
        if dots:
            self._paint_dots(act, row0, spheres, _NOTHING)

    def _paint_solids(self, act: Act, row0: int, items: list[Array]) -> None:
        """The samples of one band with surfaces and tubes: `items` are its spheres, triangles and tubes."""
        cast, view, buffers = act.cast, act.view, self._buffers(act.view.width)
        spheres, triangles, tubes = items
        seen, solids, n = buffers.samples, cast.solids, len(cast.sphere)
        clear_samples(seen)
        dots = self.settings.look == "dots"
        if len(self.balls.radius):
            particle = spheres < n - len(self.balls.radius) - self.props.number
            raster_balls(cast.sphere, cast.box, spheres[~particle], row0, view, act.planes, seen)
            spheres = spheres[particle]
        if not dots:
            raster_balls(cast.sphere, cast.box, spheres, row0, view, None, seen)
        raster_triangles(cast.sphere, solids, n, cast.triangle_box, triangles, row0, view, seen)
        base, least = n + len(solids.corner), self.sizes.least_tube()
        raster_tubes(cast.sphere, solids, least, base, cast.tube_box, tubes, row0, view, seen)
        shade_samples(
            row0, view, self.light, act.shadow, act.sky, cast.sphere, cast.color, self.palette,
            solids, least, seen, self._paths(act, row0), buffers.image,
        )  # fmt: skip
        if dots:
            nearest_depth(seen, buffers.layers.near)
            self._paint_dots(act, row0, spheres, buffers.layers.near)

    def _paint_dots(self, act: Act, row0: int, items: Array, solid: Array) -> None:
        buffers, cast = self._buffers(act.view.width), act.cast
        spheres = np.empty((len(items), 4), np.float32)
        project.gather(cast.sphere, items, spheres)
        shade.draw_dots(
            row0, act.view, act.haze, spheres, items, cast.color, self.palette, solid, buffers.image
        )

    def _paths(self, act: Act, row0: int) -> Paths:
        """The trails of one band."""
        if act.trails is None:
            return _NO_PATHS
        paths = self._buffers(act.view.width).paths
        shade.draw_paths(*act.trails, row0, min(BAND, act.view.height - row0), paths)
        return paths

    def _haze(self, viewpoint: Viewpoint) -> tuple[float, float, float, float, float]:
        """Colour and depth range of the fog on dots: from the scene's near side to its far side."""
        away = float(np.linalg.norm(viewpoint.eye - self.center)) / self.scale
        return (*self.theme.bottom, away - 1.0, 0.5)

    def _place(self, frame: Frame, view: View, planes: Planes) -> Cast:
        position = np.ascontiguousarray(frame.position)
        n = len(position)
        balls = self.balls
        last = n + len(balls.radius)
        linked, strain, owner = self.bodies.links.at(frame, self.bodies.rows)
        first = last + self.props.number
        every = first + 2 * len(owner)
        radius, sized = self._radii(frame, n)
        radius = np.concatenate([radius, balls.radius, np.zeros(every - last, np.float32)])
        world, sphere = np.empty((every, 3), np.float32), np.empty((every, 4), np.float32)
        box = np.empty((every, 4), np.int32)
        world[n:last] = balls.center
        world[last:first], normal = self.props.at(frame)
        world[first:] = (linked.reshape(-1, 3) - self.center) / self.scale
        chunks = -(-n // CHUNK)
        bad = [0] * chunks

        def piece(c: int) -> None:
            start, stop = c * CHUNK, min((c + 1) * CHUNK, n)
            bad[c] = project.to_scene(position, start, stop, self.center, self.scale, world)
            project.to_view(world, radius, start, stop, view, planes, self.sizes.least(), sphere, box)

        self.team.each(piece, chunks)
        project.to_view(world, radius, n, every, view, planes, 0.0, sphere, box)
        with self._lock:
            self.bad_positions += sum(bad)
        concealed = self.bodies.concealed(frame, sized) | self.props.carried(frame)
        hidden = np.concatenate([concealed, np.arange(n, every) >= last])
        box[hidden] = NO_BOX
        color = self._colors(frame)
        solids, whole = self._solids(frame, world, color)
        solids, whole = self._with_props(solids, whole, world[:first], last, normal, view)
        painted, stone = self._painted(frame, color), len(self.palette) - 1
        solids = self._with_links(solids, first, strain, owner, stone)
        others = (np.full(k, stone, color.dtype) for k in (last - n, every - first))
        color = np.concatenate([painted, next(others), self.props.colors(frame, painted, stone), *others])
        triangle_box, tube_box = (np.empty((len(s), 4), np.int32) for s in (solids.corner, solids.end))
        box_triangles(world, sphere, solids.corner, 0, len(triangle_box), view, planes, triangle_box)
        triangle_box[~whole] = NO_BOX
        least = self.sizes.least_tube()
        box_tubes(world, sphere, solids.end, 0, len(tube_box), view, planes, solids.radius, least, tube_box)
        return Cast(world, sphere, box, color, hidden, solids, whole, triangle_box, tube_box)

    def _with_props(
        self, solids: Solids, whole: Array, world: Array, first: int, normal: Array, view: View
    ) -> tuple[Solids, Array]:
        """The surfaces with those of props, whose corners begin at row `first` and have these normals."""
        props = self.props
        if not props.number:
            return solids, whole
        added = solids._replace(
            corner=np.concatenate([solids.corner, props.faces + np.int32(first)]),
            shade=np.concatenate([solids.shade, props.shade + np.int32(len(solids.normal))]),
            closed=np.concatenate([solids.closed, props.closed]),
            normal=np.concatenate([solids.normal, normal]),
        )
        return added, np.concatenate([whole, props.seen(world[first:], view.eye)])

    def _with_links(self, solids: Solids, first: int, strain: Array, owner: Array, stone: int) -> Solids:
        """The tubes with those at points of rigid bodies, whose ends begin at row `first`."""
        tint = np.full(len(owner), stone, solids.end_color.dtype)
        if self.coloring.kind == "strain":
            tint = quantized(strain, *self.range, self.shades).astype(tint.dtype)
        for k, name in enumerate(self.bodies.owners):
            if name in self.paint:
                tint[owner == k] = self.paint[name]
        end = first + np.arange(2 * len(owner), dtype=np.int32).reshape(-1, 2)
        radius = (self.line_radii / self.scale).astype(np.float32)[owner]
        return solids._replace(
            end=np.concatenate([solids.end, end]),
            end_color=np.concatenate([solids.end_color, np.repeat(tint[:, None], 2, axis=1)]),
            radius=np.concatenate([solids.radius, radius]),
        )

    def _radii(self, frame: Frame, n: int) -> tuple[Array, Array]:
        """Drawn radii [scene units], shape [n], and which particles have a size of their own."""
        radius = np.full(n, self.radius / self.scale, np.float32)
        if self.settings.particle_radius is not None or not self.use_radius:
            return radius, np.full(n, self.settings.particle_radius is not None)
        own = np.asarray(frame["radius"], np.float64) / self.scale
        sized = np.isfinite(own) & (own > 0)
        np.copyto(radius, own.astype(np.float32), where=sized)
        return radius, sized

    def _solids(self, frame: Frame, world: Array, color: Array) -> tuple[Solids, Array]:
        """Surfaces and tubes, and which triangles are whole."""
        bodies = self.bodies
        corner, whole = bodies.surface(frame)
        end, strain, owner = bodies.line_ends(frame)
        if self.coloring.kind == "strain":
            tint = quantized(strain, *self.range, self.shades)
            end_color = np.repeat(tint[:, None], 2, axis=1)
        else:
            end_color = color[end]
        for k, name in enumerate(bodies.owners):
            if name in self.paint:
                end_color[owner == k] = self.paint[name]
        normal = bodies.normals(world, corner, whole, self.team)
        radius = (self.line_radii / self.scale).astype(np.float32)[owner]
        solids = Solids(corner, bodies.fans.shade, bodies.closed, normal, end, end_color, radius)
        return solids, whole

    def _colors(self, frame: Frame) -> Array:
        if self.coloring.kind == "strain":
            return quantized(self.bodies.strain_at(frame), *self.range, self.shades)
        return color_indices(frame, self.coloring, *self.range, self.shades)

    def _painted(self, frame: Frame, color: Array) -> Array:
        """The same, but for groups that have a colour of their own."""
        if not (self._group_paint >= 0).any():
            return color
        group = np.asarray(frame["group"]).astype(np.int64) if self._has_groups else 0
        own = self._group_paint[group]
        return np.where(own >= 0, own, color).astype(np.uint16)

    def _values(self, frame: Frame) -> Array | None:
        """What the colours show in a frame, or None when that is no number."""
        if self.coloring.kind == "strain":
            return self.bodies.strains(frame)
        return values_of(frame, self.coloring)

    def _lamp(self) -> Lamp:
        # Nothing shows the shadows of dots alone.
        dots_alone = self.settings.look == "dots" and not len(self.planes.point) and not self._multisampled
        radius = self.radius / self.scale
        return Lamp(
            self.light,
            self.planes,
            self.scene.high - self.scene.low,
            self.scale,
            radius,
            0.01 if self.bodies else max(radius, 1e-3),
            self.settings.shadows and not dots_alone,
            self.height > 600,
        )

    def _lines(self, frame: Frame, view: View) -> tuple[Array, Array] | None:
        """Trails, and the edges of a periodic box."""
        found: list[tuple[Array, Array]] = []
        width = max(3.6 * self.height / 1080, 1.5 * self.samples)
        if self.trails is not None:
            found.append(
                self.trails.segments(
                    float(frame.time), view, self.center, self.scale, width, np.asarray(frame.id)
                )
            )
        if self.box is not None:
            edges = self.box.segments(view, self.center, self.scale, 0.4 * width)
            found.append((edges, np.full(len(edges), len(self.palette) - 1, np.int32)))
        if not any(len(rows) for rows, _ in found):
            return None
        return np.concatenate([rows for rows, _ in found]), np.concatenate([color for _, color in found])

    def _as_drawn(self, frame: Frame) -> Frame:
        """A frame whose springs and surfaces do not lead across a periodic box: there, positions are those along paths."""
        return AlongPaths(frame) if self._follows_paths else frame

    def _buffers(self, width: int) -> Buffers:
        """This thread's samples of one band."""
        scratch: Any = self._scratch
        if not hasattr(scratch, "buffers"):
            scratch.buffers = Buffers.of(width, self._multisampled)
        buffers: Buffers = scratch.buffers
        return buffers


def _without(cast: Cast, masks: list[Array]) -> Cast:
    """A cast without some of its triangles, each mask of shape [t]."""
    if not masks:
        return cast
    gone = np.logical_or.reduce(masks)
    whole, box = cast.whole & ~gone, cast.triangle_box.copy()
    box[~whole] = NO_BOX
    return replace(cast, whole=whole, triangle_box=box)


def _mixed(behind: Picture, front: Picture, share: float) -> Picture:
    """A picture that shows `front` with this share, and what is `behind` it with the rest."""
    there = behind.astype(np.float32)
    return np.asarray(there + share * (front - there) + 0.5, np.uint8)


def _towards(planes: Planes, view: View) -> Planes:
    """The planes with those marked that have the camera on their legal side."""
    height = np.einsum("ij,ij->i", np.array(view.eye) - planes.point, planes.normal)
    return planes._replace(facing=height > 1e-6)
