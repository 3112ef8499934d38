"""Surfaces of shapes as triangles, for pictures: corners [n, 3] in metres, and triangles [m, 3], fronts outwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.model.arrays import Floats, Ints
from particlesim.model.vectors import Vector3

SIDES = 96
"""Corners around an axis."""
LARGE = 1e75
"""Lengths whose squares, and those of their products, are numbers [m]."""

HALVES = 20
"""Halves in which the place is found at which an edge is cut."""


class Triangles(NamedTuple):
    """A surface: corners [m], shape [n, 3], and the rows of the corners of every triangle, shape [m, 3]."""

    corners: Floats
    faces: Ints

    def placed(self, center: Vector3, rotation: Sequence[Vector3]) -> Triangles:
        """Turned and moved from the frame of its shape into the world: x = c + R y."""
        return Triangles(np.asarray(center) + self.corners @ np.asarray(rotation).T, self.faces)


def joined(parts: Sequence[Triangles]) -> Triangles:
    """Several surfaces as one."""
    first = np.cumsum([0, *(len(part.corners) for part in parts)])
    return Triangles(
        np.concatenate([np.empty((0, 3)), *(part.corners for part in parts)]),
        np.concatenate(
            [np.empty((0, 3), np.int64), *(part.faces + k for part, k in zip(parts, first, strict=False))]
        ),
    )


def turned_over(surface: Triangles) -> Triangles:
    """With fronts on the other side."""
    return Triangles(surface.corners, surface.faces[:, ::-1])


def shifted(surface: Triangles, by: float) -> Triangles:
    """With every triangle moved to its front [m], for itself."""
    t = surface.corners[surface.faces]
    unit = max(1.0, float(np.abs(t).max(initial=0.0)) / LARGE)
    front = np.cross((t[:, 1] - t[:, 0]) / unit, (t[:, 2] - t[:, 0]) / unit)
    size = np.linalg.norm(front, axis=1, keepdims=True)
    t = t + (by * front / np.where(size > 0, size, 1))[:, None]
    return Triangles(t.reshape(-1, 3), np.arange(3 * len(t)).reshape(-1, 3))


def cuboid(size: Vector3) -> Triangles:
    """A box about the origin."""
    sign = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            corners = np.flatnonzero(sign[:, axis] == side)
            a, b, c, d = (int(k) for k in corners)
            ring = (a, b, d, c)
            out = np.cross(sign[ring[1]] - sign[ring[0]], sign[ring[2]] - sign[ring[0]])[axis] * side
            ring = ring if out > 0 else ring[::-1]
            faces += [(ring[0], ring[1], ring[2]), (ring[0], ring[2], ring[3])]
    return Triangles(0.5 * np.asarray(size) * sign, np.array(faces, np.int64))


def revolved(profile: Sequence[tuple[float, float]], sides: int = SIDES, closed: bool = False) -> Triangles:
    """What a line of points (distance from the y axis, height) sweeps out around that axis.

    The line goes upwards on the outside. `closed` joins its end with its beginning, as for a ring.
    """
    points = np.asarray(profile, float)
    points[np.abs(points[:, 0]) < 1e-12 * np.abs(points).max(), 0] = 0.0  # on the axis
    turn = 2 * np.pi * np.arange(sides) / sides
    x, z = np.cos(turn), -np.sin(turn)  # upwards and then around: fronts outwards
    corners = np.stack(
        [
            points[:, None, 0] * x,
            np.broadcast_to(points[:, None, 1], (len(points), sides)),
            points[:, None, 0] * z,
        ],
        axis=-1,
    ).reshape(-1, 3)
    index = np.arange(len(points) * sides).reshape(-1, sides)
    low, high = (index, np.roll(index, -1, axis=0)) if closed else (index[:-1], index[1:])
    a, b, c, d = low, np.roll(low, -1, axis=1), np.roll(high, -1, axis=1), high
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return without_slivers(Triangles(corners, faces))


def arc(
    center: tuple[float, float], radius: float, first: float, last: float, parts: int
) -> list[tuple[float, float]]:
    """Points on a part of a circle, by angles from the horizontal [rad]."""
    angles = np.linspace(first, last, parts + 1)
    return [(center[0] + radius * float(np.cos(a)), center[1] + radius * float(np.sin(a))) for a in angles]


def grid_faces(index: Ints) -> Ints:
    """Two triangles for every cell of a grid of points [rows, columns] with x along columns and z along rows.

    Their fronts look upwards, and the diagonals alternate.
    """
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    row, column = np.indices(a.shape)
    rising = ((row + column) % 2 == 0)[..., None]
    first = np.where(rising, np.stack([a, b, c], axis=-1), np.stack([a, b, d], axis=-1))
    second = np.where(rising, np.stack([a, c, d], axis=-1), np.stack([b, c, d], axis=-1))
    return np.stack([first, second], axis=2).reshape(-1, 3)


class Distance(NamedTuple):
    """What surfaces are clipped by: `at` gives signed distances [n] of places [n, 3] [m], which change no faster than these
    do; `side` tells which triangles [m, 3, 3] are on one side for sure, −1 or 1, and 0 of others."""

    at: Callable[[Floats], Floats]
    side: Callable[[Floats], Ints]


def clipped(surface: Triangles, distance: Distance, longest: float) -> Triangles:
    """The part of a surface where a distance is negative.

    Triangles on both sides are halved until no edge is longer than `longest` [m], and cut along the line between the places
    on their edges where it is zero.
    """
    kept, corners = [], surface.corners
    faces = surface.faces
    value = distance.at(corners)
    while len(faces):
        edge = corners[faces] - corners[np.roll(faces, -1, axis=1)]
        unit = max(1.0, float(np.abs(edge).max()) / LARGE)
        length = unit * np.sqrt(((edge / unit) ** 2).sum(axis=2))
        far = np.abs(value[faces]).max(axis=1) > length.max(axis=1)
        side = np.where(far, np.where(value[faces[:, 0]] < 0, -1, 1), 0)
        side[~far] = distance.side(corners[faces[~far]])
        clear = side != 0
        kept.append(faces[side < 0])
        small = ~clear & (length.max(axis=1) <= longest)
        cut, added = _cut(corners, value, faces[small], distance.at)
        kept.append(cut)
        large = ~clear & ~small
        corners, value = np.concatenate([corners, added]), np.concatenate([value, np.zeros(len(added))])
        # halved across their longest edges
        k = length[large].argmax(axis=1)
        row = np.arange(len(k))
        a, b, c = (faces[large][row, (k + turn) % 3] for turn in range(3))
        middle = 0.5 * (corners[a] + corners[b])
        m = len(corners) + row
        corners, value = np.concatenate([corners, middle]), np.concatenate([value, distance.at(middle)])
        faces = np.concatenate([np.stack([a, m, c], axis=1), np.stack([m, b, c], axis=1)])
    return Triangles(corners, np.concatenate([np.empty((0, 3), np.int64), *kept]))


def side_of(triangles: Floats, value: Floats, slope: Floats, bend: int) -> Ints:
    """On which side of a function triangles [m, 3, 3] are for sure, by its values [m, 3] and slopes [m, 3, 3] at their
    corners: −1 or 1, and 0 of others. It is convex where `bend` is 1, concave where it is −1.

    A convex function is negative where it is at all corners, and positive where the plane at one of them is at all.
    """
    up, steep = bend * value, bend * slope
    ways = triangles[:, None, :, :] - triangles[:, :, None, :]
    planes = up[:, :, None] + np.einsum("mik,mijk->mij", steep, ways)
    return bend * ((planes.min(axis=2).max(axis=1) > 0).astype(int) - (up < 0).all(axis=1))


def _cut(corners: Floats, value: Floats, faces: Ints, at: Callable[[Floats], Floats]) -> tuple[Ints, Floats]:
    """The parts of triangles where a function is negative, one side of a line in each, and the corners that they have
    besides."""
    inside = value[faces] < 0
    number = inside.sum(axis=1)
    kept, added, first = [faces[number == 3]], [np.empty((0, 3))], len(corners)
    for wanted in (1, 2):
        # turned so that the corner that differs from the others comes first
        some = faces[number == wanted]
        odd = np.argmax(inside[number == wanted] == (wanted == 1), axis=1)
        a, b, c = (some[np.arange(len(some)), (odd + k) % 3] for k in range(3))
        cuts = []
        for end in (b, c):
            added.append(_zeros(corners[a], corners[end], value[a] < 0, at))
            cuts.append(first + np.arange(len(some)))
            first += len(some)
        d, e = cuts
        parts = ((a, d, e),) if wanted == 1 else ((d, b, c), (d, c, e))
        kept += [np.stack(each, axis=1) for each in parts]
    return np.concatenate(kept), np.concatenate(added)


def _zeros(start: Floats, end: Floats, inside: NDArray[np.bool_], at: Callable[[Floats], Floats]) -> Floats:
    """Where a function is zero between places [n, 3] with different signs of it; `inside`: which starts it is negative at.
    By halves: it has a kink where it meets the edge of a face."""
    near, far = start, end
    for _ in range(HALVES):
        middle = 0.5 * (near + far)
        here = ((at(middle) < 0) == inside)[:, None]
        near, far = np.where(here, middle, near), np.where(here, far, middle)
    return 0.5 * (near + far)


def without_slivers(surface: Triangles) -> Triangles:
    """Without triangles two of whose corners are in the same place."""
    t = surface.corners[surface.faces]
    flat = [np.abs(t[:, k] - t[:, k - 1]).max(axis=1) == 0 for k in range(3)]
    return Triangles(surface.corners, surface.faces[~(flat[0] | flat[1] | flat[2])])


def three_cornered(triangles: Ints) -> NDArray[np.bool_]:
    """Which triangles have three different corners."""
    a, b, c = triangles.T
    return np.asarray((a != b) & (b != c) & (c != a))
