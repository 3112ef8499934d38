"""Impacts of swift hard grains on each other in the midst of a step, and what others do to their motion (`swift`).

Two get what a pair in turns gets (`impulses`), along the line of centres at the time of impact: −(1 + e) v_n and friction
within Coulomb's cone, with the velocities of that time. Forces go on after it as before, so their work on the way that is
now another one is what the change of v² leaves out: with e = 1 energy is kept wherever in the step an impact is. An impulse
may be larger, so that both do not go on into each other, but no larger than that of e = 1. Where they would nevertheless,
their ways are turned, and what they do not fall for that is taken from their motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.bench import REST
from particlesim.engine.interactions.hard.friction import held_by
from particlesim.engine.interactions.hard.laws import bounces_at
from particlesim.engine.interactions.hard.overheard import tell_both
from particlesim.engine.interactions.hard.turns import BLOWS
from particlesim.engine.interactions.hard.ways import (
    HIT,
    IMPACTS,
    MOST_IMPACTS,
    let_go,
    stand_at,
    stay,
    velocity_at,
)
from particlesim.engine.interactions.lifting import book
from particlesim.engine.interactions.pressing import cross


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
