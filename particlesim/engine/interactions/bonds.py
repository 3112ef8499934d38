"""Bonds in kernels: their forces, added up in a fixed order, and their breaking."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bonds.spring import Pair
from particlesim.compiler import outlined
from particlesim.compiler.barrier import meet
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
from particlesim.engine.state.columns import cut
from particlesim.laws.registry import bond_force

SHORT = 12
"""Springs of a piece below which they are taken one by one: setting up vectors costs more."""


class Breaking(NamedTuple):
    """When bonds break: strain, pull [N] (infinite: never), and when each broke [s], infinity while it holds."""

    strain: float
    pull: float
    when: Any


class Bonds(NamedTuple):
    """Bonds of one law: its record, both ends of each bond, and stiffness [N/m], damping [kg/s] and rest length [m], each
    a number for all or an array, in the slots of `bond_layout`; `holes` are slots without a bond, with ends −1.
    `breaking` is None for bonds that hold.

    `table` lists the pieces of `bond_layout` that a thread works on, and `begin` where those of each chunk
    begin.
    """

    law: tuple[Any, ...]
    i: Any
    j: Any
    k: Any
    c: Any
    rest: Any
    holes: Any
    table: Any
    begin: Any
    breaking: Any


def pair_of(bond: Any, c: Any, k: Any) -> Any:
    """Bond k as laws see it."""
    i, j = bond.i[k], bond.j[k]
    return Pair(
        c.x[i] - c.x[j],
        c.y[i] - c.y[j],
        c.z[i] - c.z[j],
        c.vx[i] - c.vx[j],
        c.vy[i] - c.vy[j],
        c.vz[i] - c.vz[j],
        of_bond(bond.k, k),
        of_bond(bond.c, k),
        of_bond(bond.rest, k),
    )


def of_bond(column: Any, k: Any) -> Any:
    """What belongs to bond k: an element of an array, or the number that all share."""
    return column[k] if isinstance(column, np.ndarray) else column


def chunks_of(bonds: Any) -> Any:
    """Chunks of particles that pieces of bonds are sorted by; none without bonds."""
    return bonds[0].begin.size - 1 if len(bonds) > 0 else 0


def add_bonds(bonds: Any, c: Any, total: Any, pull: Any, chunk: Any) -> None:
    """Add the forces of the bonds of a chunk to `total`; the sets take turns, so that they share what is in the cache."""
    for bond in bonds:
        for piece in range(bond.begin[chunk], bond.begin[chunk + 1]):
            if bond.table[piece, LENGTH] < SHORT:
                _add_one_by_one(bond, c, total, bond.table[piece])
            else:
                _add_run(bond, c, total, pull, bond.table[piece])


@outlined
def _add_one_by_one(bond: Any, c: Any, total: Any, piece: Any) -> None:
    for k in range(piece[OFFSET], piece[OFFSET] + piece[LENGTH]):
        i, j = bond.i[k], bond.j[k]
        if i < 0:
            continue
        fx, fy, fz = bond_force(bond.law, pair_of(bond, c, k))
        if piece[OWNS_FIRST]:
            total[0, i] += fx
            total[1, i] += fy
            total[2, i] += fz
        if piece[OWNS_SECOND]:
            total[0, j] -= fx
            total[1, j] -= fy
            total[2, j] -= fz


@outlined
def _add_run(bond: Any, c: Any, total: Any, pull: Any, piece: Any) -> None:
    # Slices come first: an index such as x[a + k] might be negative, and the check for that stops vectorisation.
    # Forces go to scratch before they are added, because both ends may be among the same particles.
    a, b, n = piece[FIRST], piece[SECOND], piece[LENGTH]
    first, last = piece[OFFSET], piece[OFFSET] + n
    xa, ya, za = c.x[a : a + n], c.y[a : a + n], c.z[a : a + n]
    xb, yb, zb = c.x[b : b + n], c.y[b : b + n], c.z[b : b + n]
    ua, va, wa = c.vx[a : a + n], c.vy[a : a + n], c.vz[a : a + n]
    ub, vb, wb = c.vx[b : b + n], c.vy[b : b + n], c.vz[b : b + n]
    ks, cs, rests = cut(bond.k, first, last), cut(bond.c, first, last), cut(bond.rest, first, last)
    px, py, pz = pull[0, :n], pull[1, :n], pull[2, :n]
    for k in range(n):
        pair = Pair(
            xa[k] - xb[k],
            ya[k] - yb[k],
            za[k] - zb[k],
            ua[k] - ub[k],
            va[k] - vb[k],
            wa[k] - wb[k],
            of_bond(ks, k),
            of_bond(cs, k),
            of_bond(rests, k),
        )
        fx, fy, fz = bond_force(bond.law, pair)
        px[k] = fx
        py[k] = fy
        pz[k] = fz
    for q in range(piece[HOLES], piece[HOLES_END]):
        hole = bond.holes[q] - first
        px[hole] = py[hole] = pz[hole] = 0
    if piece[OWNS_FIRST]:
        gx, gy, gz = total[0, a : a + n], total[1, a : a + n], total[2, a : a + n]
        for k in range(n):
            gx[k] += px[k]
            gy[k] += py[k]
            gz[k] += pz[k]
    if piece[OWNS_SECOND]:
        gx, gy, gz = total[0, b : b + n], total[1, b : b + n], total[2, b : b + n]
        for k in range(n):
            gx[k] -= px[k]
            gy[k] -= py[k]
            gz[k] -= pz[k]


def break_bonds(bonds: Any, c: Any, share: Any, t: Any) -> None:
    """Take out bonds that are stretched or pulled too far at time t: they lose their stiffness and damping.

    The owner of the first end does; all threads go on when all are done.
    """
    for bond in bonds:
        if bond.breaking is not None:
            for piece in range(len(bond.table)):
                if bond.table[piece, OWNS_FIRST]:
                    _break_piece(bond, c, bond.table[piece], t)
            meet(share.gate, share.threads)


@outlined
def _break_piece(bond: Any, c: Any, piece: Any, t: Any) -> None:
    limits = bond.breaking
    for k in range(piece[OFFSET], piece[OFFSET] + piece[LENGTH]):
        if bond.i[k] >= 0 and limits.when[k] == np.inf:
            p = pair_of(bond, c, k)
            length = np.sqrt(p.x * p.x + p.y * p.y + p.z * p.z)
            fx, fy, fz = bond_force(bond.law, p)
            pull = -(fx * p.x + fy * p.y + fz * p.z)
            if length - p.rest > limits.strain * p.rest or pull > limits.pull * length:
                limits.when[k] = t
                bond.k[k] = 0
                bond.c[k] = 0
