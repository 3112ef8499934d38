"""Rods in kernels: lengths held after every drift (SHAKE), velocities along them taken away (RATTLE).

A drift of length h from positions that fit, d = x₁ − x₂, leads to others that do not. They are put right by

    x ← x + M⁻¹ Jᵀ λ,   v ← v + M⁻¹ Jᵀ λ / h,   with the rows d of J before the drift, so that ½ |x₁ − x₂|² = ½ L²

for all connected rods: Newton's method with N = J' M⁻¹ Jᵀ, where J' has the rows where the particles are. At the end of the
step v ← v + M⁻¹ Jᵀ μ with J v = 0 there. A kick before a drift needs no projection of its own: what it adds along the rods
becomes part of λ, and so does the μ of the drift before, as both are at the positions where the drift starts. Kicks and
drifts are symplectic this way, reversible where the method is, and of second order in the drift.

N couples rods that share a free particle. Its elimination follows an order and a pattern that are worked out at the start
(`engine.constraints.elimination`): for chains and trees without fill. Rods that close loops may depend on each other:
those whose pivot vanishes get no force of their own, and must fit because the others do.

Sources: J.-P. Ryckaert, G. Ciccotti, H. J. C. Berendsen, J. Comput. Phys. 23, 327 (1977); H. C. Andersen, ibid. 52, 24
(1983); B. J. Leimkuhler, R. D. Skeel, ibid. 112, 117 (1994); E. Hairer, C. Lubich, G. Wanner, Geometric Numerical
Integration, VII.1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import kernel, outlined

TIGHT = 1e-14
"""Part of its length by which a rod may be too long or too short."""
ROUNDING = 4 * float(np.finfo(float).eps)
"""Rounding of a coordinate that shows in a length, as a part of the coordinate."""
LIMIT = 50
"""Newton iterations; two or three are usual."""
DEPENDENT = 1e-11
"""Part of itself to which a pivot shrinks where a rod depends on others."""
FORGIVEN = 1e-5
"""Weight of the misfit of such a rod: it is right up to the conditioning of the others."""


class Rig(NamedTuple):
    """Rods by connected components; within one, rods are in the order of their elimination.

    Slots are the particles of a component: their rows in the island and 1/m (0 for those that are held). Rods have the
    slots of both ends, the square of their length [m²], and the entries of their row beyond the diagonal, `pointer`, at the
    rods `later`; `target` are the entries that an elimination changes, pair by pair, from `turn` on. Links are pairs of
    rods that share a free particle: `one` before `other`, their entry, and ±1/m of the particle, positive when both begin
    or both end there. `rods`, `slots` and `links` are the borders of components, `shortest` [m] and `looped` (whether rods
    may depend on each other) belong to each.
    """

    rows: Any
    inverse: Any
    first: Any
    second: Any
    square: Any
    pointer: Any
    later: Any
    target: Any
    turn: Any
    one: Any
    other: Any
    entry: Any
    weight: Any
    rods: Any
    slots: Any
    links: Any
    shortest: Any
    looped: Any


class Bench(NamedTuple):
    """Scratch of components: positions [3, slots]; x₁ − x₂ before the drift (`arm`) and now (`reach`), [3, rods]; how fast
    held ends move along their rods, times the length (`lead`); λ; right-hand side; inverse pivots, the pivots below which
    rods depend on others, and which do not; the entries below and above the diagonal."""

    x: Any
    arm: Any
    reach: Any
    lead: Any
    force: Any
    side: Any
    pivot: Any
    floor: Any
    kept: Any
    low: Any
    up: Any


class Rods(NamedTuple):
    """What a thread holds: components [first, last). `eager`: forces depend on velocities, which must be right at every
    evaluation; `touched`: there are colliders.

    For every component the energy that rods gave to led ends [J], the rod that could not be held (−1: none), and its misfit
    as a part of its length.
    """

    rig: Rig
    bench: Bench
    first: int
    last: int
    eager: bool
    touched: bool
    effort: Any
    failed: Any
    misfit: Any
    blows: Any


class Places(NamedTuple):
    """Where particles are and how fast: the columns that rods read and write."""

    x: Any
    y: Any
    z: Any
    vx: Any
    vy: Any
    vz: Any


def places(c: Any) -> Places:
    """The places of an island's columns."""
    return Places(c.x, c.y, c.z, c.vx, c.vy, c.vz)


