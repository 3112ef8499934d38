"""What it costs to move hard grains apart is taken from their motion.

Displacements that make overlaps smaller leave velocities as they are, and lift what lies on something. What sinks in a step
loses as much in it, and has it back by that. More is energy out of nothing, and each cluster at colliders pays for it: where
its energy has risen in the step, the velocities of all, relative to a collider that it is at, are made smaller by one
factor, by which it loses that, or as much as displacements have given, as long as it moves. What it does not have is booked
as given (`lifting`).

What no collider pushes along is kept: on one plane the velocity of the whole along that, in a groove that along both sides.
Clusters away from colliders pay nothing: displacements in inverse proportion to masses lift nothing in a
uniform field.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import root
from particlesim.engine.interactions.hard.bench import GAIN, OWN, PAIRED, SQUARE, WORK
from particlesim.engine.interactions.hard.ways import SPINS
from particlesim.engine.interactions.lifting import energy_at
from particlesim.engine.state.columns import fetch, let_know, type_of
from particlesim.laws.registry import force, moved_to

SIDES, FASTEST = 3, 4
"""Rows of `Bench.start` that are free when impulses have been given, of the particle that stands for a cluster: how many
directions its colliders push along, 3 at most; the square of its fastest motion [m²/s²]."""
FRAME, RISE, ALONG, ACROSS, MOTION, MASS = 10, 16, 17, 20, 23, 26
"""After them the velocity of a collider [3] [m/s]; how much its energy has risen in the step [J]; two of those directions,
at right angles [3] each; the momentum relative to the collider [3] [kg m/s], then the velocity of the whole that is kept
[m/s]; and the mass [kg]."""
OTHER = 0.1
"""The sine of the angle between two directions above which they are different ones."""
STILL = 1e-3
"""Motion of what rests, which pays nothing, as a part of what forces change velocities by in a step."""
ROUNDING = 4e-15, 1e-6
"""Lifts that are rounding, as parts of potential energies, in double and in single precision."""


def note_potentials(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Note the potential energies of all in pairs before they are moved apart."""
    for part in parts:
        _note_in(each, part.forces, c, part.first, part.last, t)


@outlined
def _note_in(each: Any, forces: Any, c: Any, first: Any, last: Any, t: Any) -> None:
    for i in range(first, last):
        if (each.bench.mark[i] & PAIRED) != 0:
            each.bench.start[WORK, i] = energy_at(forces, fetch(c, i, t))


def pay_for_lifts(each: Any, parts: Any, c: Any, before: Any, walls: Any, t: Any, h: Any) -> float:
    """Slow clusters down by what they have been lifted since potentials were noted, as far as their energy has risen in the
    step of h; what that has taken from their motion [J]."""
    begin_sums(each, c, walls)
    for part in parts:
        _add_lifts(each, part.forces, c, before, part.first, part.last, t, h)
    return slow_down(each, c)


@outlined
def begin_sums(each: Any, c: Any, walls: Any) -> None:
    """Of each cluster what it is at, and its energy of motion, twice, without what is kept."""
    mark, s, cluster = each.bench.mark, each.bench.start, each.bench.desk.cluster
    for i in range(mark.size):
        if (mark[i] & PAIRED) != 0:
            s[GAIN, i] = s[RISE, i] = s[SQUARE, i] = s[SIDES, i] = s[FASTEST, i] = s[MASS, i] = 0.0
            for axis in range(3):
                s[FRAME + axis, i] = s[MOTION + axis, i] = 0.0
    for q in range(walls):
        note_side(each, root(cluster, each.bench.wall[q]), q)
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at, m = root(cluster, i), 1.0 / float(each.a[i])
            s[MASS, at] += m
            for axis, v in enumerate((c.vx, c.vy, c.vz)):
                s[MOTION + axis, at] += m * (float(v[i]) - s[FRAME + axis, at])
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0) and (root(cluster, i) == i):
            keep_motion(s, i)
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at, square = root(cluster, i), 0.0
            for axis, v in enumerate((c.vx, c.vy, c.vz)):
                by = float(v[i]) - s[FRAME + axis, at] - s[MOTION + axis, at]
                square += by * by
            if c.spin is not None:
                u, v, w = float(c.spin.wx[i]), float(c.spin.wy[i]), float(c.spin.wz[i])
                square += 0.4 * float(c.r[i]) * float(c.r[i]) * (u * u + v * v + w * w)
            s[SQUARE, at] += square / float(each.a[i])
            s[FASTEST, at] = max(s[FASTEST, at], square)


