"""Particles that colliders hold back in an implicit step: its equations are solved across the normal of each, as by
D. Baraff, A. Witkin, Large Steps in Cloth Simulation, SIGGRAPH 1998. What is left of them there, R, is the force that the
collider takes up, of all that weighs on the particle: N = −R·n presses, and friction

- holds what is at rest while |R_t| ≤ μ_s N, and
- is μ_k N against what slides, until that stops.

Contact works for nothing. What has been thrown back leaves no faster than it came, however springs have drawn it in within
the step. And by methods that keep energy a force gives h f·V, with V the velocity in the middle of the step: what friction
could hold only by a force along that is left to itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.implicit.linear_system import (
    ALONG,
    CAUGHT,
    FREE,
    HELD,
    KINETIC,
    LEFT,
    NORMAL,
    RESTS,
    RUBS,
    RUNS,
    SLIDES,
    STATIC,
)
from particlesim.engine.interactions.hard.walls import colliders_of, surface_of, whole
from particlesim.engine.state.columns import fetch, saved, span, type_of
from particlesim.engine.step.contacts import Simple, rounding
from particlesim.engine.step.newton import EPSILON
from particlesim.laws.registry import PASS, gap_and_normal

BEND = 2.0**-4
"""The part of its way in a step by which what has been on a surface may be off it."""
TOUCH = 64
"""Rounding errors of places up to which a particle touches a surface."""


@outlined
def free_along(method: Any, part: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """Let those particles of a group in a share that have met one collider alone move along it, or rest there if friction
    may stop them in the step."""
    s, before, reach = work.system, work.before, type_of(h, method.gamma) * h
    reversible = is_reversible(method)
    for i in range(max(share.first, part.first), min(share.last, part.last)):
        _, hi = span(c.clock, i, t, end, h)
        if s.held[i] == CAUGHT:
            s.held[i] = HELD
            p = fetch(c, i, end)
            begun, p = saved(before, i, p, t), saved(s.ended, i, p, end)
            number, n, u, own, static, kinetic, g = wall_of(part, c, begun, p, h, reversible)
            came = (before[3, i] - u[0], before[4, i] - u[1], before[5, i] - u[2])
            pull = dot(n, (s.near[0, i] - u[0], s.near[1, i] - u[1], s.near[2, i] - u[2]))
            slack = touching(part.contacts, p)
            if (number == 1) & (hi == h):
                leave_slower(method, c, s, before, i, n, u, own, g, slack, h)
                ends = (s.ended[3, i] - u[0], s.ended[4, i] - u[1], s.ended[5, i] - u[2])
                for k in range(3):
                    s.wall[NORMAL + k, i], s.wall[RUNS + k, i] = n[k], u[k]
                s.wall[STATIC, i], s.wall[KINETIC, i] = static, kinetic
                slide, left, most = flat(came, n), flat(ends, n), kinetic * max(-pull, h - h)
                if (static > 0) & (dot(left, left) == 0):
                    s.held[i] = RESTS
                elif (static > 0) & (dot(slide, slide) <= most * most):
                    s.held[i] = RESTS
                    lay(method, c, s, before, i, n, u, dot(n, ends), h)
                else:
                    go_on(c, i, n, before)
                    rubs = (
                        type_of(h, method.mass) * p.m * most / (type_of(h, 2 if method.middle else 1) * reach)
                    )
                    let_slide(c, s, i, n, slide, rubs, reach)


def is_reversible(method: Any) -> bool:
    """Whether a method keeps energy: one by forces in the middle of the step, or at both ends, not at its end alone."""
    return bool(method.middle | (method.slope != 0))


def leave_slower(
    method: Any, c: Any, s: Any, before: Any, i: Any, n: Any, u: Any, own: Any, g: Any, slack: Any, h: Any
) -> None:
    """Have particle i, which has been thrown back, leave its collider no faster than it came, and be where these velocities
    lead, unless that is in the collider; it is g above that, which moves with `own` at the beginning of the step and u at
    the end. By a method that keeps energy what leaves it already, and is drawn back in the step, turns around before it."""
    half, none = type_of(h, 0.5), h - h
    came = dot(n, (before[3, i] - own[0], before[4, i] - own[1], before[5, i] - own[2]))
    leaves = dot(n, (s.ended[3, i] - u[0], s.ended[4, i] - u[1], s.ended[5, i] - u[2]))
    turns = is_reversible(method) & (h * came > slack)
    if (h * leaves > slack) | turns:
        slower, rise = min(leaves, -came if turns else max(-came, none)), none
        for k in range(3):
            rise += n[k] * (before[k, i] + half * h * (own[k] + u[k]) - s.ended[k, i])
        # nor higher than it was: a collider that lifts what was leaving would work
        rise = max(rise + g + half * h * ((came if turns else min(came, none)) + slower), none) - g
        for k, (place, speed) in enumerate(zip((c.x, c.y, c.z), (c.vx, c.vy, c.vz), strict=True)):
            s.ended[k, i] += rise * n[k]
            s.ended[3 + k, i] += (slower - leaves) * n[k]
            place[i], speed[i] = s.ended[k, i], s.ended[3 + k, i]
            if method.middle:
                place[i], speed[i] = half * (place[i] + before[k, i]), half * (speed[i] + before[3 + k, i])


def dot(a: Any, b: Any) -> Any:
    """a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def wall_of(part: Any, c: Any, p: Any, q: Any, h: Any, reversible: Any) -> Any:
    """How many colliders of a group a particle has met that went from p to q; the normal of one, the velocity of its surface
    at the end and at the beginning, its coefficients of friction, and how far above it the particle is. Those that stop or
    kill what touches them, or take a part of its velocity, count as two."""
    number, zero = 0, h - h
    n, u, was = (zero, zero, zero), (zero, zero, zero), (zero, zero, zero)
    static, kinetic, height = zero, zero, zero
    slack, way = touching(part.contacts, q), (q.x - p.x, q.y - p.y, q.z - p.z)
    for collider in colliders_of(part):
        g, axes = gap_and_normal(collider, q)
        up = whole(axes, g)
        own = surface_of(collider, c, q, up, q.t)
        began = surface_of(collider, c, p, up, p.t)
        leaves = dot(up, (q.vx - own[0], q.vy - own[1], q.vz - own[2]))
        came = dot(up, (began[0] - p.vx, began[1] - p.vy, began[2] - p.vz))
        if g <= slack + h * max(leaves, came, zero):
            response = collider.response
            number += 1 if (response.outcome == PASS) & (response.loss == 0) else 2
            n, u, was, height = up, own, began, max(g, zero)
            if reversible:
                started, axes = gap_and_normal(collider, p)
                begun = whole(axes, g)
                if (started <= slack + type_of(h, BEND) * np.sqrt(dot(way, way))) & (
                    dot(begun, up) > type_of(h, 0.5)
                ):
                    n = halfway(begun, up)
            if response.friction is not None:
                static, kinetic = type_of(h, response.friction.static), type_of(h, response.friction.kinetic)
    return number, n, u, was, static, kinetic, height