def load(rig: Any, bench: Any, c: Any, k: Any) -> float:
    """Positions of a component; returns the largest coordinate."""
    x, y, z = bench.x[0], bench.x[1], bench.x[2]
    size = 0.0
    for s in range(rig.slots[k], rig.slots[k + 1]):
        row = rig.rows[s]
        x[s], y[s], z[s] = c.x[row], c.y[row], c.z[row]
        size = max(size, abs(x[s]), abs(y[s]), abs(z[s]))
    return size


def aim(rig: Any, bench: Any, c: Any, k: Any) -> None:
    """Take the present positions of a component, which are loaded, for those before the next drift."""
    x, y, z = bench.x[0], bench.x[1], bench.x[2]
    ax, ay, az = bench.arm[0], bench.arm[1], bench.arm[2]
    for e in range(rig.rods[k], rig.rods[k + 1]):
        i, j = rig.first[e], rig.second[e]
        ax[e], ay[e], az[e] = x[i] - x[j], y[i] - y[j], z[i] - z[j]
        lead = 0.0
        if rig.inverse[i] == 0:
            a = rig.rows[i]
            lead += ax[e] * c.vx[a] + ay[e] * c.vy[a] + az[e] * c.vz[a]
        if rig.inverse[j] == 0:
            b = rig.rows[j]
            lead -= ax[e] * c.vx[b] + ay[e] * c.vy[b] + az[e] * c.vz[b]
        bench.lead[e] = lead


def measure(rig: Any, bench: Any, k: Any) -> tuple[float, int]:
    """Set `reach` and the right-hand side ½ (L² − |x₁ − x₂|²); returns the largest misfit of a rod as a part of its length,
    and which."""
    x, y, z = bench.x[0], bench.x[1], bench.x[2]
    rx, ry, rz = bench.reach[0], bench.reach[1], bench.reach[2]
    worst, at = 0.0, rig.rods[k]
    for e in range(rig.rods[k], rig.rods[k + 1]):
        i, j = rig.first[e], rig.second[e]
        rx[e], ry[e], rz[e] = x[i] - x[j], y[i] - y[j], z[i] - z[j]
        bench.side[e] = 0.5 * (rig.square[e] - (rx[e] * rx[e] + ry[e] * ry[e] + rz[e] * rz[e]))
        miss = abs(bench.side[e]) / rig.square[e]
        if not bench.kept[e]:
            miss *= FORGIVEN
        if not miss <= worst:
            worst, at = miss, e
        if miss != miss:
            break
    return worst, at


def assemble(rig: Any, bench: Any, a: Any, b: Any, k: Any) -> None:
    """The matrix A M⁻¹ Bᵀ of a component, with rows a and b [3, rods]."""
    low, up = bench.low, bench.up
    ax, ay, az = a[0], a[1], a[2]
    bx, by, bz = b[0], b[1], b[2]
    begin, end = rig.rods[k], rig.rods[k + 1]
    for p in range(rig.pointer[begin], rig.pointer[end]):
        low[p] = 0
        up[p] = 0
    for e in range(begin, end):
        mobility = rig.inverse[rig.first[e]] + rig.inverse[rig.second[e]]
        bench.pivot[e] = mobility * (ax[e] * bx[e] + ay[e] * by[e] + az[e] * bz[e])
        bench.floor[e] = DEPENDENT * bench.pivot[e]
    for n in range(rig.links[k], rig.links[k + 1]):
        e, f, p, w = rig.one[n], rig.other[n], rig.entry[n], rig.weight[n]
        up[p] += w * (ax[e] * bx[f] + ay[e] * by[f] + az[e] * bz[f])
        low[p] += w * (ax[f] * bx[e] + ay[f] * by[e] + az[f] * bz[e])


