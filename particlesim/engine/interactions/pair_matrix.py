"""Interactions of pairs in the matrix of implicit methods.

A pair adds B = a 1 + b l lᵀ on the difference of its ends, the positive part of γ times its stiffness −∂f/∂l, and of its
damping −∂f/∂v. Of a central law, f = k l, the stiffness is −k across the pair and −(k + q l²) along it; of other laws the
components along and across the pair are taken. Negative stiffness (across a compressed pair, along an attraction that
decreases with distance) is left out: the matrix is positive (semi-)definite, and a converged step solves the method's
equations all the same.

The matrix is not kept: every product computes B from the particles as they were when it was made.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import lanes, on_stack, outlined
from particlesim.engine.interactions.pair_blocks import (
    CHARGE,
    apart,
    chosen,
    gathered,
    pair_in,
    particle_of,
    reaches,
)
from particlesim.engine.state.columns import Columns, load, presence, type_of
from particlesim.laws.pair import central, is_central, pair_force_dv, pair_force_dx, square

WIDTH = 8
"""Particles whose terms are summed at once: a vector of AVX-512."""
ROWS = 12
"""Rows of what direct pairs keep: place, velocity, mass, radius, charge, whether it is there; and in the first two places of
the others γ [s] and the time [s]."""


class Push(NamedTuple):
    """A vector of every particle, x [3, n], that the matrix is multiplied by, and γ [s]."""

    x: Any
    reach: Any


def stiffness_of(each: Any, p: Any, reach: Any) -> Any:
    """a, b of a pair, and of them what is stiffness alone; zeros if they do not act on each other."""
    s = square(p)
    near = reaches(each, s)
    zero, one = type_of(s, 0), type_of(s, 1)
    there = s if s > 0 else one
    if is_central(each.law):
        _, k, q = central(each.law, apart(near, p), s if near is True else (s if near else one))
        along, across = reach * max(-(k + q * s), zero), reach * max(-k, zero)
        a, b = chosen(near, across), chosen(near, (along - across) / there)
        return a, b, a, b
    found = []
    for generic, weight in ((pair_force_dx, reach), (pair_force_dv, one)):
        j = generic(each.law, apart(near, p))
        dx = j[0] * p.x + j[1] * p.y + j[2] * p.z
        dy = j[3] * p.x + j[4] * p.y + j[5] * p.z
        dz = j[6] * p.x + j[7] * p.y + j[8] * p.z
        along = -(p.x * dx + p.y * dy + p.z * dz) / there
        across = (-(j[0] + j[4] + j[8]) - along) * type_of(s, 0.5)
        along, across = weight * max(along, zero), weight * max(across, zero)
        found += [chosen(near, across), chosen(near, (along - across) / there)]
    return found[0] + found[2], found[1] + found[3], found[0], found[1]


def product_terms(each: Any, p: Any, counts: Any, u: Any, reach: Any) -> Any:
    """B u of a pair."""
    a, b, _, _ = stiffness_of(each, p, reach)
    along = b * (p.x * u[0] + p.y * u[1] + p.z * u[2])
    return (
        chosen(counts, a * u[0] + along * p.x),
        chosen(counts, a * u[1] + along * p.y),
        chosen(counts, a * u[2] + along * p.z),
    )


def block_terms(each: Any, p: Any, counts: Any, u: Any, reach: Any) -> Any:
    """B of a pair as xx, yy, zz, xy, xz, yz, and what its stiffness makes of u."""
    a, b, c, d = stiffness_of(each, p, reach)
    along = d * (p.x * u[0] + p.y * u[1] + p.z * u[2])
    terms = (
        a + b * p.x * p.x,
        a + b * p.y * p.y,
        a + b * p.z * p.z,
        b * p.x * p.y,
        b * p.x * p.z,
        b * p.y * p.z,
        c * u[0] + along * p.x,
        c * u[1] + along * p.y,
        c * u[2] + along * p.z,
    )
    return tuple([chosen(counts, term) for term in terms])


def add_terms(s: Any, i: Any, terms: Any) -> None:
    """Add the block of particle i, and take what its forces lose by the lead from its residual."""
    for k in range(6):
        s.block[k, i] += terms[k]
    for k in range(3):
        s.residual[k, i] -= terms[6 + k]


# Direct sums


def keep(form: Any, c: Any, count: Any, t: Any, reach: Any) -> None:
    """Copy what laws read of all particles into `form` [ROWS, n]."""
    charge = c.further[CHARGE] if len(c.further) > 0 else None
    for i in range(count):
        x = c.x[i]
        row = (x, c.y[i], c.z[i], c.vx[i], c.vy[i], c.vz[i], c.m[i], load(c.r, i, x), load(charge, i, x))
        for k, number in enumerate(row):
            form[k, i] = number
        form[9, i] = type_of(x, 1.0 if presence(c.clock, i) > 0 else 0.0)
    form[10, 0], form[11, 0] = reach, type_of(c.x[0], t)


def kept(form: Any) -> Any:
    """Columns of the particles in `form`."""
    further = (*[None for _ in range(CHARGE)], form[8])
    return Columns(
        form[0], form[1], form[2], form[3], form[4], form[5], form[6], form[7], None, None, (), further
    )


@outlined
def sum_few(
    each: Any, form: Any, x: Any, terms: Any, lo: Any, hi: Any, begin: Any, end: Any, sums: Any
) -> None:
    """Terms of particles [lo, hi), at most WIDTH, with sources [begin, end), into sums [terms, WIDTH]."""
    c, reach, t = kept(form), form[10, 0], form[11, 0]
    block, mine = gathered(each, c, lo, lo, hi, WIDTH), on_stack(3, WIDTH, form.dtype)
    own = on_stack(sums.shape[0], WIDTH, form.dtype)
    for i in range(WIDTH):
        row = min(lo + i, hi - 1)
        for axis in range(3):
            mine[axis, i] = x[axis, row]
    for k in range(own.shape[0]):
        for i in lanes(WIDTH):
            own[k, i] = 0
    for j in range(begin, end):
        if form[9, j] > 0:
            other = particle_of(each, c, j)
            ux, uy, uz = x[0, j], x[1, j], x[2, j]
            for i in lanes(WIDTH):
                u = (mine[0, i] - ux, mine[1, i] - uy, mine[2, i] - uz)
                p = pair_in(block, i, other, t, False, each.box)
                for k, term in enumerate(terms(each, p, lo + i != j, u, reach)):
                    own[k, i] += term
    for k in range(own.shape[0]):
        for i in lanes(WIDTH):
            sums[k, i] = own[k, i]


def stiffen_direct(each: Any, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
    """`stiffen` of direct pairs."""
    keep(form, c, form.shape[1], t, reach)
    sums = on_stack(9, WIDTH, form.dtype)
    for k in range(len(each.spans)):
        lo, hi = max(first, each.spans[k, 0]), min(last, each.spans[k, 1])
        for start in range(lo, hi, WIDTH):
            end = min(start + WIDTH, hi)
            sum_few(each, form, s.lead, block_terms, start, end, each.spans[k, 2], each.spans[k, 3], sums)
            for i in range(start, end):
                add_terms(s, i, sums[:, i - start])


def multiply_direct(each: Any, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
    """`multiply` of direct pairs."""
    sums = on_stack(3, WIDTH, form.dtype)
    for k in range(len(each.spans)):
        lo, hi = max(first, each.spans[k, 0]), min(last, each.spans[k, 1])
        for start in range(lo, hi, WIDTH):
            end = min(start + WIDTH, hi)
            sum_few(each, form, x, product_terms, start, end, each.spans[k, 2], each.spans[k, 3], sums)
            for i in range(start, end):
                for axis in range(3):
                    y[axis, i] += sums[axis, i - start]


def new_direct_form(each: Any, dtype: Any) -> Any:
    """The data that direct pairs keep for products with their matrix."""
    return np.zeros((ROWS, int(each.spans[:, [1, 3]].max(initial=1))), dtype)
