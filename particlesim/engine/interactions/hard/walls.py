"""Colliders that hard grains lie on, in the turns and solutions that find the impulses of a step (`impulses`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.moving import MovingRecord, carried, frame_at, surface_velocity
from particlesim.colliders.response import ResponseRecord, held_back, put_back, rebound, sliding, with_slide
from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import FOUND, GIVEN
from particlesim.engine.state.columns import fetch, held, type_of
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.rubbing import rub
from particlesim.laws.registry import PASS, gap_and_normal, moved_to

REST = 2.0
"""Steps in which forces bring about an approach that counts as rest."""
NEAR_WALL, ON_WALL = 0.1, 1e-4
"""Gaps to a collider, as parts of the radius, below which a particle is watched, and below which it lies on it."""
COUNT, LOST = range(2)
"""In `report`: how many pairs there are, and whether some found no room."""


def colliders_of(part: Any) -> Any:
    """All colliders of a group that have a surface."""
    if len(part.rubbing) > 0:
        return part.rubbing
    contacts = part.contacts
    found = contacts.colliders if isinstance(contacts, Simple) else contacts.continuous + contacts.discrete
    return tuple(c for c in found if not isinstance(c.shape, BoundsRecord))


def whole(n: Any, like: Any) -> Any:
    """A normal without components that are left out."""
    return tuple(type_of(like, 0) if axis is None else axis for axis in n)


def watch_walls(each: Any, parts: Any, c: Any, before: Any, t: Any) -> None:
    """List particles that are near a collider, collider after collider."""
    end, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            end = watch_wall(each, collider, c, before, t, part.first, part.last, end)
            each.bench.ends[k] = end
            k += 1


@outlined
def watch_wall(each: Any, collider: Any, c: Any, before: Any, t: Any, first: Any, last: Any, end: Any) -> Any:
    """List those of particles [first, last) that are near a collider; returns the end of the list."""
    bench = each.bench
    for i in range(first, last):
        if (each.near.place[i] >= 0) & (each.a[i] > 0) & (end < bench.wall.size):  # noqa: SIM102
            if (not held(c.clock, i)) & (collider.response.outcome == PASS):
                p = fetch(c, i, t)
                g, n = gap_and_normal(collider.shape, p)
                if g < type_of(g, NEAR_WALL) * p.r:
                    x, y, z = whole(n, g)
                    dx, dy, dz = p.vx - before[3, i], p.vy - before[4, i], p.vz - before[5, i]
                    bench.wall[end] = i
                    bench.wall_normal[0, end] = x
                    bench.wall_normal[1, end] = y
                    bench.wall_normal[2, end] = z
                    lies = g < type_of(g, ON_WALL) * p.r
                    least = type_of(g, REST) * np.sqrt(dx * dx + dy * dy + dz * dz)
                    bench.wall_normal[3, end] = least if lies else type_of(g, -1)
                    bench.wall_normal[4, end] = speed_along(collider, p, (x, y, z))
                    bench.desk.contacts[GIVEN, each.report[COUNT] + end] = 0
                    end += 1
    return end


def speed_along(collider: Any, p: Any, n: Any) -> Any:
    """How fast a collider moves along its normal where it touches a particle [m/s]."""
    if not isinstance(collider.shape, MovingRecord):
        return p.x - p.x
    f = frame_at(collider.shape, p.t, p.x)
    place = (p.x - p.r * n[0], p.y - p.r * n[1], p.z - p.r * n[2])
    u, v, w = surface_velocity(collider.shape, f, *place)
    return u * n[0] + v * n[1] + w * n[2]


def beside(collider: Any, p: Any) -> Any:
    """A particle with its velocity relative to a collider where it is, along the axes of the world."""
    if not isinstance(collider.shape, MovingRecord):
        return p
    x, y, z = surface_velocity(collider.shape, frame_at(collider.shape, p.t, p.x), p.x, p.y, p.z)
    return moved_to(p, p.x, p.y, p.z, p.vx - x, p.vy - y, p.vz - z, p.t)


def away(collider: Any, v: Any, p: Any, q: Any) -> Any:
    """A velocity relative to a collider, as that of q is to that of p in the world, in the world."""
    if not isinstance(collider.shape, MovingRecord):
        return v
    return v[0] + (p.vx - q.vx), v[1] + (p.vy - q.vy), v[2] + (p.vz - q.vz)


def push_off_walls(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Velocities of particles that lie on colliders and are pressed into them."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            push_off_wall(each, collider, c, begin, each.bench.ends[k], t)
            begin = each.bench.ends[k]
            k += 1


@outlined
def push_off_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any, t: Any) -> None:
    """`push_off_walls` for particles [begin, end) of the list."""
    bench, response = each.bench, collider.response
    for k in range(begin, end):
        i, least = bench.wall[k], bench.wall_normal[3, k]
        n = (bench.wall_normal[0, k], bench.wall_normal[1, k], bench.wall_normal[2, k])
        p = fetch(c, i, t)
        q = beside(collider, p)
        rate = q.vx * n[0] + q.vy * n[1] + q.vz * n[2]
        if (least >= 0) & (rate < 0):
            one, none = type_of(rate, 1), type_of(rate, 0)
            lively, given = (-rate > least) | (response.bounce >= 2), each.report[COUNT] + k
            bounce = response.bounce if lively else one
            bench.desk.contacts[GIVEN, given] = 0 if lively else bench.desk.contacts[GIVEN, given] - rate
            friction = None if c.spin is not None else response.friction
            belt = None if c.spin is not None else carried(collider.shape, response.belt, p.t, p.x)
            once = ResponseRecord(bounce, none, one, PASS, friction, response.falling, belt)
            vx, vy, vz = away(collider, rebound(once, n, rate, q), p, q)
            if c.spin is not None and response.friction is not None:
                push = (vx - p.vx) * n[0] + (vy - p.vy) * n[1] + (vz - p.vz) * n[2]
                dx, dy, dz = rub(collider, c, i, moved_to(p, p.x, p.y, p.z, vx, vy, vz, p.t), n, push)
                vx, vy, vz = vx + dx, vy + dy, vz + dz
            c.vx[i], c.vy[i], c.vz[i] = vx, vy, vz
            if len(c.memory) > 0:
                c.memory[-1][i] = 0


def rub_walls(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Friction of colliders on particles that have got impulses from them."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            if collider.response.friction is not None:
                rub_wall(each, collider, c, begin, each.bench.ends[k], t)
            begin = each.bench.ends[k]
            k += 1


@outlined
def rub_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any, t: Any) -> None:
    """`rub_walls` for particles [begin, end) of the list."""
    bench, response = each.bench, collider.response
    for k in range(begin, end):
        i, push = bench.wall[k], type_of(c.x[0], bench.desk.contacts[FOUND, each.report[COUNT] + k])
        if push > 0:
            n = (bench.wall_normal[0, k], bench.wall_normal[1, k], bench.wall_normal[2, k])
            p = fetch(c, i, t)
            if c.spin is not None:
                dx, dy, dz = rub(collider, c, i, p, n, push)
                vx, vy, vz = p.vx + dx, p.vy + dy, p.vz + dz
            else:
                q, one, none = beside(collider, p), type_of(push, 1), type_of(push, 0)
                rate = q.vx * n[0] + q.vy * n[1] + q.vz * n[2]
                belt = carried(collider.shape, response.belt, p.t, p.x)
                once = ResponseRecord(one, none, one, PASS, response.friction, None, belt)
                slide = sliding(once, n, rate, q)
                found = with_slide(once, n, rate, held_back(once, slide, push), slide)
                vx, vy, vz = away(collider, found, p, q)
            c.vx[i], c.vy[i], c.vz[i] = vx, vy, vz


def put_on_walls(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Particles that have been moved into colliders go back to their surface."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            put_on_wall(each, collider, c, begin, each.bench.ends[k], t)
            begin = each.bench.ends[k]
            k += 1


@outlined
def put_on_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any, t: Any) -> None:
    """`put_on_walls` for particles [begin, end) of the list."""
    bench = each.bench
    for k in range(begin, end):
        i = bench.wall[k]
        p = fetch(c, i, t)
        g, n = gap_and_normal(collider.shape, p)
        if g < 0:
            x, y, z = put_back(collider.shape, p, g, whole(n, g))
            c.x[i], c.y[i], c.z[i] = x, y, z
