"""The ways of hard grains within a step, along which those that are swift are followed (`swift`).

A way is a chord from where the step begins to where it ends, run through at a steady pace; times are parts of the step, 0 to
1. A particle that something has thrown back in the step has a way of two legs: on from where it began with the velocity that
it had there, and back from where it ends with the one that it has then, with a bend where these come nearest to each other.
Velocities change evenly in a step, by what forces have done in all of it, and at time s there is 1 − s of that still to
come. A method may know them late, or early (`Method.lag`): what has come a way of h (v₀ + (½ + lag) Δv) had that velocity in
the middle, so at time s it has v₁ − (1 − s) Δv + lag Δv.

All numbers are of double precision: impacts of a step follow each other, and single precision would add up.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.bench import REST
from particlesim.engine.interactions.neighbours.record import level_starts
from particlesim.engine.queue import new_queue
from particlesim.engine.state.columns import held, span

BEGUN, BEND, ENDS, DUE, WALL = range(5)
"""Rows of `when`: the times at which a way begins, bends, and ends, 1 or that of a death, and of its next impacts, on
another particle and on a collider; a way bends after 1 if it does not, and ends before 0 where a particle is not there."""
TURNED, PARTNER, SEEN, IMPACTS, SIDE, FOLLOWED, THROWN, LAW, HIT = range(9)
"""Rows of `what`: how often a way has changed, with whom its next impact is, how often that one's way had changed when that
was found, how many impacts it has had in the step, which collider is next, or which body as −1 and less, whether it is
looked at where it goes, what has thrown it back before, if something has, by which of all contacts its next impact is, and
whether another particle has hit it."""
SOMETHING, COLLIDER, LIES = 1, 2, 3
"""For THROWN: that it moves as no method does, that a collider has thrown it back, and that it lies on one, or hops no
higher than what lies."""
MOST_IMPACTS = 64
"""Impacts of a particle in a step, after which it stays where it is until the end of the step."""
STRUCK, LAPS, FORESEEN, ALONE, LIVELY, ELASTIC = range(6)
"""In `number`: whether an impact has taken place in the step; in how many laps somebody is followed, 0 for nobody; whether
lists are to tell who meets somebody; whether nothing but hard contacts acts between particles; whether those are followed
that come to others, and not only by others; whether some are elastic."""
MEETING = -1
"""For FOLLOWED: that it is if it meets somebody."""
STRAIGHT = 2.0
"""The BEND of a way of one leg."""
SPINS = 9
"""Row of the state at the beginning of a step at which angular velocities begin."""
BRIEF = 1e-9
"""The part of a way below which a leg is none: rounding would make its pace."""
TURNS = 0.25
"""By how much a way has turned at most that colliders have led along, as a part of it."""
ARC = 3.0
"""1 over the part of the square of its angle by which the chord of an arc misses the mean of the velocities at its ends, at
most: of a circle it is 12, of a spiral less."""
ASTRAY = 1e-3
"""How far both legs may miss each other, as a part of the radius, and of the change of velocity times the step."""


class Ways(NamedTuple):
    """Of every particle, in double precision: where its way begins, how far it leads in a whole step, both again after its
    bend, [3, n] each [m]; its velocity at the end of the step, that without what has thrown it back, by how much forces
    change it in a whole step, and how much of that a collider carries on which it lies [3, n] [m/s]; its angular velocity at
    the end and at the beginning [3, n] [rad/s]; times [5, n], numbers [9, n]; the displacement of the image that it meets
    next [3, n] [m]; its inverse mass, 0 of what nothing moves [n] [1/kg]; what to add to its place in a periodic box for an
    image inside [3, n] [m].

    Bodies in the step (`rigid.obstacles`), None where these particles touch none, and how far the surface that each comes
    to goes in the step [m], with the normal there, and how often that body's way had
    changed then (`met` [7, n]).

    The queue of impacts, numbers of the step [6]; how far members come in it at most relative to their mean, the smallest
    radius, and that mean [5] [m]; by which part of a step velocities are late [1]. Of one
    impact: room for its friction and its rolling friction, as in `Bench` [4, 2]. Members in an order in which neighbours in
    space are neighbours [room], −1 for none, and the place of each in it [n]; how many come before a cell [cells + 1], and
    the cell of each [n]. Boxes about the ways in that order and about eight of these each, and so on [6, nodes], and
    where their levels begin.
    """

    at: Any
    go: Any
    bend: Any
    on: Any
    speed: Any
    first: Any
    force: Any
    carried: Any
    spin: Any
    spun: Any
    when: Any
    what: Any
    image: Any
    light: Any
    wrap: Any
    obstacles: Any
    met: Any
    queue: Any
    number: Any
    reach: Any
    late: Any
    held: Any
    order: Any
    place: Any
    cells: Any
    cell: Any
    boxes: Any
    levels: Any


class Field(NamedTuple):
    """The ways of all members of the hard contacts of an island, their radii [m], their sides in each of the contacts, and
    the periods of the box, None without one; and no laws."""

    ways: Ways
    r: Any
    sides: Any
    box: Any


def new_ways(particles: int, lag: float, obstacles: Any) -> Ways:
    """Room for the ways of the particles of an island, by whose method velocities are late by a part `lag` of a step, with
    bodies in their way, None if there are none."""
    at, go, bend, on, speed, first, force, carried, spin, spun = (np.zeros((3, particles)) for _ in range(10))
    levels, bits = level_starts(particles), max(particles.bit_length() // 3, 1)
    return Ways(
        *(at, go, bend, on, speed, first, force, carried, spin, spun),
        np.zeros((5, particles)),
        np.zeros((9, particles), np.int64),
        np.zeros((3, particles)),
        np.zeros(particles),
        np.zeros((3, particles)),
        obstacles,
        np.zeros((7, 0 if obstacles is None else particles)),
        new_queue(particles),
        np.zeros(6, np.int64),
        np.zeros(5),
        np.array([lag]),
        np.zeros((4, 2)),
        np.zeros(levels[1], np.int64),
        np.zeros(particles, np.int64),
        np.zeros(8**bits + 1, np.int64),
        np.zeros(particles, np.int64),
        np.zeros((6, levels[-1])),
        levels,
    )


def is_member(sides: Any, i: Any) -> Any:
    """Whether some hard contact acts on a particle."""
    found = False
    for side in sides:
        found = found | (side[i] != 0)
    return found


@outlined
def begin_ways(f: Any, a: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
    """The ways of the members of a share in a step of h that ends at time t; `a`: their inverse masses."""
    w = f.ways
    for i in range(share.first, share.last):
        for row in range(w.what.shape[0]):
            w.what[row, i] = 0
        w.when[DUE, i], w.when[WALL, i], w.when[ENDS, i] = np.inf, np.inf, -1.0
        w.carried[0, i] = w.carried[1, i] = w.carried[2, i] = 0.0
        w.light[i] = 0.0 if held(c.clock, i) else float(a[i])
        if is_member(f.sides, i):
            begin_way(f, c, before, i, t, h)


def begin_way(f: Any, c: Any, before: Any, i: Any, t: Any, h: Any) -> None:
    """The way of a particle, unless it is not there."""
    w, own = f.ways, t - float(h)
    begin, lasts = span(c.clock, i, own, t, h)
    part, rests = float(lasts) / float(h), held(c.clock, i)
    if (part > 0) | rests:
        start = min(max((begin - own) / float(h), 0.0), 1.0) if part > 0 else 0.0
        w.when[BEGUN, i], w.when[BEND, i] = start, STRAIGHT
        w.when[ENDS, i] = 1.0 if (part <= 0) | (start + part > 1 - 1e-9) else start + part
        lasts = w.when[ENDS, i] - start
        now, speed = (c.x[i], c.y[i], c.z[i]), (c.vx[i], c.vy[i], c.vz[i])
        for axis in range(3):
            w.at[axis, i] = float(now[axis] if part <= 0 else before[axis, i])
            w.go[axis, i] = (float(now[axis]) - w.at[axis, i]) / lasts if lasts > 0 else 0.0
            w.speed[axis, i] = float(speed[axis])
            w.first[axis, i] = float(before[3 + axis, i])
            w.force[axis, i] = (w.speed[axis, i] - w.first[axis, i]) / lasts if part > 0 else 0.0
            period = None if f.box is None else f.box[axis]
            w.wrap[axis, i] = 0.0 if period is None else -period * np.floor(w.at[axis, i] / period)
        if c.spin is not None:
            for axis, turns in enumerate((c.spin.wx, c.spin.wy, c.spin.wz)):
                w.spin[axis, i] = float(turns[i])
                w.spun[axis, i] = float(turns[i] if part <= 0 else before[SPINS + axis, i])


def bend_of(w: Any, i: Any, r: Any, h: Any) -> Any:
    """The part of its time after which the way of a particle with a radius r bends if it has been thrown back in a step of
    h, less than 0 if its legs do not meet; and where it bends, from where it begins [m]. In `image` is what forces change
    its velocity by in a step: so the first leg leads where it would have come, and the second one comes from where it would
    have begun. By how much these miss each other is shared as their times are: the pace of both changes by as much then,
    that of a brief one, too, of which rounding would make a fast one else."""
    lasts = w.when[ENDS, i] - w.when[BEGUN, i]
    long, one, other = lasts * float(h), lasts * (0.5 + w.late[0]), lasts * (0.5 - w.late[0])
    u = tuple(w.first[axis, i] + one * w.image[axis, i] for axis in range(3))
    v = tuple(w.speed[axis, i] - other * w.image[axis, i] for axis in range(3))
    # from where the second leg is to where the first one is at a time τ: e + τ d
    d = tuple(long * (u[axis] - v[axis]) for axis in range(3))
    e = tuple(long * v[axis] - lasts * w.go[axis, i] for axis in range(3))
    size = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    part = -(e[0] * d[0] + e[1] * d[1] + e[2] * d[2]) / size if size > 0 else -1.0
    miss = tuple(e[axis] + part * d[axis] for axis in range(3))
    astray = miss[0] * miss[0] + miss[1] * miss[1] + miss[2] * miss[2] > ASTRAY * ASTRAY * min(size, r * r)
    middle = tuple(part * (long * u[axis] - miss[axis]) for axis in range(3))
    return (-1.0 if astray | (part <= BRIEF) | (part >= 1 - BRIEF) else part), middle


def bend_way(w: Any, i: Any, r: Any, h: Any) -> None:
    """Bend the way of a particle with a radius r that has been thrown back in a step of h, unless its legs do not meet. What
    forces change its velocity by is then in `image`; where colliders have changed it by no more than twice that, or
    have led it along, it lies."""
    part, middle = bend_of(w, i, r, h)
    lasts = w.when[ENDS, i] - w.when[BEGUN, i]
    if part > 0:
        for axis in range(3):
            rest = lasts * w.go[axis, i] - middle[axis]
            w.bend[axis, i] = w.at[axis, i] + middle[axis]
            w.go[axis, i], w.on[axis, i] = middle[axis] / (part * lasts), rest / ((1.0 - part) * lasts)
        w.when[BEND, i] = w.when[BEGUN, i] + part * lasts
    if (part > 0) | (w.what[THROWN, i] == COLLIDER):
        kick, push = 0.0, 0.0
        for axis in range(3):
            by = w.speed[axis, i] - w.first[axis, i] - lasts * w.image[axis, i]
            kick, push = kick + w.image[axis, i] * w.image[axis, i], push + by * by
            w.force[axis, i] = w.image[axis, i]
            w.first[axis, i] += lasts * w.force[axis, i]
        if (part <= 0) and led(w, i, push, kick, h):
            w.what[THROWN, i] = LIES


def led(w: Any, i: Any, push: Any, kick: Any, h: Any) -> Any:
    """Whether a particle lies on colliders that have changed its velocity, or has but been led along, by the squares of that
    change and of what forces do. What has come less far than its velocities take it has not, as what is thrown back again
    and again, and happens to go on as it came. What is led along an arc of θ, up to about 1 rad, misses their mean by some
    θ²/12 of its speed: from impact to impact it would stay where it is. Among elastic ones that may be rebounds."""
    was = now = off = 0.0
    for axis in range(3):
        u, v = w.first[axis, i], w.speed[axis, i]
        miss = w.go[axis, i] / float(h) - 0.5 * (u + v)
        was, now, off = was + u * u, now + v * v, off + miss * miss
    least = min(was, now)
    most = max(REST * REST * kick, TURNS * TURNS * least)
    arc = (push <= least) & (ARC * ARC * off * least <= push * push)
    return off <= most if push <= most else arc & (w.number[ELASTIC] == 0)


def turned_little(w: Any, i: Any, h: Any) -> Any:
    """Whether the velocity of a particle has changed by no more, but for what forces do, than that of what lies or is led
    along: its way is nearly straight, whatever has turned it."""
    lasts, push, kick = w.when[ENDS, i] - w.when[BEGUN, i], 0.0, 0.0
    known = 0.0 if w.what[THROWN, i] == COLLIDER else lasts  # what forces do is in `first` then
    for axis in range(3):
        by = w.speed[axis, i] - w.first[axis, i] - known * w.image[axis, i]
        push, kick = push + by * by, kick + w.image[axis, i] * w.image[axis, i]
    return led(w, i, push, kick, h)


def begin_anew(w: Any, i: Any, h: Any) -> Any:
    """Have a particle that has been thrown back begin its way in a step of h anew, as if nothing were in it; returns what it
    began with (`begin_as_before`)."""
    begun = tuple(
        (w.go[axis, i], w.speed[axis, i], w.spin[axis, i], w.force[axis, i], w.first[axis, i])
        for axis in range(3)
    )
    lasts = w.when[ENDS, i] - w.when[BEGUN, i]
    for axis in range(3):
        if w.what[THROWN, i] != COLLIDER:
            w.force[axis, i] = w.image[axis, i]
            w.first[axis, i] += lasts * w.force[axis, i]
        w.speed[axis, i], w.spin[axis, i] = w.first[axis, i], w.spun[axis, i]
        w.go[axis, i] = float(h) * (w.speed[axis, i] - (0.5 - w.late[0]) * lasts * w.force[axis, i])
    w.what[TURNED, i] += 1
    return begun


def begin_as_before(w: Any, i: Any, begun: Any) -> None:
    """Undo `begin_anew`."""
    for axis in range(3):
        w.go[axis, i], w.speed[axis, i], w.spin[axis, i], w.force[axis, i], w.first[axis, i] = begun[axis]


def leg_of(w: Any, i: Any, s: Any) -> Any:
    """On which leg of its way a particle is from time s on: when that began, where, and how far it leads in a step."""
    if s < w.when[BEND, i]:
        return (
            w.when[BEGUN, i],
            (w.at[0, i], w.at[1, i], w.at[2, i]),
            (w.go[0, i], w.go[1, i], w.go[2, i]),
        )
    return (
        w.when[BEND, i],
        (w.bend[0, i], w.bend[1, i], w.bend[2, i]),
        (w.on[0, i], w.on[1, i], w.on[2, i]),
    )


def place_at(w: Any, i: Any, s: Any) -> Any:
    """Where a particle is at time s."""
    begun, x, go = leg_of(w, i, s)
    by = s - begun
    return x[0] + by * go[0], x[1] + by * go[1], x[2] + by * go[2]


def stand_at(w: Any, i: Any, s: Any, h: Any) -> None:
    """Have the way of a particle begin at time s of a step of h, with what is left of its leg, and nothing after that. Where
    it had been thrown back after that time, it has the velocities of before; what lies has that of its way (`rise`)."""
    begun, x, go = leg_of(w, i, s)
    by = s - begun
    for axis in range(3):
        w.at[axis, i], w.go[axis, i] = x[axis] + by * go[axis], go[axis]
        if w.when[BEND, i] < STRAIGHT and s < w.when[BEND, i]:
            w.speed[axis, i], w.spin[axis, i] = w.first[axis, i], w.spun[axis, i]
    if w.what[THROWN, i] == LIES:
        rise(w, i, s, by, h)
    w.when[BEGUN, i], w.when[BEND, i] = s, STRAIGHT
    w.what[THROWN, i] = min(w.what[THROWN, i], COLLIDER)
    w.what[TURNED, i] += 1


def rise(w: Any, i: Any, s: Any, since: Any, h: Any) -> None:
    """Have forces act again on a particle that has lain on a collider, or hopped low, from time s of a step of h on, `since`
    so long. It goes at the mean pace of its step, or as fast as its energy allows: it has had u at the beginning, and
    what forces have done on its way since."""
    lasts, left = w.when[ENDS, i] - w.when[BEGUN, i], w.when[ENDS, i] - s
    most, square = 0.0, 0.0
    for axis in range(3):
        u, pace = w.first[axis, i] - (lasts - w.late[0]) * w.force[axis, i], w.go[axis, i] / float(h)
        most += u * u + 2.0 * since * pace * w.force[axis, i]
        square += pace * pace
    part = min(np.sqrt(max(most, 0.0) / square), 1.0) if square > 0 else 1.0
    for axis in range(3):
        v, force = part * w.go[axis, i] / float(h), w.force[axis, i]
        w.speed[axis, i] = v + (left - w.late[0]) * force
        w.go[axis, i] = float(h) * (v + 0.5 * left * force)


def carry(w: Any, i: Any, s: Any, n: Any) -> None:
    """Have a collider with a normal n carry a particle that lies on it from time s on: forces do not press it into that."""
    pressed = -(w.force[0, i] * n[0] + w.force[1, i] * n[1] + w.force[2, i] * n[2])
    if pressed > 0:
        left = w.when[ENDS, i] - s - w.late[0]
        for axis in range(3):
            w.force[axis, i] += pressed * n[axis]
            w.speed[axis, i] += left * pressed * n[axis]
            w.carried[axis, i] += pressed * n[axis]


def let_go(w: Any, i: Any, s: Any, h: Any) -> None:
    """Have all forces act again on a particle from time s of a step of h on, and bend its way, unless it stays."""
    left = w.when[ENDS, i] - s
    for axis in range(3):
        by = w.carried[axis, i]
        if (by != 0) & (w.what[IMPACTS, i] < MOST_IMPACTS):
            w.force[axis, i] -= by
            w.speed[axis, i] -= (left - w.late[0]) * by
            w.go[axis, i] -= 0.5 * left * float(h) * by
            w.carried[axis, i] = 0.0


def velocity_at(w: Any, i: Any, s: Any) -> Any:
    """The velocity of a particle at time s, when forces have not yet done all that they do in the step [m/s]."""
    late = w.when[ENDS, i] - s - w.late[0]
    return (
        w.speed[0, i] - late * w.force[0, i],
        w.speed[1, i] - late * w.force[1, i],
        w.speed[2, i] - late * w.force[2, i],
    )


def excess(w: Any, i: Any, s: Any, h: Any) -> Any:
    """By how much a way from time s of a step of h on gives a particle more energy than forces do along it, over its mass
    [J/kg]."""
    left, v, more = w.when[ENDS, i] - s, velocity_at(w, i, s), 0.0
    for axis in range(3):
        force = w.force[axis, i]
        more += force * (v[axis] + 0.5 * left * force) - (force - w.carried[axis, i]) * w.go[axis, i] / float(
            h
        )
    return left * more


def stay(w: Any, i: Any, s: Any, h: Any) -> Any:
    """Have a particle stay where its way begins, at time s of a step of h; as if time stood still, nothing acts on it, too.
    Returns the energy that it ends with and would not have had, over its mass: where others had turned its way [J/kg]."""
    more = -excess(w, i, s, h)
    for axis in range(3):
        w.speed[axis, i] -= (w.when[ENDS, i] - s - w.late[0]) * w.force[axis, i]
        w.carried[axis, i] -= w.force[axis, i]
        w.go[axis, i] = w.force[axis, i] = 0.0
    return max(more, 0.0)
