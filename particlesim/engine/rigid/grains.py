"""Particles that touch rigid bodies.

Those that may touch a body in a step are its guests: spheres among the bodies for that step, whose impulses are found
together with those of all bodies and colliders (`solver`). So a grain on a box on a floor lies as still as another box
would. A guest that does not rotate has an infinite moment of inertia.

The path of a guest in the frame of a body is followed to the first contact. The distance from a convex piece is a convex
function of time on a straight path, so Newton's method converges to that time and never passes it; thin bodies hold back
fast particles. The contact points of an impact at the time t, counted from the middle of the step, are those at t. As
impulses are given in the middle of the step, both are shifted afterwards to where they would be if the impulse had been
given at t: the body by −ΔV t, the guest by −Δv (h/2 + t), as its own method moves it with its new velocity from the
beginning of the step on. So momentum and angular momentum are kept to rounding. To be moved takes work against the forces
that act on them, F·Δv times that; the speed of an impact is therefore the one that forces have made by then (`solver.aim`),
which needs to know what acts on guests (`asks`). What the change of those forces on the way takes, of springs k/2 times the
square of the shift, comes from the rebound (`timing.answered`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies.pieces import BOX, CAPSULE, CYLINDER, HULL, SPHERE
from particlesim.compiler import kernel, on_stack, outlined
from particlesim.engine.rigid.bodies import (
    GRAINS,
    GUEST,
    add_contact,
    name_contact,
    orientation,
    place,
    row,
    set_fall,
    set_surface,
)
from particlesim.engine.rigid.cells import gather_at, sort
from particlesim.engine.rigid.convex import nearest
from particlesim.engine.rigid.narrow import box_distance, box_normal, clamped, entry, minus, plus
from particlesim.engine.rigid.pieces import Solid, solid_of
from particlesim.engine.rigid.rolling import ROLLING
from particlesim.engine.rigid.rotation import cross, dot, matrix, normalised, rotated, to_body, to_world
from particlesim.engine.rigid.stops import ROLL
from particlesim.engine.rigid.support import lies_on_collider
from particlesim.model.quaternions import times

HOPS = 48
"""Steps of Newton's method at most."""
NEAR = 1e-6
"""Distance that counts as touching, in units of the smallest size of a piece."""
FAST = 0.5
"""Way relative to a body in a step, in radii, from which on it matters whom else a particle meets first."""
ROUNDING = 1e-12
"""Part of an energy of rotation that rounding makes."""
DEEP, BESIDE = 0.5, 0.5
"""How deep a guest may be in a body after its own step, and how far beside one a particle is its guest at any speed, as what
else acts on it may pull it there: as parts of its radius."""
LEFT = 0.01
"""The part of the overlap that bodies are left which guests are."""


class Guests(NamedTuple):
    """Particles among bodies for a step: number of the first; their kinds, radii and ids [n]; by kind and group of bodies
    whether they touch, restitution, static and kinetic friction, the speed above which restitution falls and how fast,
    rolling friction, and 1 where all sides of the bodies are flat [kinds, groups].

    Of the step: when each hits something, from the middle of the step on, 0 if it touches something already or hits nothing
    [n]; where it is taken to be [3, n]; by how much the time of its impact moves it [3, n]; the force of what acts on
    particles alone [N] [3, n] (`other`); which of them springs and rods tie to bodies, and for which it counts [n]
    (`awaits`): for what is tied, and for what touches something already; whose impacts on bodies that are `free` [bodies]
    are left to their own step, as they come far in it [n] (`swift`), and whose are in this one (`alone` [n]). How many of
    the first ones rods hold. How much what else acts on those that are not tied accelerates them at its beginning [m/s²]
    [3, n] (`pull`), once that has been `asked` for [1]: not before one of them touches something, 1, or hits it, 2. About
    where the impulse of an impact will shift them [3, n] (`probe`), and how much faster that makes what acts on them pull
    them back, for every metre [1/s²] [n] (`bend`). By which part of the step before its middle what lies on a body is
    pressed on it, on the average: half where all of the kick is at the beginning [n] (`lag`). What they lie on besides, and
    those that do (`support`).
    """

    first: int
    kind: Any
    radius: Any
    id: Any
    touch: Any
    restitution: Any
    static: Any
    kinetic: Any
    speed: Any
    exponent: Any
    rolling: Any
    flat: Any
    when: Any
    at: Any
    shift: Any
    other: Any
    tied: Any
    awaits: Any
    swift: Any
    free: Any
    alone: Any
    held: int
    pull: Any
    asked: Any
    probe: Any
    bend: Any
    lag: Any
    support: Any
    crowd: Any


