"""What it costs to move hard grains apart is taken from their motion.

Displacements that make overlaps smaller leave velocities as they are, and lift what lies on something: energy out of
nothing, though no more than what has been lost as grains came into each other. So each cluster at colliders pays for it:
all its velocities, relative to what it is at, are made smaller by one factor, by which it loses what its displacements have
given it, as long as it moves. What it does not have is booked as given (`lifting`). What flies together, away from
colliders, is lifted by nothing in a uniform field, as displacements are in inverse proportion to masses, and keeps its
momentum in others.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import STANDS, root
from particlesim.engine.interactions.hard.bench import GAIN, OWN, PAIRED, SQUARE, WORK
from particlesim.engine.interactions.lifting import energy_at
from particlesim.engine.state.columns import fetch, let_know, type_of

HELD, FASTEST = 3, 4
"""Rows of `Bench.start` that are free when impulses have been given, of the particle that stands for a cluster: whether it
is at a collider, and the square of the fastest motion in it [m²/s²]; from `FRAME` on the velocity of that collider [m/s]."""
FRAME = 10
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


def pay_for_lifts(each: Any, parts: Any, c: Any, walls: Any, t: Any) -> float:
    """Slow clusters down by what they have been lifted since potentials were noted; what that has taken from them [J]."""
    begin_sums(each, c, walls)
    for part in parts:
        _add_lifts(each, part.forces, c, part.first, part.last, t)
    return slow_down(each, c)


@outlined
def begin_sums(each: Any, c: Any, walls: Any) -> None:
    """The energy of motion of each cluster, twice, as it is seen from a collider that it is at."""
    mark, s, n, cluster = each.bench.mark, each.bench.start, each.bench.wall_normal, each.bench.desk.cluster
    for i in range(mark.size):
        if (mark[i] & PAIRED) != 0:
            s[GAIN, i] = s[SQUARE, i] = s[HELD, i] = s[FASTEST, i] = 0.0
            s[FRAME, i] = s[FRAME + 1, i] = s[FRAME + 2, i] = 0.0
    for q in range(walls):
        at = root(cluster, each.bench.wall[q])
        s[HELD, at] = 1.0
        for axis in range(3):
            s[FRAME + axis, at] = float(n[OWN + axis, q])
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at, square = root(cluster, i), 0.0
            for axis, v in enumerate((c.vx, c.vy, c.vz)):
                square += (float(v[i]) - s[FRAME + axis, at]) * (float(v[i]) - s[FRAME + axis, at])
            if c.spin is not None:
                u, v, w = float(c.spin.wx[i]), float(c.spin.wy[i]), float(c.spin.wz[i])
                square += 0.4 * float(c.r[i]) * float(c.r[i]) * (u * u + v * v + w * w)
            s[SQUARE, at] += square / float(each.a[i])
            s[FASTEST, at] = max(s[FASTEST, at], square)


@outlined
def _add_lifts(each: Any, forces: Any, c: Any, first: Any, last: Any, t: Any) -> None:
    """Add up how much each cluster has been lifted, but for what may be rounding."""
    mark, s, cluster = each.bench.mark, each.bench.start, each.bench.desk.cluster
    rounding = ROUNDING[1] if isinstance(c.r[0], np.float32) else ROUNDING[0]
    for i in range(first, last):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            now = energy_at(forces, fetch(c, i, t))
            s[GAIN, root(cluster, i)] += now - s[WORK, i] - rounding * abs(now)


@outlined
def slow_down(each: Any, c: Any) -> float:
    """Take from the motion of all clusters at colliders what lifts them, as far as they have it; returns that."""
    mark, s, cluster, paid = each.bench.mark, each.bench.start, each.bench.desk.cluster, 0.0
    for i in range(mark.size):  # of those that stand for a cluster: the part of velocities that stays
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0) and (root(cluster, i) == i):
            held, rest = (cluster[STANDS, i] > 0) | (s[HELD, i] > 0), STILL * float(each.bench.change[i])
            lift = s[GAIN, i] if held & (s[GAIN, i] > 0) & (s[FASTEST, i] > rest * rest) else 0.0
            lift = min(lift, 0.5 * s[SQUARE, i])
            s[GAIN, i] = np.sqrt(max(1.0 - 2.0 * lift / s[SQUARE, i], 0.0)) if lift > 0 else 1.0
            paid += lift
    if paid > 0:
        for i in range(mark.size):
            if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
                at = root(cluster, i)
                if s[GAIN, at] < 1:
                    slow(c, i, s[GAIN, at], (s[FRAME, at], s[FRAME + 1, at], s[FRAME + 2, at]))
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
