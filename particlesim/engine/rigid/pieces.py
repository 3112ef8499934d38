"""Convex pieces of bodies, as kernels take them: where they are, and how far they reach along a direction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies.pieces import BOX, CAPSULE, CYLINDER, HULL, SPHERE, Piece
from particlesim.compiler import outlined
from particlesim.engine.rigid.rotation import to_body, to_world


class Pieces(NamedTuple):
    """The pieces of the shape of every group, in the frame of its bodies: those of group g are `first[g]` to
    `first[g + 1]`.

    kind [p]; size [3, p]; place [3, p] and rotation [9, p] in the body; radius of a ball about each, and its smallest size
    [p]. Of hulls the corners [3, c], planes [4, f], corners around faces [l] with the first of every face [f + 1], ends of
    edges [2, e]; and the first corner, face and edge of every piece [p + 1]. `corners` is None where all pieces are
    spheres, boxes and capsules, which have contacts of their own kind.
    """

    first: Any
    kind: Any
    size: Any
    at: Any
    rotation: Any
    ball: Any
    fine: Any
    corners: Any
    planes: Any
    loops: Any
    loop: Any
    edges: Any
    first_corner: Any
    first_face: Any
    first_edge: Any


class Solid(NamedTuple):
    """A piece in the world: its number, kind and sizes, its place [3] and its rotation, row by row [9]."""

    number: Any
    kind: Any
    size: Any
    x: Any
    r: Any


def pieces_of(shapes: Sequence[Sequence[Piece]]) -> Pieces:
    """The pieces of several shapes."""
    every = [piece for shape in shapes for piece in shape]
    hulls = [piece.hull for piece in every]
    corners = [np.empty((0, 3)) if hull is None else hull.corners for hull in hulls]
    planes = [np.empty((0, 4)) if hull is None else hull.planes for hull in hulls]
    first_corner, first_face = (np.cumsum([0, *map(len, each)]) for each in (corners, planes))
    edges = [np.empty((0, 2), np.int64) if hull is None else hull.edges for hull in hulls]
    loops, loop = [np.empty(0, np.int64)], [0]
    for hull, row in zip(hulls, first_corner.tolist(), strict=False):
        if hull is not None:
            loops.append(hull.loops + row)
            loop += (loop[-1] + hull.first[1:]).tolist()
    whole = [each + row for each, row in zip(edges, first_corner.tolist(), strict=False)]
    columns = (np.array([getattr(each, name) for each in every], float) for name in ("size", "at"))
    size, at = (np.ascontiguousarray(column.reshape(-1, 3).T) for column in columns)
    rotation = np.array([each.rotation.reshape(9) for each in every], float).reshape(-1, 9).T
    return Pieces(
        np.cumsum([0, *map(len, shapes)]),
        np.array([each.kind for each in every], np.int64),
        size,
        at,
        np.ascontiguousarray(rotation),
        np.array([each.ball() for each in every], float),
        np.array([each.fineness() for each in every], float),
        np.ascontiguousarray(np.concatenate(corners).T)
        if any(each.kind > CAPSULE for each in every)
        else None,
        np.ascontiguousarray(np.concatenate([np.empty((0, 4)), *planes]).T),
        np.concatenate(loops).astype(np.int64),
        np.array(loop, np.int64),
        np.ascontiguousarray(np.concatenate([np.empty((0, 2), np.int64), *whole]).T),
        first_corner,
        first_face,
        np.cumsum([0, *map(len, edges)]),
    )


def solid_of(p: Any, number: Any, x: Any, r: Any) -> Solid:
    """A piece of a body at a place with a rotation."""
    a = to_world(r, (p.at[0, number], p.at[1, number], p.at[2, number]))
    u = to_world(r, (p.rotation[0, number], p.rotation[3, number], p.rotation[6, number]))
    v = to_world(r, (p.rotation[1, number], p.rotation[4, number], p.rotation[7, number]))
    w = to_world(r, (p.rotation[2, number], p.rotation[5, number], p.rotation[8, number]))
    return Solid(
        number,
        p.kind[number],
        (p.size[0, number], p.size[1, number], p.size[2, number]),
        (x[0] + a[0], x[1] + a[1], x[2] + a[2]),
        (u[0], v[0], w[0], u[1], v[1], w[1], u[2], v[2], w[2]),
    )


def roundness(s: Any) -> Any:
    """Radius about the core of a piece [m]: spheres and capsules are points and segments with one."""
    return s.size[0] if s.kind == SPHERE or s.kind == CAPSULE else 0.0


def ring_of(s: Any) -> Any:
    """Half of the angle that a capsule stands for, which is a part of a ring, and the centre of that."""
    half = 2 * np.arctan(0.5 * s.size[1] / s.size[2])
    inner = 2 * s.size[2] * np.cos(half) / (1 + np.cos(half))  # from the centre to the middle of the capsule
    y = to_world(s.r, (0.0, 1.0, 0.0))
    return half, (s.x[0] - inner * y[0], s.x[1] - inner * y[1], s.x[2] - inner * y[2])


def corner(p: Any, s: Any, number: Any) -> Any:
    """A corner of a hull in the world."""
    a = to_world(s.r, (p.corners[0, number], p.corners[1, number], p.corners[2, number]))
    return s.x[0] + a[0], s.x[1] + a[1], s.x[2] + a[2]


@outlined
def farthest_corner(p: Any, number: Any, dx: Any, dy: Any, dz: Any) -> int:
    """The corner of a hull that is farthest along a direction of its frame."""
    best, found = -np.inf, 0
    for c in range(p.first_corner[number], p.first_corner[number + 1]):
        far = p.corners[0, c] * dx + p.corners[1, c] * dy + p.corners[2, c] * dz
        if far > best:
            best, found = far, c
    return found


def own_support(p: Any, s: Any, d: Any) -> Any:
    """The place of the core of a piece that is farthest along a direction, both in its frame."""
    if p.corners is not None and s.kind == HULL:
        c = farthest_corner(p, s.number, d[0], d[1], d[2])
        return p.corners[0, c], p.corners[1, c], p.corners[2, c]
    if s.kind == BOX:
        return (
            np.copysign(s.size[0], d[0]),
            np.copysign(s.size[1], d[1]),
            np.copysign(s.size[2], d[2]),
        )
    if s.kind == SPHERE:
        return 0.0, 0.0, 0.0
    if s.kind == CAPSULE:
        return 0.0, 0.0, np.copysign(s.size[1], d[2])
    across = np.sqrt(d[0] * d[0] + d[1] * d[1])
    k = s.size[0] / across if across > 0 else 0.0
    if s.kind == CYLINDER:
        return k * d[0], k * d[1], np.copysign(s.size[1], d[2])
    # a cone: its tip or its base
    if s.size[1] * d[2] >= s.size[0] * across:
        return 0.0, 0.0, 0.75 * s.size[1]
    return k * d[0], k * d[1], -0.25 * s.size[1]


@outlined
def support(p: Any, s: Any, d: Any) -> Any:
    """The place of the core of a piece that is farthest along a direction, in the world."""
    a = to_world(s.r, own_support(p, s, to_body(s.r, d)))
    return s.x[0] + a[0], s.x[1] + a[1], s.x[2] + a[2]