def away_from(p: Any, s: Any, x: Any, found: Any) -> Any:
    """The signed distance of a place from a piece, and the unit vector from there to the place."""
    own = to_body(s.r, minus(x, s.x))
    if s.kind == BOX:
        return box_distance(s.size, own), to_world(s.r, box_normal(s.size, own))
    if s.kind == SPHERE or s.kind == CAPSULE:
        level = clamped(own[2], -s.size[1], s.size[1])
        d = (own[0], own[1], own[2] - level)
        length = np.sqrt(dot(d, d))
        n = (d[0] / length, d[1] / length, d[2] / length) if length > 0 else (1.0, 0.0, 0.0)
        return length - s.size[0], to_world(s.r, n)
    if p.corners is not None:
        depth, n = inside(p, s, own)
        if depth <= 0:
            return depth, to_world(s.r, n)
        point = Solid(s.number, SPHERE, (0.0, 0.0, 0.0), x, s.r)
        distance = nearest(p, point, s, 1.0, found)
        if distance > 0:
            return distance, (found[0, 0], found[0, 1], found[0, 2])
        return depth, to_world(s.r, n)
    return np.inf, (1.0, 0.0, 0.0)


@outlined
def inside(p: Any, s: Any, a: Any) -> Any:
    """How far a place is above that flat or round side of a piece which it is farthest above: negative inside."""
    if s.kind == HULL:
        best, face = -np.inf, 0
        for f in range(p.first_face[s.number], p.first_face[s.number + 1]):
            above = p.planes[0, f] * a[0] + p.planes[1, f] * a[1] + p.planes[2, f] * a[2] - p.planes[3, f]
            if above > best:
                best, face = above, f
        return best, (p.planes[0, face], p.planes[1, face], p.planes[2, face])
    across = np.sqrt(a[0] * a[0] + a[1] * a[1])
    c, e = (a[0] / across, a[1] / across) if across > 0 else (1.0, 0.0)
    if s.kind == CYLINDER:
        out, over = across - s.size[0], abs(a[2]) - s.size[1]
        if out > over:
            return out, (c, e, 0.0)
        return over, (0.0, 0.0, np.copysign(1.0, a[2]))
    slope = np.sqrt(s.size[0] * s.size[0] + s.size[1] * s.size[1])
    rise, run = s.size[0] / slope, s.size[1] / slope
    out, under = run * across + rise * (a[2] - 0.75 * s.size[1]), -0.25 * s.size[1] - a[2]
    if out > under:
        return out, (run * c, run * e, rise)
    return under, (0.0, 0.0, -1.0)


@kernel
def near_bodies(
    b: Any, touch: Any, x: Any, v: Any, radius: Any, slop: Any, h: Any, cells: Any, around: Any, near: Any
) -> None:
    """Which particles may come to bodies within a time h, into near [n]: 3 of those that come far by then for their size, 2
    of others that touch one already, within about the slop; `touch` [groups]: bodies that they touch. With `cells` for the
    bodies, and room for those `around` one [b]."""
    found, p, bodies = on_stack(1, 9, np.float64), b.pieces, b.w.size
    sort(cells, b, bodies, 1.5 * h)
    for m in range(radius.size):
        at, own = row(x, m), row(v, m)
        for k in range(
            gather_at(cells, at, (1 + BESIDE) * radius[m] + 1.5 * h * np.sqrt(dot(own, own)), bodies, around)
        ):
            i = around[k]
            if touch[b.group[i]] > 0:
                d, u = minus(at, place(b, i)), minus(own, row(b.v, i))
                reach = b.reach[i] + (1 + BESIDE) * radius[m] + 1.5 * h * np.sqrt(dot(u, u))
                if dot(d, d) < reach * reach:
                    swift = h * np.sqrt(dot(u, u)) > FAST * radius[m]
                    near[m] = max(near[m], 3 if swift else 1)
                    if near[m] == 1 and touches_body(p, b, i, at, radius[m] + 2 * slop, found):
                        near[m] = 2


