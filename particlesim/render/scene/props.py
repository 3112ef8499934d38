"""Shapes that particles collide with, as surfaces of triangles that no particle carries."""

from __future__ import annotations

import numpy as np

from particlesim.render.kernels.records import Array, Triple
from particlesim.render.kernels.solids import face_normals, smooth_normals
from particlesim.render.scene.smooth_normals import smooth_fans
from particlesim.render.scene.source import MeshShape


class Props:
    """Surfaces in scene units about a centre [m], with a unit of length [m].

    `faces` [t, 3]: rows of `corners`; `shade` [t, 3]: rows of the normals that `at` gives;
    `closed` [t]: a prop has one side.
    """

    def __init__(self, shapes: tuple[MeshShape, ...], center: Array, scale: float) -> None:
        self._shapes, self._center, self._scale = shapes, center, scale
        self._corners, self._normals = [], []
        faces, shade, hollow = (
            [np.empty((0, 3), np.int32)],
            [np.empty((0, 3), np.int32)],
            [np.empty(0, np.bool_)],
        )
        first = row = 0
        for each in shapes:
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
            faces.append(triangles + first)
            shade.append(fans.shade + row)
            hollow.append(np.full(len(triangles), each.hollow))
            first += len(corners)
            row += len(normal)
        self.faces: Array = np.concatenate(faces).astype(np.int32)
        self.shade: Array = np.concatenate(shade).astype(np.int32)
        self.closed: Array = np.ones(len(self.faces), np.bool_)
        self._hollow = np.concatenate(hollow)
        self.number = first
        """How many corners there are."""

    def at(self, time: float) -> tuple[Array, Array]:
        """Corners [n, 3] in scene units and normals [k, 3] at a time [s], float32."""
        corners: list[Array] = [np.empty((0, 3))]
        normals: list[Array] = [np.empty((0, 3))]
        for shape, corner, normal in zip(self._shapes, self._corners, self._normals, strict=True):
            place = corner
            if shape.pose is not None:
                center, rotation = shape.pose(time)
                place, normal = np.asarray(center) + corner @ rotation.T, normal @ rotation.T
            corners.append((place - self._center) / self._scale)
            normals.append(normal)
        return np.concatenate(corners).astype(np.float32), np.concatenate(normals).astype(np.float32)

    def seen(self, corners: Array, eye: Triple) -> Array:
        """Which triangles are drawn, bool [t]: of containers those that turn their inside to the camera."""
        a, b, c = (corners[self.faces[:, k]].astype(float) for k in range(3))
        towards = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.asarray(eye) - a) > 0
        return towards | ~self._hollow


def extent(shapes: tuple[MeshShape, ...], time: float) -> Array:
    """Corners of the boxes about shapes at a time [m], shape [k, 3]."""
    points = [np.empty((0, 3))]
    for each in shapes:
        corners = np.asarray(each.corners, float)
        if each.pose is not None:
            center, rotation = each.pose(time)
            corners = np.asarray(center) + corners @ rotation.T
        ends = np.stack([corners.min(axis=0), corners.max(axis=0)])
        points.append(
            np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        )
    return np.concatenate(points)
