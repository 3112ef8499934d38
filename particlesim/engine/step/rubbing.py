"""Friction of colliders on spheres that rotate, from the normal impulses of impacts and resting contact without friction.

The surface of a sphere slides over a collider at u = v_t − r ω × n, less the velocity of the collider's surface. A
tangential impulse per mass of 2/7 |u| stops that, as a sphere has I = 2/5 m r²; friction gives it if it is at most μ_s J,
with J the normal impulse per mass, else μ_k J. A sphere that rolls has u = 0 and gets none; down a slope it rolls with 5/7
of the acceleration of a sphere without friction, while that takes no more than μ_s J.

With rolling friction μ_r (of grains) there is also an angular impulse m r n × q with |q| ≤ μ_r J, which changes the speed of
the surface by rolling, s = r ω × n, by 5/2 q. Where friction p holds, both together take u = v_t − s to 0 and v_t to as
little as they may:

    p = −2/7 u + 5/7 q,   q = −7/5 (v_t − 2/7 u), or as much of it as is allowed.

So a sphere rolls down a slope with 5/7 g (sin θ − μ_r cos θ), and rests up to tan θ = μ_r. Where it slides, p and q are
found by turns, each within its bound.

Source: the collision of a sphere with a rough wall, O. R. Walton, in Particulate Two-Phase Flow (1993), with a tangential
restitution of −1 or 0; J. Ai, J.-F. Chen, J. M. Rotter, J. Y. Ooi, Powder Technol. 206, 269 (2011), on rolling friction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord, carried, frame_at, spin_of, surface_velocity
from particlesim.colliders.response import along_surface
from particlesim.compiler import outlined
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.lateness import way_between
from particlesim.engine.step.resting import bends, cross
from particlesim.laws.registry import PASS, gap, gap_and_normal, moved_to

NEAR = 1e-6
"""Part of the radius by which a particle that lies may be off a surface."""
MOST = 0.5
"""Part of the radius by which friction may move a particle in a step: not through a sheet."""
SAME_SIDE = 1.5
"""The length of the sum of two normals from which on they are of one side of a collider."""
STILL = 1e-18
"""Speed that is none [m/s]: processors know inverse roots of its square in single precision no more."""
SHARED, COARSELY, MOST_SHARES = 1e-12, 1e-6, 200
"""The change of what colliders share, as a part of all, below which it is found, also in single precision, and the turns
until then at most."""
TURNS = 8
"""Turns between sliding and rolling friction of what slides."""


def rub(c: Any, rolling: Any, columns: Any, i: Any, was: Any, p: Any, n: Any, push: Any) -> Any:
    """Turn sphere i of some columns by the friction of a collider that gave it a normal impulse over mass `push` [m/s], and
    by `rolling` friction unless that is None; return what its velocity changes by. `was` is the sphere at the beginning of
    the step, p that with its velocity after the impulse, and n the normal there."""
    friction, s, r = c.response.friction, columns.spin, p.r
    w = (s.wx[i], s.wy[i], s.wz[i])
    before, m = between(c, was, n)
    slip, turn = slip_of(c, p, n, w)
    one = type_of(push, 1)
    if rolling is not None:
        spun = cross(spin_of(c.shape), n)
        roll = tuple(r * (a - type_of(push, b)) for a, b in zip(turn, spun, strict=True))
        change, q = slowed(slip, roll, friction, rolling, push)
        k = type_of(push, 2.5) / (r if r > 0 else one)
        spin_up(s, i, k, cross(m, tuple(a - b for a, b in zip(q, change, strict=True))))
        return change
    first, _ = slip_of(c, was, before, w)
    if first[0] * slip[0] + first[1] * slip[1] + first[2] * slip[2] < 0 and lay_on(gap(c.shape, was), was):
        slip = without_gain(first, slip)
    speed, share = np.sqrt(slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]), type_of(push, 2 / 7)
    holds = share * speed <= max(friction.static * push, type_of(push, STILL))
    part = share if holds else min(friction.kinetic * push / speed, share)
    change = tuple(-part * a for a in slip)
    k = type_of(push, 2.5) / (r if r > 0 else one)
    s.wx[i] -= k * (m[1] * change[2] - m[2] * change[1])
    s.wy[i] -= k * (m[2] * change[0] - m[0] * change[2])
    s.wz[i] -= k * (m[0] * change[1] - m[1] * change[0])
    return change


def slip_of(c: Any, p: Any, n: Any, w: Any) -> Any:
    """How the surface of a sphere p with angular velocity w slides over a collider where the normal is n, and ω × n [m/s,
    1/s]."""
    r, u = p.r, (p.vx, p.vy, p.vz)
    if isinstance(c.shape, MovingRecord):
        f = frame_at(c.shape, p.t, p.x)
        own = surface_velocity(c.shape, f, p.x - r * n[0], p.y - r * n[1], p.z - r * n[2])
        u = tuple(a - b for a, b in zip(u, own, strict=True))
    belt = along_surface(carried(c.shape, c.response.belt, p.t, p.x), n)
    u = tuple(a if b is None else a - b for a, b in zip(u, belt, strict=True))
    turn = (w[1] * n[2] - w[2] * n[1], w[2] * n[0] - w[0] * n[2], w[0] * n[1] - w[1] * n[0])
    up = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    return tuple(a - up * axis - r * b for a, axis, b in zip(u, n, turn, strict=True)), turn


def without_gain(first: Any, slip: Any) -> Any:
    """As much of how a sphere slides at the end of a step as friction may stop, if it slid the other way at its beginning.
    All of it, Y, would give the sphere 1/7 (|Y − T|² − |T|²) of energy per mass, with T the mean of both: what forces and
    the bend of a wall do within the step is more than what it had."""
    half = type_of(slip[0], 0.5)
    mean = tuple(half * (a + b) for a, b in zip(first, slip, strict=True))
    rest = tuple(half * (b - a) for a, b in zip(first, slip, strict=True))
    size = np.sqrt(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2])
    part = size / np.sqrt(rest[0] * rest[0] + rest[1] * rest[1] + rest[2] * rest[2])
    return tuple(a + part * b for a, b in zip(mean, rest, strict=True))


def spin_up(s: Any, i: Any, k: Any, turn: Any) -> None:
    """Change the angular velocity of a sphere by k times something."""
    s.wx[i] += k * turn[0]
    s.wy[i] += k * turn[1]
    s.wz[i] += k * turn[2]


@outlined
def slowed(slip: Any, roll: Any, friction: Any, rolling: Any, push: Any) -> Any:
    """Friction p and rolling friction q of a sphere under a normal impulse over mass `push`, from how it slides over a
    surface and how its own surface goes by rolling, as vectors [m/s]."""
    one, two7, most = type_of(push, 1), type_of(push, 2 / 7), rolling * push
    full = tuple(type_of(push, -7 / 5) * (b + (one - two7) * a) for a, b in zip(slip, roll, strict=True))
    part = within(full, most)
    q = tuple(part * a for a in full)
    p = tuple(type_of(push, 5 / 7) * b - two7 * a for a, b in zip(slip, q, strict=True))
    if part >= one:
        p = tuple(-a - b for a, b in zip(slip, roll, strict=True))  # both end, to the last bit
    if within(p, friction.static * push) < one:
        p = q = (push - push, push - push, push - push)
        for _ in range(TURNS):
            spun = tuple(a + type_of(push, 2.5) * (y - x) for a, x, y in zip(roll, p, q, strict=True))
            q = limited(tuple(y - type_of(push, 0.4) * a for a, y in zip(spun, q, strict=True)), most)
            u = tuple(
                a + type_of(push, 3.5) * x - type_of(push, 2.5) * y
                for a, x, y in zip(slip, p, q, strict=True)
            )
            p = limited(tuple(x - two7 * a for a, x in zip(u, p, strict=True)), friction.kinetic * push)
    return p, q


def within(v: Any, most: Any) -> Any:
    """The part of a vector that is at most as long."""
    size = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return most / size if size > max(most, type_of(size, STILL)) else type_of(size, 1)


def limited(v: Any, most: Any) -> Any:
    """A vector, or one along it that is as long as allowed."""
    part = within(v, most)
    return part * v[0], part * v[1], part * v[2]


def way_of(p: Any, q: Any, h: Any) -> Any:
    """How far forces move a particle in a step of h from p to q over h times what they change its velocity by, which is a
    property of the method: 0, a half or 1."""
    half = type_of(h, 0.5)
    way = way_between(p, q, h)
    a, b = way.turn, way.bend
    size = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    if along < half * half * size:
        return h - h
    return half if along <= (half + half * half) * size else type_of(h, 1)


def lay_on(g: Any, p: Any) -> Any:
    """Whether a sphere that is g off a surface touches it."""
    return abs(g) <= type_of(g, NEAR) * p.r


def between(c: Any, p: Any, n: Any) -> Any:
    """The normals at the beginning and in the middle of a step along a collider that bends, from p to where it is n; n, if p
    does not touch it. With that of the end what turns about its normal would gain energy, or lose it, in proportion to
    the step."""
    if not bends(c):
        return n, n
    g, axes = gap_and_normal(c.shape, p)
    was = tuple(g - g if axis is None else axis for axis in axes)
    x, y, z = (a + b for a, b in zip(was, n, strict=True))
    size = np.sqrt(x * x + y * y + z * z)
    turned = (was[0] != n[0]) | (was[1] != n[1]) | (was[2] != n[2])
    lay = turned & lay_on(g, p) & (size > type_of(g, SAME_SIDE))
    by = type_of(g, 1) / size if lay else size
    first = tuple(a if lay else b for a, b in zip(was, n, strict=True))
    return first, tuple(by * a if lay else b for a, b in zip((x, y, z), n, strict=True))


def rubbed(colliders: Any, rolling: Any, c: Any, i: Any, p: Any, q: Any, r: Any, h: Any) -> Any:
    """Particle i at the end r of a step of h from p that colliders without friction have made of q, with the friction that
    goes with their impulses: those of colliders that it may have touched, one after the other."""
    left = (r.vx - q.vx, r.vy - q.vy, r.vz - q.vz)
    if left[0] != 0 or left[1] != 0 or left[2] != 0:
        far = h * (_size(q) + _size(r)) + type_of(h, NEAR) * r.r
        dx, dy, dz = left[0] - left[0], left[1] - left[1], left[2] - left[2]
        normals, pushes = shared_by(colliders, r, left, far)
        for each, n, push in zip(colliders, normals, pushes, strict=True):
            if each.response.friction is not None and push > 0:
                x, y, z = rub(each, rolling, c, i, p, r, n, push)
                r = moved_to(r, r.x, r.y, r.z, r.vx + x, r.vy + y, r.vz + z, r.t)
                dx, dy, dz = dx + x, dy + y, dz + z
        # a force that acts all through the step; an impact takes place in the middle of it, on average
        half = way_of(p, q, h) * h
        there = moved_to(r, r.x + half * dx, r.y + half * dy, r.z + half * dz, r.vx, r.vy, r.vz, r.t)
        near = half * np.sqrt(dx * dx + dy * dy + dz * dz) < type_of(h, MOST) * r.r
        there = _back_on(colliders, r, there)
        if near & (_least(colliders, there) >= min(_least(colliders, r), h - h) - type_of(h, NEAR) * r.r):
            r = there
    return r


def shared_by(colliders: Any, r: Any, change: Any, far: Any) -> tuple[Any, Any]:
    """The normals of colliders at r, and by how much each of them has changed a velocity along its own [m/s], if they have
    changed it all together: as much as is left, by turns, which ends where none would have to pull. Those that are touched
    come first, and what is farther away than `far` has given nothing."""
    normals: tuple[Any, ...] = ()
    gaps: tuple[Any, ...] = ()
    for each in colliders:
        g, axes = gap_and_normal(each.shape, r)
        normals, gaps = (*normals, tuple(g - g if axis is None else axis for axis in axes)), (*gaps, g)
    zero, left = far - far, change
    pushes = tuple(zero for _ in colliders)
    least = type_of(far, COARSELY if isinstance(r.x, np.float32) else SHARED)
    least *= abs(change[0]) + abs(change[1]) + abs(change[2])
    for reach in (type_of(far, NEAR) * r.r, far):
        turn, going = 0, True
        while going & (turn < MOST_SHARES):
            most, count = zero, 0
            for k in range(len(colliders)):
                n, had = normals[k], pushes[k]
                push = max(had + (left[0] * n[0] + left[1] * n[1] + left[2] * n[2]), zero)
                push = push if gaps[k] < reach else had
                left = tuple(a - (push - had) * axis for a, axis in zip(left, n, strict=True))
                pushes = tuple(push if m == k else each for m, each in enumerate(pushes))
                most, count = max(most, abs(push - had)), count + (push > 0)
            going, turn = (count > 1) & (most > least), turn + 1
    return normals, pushes


def _back_on(colliders: Any, p: Any, q: Any) -> Any:
    """The place q to which friction has moved a particle from p, on the surfaces that bend under it and that it touched
    there: off them it would fall, and land."""
    for each in colliders:
        if bends(each):
            was = gap(each.shape, p)
            g, n = gap_and_normal(each.shape, q)
            off = g if abs(was) <= type_of(g, NEAR) * p.r else g - g
            x, y, z = (a if b is None else a - off * b for a, b in zip((q.x, q.y, q.z), n, strict=True))
            q = moved_to(q, x, y, z, q.vx, q.vy, q.vz, q.t)
    return q


def _size(p: Any) -> Any:
    return np.sqrt(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz)


def _least(colliders: Any, p: Any) -> Any:
    """The smallest gap [m]."""
    least = type_of(p.x, 1)
    for each in colliders:
        if each.response.outcome == PASS:
            least = min(least, gap(each.shape, p))
    return least
