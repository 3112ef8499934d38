"""Turns from pair to pair, in which hard contacts get the impulses of a step (`impulses`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import (
    ALONG,
    FOUND,
    GIVEN,
    LEAST,
    PARTING,
    PARTS,
    ROOM,
    STANDS,
    join,
    root,
)
from particlesim.engine.interactions.hard.bench import (
    ABOVE,
    ARM,
    CARRIED,
    CLOSES,
    COUNT,
    FREE,
    KEPT,
    LATER,
    NEAR,
    PAIRED,
    REST,
    SHARE,
    SPINS,
    STILL,
    SWERVED,
    THROWN,
    WAY,
    WORK,
    farthest,
)
from particlesim.engine.interactions.hard.friction import coupled, hold_pair, hold_rolling
from particlesim.engine.interactions.hard.laws import bounces_of, restitution_at, static_at
from particlesim.engine.interactions.hard.ways import HIT, STRUCK
from particlesim.engine.interactions.pressing import cross
from particlesim.engine.interactions.touching import line_between, overlap_at
from particlesim.engine.state.columns import type_of

SETTLED, CALM = 1e-3, 1e-9
"""Approaches that turns end with, as a part of the largest that forces have brought about in the step, and of the fastest
that there is."""
BLOW = 1e3
"""How many times as fast as what rebounds at least is what only hits, and leaves nothing for rest."""
MIDDLE = 0.5
"""When an impact takes place, as a part of what forces do in its step."""
NOISE, OTHER = 1e-6, 0.1
"""Ways in a step, as parts of how far from the origin they are, that say nothing; by how much the one of a particle that has
hit something differs from that of a method, as a part of it."""
TOUCHED, CALMLY = 1e-6, 0.25
"""Gap, as a part of the smaller radius, below which two have touched; how fast they may have been then to be at rest, as a
part of what forces give in the step."""
ANY = 1e30
"""Least speed of a rebound of what does not touch [m/s]."""
BLOWS = 24
"""Turns between friction and rolling friction of a blow, each of which leaves 5/7 of what both lack, or less."""
GENTLY = 0.02
"""The part of the smaller radius by which a step makes an overlap smaller at most."""


LATE = 2 / 3
"""From how far on impulses move a pair apart, over what they change its velocity by times the step, it is held as it is at
the end of the step: what is left of its velocity by 1/r - 1, with another sign, is halved at least."""
LESS = 5e-5
"""Overlap, as a part of the smaller radius, that this takes in a step at most: half of the slack (`apart`)."""


@outlined
def mark_pairs(each: Any) -> None:
    """Mark all particles that are in a pair, and those that have been hit within the step."""
    bench, w = each.bench, each.ways
    struck = w.number[STRUCK] > 0
    for i in range(bench.mark.size):
        bench.mark[i] = THROWN if struck and w.what[HIT, i] > 0 else 0
        for row in range(CARRIED, SWERVED + 3):
            bench.start[row, i] = 0.0
    for k in range(each.report[COUNT]):
        for i in (bench.rows[0, k], bench.rows[1, k]):
            bench.mark[i] = bench.mark[i] | PAIRED


@outlined
def look_at(each: Any, c: Any, before: Any, walls: Any, h: Any) -> Any:
    """Normals of all pairs, clusters, and from which speed on each contact rebounds; returns the approach that turns end
    with.

    What lies on something approaches others by what forces do, along the normal, or by impulses that pass on what they do
    elsewhere in its cluster. What flies feels only differences of forces.
    """
    bench, rest, most = each.bench, type_of(c.x[0], REST), type_of(c.x[0], 0)
    fastest, usual = most, MIDDLE
    join(bench, each.a, each.report[COUNT], walls)
    cluster, change = bench.desk.cluster, bench.change
    for k in range(each.report[COUNT]):
        change[bench.rows[0, k]] = change[bench.rows[1, k]] = 0
    for i in range(bench.mark.size):
        if bench.mark[i] == PAIRED:  # and not thrown back: how fast says nothing about forces
            way = way_of(c, before, i, float(h), swerve_of(bench, i))
            if way < 0:
                bench.mark[i] = PAIRED | THROWN
            else:
                x, y, z = c.vx[i] - before[3, i], c.vy[i] - before[4, i], c.vz[i] - before[5, i]
                at = root(cluster, i)
                change[at] = max(change[at], np.sqrt(x * x + y * y + z * z))
                usual = bench.start[WAY, i] = way
    for i in range(bench.mark.size):
        if (bench.mark[i] & PAIRED) != 0:
            for axis, now in enumerate((c.vx, c.vy, c.vz)):
                bench.faster[axis, i] = 0.5 * float(now[i] - before[3 + axis, i]) if each.a[i] <= 0 else 0.0
    for i in range(bench.mark.size):
        if (bench.mark[i] & THROWN) != 0:
            bench.start[WAY, i] = max(usual - MIDDLE, 0.0)
    for q in range(walls):  # hops that are as short as what forces bring about in a step are rest
        n, at = bench.wall_normal, root(cluster, bench.wall[q])
        if (n[LEAST, q] == FREE) & (n[ABOVE, q] < rest * type_of(most, h) * change[at]):
            n[LEAST, q] = rest * change[at]
            n[ALONG, q] -= n[ABOVE, q] / type_of(most, CLOSES * h)
            cluster[STANDS, at] = 1
        elif (n[LEAST, q] > 0) & ((bench.mark[bench.wall[q]] & THROWN) != 0) & (change[at] > 0):
            n[LEAST, q] = rest * change[at]
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        bench.shift[0, k] -= c.x[i] - c.x[j]
        bench.shift[1, k] -= c.y[i] - c.y[j]
        bench.shift[2, k] -= c.z[i] - c.z[j]
        size = h * _most_given(each, c, before, k)
        if size > 0:  # how far an impact might move them
            bench.start[WAY, i] = min(bench.start[WAY, i], farthest(bench) * float(c.r[i]) / size)
            bench.start[WAY, j] = min(bench.start[WAY, j], farthest(bench) * float(c.r[j]) / size)
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        x, y, z, far = line_when(bench, c, i, j, k, h)
        bench.normal[0, k], bench.normal[1, k], bench.normal[2, k] = x, y, z
        note_parts(each, c, k, far / (c.r[i] + c.r[j]))
        began = overlap_at(c, (before[0], before[1], before[2]), i, j, bench.shift[:, k])
        _, _, _, ends = line_between(c, i, j, bench.shift, k)
        gently = type_of(most, GENTLY) * min(c.r[i], c.r[j])
        bench.normal[KEPT, k] = max(min(began, c.r[i] + c.r[j] - ends) - gently, gently - gently)
        now = (c.vx[i] - c.vx[j]) * x + (c.vy[i] - c.vy[j]) * y + (c.vz[i] - c.vz[j]) * z
        mine, other = changed_along(bench, c, before, i, x, y, z), changed_along(bench, c, before, j, x, y, z)
        # where impulses displace less than that, forces have done as much less on the way
        part = MIDDLE - usual + bench.start[WAY, i]
        later = part * float(mine) - (MIDDLE - usual + bench.start[WAY, j]) * float(other)
        at = root(cluster, i if each.a[i] > 0 else j)
        stands = cluster[STANDS, at] > 0
        least = rest * (max(abs(mine), abs(other)) if stands else abs(mine - other))
        reach = _reach(each, k)
        late = _swerved(bench, k) if reach > LATE else now - now
        square = (c.vx[i] - c.vx[j]) ** 2 + (c.vy[i] - c.vy[j]) ** 2 + (c.vz[i] - c.vz[j]) ** 2 - now * now
        # as far as turns find it, the line of the two turns in the step, or walls turn them
        bent = max(abs(late), h * square / (c.r[i] + c.r[j])) > type_of(most, SETTLED) * change[at]
        if stands & (late - now <= least):
            least = rest * change[at]
        room = max(ends - c.r[i] - c.r[j], gently - gently) / type_of(most, CLOSES * h)
        bench.normal[ROOM, k] = room
        if room > 0:  # which rests, or will hit in the next step
            near = ends - c.r[i] - c.r[j] <= type_of(most, NEAR * h) * change[at]
            if (-now > least) | ((not near) & (restitution_at(each, k) > 0)):
                bench.normal[PARTS, k] = bench.normal[PARTS + 1, k] = 0
            if not (near | stands):  # a neighbour that nobody presses on it
                bench.normal[KEPT, k] = ANY
            least = type_of(most, ANY)
        elif (-now <= least) & (restitution_at(each, k) < 1):  # the fall of a step has hidden the gap
            bench.normal[ROOM, k] = _gap_when_held(bench, c, before, k, h) / type_of(most, CLOSES * h)
            bench.normal[ROOM, k] -= _swerved(bench, k)
        if (reach > LATE) & bent & (late - now <= least) & (restitution_at(each, k) < 1):
            # touch at the end of the step: then they part at its beginning as fast as they approach after impulses
            less = min(type_of(most, LESS) * min(c.r[i], c.r[j]), type_of(most, h / CLOSES) * change[at])
            gap = ends - c.r[i] - c.r[j] + max(began - less, gently - gently)
            bench.normal[ROOM, k] = gap / type_of(most, h * reach) - now
        bench.normal[LEAST, k], bench.normal[PARTING, k] = least + max(-late, late - late), 0
        bench.normal[STILL, k] = _rested(c, before, i, j, (x, y, z), began, abs(mine - other))
        bench.normal[LATER, k] = type_of(least, -later)
        most, fastest = max(most, abs(mine - other)), max(fastest, -now)
    for q in range(walls):
        n, i = bench.wall_normal, bench.wall[q]
        rate = c.vx[i] * n[0, q] + c.vy[i] * n[1, q] + c.vz[i] * n[2, q] - n[ALONG, q]
        if (n[LEAST, q] >= 0) & (-rate <= n[LEAST, q]):
            n[LEAST, q] = max(n[LEAST, q], rest * change[root(cluster, i)])
    return max(type_of(most, SETTLED) * most, type_of(most, CALM) * fastest)


def _reach(each: Any, k: Any) -> Any:
    """By how much impulses move pair k apart in a step, over what they change their velocities by times the step."""
    bench = each.bench
    i, j = bench.rows[0, k], bench.rows[1, k]
    both = each.a[i] + each.a[j]
    return (each.a[i] * bench.start[WAY, i] + each.a[j] * bench.start[WAY, j]) / both if both > 0 else 0.0


def _swerved(bench: Any, k: Any) -> Any:
    """By how much colliders along which the two of pair k slide turn their velocities apart after impulses have acted [m/s]:
    a half of what they do so in the step, where that is in its middle."""
    n, s, i, j = bench.normal, bench.start, bench.rows[0, k], bench.rows[1, k]
    wi, wj = s[WAY, i], s[WAY, j]
    x, y, z = (wi * s[SWERVED + axis, i] - wj * s[SWERVED + axis, j] for axis in range(3))
    return type_of(n[0, k], float(n[0, k]) * x + float(n[1, k]) * y + float(n[2, k]) * z)


def _rested(c: Any, before: Any, i: Any, j: Any, n: Any, began: Any, kick: Any) -> Any:
    """1 where two touched at the beginning of the step, and moved along their normal n by less than a part of what forces
    give in it; else 0."""
    u = tuple(before[3 + axis, i] - before[3 + axis, j] for axis in range(3))
    rate, one = u[0] * n[0] + u[1] * n[1] + u[2] * n[2], type_of(began, 1)
    touched = began >= type_of(began, -TOUCHED) * min(c.r[i], c.r[j])
    return one if touched & (abs(rate) <= type_of(began, CALMLY) * kick) else one - one


def note_parts(each: Any, c: Any, k: Any, arm: Any) -> None:
    """Note how impulses change the velocities of both of pair k; `arm`: the distance of their centres over both radii."""
    n, i, j = each.bench.normal, each.bench.rows[0, k], each.bench.rows[1, k]
    wi, wj, both = each.a[i], each.a[j], each.a[i] + each.a[j]
    n[PARTS, k], n[PARTS + 1, k] = (wi / both, wj / both) if both > 0 else (wi, wj)
    n[SHARE, k] = 1
    if c.spin is not None:
        spins = type_of(arm, 2.5) * arm
        n[ARM, k], n[SHARE, k] = arm, type_of(arm, 1) / (type_of(arm, 1) + spins * arm)
        n[SPINS, k], n[SPINS + 1, k] = spins * n[PARTS, k] / c.r[i], spins * n[PARTS + 1, k] / c.r[j]


def _most_given(each: Any, c: Any, before: Any, k: Any) -> float:
    """How much an impulse changes the relative velocity of pair k at most, if nothing else acts on it [m/s]: twice the speed
    in an impact; at rest what takes the approach along the line of centres, at either end of the step, and friction. By how
    fast it slides along the other one what rests is not moved: were it moved less than forces have moved it, it would fall
    into that one, and each lift out of it would be energy."""
    bench, i, j, s = each.bench, each.bench.rows[0, k], each.bench.rows[1, k], each.bench.start
    v = float(c.vx[i] - c.vx[j]), float(c.vy[i] - c.vy[j]), float(c.vz[i] - c.vz[j])
    x, y, z, _ = line_between(c, i, j, bench.shift, k)
    most = max(-(v[0] * float(x) + v[1] * float(y) + v[2] * float(z)), 0.0)
    dx, dy, dz = (float(before[axis, i] - before[axis, j] + bench.shift[axis, k]) for axis in range(3))
    apart = np.sqrt(dx * dx + dy * dy + dz * dz)
    if apart > 0:
        ux, uy, uz = (v[axis] - s[SWERVED + axis, i] + s[SWERVED + axis, j] for axis in range(3))
        most = max(most, -(ux * dx + uy * dy + uz * dz) / apart)
    mine, other = changed_along(bench, c, before, i, x, y, z), changed_along(bench, c, before, j, x, y, z)
    speed = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if most > REST * float(abs(mine - other)):
        return 2 * speed  # an impact, in a line that turns in the step
    if each.laws.friction is not None:
        slide = min(float(static_at(each, k)) * most, speed)
        most = np.sqrt(most * most + slide * slide)
    return most


def _gap_when_held(bench: Any, c: Any, before: Any, k: Any, h: Any) -> Any:
    """The gap that pair k would have at the end of the step without what forces have done in it [m]; 0 if it touches."""
    i, j = bench.rows[0, k], bench.rows[1, k]
    x, y, z = (
        here[i]
        - here[j]
        + bench.shift[axis, k]
        - _given(bench, now, then, i, axis, h)
        + _given(bench, now, then, j, axis, h)
        for axis, (here, now, then) in enumerate(
            ((c.x, c.vx, before[3]), (c.y, c.vy, before[4]), (c.z, c.vz, before[5]))
        )
    )
    return max(np.sqrt(x * x + y * y + z * z) - c.r[i] - c.r[j], type_of(x, 0))


def _given(bench: Any, now: Any, then: Any, i: Any, axis: int, h: Any) -> Any:
    """How far forces have moved particle i along an axis in the step [m]: not what colliders along which it slides have."""
    turned = type_of(h, bench.start[SWERVED + axis, i])
    return h * (type_of(h, bench.start[WAY, i]) * (now[i] - then[i] - turned) + type_of(h, 0.5) * turned)


def line_when(bench: Any, c: Any, i: Any, j: Any, k: Any, h: Any) -> Any:
    """From particle j to particle i of pair k where they are when the impulses of the step act: the unit vector, along x for
    coincident centres, and the distance."""
    x = c.x[i] - c.x[j] + bench.shift[0, k] - _since(bench, c.vx, i, 0, h) + _since(bench, c.vx, j, 0, h)
    y = c.y[i] - c.y[j] + bench.shift[1, k] - _since(bench, c.vy, i, 1, h) + _since(bench, c.vy, j, 1, h)
    z = c.z[i] - c.z[j] + bench.shift[2, k] - _since(bench, c.vz, i, 2, h) + _since(bench, c.vz, j, 2, h)
    r = np.sqrt(x * x + y * y + z * z)
    apart = r > 0
    by = type_of(r, 1) / r if apart else type_of(r, 0)
    return by * x if apart else type_of(r, -1), by * y, by * z, r


def _since(bench: Any, now: Any, i: Any, axis: int, h: Any) -> Any:
    """How far particle i has gone along an axis since the impulses of the step act [m]."""
    way = bench.start[WAY, i]
    return type_of(h, h * way) * (now[i] - type_of(h, 0.5 * way * bench.start[SWERVED + axis, i]))


def swerve_of(bench: Any, i: Any) -> Any:
    """By how much colliders along which a particle slides have turned its velocity in the step [m/s]."""
    s = bench.start
    return s[SWERVED, i], s[SWERVED + 1, i], s[SWERVED + 2, i]


def way_of(c: Any, before: Any, i: Any, h: float, turned: Any) -> float:
    """How far forces have moved a particle in the step over what they have changed its velocity by times the step, which is
    a property of the method: 0, a half, or 1; less than 0 where it moves as no method does, and has been thrown back.
    `turned`: how much of that change a collider has made along which it slides."""
    u, v, w = float(before[3, i]), float(before[4, i]), float(before[5, i])
    dx = h * (float(c.vx[i]) - u - turned[0])
    dy = h * (float(c.vy[i]) - v - turned[1])
    dz = h * (float(c.vz[i]) - w - turned[2])
    x = float(c.x[i]) - float(before[0, i]) - h * (u + 0.5 * turned[0])
    y = float(c.y[i]) - float(before[1, i]) - h * (v + 0.5 * turned[1])
    z = float(c.z[i]) - float(before[2, i]) - h * (w + 0.5 * turned[2])
    size = dx * dx + dy * dy + dz * dz
    far = abs(float(c.x[i])) + abs(float(c.y[i])) + abs(float(c.z[i])) + h * (abs(u) + abs(v) + abs(w))
    known = size > NOISE * NOISE * far * far
    part = (x * dx + y * dy + z * dz) / size if known else MIDDLE
    way = 0.0 if part < 0.25 else (0.5 if part < 0.75 else 1.0)
    x, y, z = x - way * dx, y - way * dy, z - way * dz
    return -1.0 if known & (x * x + y * y + z * z > OTHER * OTHER * size) else way


def changed_along(bench: Any, c: Any, before: Any, i: Any, x: Any, y: Any, z: Any) -> Any:
    """By how much the velocity of a particle along a normal has changed in the step, unless a collider has thrown it."""
    change = (c.vx[i] - before[3, i]) * x + (c.vy[i] - before[4, i]) * y + (c.vz[i] - before[5, i]) * z
    return change - change if (bench.mark[i] & THROWN) != 0 else change


@outlined
def give_impulses(each: Any, c: Any, backwards: Any) -> Any:
    """A turn through all pairs; returns the largest change of a speed along a normal [m/s], and the sum of their squares."""
    bench, number, worst, squares = each.bench, each.report[COUNT], type_of(c.x[0], 0), 0.0
    for q in range(number):
        k = number - 1 - q if backwards else q
        i, j = bench.rows[0, k], bench.rows[1, k]
        x, y, z = bench.normal[0, k], bench.normal[1, k], bench.normal[2, k]
        vx, vy, vz = c.vx[i] - c.vx[j], c.vy[i] - c.vy[j], c.vz[i] - c.vz[j]
        approach, e = -(vx * x + vy * y + vz * z), restitution_at(each, k)
        given = type_of(e, bench.desk.contacts[GIVEN, k])
        lacks = approach - bench.normal[ROOM, k]
        if ((lacks > 0) | (given > 0)) & (bench.normal[PARTS, k] + bench.normal[PARTS + 1, k] > 0):
            # what is elastic comes to no rest, as its hops do not end; but it may be at rest
            lively = approach > bench.normal[LEAST, k]
            lively |= (e >= 1) & (approach > 0) & (bench.normal[STILL, k] == 0)
            later = bench.normal[LATER, k] if lively else e - e
            bounces = bounces_of(each, k, approach - later)
            blow = blow_at(bench, i if each.a[i] > 0 else j, bench.normal[LEAST, k]) if lively else e - e
            change, push = given_at(bench, k, bench.normal, k, lacks, later, bounces, lively, blow)
            if lively:
                bench.normal[LATER, k] = 0
            worst = max(worst, abs(change))
            squares += float(change) * float(change)
            dx, dy, dz = change * x, change * y, change * z
            if each.laws.friction is not None:
                slide = (vx + approach * x, vy + approach * y, vz + approach * z)
                tx, ty, tz = hold_pair(each, c, k, slide, push)
                dx, dy, dz = dx + tx, dy + ty, dz + tz
            give_pair(each, c, k, dx, dy, dz)
            if bench.rolled is not None:
                hold_rolling(each, c, k, push)
                if lively and coupled(each, c, k):
                    rub_and_roll(each, c, k, push)
    return worst, squares


def blow_at(bench: Any, i: Any, least: Any) -> Any:
    """From which speed on a contact of particle i only hits, and leaves nothing for rest [m/s]. Across what forces do, where
    what rebounds may be slow, others push with what they do elsewhere in the cluster."""
    cluster = bench.desk.cluster
    at = root(cluster, i)
    rests = type_of(least, REST) * bench.change[at] if cluster[STANDS, at] > 0 else least
    return type_of(least, BLOW) * max(least, rests)


def given_at(
    bench: Any, k: Any, normal: Any, q: Any, approach: Any, later: Any, e: Any, lively: Any, blow: Any
) -> Any:
    """What contact k gets along its normal at an approach, and how much it has been pushed in all, as changes of the speed
    [m/s]. What is `lively` rebounds, from the approach that it has in the middle of what forces do in the step: `later`
    comes after that, and ends at rest at least. What has pushed too much at rest takes it back, but no rebound."""
    given, parts = type_of(e, bench.desk.contacts[GIVEN, k]), normal[PARTING, q]
    if lively:
        change = max((approach - later) + e * (approach - later), approach)
        normal[PARTING, q] = max(parts, change - approach)
        if (e < 1) & (approach < blow):
            bench.desk.contacts[GIVEN, k] = given + approach
        else:
            bench.held[0, k] = bench.held[1, k] = bench.held[2, k] = 0  # friction of each blow by itself
            if bench.rolled is not None:
                bench.rolled[0, k] = bench.rolled[1, k] = bench.rolled[2, k] = 0
        return change, given + change
    change = max(approach if approach > 0 else min(approach + parts, e - e), -given)
    bench.desk.contacts[GIVEN, k] = given + change
    return change, given + change


def give_pair(each: Any, c: Any, k: Any, dx: Any, dy: Any, dz: Any) -> None:
    """Change the velocity of the first of pair k relative to the second [m/s]."""
    bench, i, j = each.bench, each.bench.rows[0, k], each.bench.rows[1, k]
    mine, other = bench.normal[PARTS, k], bench.normal[PARTS + 1, k]
    if (mine <= 0) != (other <= 0):
        book_work(each, c, k, dx, dy, dz)
    give(c, i, mine, dx, dy, dz)
    give(c, j, -other, dx, dy, dz)


@outlined
def book_work(each: Any, c: Any, k: Any, dx: Any, dy: Any, dz: Any) -> None:
    """Note the work of the one of pair k that nothing moves."""
    i, j = each.bench.rows[0, k], each.bench.rows[1, k]
    if each.a[i] + each.a[j] > 0:
        at, moved, sign = (i, j, -1.0) if each.a[i] <= 0 else (j, i, 1.0)
        x, y, z = surface_of(each, c, k, at)
        f = each.bench.faster
        x, y, z = x - f[0, at], y - f[1, at], z - f[2, at]
        work = sign * (float(dx) * x + float(dy) * y + float(dz) * z) / float(each.a[i] + each.a[j])
        each.bench.start[WORK, root(each.bench.desk.cluster, moved)] += work


def surface_of(each: Any, c: Any, k: Any, i: Any) -> Any:
    """The velocity of the surface of particle i of pair k where the two touch [m/s]."""
    bench, x, y, z = each.bench, float(c.vx[i]), float(c.vy[i]), float(c.vz[i])
    if c.spin is not None:
        n = (float(bench.normal[0, k]), float(bench.normal[1, k]), float(bench.normal[2, k]))
        u = cross((float(c.spin.wx[i]), float(c.spin.wy[i]), float(c.spin.wz[i])), n)
        arm = float(bench.normal[ARM, k]) * float(c.r[i])
        arm = -arm if i == bench.rows[0, k] else arm
        x, y, z = x + arm * u[0], y + arm * u[1], z + arm * u[2]
    return x, y, z


def give(c: Any, i: Any, part: Any, x: Any, y: Any, z: Any) -> None:
    """Change the velocity of a particle by a part of something."""
    c.vx[i] += part * x
    c.vy[i] += part * y
    c.vz[i] += part * z


@outlined
def push_pairs(each: Any, c: Any, pairs: Any) -> None:
    """Give all pairs the impulses that have been found at once."""
    bench = each.bench
    for k in range(pairs):
        change = type_of(c.x[0], bench.desk.contacts[FOUND, k])
        if change != 0:
            n = bench.normal
            give_pair(each, c, k, change * n[0, k], change * n[1, k], change * n[2, k])


def rub_pair(each: Any, c: Any, k: Any, given: Any) -> None:
    """Bring the friction of pair k up to what it has been given along the normal."""
    bench, i, j = each.bench, each.bench.rows[0, k], each.bench.rows[1, k]
    x, y, z = bench.normal[0, k], bench.normal[1, k], bench.normal[2, k]
    vx, vy, vz = c.vx[i] - c.vx[j], c.vy[i] - c.vy[j], c.vz[i] - c.vz[j]
    rate = vx * x + vy * y + vz * z
    slide = (vx - rate * x, vy - rate * y, vz - rate * z)
    tx, ty, tz = hold_pair(each, c, k, slide, given)
    give_pair(each, c, k, tx, ty, tz)


@outlined
def rub_and_roll(each: Any, c: Any, k: Any, push: Any) -> None:
    """Friction and rolling friction of the blow of pair k, by turns: what rests does so from step to step."""
    for _ in range(BLOWS):
        rub_pair(each, c, k, push)
        hold_rolling(each, c, k, push)


@outlined
def rub_pairs(each: Any, c: Any, pairs: Any) -> None:
    """Friction of all pairs that push each other at rest."""
    bench = each.bench
    for k in range(pairs):
        given = type_of(c.x[0], bench.desk.contacts[GIVEN, k])
        if given > 0:
            rub_pair(each, c, k, given)
            if bench.rolled is not None:
                hold_rolling(each, c, k, given)