def halfway(n: Any, m: Any) -> Any:
    """The unit vector between two."""
    x, y, z = n[0] + m[0], n[1] + m[1], n[2] + m[2]
    size = np.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


def touching(contacts: Any, p: Any) -> Any:
    """The gap up to which a particle touches a collider."""
    if isinstance(contacts, Simple):
        return type_of(p.x, TOUCH * EPSILON[type(p.x)]) * (abs(p.x) + abs(p.y) + abs(p.z) + p.r)
    return rounding(contacts, p)


def flat(v: Any, n: Any) -> Any:
    """The part of a vector across a normal."""
    up = dot(v, n)
    return v[0] - up * n[0], v[1] - up * n[1], v[2] - up * n[2]


def lay(method: Any, c: Any, s: Any, before: Any, i: Any, n: Any, u: Any, leaves: Any, h: Any) -> None:
    """Let particle i rest on its collider: it goes on along it only as far as the method says of what stops in the step."""
    half, reach = type_of(h, 0.5), type_of(h, method.gamma) * h
    places, speeds = (c.x, c.y, c.z), (c.vx, c.vy, c.vz)
    off = h - h
    for k in range(3):
        s.ended[3 + k, i] = u[k] + leaves * n[k]
        speeds[k][i] = half * (before[3 + k, i] + s.ended[3 + k, i]) if method.middle else s.ended[3 + k, i]
        off += n[k] * (s.base[k, i] + reach * speeds[k][i] - places[k][i])
    for k in range(3):
        places[k][i] = s.base[k, i] + reach * speeds[k][i] - off * n[k]
        s.ended[k, i] = places[k][i] + places[k][i] - before[k, i] if method.middle else places[k][i]


def go_on(c: Any, i: Any, n: Any, before: Any) -> None:
    """Give particle i along a surface the velocity with which it began the step."""
    speeds = (c.vx, c.vy, c.vz)
    up = dot(n, (c.vx[i] - before[3, i], c.vy[i] - before[4, i], c.vz[i] - before[5, i]))
    for k in range(3):
        speeds[k][i] = before[3 + k, i] + up * n[k]


def let_slide(c: Any, s: Any, i: Any, n: Any, way: Any, rubs: Any, reach: Any) -> None:
    """Free particle i along its collider, such that the method puts it on the surface, with a force of friction against the
    direction in which it goes."""
    places, speeds = (c.x, c.y, c.z), (c.vx, c.vy, c.vz)
    off = reach - reach
    for k in range(3):
        off += n[k] * (places[k][i] - s.base[k, i] - reach * speeds[k][i])
    for k in range(3):
        s.base[k, i] += off * n[k]
        places[k][i] = s.base[k, i] + reach * speeds[k][i]
    size = np.sqrt(dot(way, way))
    for k in range(3):
        s.wall[ALONG + k, i] = way[k] / size if size > 0 else off - off
    s.wall[RUBS, i] = rubs
    s.held[i], s.free[i] = SLIDES, type_of(reach, 1)


