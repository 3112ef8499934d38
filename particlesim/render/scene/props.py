"""Shapes that particles collide with, and rigid bodies, as surfaces of triangles."""

from __future__ import annotations

import numpy as np

from particlesim.errors import UsageError
from particlesim.render.kernels.records import Array, Triple
from particlesim.render.kernels.solids import face_normals, smooth_normals
from particlesim.render.scene.smooth_normals import smooth_fans
from particlesim.render.scene.source import Frame, MeshShape


class Props:
    """Surfaces in scene units about a centre [m], with a unit of length [m].

    `faces` [t, 3]: rows of `corners`; `shade` [t, 3]: rows of the normals that `at` gives;
    `closed` [t]: a prop has one side.
    """

    def __init__(self, shapes: tuple[MeshShape, ...], center: Array, scale: float, frame: Frame) -> None:
        shapes = tuple(
            each for each in shapes if len(each.triangles)
        )  # of an empty solid there is nothing to see
        self._shapes, self._center, self._scale = shapes, center, scale
        self._corners, self._normals = [], []
        self._copies = [1 if each.group is None else len(members(frame, each.group)) for each in shapes]
        faces, shade, hollow = (
            [np.empty((0, 3), np.int32)],
            [np.empty((0, 3), np.int32)],
            [np.empty(0, np.bool_)],
        )
        opacity = [np.empty(0)]
        first = row = 0
        for each, copies in zip(shapes, self._copies, strict=True):
            corners = np.ascontiguousarray(each.corners, float)
            triangles = np.ascontiguousarray(
                each.triangles[:, ::-1] if each.hollow else each.triangles, np.int32
            )
            fans = smooth_fans(triangles, corners[triangles])
            local = np.ascontiguousarray(
                (corners - corners.mean(axis=0)) / np.ptp(corners, axis=0).max(), np.float32
            )
            face = np.empty((len(triangles), 3), np.float32)
            normal = np.empty((len(fans.first) - 1, 3), np.float32)
            face_normals(local, triangles, 0, len(triangles), face)
            smooth_normals(face, fans.first, fans.fan, 0, len(normal), normal)
            self._corners.append(corners)
            self._normals.append(normal)
            for _ in range(copies):
                faces.append(triangles + first)
                shade.append(fans.shade + row)
                first += len(corners)
                row += len(normal)
            hollow.append(np.full(copies * len(triangles), each.hollow))
            opacity.append(np.full(copies * len(triangles), each.opacity))
        self.faces: Array = np.concatenate(faces).astype(np.int32)
        self.shade: Array = np.concatenate(shade).astype(np.int32)
        self.closed: Array = np.ones(len(self.faces), np.bool_)
        self._hollow = np.concatenate(hollow)
        self.opacity: Array = np.concatenate(opacity)
        """How much of what is behind them triangles hide [t]."""
        self.number = first
        """How many corners there are."""

    def at(self, frame: Frame) -> tuple[Array, Array]:
        """Corners [n, 3] in scene units and normals [k, 3] in a frame, float32."""
        corners: list[Array] = [np.empty((0, 3))]
        normals: list[Array] = [np.empty((0, 3))]
        for shape, corner, normal in zip(self._shapes, self._corners, self._normals, strict=True):
            place = corner
            if shape.group is not None:
                centers, rotation = poses(frame, members(frame, shape.group))
                place = (centers[:, None] + corner @ rotation.transpose(0, 2, 1)).reshape(-1, 3)
                normal = (normal @ rotation.transpose(0, 2, 1)).reshape(-1, 3)
            elif shape.pose is not None:
                center, rotation = shape.pose(float(frame.time))
                place, normal = np.asarray(center) + corner @ rotation.T, normal @ rotation.T
            corners.append((place - self._center) / self._scale)
            normals.append(normal)
        return np.concatenate(corners).astype(np.float32), np.concatenate(normals).astype(np.float32)

    def colors(self, frame: Frame, of_particles: Array, stone: int) -> Array:
        """A palette index for every corner: that of the body that carries it, `stone` for other shapes, the one before for
        fluids."""
        parts = [np.empty(0, of_particles.dtype)]
        for shape, corner in zip(self._shapes, self._corners, strict=True):
            own = np.array([stone - shape.fluid])
            if shape.group is not None:
                own = of_particles[members(frame, shape.group)]
            parts.append(np.repeat(own, len(corner)).astype(of_particles.dtype))
        return np.concatenate(parts)

    def carried(self, frame: Frame) -> Array:
        """Which particles of a frame are bodies, drawn by their surfaces, bool [n]."""
        found = np.zeros(len(frame.position), np.bool_)
        for shape in self._shapes:
            if shape.group is not None:
                found[members(frame, shape.group)] = True
        return found

    def seen(self, corners: Array, eye: Triple) -> Array:
        """Which triangles are drawn, bool [t]: of containers those that turn their inside to the camera."""
        a, b, c = (corners[self.faces[:, k]].astype(float) for k in range(3))
        towards = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.asarray(eye) - a) > 0
        return towards | ~self._hollow


def members(frame: Frame, group: int) -> Array:
    """Rows of the particles of a group."""
    try:
        return np.flatnonzero(np.asarray(frame["group"]) == group)
    except UsageError:  # a single group has no such column
        return np.arange(len(frame.position))


def poses(frame: Frame, rows: Array) -> tuple[Array, Array]:
    """Places [m], shape [n, 3], and rotations [n, 3, 3] of bodies."""
    w, x, y, z = np.asarray(frame["orientation"], float)[rows].T
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.asarray(frame.position, float)[rows], np.moveaxis(rotation, 2, 0)


def extent(shapes: tuple[MeshShape, ...], time: float) -> Array:
    """Corners of the boxes about shapes at a time [m], shape [k, 3]."""
    points = [np.empty((0, 3))]
    for each in shapes:
        if each.group is not None:
            continue  # bodies are among the particles
        corners = np.asarray(each.corners, float)
        if each.pose is not None:
            center, rotation = each.pose(time)
            corners = np.asarray(center) + corners @ rotation.T
        ends = np.stack([corners.min(axis=0), corners.max(axis=0)])
        points.append(
            np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        )
    return np.concatenate(points)
