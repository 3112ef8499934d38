"""The arrays of contacts of surfaces, allocated by the caller of the kernels.

Contact is between *simplices*: triangles of cloth, of jelly and of meshes, edges of ropes, nets and hair, and single
particles, which are edges without length. Every vertex and every edge belongs to one simplex, so that a loop over pairs of
simplices visits every pair of a vertex and a triangle and every pair of edges once (R. Curtis, R. Tamstorf, D. Manocha, Fast
collision detection for deformable models using representative-triangles, 2008).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.engine.interactions.neighbours.record import Neighbours, new_neighbours
from particlesim.model.arrays import Ints

PER_SIMPLEX, AT_LEAST = 24, 4096
"""Candidates, and contacts, to have room for at first: so many for every simplex, and some."""
ROOMIER = 2
"""By how much room grows."""

STALE, FACES, EDGES, CONTACTS, LOST, BUILDS, ZONED, AGE, ANEW, EFFORT, PAUSE = range(11)
"""In `report`: whether candidates have to be found anew; how many of a vertex and a triangle, and of two edges; contacts of
the step; whether there was no room; how often candidates were found; how many particles had to move as one, and in which
step candidates are, the one in which they were found being 0; whether all threads find them anew in this step, which stays
until the next one; about how many pairs have been looked at since the last pause, and after how many there is one."""
CROWDED = 2
"""In `report[LOST]`, where lists of simplices had no room."""
SKIN, HORIZON, REACH, THIN, FASTEST, TURNED, COURSE, WAY, DRIFT = range(9)
"""In `tune` [m]: how far vertices may leave their course before candidates are found anew, and for how many steps these are;
the length by which skins are measured; the least thickness; how far a particle has come in the step, and how much that
differs from the step before, beside what all have in common; the sum of twice the latter since candidates were found, and
the sum of that over all steps but this one; and from there on the displacement of all."""


class Simplices(NamedTuple):
    """Corners of simplices [3, n]: those of an edge are i, j, j; `face` [n]: whether each is a triangle; `vertices` [3, n]
    and `sides` [3, n]: the rows of vertices and the numbers of edges that belong to each, −1 for none. `edges` [2, m]: rows
    of all edges, and `bordered` [m]: whether triangles lie at them. `rows`: all particles in simplices. `split`: how many
    simplices come before those of the other side, None where all may touch each other."""

    corners: Any
    face: Any
    vertices: Any
    sides: Any
    edges: Any
    bordered: Any
    rows: Any
    split: int | None


class Pairs(NamedTuple):
    """Candidates of one sort: `of` [2, room], a row of a vertex and the number of a triangle, or the numbers of two edges;
    `rows` [4, room] of their particles; what tells when they can touch (`sieve`): `until` [room] [m] and `slope` [room] [m];
    and room for the numbers of those that can, `due` [room]."""

    of: Any
    rows: Any
    until: Any
    slope: Any
    due: Any


class Candidates(NamedTuple):
    """Pairs that may touch soon, of a vertex and a triangle (`faces`) and of two edges (`edges`).

    `near`: lists of simplices, found by spheres around them with middles [3, n] and radii [n]; boxes around all particles
    [n, 6], edges and simplices; `base` and `way` [3, n]: particles when candidates were found, and how far they went in that
    step; `last` [3, n]: how far they went in the last step that was measured.
    """

    near: Neighbours
    middle: Any
    radius: Any
    around: Any
    edge_boxes: Any
    boxes: Any
    base: Any
    way: Any
    last: Any
    faces: Pairs
    edges: Pairs


class Touches(NamedTuple):
    """Contacts of a step: rows [4, room], weights [4, room]; unit normals, and what the difference of places along them must
    be at least [m] [4, room]; displacement from which sliding is measured [3, room] [m], velocity likewise; how both are
    bound: μ_s, μ_k, the part of an approach that rebounds and the speed above which it does, the push so far, the part of
    sliding that is lost at once, and the impulse so far [7, room]; what friction has done so far [3, room],
    and how far a collider goes there in the step [3, room] [m]."""

    rows: Any
    weights: Any
    normal: Any
    shift: Any
    drift: Any
    bound: Any
    rubbed: Any
    carried: Any


class Beside(NamedTuple):
    """Particles beside a collider, in its frame. `at` [10, n]: where they are at the beginning and at the end of the step,
    the gap at the beginning [m] and the normal. For each of the colliders that are not convex, `last` [m, 3, n]: where they
    were at the beginning of an earlier step, and `clear` [m, edges and simplices]: what no gap was below then, −∞ where
    nothing is known [m]."""

    at: Any
    last: Any
    clear: Any


class Desk(NamedTuple):
    """Scratch by particle: inverse masses [n], −1 of absent ones; marks of those in contact (1: has contacts, 4: also with
    colliders, 8: its zone goes with a collider), and zones that move as one with their sums [8, n]."""

    inverse: Any
    mark: Any
    zone: Any
    sums: Any


def simplices_of(triangles: Ints, edges: Ints, side: tuple[Ints, Ints] | None, count: int) -> Simplices:
    """Simplices from rows of triangles [3, n] and of free edges [2, m], with their sides, 0 or 1, where only those of two
    sides touch."""
    corners = np.concatenate([triangles, edges[[0, 1, 1]]], axis=1).astype(np.int64)
    face = np.arange(corners.shape[1]) < triangles.shape[1]
    split, order = None, np.arange(corners.shape[1])
    if side is not None:
        sides = np.concatenate(side)
        order = np.argsort(sides, kind="stable")
        split = int((sides == 0).sum())
    corners, face = np.ascontiguousarray(corners[:, order]), face[order]
    vertices = _first_owner(corners[None], count)
    ends = np.stack([corners[[0, 1, 2]], corners[[1, 2, 0]]])  # [2, 3, n]
    ends = np.sort(ends, axis=0)
    ends[:, 1:, ~face] = -1
    key = np.where(ends[0] < 0, -1, ends[0] * (count + 1) + ends[1]).T.ravel()
    found, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    real = found >= 0
    number = np.where(real, np.cumsum(real) - 1, -1)
    owned = np.zeros(key.size, bool)
    owned[first[real]] = True
    numbers = np.where(owned, number[inverse.ravel()], -1)
    at = np.stack([part.T.ravel() for part in ends])[:, first[real]]
    bordered = np.zeros(at.shape[1], bool)
    flat = np.repeat(face, 3)
    bordered[number[inverse.ravel()][flat]] = True
    return Simplices(
        corners,
        face.astype(np.int8),
        vertices,
        np.ascontiguousarray(numbers.reshape(-1, 3).T.astype(np.int64)),
        np.ascontiguousarray(at.astype(np.int64)),
        bordered.astype(np.int8),
        np.unique(corners),
        split,
    )


def _first_owner(corners: Ints, count: int) -> Ints:
    """Corners of simplices [3, n], −1 where an earlier simplex, or an earlier corner of it, has the particle."""
    flat = corners[0].T.ravel()
    _, first = np.unique(flat, return_index=True)
    owned = np.full(flat.size, -1, np.int64)
    owned[first] = flat[first]
    return np.ascontiguousarray(owned.reshape(-1, 3).T)


def new_candidates(simplices: Simplices, count: int, room: int) -> Candidates:
    """Room for candidates among some particles, none found yet."""
    n, m = simplices.corners.shape[1], simplices.edges.shape[1]
    near = new_neighbours(np.arange(n), n, 0.0, 0.0, split=simplices.split, radii=True)
    return Candidates(
        near,
        np.zeros((3, n)),
        np.zeros(n),
        np.zeros((count, 6)),
        np.zeros((m, 6)),
        np.zeros((n, 6)),
        np.zeros((3, count)),
        np.zeros((3, count)),
        np.zeros((3, count)),
        new_pairs(room),
        new_pairs(room),
    )


def new_pairs(room: int) -> Pairs:
    """Room for candidates of one sort."""
    return Pairs(
        np.zeros((2, room), np.int32),
        np.zeros((4, room), np.int32),
        np.zeros(room),
        np.zeros(room),
        np.zeros(room, np.int32),
    )


def new_touches(room: int) -> Touches:
    """Room for contacts of a step."""
    return Touches(
        np.zeros((4, room), np.int32),
        np.zeros((4, room)),
        np.zeros((4, room)),
        np.zeros((3, room)),
        np.zeros((3, room)),
        np.zeros((7, room)),
        np.zeros((3, room)),
        np.zeros((3, room)),
    )


def room_for(simplices: Simplices) -> int:
    """Candidates and contacts to have room for at first."""
    return PER_SIMPLEX * int(simplices.corners.shape[1]) + AT_LEAST


def new_beside(simplices: Simplices, count: int, rough: int) -> Beside:
    """Room for some particles, and for so many colliders that are not convex."""
    patches = simplices.edges.shape[1] + simplices.corners.shape[1]
    return Beside(np.zeros((10, count)), np.zeros((rough, 3, count)), np.full((rough, patches), -np.inf))


def new_desk(count: int) -> Desk:
    """Scratch for some particles."""
    return Desk(np.zeros(count), np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros((8, count)))