@outlined
def touches_body(p: Any, b: Any, i: Any, at: Any, radius: Any, found: Any) -> bool:
    """Whether a sphere touches body i."""
    touches, r = False, matrix(orientation(b, i))
    for number in range(p.first[b.group[i]], p.first[b.group[i] + 1]):
        if not touches:
            away, _ = away_from(p, solid_of(p, number, place(b, i), r), at, found)
            touches = away < radius
    return touches


@kernel
def depths_in(b: Any, group: Any, x: Any, radius: Any, depth: Any, which: Any) -> None:
    """How deep particles at x [3, n] are in bodies of a group [m], into depth [n], and in which, into which [n]."""
    found, p = on_stack(1, 9, np.float64), b.pieces
    for i in range(b.w.size):
        if b.group[i] == group:
            r = matrix(orientation(b, i))
            for m in range(radius.size):
                at = (x[0, m], x[1, m], x[2, m])
                d = minus(at, place(b, i))
                if dot(d, d) < (b.reach[i] + radius[m]) ** 2:
                    for number in range(p.first[group], p.first[group + 1]):
                        away, _ = away_from(p, solid_of(p, number, place(b, i), r), at, found)
                        if radius[m] - away > depth[m]:
                            depth[m], which[m] = radius[m] - away, i


@kernel
def put_out(b: Any, guests: Any, x: Any, here: Any) -> bool:
    """Put guests at x [3, n] that are `here` [n], touch bodies alone, and have come deep into one in their own step, as
    where springs pull them, less deep into it; whether there are any. Further out they would take more energy of springs."""
    found, p, some = on_stack(1, 9, np.float64), b.pieces, False
    for m in range(guests.radius.size):
        radius, kind = guests.radius[m], guests.kind[m]
        for i in range(guests.first if here[m] > 0 and guests.crowd.linked[m] == 0 else 0):
            group, d = b.group[i], minus(row(x, m), place(b, i))
            if guests.touch[kind, group] > 0 and dot(d, d) < (b.reach[i] + radius) ** 2:
                r = matrix(orientation(b, i))
                for number in range(p.first[group], p.first[group + 1]):
                    away, n = away_from(p, solid_of(p, number, place(b, i), r), row(x, m), found)
                    if away - radius < -DEEP * radius:
                        x[0, m], x[1, m], x[2, m] = plus(row(x, m), (1 - DEEP) * radius - away, n)
                        some = True
    return some


