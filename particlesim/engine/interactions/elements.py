"""Forces among three and four particles in kernels: angles, dihedrals, and drag on triangles.

Every thread takes all that have a corner among its particles, in one order, and adds to its own particles alone. What lies
across a border is computed by both sides; in return no thread waits for another, and sums have the same bits for any number
of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bonds.hinge import angle_gradient, dihedral_gradient, wrapped
from particlesim.compiler import kernel, outlined
from particlesim.forces.sheet_drag import Triangle
from particlesim.laws.registry import Particle, hinge_energy, hinge_moment, triangle_force


class AngleColumns(NamedTuple):
    """Angles of one law: rows of the particles [3, n], the angle at the second; rest angles [rad], [n]."""

    law: tuple[Any, ...]
    rows: Any
    rest: Any


class DihedralColumns(NamedTuple):
    """Dihedrals of one law: rows of the particles [4, n], the edge from the second to the third; rest folds [rad], [n]."""

    law: tuple[Any, ...]
    rows: Any
    rest: Any


class TriangleColumns(NamedTuple):
    """Triangles of a surface under one force: rows of the corners [3, n]. `rest` is empty."""

    law: tuple[Any, ...]
    rows: Any
    rest: Any


Corners = AngleColumns | DihedralColumns | TriangleColumns


def corners_between(sets: tuple[Corners, ...], first: int, last: int) -> tuple[Corners, ...]:
    """What has a corner among particles [first, last), in the same order."""
    parts = []
    for each in sets:
        mine = ((each.rows >= first) & (each.rows < last)).any(axis=0)
        rest = each.rest[mine] if len(each.rest) else each.rest
        parts.append(each._replace(rows=np.ascontiguousarray(each.rows[:, mine]), rest=rest))
    return tuple(parts)


def add_corners(sets: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    """Add the forces of all sets on particles [first, last)."""
    for each in sets:
        add_set(each, c, total, first, last, t)


def give(total: Any, i: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> None:
    """Add a force to particle i if it is among [first, last)."""
    if first <= i < last:
        total[0, i] += x
        total[1, i] += y
        total[2, i] += z


def bent(each: Any, c: Any, q: Any) -> Any:
    """Angle or dihedral q: the deviation from its rest angle [rad], and the gradients as `bonds.hinge` gives them."""
    if isinstance(each, AngleColumns):
        i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
        g = angle_gradient(
            c.x[i] - c.x[j],
            c.y[i] - c.y[j],
            c.z[i] - c.z[j],
            c.x[k] - c.x[j],
            c.y[k] - c.y[j],
            c.z[k] - c.z[j],
        )
        return wrapped(g[0] - each.rest[q]), g
    i, j, k, m = each.rows[0, q], each.rows[1, q], each.rows[2, q], each.rows[3, q]
    fold = dihedral_gradient(
        c.x[i] - c.x[j],
        c.y[i] - c.y[j],
        c.z[i] - c.z[j],
        c.x[j] - c.x[k],
        c.y[j] - c.y[k],
        c.z[j] - c.z[k],
        c.x[m] - c.x[k],
        c.y[m] - c.y[k],
        c.z[m] - c.z[k],
    )
    return wrapped(fold[0] - each.rest[q]), fold


def _add_angles(each: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    for q in range(each.rows.shape[1]):
        d, g = bent(each, c, q)
        s = -hinge_moment(each.law, d)
        ax, ay, az = s * g[1], s * g[2], s * g[3]
        bx, by, bz = s * g[4], s * g[5], s * g[6]
        give(total, each.rows[0, q], first, last, ax, ay, az)
        give(total, each.rows[1, q], first, last, -(ax + bx), -(ay + by), -(az + bz))
        give(total, each.rows[2, q], first, last, bx, by, bz)


def _add_dihedrals(each: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    for q in range(each.rows.shape[1]):
        d, g = bent(each, c, q)
        s = -hinge_moment(each.law, d)
        ax, ay, az = s * g[1], s * g[2], s * g[3]
        bx, by, bz = s * g[4], s * g[5], s * g[6]
        dx, dy, dz = s * g[7], s * g[8], s * g[9]
        give(total, each.rows[0, q], first, last, ax, ay, az)
        give(total, each.rows[1, q], first, last, bx, by, bz)
        give(total, each.rows[2, q], first, last, -(ax + bx + dx), -(ay + by + dy), -(az + bz + dz))
        give(total, each.rows[3, q], first, last, dx, dy, dz)


def _add_triangles(each: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    for q in range(each.rows.shape[1]):
        fx, fy, fz = triangle_force(each.law, triangle(each, c, q, t))
        for corner in range(3):
            give(total, each.rows[corner, q], first, last, fx / 3, fy / 3, fz / 3)


FORCES = {AngleColumns: _add_angles, DihedralColumns: _add_dihedrals, TriangleColumns: _add_triangles}


@outlined
def add_set(each: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    """Add the forces of one set on particles [first, last)."""
    FORCES[type(each)](each, c, total, first, last, t)


def triangle(each: Any, c: Any, q: Any, t: Any) -> Any:
    """Triangle q as laws see it."""
    i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
    ax, ay, az = c.x[j] - c.x[i], c.y[j] - c.y[i], c.z[j] - c.z[i]
    bx, by, bz = c.x[k] - c.x[i], c.y[k] - c.y[i], c.z[k] - c.z[i]
    middle = Particle(
        c.x[i] + (ax + bx) / 3,
        c.y[i] + (ay + by) / 3,
        c.z[i] + (az + bz) / 3,
        (c.vx[i] + c.vx[j] + c.vx[k]) / 3,
        (c.vy[i] + c.vy[j] + c.vy[k]) / 3,
        (c.vz[i] + c.vz[j] + c.vz[k]) / 3,
        c.m[i] - c.m[i],
        c.m[i] - c.m[i],
        c.m[i] - c.m[i],
        t,
    )
    return Triangle((ay * bz - az * by) / 2, (az * bx - ax * bz) / 2, (ax * by - ay * bx) / 2, middle)


@kernel
def sum_hinges(each: Any, c: Any) -> float:
    """Potential energy of a set of angles or dihedrals [J]."""
    total = 0.0
    for q in range(each.rows.shape[1]):
        d, _ = bent(each, c, q)
        total += hinge_energy(each.law, d)
    return total
