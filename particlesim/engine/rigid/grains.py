"""Particles that touch rigid bodies: impulses between steps.

At the beginning of a step the way of every particle, as a body sees it, is followed up to the end of the step. The distance
from a convex piece is a convex function of the time on a straight way, so Newton's method comes to where it touches, and
never beyond; thin bodies hold back fast particles. There the impulse P at the place of contact is as between bodies,

    u·n ≥ s,  P·n ≥ 0,  (u·n − s) P·n = 0,   |P_t| ≤ μ P·n,

with u the velocity of the particle relative to the surface, and s = −e u·n for an impact, or the approach that the gap
leaves room for where the two have touched in the step before: what lies does not rebound. Both get opposite impulses, which
are found together (projected Gauss and Seidel). As between particles friction acts on the centre of a particle, which does
not turn.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies.pieces import BOX, CAPSULE, CYLINDER, HULL, SPHERE
from particlesim.compiler import kernel, on_stack, outlined
from particlesim.engine.rigid.bodies import orientation, place, row
from particlesim.engine.rigid.convex import nearest
from particlesim.engine.rigid.narrow import box_distance, box_normal, clamped, minus, plus
from particlesim.engine.rigid.pieces import Solid, solid_of
from particlesim.engine.rigid.rotation import (
    angular_velocity,
    cross,
    dot,
    matrix,
    to_body,
    to_world,
    turned_by,
    world_inverse,
)

HOPS = 48
"""Steps of Newton's method at most."""
NEAR = 1e-6
"""Distance that counts as touching, in units of the smallest size of a piece."""
SWEEPS = 40
SETTLED = 1e-10
"""Sweeps over all contacts at most; relative change of a speed below which nothing changes any more."""
PART = 0.2
"""Part of an overlap that is taken away in a step."""


class Grains(NamedTuple):
    """Particles that may touch bodies [n]: places and velocities [3, n], radii, 1/m, 0 for those that are held, ids."""

    x: Any
    v: Any
    radius: Any
    w: Any
    id: Any


class Touches(NamedTuple):
    """Contacts of particles and bodies [k]: which; the normal from the body to the particle, the way from the centre of the
    body to the place of contact [3, k]; the gap now; speed to be reached; impulses [k, 3]; number, and how many found no
    room [2]."""

    grain: Any
    body: Any
    normal: Any
    arm: Any
    gap: Any
    target: Any
    impulse: Any
    number: Any


def new_touches(room: int) -> Touches:
    """Room for contacts."""
    grain, body = np.zeros(room, np.int64), np.zeros(room, np.int64)
    return Touches(
        grain,
        body,
        np.zeros((3, room)),
        np.zeros((3, room)),
        np.zeros(room),
        np.zeros(room),
        np.zeros((room, 3)),
        np.zeros(2, np.int64),
    )


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
def find_touches(b: Any, first: Any, last: Any, g: Any, k: Any, h: Any) -> None:
    """Note the contacts that particles have with bodies [first, last) now, or would come to within a time h."""
    found, best = on_stack(1, 9, np.float64), on_stack(1, 8, np.float64)
    p = b.pieces
    for i in range(first, last):
        x, r = place(b, i), matrix(orientation(b, i))
        omega = angular_velocity(orientation(b, i), row(b.spin, i), row(b.inertia, i))
        drift = (b.v[0, i], b.v[1, i], b.v[2, i])
        group = b.group[i]
        for m in range(g.w.size):
            at = (g.x[0, m], g.x[1, m], g.x[2, m])
            d = minus(at, x)
            u = minus((g.v[0, m], g.v[1, m], g.v[2, m]), drift)
            far = np.sqrt(dot(d, d)) - b.reach[i] - g.radius[m]
            if far < h * np.sqrt(dot(u, u)):
                u = minus(u, cross(omega, d))
                best[0, 0] = np.inf
                for number in range(p.first[group], p.first[group + 1]):
                    follow(p, solid_of(p, number, x, r), k, i, m, x, at, u, g.radius[m], h, found, best)
                if 0 < best[0, 0] <= h:
                    n, arm = (best[0, 1], best[0, 2], best[0, 3]), (best[0, 4], best[0, 5], best[0, 6])
                    note(k, m, i, n, arm, best[0, 7])


@outlined
def follow(
    p: Any,
    s: Any,
    k: Any,
    i: Any,
    m: Any,
    center: Any,
    at: Any,
    u: Any,
    radius: Any,
    h: Any,
    found: Any,
    best: Any,
) -> None:
    """Follow the way of particle m, which moves with u as body i sees it, to a piece.

    All pieces that it touches now are noted; of those that it would come to, the first one is kept in `best` [1, 8]: when,
    the normal, the way from the centre of the body, the gap now.
    """
    close = NEAR * p.fine[s.number]
    now, n = away_from(p, s, at, found)
    now -= radius
    gap, t, x = now, 0.0, at
    falls = -dot(u, n)
    for _ in range(HOPS):
        if gap <= close or not falls > 0 or t > h:
            break
        t += gap / falls
        x = plus(at, t, u)
        gap, n = away_from(p, s, x, found)
        gap -= radius
        falls = -dot(u, n)
    arm = plus(minus(x, center), -(radius + gap), n)
    if now <= close:
        if falls > 0 or now < 0:  # what overlaps and moves apart is still to be moved apart
            note(k, m, i, n, arm, now)
            best[0, 0] = -np.inf
    elif falls > 0 and t <= h and t < best[0, 0]:
        best[0, 0], best[0, 7] = t, now
        best[0, 1], best[0, 2], best[0, 3] = n
        best[0, 4], best[0, 5], best[0, 6] = arm


