"""Velocities that are not those of their places, as with leapfrogs that tell them half a step late, and what contacts make
of the difference; and the parabola through both ends of a step of any method.

An impact that turned a late velocity around would change the energy by h v·f.
"""

from __future__ import annotations

from typing import Any

from particlesim.engine.state.columns import type_of
from particlesim.engine.step.contacts import rounding
from particlesim.engine.step.particle_step import BentRecord, kick
from particlesim.integrators.base import CompositionRecord, VerletRecord
from particlesim.laws.registry import gap_and_normal, moved_to


def lags(method: Any) -> bool:
    """Whether the velocities of a method are not those of its places: it is a leapfrog like velocity Verlet, which has the
    same places and, at these, the velocities `on_time` (Hairer, Lubich, Wanner, Geometric Numerical Integration, I.3.1)."""
    if isinstance(method, BentRecord):
        return method.late is not None
    return isinstance(method, VerletRecord) or (leaps(method) and len(method.kicks) == 1)


def leaps(method: Any) -> bool:
    """Whether a method is a leapfrog, with places like those of velocity Verlet."""
    return isinstance(method, VerletRecord) or (
        isinstance(method, CompositionRecord) and len(method.kicks) <= 2
    )


def centred(method: Any, h: Any, lies: Any) -> Any:
    """A method that `lags` with the same places after steps of h and the velocities of these; as it is for a particle that
    `lies`, which has no velocity that is late, as its forces and those of contact cancel."""
    one, half, zero = type_of(h, 1), type_of(h, 0.5), h - h
    if isinstance(method, BentRecord):
        part = zero if lies else one / h
        bend = tuple(b - part * v for b, v in zip(method.bend, method.late, strict=True))
        return BentRecord(method.turn, bend)
    whole = lies and isinstance(method, CompositionRecord)
    return CompositionRecord((one if whole else half, zero if whole else half), (one, None))


def on_time(method: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """A particle between steps of h with the velocity of its place, of a method that `lags`."""
    half = type_of(h, 0.5)
    if isinstance(method, BentRecord):
        vx, vy, vz = method.late
        return moved_to(p, p.x, p.y, p.z, p.vx + vx, p.vy + vy, p.vz + vz, p.t)
    if isinstance(method, CompositionRecord):
        return kick(half, forces, p, h)
    ux, uy, uz, known = memory
    q = kick(half, forces, moved_to(p, p.x, p.y, p.z, ux, uy, uz, p.t), h)
    late = known == h
    vx, vy, vz = q.vx if late else p.vx, q.vy if late else p.vy, q.vz if late else p.vz
    return moved_to(p, p.x, p.y, p.z, vx, vy, vz, p.t)


def delayed(method: Any, forces: Any, q: Any, h: Any) -> Any:
    """The opposite of `on_time`, where the method goes on without a memory."""
    if isinstance(method, BentRecord):
        vx, vy, vz = method.late
        return moved_to(q, q.x, q.y, q.z, q.vx - vx, q.vy - vy, q.vz - vz, q.t)
    return q if isinstance(method, VerletRecord) else kick(type_of(h, -0.5), forces, q, h)


def taken_off(q: Any, late: Any) -> Any:
    """A particle that has left what it lay on, with the other part: along its way it has been late there, too."""
    k = type_of(q.x, 1) - _part_along(q, late)
    vx, vy, vz = late.vx + k * q.vx, late.vy + k * q.vy, late.vz + k * q.vz
    return moved_to(q, q.x, q.y, q.z, vx, vy, vz, q.t)


def _part_along(q: Any, late: Any) -> Any:
    """The part of a velocity along another one, over this: 1 where there is none."""
    square = q.vx * q.vx + q.vy * q.vy + q.vz * q.vz
    along = late.vx * q.vx + late.vy * q.vy + late.vz * q.vz
    return along / square if square > 0 else type_of(square, 1)


def hastened(p: Any, v: Any) -> Any:
    """A particle that is faster by v."""
    return moved_to(p, p.x, p.y, p.z, p.vx + v[0], p.vy + v[1], p.vz + v[2], p.t)


def with_places(p: Any, q: Any, a: Any, late: Any, h: Any) -> tuple[Any, Any, Any]:
    """Both ends of a step with the velocities of their places, `late` more, and what they are late by at the end. What
    contact takes up of a velocity that is late by a, it had not: so far it has fallen half as far."""
    begun, end = hastened(p, late), hastened(q, late)
    still = (begun.vx == 0) & (begun.vy == 0) & (begun.vz == 0)
    x, y, z = (b - h * (whole - part) for b, whole, part in zip((q.x, q.y, q.z), a, late, strict=True))
    end = moved_to(end, x, y, z, end.vx, end.vy, end.vz, end.t)
    return begun, end, tuple(whole if still else part for whole, part in zip(a, late, strict=True))


def along_contacts(contacts: Any, p: Any, a: Any, level: bool) -> Any:
    """What of a change of the velocity of p no collider takes up that it touches, or, `level`, all that is along these;
    nothing where friction has stopped it. And whether it touches one."""
    slack, lies, still = rounding(contacts, p), False, (p.vx == 0) & (p.vy == 0) & (p.vz == 0)
    x, y, z = a
    for c in contacts.continuous:
        g, normal = gap_and_normal(c, p)
        zero = g - g
        n = tuple(zero if axis is None else axis for axis in normal)
        push = n[0] * x + n[1] * y + n[2] * z
        touches = (g <= slack) & ((push <= 0) | level)
        s, lies = push if touches else zero, lies | touches
        x, y, z = x - s * n[0], y - s * n[1], z - s * n[2]
        if c.response.friction is not None:
            stopped = touches & still
            x, y, z = zero if stopped else x, zero if stopped else y, zero if stopped else z
    return (x, y, z), lies


def way_between(p: Any, q: Any, h: Any) -> BentRecord:
    """The parabola through both ends of a step with the velocity at its beginning; velocities change evenly."""
    k = type_of(h, 1) / h
    turn = k * (q.vx - p.vx), k * (q.vy - p.vy), k * (q.vz - p.vz)
    bend = k * (k * (q.x - p.x) - p.vx), k * (k * (q.y - p.y) - p.vy), k * (k * (q.z - p.z) - p.vz)
    return BentRecord(turn, bend)


def lateness(way: BentRecord, h: Any, quick: Any) -> Any:
    """What velocities on a way lack to be those of the parabola through both ends of a step with the same change of the
    velocity; nothing for what is not `quick`."""
    k, half = h if quick else h - h, type_of(h, 0.5)
    return tuple(k * (b - half * a) for a, b in zip(way.turn, way.bend, strict=True))


def parabola(p: Any, q: Any, h: Any) -> BentRecord:
    """`way_between`, with what velocities lack on it."""
    way = way_between(p, q, h)
    return BentRecord(way.turn, way.bend, lateness(way, h, True))
