"""The linear equations of an implicit step in an island, (D + G + B) δ = r, without a matrix.

D is the inertia of every particle over the reach γ of the step, m/γ, or its drag coefficient where it has no inertia;
G = −∂f/∂v − γ ∂f/∂x are the 3 × 3 Jacobians of forces on single particles. B is the sum over springs (`spring_system`) and
over all other interactions, each by its own `stiffen` and `multiply` (`interactions.interaction`).

Threads own chunks of particles and add to those alone, piece after piece, as they do with forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import outlined, shared
from particlesim.engine.barrier import meet, team_of
from particlesim.engine.implicit.multilevel import Lattices, gather_blocks, inverse_of, new_lattices
from particlesim.engine.implicit.spring_system import add_springs, times_chunk
from particlesim.engine.interactions.bond_layout import chunk_size
from particlesim.engine.interactions.bonds import Bonds, chunks_of
from particlesim.engine.interactions.interaction import multiply_elements, stiffen_elements
from particlesim.engine.state.columns import fetch, type_of
from particlesim.engine.step.particle_step import Newtonian
from particlesim.laws.registry import (
    force_dv,
    force_dx,
    times,
    velocity,
    velocity_dx,
)

GENERAL, COUPLED_AXES, SOME_HELD = 0, 1, 2
"""Flags of a system, for every thread: some G is not symmetric; some G is not zero; colliders have held some back."""
FREE, CAUGHT, HELD, RESTS, SLIDES = 0, 1, 2, 3, 4
"""What colliders do to a particle in a step: nothing; they have just met it; they have it where it is; friction does; it
slides along one."""
NORMAL, RUNS, STATIC, KINETIC, ALONG, RUBS, LEFT, BEFORE = 0, 3, 6, 7, 8, 11, 12, 15
"""Rows of the walls that hold particles back: the unit normal and the velocity of the surface [m/s]; coefficients of
friction; the direction in which particles slide, and the force of friction against it [N]; the residual [N]; and
what forces gave in the step before [m/s]."""
LANES = 64
"""Partial sums that run in parallel, as vectors; chunks of particles are multiples of it, except for the last."""
FLAGS = 8
"""Flags per thread: those of two threads are on different cache lines."""


class System(NamedTuple):
    """Arrays of an island's equations; n particles, vectors of shape [3, n].

    `inertia` D and `free` (1, or 0 for particles that do not move) [n]; `own` G row by row [9, n]; `block`: the 3 × 3 blocks
    on the diagonal, then their inverses, as xx, yy, zz, xy, xz, yz [6, n]; `anchor`: their part without springs to free
    particles; `base`: X₀ and V₀ of the step [6, n]; `lead`: the velocity with which a single linear solve expects positions
    to move; `held`: what colliders do to each in the step [n], `wall`: that which does [18, n], `ended`: the motion of all
    at its end [6, n], and `missed`: how many colliders they had passed unseen before [n] (`contacts`); `residual` r,
    `solution` δ, and work of the solver; `springs`: w and q of every slot [4, slots], for every set; `forms`: what the other
    interactions of a thread keep of their linearisation; `pull`: scratch of a thread [8, chunk], and `lanes` for its sums;
    `partial`: sums of chunks [5, chunks]; `flags`; `report`: how the last step ended, its relative residual, its Newton and
    linear iterations, and how small the residual of the first solution had to be (`solution.GOAL`).
    """

    inertia: Any
    free: Any
    own: Any
    block: Any
    anchor: Any
    base: Any
    lead: Any
    held: Any
    wall: Any
    ended: Any
    missed: Any
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
        held=np.zeros(count, np.int8),
        wall=rows(18),
        missed=np.zeros(count, np.int64),
        ended=rows(6),
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
        partial=np.zeros((5, -(-count // chunk))),
        flags=np.zeros(FLAGS * -(-count // chunk), np.int64),
        report=np.zeros(6),
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


def add_own(
    parts: Any, c: Any, s: Any, total: Any, t: Any, reach: Any, mass: Any, lo: Any, hi: Any, flags: Any
) -> None:
    """D, G and the residual of particles [lo, hi) from the forces on single particles.

    `total` are all forces, `reach` is γ, and `mass` what inertia counts for; the residual is f − D (V − V₀), and what the
    forces gain from the lead.
    """
    for part in parts:
        first, last = max(lo, part.first), min(hi, part.last)
        _add_own(part.dynamics, part.forces, c, s, total, t, reach, mass, first, last, flags)


def _add_own(
    dynamics: Any,
    forces: Any,
    c: Any,
    s: Any,
    total: Any,
    t: Any,
    reach: Any,
    mass: Any,
    first: Any,
    last: Any,
    flags: Any,
) -> None:
    for i in range(first, last):
        p = fetch(c, i, t)
        inertia, g, (rx, ry, rz) = equation(
            dynamics, forces, p, s.base[3:6, i], reach, type_of(reach, mass), s.lead[:, i]
        )
        general, coupled = write_own(s, i, type_of(reach, inertia), g)
        free = s.free[i] > 0
        flags[GENERAL] |= general & free
        flags[COUPLED_AXES] |= coupled & free
        s.residual[0, i] = total[0, i] + rx
        s.residual[1, i] = total[1, i] + ry
        s.residual[2, i] = total[2, i] + rz


def equation(dynamics: Any, forces: Any, p: Any, start: Any, reach: Any, mass: Any, lead: Any) -> Any:
    """D, G, and the residual without the force, of one particle that would move with the velocity that it has; tracers are
    never coupled."""
    if isinstance(dynamics, Newtonian):
        dx, dv = force_dx(forces, p), force_dv(forces, p)
        inertia = mass * p.m / reach
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


@outlined
def keep_along(s: Any, y: Any, lo: Any, hi: Any) -> None:
    """Leave of vectors at particles [lo, hi) that slide what lies in the surface of their collider."""
    held, wall = s.held, s.wall
    for i in range(lo, hi):
        if held[i] == SLIDES:
            up = wall[0, i] * y[0, i] + wall[1, i] * y[1, i] + wall[2, i] * y[2, i]
            y[0, i] -= up * wall[0, i]
            y[1, i] -= up * wall[1, i]
            y[2, i] -= up * wall[2, i]


@outlined
def take_up(s: Any, lo: Any, hi: Any) -> None:
    """Leave of the residuals of particles [lo, hi) what can move them; of those that colliders have, keep it whole."""
    for i in range(lo, hi):
        if s.held[i] >= RESTS:
            for k in range(3):
                s.wall[LEFT + k, i] = s.residual[k, i]
                if s.held[i] == SLIDES:
                    s.residual[k, i] -= s.wall[RUBS, i] * s.wall[ALONG + k, i]
        if not s.free[i] > 0:
            s.residual[0, i] = s.residual[1, i] = s.residual[2, i] = 0
    keep_along(s, s.residual, lo, hi)


@outlined
def multiply(bonds: Any, springs: Any, s: Any, x: Any, y: Any, plain: Any, share: Any) -> None:
    """y = (D + G + B) x on the particles of a share; `plain` says that G is zero. All of x must be in place."""
    _times_own(s.inertia, s.own, x, y, plain, share.first, share.last)
    for chunk in range(chunks_of(bonds)):
        times_chunk(bonds, springs, s.pull, x, y, chunk)
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


def linearise(
    parts: Any, bonds: Any, c: Any, s: Any, total: Any, share: Any, t: Any, reach: Any, mass: Any
) -> Any:
    """The equations at the present state, under the total forces at time t; ready when all threads have met.

    Returns whether G is zero, whether the matrix is symmetric, and Σ tr(M) (V² + X²/γ²): the square of the residual that
    errors of the size of all positions and velocities would leave.
    """
    flags = s.flags[FLAGS * share.number : FLAGS * (share.number + 1)]
    for k in range(FLAGS):
        flags[k] = 0
    for lo in range(share.first, share.last, share.chunk):
        add_own(parts, c, s, total, t, reach, mass, lo, min(lo + share.chunk, share.last), flags)
    add_springs(bonds, s.springs, c, s, reach)
    gather_blocks(s.lattices, s.free, s.anchor, s.block, team_of(share))
    stiffen_elements(share.elements, s.forms, c, s, share, t, reach)
    take_up(s, share.first, share.last)
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


def told_all(some: Any, s: Any, share: Any) -> bool:
    """Whether it is so in some share."""
    s.flags[FLAGS * share.number + SOME_HELD] = 1 if some else 0
    meet(share.gate, share.threads)
    found = False
    for k in range(share.threads):
        found = found | (s.flags[FLAGS * k + SOME_HELD] != 0)
    meet(share.gate, share.threads)
    return bool(found)
