"""Hard grains that lie, and only tremble, stay where they are.

Turns find the impulses of a step up to a part of what forces do in it. In narrow places, such as the tip of a pyramid, what
is left is never the same twice, and grains would go to and fro by that for ever. So a cluster falls asleep if all of it

- stands on something at rest, and is no faster than twice what forces change velocities by in a step, u = h |F|/m,
- stays within h u of where it was, and comes back there eight times, in 16 to 64 steps each, up to an eighth of its path,
  and up to a 32th in the end: what slides or rolls, however slowly, is at the end of its path,
- jerks: its displacements change from step to step by more than half of themselves. What swings does not, in ten steps or
  more for each swing,
- trembles, if it turns: a top, whose place is still, goes on,

and then is slower than 0.3 u, but not at rest anyway (10⁻⁵ u). From then on each step is tried as all others are, and taken
back: grains stay where they are, at rest. What contacts are given goes on from step to step (`memory`), until all steps are
the same. After that the first one wakes it up in which a grain would go otherwise by 10⁻³ u. So does the first in which the
force on a grain is another one, by a bit: forces that change with time let nothing sleep. Elastic grains never do, nor those
on which something else acts than fields of forces and hard contacts, such as springs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import STANDS, root
from particlesim.engine.interactions.hard.bench import COUNT, FASTER, OWN, PAIRED
from particlesim.engine.interactions.hard.laws import restitution_at, some_rest
from particlesim.engine.interactions.hard.thrown import size_of
from particlesim.engine.interactions.hard.ways import ALONE
from particlesim.engine.interactions.interaction import Floats, Ints
from particlesim.engine.state.columns import fetch, let_know
from particlesim.laws.registry import force, moved_to

STEPS, PATH, AWAY, RETURNS, LEAST, MOST = 0, 1, 2, 5, 6, 7
LAST, WHOLE, JERKS, FORCES, ROWS = 8, 11, 12, 13, 16
"""Rows of what is kept of particles: steps and path since they have come back, and how far they are from where they were at
first [3] [m]; how often they have come back, and more than `OFTEN` of what sleeps: with the steps that were taken back; the
least and the fastest motion in those [m/s]; the last displacement [3], the path from the first on, and how much
displacements have changed from step to step on it [m]; the last kick of forces [3] [m/s]."""
UNREST, KICK, CALM = 3, 4, 5
"""Rows of `Bench.start` that are free when impulses have been given, of the particle that stands for a cluster: its fastest
motion and u [m/s]; how often all of it has come back."""
SOON, LATE = 16, 64
"""Steps after which something comes back at the earliest, and at the latest."""
OFTEN, DOZES, SLEEPS, NEVER = 8, 40, 72, -1000
"""How often something comes back before it sleeps; with the steps that are taken back then, from which on these are kept in
mind, and from which on one that differs from those wakes it up; how often it has come back when changing forces wake it."""
CALMLY, QUIETLY, CALMEST, NOTICED = 2.0, 0.3, 1e-5, 1e-3
"""Speeds over u up to which a cluster is calm, up to which it sleeps, and up to which it has come to rest by itself; by how
much a step differs that wakes it up."""
TO_AND_FRO, AT_LAST, JERKY, TREMBLES, ROUNDED = 0.125, 1 / 32, 0.5, 0.01, 1e-9
"""How far from where it was something is that has come back, as a part of its path, and of all of it before it sleeps; how
much displacements change that jerk, as a part of them; the path of what trembles, over h u, and of rounding, in radii."""


def nobody_sleeps(particles: int) -> Floats:
    """What is kept of particles that are awake."""
    return np.zeros((ROWS, particles))


def asleep_by(asleep: Floats, place: Ints, particles: int) -> Floats:
    """The same among particles of which row k has become row `place[k]`, −1 of those that are gone."""
    found, left = nobody_sleeps(particles), place >= 0
    found[:, place[left]] = asleep[:, left]
    return found


def sleeps(kept: Any, i: Any) -> Any:
    """Whether the steps of a particle are taken back."""
    return kept[RETURNS, i] > OFTEN


# Kernels


def let_sleep(each: Any, parts: Any, c: Any, before: Any, walls: Any, t: Any, h: Any) -> None:
    """Take back what a step has done to what sleeps, and let sleep what may."""
    if some_rest(each.laws) & (each.ways.number[ALONE] > 0):
        look_at_unrest(each, c, before, walls, h)
        for part in parts:
            note_kicks(each, part.forces, c, before, part.first, part.last, t, h)
        note_calm(each, c, before, h)
        take_back_steps(each, c, before, h)


@outlined
def wake_all(each: Any) -> None:
    """Forget of all that they have been calm, where nothing touches."""
    for i in range(each.asleep.shape[1]):
        each.asleep[RETURNS, i] = 0.0


@outlined
def look_at_unrest(each: Any, c: Any, before: Any, walls: Any, h: Any) -> None:
    """How fast what moves fastest is in each cluster, without an end where that does not stand on what is at rest."""
    bench, s, o = each.bench, each.bench.start, each.ways.obstacles
    mark, cluster = bench.mark, bench.desk.cluster
    for i in range(mark.size):
        if (mark[i] & PAIRED) != 0:
            s[UNREST, i], s[KICK, i], s[CALM, i] = 0.0, 0.0, np.inf
        else:
            each.asleep[RETURNS, i] = 0.0
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at = root(cluster, i)
            s[UNREST, at] = max(s[UNREST, at], _motion(c, before, i, h))
            among_bodies = False if o is None else o.guests[i] > 0
            if (cluster[STANDS, at] == 0) | among_bodies:
                s[UNREST, at] = np.inf
    for k in range(each.report[COUNT]):
        for i, j in ((bench.rows[0, k], bench.rows[1, k]), (bench.rows[1, k], bench.rows[0, k])):
            if each.a[i] > 0:
                moves = (each.a[j] <= 0) and _motion(c, before, j, h) > 0
                if moves or restitution_at(each, k) >= 1:
                    s[UNREST, root(cluster, i)] = np.inf
    for q in range(walls):
        moves = False
        for axis in range(3):
            moves |= (bench.wall_normal[OWN + axis, q] != 0) | (bench.wall_normal[FASTER + axis, q] != 0)
        if moves:
            s[UNREST, root(cluster, bench.wall[q])] = np.inf


def _motion(c: Any, before: Any, i: Any, h: Any) -> float:
    """How fast a particle is, has gone in the step, or turns [m/s]."""
    x, y, z = float(c.x[i] - before[0, i]), float(c.y[i] - before[1, i]), float(c.z[i] - before[2, i])
    u, v, w = float(c.vx[i]), float(c.vy[i]), float(c.vz[i])
    return max(size_of((x, y, z)) / h, size_of((u, v, w)), _turning(c, i))


def _turning(c: Any, i: Any) -> float:
    """How fast the surface of a particle turns [m/s]."""
    if c.spin is None:
        return 0.0
    return float(c.r[i]) * size_of((float(c.spin.wx[i]), float(c.spin.wy[i]), float(c.spin.wz[i])))


@outlined
def note_kicks(each: Any, forces: Any, c: Any, before: Any, first: Any, last: Any, t: Any, h: Any) -> None:
    """By how much forces change velocities in a step where it begins, at most in a cluster; where they are others than
    before nothing sleeps."""
    mark, s, cluster, kept = each.bench.mark, each.bench.start, each.bench.desk.cluster, each.asleep
    for i in range(first, last):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            x, y, z, u, v, w = (before[row, i] for row in range(6))
            p = moved_to(fetch(c, i, t), x, y, z, u, v, w, t)
            f = force(forces, p) if len(forces) > 0 else (0.0, 0.0, 0.0)
            kick, same, at, other = h * float(each.a[i]), True, root(cluster, i), 0.0
            for axis in range(3):
                now = kick * float(f[axis])
                same = same & (kept[FORCES + axis, i] == now)
                other = max(other, abs(now - kept[FORCES + axis, i]))
                kept[FORCES + axis, i] = now
            given = (kept[FORCES, i], kept[FORCES + 1, i], kept[FORCES + 2, i])
            s[KICK, at] = max(s[KICK, at], size_of(given))
            if sleeps(kept, i) & (kept[RETURNS, i] > OFTEN + 1) & (not same):
                s[CALM, at] = NEVER
            elif other > CALMEST * s[KICK, at]:
                kept[RETURNS, i] = min(kept[RETURNS, i], 0.0)


@outlined
def note_calm(each: Any, c: Any, before: Any, h: Any) -> None:
    """How often clusters have come back, calm."""
    mark, s, cluster, kept = each.bench.mark, each.bench.start, each.bench.desk.cluster, each.asleep
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at = root(cluster, i)
            if not s[UNREST, at] <= CALMLY * s[KICK, at]:
                _wake(kept, i, 0.0)
            elif not sleeps(kept, i):
                _go_on(kept, c, before, i)
                far = size_of((kept[AWAY, i], kept[AWAY + 1, i], kept[AWAY + 2, i]))
                if (far > h * s[KICK, at]) | (kept[STEPS, i] >= LATE):
                    _wake(kept, i, min(kept[RETURNS, i], 0.0))
                elif (kept[STEPS, i] >= SOON) & _returns(kept, c, i, far, s[KICK, at], h):
                    kept[RETURNS, i] = min(kept[RETURNS, i] + 1.0, OFTEN)
                    kept[STEPS, i] = kept[PATH, i] = 0.0
            s[CALM, at] = min(s[CALM, at], kept[RETURNS, i])


def _wake(kept: Any, i: Any, returns: Any) -> None:
    """Begin to look at the way of a particle, as one that has come back so often."""
    for row in range(FORCES):
        kept[row, i] = 0.0
    kept[RETURNS, i] = returns


def _go_on(kept: Any, c: Any, before: Any, i: Any) -> None:
    """Add a step to the way of a particle."""
    far, jerk = 0.0, 0.0
    for axis, now in enumerate((c.x, c.y, c.z)):
        way = float(now[i] - before[axis, i])
        jerk += (way - kept[LAST + axis, i]) * (way - kept[LAST + axis, i])
        far += way * way
        kept[AWAY + axis, i] += way
        kept[LAST + axis, i] = way
    kept[PATH, i] += np.sqrt(far)
    kept[WHOLE, i] += np.sqrt(far)
    kept[JERKS, i] += np.sqrt(jerk)
    kept[STEPS, i] += 1.0


def _returns(kept: Any, c: Any, i: Any, far: Any, u: Any, h: Any) -> bool:
    """Whether a particle that is `far` from where it was has come back by jerks, and turns only as it trembles."""
    path, least = kept[PATH, i], ROUNDED * float(c.r[i])
    turns = (path <= TREMBLES * h * u) & (_turning(c, i) > NOTICED * u)
    returns = (far <= TO_AND_FRO * path) & (kept[JERKS, i] >= JERKY * kept[WHOLE, i])
    if kept[RETURNS, i] + 1 >= OFTEN:
        returns &= far <= AT_LAST * kept[WHOLE, i]
    return (returns | (kept[WHOLE, i] <= least)) & (not turns)


@outlined
def take_back_steps(each: Any, c: Any, before: Any, h: Any) -> None:
    """Put back what sleeps; what something has disturbed is awake."""
    mark, s, cluster, kept = each.bench.mark, each.bench.start, each.bench.desk.cluster, each.asleep
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at = root(cluster, i)
            now, u = _motion(c, before, i, h), s[KICK, at]
            other = (now < kept[LEAST, i] - NOTICED * u) | (now > kept[MOST, i] + NOTICED * u)
            still = (s[UNREST, at] <= CALMEST * u) & (not sleeps(kept, i)) & (s[CALM, at] >= OFTEN)
            if still:
                s[CALM, at] = min(s[CALM, at], -1.0)
            if (s[UNREST, at] > QUIETLY * u) | ((kept[RETURNS, i] >= SLEEPS) & other):
                s[CALM, at] = min(s[CALM, at], 0.0)
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at = root(cluster, i)
            if s[CALM, at] >= OFTEN:
                now, dozes = _motion(c, before, i, h), kept[RETURNS, i] < DOZES
                kept[LEAST, i] = now if dozes else min(kept[LEAST, i], now)
                kept[MOST, i] = now if dozes else max(kept[MOST, i], now)
                kept[RETURNS, i] = min(kept[RETURNS, i] + 1.0, SLEEPS)
                _put_back(c, before, i)
            elif sleeps(kept, i) | (s[CALM, at] < 0):
                _wake(kept, i, NEVER if s[CALM, at] <= NEVER else min(kept[RETURNS, i], 0.0))


def _put_back(c: Any, before: Any, i: Any) -> None:
    """Leave a particle where it was, at rest."""
    let_know(c.memory, i, -float(c.vx[i]), -float(c.vy[i]), -float(c.vz[i]))
    c.x[i], c.y[i], c.z[i] = before[0, i], before[1, i], before[2, i]
    c.vx[i] = c.vy[i] = c.vz[i] = 0
    if c.spin is not None:
        c.spin.wx[i] = c.spin.wy[i] = c.spin.wz[i] = 0
