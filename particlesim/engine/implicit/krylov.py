"""Iterations that solve an island's linear equations on several threads, with the same bits for any number of them.

Symmetric positive definite equations are solved by conjugate gradients, others by BiCGStab, both preconditioned by the 3 × 3
blocks on the diagonal and by lattices (`multilevel`). Dot products are summed over each chunk of
particles, and then over the chunks in order; all threads compute the same scalars, and so decide alike. The size of a
residual is √(rᵀ M⁻¹ r), with M the preconditioner.

Source: Y. Saad, Iterative Methods for Sparse Linear Systems, algorithms 9.1 and 7.7.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.barrier import meet, team_of
from particlesim.engine.implicit.linear_system import LANES, keep_along, multiply
from particlesim.engine.implicit.multilevel import carry
from particlesim.engine.state.columns import type_of

SOLVED, UNSOLVED, WILD, INDEFINITE = 0, 1, 2, 3
"""How a solver ended: the residual is small; too many iterations; it is not finite; the matrix is not positive definite."""


@shared
def dot(a: Any, b: Any, lo: Any, hi: Any, lanes: Any) -> float:
    """Σ aᵢ bᵢ over particles [lo, hi) of [3, n], in double precision and in a fixed order; `lanes` is scratch."""
    for j in range(LANES):
        lanes[j] = 0
    for axis in range(3):
        p, q = a[axis, lo:hi], b[axis, lo:hi]
        whole = p.size // LANES * LANES
        for k in range(0, whole, LANES):
            u, v = p[k : k + LANES], q[k : k + LANES]
            for j in range(LANES):
                lanes[j] += float(u[j]) * float(v[j])
        for k in range(whole, p.size):
            lanes[k - whole] += float(p[k]) * float(q[k])
    total = 0.0
    for j in range(LANES):
        total += lanes[j]
    return total


def dots(s: Any, row: Any, a: Any, b: Any, share: Any) -> None:
    """Dot product of a share's particles, chunk by chunk, into a row of the partial sums."""
    for lo in range(share.first, share.last, share.chunk):
        s.partial[row, lo // share.chunk] = dot(a, b, lo, min(lo + share.chunk, share.last), s.lanes)


@shared
def copy(a: Any, b: Any, lo: Any, hi: Any) -> None:
    """b = a for particles [lo, hi)."""
    for axis in range(3):
        u, v = a[axis, lo:hi], b[axis, lo:hi]
        for i in range(u.size):
            v[i] = u[i]


@shared
def clear(a: Any, lo: Any, hi: Any) -> None:
    """a = 0 for particles [lo, hi)."""
    for axis in range(3):
        u = a[axis, lo:hi]
        for i in range(u.size):
            u[i] = 0


def summed(partial: Any, row: Any) -> float:
    """The sum over all chunks, in order; all threads must have met."""
    total = 0.0
    for k in range(partial.shape[1]):
        total += partial[row, k]
    return total


def precondition(s: Any, r: Any, z: Any, share: Any) -> None:
    """z = M⁻¹ r for the particles of a share; r need not be in place, and z is not yet."""
    _precondition(s.block, s.lattices, s.free, r, z, team_of(share))
    keep_along(s, z, share.first, share.last)


@shared
def _precondition(block: Any, lattices: Any, free: Any, r: Any, z: Any, team: Any) -> None:
    lo, hi = team.first, team.last
    xx, yy, zz = block[0, lo:hi], block[1, lo:hi], block[2, lo:hi]
    xy, xz, yz = block[3, lo:hi], block[4, lo:hi], block[5, lo:hi]
    rx, ry, rz = r[0, lo:hi], r[1, lo:hi], r[2, lo:hi]
    zx, zy, zw = z[0, lo:hi], z[1, lo:hi], z[2, lo:hi]
    for i in range(rx.size):
        zx[i] = xx[i] * rx[i] + xy[i] * ry[i] + xz[i] * rz[i]
        zy[i] = xy[i] * rx[i] + yy[i] * ry[i] + yz[i] * rz[i]
        zw[i] = xz[i] * rx[i] + yz[i] * ry[i] + zz[i] * rz[i]
    carry(lattices, free, r, z, team)


@shared
def add_scaled(y: Any, factor: Any, x: Any, lo: Any, hi: Any) -> None:
    """y += factor · x for particles [lo, hi)."""
    for axis in range(3):
        u, v = y[axis, lo:hi], x[axis, lo:hi]
        k = type_of(u[0], factor)
        for i in range(u.size):
            u[i] += k * v[i]


@shared
def scale_and_add(y: Any, factor: Any, x: Any, lo: Any, hi: Any) -> None:
    """y = factor · y + x for particles [lo, hi)."""
    for axis in range(3):
        u, v = y[axis, lo:hi], x[axis, lo:hi]
        k = type_of(u[0], factor)
        for i in range(u.size):
            u[i] = k * u[i] + v[i]


def size2(s: Any, share: Any) -> Any:
    """rᵀ M⁻¹ r of the residual, and M⁻¹ r in `near`; the same number for all threads."""
    precondition(s, s.residual, s.near, share)
    dots(s, 0, s.residual, s.near, share)
    meet(share.gate, share.threads)
    return summed(s.partial, 0)


def conjugate_gradients(bonds: Any, s: Any, share: Any, plain: Any, begin: Any, goal: Any, limit: Any) -> Any:
    """Solve for `solution` from zero until rᵀ M⁻¹ r ≤ goal; needs what `size2` left, and `begin`, what it returned.

    Returns how it ended, the last rᵀ M⁻¹ r, and the number of iterations. `residual` is used up.
    """
    lo, hi = share.first, share.last
    clear(s.solution, lo, hi)
    copy(s.near, s.direction, lo, hi)
    size = begin
    meet(share.gate, share.threads)
    for iteration in range(limit):
        if size <= goal:
            return SOLVED, size, iteration
        multiply(bonds, s.springs, s, s.direction, s.product, plain, share)
        keep_along(s, s.product, lo, hi)
        dots(s, 1, s.direction, s.product, share)
        meet(share.gate, share.threads)
        curvature = summed(s.partial, 1)
        if not curvature < np.inf:
            return WILD, size, iteration
        if not curvature > 0:
            return INDEFINITE, size, iteration
        step = size / curvature
        add_scaled(s.solution, step, s.direction, lo, hi)
        add_scaled(s.residual, -step, s.product, lo, hi)
        after = size2(s, share)
        if not after < np.inf:
            return WILD, after, iteration
        scale_and_add(s.direction, after / size, s.near, lo, hi)
        size = after
        meet(share.gate, share.threads)
    return (SOLVED if size <= goal else UNSOLVED), size, limit


class Symmetric(NamedTuple):
    """Stands for a kernel that solves symmetric positive definite equations alone: most islands have no others, and half of
    what there is to compile is for them."""


class General(NamedTuple):
    """Stands for a kernel that solves any equations."""


@outlined
def stabilised(
    solver: Any, bonds: Any, s: Any, share: Any, plain: Any, begin: Any, goal: Any, limit: Any
) -> Any:
    """BiCGStab, for equations that are not symmetric or not positive definite; as `conjugate_gradients` otherwise.

    A kernel of the `Symmetric` kind gives them back: it ends with INDEFINITE.
    """
    if isinstance(solver, Symmetric):
        return INDEFINITE, begin, 0
    # Preconditioned from the right. `shadow` is the residual at the start, `near` what the preconditioner makes of a vector,
    # `other` A M⁻¹ of the intermediate residual.
    lo, hi = share.first, share.last
    clear(s.solution, lo, hi)
    copy(s.residual, s.direction, lo, hi)
    copy(s.residual, s.shadow, lo, hi)
    size = begin
    dots(s, 1, s.shadow, s.residual, share)
    meet(share.gate, share.threads)
    rho = summed(s.partial, 1)
    for iteration in range(limit):
        if size <= goal:
            return SOLVED, size, iteration
        precondition(s, s.direction, s.near, share)
        meet(share.gate, share.threads)
        _free_product(bonds, s, s.product, plain, share)
        dots(s, 1, s.shadow, s.product, share)
        meet(share.gate, share.threads)
        step = rho / summed(s.partial, 1)
        add_scaled(s.solution, step, s.near, lo, hi)
        add_scaled(s.residual, -step, s.product, lo, hi)
        precondition(s, s.residual, s.near, share)
        meet(share.gate, share.threads)
        _free_product(bonds, s, s.other, plain, share)
        dots(s, 1, s.other, s.residual, share)
        dots(s, 2, s.other, s.other, share)
        meet(share.gate, share.threads)
        square = summed(s.partial, 2)
        weight = summed(s.partial, 1) / square if square > 0 else 0.0
        add_scaled(s.solution, weight, s.near, lo, hi)
        add_scaled(s.residual, -weight, s.other, lo, hi)
        size = size2(s, share)
        if not size < np.inf:
            return WILD, size, iteration
        dots(s, 1, s.shadow, s.residual, share)
        meet(share.gate, share.threads)
        after = summed(s.partial, 1)
        factor = after / rho * step / weight if rho * weight != 0 else 0.0
        rho = after
        add_scaled(s.direction, -weight, s.product, lo, hi)
        scale_and_add(s.direction, factor, s.residual, lo, hi)
    return (SOLVED if size <= goal else UNSOLVED), size, limit


@outlined
def _free_product(bonds: Any, s: Any, y: Any, plain: Any, share: Any) -> None:
    """y = A · near; 0 for particles that do not move."""
    multiply(bonds, s.springs, s, s.near, y, plain, share)
    keep_along(s, y, share.first, share.last)
    for axis in range(3):
        for i in range(share.first, share.last):
            y[axis, i] *= s.free[i]
