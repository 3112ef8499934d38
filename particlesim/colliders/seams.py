"""Seams: where a flat face of one collider lies against another, as under a box that stands on the floor.

What has no size and is exactly there is inside of neither: it would slide under the box, or fall between two boxes that
stand side by side. So such a face reaches a little into the other collider, farther than gaps are off by rounding. Nothing
else changes, as that part of it is hidden. Round sides, which touch in a line or at a point, stay as they are.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders.box import BoxRecord
from particlesim.colliders.bvh import build
from particlesim.colliders.cone import ConeRecord
from particlesim.colliders.cylinder import CylinderRecord
from particlesim.colliders.gaps import gaps_of
from particlesim.colliders.mesh import MeshRecord
from particlesim.colliders.moving import MovingRecord, frame_at
from particlesim.colliders.parts import IntersectionRecord, UnionRecord
from particlesim.colliders.pose import UNTURNED, ShiftedRecord, TurnedRecord, placed
from particlesim.laws.registry import Particle, gap

Floats = NDArray[np.float64]

REACH = 2.0**-41
"""How far a face reaches into what it touches, in parts of the size of the scene: much more than rounding errors of places,
much less than any that matters."""
REACH_SINGLE = 2.0**-17
"""The same in single precision; impacts are found in double, so that only places are off."""
TOUCHING = 2.0**-46
"""Gaps that count as none, in the same parts."""
FACING = 0.25
"""How far into the other a place on a face comes at least that is moved along its normal, in parts of that way."""
FINE, MOST = 2, 32
"""Places on a face that are looked at: as many along half its shorter side, and at most so many along the longer one."""
ROUND = 16
"""The same along a circle."""
FLAT, LARGE = 1e-9, 1e-3
"""By how much triangles in a plane may differ, and the part of the surface of a mesh that they have at least."""
LOOKS = 16
"""How often it is looked at colliders that move, whether they have come to touch others."""
BY_ONE, FEW = 8, 2048
"""As many places are looked at one by one rather than in halves; more than `FEW` are worth a kernel."""


class Face(NamedTuple):
    """A part of a surface: places on it and normals there, [n, 3] each; the shape with that part farther out by a length,
    and how far that is to be shifted [m]; and further shapes that the part may touch."""

    places: Floats
    normals: Floats
    out: Callable[[float], tuple[Any, Floats]]
    beside: tuple[Any, ...] = ()


def closed(shapes: Sequence[Any], size: float, dtype: np.dtype[Any], until: float = 0.0) -> list[Any]:
    """Shapes as kernels take them, with those faces farther out that touch another one; `size` is that of the scene [m],
    whose numbers have a precision. Where one of them moves, it is looked at `LOOKS` times from the start `until` a time [s],
    so that what comes to rest on another is found."""
    if len(shapes) == 1 and isinstance(shapes[0], MeshRecord):
        return list(shapes)  # to look for its sides takes long
    scene = _Scene(shapes, (REACH if dtype.itemsize == 8 else REACH_SINGLE) * size, TOUCHING * size)
    looks = LOOKS if until > 0 and any(scene.moves) else 0
    for time in np.linspace(0, until, 1 + looks).tolist():
        scene.close(time)
    return scene.shapes


class _Scene:
    """Shapes, how far their faces are to reach into others, and what counts as touching [m]."""

    def __init__(self, shapes: Sequence[Any], by: float, slack: float) -> None:
        self.shapes, self.by, self.slack = list(shapes), by, slack
        self.moves = [isinstance(each, MovingRecord) for each in shapes]
        self._standing: list[Any] = []
        self._faces: dict[int, tuple[Face, ...]] = {}
        self._now: dict[int, tuple[Face, ...]] = {}

    def close(self, time: float) -> None:
        """Puts those faces farther out that touch another shape at a time; after the start, where one of both moves. What is
        covered by the other comes first; of two that only overlap, one is enough."""
        self._standing, self._now = [standing(each, time) for each in self.shapes], {}
        partly = []
        for k in range(len(self.shapes)):
            near = self._near(k, time > 0)
            for j in range(len(self._parts(k)) if near or time == 0 else 0):
                covered = self._covered(k, j, near)
                if len(covered) and covered.all():
                    self._reach_out(k, j)
                elif covered.any():
                    partly.append((k, j, near))
        for k, j, near in partly:
            if self._covered(k, j, near).any():
                self._reach_out(k, j)

    def _parts(self, k: int) -> tuple[Face, ...]:
        """The faces of a shape as it stands; of one that moves, they are looked for once."""
        if k not in self._faces:
            self._faces[k] = faces(self.shapes[k].shape if self.moves[k] else self.shapes[k])
        if k not in self._now:
            self._now[k] = posed(self._standing[k], self._faces[k]) if self.moves[k] else self._faces[k]
        return self._now[k]

    def _reach_out(self, k: int, j: int) -> None:
        grown = self._standing[k] = self._parts(k)[j].out(self.by)[0]
        self.shapes[k] = self.shapes[k]._replace(shape=grown.shape) if self.moves[k] else grown
        del self._faces[k], self._now[k]

    def _near(self, k: int, led: bool) -> list[Any]:
        """The others that may touch some face of a shape; if one of both must be `led`, those."""
        pairs = [j for j in range(len(self.shapes)) if j != k and (not led or self.moves[j] or self.moves[k])]
        if not pairs or not self._parts(k):
            return []
        middle, around = _ball(np.concatenate([each.places for each in self._parts(k)]))
        return [j for j in pairs if _gaps(self._standing[j], middle[None])[0] <= around + self.slack]

    def _covered(self, k: int, j: int, near: Sequence[int]) -> Any:
        """Which places on a face of a shape those near it touch, of those that are on its surface."""
        face = self._parts(k)[j]
        covered = np.zeros(len(face.places), bool)
        for other in (*(self._standing[i] for i in near), *face.beside):
            touches = _touched(other, face.places, self.slack)
            ahead = face.places[touches] + self.by * face.normals[touches]
            touches[touches] = _gaps(other, ahead) < -FACING * self.by
            covered |= touches
        if not covered.any():
            return covered
        return covered[np.abs(_gaps(self._standing[k], face.places)) <= self.slack]


def standing(shape: Any, time: float) -> Any:
    """A shape as it stands in the world at a time; where a path has no value, nowhere."""
    if not isinstance(shape, MovingRecord):
        return shape
    try:
        with np.errstate(all="ignore"):
            frame = frame_at(shape, np.float64(time), np.float64(0))
    except (ArithmeticError, ValueError):  # from plain numbers: 1/x at x = 0
        return placed(shape.shape, (math.nan, math.nan, math.nan))
    rows = UNTURNED if frame.rows is None else frame.rows
    pivot = np.array(frame[:3]) - np.array(rows) @ shape[1:4]
    return placed(shape.shape, tuple(pivot.tolist()), rows)


def _ball(places: Floats) -> tuple[Floats, float]:
    """The middle of some places, and the radius about it in which they are [m]."""
    with np.errstate(over="ignore"):  # of sizes out of all proportion it is infinite
        middle = places.mean(axis=0)
        return middle, float(np.sqrt(((places - middle) ** 2).sum(axis=1).max()))


def _touched(shape: Any, places: Floats, slack: float) -> Any:
    """Which places are on the surface of a shape: looked for in halves of halves, as most are far from it."""
    if len(places) > FEW:
        return np.abs(_gaps(shape, places)) <= slack
    touches, parts = np.zeros(len(places), bool), [np.arange(len(places))]
    while parts:
        mine = parts.pop()
        middle, around = _ball(places[mine])
        if abs(_gaps(shape, middle[None])[0]) > around + slack:
            continue
        if len(mine) <= BY_ONE:
            touches[mine] = np.abs(_gaps(shape, places[mine])) <= slack
        else:
            longest = np.ptp(places[mine], axis=0).argmax()
            mine = mine[np.argsort(places[mine, longest], kind="stable")]
            parts += [mine[: len(mine) // 2], mine[len(mine) // 2 :]]
    return touches


def _gaps(shape: Any, places: Floats) -> Floats:
    """Gaps of points to a shape at rest [m], [n]; not a number where a formula has no value, which touches nothing."""
    if len(places) > FEW:
        out = np.empty(len(places))
        x, y, z = np.ascontiguousarray(places.T)
        gaps_of(shape, x, y, z, np.zeros(len(places)), 0.0, out)
        return out
    return np.array([_gap(shape, *place) for place in places.tolist()])


def _gap(shape: Any, x: float, y: float, z: float) -> float:
    p = Particle(x, y, z, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    try:
        with np.errstate(all="ignore"):
            return float(gap(shape, p))
    except (ArithmeticError, ValueError):  # from plain numbers: 1/x at x = 0
        return math.nan


@functools.singledispatch
def faces(shape: Any) -> tuple[Face, ...]:
    """The parts of the surface of a shape at rest that others may lie against; none of those that are round."""
    return ()


@faces.register
def _(shape: BoxRecord) -> tuple[Face, ...]:
    half, found = np.array(shape), []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        step = min(half[u], half[v]) / FINE
        number = [math.ceil(w / step) if w / MOST < step else MOST for w in (half[u], half[v])]
        a, b = (np.linspace(-w, w, 1 + 2 * n) for w, n in zip((half[u], half[v]), number, strict=True))
        for side in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = side
            places = np.full((len(a) * len(b), 3), side * half[axis])
            places[:, u], places[:, v] = (each.ravel() for each in np.meshgrid(a, b))

            def out(by: float, normal: Floats = normal) -> tuple[Any, Floats]:
                return BoxRecord(*(half + 0.5 * by * np.abs(normal)).tolist()), 0.5 * by * normal

            found.append(Face(places, np.broadcast_to(normal, places.shape), out))
    return tuple(found)


def _ends(half: float, low: float, high: float, longer: Callable[[float, float], Any]) -> tuple[Face, ...]:
    """The flat ends of a shape about the y axis, of half its length and these radii; `longer` is it with the end on a side
    farther out."""
    turns = np.linspace(0, 2 * math.pi, ROUND, endpoint=False)
    found = []
    for side, radius in ((-1.0, low), (1.0, high)):
        if radius <= 0:  # a tip
            continue
        rings = radius * np.linspace(0, 1, 1 + FINE)[:, None]
        x, z = (rings * np.cos(turns)).ravel(), (rings * np.sin(turns)).ravel()
        normal = np.array((0.0, side, 0.0))

        def out(by: float, side: float = side, normal: Floats = normal) -> tuple[Any, Floats]:
            return longer(side, by), 0.5 * by * normal

        places = np.stack([x, np.full(len(x), side * half), z], axis=1)
        found.append(Face(places, np.broadcast_to(normal, places.shape), out))
    return tuple(found)


@faces.register
def _(shape: CylinderRecord) -> tuple[Face, ...]:
    def longer(side: float, by: float) -> Any:
        return shape._replace(half=shape.half + 0.5 * by)

    return _ends(shape.half, shape.radius, shape.radius, longer)


@faces.register
def _(shape: ConeRecord) -> tuple[Face, ...]:
    def longer(side: float, by: float) -> Any:
        wider = by * shape.up / shape.out  # as wide as it becomes along its slope
        low, high = (shape.low + wider, shape.high) if side < 0 else (shape.low, shape.high - wider)
        half, length = shape.half + 0.5 * by, shape.length + by / shape.out
        return shape._replace(half=half, low=max(low, 0.0), high=max(high, 0.0), length=length)

    return _ends(shape.half, shape.low, shape.high, longer)


@faces.register
def _(shape: MeshRecord) -> tuple[Face, ...]:
    """Those of its flat sides that are large, of several triangles in a plane."""
    if shape.side != 1:
        return ()
    corners = np.unique(shape.tree.corners.transpose(0, 2, 1).reshape(-1, 9), axis=0).reshape(-1, 3, 3)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    normals = across / area[:, None]
    size = np.abs(corners).max()
    plane = np.round(np.column_stack([normals, (normals * a).sum(axis=1) / size]) / FLAT)
    _, first, side = np.unique(plane, axis=0, return_index=True, return_inverse=True)
    sizes = np.bincount(side.ravel(), area)
    large = np.argsort(-sizes, kind="stable")[:MOST]
    places, which = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    triangles = which.reshape(-1, 3)
    found = []
    for k in large[sizes[large] > LARGE * area.sum()]:
        of = side.ravel() == k
        normal, mine = normals[first[k]], np.unique(triangles[of])

        def out(by: float, normal: Floats = normal, mine: Any = mine) -> tuple[Any, Floats]:
            moved = places.copy()
            moved[mine] += by * normal
            return shape._replace(tree=build(moved, triangles)), np.zeros(3)

        ends = corners[of]
        middles = [ends.mean(axis=1), *((ends[:, i] + ends[:, j]) / 2 for i, j in ((0, 1), (1, 2), (2, 0)))]
        on = np.concatenate([places[mine], *middles])
        found.append(Face(on, np.broadcast_to(normal, on.shape), out))
    return tuple(found)


@faces.register(UnionRecord)
@faces.register(IntersectionRecord)
def _(shape: Any) -> tuple[Face, ...]:
    found = []
    for k, part in enumerate(shape.parts):
        rest = (*shape.parts[:k], *shape.parts[k + 1 :]) if isinstance(shape, UnionRecord) else ()
        for face in faces(part):

            def out(by: float, k: int = k, face: Face = face) -> tuple[Any, Floats]:
                parts = (*shape.parts[:k], face.out(by)[0], *shape.parts[k + 1 :])
                return shape._replace(parts=parts), np.zeros(3)

            found.append(Face(face.places, face.normals, out, (*face.beside, *rest)))
    return tuple(found)


@faces.register(ShiftedRecord)
@faces.register(TurnedRecord)
def _(shape: Any) -> tuple[Face, ...]:
    return posed(shape, faces(shape.shape))


def posed(shape: Any, parts: Sequence[Face]) -> tuple[Face, ...]:
    """Faces of what is shifted or turned, in the world."""
    rows = np.array(shape[3:12]).reshape(3, 3) if isinstance(shape, TurnedRecord) else np.eye(3)
    found = []
    for face in parts:

        def out(by: float, face: Face = face) -> tuple[Any, Floats]:
            grown, shift = face.out(by)
            x, y, z = (np.array(shape[:3]) + rows @ shift).tolist()
            return shape._replace(x=x, y=y, z=z, shape=grown), np.zeros(3)

        beside = tuple(shape._replace(shape=each) for each in face.beside)
        found.append(Face(face.places @ rows.T + np.array(shape[:3]), face.normals @ rows.T, out, beside))
    return tuple(found)
