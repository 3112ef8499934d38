"""Hinges and triangles in the linear equations of an implicit step.

To the matrix of `linear_system` every hinge adds γ times the positive part of its second derivatives, which
is one product w wᵀ for a dihedral and two for an angle (`particlesim.bonds.hinge`), with w a vector on its three or four
particles that sums to zero; and every triangle adds −∂f/∂v, a ninth of it between any two of its corners. How the force on
a triangle changes as it turns is left out, as is what lets a hinge snap or only changes its leverage: it is not symmetric or
not definite. Forces are complete, so that a converged step solves the equations of the method all the same.

As with forces, every thread takes all that have a corner among its particles, in one order, and adds to its own particles
alone. The lattices of the preconditioner leave hinges and triangles out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from particlesim.bonds.hinge import angle_forms
from particlesim.compiler import outlined
from particlesim.engine.interactions.elements import (
    AngleColumns,
    Corners,
    DihedralColumns,
    TriangleColumns,
    bent,
    give,
    triangle,
)
from particlesim.laws.registry import hinge_moment, hinge_stiffness, triangle_force_dv

NUMBERS = {AngleColumns: 12, DihedralColumns: 9, TriangleColumns: 6}
"""What is kept of each: w and p by a and b; w by x₁, x₂ and x₄; a ninth of −∂f/∂v as xx, yy, zz, xy, xz, yz."""


def new_forms(sets: Sequence[Corners], dtype: Any) -> tuple[Any, ...]:
    """Arrays for what sets of hinges and triangles add to the equations, [numbers, n] each."""
    return tuple(np.zeros((NUMBERS[type(each)], each.rows.shape[1]), dtype) for each in sets)


def stiffen(sets: Any, forms: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
    """Find what all sets add at the present state: to the blocks of particles [first, last), and to their residuals what the
    forces of hinges gain from the lead."""
    for each, form in zip(sets, forms, strict=True):
        stiffen_set(each, form, c, s, first, last, t, reach)


def add_square(s: Any, i: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> None:
    """Add w wᵀ to the block of particle i if it is among [first, last)."""
    if first <= i < last:
        s.block[0, i] += x * x
        s.block[1, i] += y * y
        s.block[2, i] += z * z
        s.block[3, i] += x * y
        s.block[4, i] += x * z
        s.block[5, i] += y * z


def take(s: Any, i: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> None:
    """Subtract a force from the residual of particle i if it is free and among [first, last)."""
    if first <= i < last:
        s.residual[0, i] -= s.free[i] * x
        s.residual[1, i] -= s.free[i] * y
        s.residual[2, i] -= s.free[i] * z


def _stiffen_angles(each: Any, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
    for q in range(each.rows.shape[1]):
        i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
        d, _ = bent(each, c, q)
        stiff = max(hinge_stiffness(each.law, d), d - d)
        w = angle_forms(
            reach * stiff,
            reach * hinge_moment(each.law, d),
            c.x[i] - c.x[j],
            c.y[i] - c.y[j],
            c.z[i] - c.z[j],
            c.x[k] - c.x[j],
            c.y[k] - c.y[j],
            c.z[k] - c.z[j],
        )
        for row, entry in enumerate(w):
            form[row, q] = entry
        for ax, ay, az, bx, by, bz in (w[:6], w[6:]):
            add_square(s, i, first, last, ax, ay, az)
            add_square(s, j, first, last, ax + bx, ay + by, az + bz)
            add_square(s, k, first, last, bx, by, bz)
        ax, ay, az, bx, by, bz = angle_times(each, form, s.lead, q)
        take(s, i, first, last, ax, ay, az)
        take(s, j, first, last, -(ax + bx), -(ay + by), -(az + bz))
        take(s, k, first, last, bx, by, bz)


def _stiffen_dihedrals(
    each: Any, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any
) -> None:
    for q in range(each.rows.shape[1]):
        i, j, k, m = each.rows[0, q], each.rows[1, q], each.rows[2, q], each.rows[3, q]
        d, g = bent(each, c, q)
        root = np.sqrt(reach * max(hinge_stiffness(each.law, d), d - d))
        for row, entry in enumerate(g[1:]):
            form[row, q] = root * entry
        w = form[:, q]
        add_square(s, i, first, last, w[0], w[1], w[2])
        add_square(s, j, first, last, w[3], w[4], w[5])
        add_square(s, k, first, last, w[0] + w[3] + w[6], w[1] + w[4] + w[7], w[2] + w[5] + w[8])
        add_square(s, m, first, last, w[6], w[7], w[8])
        ax, ay, az, bx, by, bz, dx, dy, dz = dihedral_times(each, form, s.lead, q)
        take(s, i, first, last, ax, ay, az)
        take(s, j, first, last, bx, by, bz)
        take(s, k, first, last, -(ax + bx + dx), -(ay + by + dy), -(az + bz + dz))
        take(s, m, first, last, dx, dy, dz)


def _stiffen_triangles(
    each: Any, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any
) -> None:
    for q in range(each.rows.shape[1]):
        g = triangle_force_dv(each.law, triangle(each, c, q, t))
        form[0, q], form[1, q], form[2, q] = -g[0] / 9, -g[4] / 9, -g[8] / 9
        form[3, q], form[4, q], form[5, q] = -g[1] / 9, -g[2] / 9, -g[5] / 9
        for corner in range(3):
            i = each.rows[corner, q]
            if first <= i < last:
                for row in range(6):
                    s.block[row, i] += form[row, q]


STIFFEN = {
    AngleColumns: _stiffen_angles,
    DihedralColumns: _stiffen_dihedrals,
    TriangleColumns: _stiffen_triangles,
}


@outlined
def stiffen_set(each: Any, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
    """`stiffen` for one set."""
    STIFFEN[type(each)](each, form, c, s, first, last, t, reach)


def times_corners(sets: Any, forms: Any, x: Any, y: Any, first: Any, last: Any) -> None:
    """Add to y, on particles [first, last), what all sets make of x."""
    for each, form in zip(sets, forms, strict=True):
        times_set(each, form, x, y, first, last)


def angle_times(each: Any, form: Any, x: Any, q: Any) -> Any:
    """What an angle makes of x [3, particles]: its forces on its first particle and on its third."""
    i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
    ax, ay, az = x[0, i] - x[0, j], x[1, i] - x[1, j], x[2, i] - x[2, j]
    bx, by, bz = x[0, k] - x[0, j], x[1, k] - x[1, j], x[2, k] - x[2, j]
    w, p = form[0:6, q], form[6:12, q]
    u = w[0] * ax + w[1] * ay + w[2] * az + w[3] * bx + w[4] * by + w[5] * bz
    v = p[0] * ax + p[1] * ay + p[2] * az + p[3] * bx + p[4] * by + p[5] * bz
    return (
        u * w[0] + v * p[0],
        u * w[1] + v * p[1],
        u * w[2] + v * p[2],
        u * w[3] + v * p[3],
        u * w[4] + v * p[4],
        u * w[5] + v * p[5],
    )


def dihedral_times(each: Any, form: Any, x: Any, q: Any) -> Any:
    """What a dihedral makes of x: its forces on its first, second and fourth particle."""
    i, j, k, m = each.rows[0, q], each.rows[1, q], each.rows[2, q], each.rows[3, q]
    w, u = form[:, q], x[0, i] - x[0, i]
    for axis in range(3):
        base = x[axis, k]
        u += w[axis] * (x[axis, i] - base)
        u += w[3 + axis] * (x[axis, j] - base)
        u += w[6 + axis] * (x[axis, m] - base)
    return u * w[0], u * w[1], u * w[2], u * w[3], u * w[4], u * w[5], u * w[6], u * w[7], u * w[8]


def _times_angles(each: Any, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
    for q in range(each.rows.shape[1]):
        ax, ay, az, bx, by, bz = angle_times(each, form, x, q)
        give(y, each.rows[0, q], first, last, ax, ay, az)
        give(y, each.rows[1, q], first, last, -(ax + bx), -(ay + by), -(az + bz))
        give(y, each.rows[2, q], first, last, bx, by, bz)


def _times_dihedrals(each: Any, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
    for q in range(each.rows.shape[1]):
        ax, ay, az, bx, by, bz, dx, dy, dz = dihedral_times(each, form, x, q)
        give(y, each.rows[0, q], first, last, ax, ay, az)
        give(y, each.rows[1, q], first, last, bx, by, bz)
        give(y, each.rows[2, q], first, last, -(ax + bx + dx), -(ay + by + dy), -(az + bz + dz))
        give(y, each.rows[3, q], first, last, dx, dy, dz)


def _times_triangles(each: Any, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
    for q in range(each.rows.shape[1]):
        i, j, k = each.rows[0, q], each.rows[1, q], each.rows[2, q]
        g = form[:, q]
        ux, uy, uz = x[0, i] + x[0, j] + x[0, k], x[1, i] + x[1, j] + x[1, k], x[2, i] + x[2, j] + x[2, k]
        fx = g[0] * ux + g[3] * uy + g[4] * uz
        fy = g[3] * ux + g[1] * uy + g[5] * uz
        fz = g[4] * ux + g[5] * uy + g[2] * uz
        give(y, i, first, last, fx, fy, fz)
        give(y, j, first, last, fx, fy, fz)
        give(y, k, first, last, fx, fy, fz)


TIMES = {AngleColumns: _times_angles, DihedralColumns: _times_dihedrals, TriangleColumns: _times_triangles}


@outlined
def times_set(each: Any, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
    """`times_corners` for one set."""
    TIMES[type(each)](each, form, x, y, first, last)
