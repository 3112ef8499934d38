"""Friction of colliders on spheres that rotate, from the normal impulses of impacts and resting contact without friction.

The surface of a sphere slides over a collider at u = v_t − r ω × n, less the velocity of the collider's surface. A
tangential impulse per mass of 2/7 |u| stops that, as a sphere has I = 2/5 m r²; friction gives it if it is at most μ_s J,
with J the normal impulse per mass, else μ_k J. A sphere that rolls has u = 0 and gets none; down a slope it rolls with 5/7
of the acceleration of a sphere without friction, while that takes no more than μ_s J.

Source: the collision of a sphere with a rough wall, O. R. Walton, in Particulate Two-Phase Flow (1993), with a tangential
restitution of −1 or 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord, carried, frame_at, surface_velocity
from particlesim.colliders.response import along_surface
from particlesim.engine.state.columns import type_of
from particlesim.laws.registry import PASS, gap, gap_and_normal, moved_to

NEAR = 1e-6
"""Part of the radius by which a particle that lies may be off a surface."""
MOST = 0.5
"""Part of the radius by which friction may move a particle in a step: not through a sheet."""


def rub(c: Any, columns: Any, i: Any, p: Any, n: Any, push: Any) -> Any:
    """Turn sphere i of some columns by the friction of a collider that gave it a normal impulse over mass `push` [m/s], and
    return what its velocity changes by; p is the sphere with its velocity after that impulse."""
    friction, s, r = c.response.friction, columns.spin, p.r
    w = (s.wx[i], s.wy[i], s.wz[i])
    u = (p.vx, p.vy, p.vz)
    if isinstance(c.shape, MovingRecord):
        f = frame_at(c.shape, p.t, p.x)
        own = surface_velocity(c.shape, f, p.x - r * n[0], p.y - r * n[1], p.z - r * n[2])
        u = tuple(a - b for a, b in zip(u, own, strict=True))
    belt = along_surface(carried(c.shape, c.response.belt, p.t, p.x), n)
    u = tuple(a if b is None else a - b for a, b in zip(u, belt, strict=True))
    turn = (w[1] * n[2] - w[2] * n[1], w[2] * n[0] - w[0] * n[2], w[0] * n[1] - w[1] * n[0])
    up = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    slip = tuple(a - up * axis - r * b for a, axis, b in zip(u, n, turn, strict=True))
    one = type_of(push, 1)
    speed, share = np.sqrt(slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]), type_of(push, 2 / 7)
    holds = share * speed <= friction.static * push
    part = share if holds else min(friction.kinetic * push / speed, share)
    change = tuple(-part * a for a in slip)
    k = type_of(push, 2.5) / (r if r > 0 else one)
    s.wx[i] -= k * (n[1] * change[2] - n[2] * change[1])
    s.wy[i] -= k * (n[2] * change[0] - n[0] * change[2])
    s.wz[i] -= k * (n[0] * change[1] - n[1] * change[0])
    return change


def rubbed(colliders: Any, c: Any, i: Any, q: Any, r: Any, h: Any) -> Any:
    """Particle i at the end r of a step of h that colliders without friction have made of q, with the friction that goes
    with their impulses: those of colliders that it may have touched, one after the other."""
    left = (r.vx - q.vx, r.vy - q.vy, r.vz - q.vz)
    if left[0] != 0 or left[1] != 0 or left[2] != 0:
        far = h * (_size(q) + _size(r)) + type_of(h, NEAR) * r.r
        dx, dy, dz = left[0] - left[0], left[1] - left[1], left[2] - left[2]
        for each in colliders:
            g, axes = gap_and_normal(each.shape, r)
            n = tuple(g - g if axis is None else axis for axis in axes)
            push = left[0] * n[0] + left[1] * n[1] + left[2] * n[2]
            if (push > 0) & (g < far):
                left = tuple(a - push * axis for a, axis in zip(left, n, strict=True))
                if each.response.friction is not None:
                    x, y, z = rub(each, c, i, r, n, push)
                    r = moved_to(r, r.x, r.y, r.z, r.vx + x, r.vy + y, r.vz + z, r.t)
                    dx, dy, dz = dx + x, dy + y, dz + z
        # a force that acts all through the step; an impact takes place in the middle of it, on average
        half = type_of(h, 0.5) * h
        there = moved_to(r, r.x + half * dx, r.y + half * dy, r.z + half * dz, r.vx, r.vy, r.vz, r.t)
        near = half * np.sqrt(dx * dx + dy * dy + dz * dz) < type_of(h, MOST) * r.r
        if near & (_least(colliders, there) >= min(_least(colliders, r), h - h) - type_of(h, NEAR) * r.r):
            r = there
    return r


def _size(p: Any) -> Any:
    return np.sqrt(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz)


def _least(colliders: Any, p: Any) -> Any:
    """The smallest gap [m]."""
    least = type_of(p.x, 1)
    for each in colliders:
        if each.response.outcome == PASS:
            least = min(least, gap(each.shape, p))
    return least
