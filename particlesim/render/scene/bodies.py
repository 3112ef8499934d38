"""The surfaces and lines between particles as they are drawn, and which particles they replace.

A group with triangles is a surface, springs without triangles are lines, everything else is particles; the settings'
`styles` may say otherwise. Sets of springs of a body are called GROUP.KIND; others have a name of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from particlesim.process.threads import Team
from particlesim.render.kernels.records import Array, Float32s
from particlesim.render.kernels.solids import face_normals, smooth_normals
from particlesim.render.scene.links import Links
from particlesim.render.scene.smooth_normals import Fans, is_closed, smooth_fans
from particlesim.render.scene.source import Frame, FrameSource
from particlesim.scenario.rendering import RenderSettings

BEND = ".bend"
"""Springs to every other particle: they lie on others, and are not drawn."""

SHEAR = ".shear"
"""Diagonals: drawn in a bridge, but not where they brace a surface, whose threads they would hide."""

GRAIN = 1 << 12
"""Least number of triangles or normals for a piece of work."""

_NO_FANS = Fans(np.empty((0, 3), np.int32), np.zeros(1, np.int64), np.empty(0, np.int32))


@dataclass(frozen=True)
class Springs:
    """Pairs of ids, shape [n, 2], rest lengths [m] and when each broke [s] (infinity: never), shape [n]."""

    pairs: Array
    rest: Array
    broke: Array

    @staticmethod
    def of(sets: Sequence[Any]) -> Springs:
        """Those of several sets of a topology."""
        return Springs(
            np.concatenate([np.empty((0, 2), np.int64), *(each.pairs for each in sets)]),
            np.concatenate([np.empty(0), *(each.rest for each in sets)]),
            np.concatenate([np.empty(0), *(each.broke for each in sets)]),
        )


class Bodies:
    """The surfaces and lines of a trajectory; `links` are the lines that end at points of rigid bodies.

    `triangles` [t, 3]: ids; `torn` [t]: when a triangle lost the first of its springs [s]; `skin` [t]: the number in `skins`
    of the group that it is of. `lines`: the springs that are drawn, and `owner` [l]: the number in `owners` of the body or
    set of springs that each belongs to. `springs`: those that show strain, all but the ones against bending and the hidden
    ones.
    """

    def __init__(self, source: FrameSource, settings: RenderSettings) -> None:
        found: Mapping[str, Any] = getattr(source, "topology", {})
        groups = tuple(getattr(source, "groups", ()))
        style = _styles(found, settings)
        surfaces = [each for name, each in found.items() if len(each.triangles) and style(name) == "surface"]
        self.triangles = np.concatenate([np.empty((0, 3), np.int64), *(s.triangles for s in surfaces)])
        self.torn = np.concatenate([np.empty(0), *(_torn(each, found) for each in surfaces)])
        self.skins = tuple(each.name for each in surfaces)
        self.skin = np.repeat(np.arange(len(surfaces)), [len(each.triangles) for each in surfaces])
        skins = {name for name, each in found.items() if len(each.triangles)}
        drawn = {name: each for name, each in found.items() if _is_line(name, style, skins)}
        self.owners = tuple(dict.fromkeys(owner_of(name) for name in drawn))
        owned = [(self.owners.index(owner_of(name)), each) for name, each in drawn.items()]
        posed = "orientation" in source.fields
        self.links = Links([(k, each) for k, each in owned if each.points is not None and posed])
        owned = [(k, each) for k, each in owned if each.points is None]
        self.lines = Springs.of([each for _, each in owned])
        self.owner = np.concatenate(
            [np.empty(0, np.int64), *(np.full(len(each.pairs), k) for k, each in owned)]
        )
        self.springs = Springs.of(
            [each for name, each in found.items() if each.points is None and _shows_strain(name, style)]
        )
        self._limit = 1 + max(
            (int(ids.max()) for ids in (self.triangles, self.springs.pairs) if len(ids)), default=-1
        )
        self.fans = self._smoothed(source)
        closed = [np.full(len(s.triangles), is_closed(s.triangles)) for s in surfaces]
        self.closed = np.concatenate([np.empty(0, np.bool_), *closed])
        covered = {k for k, name in enumerate(groups) if style(name) in ("surface", "hidden")}
        self._covered = sorted(covered)
        self._as_points = [k for k, name in enumerate(groups) if settings.styles.get(name) == "points"]
        self._has_groups = "group" in source.fields

    def __bool__(self) -> bool:
        """Whether anything but particles is drawn."""
        return len(self.triangles) > 0 or len(self.lines.pairs) > 0

    def _smoothed(self, source: FrameSource) -> Fans:
        if not len(self.triangles):
            return _NO_FANS
        first = source[0]
        corner = np.maximum(self.rows(first, self.triangles), 0)
        return smooth_fans(
            self.triangles, np.asarray(getattr(first, "unwrapped", first.position), float)[corner]
        )

    def rows(self, frame: Frame, ids: Array) -> Array:
        """Rows of particles in a frame, int32, the shape of `ids`; −1 for those that are not there."""
        present = np.asarray(frame.id)
        if len(present) >= self._limit and np.array_equal(present[: self._limit], np.arange(self._limit)):
            return ids.astype(np.int32)
        if not len(present):
            return np.full(ids.shape, -1, np.int32)
        order = np.argsort(
            present, kind="stable"
        )  # quick, as groups have rising ids; and ids may be any numbers
        row = order[np.minimum(np.searchsorted(present, ids, sorter=order), len(order) - 1)]
        return np.where(present[row] == ids, row, -1).astype(np.int32)

    def concealed(self, frame: Frame, sized: Array) -> Array:
        """Which particles are not drawn as such, bool [n]: those of surfaces, those hidden, and joints of lines that
        have no size (`sized` [n]: which have one)."""
        hidden = np.zeros(len(frame.position), np.bool_)
        if not self and not self._covered:
            return hidden
        rows = self.rows(frame, self.lines.pairs)
        hidden[rows[rows >= 0]] = True
        hidden &= ~sized
        if self._has_groups:
            group = np.asarray(frame["group"])
            hidden &= ~np.isin(group, self._as_points)
            hidden |= np.isin(group, self._covered)
        elif self._as_points:
            hidden[:] = False
        elif self._covered:
            hidden[:] = True
        return hidden

    def surface(self, frame: Frame) -> tuple[Array, Array]:
        """Rows of the corners of all triangles, int32 [t, 3], and which triangles are whole, bool [t]."""
        corner = self.rows(frame, self.triangles)
        whole = (self.torn > frame.time) & (corner >= 0).all(axis=1)
        return np.maximum(corner, 0), whole

    def normals(self, world: Float32s, corner: Array, whole: Array, team: Team) -> Float32s:
        """Smooth normals of the surfaces, float32 [k, 3]; triangles that are torn do not count."""
        face = np.empty((len(corner), 3), np.float32)
        first, fan = self.fans.first, self.fans.fan
        normal = np.empty((len(first) - 1, 3), np.float32)
        team.over_range(len(face), GRAIN, lambda a, b: face_normals(world, corner, a, b, face))
        face[~whole] = 0.0
        team.over_range(len(normal), GRAIN, lambda a, b: smooth_normals(face, first, fan, a, b, normal))
        return normal

    def line_ends(self, frame: Frame) -> tuple[Array, Array, Array]:
        """Rows of both ends of the lines that are there, int32 [l, 2], their strains [l] and their owners [l]."""
        ends = self.rows(frame, self.lines.pairs)
        there = (self.lines.broke > frame.time) & (ends >= 0).all(axis=1)
        ends = ends[there]
        stretched = strain(frame.position, ends, self.lines.rest[there])
        return np.ascontiguousarray(ends), stretched, self.owner[there]

    def strain_at(self, frame: Frame) -> Array:
        """Root mean square of the strains of all springs that meet in a particle, shape [n]; 0 where there are none."""
        ends = self.rows(frame, self.springs.pairs)
        there = (self.springs.broke > frame.time) & (ends >= 0).all(axis=1)
        ends = ends[there]
        square = strain(frame.position, ends, self.springs.rest[there]) ** 2
        n = len(frame.position)
        total, number = np.zeros(n), np.zeros(n)
        for side in (ends[:, 0], ends[:, 1]):
            total += np.bincount(side, square, n)
            number += np.bincount(side, minlength=n)
        return np.asarray(np.sqrt(total / np.maximum(number, 1)))

    def strains(self, frame: Frame) -> Array:
        """All values of the colour "strain" in a frame: those of the lines, and those of the surfaces' points."""
        found = [self.line_ends(frame)[1], self.links.at(frame, self.rows)[1]]
        if len(self.triangles):
            corner, whole = self.surface(frame)
            found.append(self.strain_at(frame)[np.unique(corner[whole])])
        return np.concatenate(found)


