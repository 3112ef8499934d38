"""Impacts of bodies to which emitters react: on colliders, on each other, and of particles on them. Of every body and
particle the first in a step, where it is hit the hardest.

What closes faster than forces bring about in two steps is an impact (`solver.aim`), of two also than they do on each; what
lies has none. Impacts count as in the middle of a step, where impulses act, those of swift bodies and of particles that come
from afar at their time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import FEATURES, GUEST, WORLD, place, row
from particlesim.engine.rigid.contact_rows import speed_along
from particlesim.engine.rigid.narrow import entry, minus
from particlesim.engine.rigid.rotation import cross
from particlesim.engine.rigid.timing import RESTING
from particlesim.engine.rigid.visit import Visitors
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import HEARD, HIT
from particlesim.model.arrays import Floats, Ints


class Hearing(NamedTuple):
    """Numbers of colliders whose impacts emitters hear, by collider and group of bodies, −1 for others [colliders, groups],
    and by collider of the scenario and kind of particles (`grains` [colliders, kinds]); the rows of `state.table.HIT` of all
    bodies, and of the particles among them [13, n]; their radii in the state, groups
    and ids [n]; what is heard of two groups as `reach.codes_of_groups` has it [groups, groups]."""

    numbers: Any
    grains: Any
    rows: Any
    radius: Any
    owner: Any
    id: Any
    code: Any


def with_particles(hearing: Hearing, code: Ints, grains: Ints, visitors: Visitors) -> Hearing:
    """What is heard of bodies and of particles among them, whose groups follow those of bodies; `code` is that of all, and
    `grains` that of particles on colliders."""
    bodies = hearing.numbers.shape[1]
    n = hearing.radius.size + visitors.radius.size
    return Hearing(
        hearing.numbers,
        grains,
        np.zeros((len(HIT), n)),
        np.concatenate([hearing.radius, visitors.radius]),
        np.concatenate([hearing.owner, bodies + visitors.kind]),
        np.concatenate([hearing.id, visitors.id]),
        code,
    )


def share_out(every: Hearing | None, bodies: Hearing | None) -> Floats | None:
    """Give what has been heard in a step of bodies and particles to the bodies; returns that of the particles."""
    if every is None or bodies is None:
        return None
    n = bodies.radius.size
    bodies.rows[:] = every.rows[:, :n]
    return np.asarray(every.rows[:, n:])


def silence(hearing: Any) -> None:
    """There has been no impact in this step."""
    for i in range(hearing.rows.shape[1]):
        hearing.rows[2, i] = 0.0


@outlined
def note_impacts(hearing: Any, b: Any, k: Any, motion: Any, t: Any, h: Any) -> None:
    """Note the impacts among all contacts, whose impulses have been given at a time in the middle of a step of h; velocities
    before them are in `motion.start`."""
    for c in range(k.number[0]):
        if k.struck[c] > 0 and (k.second[c] == WORLD or k.struck[c] > kicked(b, k, motion, c, h)):
            when = t - 0.5 * h + k.late[0, c] if k.late[0, c] > 0 else t
            note(hearing, b, k, motion.start, c, k.struck[c], when)


def kicked(b: Any, k: Any, motion: Any, c: Any, h: Any) -> Any:
    """How fast forces make the one of both sides of a contact along the normal which they make the faster, times `RESTING`:
    two that lie on each other feel the same, and come together by rounding."""
    i, j, n, one, two = (
        k.first[c],
        k.second[c],
        row(k.normal, c),
        motion.pull[k.first[c]],
        motion.pull[k.second[c]],
    )
    mine = b.w[i] * (one[0] * n[0] + one[1] * n[1] + one[2] * n[2])
    other = b.w[j] * (two[0] * n[0] + two[1] * n[1] + two[2] * n[2])
    return RESTING * h * max(abs(mine), abs(other))


@outlined
def note_swift(hearing: Any, b: Any, k: Any, motion: Any, close: Any, t: Any) -> None:
    """Note the impact of a swift body at a time, before it has its impulses: its contacts are those as close."""
    for c in range(k.number[0]):
        if k.gap[c] <= close:
            note(hearing, b, k, motion.now, c, -speed_along(k, motion, c, 0), t)


def note(hearing: Any, b: Any, k: Any, velocity: Any, c: Any, speed: Any, t: Any) -> None:
    """Write an impact of both sides of contact c down."""
    i, j = k.first[c], k.second[c]
    if j == WORLD:
        if k.names[0, c] == GUEST:
            number = hearing.grains[GUEST - 1 - k.names[1, c], hearing.owner[i] - hearing.numbers.shape[1]]
        else:
            number = hearing.numbers[k.feature[c] // FEATURES - 1, b.group[i]]
        if number >= 0:
            write(hearing, b, k, velocity, c, i, 1.0, number, -1, speed, t)
    else:
        one, other = hearing.owner[i], hearing.owner[j]
        if hearing.code[one, other] < -1:
            write(hearing, b, k, velocity, c, i, 1.0, hearing.code[one, other], hearing.id[j], speed, t)
        if hearing.code[other, one] < -1:
            write(hearing, b, k, velocity, c, j, -1.0, hearing.code[other, one], hearing.id[i], speed, t)


@outlined
def write(
    hearing: Any,
    b: Any,
    k: Any,
    velocity: Any,
    c: Any,
    i: Any,
    side: Any,
    number: Any,
    other: Any,
    speed: Any,
    t: Any,
) -> None:
    """Write an impact of body or particle i down, unless one was before it, or is harder at the same time; `side`: 1 if the
    normal of contact c points to it, −1 if it points away."""
    rows = hearing.rows
    if speed > 0 and (not rows[2, i] > 0 or t < rows[0, i] or (rows[0, i] == t and speed > rows[2, i])):
        u = velocity[i]
        arm = minus((k.point[0, c], k.point[1, c], k.point[2, c]), place(b, i))
        turned = cross((u[3], u[4], u[5]), arm)
        rows[0, i], rows[1, i], rows[2, i], rows[12, i] = t, number, speed, other
        for axis in range(3):
            n = side * k.normal[axis, c]
            rows[3 + axis, i] = k.point[axis, c] + hearing.radius[i] * n
            rows[6 + axis, i] = n
            rows[9 + axis, i] = u[axis] + entry(turned, axis)


def tell_particles(rows: Floats, chosen: Sequence[tuple[GroupState, Ints]]) -> None:
    """Write the impacts of particles on bodies [13, n], of groups and their rows, down where these have had none before."""
    first = 0
    for state, mine in chosen:
        part = rows[:, first : first + len(mine)]
        first += len(mine)
        if HEARD in state.parts:
            new = part[HIT.index("speed")] > 0
            state.hit[:, mine[new]] = part[:, new]