@outlined
def find_guests(guests: Any, joined: Any, b: Any, k: Any, motion: Any, slop: Any, t: Any, h: Any) -> None:
    """Note the contacts that guests have with bodies in a step of length h, whose middle is at t; the bodies that joints
    hold are `joined`, None where none are. What lies on a collider is no swift guest, however swift the body is."""
    found, best = on_stack(1, 9, np.float64), on_stack(1, 2, np.float64)
    p = b.pieces
    find_free(guests, joined, k)
    for m in range(guests.radius.size):
        guest, which = guests.first + m, -1
        at, radius, kind = place(b, guest), guests.radius[m], guests.kind[m]
        best[0, 0], guests.alone[m], guests.crowd.hit[m] = np.inf, 0, -1
        for axis in range(3):
            guests.shift[axis, m] = guests.probe[axis, m] = 0.0
            if m >= guests.held:  # rods bend the way of others
                guests.crowd.began[axis, m] = b.x[axis, guest] - 0.5 * h * motion.now[guest, axis]
        swift = guests.swift[m] > 0 and not lies_on_collider(guests, motion, m, t, h)
        for i in range(guests.first):
            group = b.group[i]
            if guests.touch[kind, group] > 0:
                x, now, other = place(b, i), motion.now[i], motion.now[guest]
                d = minus(at, x)
                u = (other[0] - now[0], other[1] - now[1], other[2] - now[2])
                far = np.sqrt(dot(d, d)) - b.reach[i] - radius
                if far < h * np.sqrt(dot(u, u)) + slop:
                    u = minus(u, cross((now[3], now[4], now[5]), d))
                    r, had = matrix(orientation(b, i)), best[0, 0]
                    begin = k.number[0]
                    for number in range(p.first[group], p.first[group + 1]):
                        s = solid_of(p, number, x, r)
                        if swift and guests.free[i] > 0 and falls_on(p, s, at, u, slop, h, found):
                            guests.alone[m] = 1
                        else:
                            late = h * guests.lag[m]
                            follow(p, s, k, i, guest, guests.id[m], at, u, radius, slop, h, late, found, best)
                    meet(guests, b, k, begin, kind, group)
                    if best[0, 0] < had:
                        which = i
        guests.when[m], guests.crowd.press[m] = 0.0, best[0, 1] if best[0, 0] < 0 else 0.0
        if m < guests.held:  # what rods hold meets colliders with all that they join
            now = motion.now[guest]
            guests.crowd.press[m] = np.sqrt(now[0] ** 2 + now[1] ** 2 + now[2] ** 2)
        guests.awaits[m] = 1 if guests.tied[m] > 0 or best[0, 0] < 0 else 0
        if swift and 0 < best[0, 0] <= h and guests.free[which] > 0:
            guests.alone[m], best[0, 0] = 1, np.inf
        if 0 < best[0, 0] <= h:
            guests.alone[m] = 0
            group, begin, when = b.group[which], k.number[0], best[0, 0] - 0.5 * h
            n, beside = on_impact(p, b, motion, which, guest, int(best[0, 1]), when, found)
            guests.when[m] = when
            b.x[0, guest], b.x[1, guest], b.x[2, guest] = plus(place(b, which), 1.0, beside)
            where = plus(place(b, guest), -radius, n)
            number = add_contact(k, which, guest, GRAINS + guests.id[m], where, (-n[0], -n[1], -n[2]), 0.0)
            name_contact(k, number, which, GUEST)
            guests.crowd.hit[m] = number
            if number >= 0:
                # Others are not moved to where they would be if the impulse had been given then.
                k.late[0, number], k.late[1, number] = best[0, 0], dot(row(guests.pull, m), n)
                k.late[2, number] = best[0, 0] if guests.free[which] > 0 else 0.5 * h
                k.late[3, number] = guests.bend[m] * b.w[guest] * best[0, 0] ** 2
            back = shift_back(guests, b, k, motion, which, guest, n) * best[0, 0]
            for axis in range(3):
                guests.probe[axis, m] = -back * entry(n, axis)
            meet(guests, b, k, begin, kind, group)
        for axis in range(3):
            guests.at[axis, m] = b.x[axis, guest]


def shift_back(guests: Any, b: Any, k: Any, motion: Any, i: Any, guest: Any, n: Any) -> float:
    """About how fast the impulse of an impact without spin makes a guest along the normal; 0 without rebound."""
    kind, group = guests.kind[guest - guests.first], b.group[i]
    e = guests.restitution[kind, group]
    body, own, w = motion.now[i], motion.now[guest], b.w[guest]
    u = dot((body[0] - own[0], body[1] - own[1], body[2] - own[2]), n)
    if k.falls is not None:
        e = e * max(u / guests.speed[kind, group], 1.0) ** (-guests.exponent[kind, group])
    return (1 + e) * max(u, 0.0) * w / (w + b.w[i]) if e > 0 and w > 0 else 0.0


