"""Limits and motors of joints, as contacts with a moment: their row has no direction and the arms a for an axis a.

With θ the angle of the first body against the second about a, u = a·(ω₁ − ω₂) its rate. A limit is a contact whose gap is
the remaining angle; a motor is one that drives u to ω₀ with an impulse of at most τ h, in either direction. The cone of a
ball joint bounds the angle φ between an axis of the first body and one of the second: with a along a₁ × a₂, u = −dφ/dt.

Their impulses are found together with those of contacts, and joints transmit them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import WORLD, add_contact, orientation, place, row, set_surface
from particlesim.engine.rigid.rotation import cross, dot, matrix, to_world, turned_by

LIMIT, MOTOR, ROLL = 1, 2, 3
"""What a contact that turns bodies is (`Contacts.turns`); the last is rolling friction (`rolling`)."""
NUMBERED = 1 << 52
"""First number for their features."""
WATCHED = 0.02
"""Angle from a limit within which it counts, in addition to the change in a step [rad]."""


class Stops(NamedTuple):
    """Joints with limits or motors: the number of each [m]; a direction across the axis in the frame of the first body, and
    the same at the start in that of the second [3, m] (of a cone both axes); the range of the angle [rad] (infinite: none;
    of a cone 0 and its angle); the speed and the greatest torque of motors [rad/s, N m] (torque 0: none), and whether it
    is a cone [m]."""

    joint: Any
    mark: Any
    other: Any
    low: Any
    high: Any
    speed: Any
    torque: Any
    cone: Any


def marks(stops: Any, j: Any, b: Any, s: Any) -> Any:
    """The axis of a hinge, and the marks of both bodies, in the world."""
    g = stops.joint[s]
    r = matrix(orientation(b, j.first[g]))
    p, q, k = to_world(r, row(stops.mark, s)), row(stops.other, s), j.second[g]
    if k != WORLD:
        q = to_world(matrix(orientation(b, k)), q)
    return to_world(r, row(j.axis, g)), p, q


@outlined
def angle_of(stops: Any, j: Any, b: Any, s: Any) -> Any:
    """The angle of a joint [rad], and the axis about which the first body turns to raise it."""
    a, p, q = marks(stops, j, b, s)
    n = cross(q, p)
    if stops.cone[s] == 0:
        return np.arctan2(dot(a, n), dot(q, p)), a
    size = np.sqrt(dot(n, n))
    if not size > 0:
        return np.arctan2(0.0, dot(q, p)), (1.0, 0.0, 0.0)
    return np.arctan2(size, dot(q, p)), (n[0] / size, n[1] / size, n[2] / size)


@outlined
def find_stops(stops: Any, j: Any, b: Any, k: Any, motion: Any, h: Any) -> None:
    """Note limits that a step of length h may come to, and motors."""
    for s in range(stops.joint.size):
        g = stops.joint[s]
        angle, a = angle_of(stops, j, b, s)
        m = motion.now[j.first[g]]
        u = a[0] * m[3] + a[1] * m[4] + a[2] * m[5]
        if j.second[g] != WORLD:
            m = motion.now[j.second[g]]
            u -= a[0] * m[3] + a[1] * m[4] + a[2] * m[5]
        near, code = WATCHED + 2 * h * abs(u), NUMBERED + 4 * g
        if stops.cone[s] == 0 and angle - stops.low[s] < near:
            note_turn(j, b, k, g, code, a, angle - stops.low[s], LIMIT)
        if stops.high[s] - angle < near:
            note_turn(j, b, k, g, code + 1, (-a[0], -a[1], -a[2]), stops.high[s] - angle, LIMIT)
        if stops.torque[s] > 0:
            number = note_turn(j, b, k, g, code + 2, a, 0.0, MOTOR)
            if number >= 0:
                k.aim[0, number], k.aim[1, number] = stops.speed[s], h * stops.torque[s]


def note_turn(j: Any, b: Any, k: Any, g: Any, code: Any, a: Any, gap: Any, what: Any) -> int:
    """Note a contact that turns the bodies of joint g about an axis."""
    number = add_contact(k, j.first[g], j.second[g], code, place(b, j.first[g]), a, gap)
    set_surface(k, number, 0.0, 0.0, 0.0)
    if number >= 0:
        k.turns[number] = what
    return number


def lay_turn(k: Any, motion: Any, c: Any) -> None:
    """The rows of such a contact: about its normal, or of rolling friction about two tangents."""
    for d in range(3):
        for entry in range(15):
            k.rows[c, d, entry] = 0.0
        k.rows[c, d, 15] = 1.0
    n, size = row(k.normal, c), k.aim[1, c]
    if k.turns[c] != ROLL:
        lay_axis(k, motion, c, 0, n)
    elif size > 0:
        one = tangent(n)
        two = cross(n, one)
        lay_axis(k, motion, c, 1, (size * one[0], size * one[1], size * one[2]))
        lay_axis(k, motion, c, 2, (size * two[0], size * two[1], size * two[2]))


def tangent(n: Any) -> Any:
    """A unit vector across another, made with that axis of the world which is farthest from it."""
    x, y, z = abs(n[0]), abs(n[1]), abs(n[2])
    other = (1.0, 0.0, 0.0) if x <= y and x <= z else ((0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0))
    one = cross(n, other)
    length = 1 / np.sqrt(dot(one, one))
    return one[0] * length, one[1] * length, one[2] * length


def lay_axis(k: Any, motion: Any, c: Any, d: Any, a: Any) -> None:
    """A row that turns bodies about an axis."""
    i, j = k.first[c], k.second[c]
    e = k.rows[c, d]
    e[3], e[4], e[5] = a
    e[9], e[10], e[11] = turned_by(motion.inverse[i], a)
    give = e[3] * e[9] + e[4] * e[10] + e[5] * e[11]
    if j != WORLD:
        e[6], e[7], e[8] = a
        e[12], e[13], e[14] = turned_by(motion.inverse[j], a)
        give += e[6] * e[12] + e[7] * e[13] + e[8] * e[14]
    e[15] = 1 / give


@outlined
def motor_work(k: Any, means: Any) -> float:
    """The work of motors [J] on bodies that move with the means of their velocities before and after."""
    total = 0.0
    for c in range(k.number[0]):
        if k.turns[c] == MOTOR:
            total += k.impulse[c, 0] * turn_rate(k, means, c)
    return total


def turn_rate(k: Any, velocities: Any, c: Any) -> Any:
    """How fast the bodies of a contact that turns them turn against each other, with some velocities [n, 6 or more]."""
    e, m = k.rows[c, 0], velocities[k.first[c]]
    u = e[3] * m[3] + e[4] * m[4] + e[5] * m[5]
    if k.second[c] != WORLD:
        m = velocities[k.second[c]]
        u -= e[6] * m[3] + e[7] * m[4] + e[8] * m[5]
    return u
