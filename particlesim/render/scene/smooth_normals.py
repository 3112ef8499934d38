"""Which triangles share a smooth normal: none across an edge that is creased at the start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from particlesim.render.kernels.records import Array, Ints

CREASE = 40.0
"""Faces that meet at a sharper angle than this [degrees] keep their own normals, as on the edges of a cube."""


@dataclass(frozen=True)
class Fans:
    """`shade` [t, 3]: the normal of each triangle's corners; normal k is that of the triangles
    `fan[first[k]:first[k + 1]]`."""

    shade: Ints
    first: Array
    fan: Ints


def _edges(triangles: Array) -> tuple[Array, Array, Array]:
    """Half edges in order of their ends: key of both ends, and which of 3 t + corner each is; how often each key occurs,
    at its first place, 0 elsewhere."""
    t = np.asarray(triangles, np.int64)
    ends = np.stack([t, np.roll(t, -1, axis=1)], axis=2).reshape(-1, 2)
    key = ends.min(axis=1) * (int(t.max()) + 1) + ends.max(axis=1)
    half = np.argsort(key, kind="stable")
    key = key[half]
    starts = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
    count = np.zeros(len(key), np.int64)
    count[starts] = np.diff(np.append(starts, len(key)))
    return key, half, count


def is_closed(triangles: Array) -> bool:
    """Whether every edge has a triangle on both sides: the skin of a body, whose inside nobody sees."""
    _, _, count = _edges(triangles)
    return bool(np.isin(count, (0, 2)).all())


def smooth_fans(triangles: Array, corners: Array) -> Fans:
    """The fans of `triangles` [t, 3] (any numbers of points) with corners at `corners` [t, 3, 3] when nothing is deformed.

    Corners of two triangles are one where these share an edge that is no crease; a fan is what hangs together.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, half, count = _edges(triangles)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    at = np.flatnonzero(count == 2)
    one, other = half[at], half[at + 1]
    smooth = np.einsum("ij,ij->i", normal[one // 3], normal[other // 3]) > np.cos(np.radians(CREASE))
    one, other = one[smooth], other[smooth]
    after, before = _next(one), _next(other)
    # The two half edges run in opposite directions: where one starts the other ends.
    flat = np.asarray(triangles).ravel()
    turned = flat[one] == flat[before]
    one, after, other, before = one[turned], after[turned], other[turned], before[turned]
    a, b = np.concatenate([one, after]), np.concatenate([before, other])
    links = coo_array((np.ones(len(a), np.bool_), (a, b)), shape=(len(flat), len(flat)))
    number, label = connected_components(links, directed=False)
    order = np.argsort(label, kind="stable")
    first = np.append(0, np.cumsum(np.bincount(label, minlength=number)))
    return Fans(
        np.ascontiguousarray(label.reshape(-1, 3), np.int32),
        first.astype(np.int64),
        np.ascontiguousarray(order // 3, np.int32),
    )


def _next(half: Array) -> Array:
    """The half edge that follows in the same triangle."""
    return np.where(half % 3 == 2, half - 2, half + 1)