@outlined
def on_impact(p: Any, b: Any, motion: Any, i: Any, guest: Any, number: Any, when: Any, found: Any) -> Any:
    """The normal of a piece at a guest at the time of their impact, counted from the middle of the step, and where the guest
    is then from the centre of body i, which has turned since."""
    body, own, x = motion.now[i], motion.now[guest], place(b, i)
    spin = (body[3], body[4], body[5])
    beside = minus(place(b, guest), x)
    beside = plus(beside, when, (own[0] - body[0], own[1] - body[1], own[2] - body[2]))
    s = solid_of(p, number, x, matrix(orientation(b, i)))
    _, n = away_from(p, s, plus(x, 1.0, rotated(beside, spin, -when)), found)
    return rotated(n, spin, when), beside


def meet(guests: Any, b: Any, k: Any, begin: Any, kind: Any, group: Any) -> None:
    """The effect of the contacts of a guest from one on, and their rolling friction."""
    end, friction = k.number[0], guests.rolling[kind, group]
    for number in range(begin, end):
        e, static = guests.restitution[kind, group], guests.static[kind, group]
        set_surface(k, number, e, static, guests.kinetic[kind, group])
        if k.falls is not None:
            set_fall(k, number, 0, e, guests.speed[kind, group], guests.exponent[kind, group])
    if friction > 0:
        for number in range(begin, end):
            if b.inertia[0, k.second[number]] < np.inf:
                roll(b, k, number, friction, guests.flat[kind, group])


def roll(b: Any, k: Any, c: Any, friction: Any, flat: Any) -> None:
    """Note the rolling friction of a guest at contact c (`rolling`)."""
    i, guest, n, at = k.first[c], k.second[c], row(k.normal, c), row(k.point, c)
    number = add_contact(k, i, guest, ROLLING + k.feature[c], at, n, 0.0)
    set_surface(k, number, 0.0, friction, friction)
    name_contact(k, number, i, GUEST)
    if number >= 0:
        size, other = b.reach[guest], abs(dot(minus(at, place(b, i)), n))
        k.turns[number], k.aim[0, number] = ROLL, c
        k.aim[1, number] = size if flat > 0 else size * other / (size + other)


def find_free(guests: Any, joined: Any, k: Any) -> None:
    """Find the bodies that touch no collider and no other body, and are in no joint."""
    for i in range(guests.first):
        guests.free[i] = 1 if joined is None or joined[i] == 0 else 0
    for c in range(k.number[0]):
        for i in (k.first[c], k.second[c]):
            if 0 <= i < guests.first:
                guests.free[i] = 0


def falls_on(p: Any, s: Any, at: Any, u: Any, slop: Any, h: Any, found: Any) -> Any:
    """Whether a guest comes to a piece, or further into it, by more than contacts tolerate in a step."""
    _, n = away_from(p, s, plus(at, -0.5 * h, u), found)
    return -h * dot(u, n) > slop