def eliminate(rig: Any, bench: Any, k: Any, judge: bool, alone: Any = 0.0) -> None:
    """Factors of the matrix of a component in its place; rods that are not kept are left out, or have the pivot
    `floor/alone` where that is given.

    With `judge`, those are not kept that depend on others. The matrix must be symmetric: its pivots are then positive, or
    vanish.
    """
    low, up, pivot = bench.low, bench.up, bench.pivot
    for e in range(rig.rods[k], rig.rods[k + 1]):
        if judge:
            bench.kept[e] = pivot[e] > bench.floor[e]
        inverse = 1 / pivot[e] if bench.kept[e] else (alone / bench.floor[e] if alone > 0 else 0.0)
        pivot[e] = inverse
        n, after = rig.turn[e], rig.pointer[e + 1]
        for p in range(rig.pointer[e], after):
            left, above = low[p] * inverse, up[p] * inverse
            pivot[rig.later[p]] -= left * up[p]
            for q in range(p + 1, after):
                t = rig.target[n]
                up[t] -= left * up[q]
                low[t] -= low[q] * above
                n += 1


def solve(rig: Any, bench: Any, k: Any) -> None:
    """Replace the right-hand side of a component by the solution."""
    side, low, up, begin, end = bench.side, bench.low, bench.up, rig.rods[k], rig.rods[k + 1]
    for e in range(begin, end):
        y = side[e] * bench.pivot[e]
        for p in range(rig.pointer[e], rig.pointer[e + 1]):
            side[rig.later[p]] -= low[p] * y
    for e in range(end - 1, begin - 1, -1):
        y = side[e]
        for p in range(rig.pointer[e], rig.pointer[e + 1]):
            y -= up[p] * side[rig.later[p]]
        side[e] = y * bench.pivot[e]


def move(rig: Any, bench: Any, k: Any) -> None:
    """λ += what has been solved for, x += M⁻¹ Jᵀ of it, with J before the drift."""
    x, y, z = bench.x[0], bench.x[1], bench.x[2]
    ax, ay, az = bench.arm[0], bench.arm[1], bench.arm[2]
    for e in range(rig.rods[k], rig.rods[k + 1]):
        i, j, change = rig.first[e], rig.second[e], bench.side[e]
        bench.force[e] += change
        wi, wj = rig.inverse[i] * change, rig.inverse[j] * change
        x[i], y[i], z[i] = x[i] + wi * ax[e], y[i] + wi * ay[e], z[i] + wi * az[e]
        x[j], y[j], z[j] = x[j] - wj * ax[e], y[j] - wj * ay[e], z[j] - wj * az[e]


def push(rig: Any, bench: Any, c: Any, force: Any, scale: Any, k: Any) -> float:
    """v += scale · M⁻¹ Jᵀ λ on the particles of a component, with J before the drift; returns the work on held ends [J]."""
    ax, ay, az = bench.arm[0], bench.arm[1], bench.arm[2]
    effort = 0.0
    for e in range(rig.rods[k], rig.rods[k + 1]):
        i, j, size = rig.first[e], rig.second[e], scale * force[e]
        effort += size * bench.lead[e]
        a, b = rig.rows[i], rig.rows[j]
        if rig.inverse[i] > 0:
            w = rig.inverse[i] * size
            c.vx[a], c.vy[a], c.vz[a] = c.vx[a] + w * ax[e], c.vy[a] + w * ay[e], c.vz[a] + w * az[e]
        if rig.inverse[j] > 0:
            w = rig.inverse[j] * size
            c.vx[b], c.vy[b], c.vz[b] = c.vx[b] - w * ax[e], c.vy[b] - w * ay[e], c.vz[b] - w * az[e]
    return effort


