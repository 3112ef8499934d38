"""Hinges and triangles linearised, all at once, in the manner of `particlesim.engine.stability.bond_tensors`.

A hinge resists with Σ w wᵀ, w a vector on its particles; a triangle's drag damps with T = −∂f/∂v, a ninth of it between any
two corners. With y = √m x both are bounded particle by particle: for any numbers g > 0 of the corners

    (Σ u_c·y_c)² ≤ Σ g · Σ (u_c·y_c)²/g_c,

here with g_c = |u_c|, u_c = w_c/√m_c, and with g_c = 1/√m_c for the sum over a triangle's corners.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.bonds.hinge import angles_at, wrapped
from particlesim.engine.interactions.elements import AngleColumns, Corners, TriangleColumns
from particlesim.forces.sheet_drag import Triangle
from particlesim.laws.registry import Particle, hinge_moment, hinge_stiffness, triangle_force_dv

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LOOKED_AT = 2_000
"""Triangles whose drag is looked at, evenly spread; the others count as the one before them does, by their area."""


class CornerTensors(NamedTuple):
    """Hinges or triangles of a set near a state: rows of their particles [corners, n]; `forms`: the vectors w [m, n,
    corners, 3] [√(N/m)], m products for each; `drag`: T/9 [n, 3, 3] [kg/s]."""

    rows: Ints
    forms: Floats
    drag: Floats

    @property
    def number(self) -> int:
        """How many there are."""
        return self.rows.shape[1]

    def matrices(self, count: int) -> tuple[Any, Any]:
        """Stiffness and damping of all particles as sparse matrices, shape [3 count, 3 count]."""
        stiffness = np.einsum("mnca,mndb->ncadb", self.forms, self.forms)
        corners = len(self.rows)
        damping = np.broadcast_to(self.drag[:, None, :, None, :], (self.number, corners, 3, corners, 3))
        return self._assembled(stiffness, count), self._assembled(damping, count)

    def jacobians(self, count: int) -> tuple[Any, Any]:
        """∂f/∂x and ∂f/∂v of all particles."""
        stiffness, damping = self.matrices(count)
        return -stiffness, -damping

    def _assembled(self, blocks: Floats, count: int) -> Any:
        from scipy.sparse import coo_array

        at = 3 * self.rows.T[:, :, None] + np.arange(3)  # [n, corners, 3]
        rows, columns = (
            np.broadcast_to(part, blocks.shape).ravel()
            for part in (at[:, :, :, None, None], at[:, None, None, :, :])
        )
        return coo_array((blocks.ravel(), (rows, columns)), shape=(3 * count, 3 * count)).tocsr()

    def loads(self, w: Floats, *, damping: bool, rows: int) -> Iterator[tuple[Ints, list[Floats]]]:
        """As those of springs."""
        root = np.sqrt(w[self.rows])  # [corners, n]
        if damping:
            for at, share in zip(self.rows, root, strict=True):
                yield at, _parts((share * root.sum(axis=0))[:, None, None] * self.drag, rows)
            return
        for form in self.forms:
            u = root.T[:, :, None] * form
            g = np.sqrt((u * u).sum(axis=2))
            for corner, at in enumerate(self.rows):
                size = g[:, corner]
                factor = np.divide(g.sum(axis=1), size, out=np.zeros_like(size), where=size > 0)
                outer = np.einsum("na,nb->nab", u[:, corner], u[:, corner])
                yield at, _parts(factor[:, None, None] * outer, rows)


def _parts(tensors: Floats, rows: int) -> list[Floats]:
    """Tensors [n, 3, 3] by component, or their traces."""
    if rows == 1:
        return [np.trace(tensors, axis1=1, axis2=2)]
    return [tensors[:, a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def corner_tensors(each: Corners, columns: Any, time: float) -> CornerTensors:
    """A set of hinges or triangles at the present state."""
    x, v = (
        np.stack([column.astype(float) for column in part])
        for part in ((columns.x, columns.y, columns.z), (columns.vx, columns.vy, columns.vz))
    )
    number, corners = each.rows.shape[1], len(each.rows)
    if isinstance(each, TriangleColumns):
        return CornerTensors(each.rows, np.zeros((0, number, corners, 3)), _drag(each, x, v, time))
    deviation = wrapped(angles_at(x, each.rows.T) - each.rest)
    stiffness = np.broadcast_to(np.maximum(hinge_stiffness(each.law, deviation), 0.0), number)
    points = [x[:, row].T for row in each.rows]
    if isinstance(each, AngleColumns):
        moment = np.asarray(hinge_moment(each.law, deviation))
        forms = _angle_forms(stiffness, moment, points)
    else:
        forms = np.sqrt(stiffness)[:, None, None] * _fold_gradient(points)[None]
    return CornerTensors(each.rows, forms, np.zeros((number, 3, 3)))


def _drag(each: TriangleColumns, place: Floats, v: Floats, time: float) -> Floats:
    corners = place[:, each.rows]  # [3, corners, n]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0).T
    middle, mean = corners.mean(axis=1).T, v[:, each.rows].mean(axis=1).T
    stride = -(-len(area) // LOOKED_AT)
    size = np.linalg.norm(area, axis=1)
    found = np.zeros((len(area), 3, 3))
    for k in range(0, len(area), stride):
        (ax, ay, az), (x, y, z), (vx, vy, vz) = area[k], middle[k], mean[k]
        plate = Triangle(ax, ay, az, Particle(x, y, z, vx, vy, vz, 0.0, 0.0, 0.0, time))
        drag = -np.reshape(triangle_force_dv(each.law, plate), (3, 3)) / 9
        part = size[k : k + stride] / size[k] if size[k] > 0 else np.zeros(len(size[k : k + stride]))
        found[k : k + stride] = part[:, None, None] * drag
    return found


def _angle_forms(stiffness: Floats, moment: Floats, points: list[Floats]) -> Floats:
    """As `bonds.hinge.angle_forms`, for all at once; shape [2, n, 3, 3]."""
    a, b = points[0] - points[1], points[2] - points[1]
    normal = np.cross(a, b)
    n = np.linalg.norm(normal, axis=1)
    bent = n > 0
    other = np.eye(3)[np.abs(a).argmin(axis=1)]
    m = np.where(bent[:, None], normal, np.cross(a, other))
    m = _divided(m, np.linalg.norm(m, axis=1))
    la, lb, dot = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1), (a * b).sum(axis=1)
    pushed = moment < 0
    wide = la * lb + np.abs(dot)
    ratio = np.divide(n, wide, out=np.ones_like(n), where=bent)
    lever = np.where(pushed == (dot < 0), 1 / ratio, ratio)
    out = np.sqrt(np.where(bent, 0.5 * np.abs(moment) * lever, stiffness))
    sign = np.where(np.where(bent, pushed, dot < 0), 1.0, -1.0)
    s = np.sqrt(stiffness)[:, None]
    first = [-s * _divided(np.cross(m, a), la * la), s * _divided(np.cross(m, b), lb * lb)]
    second = [_divided(out[:, None] * m, la), _divided((sign * out)[:, None] * m, lb)]
    return np.stack([np.stack([by_a, -by_a - by_b, by_b], axis=1) for by_a, by_b in (first, second)])


def _fold_gradient(points: list[Floats]) -> Floats:
    """As `bonds.hinge.dihedral_gradient`, for all at once; shape [n, 4, 3]."""
    f, g, h = points[0] - points[1], points[1] - points[2], points[3] - points[2]
    a, b = np.cross(f, g), np.cross(h, g)
    length, a2, b2 = np.linalg.norm(g, axis=1), (a * a).sum(axis=1), (b * b).sum(axis=1)
    sound = ((a2 > 0) & (b2 > 0))[:, None]
    first, last = -length[:, None] * _divided(a, a2), length[:, None] * _divided(b, b2)
    fg, hg = (_divided((part * g).sum(axis=1)[:, None], length) for part in (f, h))
    second = -first + fg * _divided(a, a2) - hg * _divided(b, b2)
    gradient = np.stack([first, second, -first - second - last, last], axis=1)
    return np.where(sound[:, :, None], gradient, 0.0)


def _divided(vectors: Floats, by: Floats) -> Floats:
    """Vectors [n, k] over numbers [n], 0 where a number is."""
    return np.divide(vectors, by[:, None], out=np.zeros_like(vectors), where=by[:, None] > 0)
