"""The response to contact, the same for all shapes.

A shape gives the gap g of a particle and the unit normal n = ∇g; the legal side is g > 0. On overlap the particle is put
back on the surface, and if it approaches (v·n < 0) its velocity becomes (impulse j = −(1 + e) m (v·n) n)

    v' = v − (1 + e) (v·n) n − k (v − (v·n) n)

with restitution e and tangential loss k. Nothing of it gains energy: |v'|² = e² v_n² + (1 − k)² v_t².

Coulomb friction takes at most μ_k |j| more along the surface, and no more than there is: what slides at (1 − k) |v_t| before
slides at max((1 − k) |v_t| − μ_k |j|/m, 0) after. The particle is a point that does not turn; how colliders rub spheres that
turn is in `engine.step.rubbing`. Where the surface runs along itself (`belt`), v_t is relative to it.

A component of a normal that is None is always zero: it drops out of the compiled loop. A normal with two of them lies along
an axis, and the response is exact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.moving import MovingRecord, alight, ride
from particlesim.compiler import outlined
from particlesim.laws.registry import (
    PASS,
    Particle,
    Vector,
    apart,
    contact,
    first_contact,
    gap,
    gap_and_normal,
    has_law,
    law,
    moved_to,
    normal,
    side_from,
    surface,
)


class FrictionRecord(NamedTuple):
    """Coefficients of friction μ_s and μ_k."""

    static: float
    kinetic: float


class FallingRecord(NamedTuple):
    """Restitution that falls with the speed of the impact, e = e₀ (max(v, v₀)/v₀)⁻ⁿ: v₀ [m/s] and n."""

    speed: float
    exponent: float


STEADY = FallingRecord(1.0, 0.0)
"""Restitution that does not fall."""


class PenaltyRecord(NamedTuple):
    """Spring [N/m] and damper [kg/s] of a surface that pushes what is inside of it out."""

    stiffness: float
    damping: float


class RecoveryRecord(NamedTuple):
    """Time constant in which what is inside is brought back to the surface [s]."""

    time: float


class ResponseRecord(NamedTuple):
    """1 + e (at low speed), k, 1 − k, and what becomes of the particle; friction, how e falls with speed, the velocity
    of the surface along itself [m/s], how it yields, the number under which somebody hears of impacts, each None where
    there is none. `turning` and `even`: an empty tuple where forces may turn along the way of what lies on it, and where
    they are the same along it; `even` holds one where velocities are not those of the places; else None."""

    bounce: float
    loss: float
    keep: float
    outcome: int
    friction: FrictionRecord | None = None
    falling: FallingRecord | None = None
    belt: tuple[float, float, float] | None = None
    yielding: PenaltyRecord | RecoveryRecord | None = None
    heard: int | None = None
    turning: tuple[()] | None = None
    even: tuple[()] | tuple[tuple[()]] | None = None
    called: tuple[()] | None = None


class ColliderRecord(NamedTuple):
    """A shape and the response to contact with it."""

    shape: Any
    response: ResponseRecord


def crossable(c: Any) -> bool:
    """Whether a way between two legal places may cross a collider."""
    return has_law(first_contact, c.shape)


def opposite(c: Any, p: Any, q: Any) -> Any:
    """Whether p and q are on opposite sides of a collider, such as a thin sheet, and not only at two sides of a corner."""
    n, m = normal(c, p), normal(c, q)
    return n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < type(p.x)(-0.5)


@law(gap, ColliderRecord)
def collider_gap(c: ColliderRecord, p: Particle) -> float:
    return gap(c.shape, p) if c.response.called is None else _gap(c.shape, p)


@law(normal, ColliderRecord)
def collider_normal(c: ColliderRecord, p: Particle) -> Vector:
    return normal(c.shape, p) if c.response.called is None else _normal(c.shape, p)


@law(gap_and_normal, ColliderRecord)
def collider_gap_and_normal(c: ColliderRecord, p: Particle) -> tuple[float, Vector]:
    return gap_and_normal(c.shape, p) if c.response.called is None else _gap_and_normal(c.shape, p)


@law(side_from, ColliderRecord)
def collider_side_from(c: ColliderRecord, p: Particle, q: Particle) -> tuple[float, Vector]:
    return side_from(c.shape, p, q) if c.response.called is None else _side_from(c.shape, p, q)


@law(apart, ColliderRecord)
def collider_apart(c: ColliderRecord, p: Particle, q: Particle, h: float, slack: float) -> bool:
    look = apart if c.response.called is None else _apart
    return look(c.shape, p, q, h, slack)


@law(first_contact, ColliderRecord)
def collider_first_contact(c: ColliderRecord, p: Particle, q: Particle, h: float, slack: float) -> float:
    look = first_contact if c.response.called is None else _first_contact
    return look(c.shape, p, q, h, slack)


@outlined
def _gap(shape: Any, p: Any) -> Any:
    return gap(shape, p)


@outlined
def _side_from(shape: Any, p: Any, q: Any) -> Any:
    return side_from(shape, p, q)


@outlined
def _normal(shape: Any, p: Any) -> Any:
    return normal(shape, p)


@outlined
def _gap_and_normal(shape: Any, p: Any) -> Any:
    return gap_and_normal(shape, p)


@outlined
def _apart(shape: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    return apart(shape, p, q, h, slack)


@outlined
def _first_contact(shape: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    return first_contact(shape, p, q, h, slack)


def called(c: Any) -> ColliderRecord:
    """The same collider, as one of many."""
    return _marked(c, c.response.even, ())


def under_late(c: Any) -> Any:
    """The same collider, where velocities are not those of the places."""
    return c if c.response.even is None else _marked(c, ((),), c.response.called)


def _marked(c: Any, even: Any, called: Any) -> ColliderRecord:
    r = c.response
    marked = ResponseRecord(
        r.bounce,
        r.loss,
        r.keep,
        r.outcome,
        r.friction,
        r.falling,
        r.belt,
        r.yielding,
        r.heard,
        r.turning,
        even,
        called,
    )
    return ColliderRecord(c.shape, marked)


def at_rest(c: Any) -> ColliderRecord:
    """A moving collider in its own frame."""
    return ColliderRecord(c.shape.shape, c.response)


# Selects, not branches: the loop over a block must stay vectorised.


@law(contact, ColliderRecord)
def collider_contact(c: ColliderRecord, p: Particle) -> tuple[Particle, int]:
    return (_contact if c.response.called is None else _contact_of_many)(c, p)


@outlined
def _contact_of_many(c: Any, p: Any) -> Any:
    return _contact(c, p)


def _contact(c: Any, p: Any) -> Any:
    if has_law(contact, c.shape):  # what has no surface to be put back on
        return contact(c.shape, p)
    if isinstance(c.shape, MovingRecord):
        local, outcome = _contact(at_rest(c), ride(c.shape, p))
        back = alight(c.shape, local)
        touched = gap(c, p) < 0
        q = moved_to(
            p,
            back.x if touched else p.x,
            back.y if touched else p.y,
            back.z if touched else p.z,
            back.vx if touched else p.vx,
            back.vy if touched else p.vy,
            back.vz if touched else p.vz,
            p.t,
        )
        return q, outcome
    g, n = gap_and_normal(c.shape, p)
    below = g < 0
    approach = along(n, p)
    hit = below & (approach < 0)
    x, y, z = put_back(c.shape, p, g, n)
    vx, vy, vz = rebound(c.response, n, approach, p)
    q = moved_to(
        p,
        x if below else p.x,
        y if below else p.y,
        z if below else p.z,
        vx if hit else p.vx,
        vy if hit else p.vy,
        vz if hit else p.vz,
        p.t,
    )
    return q, c.response.outcome if below else PASS


def yielded(c: Any, p: Any, h: Any) -> Any:
    """The particle after a step of h at the end of which it may be inside of a surface that yields.

    A penalty is a kick by the force max(−k g − c v·n, 0) at the end of the step, with v·n the mean of before and after, so
    that with the drift of the next step it is stable for h √(k/m) < 2, whatever the damper. Recovery is the response to
    impacts, and the part 1 − exp(−h/τ) of the way back.
    """
    if isinstance(c.shape, MovingRecord):
        local = ride(c.shape, p)
        after = yielded(at_rest(c), local, h)
        away = alight(c.shape, after)
        same = (after.x == local.x) & (after.y == local.y) & (after.z == local.z)
        still = same & (after.vx == local.vx) & (after.vy == local.vy) & (after.vz == local.vz)
        return moved_to(
            p,
            p.x if same else away.x,
            p.y if same else away.y,
            p.z if same else away.z,
            p.vx if still else away.vx,
            p.vy if still else away.vy,
            p.vz if still else away.vz,
            p.t,
        )
    g, n = gap_and_normal(c.shape, p)
    approach = along(n, p)
    zero, one = type(g)(0), type(g)(1)
    below = g < 0
    if isinstance(c.response.yielding, PenaltyRecord):
        spring, damper = c.response.yielding.stiffness, c.response.yielding.damping
        share = type(g)(0.5) * h * p.w * damper
        push = (-h * p.w * spring * g - 2 * share * approach) / (one + share)
        kick = max(push, zero) if below else zero
        vx, vy, vz = (
            v if axis is None else v + kick * axis for v, axis in zip((p.vx, p.vy, p.vz), n, strict=True)
        )
        return moved_to(p, p.x, p.y, p.z, vx, vy, vz, p.t)
    back = g * (one - np.exp(-h / c.response.yielding.time)) if below else zero
    hit = below & (approach < 0)
    after = rebound(c.response, n, approach, p)
    x, y, z = (v if axis is None else v - back * axis for v, axis in zip((p.x, p.y, p.z), n, strict=True))
    vx, vy, vz = (new if hit else old for new, old in zip(after, (p.vx, p.vy, p.vz), strict=True))
    return moved_to(p, x, y, z, vx, vy, vz, p.t)


def flat(n: Any) -> bool:
    """Whether a normal lies along an axis."""
    return n[0] is None or n[1] is None or n[2] is None


def along(n: Any, p: Any) -> Any:
    """v·n."""
    return projected(n, (p.vx, p.vy, p.vz))


def projected(n: Any, v: Any) -> Any:
    """The component of a vector along a normal."""
    if n[1] is None and n[2] is None:
        return n[0] * v[0]
    if n[0] is None and n[2] is None:
        return n[1] * v[1]
    if n[0] is None and n[1] is None:
        return n[2] * v[2]
    return v[0] * n[0] + v[1] * n[1] + v[2] * n[2]


def put_back(shape: Any, p: Any, g: Any, n: Any) -> Any:
    """The nearest place where the particle touches: x − g n, unless the shape knows better."""
    if has_law(surface, shape):
        return surface(shape, p)
    return p.x - g * n[0], p.y - g * n[1], p.z - g * n[2]


def bounce_at(response: Any, approach: Any) -> Any:
    """1 + e at the normal velocity of an impact."""
    if response.falling is None:
        return response.bounce
    one = type(approach)(1)
    return one + (response.bounce - one) * falls_by(response.falling, -approach)


def falls_by(falling: Any, speed: Any) -> Any:
    """The part of the restitution of slow impacts that is left at a speed [m/s]."""
    return max(speed / falling.speed, type(speed)(1)) ** (-falling.exponent)


def belt_along(response: Any, n: Any) -> Any:
    """The velocity of the surface along itself; None along a normal that is an axis, and where it is zero."""
    return along_surface(response.belt, n)


def along_surface(belt: Any, n: Any) -> Any:
    """The part of a belt along the surface, as `belt_along` has it."""
    if belt is None:
        return None, None, None
    if flat(n):
        return tuple(u if axis is None else None for u, axis in zip(belt, n, strict=True))
    across = projected(n, belt)
    return tuple(u - across * axis for u, axis in zip(belt, n, strict=True))


def sliding(response: Any, n: Any, approach: Any, p: Any) -> Any:
    """The velocity along the surface, relative to it; None along a normal that is an axis. `approach` is v·n."""
    parts = zip((p.vx, p.vy, p.vz), n, belt_along(response, n), strict=True)
    if flat(n):
        return tuple((v if u is None else v - u) if axis is None else None for v, axis, u in parts)
    return tuple(v - approach * axis - (0 if u is None else u) for v, axis, u in parts)


def square(v: Any) -> Any:
    """|v|² of a vector some components of which may be None."""
    if v[0] is None:
        return v[1] * v[1] + v[2] * v[2]
    if v[1] is None:
        return v[0] * v[0] + v[2] * v[2]
    if v[2] is None:
        return v[0] * v[0] + v[1] * v[1]
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]


def rebound(response: Any, n: Any, approach: Any, p: Any) -> Any:
    """The velocity after an impact."""
    velocity = (p.vx, p.vy, p.vz)
    if isinstance(response.bounce, np.float32) and not isinstance(p.x, np.float32) and not flat(n):
        # A collider of single precision, in an impact that is worked out in double: the length of its normal is off by a
        # rounding error that is the same in every impact with a flat side, and would be gained each time.
        n = tuple(np.float64(axis) for axis in n)
        size = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        n, approach = (n[0] / size, n[1] / size, n[2] / size), approach / size
    bounce = bounce_at(response, approach)
    if response.friction is not None or response.belt is not None:
        slide = sliding(response, n, approach, p)
        kept = response.keep if response.friction is None else held_back(response, slide, -bounce * approach)
        return with_slide(response, n, (type(approach)(1) - bounce) * approach, kept, slide)
    if flat(n):
        return tuple(
            response.keep * v if axis is None else v - bounce * v for v, axis in zip(velocity, n, strict=True)
        )
    # −(1 + e) v_n n − k (v − v_n n) = j n − k v
    j = (response.loss - bounce) * approach
    return tuple(v + j * axis - response.loss * v for v, axis in zip(velocity, n, strict=True))


def held_back(response: Any, slide: Any, push: Any) -> Any:
    """The part of a sliding velocity that loss and friction leave, under a normal impulse over mass `push` [m/s]."""
    speed = response.keep * np.sqrt(square(slide))
    left = speed - response.friction.kinetic * push
    return response.keep * (left / speed) if left > 0 else left - left


def with_slide(response: Any, n: Any, leave: Any, kept: Any, slide: Any) -> Any:
    """The velocity that has `leave` along the normal, and along the surface the part `kept` of a relative velocity."""
    belt = belt_along(response, n)
    if flat(n):
        return tuple(
            leave * axis if axis is not None else kept * s if u is None else u + kept * s
            for axis, s, u in zip(n, slide, belt, strict=True)
        )
    return tuple(
        leave * axis + kept * s + (0 if u is None else u) for axis, s, u in zip(n, slide, belt, strict=True)
    )
