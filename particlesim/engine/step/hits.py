"""Impacts that emitters react to: the first of a particle in a step."""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.colliders.moving import MovingRecord, ride
from particlesim.colliders.response import along
from particlesim.engine.state.columns import type_of
from particlesim.laws.registry import gap_and_normal, moved_to, normal


class Hit(NamedTuple):
    """An impact: the number of the collider, and the speed along its normal relative to it, 0 for none; the particle before
    it, with its time, on the surface, and the normal."""

    collider: Any
    speed: Any
    p: Any
    x: Any
    y: Any
    z: Any


FAINT = 1e-6
"""The speed of an impact, as a part of that of another one in the step, below which it is none."""


def silence(colliders: Any, p: Any) -> Any:
    """No impact; None where no emitter would react to one."""
    if all(c.response.heard is None for c in colliders):
        return None
    zero = p.x - p.x
    return Hit(-1, zero, p, zero, zero, zero)


def hear(colliders: Any, p: Any, hit: Any) -> Any:
    """An impact of a particle that is inside of colliders, unless there has been one before it in the step."""
    if hit is None:
        return None
    for c in colliders:
        if c.response.heard is not None:
            local, shape = p, c.shape
            if isinstance(c.shape, MovingRecord):
                local, shape = ride(c.shape, p), c.shape.shape
            speed = -along(normal(shape, local), local)
            zero = p.x - p.x
            g, axes = gap_and_normal(c, p)
            n = tuple(zero if axis is None else axis for axis in axes)
            new = (g < 0) & (speed > 0) & (not hit.speed > 0)
            hit = Hit(
                c.response.heard if new else hit.collider,
                speed if new else hit.speed,
                moved_to(
                    p,
                    p.x - g * n[0] if new else hit.p.x,
                    p.y - g * n[1] if new else hit.p.y,
                    p.z - g * n[2] if new else hit.p.z,
                    p.vx if new else hit.p.vx,
                    p.vy if new else hit.p.vy,
                    p.vz if new else hit.p.vz,
                    p.t if new else hit.p.t,
                ),
                n[0] if new else hit.x,
                n[1] if new else hit.y,
                n[2] if new else hit.z,
            )
    return hit


def louder(hit: Any, other: Any) -> Any:
    """The first impact, unless it is nothing beside another one, as hops of what slides are beside its impact on a wall."""
    if hit is None:
        return None
    if hit.speed < type_of(hit.speed, FAINT) * other.speed:
        hit = other
    return hit


def tell(rows: Any, i: Any, hit: Any) -> None:
    """Write the impact of particle i down, in the order of `state.table.HIT`, if there was one and it is the first."""
    if hit is None or len(rows) == 0:
        return
    if hit.speed > 0 and not rows[2][i] > 0:
        rows[0][i], rows[1][i], rows[2][i] = hit.p.t, hit.collider, hit.speed
        rows[3][i], rows[4][i], rows[5][i] = hit.p.x, hit.p.y, hit.p.z
        rows[6][i], rows[7][i], rows[8][i] = hit.x, hit.y, hit.z
        rows[9][i], rows[10][i], rows[11][i] = hit.p.vx, hit.p.vy, hit.p.vz
        rows[12][i] = -1.0
