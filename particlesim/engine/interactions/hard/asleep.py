"""Hard grains that lie, and only tremble, stay where they are.

Turns find the impulses of a step up to a part of what forces do in it. In narrow places, such as the tip of a pyramid, what
is left is never the same twice, and grains would go to and fro by that for ever. So a cluster falls asleep if all of it

- stands on something at rest, and is no faster than twice what forces change velocities by in a step, u = h |F|/m,
- comes back eight times, in 16 to 64 steps each: ends nearer than h u, and than an eighth of its path, to where it began.
  What slides or rolls is at the end of its path then, and what swings comes back once, where it turns round,
- trembles, if it turns: a top, whose place is still, goes on,

and then is slower than 0.3 u. From then on each step is tried as all others are, and taken back: grains stay where they are,
at rest. What contacts are given goes on from step to step (`memory`), until all steps are the same. After that the first one
that differs by 10⁻³ u, as forces, a neighbour, or a collider have changed, wakes the cluster up. Elastic grains never sleep.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import STANDS, root
from particlesim.engine.interactions.hard.bench import COUNT, FASTER, OWN, PAIRED
from particlesim.engine.interactions.interaction import Floats, Ints
from particlesim.engine.state.columns import fetch, let_know
from particlesim.laws.registry import force

STEPS, PATH, AWAY, RETURNS, LEAST, MOST, ROWS = 0, 1, 2, 5, 6, 7, 8
"""Rows of what is kept of particles: steps since they have come back, the path since then, and how far that has led [3] [m];
how often they have come back, calm, and, after that, how many steps have been taken back; and the least and the largest
unrest, over u, of those, 0 of what is awake."""
UNREST, KICK, CALM = 3, 4, 5
"""Rows of `Bench.start` that are free when impulses have been given, of the particle that stands for a cluster: its fastest
motion and u [m/s]; how often all of it has come back."""
SOON, LATE = 16, 64
"""Steps after which something comes back at the earliest, and at the latest."""
OFTEN, DOZES, SLEEPS = 8, 40, 72
"""How often something comes back before it sleeps; with the steps that are taken back then, from which on these are kept in
mind, and from which on one that differs from those wakes it up."""
CALMLY, QUIETLY, NOTICED = 2.0, 0.3, 1e-3
"""Speeds over u up to which a cluster is calm, and up to which it sleeps; by how much a step differs that wakes it up."""
TO_AND_FRO, NOWHERE, TREMBLES = 0.125, 1e-3, 0.01
"""How far from where it began something ends that comes back, as a part of its path, or of h u; and from which path on, over
h u, it trembles."""


def nobody_sleeps(particles: int) -> Floats:
    """What is kept of particles that are awake."""
    return np.zeros((ROWS, particles))


def asleep_by(asleep: Floats, place: Ints, particles: int) -> Floats:
    """The same among particles of which row k has become row `place[k]`, −1 of those that are gone."""
    found, left = nobody_sleeps(particles), place >= 0
    found[:, place[left]] = asleep[:, left]
    return found


# Kernels


def let_sleep(each: Any, parts: Any, c: Any, before: Any, walls: Any, t: Any, h: Any) -> None:
    """Take back what a step has done to what sleeps, and let sleep what may."""
    if each.law.restitution < 1:
        look_at_unrest(each, c, before, walls, h)
        for part in parts:
            note_kicks(each, part.forces, c, part.first, part.last, t, h)
        note_calm(each, c, before, h)
        take_back_steps(each, c, before)


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
            if (each.a[i] > 0) & (each.a[j] <= 0):  # noqa: SIM102
                if _motion(c, before, j, h) > 0:
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
    most = max((x * x + y * y + z * z) / (h * h), u * u + v * v + w * w)
    if c.spin is not None:
        r = float(c.r[i])
        u, v, w = r * float(c.spin.wx[i]), r * float(c.spin.wy[i]), r * float(c.spin.wz[i])
        most = max(most, u * u + v * v + w * w)
    return np.sqrt(most)


@outlined
def note_kicks(each: Any, forces: Any, c: Any, first: Any, last: Any, t: Any, h: Any) -> None:
    """By how much forces change velocities in a step, at most in a cluster."""
    mark, s, cluster = each.bench.mark, each.bench.start, each.bench.desk.cluster
    for i in range(first, last):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            x, y, z = force(forces, fetch(c, i, t)) if len(forces) > 0 else (0.0, 0.0, 0.0)
            kick = (
                h
                * float(each.a[i])
                * np.sqrt(float(x) * float(x) + float(y) * float(y) + float(z) * float(z))
            )
            at = root(cluster, i)
            s[KICK, at] = max(s[KICK, at], kick)


@outlined
def note_calm(each: Any, c: Any, before: Any, h: Any) -> None:
    """How often clusters have come back, calm."""
    mark, s, cluster, kept = each.bench.mark, each.bench.start, each.bench.desk.cluster, each.asleep
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at = root(cluster, i)
            if not s[UNREST, at] <= CALMLY * s[KICK, at]:
                _wake(kept, i)
            elif kept[MOST, i] == 0:
                _go_on(kept, c, before, i)
                if (kept[STEPS, i] >= SOON) & _returns(kept, c, i, s[KICK, at], h):
                    kept[RETURNS, i] = min(kept[RETURNS, i] + 1.0, OFTEN)
                    _begin(kept, i)
                elif kept[STEPS, i] >= LATE:
                    _wake(kept, i)
            s[CALM, at] = min(s[CALM, at], kept[RETURNS, i])


def _wake(kept: Any, i: Any) -> None:
    """Forget what is kept of a particle."""
    for row in range(ROWS):
        kept[row, i] = 0.0


def _begin(kept: Any, i: Any) -> None:
    """Look at the way of a particle from here on."""
    for row in range(RETURNS):
        kept[row, i] = 0.0


def _go_on(kept: Any, c: Any, before: Any, i: Any) -> None:
    """Add a step to the way of a particle."""
    square = 0.0
    for axis, now in enumerate((c.x, c.y, c.z)):
        far = float(now[i] - before[axis, i])
        kept[AWAY + axis, i] += far
        square += far * far
    kept[PATH, i] += np.sqrt(square)
    kept[STEPS, i] += 1.0


def _returns(kept: Any, c: Any, i: Any, u: Any, h: Any) -> bool:
    """Whether the way of a particle has led nowhere, and whether it turns only as it trembles."""
    x, y, z, most = kept[AWAY, i], kept[AWAY + 1, i], kept[AWAY + 2, i], h * u
    far, path = np.sqrt(x * x + y * y + z * z), kept[PATH, i]
    still = True
    if c.spin is not None:
        x, y, z = float(c.spin.wx[i]), float(c.spin.wy[i]), float(c.spin.wz[i])
        still = float(c.r[i]) * np.sqrt(x * x + y * y + z * z) <= NOWHERE * u
    returns = (far <= min(TO_AND_FRO * path, most)) | (far <= NOWHERE * most)
    return returns & (still | (path > TREMBLES * most))


@outlined
def take_back_steps(each: Any, c: Any, before: Any) -> None:
    """Put back what sleeps; what something has disturbed is awake."""
    mark, s, cluster, kept = each.bench.mark, each.bench.start, each.bench.desk.cluster, each.asleep
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at = root(cluster, i)
            unrest, u = s[UNREST, at], s[KICK, at]
            other = (unrest < (kept[LEAST, i] - NOTICED) * u) | (unrest > (kept[MOST, i] + NOTICED) * u)
            if (unrest > QUIETLY * u) | ((kept[RETURNS, i] >= SLEEPS) & other):
                s[CALM, at] = 0.0
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at = root(cluster, i)
            if s[CALM, at] >= OFTEN:
                unrest = s[UNREST, at] / s[KICK, at] + NOTICED
                dozes = kept[RETURNS, i] < DOZES
                kept[LEAST, i] = unrest if dozes else min(kept[LEAST, i], unrest)
                kept[MOST, i] = unrest if dozes else max(kept[MOST, i], unrest)
                kept[RETURNS, i] = min(kept[RETURNS, i] + 1.0, SLEEPS)
                _put_back(c, before, i)
            elif kept[MOST, i] > 0:
                _wake(kept, i)


def _put_back(c: Any, before: Any, i: Any) -> None:
    """Leave a particle where it was, at rest."""
    let_know(c.memory, i, -float(c.vx[i]), -float(c.vy[i]), -float(c.vz[i]))
    c.x[i], c.y[i], c.z[i] = before[0, i], before[1, i], before[2, i]
    c.vx[i] = c.vy[i] = c.vz[i] = 0
    if c.spin is not None:
        c.spin.wx[i] = c.spin.wy[i] = c.spin.wz[i] = 0
