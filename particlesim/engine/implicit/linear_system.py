"""The linear equations of an implicit step in an island, (D + G + B) δ = r, without a matrix.

D is the inertia of every particle over the reach γ of the step, m/γ, or its drag coefficient where it has no inertia;
G = −∂f/∂v − γ ∂f/∂x are the 3 × 3 Jacobians of forces on single particles; and every spring adds to B

    (c + γ k) e eᵀ + γ max(T/l, 0) (1 − e eᵀ) = q 1 + w wᵀ

on the difference of its ends, with e its direction, l its length and T its tension. Compressed springs would push sideways;
that part is dropped, so that B is positive (semi-)definite. A spring is the four numbers w and q. What other
interactions add to B, they say themselves (`interactions.interaction`).

Threads own chunks of particles and add to those alone, piece after piece, as they do with forces.
Source: D. Baraff, A. Witkin, SIGGRAPH 1998; K.-J. Choi, H.-S. Ko, SIGGRAPH 2002.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import outlined, shared
from particlesim.compiler.barrier import meet
from particlesim.engine.coupled.workspace import team_of
from particlesim.engine.implicit.multilevel import Lattices, gather_blocks, inverse_of, new_lattices
from particlesim.engine.interactions.bond_layout import (
    FIRST,
    HOLES,
    HOLES_END,
    LENGTH,
    OFFSET,
    OWNS_FIRST,
    OWNS_SECOND,
    SECOND,
    chunk_size,
)
from particlesim.engine.interactions.bonds import Bonds, add_pulls, chunks_of, pair_in, run_of
from particlesim.engine.interactions.interaction import multiply_elements, stiffen_elements
from particlesim.engine.state.columns import fetch, type_of
from particlesim.engine.step.particle_step import Newtonian
from particlesim.laws.registry import (
    bond_force_dv,
    bond_force_dx,
    force_dv,
    force_dx,
    times,
    velocity,
    velocity_dx,
)

GENERAL, COUPLED_AXES = 0, 1
"""Flags of a system, for every thread: some G is not symmetric; some G is not zero."""
LANES = 64
"""Sums that run beside each other, so that they are vectors; chunks of particles are multiples of it, but for the last."""
FLAGS = 8
"""Flags per thread: those of two threads are on different cache lines."""


class System(NamedTuple):
    """Arrays of an island's equations; n particles, vectors of shape [3, n].

    `inertia` D and `free` (1, or 0 for particles that do not move) [n]; `own` G row by row [9, n]; `block`: the 3 × 3 blocks
    on the diagonal, then their inverses, as xx, yy, zz, xy, xz, yz [6, n]; `anchor`: their part without springs to free
    particles; `base`: X₀ and V₀ of the step [6, n]; `lead`: the
    velocity with which a single linear solve expects positions to move; `residual` r, `solution` δ, and work of the solver;
    `springs`: w and q of every slot [4, slots], for every set; `forms`: what the other interactions of a
    thread keep of their linearisation; `pull`: scratch of a thread [8, chunk], and `lanes` for its
    sums; `partial`: sums of chunks [4, chunks]; `flags`; `report`: how the last step ended, its relative residual, and its
    Newton and linear iterations.
    """

    inertia: Any
    free: Any
    own: Any
    block: Any
    anchor: Any
    base: Any
    lead: Any
    residual: Any
    solution: Any
    near: Any
    direction: Any
    product: Any
    shadow: Any
    other: Any
    springs: tuple[Any, ...]
    forms: tuple[Any, ...]
    lattices: Lattices
    pull: Any
    lanes: Any
    partial: Any
    flags: Any
    report: Any


def new_system(bonds: Sequence[Bonds], place: NDArray[Any], dtype: Any) -> System:
    """Arrays for an island of particles that are at `place` [3, n] at the start."""
    count = place.shape[1]
    chunk = chunk_size(count)

    def rows(number: int) -> Any:
        return np.zeros((number, count), dtype)

    return System(
        inertia=np.zeros(count, dtype),
        free=np.zeros(count, dtype),
        own=rows(9),
        block=rows(6),
        anchor=rows(6),
        base=rows(6),
        lead=rows(3),
        residual=rows(3),
        solution=rows(3),
        near=rows(3),
        direction=rows(3),
        product=rows(3),
        shadow=rows(3),
        other=rows(3),
        lattices=_lattices(bonds, place, dtype),
        springs=tuple(np.zeros((4, len(bond.i)), dtype) for bond in bonds),
        forms=(),
        pull=np.zeros((8, chunk), dtype),
        lanes=np.zeros(LANES),
        partial=np.zeros((4, -(-count // chunk))),
        flags=np.zeros(FLAGS * -(-count // chunk), np.int64),
        report=np.zeros(4),
    )


def _lattices(bonds: Sequence[Bonds], place: NDArray[Any], dtype: Any) -> Lattices:
    there = [np.flatnonzero(bond.i >= 0) for bond in bonds]
    i, j = (
        np.concatenate(
            [np.empty(0, np.int64), *(getattr(bond, end)[k] for bond, k in zip(bonds, there, strict=True))]
        )
        for end in "ij"
    )
    stiffness = [np.broadcast_to(bond.k, bond.i.shape)[k] for bond, k in zip(bonds, there, strict=True)]
    weight = np.concatenate([np.empty(0), *stiffness]).astype(float)
    return new_lattices(place.astype(float), i, j, weight, dtype)


def write_own(s: Any, i: Any, inertia: Any, g: Any) -> Any:
    """Put down D and G of particle i, and begin its block; returns whether G is unsymmetric, and whether it is not zero."""
    s.inertia[i] = inertia
    for k, entry in enumerate(g):
        s.own[k, i] = entry
    s.block[0, i] = inertia + g[0]
    s.block[1, i] = inertia + g[4]
    s.block[2, i] = inertia + g[8]
    s.block[3, i] = (g[1] + g[3]) * type_of(inertia, 0.5)
    s.block[4, i] = (g[2] + g[6]) * type_of(inertia, 0.5)
    s.block[5, i] = (g[5] + g[7]) * type_of(inertia, 0.5)
    for k in range(6):
        s.anchor[k, i] = s.block[k, i]
    apart = abs(g[1] - g[3]) + abs(g[2] - g[6]) + abs(g[5] - g[7])
    size = abs(g[0]) + abs(g[4]) + abs(g[8]) + abs(g[1]) + abs(g[2]) + abs(g[5])
    return apart > type_of(inertia, 1e-6) * (size + inertia), size + apart > 0


def add_own(parts: Any, c: Any, s: Any, total: Any, t: Any, reach: Any, lo: Any, hi: Any, flags: Any) -> None:
    """D, G and the residual of particles [lo, hi) from the forces on single particles.

    `total` are all forces, `reach` is γ; the residual is f − D (V − V₀), and what the forces gain from the lead.
    """
    for part in parts:
        first, last = max(lo, part.first), min(hi, part.last)
        _add_own(part.dynamics, part.forces, c, s, total, t, reach, first, last, flags)


def _add_own(
    dynamics: Any,
    forces: Any,
    c: Any,
    s: Any,
    total: Any,
    t: Any,
    reach: Any,
    first: Any,
    last: Any,
    flags: Any,
) -> None:
    for i in range(first, last):
        p = fetch(c, i, t)
        inertia, g, (rx, ry, rz) = equation(dynamics, forces, p, s.base[3:6, i], reach, s.lead[:, i])
        general, coupled = write_own(s, i, type_of(reach, inertia), g)
        free, none = s.free[i] > 0, type_of(reach, 0)
        flags[GENERAL] |= general & free
        flags[COUPLED_AXES] |= coupled & free
        s.residual[0, i] = total[0, i] + rx if free else none
        s.residual[1, i] = total[1, i] + ry if free else none
        s.residual[2, i] = total[2, i] + rz if free else none


def equation(dynamics: Any, forces: Any, p: Any, start: Any, reach: Any, lead: Any) -> Any:
    """D, G, and the residual without the force, of one particle that would move with the velocity that it has; tracers are
    never coupled."""
    if isinstance(dynamics, Newtonian):
        dx, dv = force_dx(forces, p), force_dv(forces, p)
        inertia = p.m / reach
        hx, hy, hz = times(dx, lead[0], lead[1], lead[2])
        g = combined(dx, dv, type_of(reach, 1), reach)
        return (
            inertia,
            g,
            (
                reach * hx - inertia * (p.vx - start[0]),
                reach * hy - inertia * (p.vy - start[1]),
                reach * hz - inertia * (p.vz - start[2]),
            ),
        )
    inertia = dynamics.gamma
    dx, dw = force_dx(forces, p), velocity_dx(dynamics.flow, p)
    wx, wy, wz = velocity(dynamics.flow, p)
    hx, hy, hz = times(dx, lead[0], lead[1], lead[2])
    ux, uy, uz = times(dw, lead[0], lead[1], lead[2])
    return (
        inertia,
        combined(dx, dw, inertia * reach, reach),
        (
            reach * (hx + inertia * ux) - inertia * (p.vx - wx),
            reach * (hy + inertia * uy) - inertia * (p.vy - wy),
            reach * (hz + inertia * uz) - inertia * (p.vz - wz),
        ),
    )


def combined(a: Any, b: Any, weight: Any, reach: Any) -> Any:
    """−(γ A + weight · B) for two matrices."""
    return tuple(-(reach * x + weight * y) for x, y in zip(a, b, strict=True))


def stiff_of(bond: Any, b: Any, reach: Any) -> Any:
    """w and q of a spring, and the share (γ k − q)/w² of its stiffness along itself without damping; none is negative, but
    for the share."""
    dx, dv = bond_force_dx(bond.law, b), bond_force_dv(bond.law, b)
    square = b.x * b.x + b.y * b.y + b.z * b.z
    zero = square - square
    # Without branches, so that loops vectorise: coincident ends give e = 0.
    there = square if square > 0 else type_of(square, 1)
    inverse = np.sqrt(there) / there
    ex, ey, ez = b.x * inverse, b.y * inverse, b.z * inverse
    px, py, pz = times(dx, ex, ey, ez)
    qx, qy, qz = times(dv, ex, ey, ez)
    along = -(ex * px + ey * py + ez * pz)
    trace = -(dx[0] + dx[4] + dx[8])
    # Coincident ends have no direction, and pull back alike in every one.
    across = (trace - along) * type_of(square, 0.5) if square > 0 else trace * type_of(square, 1 / 3)
    along, across = reach * max(along, zero), reach * max(across, zero)
    damping = max(-(ex * qx + ey * qy + ez * qz), zero)
    across = min(across, along + damping) if square > 0 else across
    excess = along + damping - across
    root = np.sqrt(excess if square > 0 else zero)
    share = (along - across) / (excess if root > 0 else type_of(square, 1))
    return root * ex, root * ey, root * ez, across, share


def add_springs(bonds: Any, springs: Any, c: Any, s: Any, reach: Any) -> None:
    """w and q of all springs of a thread; adds their blocks and what their forces gain from the lead."""
    for chunk in range(chunks_of(bonds)):
        _stiff_chunk(bonds, springs, c, s, reach, chunk)


def _stiff_chunk(bonds: Any, springs: Any, c: Any, s: Any, reach: Any, chunk: Any) -> None:
    for bond, spring in zip(bonds, springs, strict=True):
        for piece in range(bond.begin[chunk], bond.begin[chunk + 1]):
            _stiff_piece(bond, spring, c, s, reach, bond.table[piece])


@outlined
def _stiff_piece(bond: Any, spring: Any, c: Any, s: Any, reach: Any, piece: Any) -> None:
    a, b, n = piece[FIRST], piece[SECOND], piece[LENGTH]
    first, last, run = piece[OFFSET], piece[OFFSET] + n, run_of(bond, c, piece)
    lax, lay, laz = s.lead[0, a : a + n], s.lead[1, a : a + n], s.lead[2, a : a + n]
    lbx, lby, lbz = s.lead[0, b : b + n], s.lead[1, b : b + n], s.lead[2, b : b + n]
    w0, w1, w2, w3, w4 = s.pull[0, :n], s.pull[1, :n], s.pull[2, :n], s.pull[3, :n], s.pull[4, :n]
    g0, g1, g2 = s.pull[5, :n], s.pull[6, :n], s.pull[7, :n]
    for k in range(n):
        pair = pair_in(run, k)
        w0[k], w1[k], w2[k], w3[k], w4[k] = stiff_of(bond, pair, reach)
    for k in range(n):  # a loop of its own: only so many arrays are compared before it is vectorised
        ux, uy, uz = lax[k] - lbx[k], lay[k] - lby[k], laz[k] - lbz[k]
        gain = w4[k] * (ux * w0[k] + uy * w1[k] + uz * w2[k])
        g0[k] = w3[k] * ux + gain * w0[k]
        g1[k] = w3[k] * uy + gain * w1[k]
        g2[k] = w3[k] * uz + gain * w2[k]
    for q in range(piece[HOLES], piece[HOLES_END]):
        for row in range(8):
            s.pull[row, bond.holes[q] - first] = 0
    if piece[OWNS_FIRST]:
        for row in range(4):
            out, found = spring[row, first:last], s.pull[row, :n]
            for k in range(n):
                out[k] = found[k]
        _add_blocks(s.pull, s.block, s.anchor, s.free, s.residual, a, b, n, type_of(reach, -1))
    if piece[OWNS_SECOND]:
        _add_blocks(s.pull, s.block, s.anchor, s.free, s.residual, b, a, n, type_of(reach, 1))


@shared
def _add_blocks(
    pull: Any,
    block: Any,
    anchor: Any,
    free: Any,
    residual: Any,
    at: Any,
    other: Any,
    n: Any,
    sign: Any,
) -> None:
    """Add the springs in `pull` to particles at … at + n − 1: q 1 + w wᵀ to the blocks, the gains to the residuals.

    Their other ends are other … other + n − 1; those that are held anchor the particles.
    """
    wx, wy, wz, q = pull[0, :n], pull[1, :n], pull[2, :n], pull[3, :n]
    xx, yy, zz = block[0, at : at + n], block[1, at : at + n], block[2, at : at + n]
    xy, xz, yz = block[3, at : at + n], block[4, at : at + n], block[5, at : at + n]
    for k in range(n):
        xx[k] += q[k] + wx[k] * wx[k]
        yy[k] += q[k] + wy[k] * wy[k]
        zz[k] += q[k] + wz[k] * wz[k]
        xy[k] += wx[k] * wy[k]
        xz[k] += wx[k] * wz[k]
        yz[k] += wy[k] * wz[k]
    own, partner = free[at : at + n], free[other : other + n]
    for k in range(n):
        if not partner[k] > 0:
            anchor[0, at + k] += q[k] + wx[k] * wx[k]
            anchor[1, at + k] += q[k] + wy[k] * wy[k]
            anchor[2, at + k] += q[k] + wz[k] * wz[k]
            anchor[3, at + k] += wx[k] * wy[k]
            anchor[4, at + k] += wx[k] * wz[k]
            anchor[5, at + k] += wy[k] * wz[k]
    for axis in range(3):
        out, gain = residual[axis, at : at + n], pull[5 + axis, :n]
        for k in range(n):
            out[k] += own[k] * (sign * gain[k])


@outlined
def multiply(bonds: Any, springs: Any, s: Any, x: Any, y: Any, plain: Any, share: Any) -> None:
    """y = (D + G + B) x on the particles of a share; `plain` says that G is zero. All of x must be in place."""
    _times_own(s.inertia, s.own, x, y, plain, share.first, share.last)
    for chunk in range(chunks_of(bonds)):
        _times_chunk(bonds, springs, s.pull, x, y, chunk)
    multiply_elements(share.elements, s.forms, x, y, share)


@shared
def _times_own(inertia: Any, own: Any, x: Any, y: Any, plain: Any, lo: Any, hi: Any) -> None:
    """y = (D + G) x on particles [lo, hi)."""
    d = inertia[lo:hi]
    ax, ay, az = x[0, lo:hi], x[1, lo:hi], x[2, lo:hi]
    bx, by, bz = y[0, lo:hi], y[1, lo:hi], y[2, lo:hi]
    if plain:
        for i in range(d.size):
            bx[i] = d[i] * ax[i]
            by[i] = d[i] * ay[i]
            bz[i] = d[i] * az[i]
    else:
        for row, out in enumerate((bx, by, bz)):
            gx, gy, gz = own[3 * row, lo:hi], own[3 * row + 1, lo:hi], own[3 * row + 2, lo:hi]
            same = x[row, lo:hi]
            for i in range(d.size):
                out[i] = d[i] * same[i] + gx[i] * ax[i] + gy[i] * ay[i] + gz[i] * az[i]


def _times_chunk(bonds: Any, springs: Any, pull: Any, x: Any, y: Any, chunk: Any) -> None:
    for bond, spring in zip(bonds, springs, strict=True):
        for piece in range(bond.begin[chunk], bond.begin[chunk + 1]):
            _times_piece(bond.table[piece], spring, pull, x, y)


@shared
def _times_piece(piece: Any, spring: Any, pull: Any, x: Any, y: Any) -> None:
    a, b, n = piece[FIRST], piece[SECOND], piece[LENGTH]
    first, last = piece[OFFSET], piece[OFFSET] + n
    xa, ya, za = x[0, a : a + n], x[1, a : a + n], x[2, a : a + n]
    xb, yb, zb = x[0, b : b + n], x[1, b : b + n], x[2, b : b + n]
    wx, wy, wz, q = (
        spring[0, first:last],
        spring[1, first:last],
        spring[2, first:last],
        spring[3, first:last],
    )
    px, py, pz = pull[0, :n], pull[1, :n], pull[2, :n]
    for k in range(n):
        dx, dy, dz = xa[k] - xb[k], ya[k] - yb[k], za[k] - zb[k]
        along = wx[k] * dx + wy[k] * dy + wz[k] * dz
        px[k] = q[k] * dx + along * wx[k]
        py[k] = q[k] * dy + along * wy[k]
        pz[k] = q[k] * dz + along * wz[k]
    add_pulls(piece, pull, y)


@shared
def invert(block: Any, inertia: Any, free: Any, lo: Any, hi: Any) -> None:
    """Turn the blocks of particles [lo, hi) into their inverses; 0 where a particle does not move.

    A block that is not positive definite (a force that pushes away) gives way to the inertia.
    """
    for i in range(lo, hi):
        good, inverse = inverse_of(
            block[0, i], block[1, i], block[2, i], block[3, i], block[4, i], block[5, i]
        )
        instead = type_of(free[i], 1) / inertia[i]
        for k, entry in enumerate(inverse):
            otherwise = instead if k < 3 else instead - instead
            block[k, i] = free[i] * (entry if good else otherwise)


@outlined
def of_rounding(s: Any, c: Any, lo: Any, hi: Any, reach: Any) -> float:
    """Σ tr(M) (V² + X²/γ²) over free particles [lo, hi)."""
    total = 0.0
    far = 1 / float(reach)
    for i in range(lo, hi):
        x, y, z = far * float(c.x[i]), far * float(c.y[i]), far * float(c.z[i])
        u, v, w = float(c.vx[i]), float(c.vy[i]), float(c.vz[i])
        trace = float(s.block[0, i]) + float(s.block[1, i]) + float(s.block[2, i])
        total += float(s.free[i]) * trace * (x * x + y * y + z * z + u * u + v * v + w * w)
    return total


def linearise(parts: Any, bonds: Any, c: Any, s: Any, total: Any, share: Any, t: Any, reach: Any) -> Any:
    """The equations at the present state, under the total forces at time t; ready when all threads have met.

    Returns whether G is zero, whether the matrix is symmetric, and Σ tr(M) (V² + X²/γ²): the square of the residual that
    errors of the size of all positions and velocities would leave.
    """
    flags = s.flags[FLAGS * share.number : FLAGS * (share.number + 1)]
    for k in range(FLAGS):
        flags[k] = 0
    for lo in range(share.first, share.last, share.chunk):
        add_own(parts, c, s, total, t, reach, lo, min(lo + share.chunk, share.last), flags)
    add_springs(bonds, s.springs, c, s, reach)
    gather_blocks(s.lattices, s.free, s.anchor, s.block, team_of(share))
    stiffen_elements(share.elements, s.forms, c, s, share, t, reach)
    for lo in range(share.first, share.last, share.chunk):
        hi = min(lo + share.chunk, share.last)
        s.partial[3, lo // share.chunk] = of_rounding(s, c, lo, hi, reach)
    invert(s.block, s.inertia, s.free, share.first, share.last)
    meet(share.gate, share.threads)
    general, coupled = False, False
    for k in range(share.threads):
        general |= s.flags[FLAGS * k + GENERAL] != 0
        coupled |= s.flags[FLAGS * k + COUPLED_AXES] != 0
    rounding = 0.0
    for k in range(s.partial.shape[1]):
        rounding += s.partial[3, k]
    return not coupled, not general, rounding