@outlined
def follow(
    p: Any,
    s: Any,
    k: Any,
    i: Any,
    guest: Any,
    id: Any,
    at: Any,
    u: Any,
    radius: Any,
    slop: Any,
    h: Any,
    late: Any,
    found: Any,
    best: Any,
) -> None:
    """Follow the way of a guest, which moves with u as body i sees it, from the beginning of the step to a piece.

    All pieces that it touches there are noted, with their normals a time `late` before the middle of the step, when forces
    press it on them: elsewhere they would slow down, or drive, what slides along a round side. Of those that it would come
    to, the first one is kept in `best` [1, 2]: when, and its number; once it touches one, minus infinity, and how fast they
    come together.
    """
    x = plus(at, -0.5 * h, u)
    now, n = away_from(p, s, x, found)
    now -= radius
    falls = -dot(u, n)
    # What comes fast, though it is near already, has an impact of its own.
    flies = now > NEAR * p.fine[s.number] and h * falls > slop
    if now <= max(NEAR * p.fine[s.number], slop) and not flies:
        _, n = away_from(p, s, plus(at, -late, u), found)
        where = plus(at, -(radius + 0.5 * now), n)
        # What is deeper than a little is pushed out of it: of the overlap that bodies are left a guest has next to none.
        gap = now - (1 - LEFT) * slop if now < 0 else now
        number = add_contact(k, i, guest, GRAINS + id, where, (-n[0], -n[1], -n[2]), gap)
        name_contact(k, number, i, GUEST)
        best[0, 1] = max(falls, best[0, 1] if best[0, 0] < 0 else 0.0)
        best[0, 0] = -np.inf
        return
    gap, t = now, 0.0
    for _ in range(HOPS):
        if gap <= NEAR * p.fine[s.number] or not falls > 0 or t > h:
            break
        t += gap / falls
        x = plus(at, t - 0.5 * h, u)
        gap, n = away_from(p, s, x, found)
        gap -= radius
        falls = -dot(u, n)
    if falls > 0 and t <= h and t < best[0, 0]:
        best[0, 0], best[0, 1] = t, s.number


def asks(guests: Any, k: Any) -> bool:
    """Whether a guest hits or touches a body, and it is not known yet what else acts on it."""
    hits = False
    if guests.asked[0] < 2:
        for c in range(k.number[0]):
            hits |= k.late[0, c] > 0
    if guests.asked[0] == 0:
        for m in range(guests.radius.size):
            hits |= guests.awaits[m] > guests.tied[m]
    return hits


def turn_back(b: Any, k: Any, c: Any, when: Any) -> None:
    """Turn the body of a contact to where it would be if its impulse had been given at a time after the middle."""
    i, q = k.first[c], orientation(b, k.first[c])
    x = y = z = 0.0
    for d in range(3):
        part = -0.5 * when * k.impulse[c, d]
        x += part * k.rows[c, d, 9]
        y += part * k.rows[c, d, 10]
        z += part * k.rows[c, d, 11]
    p = times((0.0, x, y, z), q)
    q = normalised((q[0] + p[0], q[1] + p[1], q[2] + p[2], q[3] + p[3]))
    if not energy_at(b, i, q) > (1 + ROUNDING) * energy_at(b, i, orientation(b, i)):
        b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q


def energy_at(b: Any, i: Any, q: Any) -> float:
    """Twice the energy of rotation of a body with another orientation [J]."""
    own = to_body(matrix(q), row(b.spin, i))
    return own[0] ** 2 / b.inertia[0, i] + own[1] ** 2 / b.inertia[1, i] + own[2] ** 2 / b.inertia[2, i]


@outlined
def settle_guests(scene: Any, b: Any, k: Any, h: Any) -> None:
    """Move bodies that are free to where they would be if impacts of guests had been at their times; note the same for
    guests."""
    guests = scene.guests
    for c in range(k.number[0]):
        if k.late[0, c] > 0:
            guests.when[k.second[c] - guests.first] = k.late[3, c] - 0.5 * h
    for c in range(k.number[0]):
        guest, m = k.second[c], k.second[c] - guests.first
        if m >= 0 and guests.when[m] != 0:
            for axis in range(3):
                total = 0.0
                for d in range(3):
                    total += k.rows[c, d, axis] * k.impulse[c, d]
                if guests.free[k.first[c]] > 0:
                    b.x[axis, k.first[c]] -= guests.when[m] * b.w[k.first[c]] * total
                guests.shift[axis, m] += guests.when[m] * b.w[guest] * total
            if guests.free[k.first[c]] > 0:
                turn_back(b, k, c, guests.when[m])
        m = k.first[c] - guests.first
        if m >= 0 and guests.when[m] != 0:
            for axis in range(3):
                for d in range(3):
                    part = k.rows[c, d, axis] * k.impulse[c, d]
                    guests.shift[axis, m] -= guests.when[m] * b.w[k.first[c]] * part