def note_side(each: Any, at: Any, q: Any) -> None:
    """Add the direction along which a collider pushes a particle to those of its cluster."""
    s, n = each.bench.start, each.bench.wall_normal
    x, y, z = float(n[0, q]), float(n[1, q]), float(n[2, q])
    for k in range(2):
        if k < s[SIDES, at]:
            row = ALONG if k == 0 else ACROSS
            along = x * s[row, at] + y * s[row + 1, at] + z * s[row + 2, at]
            x, y, z = x - along * s[row, at], y - along * s[row + 1, at], z - along * s[row + 2, at]
    size = np.sqrt(x * x + y * y + z * z)
    if s[SIDES, at] == 0:
        for axis in range(3):
            s[FRAME + axis, at] = float(n[OWN + axis, q])
    if (size > OTHER) & (s[SIDES, at] < 3):
        if s[SIDES, at] < 2:
            row = ALONG if s[SIDES, at] == 0 else ACROSS
            s[row, at], s[row + 1, at], s[row + 2, at] = x / size, y / size, z / size
        s[SIDES, at] += 1.0


def keep_motion(s: Any, at: Any) -> None:
    """Of the motion of a cluster as a whole what no collider pushes along."""
    u, v, w = (s[MOTION + axis, at] / s[MASS, at] for axis in range(3))
    for k in range(2):
        if k < s[SIDES, at]:
            row = ALONG if k == 0 else ACROSS
            along = u * s[row, at] + v * s[row + 1, at] + w * s[row + 2, at]
            u, v, w = u - along * s[row, at], v - along * s[row + 1, at], w - along * s[row + 2, at]
    part = 1.0 if s[SIDES, at] < 3 else 0.0
    s[MOTION, at], s[MOTION + 1, at], s[MOTION + 2, at] = part * u, part * v, part * w


@outlined
def _add_lifts(each: Any, forces: Any, c: Any, before: Any, first: Any, last: Any, t: Any, h: Any) -> None:
    """Add up how much each cluster has been lifted, but for what may be rounding, and how much its energy has risen, as seen
    from its collider: with velocities that are late by a part of what forces do, that of when these are."""
    mark, s, cluster, late = each.bench.mark, each.bench.start, each.bench.desk.cluster, each.ways.late[0]
    rounding = ROUNDING[1] if isinstance(c.r[0], np.float32) else ROUNDING[0]
    for i in range(first, last):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at, p = root(cluster, i), fetch(c, i, t)
            now = energy_at(forces, p)
            lift = now - s[WORK, i]
            s[GAIN, at] += lift if abs(lift) > rounding * abs(now) else 0.0
            kick = (0.0, 0.0, 0.0)
            if len(forces) > 0 and late != 0:
                kick = force(forces, p)
            x, y, z = (type_of(p.x, before[axis, i] + h * s[FRAME + axis, at]) for axis in range(3))
            rise = now - energy_at(forces, moved_to(p, x, y, z, p.vx, p.vy, p.vz, p.t))
            for axis, v in enumerate((c.vx, c.vy, c.vz)):
                u, was = float(v[i]) - s[FRAME + axis, at], float(before[3 + axis, i]) - s[FRAME + axis, at]
                rise += 0.5 * (u * u - was * was) / float(each.a[i]) + late * h * float(kick[axis]) * (
                    u - was
                )
            if c.spin is not None:
                inertia = 0.4 * float(c.r[i]) * float(c.r[i]) / float(each.a[i])
                for axis, w in enumerate((c.spin.wx, c.spin.wy, c.spin.wz)):
                    u, was = float(w[i]), float(before[SPINS + axis, i])
                    rise += 0.5 * inertia * (u * u - was * was)
            s[RISE, at] += rise


@outlined
def slow_down(each: Any, c: Any) -> float:
    """Take from the motion of all clusters at colliders what lifts them, as far as they have it; returns that [J]."""
    mark, s, cluster, paid = each.bench.mark, each.bench.start, each.bench.desk.cluster, 0.0
    for i in range(mark.size):  # of those that stand for a cluster: the part of velocities that stays
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0) and (root(cluster, i) == i):
            still, lift = STILL * float(each.bench.change[i]), min(s[GAIN, i], s[RISE, i])
            pays = (lift > 0) & (s[SIDES, i] > 0) & (s[FASTEST, i] > still * still)
            lift = min(lift, 0.5 * s[SQUARE, i]) if pays else 0.0
            s[GAIN, i] = np.sqrt(max(1.0 - 2.0 * lift / s[SQUARE, i], 0.0)) if pays else 1.0
            paid += lift
    if paid > 0:
        for i in range(mark.size):
            if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
                at = root(cluster, i)
                if s[GAIN, at] < 1:
                    slow(c, i, s[GAIN, at], tuple(s[FRAME + k, at] + s[MOTION + k, at] for k in range(3)))
    return paid


def slow(c: Any, i: Any, part: Any, u: Any) -> None:
    """Leave a part of the motion of a particle relative to something with a velocity u."""
    less = part - 1.0
    x, y, z = less * (float(c.vx[i]) - u[0]), less * (float(c.vy[i]) - u[1]), less * (float(c.vz[i]) - u[2])
    for v, by in ((c.vx, x), (c.vy, y), (c.vz, z)):
        v[i] = type_of(v[i], float(v[i]) + by)
    let_know(c.memory, i, x, y, z)
    if c.spin is not None:
        for w in (c.spin.wx, c.spin.wy, c.spin.wz):
            w[i] = type_of(w[i], part * float(w[i]))
