"""Colliders under surfaces in contact: a particle that lies on a collider stays out of it while contacts push it.

Before contacts of surfaces are found, every particle has met its colliders. If a particle of a contact is near a collider,
it also gets a contact with that collider: n·x ≥ n·x_s, where x_s is the nearest point of its surface, with friction that
acts on sliding relative to the surface. Particles that contacts have pushed into a collider in spite of that are put back.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord, alight, carried, frame_at, ride, surface_velocity
from particlesim.colliders.response import along_surface, put_back
from particlesim.compiler import outlined, shared
from particlesim.engine.interactions.hard.walls import colliders_of, whole
from particlesim.engine.interactions.surfaces.record import CONTACTS, LOST
from particlesim.engine.interactions.surfaces.response import CALM, KINETIC, LOSS, PUSH, REBOUND, STATIC
from particlesim.engine.interactions.surfaces.zones import stand
from particlesim.engine.state.columns import fetch, type_of
from particlesim.laws.registry import PASS, gap_and_normal, moved_to

NEAR = 1.0
"""Gap to a collider, as a part of the radius, below which a particle gets a contact with it."""


def add_walls(each: Any, parts: Any, c: Any, t: Any, h: Any) -> None:
    """Contacts with colliders of all particles in contacts."""
    for part in parts:
        for collider in colliders_of(part):
            _add_wall(each, collider, c, t, h, part.first, part.last)
    note_walls(each.simplices, each.desk)


@shared
def note_walls(s: Any, desk: Any) -> None:
    """Mark particles whose contacts with colliders are listed."""
    for j in range(s.rows.size):
        i = s.rows[j]
        if (desk.mark[i] & 1) != 0:
            desk.mark[i] |= 4


@outlined
def _add_wall(each: Any, collider: Any, c: Any, t: Any, h: Any, first: Any, last: Any) -> None:
    touches, desk, report, response = each.touches, each.desk, each.report, collider.response
    for i in range(first, last):
        if ((desk.mark[i] & 5) == 1) & (desk.inverse[i] > 0) & (response.outcome == PASS):
            p = fetch(c, i, t)
            g, n = gap_and_normal(collider.shape, p)
            if g < type_of(g, NEAR) * p.r:
                k = report[CONTACTS]
                if k >= touches.rows.shape[1]:
                    report[LOST] = max(report[LOST], 1)
                else:
                    axes = whole(n, g)
                    wx, wy, wz = velocity_of(collider, p, axes)
                    for corner in range(4):
                        touches.rows[corner, k] = i
                        touches.weights[corner, k] = 1.0 if corner == 0 else 0.0
                    goal = -float(g)
                    for axis, (u, w, x) in enumerate(zip(axes, (wx, wy, wz), (p.x, p.y, p.z), strict=True)):
                        touches.normal[axis, k] = float(u)
                        touches.drift[axis, k] = float(w)
                        touches.shift[axis, k] = float(w) * float(h)
                        touches.rubbed[axis, k] = touches.carried[axis, k] = 0.0
                        goal += float(u) * float(x)
                    touches.normal[3, k] = goal
                    friction = response.friction
                    touches.bound[STATIC, k] = 0.0 if friction is None else float(friction.static)
                    touches.bound[KINETIC, k] = 0.0 if friction is None else float(friction.kinetic)
                    touches.bound[REBOUND, k] = touches.bound[PUSH, k] = touches.bound[LOSS, k] = 0.0
                    touches.bound[CALM, k] = np.inf
                    report[CONTACTS] = k + 1


def velocity_of(collider: Any, p: Any, n: Any) -> Any:
    """Velocity of the surface of a collider, of normal n, where a particle is [m/s]."""
    x = y = z = type_of(p.x, 0)
    if isinstance(collider.shape, MovingRecord):
        x, y, z = surface_velocity(collider.shape, frame_at(collider.shape, p.t, p.x), p.x, p.y, p.z)
    if collider.response.belt is not None:
        u, v, w = along_surface(carried(collider.shape, collider.response.belt, p.t, p.x), n)
        x, y, z = x + u, y + v, z + w
    return x, y, z


def put_on_walls(each: Any, parts: Any, c: Any, t: Any, slack: Any) -> None:
    """Particles that were moved into colliders, or lie on them up to a gap of `slack` [m], are put on their surfaces."""
    for part in parts:
        for collider in colliders_of(part):
            _put_on_wall(each, collider, c, t, part.first, part.last, slack)


@outlined
def _put_on_wall(each: Any, collider: Any, c: Any, t: Any, first: Any, last: Any, slack: Any) -> None:
    for i in range(first, last):
        if ((each.desk.mark[i] & 1) != 0) & (each.desk.inverse[i] > 0) & (collider.response.outcome == PASS):
            p = fetch(c, i, t)
            g, n = gap_and_normal(collider.shape, p)
            if g < slack:
                c.x[i], c.y[i], c.z[i] = put_back(collider.shape, p, g, whole(n, g))


def lie_on_walls(each: Any, parts: Any, c: Any, t: Any, slack: Any, calm: Any) -> None:
    """Particles on colliders lose a normal velocity that approaches them, or leaves them slower than `calm` [m/s]: rest
    needs no search for impacts."""
    for part in parts:
        for collider in colliders_of(part):
            _lie_on_wall(each, collider, c, t, part.first, part.last, slack, calm)


@outlined
def _lie_on_wall(
    each: Any, collider: Any, c: Any, t: Any, first: Any, last: Any, slack: Any, calm: Any
) -> None:
    for i in range(first, last):
        if ((each.desk.mark[i] & 1) != 0) & (each.desk.inverse[i] > 0) & (collider.response.outcome == PASS):
            p = fetch(c, i, t)
            g, n = gap_and_normal(collider.shape, p)
            if g < slack:
                axes = whole(n, g)
                wx, wy, wz = velocity_of(collider, p, axes)
                rate = (p.vx - wx) * axes[0] + (p.vy - wy) * axes[1] + (p.vz - wz) * axes[2]
                if rate < calm:
                    c.vx[i] -= rate * axes[0]
                    c.vy[i] -= rate * axes[1]
                    c.vz[i] -= rate * axes[2]


def stand_at_walls(each: Any, parts: Any, c: Any, t: Any, h: Any) -> None:
    """Zones that reach into colliders go with these."""
    for part in parts:
        for collider in colliders_of(part):
            _stand_at_wall(each, collider, c, t, h, part.first, part.last)


def carried_by(shape: Any, p: Any, h: Any) -> Any:
    """How far a collider has gone in a step of h where a particle is at the end of it [m]."""
    zero = type_of(p.x, 0)
    if not isinstance(shape, MovingRecord):
        return float(zero), float(zero), float(zero)
    local = ride(shape, p)
    was = alight(shape, moved_to(local, local.x, local.y, local.z, zero, zero, zero, p.t - h))
    return float(p.x - was.x), float(p.y - was.y), float(p.z - was.z)


@outlined
def _stand_at_wall(each: Any, collider: Any, c: Any, t: Any, h: Any, first: Any, last: Any) -> None:
    for i in range(first, last):
        if ((each.desk.mark[i] & 1) != 0) & (each.desk.inverse[i] > 0):
            p = fetch(c, i, t)
            g, n = gap_and_normal(collider.shape, p)
            if g < 0:
                x, y, z = (float(u) for u in velocity_of(collider, p, whole(n, g)))
                stand(each.desk, i, carried_by(collider.shape, p, h), (x, y, z))