def note(k: Any, m: Any, i: Any, n: Any, arm: Any, gap: Any) -> None:
    """Note a contact."""
    number = k.number[0]
    if number >= k.grain.size:
        k.number[1] += 1
        return
    k.grain[number], k.body[number], k.gap[number] = m, i, gap
    for axis in range(3):
        k.impulse[number, axis] = 0.0
    k.normal[0, number], k.normal[1, number], k.normal[2, number] = n
    k.arm[0, number], k.arm[1, number], k.arm[2, number] = arm
    k.number[0] = number + 1


@kernel
def exchange(b: Any, g: Any, k: Any, known: Any, e: Any, static: Any, kinetic: Any, h: Any) -> None:
    """Find and give the impulses of all contacts; `known` [k]: whether the two have touched in the step before."""
    inverse = on_stack(1, 6, np.float64)
    largest = 0.0
    for c in range(k.number[0]):
        m, i = k.grain[c], k.body[c]
        u = dot(meeting(b, g, k, c, m, i), row(k.normal, c))
        k.target[c] = -max(k.gap[c], 0.0) / h if known[c] or not u < 0 else -e * u
        largest = max(largest, abs(u))
    for _ in range(SWEEPS):
        worst = 0.0
        for c in range(k.number[0]):
            m, i = k.grain[c], k.body[c]
            world_inverse(orientation(b, i), row(b.inertia, i), inverse[0])
            n = row(k.normal, c)
            u = meeting(b, g, k, c, m, i)
            had = dot((k.impulse[c, 0], k.impulse[c, 1], k.impulse[c, 2]), n)
            give = yields(b, g, k, c, m, i, n, inverse[0])
            press = max(had - (dot(u, n) - k.target[c]) / give, 0.0)
            add(b, g, k, c, m, i, (n[0] * (press - had), n[1] * (press - had), n[2] * (press - had)))
            worst = max(worst, abs(press - had) * give)
            if static > 0:
                worst = max(worst, rub(b, g, k, c, m, i, n, press, static, kinetic, inverse[0]))
        if not worst > SETTLED * largest:
            break
    for c in range(k.number[0]):
        m, i = k.grain[c], k.body[c]
        both = g.w[m] + b.w[i]
        if k.gap[c] < 0 and both > 0:
            n, out = row(k.normal, c), -PART * k.gap[c] / both
            for axis in range(3):
                g.x[axis, m] += out * g.w[m] * k.normal[axis, c]
                b.x[axis, i] -= out * b.w[i] * k.normal[axis, c]


def meeting(b: Any, g: Any, k: Any, c: Any, m: Any, i: Any) -> Any:
    """Velocity of the particle of a contact relative to the surface of its body."""
    omega = angular_velocity(orientation(b, i), row(b.spin, i), row(b.inertia, i))
    surface = plus((b.v[0, i], b.v[1, i], b.v[2, i]), 1.0, cross(omega, row(k.arm, c)))
    return minus((g.v[0, m], g.v[1, m], g.v[2, m]), surface)


def yields(b: Any, g: Any, k: Any, c: Any, m: Any, i: Any, n: Any, inverse: Any) -> Any:
    """Change of the relative velocity along a direction by an impulse of 1 N s along it [1/kg]."""
    arm = cross(row(k.arm, c), n)
    return g.w[m] + b.w[i] + dot(arm, turned_by(inverse, arm))


def add(b: Any, g: Any, k: Any, c: Any, m: Any, i: Any, impulse: Any) -> None:
    """Give a particle an impulse, and its body the opposite one."""
    twist = cross(row(k.arm, c), impulse)
    for axis in range(3):
        part = impulse[0] if axis == 0 else (impulse[1] if axis == 1 else impulse[2])
        turn = twist[0] if axis == 0 else (twist[1] if axis == 1 else twist[2])
        k.impulse[c, axis] += part
        g.v[axis, m] += g.w[m] * part
        b.v[axis, i] -= b.w[i] * part
        b.spin[axis, i] -= turn


@outlined
def rub(
    b: Any,
    g: Any,
    k: Any,
    c: Any,
    m: Any,
    i: Any,
    n: Any,
    press: Any,
    static: Any,
    kinetic: Any,
    inverse: Any,
) -> float:
    """Bring the friction of a contact nearer to what it is; returns the change of the speed along the surface."""
    u = meeting(b, g, k, c, m, i)
    u = plus(u, -dot(u, n), n)
    speed = np.sqrt(dot(u, u))
    had = (k.impulse[c, 0], k.impulse[c, 1], k.impulse[c, 2])
    had = plus(had, -dot(had, n), n)
    wish = had
    give = 1.0
    if speed > 0:
        along = (u[0] / speed, u[1] / speed, u[2] / speed)
        give = yields(b, g, k, c, m, i, along, inverse)
        wish = plus(had, -speed / give, along)
    size = np.sqrt(dot(wish, wish))
    if size > static * press:
        part = kinetic * press / size
        wish = (wish[0] * part, wish[1] * part, wish[2] * part)
    change = minus(wish, had)
    add(b, g, k, c, m, i, change)
    return float(np.sqrt(dot(change, change)) * give)