def strain(position: Array, ends: Array, rest: Array) -> Array:
    """(l − L₀)/L₀ of springs between rows of `position`, shape [n]; 0 where the rest length is 0."""
    x = np.asarray(position)
    arm = x[ends[:, 1]].astype(np.float64) - x[ends[:, 0]]
    length = np.sqrt(np.einsum("ij,ij->i", arm, arm))
    return np.divide(length - rest, rest, out=np.zeros_like(length), where=rest > 0)


def owner_of(name: str) -> str:
    """The body that a set of springs is part of, or the set itself, by their names."""
    return name.rpartition(".")[0] or name


def _styles(found: Mapping[str, Any], settings: RenderSettings) -> Callable[[str], str]:
    """How a group or a set of springs is drawn, by its name."""
    surfaces = {name for name, each in found.items() if len(each.triangles)}

    def style(name: str) -> str:
        return settings.styles.get(name, "surface" if name in surfaces else "lines")

    return style


def _is_line(name: str, style: Callable[[str], str], skins: Collection[str]) -> bool:
    """Whether a set of springs is drawn: one of a body like its group, any other by its own name; `skins`: bodies that
    have a surface."""
    body = name.rpartition(".")[0]
    inner = name.endswith(BEND) or (name.endswith(SHEAR) and body in skins)
    return not inner and style(owner_of(name)) == "lines"


def _shows_strain(name: str, style: Callable[[str], str]) -> bool:
    """Whether a set of springs counts where points of surfaces show their strain."""
    return not name.endswith(BEND) and style(owner_of(name)) != "hidden"


def _torn(surface: Any, found: Mapping[str, Any]) -> Array:
    """When each triangle of a surface loses the first spring that lies along one of its edges [s]."""
    times = np.full(len(surface.triangles), np.inf)
    own = [each for name, each in found.items() if name.rpartition(".")[0] == surface.name]
    springs = Springs.of([each for each in (*own, surface) if np.isfinite(each.broke).any()])
    if not len(springs.pairs):
        return times
    size = 1 + max(int(surface.triangles.max()), int(springs.pairs.max()))
    key = springs.pairs.min(axis=1) * size + springs.pairs.max(axis=1)
    order = np.argsort(key)
    key, broke = key[order], springs.broke[order]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        ends = surface.triangles[:, [a, b]]
        edge = ends.min(axis=1) * size + ends.max(axis=1)
        at = np.minimum(np.searchsorted(key, edge), len(key) - 1)
        times = np.minimum(times, np.where(key[at] == edge, broke[at], np.inf))
    return times
