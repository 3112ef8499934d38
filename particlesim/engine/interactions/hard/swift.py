"""Swift hard grains: whom a particle meets within a step that is long for its size, found before it passes it.

Contacts look at overlaps at the end of a step. Two that move relative to each other by more than `FAST` of the sum of their
radii in a step may have passed each other then. So all whose way relative to the mean of all is more than a half of that,
and those whose impacts on rigid bodies are left to this, are followed along their ways (`ways`) from impact to impact
(`swept`, `walls_ahead`; `blows`, `rebounds`), in the order of time, and of rows at one time. After an impact both go on with
the velocities that they have then, and are followed, whoever they are, also to colliders and to bodies. What colliders have
thrown back more than once is followed from the beginning (`follow_anew`). Elastic ones that have been thrown back, or on
which forces act, are followed at any speed: impacts at the end of a step know neither the velocity before a rebound nor what
forces have done until then, and nothing takes away what that gives.
Where there are few, all are that would come into each other by more than `HITS`: a blow on a row of them, as on the column
that falls on the floor, would go on by one pair in each step else, while all behind it come nearer. Among many that takes
ten times as long, and shorter steps less. What else nobody hits keeps its bits, and where nobody is followed nothing is done
but to look at that.

Ways are cut into laps, each as long as some spaces between particles, so that a particle is compared with what is near to it
at about that time. Laps and boxes only say whom to compare: impacts do not depend on them, nor on the order of neighbours.

Source: events in the order of time, B. J. Alder, T. E. Wainwright, J. Chem. Phys. 31, 459 (1959).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.barrier import meet, team_of
from particlesim.engine.interactions.hard.blows import strike
from particlesim.engine.interactions.hard.foreseen import follow_meeting, is_plain
from particlesim.engine.interactions.hard.rebounds import hit_wall, put_back
from particlesim.engine.interactions.hard.swept import (
    FAST,
    HITS,
    around,
    box_way,
    box_ways,
    find_next,
    part_of,
)
from particlesim.engine.interactions.hard.thrown import bend_ways, size_of, unexplained
from particlesim.engine.interactions.hard.walls import colliders_of
from particlesim.engine.interactions.hard.walls_ahead import find_body, find_wall
from particlesim.engine.interactions.hard.ways import (
    ALONE,
    BEGUN,
    BEND,
    COLLIDER,
    DUE,
    ELASTIC,
    ENDS,
    FOLLOWED,
    FORESEEN,
    HIT,
    IMPACTS,
    LAPS,
    LAW,
    LIES,
    LIVELY,
    MEETING,
    MOST_IMPACTS,
    PARTNER,
    SEEN,
    STRAIGHT,
    STRUCK,
    THROWN,
    TURNED,
    TURNS,
    WALL,
    Field,
    begin_anew,
    begin_as_before,
    begin_ways,
    is_member,
    place_at,
    turned_little,
)
from particlesim.engine.queue import empty, put_in_order
from particlesim.engine.state.columns import let_know, type_of

ANEW = 2
"""For HIT: that a particle has been followed anew, and nobody has hit it."""
SURELY = 4.0
"""In units of what forces give in a step, the speed of an impact that is one for certain: what rests has up to a half."""
FEW = 256
"""How many particles there are at most where all that come into each other are followed."""
MOST_LAPS = 1000
"""Laps into which a step is cut at most."""


def hasten(sets: Any, alone: bool, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
    """Have swift particles meet what is on their way in a step of h that ends at time t, by all hard contacts of an island;
    `alone`: nothing else acts between its particles. All threads come here, and impacts follow each other on one of them."""
    w = sets[0].ways
    f = Field(w, c.r, tuple(each.side for each in sets), sets[0].near.box)
    elastic = False
    for each in sets:
        elastic = elastic | (each.law.restitution >= 1)
    if share.number == 0:
        w.number[STRUCK], w.number[ALONE] = 0, 1 if alone else 0
        if w.obstacles is not None:
            type(w.obstacles).begin(w.obstacles)
        swift = some_swift(f, c, before, FAST)
        lively = (not elastic) & (w.light.size <= FEW) & (not are_heard(parts))
        lively = lively & (swift | some_swift(f, c, before, HITS))
        w.number[LIVELY], w.number[ELASTIC] = 1 if lively else 0, 1 if elastic else 0
        w.number[LAPS] = 1 if elastic | swift | lively else 0
    meet(share.gate, share.threads)
    if w.number[LAPS] > 0:
        begin_ways(f, sets[0].a, c, before, share, t, h)
        bend_ways(w, alone, parts, c, before, share, t, h)
        meet(share.gate, share.threads)
        if share.number == 0:
            w.number[LAPS] = choose(f, alone, h, elastic)
            follow_anew(f, alone, parts, c, t, h)
        meet(share.gate, share.threads)
        if w.number[FORESEEN] > 0:
            follow_meeting(sets, w, c, share, t)
            meet(share.gate, share.threads)
        laps = w.number[LAPS]
        for lap in range(laps):
            low, high = float(lap) / laps, float(lap + 1) / laps
            begin_lap(f, team_of(share), low, high)
            if share.number == 0:
                queue_followed(w)
                take_lap(f, sets, parts, c, t, h, high)
        if share.number == 0:
            go_own_ways(w, sets[0].fed)
            put_back(w, sets[0].fed, parts, c, t, h)
        meet(share.gate, share.threads)
        conclude_ways(w, c, before, share)


def are_heard(parts: Any) -> bool:
    """Whether an emitter hears of impacts on some collider: those of what others push on it, which lies there, are none."""
    return any(is_heard(part) for part in parts)


def is_heard(part: Any) -> bool:
    """Whether an emitter hears of the impacts of a group on some collider."""
    return any(c.response.heard is not None for c in colliders_of(part))


@outlined
def take_lap(f: Any, sets: Any, parts: Any, c: Any, t: Any, h: Any, high: Any) -> None:
    """All impacts until a time, one after the other."""
    w = f.ways
    while w.queue.size[0] > 0 and w.queue.due[w.queue.order[0]] <= high:
        i = w.queue.order[0]
        s, j = w.queue.due[i], w.what[PARTNER, i]
        if w.when[WALL, i] <= w.when[DUE, i]:
            if hit_wall(w, sets[0].fed, parts, c, i, t, h):
                go_on(f, parts, c, i, s, high, t, h)
            else:
                enqueue(w, i)
        elif w.what[SEEN, i] != w.what[TURNED, j]:  # the other has taken another way since
            find_next(f, i, s, high)
            enqueue(w, i)
        else:
            for law, each in enumerate(sets):
                if w.what[LAW, i] == law:
                    strike(each, c, i, j, s, t, h)
            go_on(f, parts, c, i, s, high, t, h)
            go_on(f, parts, c, j, s, high, t, h)


@outlined
def some_swift(f: Any, c: Any, before: Any, part: Any) -> bool:
    """Whether a member moves relative to the mean of all by more than a part of what lets it pass another one."""
    columns, number, least, mean = (c.x, c.y, c.z), 0, np.inf, (0.0, 0.0, 0.0)
    for i in range(c.x.size):
        if is_member(f.sides, i):
            number += 1
            mean = moved_by(mean, 1.0, tuple(float(columns[k][i]) - float(before[k, i]) for k in range(3)))
            r = float(c.r[i])
            least = r if (r > 0) & (r < least) else least
    mean, swift = mean_of(mean, number), False
    for i in range(c.x.size):
        if is_member(f.sides, i):
            d = tuple(float(columns[k][i]) - float(before[k, i]) - mean[k] for k in range(3))
            size = 0.5 * part * (float(c.r[i]) + least)
            swift = swift | (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > size * size)
            if f.ways.obstacles is not None:
                swift = swift | (f.ways.obstacles.left[i] > 0)
    return swift & ((number > 1) | (f.ways.obstacles is not None)) & (least < np.inf)


def mean_of(total: Any, number: Any) -> Any:
    """The way that ways are seen from, the mean of so many; that of one alone is seen as it is."""
    return moved_by((0.0, 0.0, 0.0), 1.0 / number if number > 1 else 0.0, total)


@shared
def choose(f: Any, alone: bool, h: Any, elastic: Any) -> int:
    """Choose those that are followed, and in how many laps: their mean way is at most half a space between particles long in
    each."""
    w, number, least, mean, widest, die = f.ways, 0, np.inf, (0.0, 0.0, 0.0), 0.0, False
    lively = w.number[LIVELY] > 0
    low, high, total = (np.inf, np.inf, np.inf), (-np.inf, -np.inf, -np.inf), 0.0
    for i in range(w.light.size):
        if w.when[ENDS, i] > 0:
            number += 1
            x, y = place_at(w, i, w.when[BEGUN, i]), place_at(w, i, w.when[ENDS, i])
            low, high = around(low, high, x)
            mean = moved_by(moved_by(mean, 1.0, y), -1.0, x)
            r = float(f.r[i])
            least = r if (r > 0) & (r < least) else least
    mean = mean_of(mean, number)
    for i in range(w.light.size):
        if w.when[ENDS, i] > 0:
            way = longest(w, i, mean, alone, h)
            if (way > 0.5 * FAST * (float(f.r[i]) + least)) | (elastic & is_unknown(w, i, alone, h)):
                w.what[FOLLOWED, i] = 1
            pulled = (w.force[0, i] != 0) | (w.force[1, i] != 0) | (w.force[2, i] != 0)
            thrown = not is_plain(w, i)
            if elastic & (pulled | thrown) & (way > 0) & (w.what[FOLLOWED, i] == 0):
                w.what[FOLLOWED, i] = 1 if thrown else MEETING
            if lively & (way > 0.5 * HITS * (float(f.r[i]) + least)) & (w.what[FOLLOWED, i] == 0):
                # what slides along colliders that bend would be thrown back by them, and lose speed
                flies = (w.what[THROWN, i] != LIES) and not is_unknown(w, i, alone, h)
                bounced = bent_by(w, i) > max(HITS * float(f.r[i]), at_rest(w, i, h), TURNS * way)
                w.what[FOLLOWED, i] = (1 if bounced else MEETING) if flies else 0
            if w.obstacles is not None and w.obstacles.left[i] > 0:
                w.what[FOLLOWED, i] = 1
            total += min(way, 1e300)
            widest, die = max(widest, way), die | (w.when[ENDS, i] < 1)
    w.number[FORESEEN] = 0
    if number == 0:
        return 1
    space = max(high[0] - low[0], 0.0) * max(high[1] - low[1], 0.0) * max(high[2] - low[2], 0.0) / number
    laps = 2.0 * total / number / max(space ** (1.0 / 3.0), 4.0 * least)
    laps = int(min(max(laps, 1.0), float(MOST_LAPS)))
    if lively:
        follow_coming(f, h)
    if elastic and (laps == 1) & (not die) & (least < np.inf):
        w.number[FORESEEN], w.reach[0], w.reach[1] = 1, widest, least
        w.reach[2], w.reach[3], w.reach[4] = mean
    elif elastic:
        for i in range(w.light.size):
            w.what[FOLLOWED, i] = abs(w.what[FOLLOWED, i])
    return laps


@outlined
def follow_coming(f: Any, h: Any) -> None:
    """Follow those of the MEETING that come into another member on straight ways."""
    w = f.ways
    for i in range(w.light.size):
        if w.what[FOLLOWED, i] == MEETING:
            for j in range(w.light.size):
                if (j != i) & (w.when[ENDS, j] > 0) & (w.what[FOLLOWED, i] == MEETING):
                    reach = float(f.r[i]) + float(f.r[j])
                    if comes_in(f, i, j, reach) > max(HITS * reach, at_rest(w, i, h), at_rest(w, j, h)):
                        w.what[FOLLOWED, i] = 1


def comes_in(f: Any, i: Any, j: Any, reach: Any) -> float:
    """How much nearer two come along their line when they meet, at the pace of a whole step; 0 if they do not [m]."""
    w = f.ways
    x, y = place_at(w, i, w.when[ENDS, i]), place_at(w, j, w.when[ENDS, j])
    d, g = (x[0] - y[0], x[1] - y[1], x[2] - y[2]), tuple(w.go[axis, i] - w.go[axis, j] for axis in range(3))
    if f.box is not None:
        d = tuple(
            x if period is None else x - period * np.rint(x / period)
            for x, period in zip(d, f.box, strict=True)
        )
    square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
    if square == 0:
        return 0.0
    nearest = (d[0] * g[0] + d[1] * g[1] + d[2] * g[2]) / square
    since = min(max(nearest, 0.0), 1.0)
    far, deep = 0.0, reach * reach
    for axis in range(3):
        far += (d[axis] - since * g[axis]) * (d[axis] - since * g[axis])
        deep -= (d[axis] - nearest * g[axis]) * (d[axis] - nearest * g[axis])
    return np.sqrt(square * deep) / reach if (far <= reach * reach) & (deep > 0) else 0.0


def at_rest(w: Any, i: Any, h: Any) -> Any:
    """How far what surely lies on something comes into it in a step at most [m]."""
    return SURELY * h * size_of((w.force[0, i], w.force[1, i], w.force[2, i]))


def follow_anew(f: Any, alone: bool, parts: Any, c: Any, t: Any, h: Any) -> None:
    """Have swift particles that colliders have thrown back more than once in the step, on ways that are not known, take them
    again, from impact to impact on colliders. They end where these lead if there is more than one. Others may come to
    bodies: those whose impacts on them are left to this, and those that colliders have thrown back once."""
    w = f.ways
    for i in range(w.light.size):
        if (w.what[FOLLOWED, i] > 0) & is_unknown(w, i, alone, h):
            begun = begin_anew(w, i, h)
            find_wall(w, parts, c, i, t, h)
            if (w.what[THROWN, i] != COLLIDER) & (w.when[WALL, i] > w.when[ENDS, i]):
                begin_as_before(w, i, begun)
            else:
                w.what[THROWN, i], w.what[HIT, i] = COLLIDER, ANEW
        elif w.obstacles is not None and w.what[FOLLOWED, i] > 0:
            if w.obstacles.left[i] > 0:
                find_body(w, c, i, w.when[BEGUN, i])
            if (w.when[BEND, i] < STRAIGHT) & (w.when[WALL, i] == np.inf):
                find_body(w, c, i, w.when[BEND, i])


def moved_by(x: Any, part: Any, y: Any) -> Any:
    """A vector and a part of another one."""
    return x[0] + part * y[0], x[1] + part * y[1], x[2] + part * y[2]


def longest(w: Any, i: Any, mean: Any, alone: bool, h: Any) -> Any:
    """How far a particle would come in a step by the faster of its legs, relative to a mean way [m]."""
    one, other = 0.0, 0.0
    for axis in range(3):
        one += (w.go[axis, i] - mean[axis]) * (w.go[axis, i] - mean[axis])
        other += (w.on[axis, i] - mean[axis]) * (w.on[axis, i] - mean[axis])
    if w.when[BEND, i] <= 1:
        one = max(one, other)
    elif is_unknown(w, i, alone, h):
        one = 0.0
        for axis in range(3):
            way = float(h) * w.first[axis, i] - mean[axis]
            one += way * way
    return np.sqrt(one)


def bent_by(w: Any, i: Any) -> Any:
    """By how much the way of a particle in a step differs before and after its bend [m]."""
    if w.when[BEND, i] == STRAIGHT:
        return 0.0
    return size_of(tuple(w.on[axis, i] - w.go[axis, i] for axis in range(3)))


def is_unknown(w: Any, i: Any, alone: bool, h: Any) -> Any:
    """Whether the way of a particle may have legs that are not known: it has been thrown back, or happens to move as a
    method does, but not as forces on it say; and more than what lies, or slides along something, is turned."""
    thrown = w.what[THROWN, i]
    known = (thrown == LIES) | ((thrown == 0) & (not alone or size_of(unexplained(w, i)) == 0))
    return (w.when[BEND, i] == STRAIGHT) & (w.light[i] > 0) & (not known) & (not turned_little(w, i, h))


# ---- the queue


@shared
def begin_lap(f: Any, team: Any, low: Any, high: Any) -> None:
    """Find the first impacts between two times of all that are followed."""
    w = f.ways
    box_ways(f, team, low, high)
    first, last = part_of(team, w.order.size)
    for place in range(first, last):
        i = w.order[place]
        if i >= 0 and w.what[FOLLOWED, i] > 0:
            find_next(f, i, low, high)
    meet(team.gate, team.threads)


@shared
def queue_followed(w: Any) -> None:
    """Queue all that are followed, and have an impact before them."""
    empty(w.queue)
    for i in range(w.light.size):
        if w.what[FOLLOWED, i] > 0:
            enqueue(w, i)


@outlined
def go_on(f: Any, parts: Any, c: Any, i: Any, s: Any, high: Any, t: Any, h: Any) -> None:
    """Follow a particle from an impact at time s on."""
    w = f.ways
    w.what[FOLLOWED, i] = 1
    box_way(f, i, s, high, w.levels.size - 1)
    find_wall(w, parts, c, i, t, h)
    find_next(f, i, s, high)
    enqueue(w, i)


def enqueue(w: Any, i: Any) -> None:
    """Put a particle where it belongs in the queue after its next impact has changed; what is there stays, and what has none
    does not come."""
    w.queue.due[i] = min(w.when[DUE, i], w.when[WALL, i])
    if w.queue.slot[i] > 0 or w.queue.due[i] < np.inf:
        put_in_order(w.queue, i)


# ---- what comes of it


@outlined
def go_own_ways(w: Any, fed: Any) -> None:
    """Have what has met nothing but colliders, and those too often, end the step as its method has it: what slides along a
    bent wall would stay where it is for ever."""
    for i in range(w.light.size):
        if (w.what[HIT, i] == ANEW) & (w.what[IMPACTS, i] >= MOST_IMPACTS):
            w.what[HIT, i] = 0
            fed[1] -= 1.0


@outlined
def conclude_ways(w: Any, c: Any, before: Any, share: Any) -> None:
    """Give all that have been hit their places and velocities. In `before` they get the velocities with which they would
    have come to these without impacts, so that what comes after does not take impacts for forces."""
    for i in range(share.first, share.last):
        if (w.what[HIT, i] == ANEW) & (w.light[i] > 0):
            # one rebound is its method's own, which knows how forces bend the way
            w.what[HIT, i] = 1 if w.what[IMPACTS, i] > 1 else 0
        if (w.what[HIT, i] > 0) & (w.light[i] > 0):
            now, w.number[STRUCK] = place_at(w, i, w.when[ENDS, i]), 1
            had = float(c.vx[i]), float(c.vy[i]), float(c.vz[i])
            for axis, (x, v) in enumerate(((c.x, c.vx), (c.y, c.vy), (c.z, c.vz))):
                # velocities that are late are so by all forces
                speed = w.speed[axis, i] + w.late[0] * w.carried[axis, i]
                x[i], v[i] = type_of(x[i], now[axis]), type_of(v[i], speed)
                before[3 + axis, i] = type_of(x[i], speed - w.force[axis, i])
            if c.spin is not None:
                for axis, spin in enumerate((c.spin.wx, c.spin.wy, c.spin.wz)):
                    spin[i] = type_of(spin[i], w.spin[axis, i])
            let_know(c.memory, i, float(c.vx[i]) - had[0], float(c.vy[i]) - had[1], float(c.vz[i]) - had[2])
