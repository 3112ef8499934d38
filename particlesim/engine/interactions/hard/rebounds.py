"""Impacts of swift hard grains on colliders and on rigid bodies in the midst of a step (`swift`).

They get the rebound that the collider gives, or what a pair in turns gets, with the velocities of that time, and go on
beside what they have met, by which they are carried if forces press them on it. Colliders that move, that somebody hears of,
or at which they are to stick or to vanish, are left to the next step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.response import bounce_at, rebound
from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.bench import REST
from particlesim.engine.interactions.hard.blows import add, dot, minus, pay_along, push, rest, row, tire
from particlesim.engine.interactions.hard.friction import held_by
from particlesim.engine.interactions.hard.walls import colliders_of, whole
from particlesim.engine.interactions.hard.walls_ahead import TOUCHES, look_again, look_from, on_way
from particlesim.engine.interactions.hard.ways import (
    ENDS,
    HIT,
    IMPACTS,
    MOST_IMPACTS,
    SIDE,
    WALL,
    carry,
    excess,
    stand_at,
    velocity_at,
)
from particlesim.engine.interactions.lifting import book
from particlesim.engine.interactions.pressing import cross
from particlesim.engine.step.rubbing import slowed
from particlesim.laws.registry import PASS, gap_and_normal

CORNERS = 2
"""How often all colliders are looked at that something may have been pushed into."""


class Blow(NamedTuple):
    """What a particle brings to an impact on a rigid body at time s of a step: its place, velocity and angular velocity,
    None where it has none; the normal of the body; its radius and 1/m; up to which approach it does not rebound; s and h."""

    at: Any
    v: Any
    turning: Any
    n: Any
    r: Any
    light: Any
    slow: Any
    s: Any
    h: Any


def hit_wall(w: Any, fed: Any, parts: Any, c: Any, i: Any, t: Any, h: Any) -> bool:
    """The impact of a particle on the collider, or the rigid body, that is next on its way; whether it takes place."""
    k = 0
    if w.obstacles is not None and w.what[SIDE, i] < 0:
        if w.met[6, i] != w.obstacles.changes[-1 - w.what[SIDE, i]]:
            look_again(w, parts, c, i, w.when[WALL, i], t, h)
            return False
        meet_body(w, fed, c, i, h)
    for part in parts:
        for collider in colliders_of(part):
            if k == w.what[SIDE, i]:
                bounce_off(w, fed, collider, part.rolling, c, i, t, h)
            k += 1
    return True


@outlined
def meet_body(w: Any, fed: Any, c: Any, i: Any, h: Any) -> None:
    """The rebound of a particle from the rigid body that is next on its way. It goes on beside it, at least as fast as the
    surface does."""
    o, s, body = w.obstacles, w.when[WALL, i], -1 - w.what[SIDE, i]
    stand_at(w, i, s, h)
    w.what[HIT, i] = 1
    if (o.waits[0] == 0) & (o.free[body] > 0) & (w.what[IMPACTS, i] < MOST_IMPACTS - 1):
        n = (w.met[3, i], w.met[4, i], w.met[5, i])
        slow, turning = REST * abs(dot(row(w.force, i), n)), None if c.spin is None else row(w.spin, i)
        v = velocity_at(w, i, s)
        blow = Blow(row(w.at, i), v, turning, n, float(c.r[i]), w.light[i], slow, s, float(h))
        change, turn, pace = type(o).strike(o, i, body, blow)
        push(w, i, 1.0, change, s, h)
        add(w.spin, i, 1.0, turn)
        w.what[IMPACTS, i] += 1
        into, had = dot(minus(pace, row(w.go, i)), n), excess(w, i, s, h)
        if into > 0:
            add(w.go, i, into, n)
            carry(w, i, s, n)
            book(fed, max(excess(w, i, s, h) - had, 0.0) / w.light[i])
    else:
        tire(w, fed, i, s, h)
        ride(w, fed, i, s, h)


def ride(w: Any, fed: Any, i: Any, s: Any, h: Any) -> None:
    """Have a particle that has come to a rigid body at time s of a step of h go with the surface there until the end of the
    step, as if time stood still for it: it rebounds as a guest of the bodies in the next one."""
    force, pace = minus(row(w.force, i), row(w.carried, i)), row(w.met, i)
    rest(w, fed, i, s, h)
    for axis in range(3):
        w.go[axis, i] = pace[axis]
    book(fed, max(-(w.when[ENDS, i] - s) * dot(force, pace), 0.0) / (w.light[i] * float(h)))


@outlined
def bounce_off(w: Any, fed: Any, collider: Any, rolling: Any, c: Any, i: Any, t: Any, h: Any) -> None:
    """The rebound of a particle from a collider. It stays there until the end of the step, and meets it in the next one, if
    that moves, somebody hears of impacts, or it is to stick or to vanish."""
    s, response = w.when[WALL, i], collider.response
    stand_at(w, i, s, h)
    known = not isinstance(collider.shape, MovingRecord) and response.heard is None
    if known & (w.what[IMPACTS, i] < MOST_IMPACTS - 1) and response.outcome == PASS:
        p = on_way(w, c, i, s, t, h)
        g, axes = gap_and_normal(collider.shape, p)
        n = whole(axes, g)
        approach = dot((p.vx, p.vy, p.vz), n)
        if approach < 0:
            push(w, i, 1.0, rebounded(w, collider, rolling, c, i, p, axes, n, approach), s, h)
        w.what[IMPACTS, i] += 1
        into = -dot(row(w.go, i), n)
        if into > 0:
            owed = lift(w, i, n, s, into / float(h))
            add(w.go, i, into, n)
            pay_along(w, fed, i, owed, row(w.go, i), s)
            carry(w, i, s, n)
    else:
        tire(w, fed, i, s, h)
        rest(w, fed, i, s, h)


def lift(w: Any, i: Any, n: Any, s: Any, into: Any) -> Any:
    """The energy over the mass that a particle gets where a collider with a normal n carries it from time s on and turns a
    way that leads into it at a pace: against what other colliders carry, and as far as others have turned it there."""
    left, pressed = w.when[ENDS, i] - s, max(-dot(row(w.force, i), n), 0.0)
    turned = into + dot(velocity_at(w, i, s), n) - 0.5 * left * pressed
    return left * (into * dot(row(w.carried, i), n) + max(turned, 0.0) * pressed)


def put_back(w: Any, fed: Any, parts: Any, c: Any, t: Any, h: Any) -> None:
    """Put what has been hit out of colliders in which it ends: pairs that were kept off each other may push into one."""
    for _ in range(CORNERS):
        for part in parts:
            for collider in colliders_of(part):
                put_out_of(w, fed, collider, c, t, h, part.first, part.last)


@outlined
def put_out_of(w: Any, fed: Any, collider: Any, c: Any, t: Any, h: Any, first: Any, last: Any) -> None:
    """Put those of particles [first, last) that have been hit out of a collider."""
    for i in range(first, last):
        if (w.what[HIT, i] > 0) & (w.light[i] > 0):
            g, axes = look_from(w, collider, c, i, w.when[ENDS, i], t, h)
            if g < -TOUCHES * float(c.r[i]):
                n = whole(axes, g)
                stand_at(w, i, w.when[ENDS, i], h)
                add(w.at, i, -float(g), n)
                pressed = -dot(minus(row(w.force, i), row(w.carried, i)), n)
                pay_along(w, fed, i, -float(g) * max(pressed, 0.0) / float(h), n, w.when[ENDS, i])


def rebounded(
    w: Any, collider: Any, rolling: Any, c: Any, i: Any, p: Any, axes: Any, n: Any, approach: Any
) -> Any:
    """By how much the velocity of a particle changes in an impact on a collider that rests, which may turn it [m/s]."""
    response = collider.response
    if c.spin is None or response.friction is None:
        v = rebound(response, axes, approach, p)
        return v[0] - p.vx, v[1] - p.vy, v[2] - p.vz
    given = -float(bounce_at(response, approach)) * approach
    belt = whole((None, None, None) if response.belt is None else response.belt, given)
    turning, u = cross(row(w.spin, i), n), (p.vx - belt[0], p.vy - belt[1], p.vz - belt[2])
    along, friction = dot(u, n), response.friction
    slip = tuple(u[k] - along * n[k] - p.r * turning[k] for k in range(3))
    if rolling is None:
        for axis in range(3):
            w.held[axis, 0] = 0.0
        t = held_by(w.held, 0, slip, 2 / 7, given, float(friction.static), float(friction.kinetic))
        turn = cross(n, (-t[0], -t[1], -t[2]))
    else:
        roll = tuple(p.r * turning[k] for k in range(3))
        t, q = slowed(slip, roll, friction, float(rolling), given)
        turn = cross(n, minus(q, t))
    add(w.spin, i, 2.5 / p.r if p.r > 0 else 0.0, turn)
    return given * n[0] + t[0], given * n[1] + t[1], given * n[2] + t[2]
