"""Colliders that move: led along a path, turning about an axis, or both.

A place x in the world is at y = x₀ + Rᵀ (x − X(t)) in the frame of the collider, whose pivot was at x₀ at the start and is
at X(t) now; R(t) is its turn by ω t about a fixed direction; velocities there are relative, Rᵀ (v − Ẋ − ω × (x − X)). In
its frame the collider is at rest: its laws, the search for the first contact, impacts and rest are those of any other. So
the velocity of its surface is felt, and with it the work that it does.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import exact, often
from particlesim.laws.registry import (
    Particle,
    Vector,
    apart,
    first_contact,
    gap,
    gap_and_normal,
    law,
    least_gap,
    moved_to,
    normal,
    path,
    thinnest,
)


class SpinRecord(NamedTuple):
    """A steady turn: its direction, a unit vector, and its rate [rad/s]."""

    x: float
    y: float
    z: float
    rate: float


class MovingRecord(NamedTuple):
    """A shape as it is at the start, where its pivot is then [m], the path of the pivot and the turn about it; each None
    where there is none."""

    shape: Any
    x: float
    y: float
    z: float
    path: Any
    spin: SpinRecord | None


class Frame(NamedTuple):
    """A frame at a time: where the pivot is [m], its velocity [m/s], and the rotation, row by row; None where it does not
    turn."""

    x: Any
    y: Any
    z: Any
    vx: Any
    vy: Any
    vz: Any
    rows: Any


@often
@exact
def frame_at(c: MovingRecord, t: Any, like: Any) -> Frame:
    """The frame of a collider at a time, in the precision of `like`: the same to the last bit wherever it is asked for, as
    what is found to touch at one place must touch at the next, too."""
    number = type(like)
    x, y, z = c.x, c.y, c.z
    vx, vy, vz = number(0), number(0), number(0)
    if c.path is not None:
        start = Particle(float(x), float(y), float(z), 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, t, 1.0)
        x, y, z, vx, vy, vz = (number(each) for each in path(c.path, start))
    rows = None
    if c.spin is not None:
        n = c.spin
        angle = float(n.rate) * t
        cos, sin = number(np.cos(angle)), number(np.sin(angle))
        k = number(1) - cos
        rows = (
            (cos + k * n.x * n.x, k * n.x * n.y - sin * n.z, k * n.x * n.z + sin * n.y),
            (k * n.x * n.y + sin * n.z, cos + k * n.y * n.y, k * n.y * n.z - sin * n.x),
            (k * n.x * n.z - sin * n.y, k * n.y * n.z + sin * n.x, cos + k * n.z * n.z),
        )
    return Frame(x, y, z, vx, vy, vz, rows)


def led_to(body: Any, time: float) -> tuple[list[float], list[float]]:
    """Where the path of a collider that moves has its pivot at a time [s], and the velocity there; NaN where it has none."""
    try:
        with np.errstate(all="ignore"):
            frame = frame_at(body, np.float64(time), np.float64(0))
        return [float(number) for number in frame[:3]], [float(number) for number in frame[3:6]]
    except (ArithmeticError, ValueError):  # from plain numbers: 1/x of a place at x = 0
        return [math.nan] * 3, [math.nan] * 3


def into(rows: Any, v: Any) -> Any:
    """Rᵀ v."""
    if rows is None:
        return v
    return tuple(rows[0][k] * v[0] + rows[1][k] * v[1] + rows[2][k] * v[2] for k in range(3))


def out_of(rows: Any, v: Any) -> Any:
    """R v."""
    if rows is None:
        return v
    return tuple(row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in rows)


def surface_velocity(c: MovingRecord, f: Frame, x: Any, y: Any, z: Any) -> Any:
    """Velocity of the collider's body at a place in the world [m/s]."""
    if c.spin is None:
        return f.vx, f.vy, f.vz
    n = c.spin
    dx, dy, dz = x - f.x, y - f.y, z - f.z
    return (
        f.vx + n.rate * (n.y * dz - n.z * dy),
        f.vy + n.rate * (n.z * dx - n.x * dz),
        f.vz + n.rate * (n.x * dy - n.y * dx),
    )


def lead_of(shape: Any, x: Any, t: Any) -> Any:
    """The velocity of a collider's body at a place in the world [m/s], at a time."""
    if isinstance(shape, MovingRecord):
        return surface_velocity(shape, frame_at(shape, t, x[0]), x[0], x[1], x[2])
    return 0.0, 0.0, 0.0


def carried(shape: Any, belt: Any, t: Any, like: Any) -> Any:
    """The velocity of a surface along itself [m/s] in the world at a time: a belt turns with its collider; None where there
    is none."""
    if belt is None or not isinstance(shape, MovingRecord):
        return belt
    if shape.spin is None:
        return belt
    return out_of(frame_at(shape, t, like).rows, belt)