def give_back(rig: Any, bench: Any, c: Any, k: Any) -> None:
    """Positions of a component to its particles; what is loaded is rounded likewise."""
    x, y, z = bench.x[0], bench.x[1], bench.x[2]
    for s in range(rig.slots[k], rig.slots[k + 1]):
        if rig.inverse[s] > 0:
            row = rig.rows[s]
            c.x[row], c.y[row], c.z[row] = x[s], y[s], z[s]
            x[s], y[s], z[s] = c.x[row], c.y[row], c.z[row]


@outlined
def shake(rods: Any, c: Any, k: Any, h: Any) -> bool:
    """Put the rods of a component right after a drift of h [s], and its velocities with them; 0: positions only.

    Returns whether that could be done. They are then aimed at the new positions.
    """
    rig, bench = rods.rig, rods.bench
    slack = TIGHT + ROUNDING * load(rig, bench, c, k) / rig.shortest[k]
    for e in range(rig.rods[k], rig.rods[k + 1]):
        bench.force[e] = 0
    if rig.looped[k]:
        assemble(rig, bench, bench.arm, bench.arm, k)
        eliminate(rig, bench, k, True)
    worst, at = measure(rig, bench, k)
    turns = 0
    while worst > slack and turns < LIMIT:
        assemble(rig, bench, bench.reach, bench.arm, k)
        eliminate(rig, bench, k, False)
        solve(rig, bench, k)
        move(rig, bench, k)
        worst, at = measure(rig, bench, k)
        turns += 1
    if not worst <= slack:
        rods.failed[k], rods.misfit[k] = at, worst if bench.kept[at] else worst / FORGIVEN
        return False
    if h != 0:
        rods.effort[k] += push(rig, bench, c, bench.force, 1 / h, k)
    give_back(rig, bench, c, k)
    aim(rig, bench, c, k)
    return True


@outlined
def level(rods: Any, c: Any, k: Any) -> None:
    """Take away the velocities with which the rods of a component are stretched where they are aimed at."""
    rig, bench = rods.rig, rods.bench
    ax, ay, az = bench.arm[0], bench.arm[1], bench.arm[2]
    assemble(rig, bench, bench.arm, bench.arm, k)
    eliminate(rig, bench, k, rig.looped[k])
    for e in range(rig.rods[k], rig.rods[k + 1]):
        a, b = rig.rows[rig.first[e]], rig.rows[rig.second[e]]
        along = ax[e] * (float(c.vx[b]) - float(c.vx[a])) + ay[e] * (float(c.vy[b]) - float(c.vy[a]))
        bench.side[e] = along + az[e] * (float(c.vz[b]) - float(c.vz[a]))
    solve(rig, bench, k)
    rods.effort[k] += push(rig, bench, c, bench.side, 1.0, k)


# Kernels of their own, which those of islands call: they are compiled once, whatever else there is.


@kernel
def take_aim(rods: Any, c: Any) -> None:
    """Get ready for the drifts of a step: all rods of a thread where they are."""
    for k in range(rods.first, rods.last):
        load(rods.rig, rods.bench, c, k)
        aim(rods.rig, rods.bench, c, k)


@kernel
def hold(rods: Any, c: Any, h: Any, levelled: bool) -> bool:
    """Hold all rods of a thread after a drift of h [s] since they were aimed at, and level their velocities if asked to;
    whether that could be done.

    0 stands for anything else that has moved particles: they are brought to the nearest places that fit.
    """
    held = True
    for k in range(rods.first, rods.last):
        if not shake(rods, c, k, h):
            held = False
        elif levelled:
            level(rods, c, k)
    return held


@kernel
def after_kicks(rods: Any, c: Any) -> None:
    """Level the velocities of all rods of a thread."""
    for k in range(rods.first, rods.last):
        level(rods, c, k)
