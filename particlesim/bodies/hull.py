"""Convex hulls as contact takes them: corners, faces as polygons, edges.

The triangles of a hull that lie in one plane are one face: a die stands on the four corners of a side, not on the three of
a triangle. Source: C. B. Barber, D. P. Dobkin, H. Huhdanpaa, ACM Trans. Math. Softw. 22, 469 (1996).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints

LEVEL = 1e-4
"""Angle between triangles that count as one face [rad]."""


class Hull(NamedTuple):
    """Corners [n, 3] [m]; of every face the unit normal outwards and its distance from the origin [f, 4]; the rows of the
    corners around every face, counterclockwise from outside, one face after the other, [l], and where each begins [f + 1];
    rows of the ends of edges [e, 2]."""

    corners: Floats
    planes: Floats
    loops: Ints
    first: Ints
    edges: Ints


def hull_of(points: Floats, name: str) -> Hull:
    """The convex hull of places [n, 3]. Raises UsageError where they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(points)
    except QhullError:
        raise UsageError(f"{name}: its corners lie in a plane", "a rigid body has a volume") from None
    face_of = _merged(found.equations, found.neighbors.astype(np.int64))
    rows = np.full(len(points), -1)
    rows[np.sort(found.vertices)] = np.arange(len(found.vertices))
    corners = points[np.sort(found.vertices)]
    planes, loops, edges = [], [], set()
    for face in range(face_of.max() + 1):
        mine = np.flatnonzero(face_of == face)
        normal = found.equations[mine, :3].mean(axis=0)
        normal /= np.linalg.norm(normal)
        around = rows[np.unique(found.simplices[mine])]
        middle = corners[around].mean(axis=0)
        u = corners[around[0]] - middle
        u -= (u @ normal) * normal
        arm = corners[around] - middle
        loop = around[np.argsort(np.arctan2(arm @ np.cross(normal, u), arm @ u), kind="stable")]
        planes.append([*normal, (corners[loop] @ normal).max()])
        loops.append(loop)
        edges |= {
            (min(a, b), max(a, b)) for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
        }
    first = np.cumsum([0, *(len(loop) for loop in loops)])
    return Hull(corners, np.array(planes), np.concatenate(loops), first, np.array(sorted(edges)))


def _merged(equations: Floats, neighbours: Ints) -> Ints:
    """The number of the face of every triangle: neighbours in one plane are one."""
    face = np.full(len(equations), -1)
    number = 0
    for seed in range(len(equations)):
        if face[seed] >= 0:
            continue
        waiting = [seed]
        face[seed] = number
        while waiting:
            for other in neighbours[waiting.pop()]:
                level = np.linalg.norm(np.cross(equations[seed, :3], equations[other, :3]))
                if face[other] < 0 and level < LEVEL and equations[seed, :3] @ equations[other, :3] > 0:
                    face[other] = number
                    waiting.append(int(other))
        number += 1
    return face
