"""Particles that rods hold at bodies, and colliders: they meet these with all that hangs on the rods.

Impulses of a step are given in its middle, where what is swift, or is a point, may be behind a thin collider. So the way of
such a particle from the beginning of the step is followed to the collider (conservative advancement: nothing is nearer than
the gap says), and the contact is that of the place where it comes to it, with the gap that is closed there. What leaves a
face, or lies on it, is followed on: in a corner it meets a second one (`meet_wall`).

An impulse in the middle stops a particle too late by up to half of the step. What would be behind its contact at the end is
moved back, with all that hangs together, to where that impulse would have led at an earlier time τ: each by −τ ΔV of its
own, which the rods allow to first order (`put_in_time`).

Its own step begins where it leads to the same end: on the surface, if the way back would lead behind it (`lift_held`). What
it meets there beyond that end is taken back, and so is all that what may touch a collider does in it but for forces, as
the collider has acted already (`Ties.arrive`). What has passed a collider all the same, as its rods drive it, is found at
the end of the step (`passed`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord, lead_of, spin_of
from particlesim.compiler import kernel, outlined
from particlesim.engine.rigid.bodies import (
    GRAINS,
    GUEST,
    WORLD,
    add_contact,
    name_contact,
    orientation,
    place,
    row,
)
from particlesim.engine.rigid.contact_rows import presses
from particlesim.engine.rigid.joints import fit
from particlesim.engine.rigid.narrow import minus, plus
from particlesim.engine.rigid.probing import away, probe
from particlesim.engine.rigid.rolling import roll_on
from particlesim.engine.rigid.rotation import dot, normalised
from particlesim.engine.rigid.walls import set_wall
from particlesim.engine.step.crossing import through
from particlesim.laws.registry import gap
from particlesim.model.quaternions import times

TOUCH = 0.01
"""Gap up to which particles lie on a collider, as a part of their radius."""
HOP = 4.0
"""How far what lies may be from what it lies on, in ways that it gets in a step by what changes its velocity in that."""
SWIFT = 0.5
"""Way in a step from which on it is followed, as a part of the radius."""
LOOKS = 128
"""Gaps that are looked at on a way; who needs more grazes a surface, and meets it there."""
CLOSE = 1e-6
"""Gap that counts as none, as a part of the radius and the way in the step."""
BESIDE = 0.02
"""How far beside a face it is followed on, as a part of the way in the step."""
SAME_FACE = 0.9
"""The cosine of the angle between two normals of a collider from which on they are those of one face of it."""
QUICK = 2.0
"""What comes faster than so many times what changes its velocity in a step rebounds."""
SUNK, DEEP = 0.5, 0.002
"""How deep a particle may come into a collider in a step, beside `HOP`: parts of its radius, and of its way."""
SECOND = 1 << 47
"""Added to the number of a contact with a second face."""


def fastest(shape: Any, lead: Any, far: Any) -> Any:
    """A speed that no place of a collider within so far exceeds, where it has the velocity `lead` [m/s]."""
    if isinstance(shape, MovingRecord):
        return np.sqrt(dot(lead, lead)) + (0.0 if shape.spin is None else abs(shape.spin.rate) * far)
    return 0.0


@outlined
def comes_to(shape: Any, x: Any, radius: Any, u: Any, t: Any, pace: Any, limit: Any) -> float:
    """After which time what begins at x at the time t, with u, comes to a collider; infinite if it does not before a
    limit. With a pace of −1 time goes backwards."""
    speed = np.sqrt(dot(u, u))
    far = limit * speed
    speed += fastest(shape, lead_of(shape, x, t), radius + far)
    close, s, distance = CLOSE * (radius + far), 0.0, np.inf
    for _ in range(LOOKS):
        distance = gap(shape, probe(plus(x, s, u), radius, t + pace * s))
        if distance <= close or s > limit:
            break
        s += distance / speed if speed > 0 else np.inf
    return s if s <= limit else np.inf


@outlined
def meet_wall(wall: Any, guests: Any, b: Any, k: Any, m: Any, t: Any, h: Any) -> None:
    """Note the contacts that guest m, which rods hold, has with a collider in a step of h, whose middle is at t."""
    i, radius, x = guests.first + m, guests.radius[m], row(guests.crowd.began, m)
    begin, other, kick = t - 0.5 * h, row(guests.other, m), h * b.w[i]
    u = plus(row(b.v, i), kick, other)  # as impulses see it
    lead, gained = lead_of(wall.shape, x, begin), kick * np.sqrt(dot(other, other))
    near, way = TOUCH * radius + HOP * h * gained, h * np.sqrt(dot(u, u))
    reach = near + way + h * fastest(wall.shape, lead, radius + way)
    distance = gap(wall.shape, probe(x, radius, begin))
    if not distance < reach:
        return
    s, n, slow = 0.0, away(wall.shape, probe(x, radius, begin)), distance < near or way < SWIFT * radius
    if not slow:
        s = comes_to(wall.shape, x, radius, u, begin, 1.0, h)
        if not s < np.inf:
            return
        y = plus(x, s, u)
        n, lead = away(wall.shape, probe(y, radius, begin + s)), lead_of(wall.shape, y, begin + s)
        distance = -s * dot(minus(u, lead), n)
        if not distance >= 0:
            return
    note(wall, guests, b, k, m, GRAINS, n, distance, t)
    after = minus(u, lead)
    down = dot(after, n)
    if down < 0:
        e = wall.restitution if -down > QUICK * gained else 0.0
        after = plus(after, -(1 + e) * down, n)
    after = plus(after, 1.0, lead)
    beside = BESIDE * h * np.sqrt(dot(after, after))
    second = plus(plus(x, s, u), beside + max(-distance, 0.0), n)
    if not beside > CLOSE * radius:
        return
    r = comes_to(wall.shape, second, radius, after, begin + s, 1.0, h - s)
    if r < np.inf:
        y = plus(second, r, after)
        one, lead = away(wall.shape, probe(y, radius, begin + s + r)), lead_of(wall.shape, y, begin + s + r)
        if dot(one, n) < SAME_FACE and dot(minus(u, lead), one) < 0:
            note(
                wall,
                guests,
                b,
                k,
                m,
                GRAINS + SECOND,
                one,
                dot(minus(x, y), one) + (s + r) * dot(lead, one),
                t,
            )


def note(wall: Any, guests: Any, b: Any, k: Any, m: Any, kind: Any, n: Any, distance: Any, t: Any) -> None:
    """Note a contact of guest m with a collider."""
    i, friction = guests.first + m, guests.support.rolling[guests.kind[m]]
    number = add_contact(
        k, i, WORLD, kind + guests.id[m], plus(place(b, i), -guests.radius[m], n), n, distance
    )
    if number >= 0:
        set_wall(wall, k, number, t)
        name_contact(k, number, GUEST, GUEST - 1 - wall.number)
        guests.crowd.linked[m] = 1
        if friction > 0:
            roll_on(b, k, number, friction, guests.radius[m], spin_of(wall.shape))


@outlined
def put_in_time(joints: Any, guests: Any, b: Any, k: Any, motion: Any, h: Any) -> bool:
    """Move what would have a particle on rods behind its contact at the end of a step of h back to where that would be if
    impulses had been given earlier; whether joints could be held. Velocities before impulses are in `motion.start`."""
    early, some, held = motion.low, False, True
    for component in range(joints.next.size):
        early[component] = 0.0
    for c in range(k.number[0]):
        i = k.first[c]
        if k.second[c] == WORLD and 0 <= i - guests.first < guests.held and presses(k, c):
            component = joints.component[i]
            early[component] = max(early[component], too_late(guests, b, k, motion, c, h))
            some |= early[component] > 0
    for component in range(joints.next.size if some else 0):
        if early[component] > 0:
            for at in range(joints.member_from[component], joints.member_from[component + 1]):
                go_back(b, motion, joints.members[at], early[component])
            held = fit(joints, b, motion, component) and held
    return held


def go_back(b: Any, motion: Any, i: Any, early: Any) -> None:
    """Move and turn body i to where its impulses would have led a time earlier."""
    now, was, q = motion.now[i], motion.start[i], orientation(b, i)
    for axis in range(3):
        b.x[axis, i] += early * (now[axis] - was[axis])
    half = 0.5 * early
    turn = times((0.0, half * (now[3] - was[3]), half * (now[4] - was[4]), half * (now[5] - was[5])), q)
    q = normalised((q[0] + turn[0], q[1] + turn[1], q[2] + turn[2], q[3] + turn[3]))
    b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q


def too_late(guests: Any, b: Any, k: Any, motion: Any, c: Any, h: Any) -> float:
    """By how much the impulse of a contact in the middle of a step of h is too late for it not to be behind at its end."""
    i, n = k.first[c], row(k.normal, c)
    gone = plus(minus(place(b, i), row(guests.crowd.began, i - guests.first)), 0.5 * h, row(b.v, i))
    end = max(k.gap[c], 0.0) + dot(minus(gone, (h * k.belt[0, c], h * k.belt[1, c], h * k.belt[2, c])), n)
    was = motion.start[i]
    change = dot(minus(row(b.v, i), (was[0], was[1], was[2])), n)
    return min(-end / change, 0.5 * h) if end < 0 and change > 0 else 0.0


@kernel
def lift_held(guests: Any, x: Any, v: Any, gain: Any, shift: Any, lifted: Any, t: Any, h: Any) -> None:
    """Guests on rods that would begin their own step of length h inside a collider which they leave in it, or behind one,
    as impulses have changed their way in the middle of the step, begin it on its surface; so do those that lie, by what rods
    leave them over it: with what else changes their velocities, `gain` [3, n], that is nothing. By how much they are lifted
    [3, n]."""
    for wall in guests.support.walls:
        for m in range(guests.held):
            if wall.on[guests.kind[m]] > 0:
                u, radius, hop = (
                    row(v, m),
                    guests.radius[m],
                    HOP * h * np.sqrt(dot(row(gain, m), row(gain, m))),
                )
                y, swift = plus(row(x, m), 1.0, row(shift, m)), h * np.sqrt(dot(u, u)) > SWIFT * radius
                distance, n = gap(wall.shape, probe(y, radius, t)), away(wall.shape, probe(y, radius, t))
                along = h * dot(u, n)
                falls, hops = distance < 0 and along > -distance, 0 < distance < hop and abs(along) < hop
                late = leaves(wall, row(x, m), y, u, row(gain, m), radius, t, h) if swift else 0.0
                if late > 0:
                    lift(shift, lifted, m, (late * u[0], late * u[1], late * u[2]))
                elif (falls or hops) and (abs(distance) < hop or not swift):
                    lift(shift, lifted, m, (-distance * n[0], -distance * n[1], -distance * n[2]))


@outlined
def leaves(wall: Any, x: Any, y: Any, u: Any, gain: Any, radius: Any, t: Any, h: Any) -> float:
    """How long after its beginning at y, at a time t, a step of h with u, and a gain of velocity, leaves a collider that was
    below a particle at x; 0 if it does not."""
    way, end = np.sqrt(dot(u, u)), plus(plus(y, h, u), 0.5 * h, gain)
    s = comes_to(wall.shape, end, radius, (-u[0], -u[1], -u[2]), t + h, -1.0, h)
    begin, before = plus(end, -s, u) if s < np.inf else y, probe(x, radius, t)
    later = dot(minus(begin, y), u)
    if not later > 0:
        return 0.0
    n, close = away(wall.shape, probe(begin, radius, t + h - s)), CLOSE * (radius + h * way)
    out = h * dot(minus(u, lead_of(wall.shape, begin, t + h - s)), n)
    # It was before this face, or is a little behind it.
    mine = dot(minus(x, begin), n) > -close or dot(away(wall.shape, before), n) > SAME_FACE
    return later / (way * way) if mine and out > close + HOP * h * np.sqrt(dot(gain, gain)) else 0.0


def lift(shift: Any, lifted: Any, m: Any, way: Any) -> None:
    """Lift guest m by a way."""
    for axis, part in enumerate(way):
        shift[axis, m] += part
        lifted[axis, m] += part


@kernel
def passed(
    walls: Any,
    kind: Any,
    radius: Any,
    x: Any,
    y: Any,
    gain: Any,
    slack: Any,
    t: Any,
    h: Any,
    found: Any,
    how: Any,
) -> None:
    """Which particles of these kinds have passed a thin collider in a step of h from x to y [3, n], which began at t, or
    have come deep into a thick one, into found [n]; its normal at x and the velocity of its surface there, into how [6, n].
    `gain` [3, n]: the velocities that forces give in a step."""
    for wall in walls:
        for m in range(radius.size):
            if wall.on[kind[m]] > 0 and found[m] == 0:
                p, q = probe(row(x, m), radius[m], t), probe(row(y, m), radius[m], t + h)
                way, deep = minus(row(y, m), row(x, m)), gap(wall.shape, q)
                falls = HOP * h * np.sqrt(dot(row(gain, m), row(gain, m)))
                sunk = deep < -(SUNK * radius[m] + DEEP * np.sqrt(dot(way, way)) + falls + slack)
                if (sunk and deep < gap(wall.shape, p)) or through(wall, p, q, slack) < 1:
                    found[m], n, lead = 1, away(wall.shape, p), lead_of(wall.shape, row(x, m), t)
                    for axis in range(3):
                        how[axis, m], how[3 + axis, m] = n[axis], lead[axis]
