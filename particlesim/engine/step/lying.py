"""The colliders on which a particle lies, and its step there: on one, in the crease of a shape, or on several one by one."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.dents import dented
from particlesim.colliders.moving import MovingRecord, alight_after, frame_at, ride, ride_until
from particlesim.colliders.response import at_rest, crossable, square
from particlesim.compiler import outlined
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.contacts import MANY, SHALLOW, coarse
from particlesim.engine.step.creases import crept, free_part, no_faster
from particlesim.engine.step.resting import carried, glided, held, lies, touched, turns
from particlesim.laws.registry import gap

STEADY = 0.02
"""How far the place of a collider that is led may be off its mean velocity in a step, as a part of the change of that times
half the step, and slight changes, as a part of the speed of what lies on it."""


def settled(
    colliders: Any, p: Any, q: Any, h: Any, tolerance: Any, slack: Any, sure: Any, by_calls: bool = False
) -> Any:
    """The end of a step from p that would end at q without contact, on the colliders on which p lies; which those are; and
    the part of the step after which p turns around, 1 if it does not. `by_calls`: colliders are looked at by a function."""
    if len(colliders) == 0:
        return q, (), type_of(h, 1)
    here, r, turn = (_borne_alone if by_calls else borne)(colliders[0], p, q, h, tolerance, slack, sure)
    q, others, first = settled(colliders[1:], p, chosen(here, r, q), h, tolerance, slack, sure, by_calls)
    return q, (here, *others), min(turn if here else type_of(h, 1), first)


@outlined
def settled_one(colliders: Any, p: Any, q: Any, h: Any, tolerance: Any, slack: Any, sure: Any) -> Any:
    """`settled`, for where it is looked at one particle by itself."""
    return settled(colliders, p, q, h, tolerance, slack, sure, len(colliders) > MANY)


def no_higher(colliders: Any, on: Any, p: Any, q: Any, r: Any, h: Any, tolerance: Any, slack: Any) -> Any:
    """The end r of a step from p on some colliders, of which a convex one may have lifted it: `no_faster` than the uniform
    force allows that would lead to q without them."""
    convex = any(crossable(c) and not dented(c.shape) for c in colliders)
    runs = any(isinstance(c.shape, MovingRecord) or c.response.belt is not None for c in colliders)
    if not convex or runs or any(c.response.turning is not None for c in colliders):
        return r
    return chosen(any(on), no_faster(colliders, p, q, r, h, tolerance, slack, True), r)


@outlined
def _borne_alone(c: Any, p: Any, q: Any, h: Any, tolerance: Any, slack: Any, sure: Any) -> Any:
    return borne(c, p, q, h, tolerance, slack, sure)


def borne(c: Any, p: Any, q: Any, h: Any, tolerance: Any, slack: Any, sure: Any) -> Any:
    """Whether a step from p to q is rest on a collider, and what `held` says of it. One that moves is at rest in its own
    frame."""
    if isinstance(c.shape, MovingRecord):
        s, end = ride_until(c.shape, p, q.t), ride(c.shape, q)
        still = c.shape.spin is None
        here, r, turn = _borne(at_rest(c), ride(c.shape, p), s, end, h, tolerance, slack, sure, still)
        if still and turns(at_rest(c)):
            here &= led_steadily(c.shape, p, q, h)
        return here, alight_after(c.shape, r, end), turn
    return _borne(c, p, p, q, h, tolerance, slack, sure, True)


def led_steadily(c: Any, p: Any, q: Any, h: Any) -> Any:
    """Whether a path leads a collider through a step of h from p to q without a jerk: the forces that this is in its frame
    are the same all along, or slight. As it stops, what lies in it flies on, and meets it."""
    a, b, half = frame_at(c, p.t, 0.0), frame_at(c, q.t, 0.0), 0.5 * float(h)
    jump = square((b.vx - a.vx, b.vy - a.vy, b.vz - a.vz))
    off = square(
        tuple(y - x - half * (u + v) for x, y, u, v in zip(a[:3], b[:3], a[3:6], b[3:6], strict=True))
    )
    kick = square((float(q.vx - p.vx), float(q.vy - p.vy), float(q.vz - p.vz)))
    own = square((float(p.vx) - a.vx, float(p.vy) - a.vy, float(p.vz) - a.vz))
    steady = STEADY * STEADY
    return (off <= steady * half * half * jump) | (jump <= kick + steady * own)


def _borne(c: Any, p: Any, s: Any, q: Any, h: Any, tolerance: Any, slack: Any, sure: Any, still: bool) -> Any:
    """As `borne`, in the frame of the collider, unless it stands `still`; s is p with its velocity along the axes of the end
    of the step."""
    touch = touched(c, p, q)
    here = lies(c, p, q, touch, h, tolerance, slack, sure)
    turning = turns(c) and (still or c.response.turning is not None)
    if turning and c.response.turning is None:
        r, turn = glided(c, s, q, touch, h, tolerance)
    elif turning:
        start, end, way = carried(c, s, q, touch, h, tolerance)
        r, turn = held(c, start, end, way, h, tolerance, True)
    else:
        r, turn = held(c, s, q, touch, h, tolerance)
    if dented(c.shape):
        steady = not turning
        free = free_part(c, here, p, r, touch.up, touch.normal, h, slack)
        lain, turn = free > 0, min(turn, free)
        if coarse(tolerance) and isinstance(p.x, np.float32):
            lain = lain & (
                gap(c, r) >= type_of(h, -SHALLOW) * slack
            )  # else `trace` looks, in double precision
        elif (touch.start <= slack) & ((not lain) | (gap(c, r) < -slack)):
            rests, end, bend, leaves = crept(c, p, q, h, tolerance, slack, sure)
            if rests:
                lain, r, turn, steady = True, end, bend, True
            if leaves:
                lain = False
        if c.response.belt is None:
            r = chosen(steady, no_faster((c,), s, q, r, h, tolerance, slack), r)
        return lain, r, turn
    return here, r, turn
