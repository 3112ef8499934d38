"""Rolling friction: a contact of normal force N also has a moment of up to μ_r R N about the axes along the surface.

Its rows have no direction and the arms R a for the two tangents a, so that their speeds are those of rolling, R (ω₁ − ω₂)·a,
and their impulses are bounded as those of sliding friction are, |P_r| ≤ μ_r P_n.

R is the height of the centre above the contact point: the radius of a ball. Between two round bodies it is R₁ R₂/(R₁ + R₂),
as between grains, between a round and a flat one that of the round one; μ_r is the larger of both.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import WORLD, add_contact, name_contact, place, row, set_surface
from particlesim.engine.rigid.narrow import minus
from particlesim.engine.rigid.rotation import dot
from particlesim.engine.rigid.stops import ROLL

ROLLING = 1 << 56
"""Added to the feature of the contact that presses."""


class Rolling(NamedTuple):
    """By group of bodies: coefficient of rolling friction, and 1 where all sides are flat [groups]."""

    friction: Any
    flat: Any


@outlined
def find_rolling(rolling: Any, b: Any, k: Any, first: Any, spin: Any) -> None:
    """Note rolling friction at all contacts from `first` on; `spin` is the angular velocity of a collider."""
    for c in range(first, k.number[0]):
        i, j = k.first[c], k.second[c]
        friction = rolling.friction[b.group[i]]
        if j != WORLD:
            friction = max(friction, rolling.friction[b.group[j]])
        if friction > 0:
            number = add_contact(k, i, j, ROLLING + k.feature[c], row(k.point, c), row(k.normal, c), 0.0)
            set_surface(k, number, 0.0, friction, friction)
            if number >= 0:
                k.turns[number], k.aim[0, number], k.aim[1, number] = ROLL, c, radius(rolling, b, k, c)
                for axis in range(3):
                    k.belt[axis, number] = spin[axis]


def radius(rolling: Any, b: Any, k: Any, c: Any) -> Any:
    """The radius R of rolling at a contact, once its gap is closed [m]."""
    i, j, n, at, gap = k.first[c], k.second[c], row(k.normal, c), row(k.point, c), k.gap[c]
    size = abs(dot(minus(at, place(b, i)), n)) - (gap if j == WORLD else 0.5 * gap)
    if j != WORLD:
        other, flat = abs(dot(minus(at, place(b, j)), n)) - 0.5 * gap, rolling.flat[b.group[i]]
        if flat == rolling.flat[b.group[j]]:
            size = size * other / (size + other) if size + other > 0 else 0.0
        elif flat > 0:
            size = other
    return size


def roll_on(b: Any, k: Any, c: Any, friction: Any, size: Any, spin: Any) -> None:
    """Note the rolling friction of guests at contact c (`rolling`)."""
    i, j = k.first[c], k.second[c]
    turns = b.inertia[0, i] < np.inf or (j != WORLD and b.inertia[0, j] < np.inf)
    if turns:
        number = add_contact(k, i, j, ROLLING + k.feature[c], row(k.point, c), row(k.normal, c), 0.0)
        set_surface(k, number, 0.0, friction, friction)
        if number >= 0:
            name_contact(k, number, k.names[0, c], k.names[1, c])
            k.turns[number], k.aim[0, number], k.aim[1, number] = ROLL, c, size
            for axis in range(3):
                k.belt[axis, number] = spin[axis]
