"""Springs in the linear equations of an implicit step: every spring adds to B

    (c + γ k) e eᵀ + γ max(T/l, 0) (1 − e eᵀ) = q 1 + w wᵀ

on the difference of its ends, with e its direction, l its length and T its tension. Compressed springs would push sideways;
that part is dropped, so that B is positive (semi-)definite. A spring is the four numbers w and q.
Source: D. Baraff, A. Witkin, SIGGRAPH 1998; K.-J. Choi, H.-S. Ko, SIGGRAPH 2002.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.interactions.bond_layout import (
    FIRST,
    HOLES,
    HOLES_END,
    LENGTH,
    OFFSET,
    OWNS_FIRST,
    OWNS_SECOND,
    SECOND,
)
from particlesim.engine.interactions.bonds import add_pulls, chunks_of, pair_in, run_of
from particlesim.engine.state.columns import type_of
from particlesim.laws.registry import bond_force_dv, bond_force_dx, times


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
    partner = free[other : other + n]
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
            out[k] += sign * gain[k]


def times_chunk(bonds: Any, springs: Any, pull: Any, x: Any, y: Any, chunk: Any) -> None:
    """Add B x of the springs of a chunk to y."""
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
