"""The response to contact, the same for all shapes.

A shape gives the gap g of a particle and the unit normal n = ∇g; the legal side is g > 0. On overlap the particle is put
back on the surface, and if it approaches (v·n < 0) its velocity becomes (impulse j = −(1 + e) m (v·n) n)

    v' = v − (1 + e) (v·n) n − k (v − (v·n) n)

with restitution e and tangential loss k. Nothing of it gains energy: |v'|² = e² v_n² + (1 − k)² v_t².

A component of a normal that is None is always zero: it drops out of the compiled loop. A normal with two of them lies along
an axis, and the response is exact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.laws.registry import (
    PASS,
    Particle,
    Vector,
    contact,
    gap,
    has_law,
    law,
    moved_to,
    normal,
    passing,
    surface,
)


class ResponseRecord(NamedTuple):
    """1 + e, k, 1 − k, and what becomes of the particle."""

    bounce: float
    loss: float
    keep: float
    outcome: int


class ColliderRecord(NamedTuple):
    """A shape and the response to contact with it."""

    shape: Any
    response: ResponseRecord


def crossable(c: Any) -> bool:
    """Whether a straight way between two legal places may cross a collider."""
    return has_law(passing, c.shape)


@law(gap, ColliderRecord)
def collider_gap(c: ColliderRecord, p: Particle) -> float:
    return gap(c.shape, p)


@law(normal, ColliderRecord)
def collider_normal(c: ColliderRecord, p: Particle) -> Vector:
    return normal(c.shape, p)


@law(passing, ColliderRecord)
def collider_passing(c: ColliderRecord, p: Particle, q: Particle) -> float:
    return passing(c.shape, p, q)


# Selects, not branches: the loop over a block must stay vectorised.


@law(contact, ColliderRecord)
def collider_contact(c: ColliderRecord, p: Particle) -> tuple[Particle, int]:
    g, n = gap(c.shape, p), normal(c.shape, p)
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


def along(n: Any, p: Any) -> Any:
    """v·n."""
    if n[1] is None and n[2] is None:
        return n[0] * p.vx
    if n[0] is None and n[2] is None:
        return n[1] * p.vy
    if n[0] is None and n[1] is None:
        return n[2] * p.vz
    return p.vx * n[0] + p.vy * n[1] + p.vz * n[2]


def put_back(shape: Any, p: Any, g: Any, n: Any) -> Any:
    """The nearest place where the particle touches: x − g n, unless the shape knows better."""
    if has_law(surface, shape):
        return surface(shape, p)
    return p.x - g * n[0], p.y - g * n[1], p.z - g * n[2]


def rebound(response: Any, n: Any, approach: Any, p: Any) -> Any:
    """The velocity after an impact."""
    velocity = (p.vx, p.vy, p.vz)
    if n[0] is None or n[1] is None or n[2] is None:
        return tuple(
            response.keep * v if axis is None else v - response.bounce * v
            for v, axis in zip(velocity, n, strict=True)
        )
    # −(1 + e) v_n n − k (v − v_n n) = j n − k v
    j = (response.loss - response.bounce) * approach
    return tuple(v + j * axis - response.loss * v for v, axis in zip(velocity, n, strict=True))
