"""What hard contacts at rest have been given in a step, and a start from it for the next one.

Turns from pair to pair carry a push a few layers far. What lies still needs the same impulses in every step, so each step
begins with those of the last one: what turns have not found yet comes in the next steps, and a deep heap comes to rest.

Turns take energy, but a start may add some, such as to a heap that has just lost its floor, or along a row in which a
contact has opened; and turns may stop what forces turn around within the step while it parts, which then has half of their
kick less to fall from higher. So after the start, and at the end, the energy of every cluster is compared. If impulses have
changed velocities by Δv and have added

    E₁ − E₀ − W = b + ½ a > 0,    a = Σ m |Δv|² + I |Δω|²,

where W is the work of colliders and others that nothing moves, and at the end of forces on the way by which impulses
displace particles, then all of them are scaled by φ = max(−2 b/a, 0) < 1, with which they add nothing; at the end a small
part of a is left. All of them act between two particles, or at a collider, so momentum is kept.

Source: the starts of sequential impulses, E. Catto, Iterative dynamics with temporal coherence (2005).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import GIVEN, LEAST, root
from particlesim.engine.interactions.hard.bench import (
    ABOVE,
    CARRIED,
    COUNT,
    GAIN,
    LIMIT,
    OWN,
    PAIRED,
    REST,
    RUBS,
    SQUARE,
    SWERVED,
    TURN,
    WAY,
    WORK,
    farthest,
)
from particlesim.engine.interactions.hard.friction import roll_pair, turn_pair
from particlesim.engine.interactions.hard.laws import rolling_at, static_at
from particlesim.engine.interactions.hard.turns import give_pair
from particlesim.engine.interactions.hard.walls import push_at_wall, roll_at_wall, turn_at_wall
from particlesim.engine.interactions.interaction import Ints
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.crossing import EPSILON
from particlesim.engine.step.rubbing import STILL

UNNOTICED = 3e-4
"""What may be added in a step, as a part of what impulses would add one by one that are at rest, and of swifter ones as much
as at rest: as much as turns leave."""
NOISE = 8
"""In units of rounding, the part of the energy of motion that is none that has been added."""


class Known(NamedTuple):
    """What contacts at rest have been given in the last step, those of particle i in [begin[i], begin[i + 1]): `partner`
    [room], the larger row of the pair, or −1 − k for collider k; `push` [room, 3], as a change of the velocity of the first
    relative to the second [m/s]; `rolled` [room, 3], the same of rolling friction (`friction`), None without."""

    begin: Any
    partner: Any
    push: Any
    rolled: Any = None


def new_known(room: int, particles: int, dtype: Any, rolls: bool = False) -> Known:
    """Nothing is known, with room for some contacts."""
    begin, partner = np.zeros(particles + 1, np.int64), np.zeros(room, np.int32)
    return Known(begin, partner, np.zeros((room, 3), dtype), np.zeros((room, 3), dtype) if rolls else None)


def there_is(known: Known) -> tuple[Any, ...]:
    """The arrays of what is known."""
    return tuple(each for each in known if each is not None)


def with_room(known: Known, room: int) -> Known:
    """The same with room for so many contacts at least."""
    rolls = known.rolled is not None
    more = new_known(max(room, known.partner.size), known.begin.size - 1, known.push.dtype, rolls)
    for mine, theirs in zip(there_is(more), there_is(known), strict=True):
        mine[: len(theirs)] = theirs
    return more


def known_by(known: Known, place: Ints, particles: int, room: int) -> Known:
    """The same among particles of which row k has become row `place[k]`, −1 of those that are gone."""
    first = np.repeat(np.arange(known.begin.size - 1), np.diff(known.begin))
    partner = known.partner[: first.size].astype(np.int64)
    i, j = place[first], np.where(partner < 0, partner, place[np.maximum(partner, 0)])
    left = (i >= 0) & ((j >= 0) | (partner < 0))
    i, j = i[left], j[left]
    turned = (j >= 0) & (j < i)
    i, j = np.where(turned, j, i), np.where(turned, i, j)
    order = np.argsort(i, kind="stable")
    found = new_known(max(room, i.size), particles, known.push.dtype, known.rolled is not None)
    found.begin[1:] = np.cumsum(np.bincount(i, minlength=particles))
    found.partner[: i.size] = j[order]
    for there, had in zip(there_is(found)[2:], there_is(known)[2:], strict=True):
        there[: i.size] = np.where(turned, -1, 1)[order, None] * had[: first.size][left][order]
    return found


# Kernels


def recall(each: Any, c: Any, walls: Any) -> Any:
    """Begin with what contacts have been given in the last step; returns whether there is something."""
    return _recall_pairs(each, c) | _recall_walls(each, c, walls)


@outlined
def _recall_pairs(each: Any, c: Any) -> bool:
    bench, some = each.bench, False
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        u = (c.vx[i] - c.vx[j], c.vy[i] - c.vy[j], c.vz[i] - c.vz[j])
        at = root(bench.desk.cluster, i if each.a[i] > 0 else j)
        static = type_of(u[0], 0) if each.laws.friction is None else static_at(each, k)
        rolling = type_of(u[0], 0) if each.laws.rolling is None else rolling_at(each, k)
        given = _recall(each, c, k, i, j, at, u, bench.normal, k, static, rolling)
        some = some | (given > 0)
    return some


@outlined
def _recall_walls(each: Any, c: Any, walls: Any) -> bool:
    bench, some = each.bench, False
    for q in range(walls):
        # what has left a collider for a moment begins anew
        w, i = bench.wall_normal, bench.wall[q]
        lies = (w[LEAST, q] >= 0) & (w[ABOVE, q] <= 0)
        other = -1 - bench.collider[q] if lies else each.known.begin.size
        u = (c.vx[i] - w[OWN, q], c.vy[i] - w[OWN + 1, q], c.vz[i] - w[OWN + 2, q])
        at = root(bench.desk.cluster, i)
        rolling = type_of(u[0], 0) if bench.wall_rolls is None else bench.wall_rolls[0, q]
        k = each.report[COUNT] + q
        some = some | (_recall(each, c, k, i, other, at, u, w, q, w[RUBS, q], rolling) > 0)
    return some


def _recall(
    each: Any,
    c: Any,
    k: Any,
    i: Any,
    other: Any,
    cluster: Any,
    u: Any,
    normal: Any,
    q: Any,
    static: Any,
    rolling: Any,
) -> Any:
    """Begin contact k of particle i in a cluster, whose two move at u relative to each other, with what it has been given,
    as far as that pushes along its present normal, unless it comes apart. To what carries something, a blow is more."""
    known, held, given = each.known, each.bench.held, type_of(c.x[0], 0)
    change = type_of(given, REST) * each.bench.change[cluster]
    n = (normal[0, q], normal[1, q], normal[2, q])
    held[0, k] = held[1, k] = held[2, k] = held[LIMIT, k] = 0
    if known.rolled is not None:
        for axis in range(4):
            each.bench.rolled[axis, k] = 0
    apart, best = u[0] * n[0] + u[1] * n[1] + u[2] * n[2], type_of(given, 0)
    for at in range(known.begin[i], known.begin[i + 1]):
        if known.partner[at] == other:
            x, y, z = known.push[at, 0], known.push[at, 1], known.push[at, 2]
            along = x * n[0] + y * n[1] + z * n[2]
            fits = along * along / (x * x + y * y + z * z)  # of several sides of a collider the one it is
            if (along > 0) & (apart <= change) & (fits > best):
                given, best = along, fits
                x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
                part = within(x * x + y * y + z * z, static * along)
                held[0, k], held[1, k], held[2, k] = part * x, part * y, part * z
                if known.rolled is not None:
                    _recall_rolling(each, k, at, n, rolling * along)
    if given > 0:
        normal[LEAST, q] = max(normal[LEAST, q], change, type_of(given, REST) * given)
    each.bench.desk.contacts[GIVEN, k] = given
    return given


def _recall_rolling(each: Any, k: Any, at: Any, n: Any, most: Any) -> None:
    """Begin contact k with the rolling friction that is known at a place, as far as it turns across its present normal."""
    known, rolled = each.known.rolled, each.bench.rolled
    x, y, z = known[at, 0], known[at, 1], known[at, 2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    part = within(x * x + y * y + z * z, most)
    rolled[0, k], rolled[1, k], rolled[2, k] = part * x, part * y, part * z


@outlined
def remember(each: Any, walls: Any) -> None:
    """Keep what contacts have been given, for the next step."""
    bench, begin, given, pairs = (
        each.bench,
        each.known.begin,
        each.bench.desk.contacts[GIVEN],
        each.report[COUNT],
    )
    for i in range(begin.size):
        begin[i] = 0
    for k in range(pairs):
        begin[bench.rows[0, k]] += 1 if given[k] > 0 else 0
    for q in range(walls):
        begin[bench.wall[q]] += 1 if given[pairs + q] > 0 else 0
    end = 0
    for i in range(begin.size):  # where those of each begin, which moves on to where they end
        number = begin[i]
        begin[i] = end
        end += number
    for k in range(pairs):
        if given[k] > 0:
            _keep(each, k, bench.rows[0, k], bench.rows[1, k], bench.normal, k)
    for q in range(walls):
        if given[pairs + q] > 0:
            _keep(each, pairs + q, bench.wall[q], -1 - bench.collider[q], bench.wall_normal, q)
    for i in range(begin.size - 1, 0, -1):
        begin[i] = begin[i - 1]
    begin[0] = 0


def within(square: Any, most: Any) -> Any:
    """The part of a vector that is at most as long."""
    much = max(most * most, type_of(square, STILL * STILL))
    return most / np.sqrt(square) if square > much else type_of(square, 1)


def _keep(each: Any, k: Any, i: Any, other: Any, normal: Any, q: Any) -> None:
    """Keep what contact k of particle i has been given along its normal, and as much friction as goes with that."""
    known, held = each.known, each.bench.held
    at, given = known.begin[i], type_of(held[0, k], each.bench.desk.contacts[GIVEN, k])
    size = held[0, k] * held[0, k] + held[1, k] * held[1, k] + held[2, k] * held[2, k]
    part = within(size, held[LIMIT, k] * given)
    known.partner[at] = other
    for axis in range(3):
        known.push[at, axis] = given * normal[axis, q] + part * held[axis, k]
    if known.rolled is not None:
        r = each.bench.rolled
        size = r[0, k] * r[0, k] + r[1, k] * r[1, k] + r[2, k] * r[2, k]
        part = within(size, r[LIMIT, k] * given)
        for axis in range(3):
            known.rolled[at, axis] = part * r[axis, k]
    known.begin[i] = at + 1


# Starts, and what they may not add


@outlined
def note_speeds(each: Any, c: Any) -> None:
    """Keep the velocities of all particles in pairs as they are before impulses."""
    bench, s, v = each.bench, each.bench.start, c.spin
    for i in range(bench.mark.size):
        if (bench.mark[i] & PAIRED) != 0:
            s[0, i], s[1, i], s[2, i], s[WORK, i] = c.vx[i], c.vy[i], c.vz[i], 0.0
            if v is not None:
                s[3, i], s[4, i], s[5, i] = v.wx[i], v.wy[i], v.wz[i]


@outlined
def note_impulses(each: Any, c: Any, before: Any) -> None:
    """Let what comes after in the step take impulses for what was there before it, and not for what forces have done."""
    mark, s = each.bench.mark, each.bench.start
    for i in range(mark.size):
        if (mark[i] & PAIRED) != 0:
            for axis, now in enumerate((c.vx, c.vy, c.vz)):
                before[3 + axis, i] += type_of(now[i], float(now[i]) - s[axis, i])


@outlined
def start(each: Any, c: Any, walls: Any) -> None:
    """Give all contacts what they begin with."""
    bench, pairs = each.bench, each.report[COUNT]
    for k in range(pairs):
        i, j, given = bench.rows[0, k], bench.rows[1, k], type_of(c.x[0], bench.desk.contacts[GIVEN, k])
        both = each.a[i] + each.a[j]
        if (given > 0) & (both > 0):
            tx, ty, tz = bench.held[0, k], bench.held[1, k], bench.held[2, k]
            x, y, z = bench.normal[0, k], bench.normal[1, k], bench.normal[2, k]
            turn_pair(each, c, k, tx, ty, tz)
            give_pair(each, c, k, given * x + tx, given * y + ty, given * z + tz)
            if bench.rolled is not None:
                roll_pair(each, c, k, (bench.rolled[0, k], bench.rolled[1, k], bench.rolled[2, k]))
    for q in range(walls):
        i, k = bench.wall[q], pairs + q
        given = type_of(c.x[0], bench.desk.contacts[GIVEN, k])
        if given > 0:
            n = (bench.wall_normal[0, q], bench.wall_normal[1, q], bench.wall_normal[2, q])
            t = (bench.held[0, k], bench.held[1, k], bench.held[2, k])
            turn_at_wall(c, i, n, t)
            push_at_wall(each, c, q, given * n[0] + t[0], given * n[1] + t[1], given * n[2] + t[2])
            if bench.rolled is not None:
                roll_at_wall(each, c, q, (bench.rolled[0, k], bench.rolled[1, k], bench.rolled[2, k]))


@outlined
def sum_gains(each: Any, c: Any, unnoticed: Any) -> None:
    """Sum up, in each cluster, what impulses have added to the energy of motion, but for an unnoticed part of what those at
    rest would add one by one and for rounding, and what all would."""
    mark, s, cluster = each.bench.mark, each.bench.start, each.bench.desk.cluster
    for i in range(mark.size):
        if (mark[i] & PAIRED) != 0:
            s[GAIN, i] = s[SQUARE, i] = 0.0
    for i in range(mark.size):
        if ((mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            at, m, gain, square = root(cluster, i), 1.0 / float(each.a[i]), 0.0, 0.0
            rest, noise, had = REST * float(each.bench.change[at]), NOISE * EPSILON[type(c.x[0])], 0.0
            for axis, now in enumerate((c.vx, c.vy, c.vz)):
                change = float(now[i]) - s[axis, i]
                gain += change * (s[axis, i] + 0.5 * change)
                square += change * change
                had += s[axis, i] * s[axis, i]
            if c.spin is not None:
                inertia = 0.4 * float(c.r[i]) * float(c.r[i])
                for axis, now in enumerate((c.spin.wx, c.spin.wy, c.spin.wz)):
                    change = float(now[i]) - s[TURN + axis, i]
                    gain += inertia * change * (s[TURN + axis, i] + 0.5 * change)
                    square += inertia * change * change
                    had += inertia * s[TURN + axis, i] * s[TURN + axis, i]
            gain -= unnoticed * min(square, rest * rest) + noise * (had + square)
            s[GAIN, at] += m * gain
            s[SQUARE, at] += m * square


@outlined
def take_back(each: Any, c: Any, walls: Any, unnoticed: Any) -> None:
    """Scale impulses in clusters to which they have added energy, but for an unnoticed part of what those at rest would add
    one by one."""
    mark, s, some = each.bench.mark, each.bench.start, False
    sum_gains(each, c, unnoticed)
    for i in range(mark.size):  # of those that stand for a cluster: the part of impulses that stays
        if (mark[i] & PAIRED) != 0:
            gain, square = s[GAIN, i] - s[WORK, i], s[SQUARE, i]
            adds = gain > 0
            s[GAIN, i] = max(1.0 - 2.0 * gain / square, 0.0) if adds else 1.0
            s[WORK, i] *= s[GAIN, i]
            some = some | adds
    if some:
        scale_clusters(each, c, walls)


@outlined
def scale_clusters(each: Any, c: Any, walls: Any) -> None:
    """Leave of the impulses of each cluster the part that `GAIN` tells of the particle that stands for it."""
    bench, s, cluster, pairs = each.bench, each.bench.start, each.bench.desk.cluster, each.report[COUNT]
    for i in range(bench.mark.size):
        if ((bench.mark[i] & PAIRED) != 0) & (each.a[i] > 0):
            scale_speeds(c, i, s, s[GAIN, root(cluster, i)])
    for k in range(pairs):
        i, j = bench.rows[0, k], bench.rows[1, k]
        scale(bench, k, s[GAIN, root(cluster, i if each.a[i] > 0 else j)])
    for q in range(walls):
        scale(bench, pairs + q, s[GAIN, root(cluster, bench.wall[q])])


@outlined
def book_moves(each: Any, c: Any, before: Any, h: Any) -> None:
    """Note the work of forces, in each cluster, on the way by which impulses displace particles (`move_on`). Half of a kick
    counts at most: where a method moves particles by all of it, as symplectic Euler does, its velocities are half a kick
    late. What colliders have turned particles by, they have turned what moves them by, too."""
    mark, s, cluster = each.bench.mark, each.bench.start, each.bench.desk.cluster
    for i in range(mark.size):
        if (mark[i] == PAIRED) & (each.a[i] > 0):  # what a collider has thrown back does not tell of forces
            power, square, turn = 0.0, 0.0, 0.0
            for axis, now in enumerate((c.vx, c.vy, c.vz)):
                change = float(now[i]) - s[axis, i]
                power += change * (s[axis, i] - float(before[3 + axis, i]) - s[CARRIED + axis, i])
                square += change * change
                turn += change * s[SWERVED + axis, i]
            part = way_by(each.bench, c, i, np.sqrt(square), h) / h
            work = min(part, 0.5) * (power - turn) + part * turn
            s[WORK, root(cluster, i)] += work / float(each.a[i])


def way_by(bench: Any, c: Any, i: Any, speed: Any, h: Any) -> Any:
    """How long a particle moves on with the change of its velocity by impulses [s]."""
    most = h * bench.start[WAY, i]
    return min(most, farthest(bench) * float(c.r[i]) / speed) if speed > 0 else most


def scale_speeds(c: Any, i: Any, s: Any, part: Any) -> None:
    """Leave of a particle's changes in the step a part."""
    if part < 1:
        for axis, now in enumerate((c.vx, c.vy, c.vz)):
            now[i] = type_of(now[i], s[axis, i] + part * (float(now[i]) - s[axis, i]))
        if c.spin is not None:
            for axis, now in enumerate((c.spin.wx, c.spin.wy, c.spin.wz)):
                now[i] = type_of(now[i], s[TURN + axis, i] + part * (float(now[i]) - s[TURN + axis, i]))


def scale(bench: Any, k: Any, part: Any) -> None:
    """Leave of what a contact has been given a part."""
    bench.desk.contacts[GIVEN, k] = part * bench.desk.contacts[GIVEN, k]
    for axis in range(3):
        bench.held[axis, k] = type_of(bench.held[0, k], part) * bench.held[axis, k]
        if bench.rolled is not None:
            bench.rolled[axis, k] = type_of(bench.held[0, k], part) * bench.rolled[axis, k]