@outlined
def rub(method: Any, c: Any, work: Any, share: Any, h: Any, turn: Any) -> bool:
    """Give particles the friction that belongs to what presses them in the present solution; returns whether any that moves
    has some. What rests by more than friction can hold is let go."""
    s, before, some, reach = work.system, work.before, False, type_of(h, method.gamma) * h
    wall, none, reversible = s.wall, reach - reach, is_reversible(method)
    for i in range(share.first, share.last):
        if s.held[i] >= RESTS:
            n = wall[0, i], wall[1, i], wall[2, i]
            r = wall[LEFT, i], wall[LEFT + 1, i], wall[LEFT + 2, i]
            if method.linear:
                r = r[0] - s.product[0, i], r[1] - s.product[1, i], r[2] - s.product[2, i]
            press = max(-dot(n, r), none)
            pull, most = flat(r, n), wall[KINETIC, i] * press
            u = wall[RUNS, i], wall[RUNS + 1, i], wall[RUNS + 2, i]
            came = before[3, i] - u[0], before[4, i] - u[1], before[5, i] - u[2]
            if s.held[i] == RESTS:
                if reversible & (dot(pull, came) < 0):
                    let_slide(c, s, i, n, (none, none, none), most, reach)
                    some = True
                elif dot(pull, pull) > (wall[STATIC, i] * press) ** 2:
                    let_slide(c, s, i, n, pull, most, reach)
                    some = True
            elif (turn > 0) & (wall[RUBS, i] > 0) and goes_ahead(method, c, s, before, i) < 0:
                ended = s.ended[3, i] - u[0], s.ended[4, i] - u[1], s.ended[5, i] - u[2]
                lay(method, c, s, before, i, n, u, dot(n, ended), h)
                s.held[i], s.free[i], wall[STATIC, i] = RESTS, none, np.inf
                some = True
            else:
                wall[RUBS, i] = most
                some |= (turn == 0) & (most > 0)
    return some


def goes_ahead(method: Any, c: Any, s: Any, before: Any, i: Any) -> Any:
    """How fast particle i ends the step in the direction in which it slides [m/s]; friction turns nothing around."""
    ahead = before[3, i] - before[3, i]
    for k, speed in enumerate((c.vx, c.vy, c.vz)):
        v = speed[i] + speed[i] - before[3 + k, i] if method.middle else speed[i]
        ahead += s.wall[ALONG + k, i] * (v - s.wall[RUNS + k, i])
    return ahead


def recollect_pull(c: Any, free: Any, before: Any, i: Any, h: Any) -> None:
    """Have the method remember of particle i, which a collider has held back, that it came where it is under the force that
    the solution has found, with which it would have the velocity `free`. The present force may be that of a stiff spring,
    and by so much in a step it would be thrown away."""
    if len(c.memory) > 0:
        for axis, speed in enumerate((c.vx, c.vy, c.vz)):
            change = free[axis] - before[3 + axis, i]
            c.memory[axis][i] = h * (speed[i] - type_of(h, 0.5) * change)
            c.memory[3 + axis][i] = change
        c.memory[6][i] = h


def end_along(method: Any, c: Any, work: Any, share: Any, h: Any) -> None:
    """What is held ends the step where colliders have it, and what slides where the solution has it along them. Methods that
    look back see no more of a landing than of rest."""
    s = work.system
    places, speeds = (c.x, c.y, c.z), (c.vx, c.vy, c.vz)
    for i in range(share.first, share.last):
        v = (work.before[3, i], work.before[4, i], work.before[5, i])
        if s.held[i] == SLIDES:
            n, ended = s.wall[:3, i], s.ended[:, i]
            off, up, back = h - h, h - h, h - h
            for k in range(3):
                back += s.wall[ALONG + k, i] * (speeds[k][i] - s.wall[RUNS + k, i])
            back = min(back, h - h) if method.linear and s.wall[RUBS, i] > 0 else h - h
            for k in range(3):
                speeds[k][i] -= back * s.wall[ALONG + k, i]
                places[k][i] -= h * back * s.wall[ALONG + k, i]
                off += n[k] * (places[k][i] - ended[k])
                up += n[k] * (speeds[k][i] - ended[3 + k])
            for k in range(3):
                places[k][i] -= off * n[k]
                speeds[k][i] -= up * n[k]
            rise = dot(n, (v[0] - c.vx[i], v[1] - c.vy[i], v[2] - c.vz[i]))
            v = (c.vx[i] + rise * n[0], c.vy[i] + rise * n[1], c.vz[i] + rise * n[2])
            recollect_pull(c, v, work.before, i, h)
        elif s.held[i] != FREE:
            for k in range(3):
                places[k][i], speeds[k][i] = s.ended[k, i], s.ended[3 + k, i]
            if s.held[i] == RESTS:
                recollect_pull(c, v, work.before, i, h)
