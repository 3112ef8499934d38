"""Pits: places in shapes with dents where a particle lies on three parts of one shape, and stays.

Only the nearest part of a shape is known at a time, so what is pressed into a pit hops from part to part, by less and less.
With the normals n₁, n₂, n₃ of the last three parts that it has hit, it cannot move on where what presses it is

    Δv = −(λ₁ n₁ + λ₂ n₂ + λ₃ n₃),   λ > 0,

and all three meet there with their dents: beside the place each of them goes on where the two others do not reach, as no
edge does that stands out, and no round side. There hops that are as short as what forces bring about in a step are rest, as
everywhere.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.dents import dented
from particlesim.colliders.moving import MovingRecord
from particlesim.compiler import outlined
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.contacts import nearest
from particlesim.engine.step.resting import cross, dot
from particlesim.laws.registry import gap_and_normal, moved_to

REST = 2
"""Steps in which forces bring about a speed that counts as rest."""
ONE_PART = 1 - 1e-9
"""The cosine of the angle between two normals from which on they are of one part."""
FLAT = 1e-9
"""The volume that three normals span at least, which else do not hold."""
PRESSED = 2.0**-20
"""The least λ of a part that presses, in units of Δv."""
BESIDE = 64
"""How far beside a pit its parts are looked for, in rounding errors."""


def may_hold(colliders: Any) -> bool:
    """Whether a particle may lie in a pit of one of some colliders, and rest there: they have dents, and do not move."""
    still = not any(isinstance(c.shape, MovingRecord) or c.response.belt is not None for c in colliders)
    return still and any(dented(c.shape) for c in colliders)


def no_parts(h: Any) -> Any:
    """The last three parts that a particle has hit, each as the plane n·x = d on which its centre is then: none."""
    none = (h - h, h - h, h - h, h - h)
    return none, none, none


@outlined
def with_part(parts: Any, colliders: Any, p: Any) -> Any:
    """The last three parts, with the one that a particle touches, or is in, if that is another one."""
    least, x, y, z = p.x - p.x, p.x - p.x, p.x - p.x, p.x - p.x
    first = True
    for c in colliders:
        g, n = gap_and_normal(c.shape, p)
        if first or g < least:
            least, first = g, False
            x = type_of(g, 0) if n[0] is None else n[0]
            y = type_of(g, 0) if n[1] is None else n[1]
            z = type_of(g, 0) if n[2] is None else n[2]
    one, two, three = parts
    new = (x, y, z, x * p.x + y * p.y + z * p.z - least)
    if dot(one, new) > ONE_PART or dot(two, new) > ONE_PART or dot(three, new) > ONE_PART:
        return one, two, three
    return new, one, two


@outlined
def bottom(colliders: Any, parts: Any, p: Any, legal: Any, push: Any, h: Any, same: Any, rough: Any) -> Any:
    """Whether a particle that came from a `legal` place in a step of h, in which forces change its velocity by `push`, rests
    on the parts that it has hit, and where: where it touches all three, or at the legal place, if that is the `same` but
    for so much, or the parts are `rough` and hold it there."""
    one, two, three = parts
    x, y, z = p.x, p.y, p.z
    most = type_of(h, REST * REST) * dot(push, push)
    u, v, w = cross(two, three), cross(three, one), cross(one, two)
    volume = dot(one, u)
    holds = p.vx * p.vx + p.vy * p.vy + p.vz * p.vz <= most and abs(volume) > type_of(h, FLAT)
    if holds:
        a, b, c = dot(push, u), dot(push, v), dot(push, w)
        least = type_of(h, -PRESSED) * volume * volume * np.sqrt(dot(push, push))
        holds = a * volume < least and b * volume < least and c * volume < least
        x = (one[3] * u[0] + two[3] * v[0] + three[3] * w[0]) / volume
        y = (one[3] * u[1] + two[3] * v[1] + three[3] * w[1]) / volume
        z = (one[3] * u[2] + two[3] * v[2] + three[3] * w[2]) / volume
        holds = holds and _enclosed(
            colliders, moved_to(p, x, y, z, p.vx, p.vy, p.vz, p.t), u, v, w, volume, same
        )
        if rough:
            x, y, z = p.x, p.y, p.z
        way = (x - legal.x, y - legal.y, z - legal.z)
        far = dot(way, way)
        # and no farther up than its speed takes it
        up = -dot(push, (x - p.x, y - p.y, z - p.z)) / h - same * np.sqrt(dot(push, push)) / h
        holds = holds and far <= h * h * most
        holds = holds and 2 * up <= p.vx * p.vx + p.vy * p.vy + p.vz * p.vz
        if rough or far <= same * same:
            x, y, z = legal.x, legal.y, legal.z
    return holds, x, y, z


@outlined
def _enclosed(colliders: Any, p: Any, u: Any, v: Any, w: Any, volume: Any, same: Any) -> Any:
    """Whether a particle where three parts meet still touches each of them when it is moved a little off both others. Along
    u it leaves the first one, along v the second and along w the third."""
    touches = True
    for a, b in ((u, v), (v, w), (w, u)):
        side = type_of(same, BESIDE) * same if volume > 0 else type_of(same, -BESIDE) * same
        i, j = side / np.sqrt(dot(a, a)), side / np.sqrt(dot(b, b))
        x, y, z = (at + i * k + j * m for at, k, m in zip((p.x, p.y, p.z), a, b, strict=True))
        touches = touches and nearest(colliders, moved_to(p, x, y, z, p.vx, p.vy, p.vz, p.t)) <= same + same
    return touches
