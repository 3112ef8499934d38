"""What bounces in a step gives springs no energy.

Impacts are followed on a parabola, with the acceleration a of a particle of mass m that would not bounce. An impact leads
it elsewhere, by d, and springs pull otherwise there. Their energy changes by −∫ f·dd along the straight way, however many
particles bounce; Simpson's rule finds that from the forces without and with the impacts of the step and halfway between,
f, f' and f″. The parabola has counted −m a·d. The difference,

    G = m a·d − (f + 4 f″ + f')·d/6,

is taken from the velocity along d, which is that of the impact. Without it an elastic impact at a speed v gives k v² h²/6 in
the mean, with a stiffness k and a step of h. Dampers and other forces are in it, too.

Methods of second order that are reversible do not keep the energy, but to order h⁴

    E + α h² v·V″v + β h² Σ f²/m,

with α = 1/12 and β = −1/24 for leapfrogs, α = β = −1/24 for the implicit midpoint rule, and both 1/12 for the trapezoidal
rule (Hairer, Lubich, Wanner, Geometric Numerical Integration, IX; V″ is the matrix of second derivatives of the potential).
What an impact changes of it is in G, too: with w = (v + v')/2, Δ = v' − v and places halfway, forces f± at displacements
of ±h w − ½ (β/α) h² (f + f')/m give

    −α ((f₊ + f₋ − 2 f″)·d + h (f₊ − f₋)·Δ + h² (Δ²/d²) (f − 2 f″ + f')·d),

and the velocity along d counts as h² V″ says. Of terms of higher order only the size is known: they may give as much as
`UNSURE` (h² κ)³ of the energy along d, with κ the stiffness there over mass. Impacts give that away.

Velocities are those of the places: with symplectic Euler v + ½ h f/m, in which way its energy is kept (`engine.shadow`), and
with Störmer's rule u + ½ h f/m, u being that in the middle of the step. Impacts change forces at the end of a step, and not
these velocities. What they differ by from those on the parabola is in G, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.compiler.barrier import meet
from particlesim.engine.coupled.forces import evaluate
from particlesim.engine.interactions.interaction import prepare_elements
from particlesim.engine.state.columns import in_step, span, type_of

FREE, HIT, BETWEEN, BEHIND, AHEAD = range(5)
"""Where forces are looked at: without impacts, with them, halfway between, and from there about a step back and ahead."""
SHORT = 10.0
"""Impacts that are nearer to the end of a step than this part of it (1 over it) count as if they were that far from it."""
UNSURE = 0.35
"""Of tetrahedra of elastic beads with ω h up to 1.2 none of the methods gains energy then, but for its own swing."""
MOST = 1.5
"""How much of its energy along the normal an impact may get back, of what springs have taken: twice the speed."""


def note_rebound(rebounds: Any, share: Any, i: Any, way: Any, q: Any) -> None:
    """List particle i of a share, which has bounced in a step that would have ended at q."""
    k = share.first + share.struck[8 * share.number]
    share.struck[8 * share.number] += 1
    rebounds.rows[k] = i
    for axis, number in enumerate((q.x, q.y, q.z, q.vx, q.vy, q.vz)):
        rebounds.free[axis, k] = number
    for axis, number in enumerate((*way.turn, *way.late)):
        rebounds.way[axis, k] = number


def exchange(c: Any, i: Any, other: Any, k: Any) -> None:
    """Exchange the motion of particle i with column k of `other` [6, n]."""
    for axis, column in enumerate((c.x, c.y, c.z, c.vx, c.vy, c.vz)):
        here = column[i]
        column[i] = other[axis, k]
        other[axis, k] = here


@outlined
def settle_rebounds(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """Take from what has bounced in a step what springs have gained by it; all threads of an island come here."""
    room = work.rebounds
    meet(share.gate, share.threads)
    if share.struck.sum() > 0:
        first, last = share.first, share.first + share.struck[8 * share.number]
        for k in range(first, last):
            exchange(c, room.rows[k], room.free, k)
        _look(parts, bonds, c, work, share, t, end, FREE)
        for k in range(first, last):
            exchange(c, room.rows[k], room.free, k)
        _look(parts, bonds, c, work, share, t, end, HIT)
        for k in range(first, last):
            halve(c, room, k)
        _look(parts, bonds, c, work, share, t, end, BETWEEN)
        if room.home is not None:
            lead(room, c, share, t, end, h, BEHIND)
            _look(parts, bonds, c, work, share, t, end, BEHIND)
            lead(room, c, share, t, end, h, AHEAD)
            _look(parts, bonds, c, work, share, t, end, AHEAD)
            lead(room, c, share, t, end, h, BETWEEN)
        for k in range(first, last):
            exchange(c, room.rows[k], room.hit, k)
        if room.home is not None:
            meet(share.gate, share.threads)
            prepare_elements(share.elements, c, share, end)  # to know what is where particles are
        if room.around is not None:
            keep_time(room, c, share, t, end, h)
        for k in range(first, last):
            _, hi = span(c.clock, room.rows[k], t, end, h)
            if room.lies[room.rows[k]]:
                slide_on(c, room, k, hi)
            else:
                slow_down(c, room, k, hi)


@outlined
def _look(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, where: int) -> None:
    """Keep the forces with all particles where they are: on what has bounced, and those on all, if they are asked for."""
    room = work.rebounds
    meet(share.gate, share.threads)
    evaluate(parts, bonds, in_step(c, t, end), work, share, end, None)
    for k in range(share.first, share.first + share.struck[8 * share.number]):
        for axis in range(3):
            room.forces[3 * where + axis, k] = work.force[axis, room.rows[k]]
    if room.around is not None and where <= HIT:
        for axis in range(3):
            for i in range(share.first, share.last):
                room.around[3 * where + axis, i] = work.force[axis, i] / c.m[i]


def halve(c: Any, room: Any, k: Any) -> None:
    """Put the particle of column k halfway between its motions with impacts and without, and keep the former."""
    i = room.rows[k]
    for axis, column in enumerate((c.x, c.y, c.z, c.vx, c.vy, c.vz)):
        room.hit[axis, k] = column[i]
        column[i] = type_of(column[i], 0.5) * (column[i] + room.free[axis, k])


@outlined
def lead(room: Any, c: Any, share: Any, t: Any, end: Any, h: Any, where: int) -> None:
    """Take the particles of a share a step back or ahead, and back home."""
    begun, aside = type_of(h, room.begun), type_of(h, room.aside)
    for axis, (places, speeds) in enumerate(((c.x, c.vx), (c.y, c.vy), (c.z, c.vz))):
        for i in range(share.first, share.last):
            _, hi = span(c.clock, i, t, end, h)
            free, hit = room.around[axis, i], room.around[3 + axis, i]
            way, fall = hi * (speeds[i] + begun * hi * free), aside * hi * hi * (free + hit)
            if where == BEHIND:
                room.home[axis, i] = places[i]
                places[i] += fall - way
            elif where == AHEAD:
                places[i] = room.home[axis, i] + fall + way
            else:
                places[i] = room.home[axis, i]


def keep_time(room: Any, c: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """Impacts change the forces at the end of a step, not the velocities of the places there: those that are older, or lie
    between places, change by the opposite."""
    speeds = (c.vx, c.vy, c.vz) if room.between is None else c.memory
    part = room.begun if room.between is None else room.old
    for axis in (0, 1, 2):
        for i in range(share.first, share.last):
            _, hi = span(c.clock, i, t, end, h)
            if not room.lies[i]:
                speeds[axis][i] += type_of(h, part) * hi * (room.around[axis, i] - room.around[3 + axis, i])


def slide_on(c: Any, room: Any, k: Any, h: Any) -> None:
    """What `keep_time` does for the particle of column k, which has landed: along the surface."""
    i, square, along = room.rows[k], 0.0, 0.0
    places, speeds, m = (c.x, c.y, c.z), (c.vx, c.vy, c.vz), np.float64(c.m[i])
    for axis in (0, 1, 2):
        d = np.float64(places[axis][i]) - np.float64(room.free[axis, k])
        change = np.float64(room.forces[3 * FREE + axis, k]) - np.float64(room.forces[3 * HIT + axis, k])
        square, along = square + d * d, along + change * d
    if square > 0:
        part = room.begun * np.float64(h) / m
        for axis in (0, 1, 2):
            d = np.float64(places[axis][i]) - np.float64(room.free[axis, k])
            change = np.float64(room.forces[3 * FREE + axis, k]) - np.float64(room.forces[3 * HIT + axis, k])
            speeds[axis][i] += type_of(h, part * (change - along / square * d))


@outlined
def slow_down(c: Any, room: Any, k: Any, h: Any) -> None:
    """Change the speed along its displacement of the particle of column k."""
    i, old, begun = room.rows[k], room.old * np.float64(h), room.begun * np.float64(h)
    places, speeds, m = (c.x, c.y, c.z), (c.vx, c.vy, c.vz), np.float64(c.m[i])
    gain, square, along, bend, turn, change, stiff, lean = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in (0, 1, 2):
        a, late = np.float64(room.way[axis, k]), np.float64(room.way[3 + axis, k])
        free, hit, between = (np.float64(room.forces[3 * where + axis, k]) / m for where in range(3))
        d = np.float64(places[axis][i]) - np.float64(room.free[axis, k])
        # What a step begins with after contact is not old with Störmer's rule, as that is with which one ends.
        lost = old * free - (old - begun) * a
        v = np.float64(room.free[3 + axis, k]) + lost
        w = np.float64(speeds[axis][i]) + begun * hit + (old - begun) * (free - a)
        # (w² − (w + late − lost)² − v² + (v + late − lost)²)/2, with the velocities on the parabola
        gain += (a - (free + 4 * between + hit) / 6) * d + (late - lost) * (v - w)
        speeds[axis][i] = type_of(h, w - begun * hit)
        square += d * d
        along += w * d
        stiff += (free - hit) * d
        bend += (free - between - between + hit) * d
        turn += (w - v) * d
        change += (w - v) * (w - v)
        if room.home is not None:
            behind, ahead = (np.float64(room.forces[3 * where + axis, k]) / m for where in (BEHIND, AHEAD))
            ways = (ahead + behind - between - between) * d + np.float64(h) * (ahead - behind) * (w - v)
            gain -= room.series * ways
            lean += room.series * np.float64(h) * (behind - ahead) * d
    if square > 0 and along != 0:
        length, part = np.sqrt(square), np.float64(h) * np.float64(h) / square
        # Where other particles bounce as well, this is not their own stiffness alone: it is no more than this in a step
        # that is stable.
        stiff = min(max(part * stiff, -1.0), 1.0)
        b, heavy = along / length, 1.0
        if room.home is not None:
            gain -= room.series * bend * min(part * change, SHORT * SHORT)
            b += (lean + room.series * stiff * turn) / length
            heavy += 2 * room.series * stiff
        gain += 0.5 * UNSURE * b * b * max(stiff, 0.0) ** 3
        gain = max(gain, -MOST * b * b)
        # ½ heavy s² + b s + gain = 0
        root = np.sqrt(max(b * b - 2 * heavy * gain, 0.0))
        s = -2 * gain / (b + root if b > 0 else b - root) if root > 0 else -b / heavy
        for axis in (0, 1, 2):
            d = np.float64(places[axis][i]) - np.float64(room.free[axis, k])
            speeds[axis][i] = type_of(h, np.float64(speeds[axis][i]) + s * d / length)
