"""Impacts of swift hard grains in the midst of a step, on each other, on colliders and on rigid bodies (`swift`).

Two get what a pair in turns gets (`impulses`), along the line of centres at the time of impact: −(1 + e) v_n and friction
within Coulomb's cone, with the velocities of that time. Forces go on after it as before, so their work on the way that is
now another one is what the change of v² leaves out: with e = 1 energy is kept wherever in the step an impact is. An impulse
may be larger, so that both do not go on into each other, but no larger than that of e = 1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.moving import MovingRecord, frame_at, surface_velocity
from particlesim.colliders.response import bounce_at, rebound
from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.bench import REST
from particlesim.engine.interactions.hard.friction import held_by
from particlesim.engine.interactions.hard.overheard import tell_both
from particlesim.engine.interactions.hard.turns import BLOWS, bounces_at
from particlesim.engine.interactions.hard.walls import FLAT, colliders_of, whole
from particlesim.engine.interactions.hard.ways import (
    BEGUN,
    BEND,
    ENDS,
    HIT,
    IMPACTS,
    MOST_IMPACTS,
    SIDE,
    STRAIGHT,
    WALL,
    carry,
    excess,
    leg_of,
    let_go,
    place_at,
    stand_at,
    stay,
    velocity_at,
)
from particlesim.engine.interactions.lifting import book
from particlesim.engine.interactions.pressing import cross
from particlesim.engine.state.columns import fetch
from particlesim.engine.step.rubbing import slowed
from particlesim.laws.registry import PASS, gap_and_normal, moved_to, with_radius

CORNERS = 2
"""How often all colliders are looked at that something may have been pushed into."""
ROUNDING = 1e-12
"""Rate at which what lies on a collider comes closer to it by rounding, as a part of its pace."""
HALVINGS = 40
"""Of a way that has led into a collider."""
TOUCHES, LEAVES, MOST_STRIDES = 1e-9, 0.05, 256
"""Gap to a collider at which a particle hits it, and what it goes without a look where it leaves one, as parts of its
radius; strides on the way to a collider at most, where it is taken to be then."""


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


def dot(a: Any, b: Any) -> Any:
    """The product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a: Any, b: Any) -> Any:
    """The difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def row(rows: Any, i: Any) -> Any:
    """A vector out of rows [3, n]."""
    return rows[0, i], rows[1, i], rows[2, i]


def add(rows: Any, i: Any, part: Any, v: Any) -> None:
    """Add a part of a vector to one in rows [3, n]."""
    for axis in range(3):
        rows[axis, i] += part * v[axis]


# ---- two particles


@outlined
def strike(each: Any, c: Any, i: Any, j: Any, s: Any, end: Any, h: Any) -> None:
    """The impact of particles i and j at time s of a step of h that ends at a time."""
    w, law = each.ways, each.law
    wi, wj, both = w.light[i], w.light[j], w.light[i] + w.light[j]
    image = row(w.image, i)
    stand_at(w, i, s, h)
    stand_at(w, j, s, h)
    w.what[HIT, i] = w.what[HIT, j] = 1
    d = tuple(w.at[k, i] - w.at[k, j] + image[k] for k in range(3))
    far, g = np.sqrt(dot(d, d)), minus(row(w.go, j), row(w.go, i))
    # in one place to rounding, they meet along their ways
    n, size = (d, far) if far > 0 else (g, np.sqrt(dot(g, g)))
    n = (n[0] / size, n[1] / size, n[2] / size)
    u = minus(velocity_at(w, i, s), velocity_at(w, j, s))
    pressed = dot(minus(row(w.force, i), row(w.force, j)), n)
    approach, meets = -dot(u, n), dot(g, n) / float(h)
    change = 0.0
    if approach > 0:
        # as slow as forces bring about in two steps is rest, but for what is elastic
        lively = (approach > REST * abs(pressed)) | (law.restitution >= 1)
        change = approach * (1.0 + (float(bounces_at(law, approach)) if lively else 0.0))
        change = max(change, min(meets, 2.0 * approach))
        if each.heard is not None and lively:
            when, one, two = end - (1.0 - s) * float(h), velocity_at(w, i, s), velocity_at(w, j, s)
            tell_both(each.heard, c, i, j, row(w.at, i), row(w.at, j), n, approach, one, two, when)
    x, y, z = change * n[0], change * n[1], change * n[2]
    if law.friction is not None:
        t = rub(each, c, i, j, n, u, far, change)
        x, y, z = x + t[0], y + t[1], z + t[2]
    if both > 0:
        push(w, i, wi / both, (x, y, z), s, h)
        push(w, j, -wj / both, (x, y, z), s, h)
        tire(w, each.fed, i, s, h)
        tire(w, each.fed, j, s, h)
        book(each.fed, keep_off(w, i, j, n, s, h))


def push(w: Any, i: Any, part: Any, change: Any, s: Any, h: Any) -> None:
    """Change the velocity of a particle and its way, unless that has come to its end. What leaves a collider that it lies on
    is carried no more."""
    add(w.speed, i, part, change)
    if w.what[IMPACTS, i] < MOST_IMPACTS:
        add(w.go, i, part * float(h), change)
        if part * dot(change, row(w.carried, i)) > 0:
            let_go(w, i, s, h)


def tire(w: Any, fed: Any, i: Any, s: Any, h: Any) -> None:
    """Count an impact of a particle, which stays where it is if it has had too many."""
    w.what[IMPACTS, i] += 1
    if (w.what[IMPACTS, i] == MOST_IMPACTS) & (w.light[i] > 0):
        rest(w, fed, i, s, h)
        fed[1] += 1.0


def rest(w: Any, fed: Any, i: Any, s: Any, h: Any) -> None:
    """Have a particle that something may move stay where it is."""
    if w.light[i] > 0:
        owed = stay(w, i, s, h)
        pay_along(w, fed, i, owed, velocity_at(w, i, s), s)


def pay_along(w: Any, fed: Any, i: Any, owed: Any, axis: Any, s: Any) -> None:
    """Take an energy over the mass from the motion of a particle along an axis, or book it where there is less [J/kg]."""
    square, along = dot(axis, axis), dot(velocity_at(w, i, s), axis)
    left = along * along - 2.0 * owed * square
    if (owed > 0) & (left > 0):
        add(w.speed, i, (slowed_to(along, left) - along) / square, axis)
    else:
        book(fed, owed / w.light[i])


def slowed_to(speed: Any, square: Any) -> Any:
    """A speed in the same direction with another square, 0 if that is less."""
    new = np.sqrt(max(square, 0.0))
    return new if speed > 0 else -new


def keep_off(w: Any, i: Any, j: Any, n: Any, s: Any, h: Any) -> Any:
    """Turn the ways of two so that they do not lead into each other from time s of a step of h on; the work that takes
    against forces on both [J]. One that stays where it is does not move, nor, if the other one can, one that lies on a
    collider behind it."""
    into = dot(minus(row(w.go, j), row(w.go, i)), n)
    if into > 0:
        mine = w.light[i] if w.what[IMPACTS, i] < MOST_IMPACTS else 0.0
        other = w.light[j] if w.what[IMPACTS, j] < MOST_IMPACTS else 0.0
        one = mine if dot(n, row(w.carried, i)) >= 0 else 0.0
        two = other if dot(n, row(w.carried, j)) <= 0 else 0.0
        mine, other = (one, two) if one + two > 0 else (mine, other)
        by = into / (mine + other) if mine + other > 0 else 0.0
        add(w.go, i, by * mine, n)
        add(w.go, j, -by * other, n)
        one = dot(minus(row(w.force, i), row(w.carried, i)), n) if mine > 0 else 0.0
        two = dot(minus(row(w.force, j), row(w.carried, j)), n) if other > 0 else 0.0
        return pay_for(w, i, j, mine, other, n, (two - one) * by * (1.0 - s) / float(h), s)
    return 0.0


def pay_for(w: Any, i: Any, j: Any, mine: Any, other: Any, n: Any, work: Any, s: Any) -> Any:
    """Take the work of turning the ways of two, whose inverse masses count as `mine` and `other`, from their motion along
    the normal: a heavy one that squeezes a light one on the floor stays above it in return for its fall. Returns what they
    do not have [J]."""
    if work > 0:
        # who is carried, or stays, is at rest; who is led is not
        one = dot(velocity_at(w, i, s), n) if (mine > 0) | (w.light[i] <= 0) else 0.0
        two = dot(velocity_at(w, j, s), n) if (other > 0) | (w.light[j] <= 0) else 0.0
        apart, both = one - two, mine + other
        left = apart * apart - 2.0 * both * work
        by = slowed_to(apart, left) - apart
        add(w.speed, i, by * mine / both, n)
        add(w.speed, j, -by * other / both, n)
        work = max(-0.5 * left / both, 0.0)
    return work


def rub(each: Any, c: Any, i: Any, j: Any, n: Any, u: Any, far: Any, change: Any) -> Any:
    """Friction, and rolling friction, of an impact that changes the velocity along the normal by `change`: they turn both;
    by what it changes the velocity u of the first relative to the second [m/s]. One makes surfaces slide, or roll, which the
    other one stops, so they come by turns."""
    w, along, t = each.ways, dot(u, n), (0.0, 0.0, 0.0)
    slide = (u[0] - along * n[0], u[1] - along * n[1], u[2] - along * n[2])
    for axis in range(3):
        w.held[axis, 0] = w.held[axis, 1] = 0.0
    for _ in range(1 if each.law.rolling is None else BLOWS):
        x, y, z = end_sliding(
            each, c, i, j, n, (slide[0] + t[0], slide[1] + t[1], slide[2] + t[2]), far, change
        )
        t = (t[0] + x, t[1] + y, t[2] + z)
        if each.law.rolling is not None:
            end_rolling(each, c, i, j, n, change)
    return t


def end_sliding(each: Any, c: Any, i: Any, j: Any, n: Any, slip: Any, far: Any, change: Any) -> Any:
    """Bring the friction of an impact up to what ends the sliding of two whose velocities differ by `slip` across the
    normal, or to what is allowed; by what it changes that [m/s]."""
    w, friction, share = each.ways, each.law.friction, 1.0
    ri, rj, both = float(c.r[i]), float(c.r[j]), w.light[i] + w.light[j]
    arm = far / (ri + rj)
    if c.spin is not None:
        a, b = row(w.spin, i), row(w.spin, j)
        turning = cross(tuple(ri * a[k] + rj * b[k] for k in range(3)), n)
        slip = tuple(slip[k] - arm * turning[k] for k in range(3))
        light = (w.light[i] if ri > 0 else 0.0) + (w.light[j] if rj > 0 else 0.0)  # points do not turn
        share = both / (both + 2.5 * arm * arm * light)
    t = held_by(w.held, 0, slip, share, change, float(friction.static), float(friction.kinetic))
    if c.spin is not None:
        turn = cross(n, (-t[0], -t[1], -t[2]))
        add(w.spin, i, 2.5 * arm * w.light[i] / (both * ri) if ri > 0 else 0.0, turn)
        add(w.spin, j, 2.5 * arm * w.light[j] / (both * rj) if rj > 0 else 0.0, turn)
    return t


def end_rolling(each: Any, c: Any, i: Any, j: Any, n: Any, change: Any) -> None:
    """Bring the rolling friction of an impact up to what ends the rolling of two, or to what is allowed (`friction`)."""
    w, most, ri, rj = each.ways, float(each.law.rolling), float(c.r[i]), float(c.r[j])
    if (ri > 0) & (rj > 0):
        turn = minus(row(w.spin, i), row(w.spin, j))
        up, by = dot(turn, n), 2.5 / ((ri + rj) * (w.light[i] + w.light[j]))
        mine, other = by * w.light[i] * rj / ri, by * w.light[j] * ri / rj
        rolls = (turn[0] - up * n[0], turn[1] - up * n[1], turn[2] - up * n[2])
        q = held_by(w.held, 1, rolls, 1.0 / (mine + other), change, most, most)
        add(w.spin, i, mine, q)
        add(w.spin, j, -other, q)


# ---- colliders


def find_wall(w: Any, parts: Any, c: Any, i: Any, t: Any, h: Any) -> None:
    """Find out when a particle comes to a collider or a rigid body on its way, which it has not gone before."""
    find_collider(w, parts, c, i, t, h)
    if w.obstacles is not None and may_meet(w, i):
        find_body(w, c, i, w.when[BEGUN, i])


def find_collider(w: Any, parts: Any, c: Any, i: Any, t: Any, h: Any) -> None:
    """Find out when a particle comes to a collider on its way, which it has not gone before."""
    k = 0
    w.when[WALL, i] = np.inf
    for part in parts:
        for collider in colliders_of(part):
            if (part.first <= i) & (i < part.last) & (w.light[i] > 0):
                soonest = wall_ahead(w, collider, c, i, t, h)
                if soonest < w.when[WALL, i]:
                    w.when[WALL, i], w.what[SIDE, i] = soonest, k
            k += 1


def look_again(w: Any, parts: Any, c: Any, i: Any, s: Any, t: Any, h: Any) -> None:
    """Find out anew when a particle comes to something from time s on: the body that it would have come to then has got
    another way."""
    if w.what[HIT, i] > 0:
        find_collider(w, parts, c, i, t, h)
    else:
        w.when[WALL, i] = np.inf  # the way of what nobody hits is known
    find_body(w, c, i, s)
    if (s < w.when[BEND, i]) & (w.when[BEND, i] < STRAIGHT) & (w.when[WALL, i] == np.inf):
        find_body(w, c, i, w.when[BEND, i])


@outlined
def find_body(w: Any, c: Any, i: Any, s: Any) -> None:
    """Find out when a particle comes to a rigid body on its leg from time s on, if that is before it comes to a collider."""
    o, (begun, x, go) = w.obstacles, leg_of(w, i, s)
    x = (x[0] + (s - begun) * go[0], x[1] + (s - begun) * go[1], x[2] + (s - begun) * go[2])
    ends = w.when[BEND, i] if s < w.when[BEND, i] else w.when[ENDS, i]
    soonest, body, pace, n = type(o).find(o, x, go, float(c.r[i]), i, s, min(ends, w.when[ENDS, i]))
    if soonest < w.when[WALL, i]:
        w.when[WALL, i], w.what[SIDE, i] = soonest, -1 - body
        for axis in range(3):
            w.met[axis, i], w.met[3 + axis, i] = pace[axis], n[axis]
        w.met[6, i] = o.changes[body]


def may_meet(w: Any, i: Any) -> Any:
    """Whether a particle is moved by impulses, and does not go with the surface of a body that it has come to."""
    with_it = w.what[SIDE, i] < 0
    for axis in range(3):
        with_it = with_it & (w.go[axis, i] == w.met[axis, i])
    return (w.light[i] > 0) & (w.what[IMPACTS, i] < MOST_IMPACTS) & (not with_it)


@outlined
def wall_ahead(w: Any, collider: Any, c: Any, i: Any, t: Any, h: Any) -> float:
    """When a particle comes to a collider: it goes as far as that is away at least, again and again. Where it leaves one
    side it goes a little way at once, and may come into another one, as in a corner; then that is looked for on this way."""
    s, go, r, stride = w.when[BEGUN, i], row(w.go, i), float(c.r[i]), 0
    left = s
    own = np.sqrt(dot(go, go))
    while (s < w.when[ENDS, i]) & (stride < MOST_STRIDES) & (own > 0):
        g, axes = look_from(w, collider, c, i, s, t, h)
        x, fast = pace_of(collider, on_way(w, c, i, s, t, h), h)
        fast, n = fast + own, whole(axes, g)
        rate = dot(minus(go, x), n)
        closes = rate < -ROUNDING * fast
        if isinstance(collider.shape, FLAT):
            return s + max(g, 0.0) / -rate if closes else np.inf
        if (g <= TOUCHES * r) & closes:
            low, high = (left if g < -TOUCHES * r else s), s
            for _ in range(HALVINGS if low < high else 0):
                middle = 0.5 * (low + high)
                gap, _ = look_from(w, collider, c, i, middle, t, h)
                low, high = (low, middle) if gap < -TOUCHES * r else (middle, high)
            return low
        left = s
        s += (g if closes else max(g, LEAVES * r)) / fast
        stride += 1
    return s if (s < w.when[ENDS, i]) & (own > 0) else np.inf


def pace_of(collider: Any, p: Any, h: Any) -> Any:
    """How far the surface of a collider comes in a step at a particle, and at most near it [m]."""
    if not isinstance(collider.shape, MovingRecord):
        return (0.0, 0.0, 0.0), 0.0
    u = surface_velocity(collider.shape, frame_at(collider.shape, p.t, p.x), p.x, p.y, p.z)
    turns = 0.0 if collider.shape.spin is None else abs(float(collider.shape.spin.rate))
    x = (h * u[0], h * u[1], h * u[2])
    way = h * np.sqrt(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz)
    return x, np.sqrt(dot(x, x)) + turns * h * way


def look_from(w: Any, collider: Any, c: Any, i: Any, s: Any, t: Any, h: Any) -> Any:
    """The gap to a collider, and its normal, at time s of the way of a particle."""
    return gap_and_normal(collider.shape, on_way(w, c, i, s, t, h))


def on_way(w: Any, c: Any, i: Any, s: Any, t: Any, h: Any) -> Any:
    """A particle at time s of its way."""
    x, v = place_at(w, i, s), velocity_at(w, i, s)
    p = with_radius(fetch(c, i, t), float(c.r[i]))
    return moved_to(p, x[0], x[1], x[2], v[0], v[1], v[2], t - (1.0 - s) * float(h))


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
