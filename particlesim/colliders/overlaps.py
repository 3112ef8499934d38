"""Closed surfaces of one mesh that run into each other.

Seen from outside, they are the union of what they enclose. From inside, as of a container or of what is taken away from
another solid, each is a wall in the others. That is found by their edges: a place on a surface that has its front outwards
is inside of no other, and one on a hollow, which has it inwards, of one. Whether it is inside tells the solid angle of the
triangles that it sees, over 4 π.

Source: A. van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30, 125 (1983), for the angle; A. Jacobson, L. Kavan,
O. Sorkine-Hornung, ACM Trans. Graph. 32, 33 (2013).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from particlesim.model.arrays import Floats, Ints

CUTS = 24
"""Places on an edge that are looked at."""
INSIDE = 0.75
"""Part of 4 π from which a place is inside; on a flat side it is a half."""
AT_ONCE, MOST = 1 << 18, 1 << 22
"""Angles that are worked out at a time, and at most for a surface; of large ones some edges are looked at."""


def closed_surfaces(corners: Floats, faces: Ints) -> list[Ints]:
    """The triangles of every closed surface of a mesh."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]]).T
    near = coo_array((np.ones(edges.shape[1], np.int8), (edges[0], edges[1])), shape=(len(corners),) * 2)
    label = connected_components(near, directed=False)[1][faces[:, 0]]
    order = np.argsort(label, kind="stable")
    ends = np.flatnonzero(np.diff(label[order], prepend=-1, append=-1))
    parts = [order[first:last] for first, last in pairwise(ends)]
    return [faces[part] for part in sorted(parts, key=lambda part: int(part[0]))]


def overlap_of(corners: Floats, faces: Ints) -> Floats | None:
    """A place [m] where a closed surface of a mesh is inside another one; None if none was found."""
    parts = closed_surfaces(corners, faces)
    if len(parts) == 1:
        return None
    low = np.array([corners[part].min(axis=(0, 1)) for part in parts])
    high = np.array([corners[part].max(axis=(0, 1)) for part in parts])
    for k, part in enumerate(parts):
        beside = np.flatnonzero(((low < high[k]) & (low[k] < high)).all(axis=1))
        others = beside[beside != k]
        if not others.size:
            continue
        few = MOST // sum(len(parts[j]) for j in others) // CUTS + 1
        places = _places(corners, part, low[others].min(axis=0), high[others].max(axis=0), few)
        inside = sum((windings(corners, parts[j], places) for j in others), np.zeros(len(places)))
        a, b, c = corners[part].transpose(1, 0, 2)
        hollow = np.einsum("ij,ij->", a - low[k], np.cross(b - low[k], c - low[k])) < 0
        wrong = np.abs(inside - (1 if hollow else 0)) > INSIDE
        if wrong.any():
            return np.asarray(places[wrong.argmax()])
    return None


def windings(corners: Floats, faces: Ints, places: Floats) -> Floats:
    """How often the triangles of a closed surface go around places: 1 inside if it has its front outwards."""
    found, some = np.empty(len(places)), max(AT_ONCE // len(faces), 1)
    for first in range(0, len(places), some):
        at = places[first : first + some]
        a, b, c = (corners[faces[:, k]] - at[:, None] for k in range(3))
        r, s, t = (np.linalg.norm(each, axis=2) for each in (a, b, c))
        volume = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ijk,ijk->ij", u, v) for u, v in ((a, b), (b, c), (c, a)))
        angle = np.arctan2(volume, r * s * t + ab * t + bc * r + ca * s)
        found[first : first + some] = angle.sum(axis=1) / (2 * np.pi)
    return found


def _places(corners: Floats, faces: Ints, low: Floats, high: Floats, few: int) -> Floats:
    """Places on some edges of triangles that reach into a box."""
    ends = np.unique(
        np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0
    )
    start, end = corners[ends[:, 0]], corners[ends[:, 1]]
    near = ((np.minimum(start, end) < high) & (low < np.maximum(start, end))).all(axis=1)
    rows = np.flatnonzero(near)
    rows = rows[:: len(rows) // few + 1]
    along = ((np.arange(CUTS) + 0.5) / CUTS)[:, None, None]
    places = ((1 - along) * start[rows] + along * end[rows]).reshape(-1, 3)
    return places[((places > low) & (places < high)).all(axis=1)]