def ride(c: MovingRecord, p: Particle) -> Particle:
    """The particle as it is in the frame of the collider, at its time."""
    f = frame_at(c, p.t, p.x)
    wx, wy, wz = surface_velocity(c, f, p.x, p.y, p.z)
    x, y, z = into(f.rows, (p.x - f.x, p.y - f.y, p.z - f.z))
    vx, vy, vz = into(f.rows, (p.vx - wx, p.vy - wy, p.vz - wz))
    return moved_to(p, x + c.x, y + c.y, z + c.z, vx, vy, vz, p.t)


def ride_until(c: MovingRecord, p: Particle, t: Any) -> Particle:
    """The particle as `ride` has it at its time, but with its relative velocity along the axes that the frame has at t: so
    what it is then is compared with what it was, and nothing seems to turn but what does."""
    local = ride(c, p)
    if c.spin is None:
        return local
    f = frame_at(c, p.t, p.x)
    wx, wy, wz = surface_velocity(c, f, p.x, p.y, p.z)
    vx, vy, vz = into(frame_at(c, t, p.x).rows, (p.vx - wx, p.vy - wy, p.vz - wz))
    return moved_to(p, local.x, local.y, local.z, vx, vy, vz, p.t)


def alight(c: MovingRecord, p: Particle) -> Particle:
    """The particle in the world, of one in the frame of the collider."""
    f = frame_at(c, p.t, p.x)
    x, y, z = out_of(f.rows, (p.x - c.x, p.y - c.y, p.z - c.z))
    x, y, z = x + f.x, y + f.y, z + f.z
    vx, vy, vz = out_of(f.rows, (p.vx, p.vy, p.vz))
    wx, wy, wz = surface_velocity(c, f, x, y, z)
    return moved_to(p, x, y, z, vx + wx, vy + wy, vz + wz, p.t)


def alight_after(c: MovingRecord, p: Particle, q: Particle) -> Particle:
    """The particle in the world of one in the frame of the collider, p, that impulses and shifts have made of q: what moves
    in the frame has changed its velocity in the world by the impulses alone, not by the shift, too."""
    away = alight(c, p)
    if c.spin is None:
        return away
    n = c.spin
    slides = (p.vx != 0) | (p.vy != 0) | (p.vz != 0)
    rate = n.rate if slides else n.rate - n.rate
    x, y, z = out_of(frame_at(c, p.t, p.x).rows, (p.x - q.x, p.y - q.y, p.z - q.z))
    vx, vy, vz = n.y * z - n.z * y, n.z * x - n.x * z, n.x * y - n.y * x
    return moved_to(
        p, away.x, away.y, away.z, away.vx - rate * vx, away.vy - rate * vy, away.vz - rate * vz, p.t
    )


def outwards(c: MovingRecord, n: Any, p: Particle) -> Any:
    """A normal of the shape's frame in the world."""
    if c.spin is None:
        return n
    return out_of(frame_at(c, p.t, p.x).rows, n)


@law(gap, MovingRecord)
def moving_gap(c: MovingRecord, p: Particle) -> float:
    return gap(c.shape, ride(c, p))


@law(normal, MovingRecord)
def moving_normal(c: MovingRecord, p: Particle) -> Vector:
    return outwards(c, normal(c.shape, ride(c, p)), p)


@law(gap_and_normal, MovingRecord)
def moving_gap_and_normal(c: MovingRecord, p: Particle) -> tuple[float, Vector]:
    g, n = gap_and_normal(c.shape, ride(c, p))
    return g, outwards(c, n, p)


@law(least_gap, MovingRecord)
def moving_least_gap(c: MovingRecord, p: Particle, need: float) -> float:
    return type(p.x)(-1)  # for how long it stays where it is nobody knows


@law(thinnest, MovingRecord)
def moving_thinnest(c: MovingRecord) -> float:
    return thinnest(c.shape)


@law(apart, MovingRecord)
def moving_apart(c: MovingRecord, p: Particle, q: Particle, h: float, slack: float) -> bool:
    return apart(c.shape, ride(c, p), ride(c, q), h, slack)


@law(first_contact, MovingRecord)
def moving_first_contact(c: MovingRecord, p: Particle, q: Particle, h: float, slack: float) -> float:
    return first_contact(c.shape, ride(c, p), ride(c, q), h, slack)


def spin_of(shape: Any) -> Any:
    """The angular velocity of a collider [rad/s]."""
    if isinstance(shape, MovingRecord) and shape.spin is not None:
        s = shape.spin
        return s.rate * s.x, s.rate * s.y, s.rate * s.z
    return 0.0, 0.0, 0.0
