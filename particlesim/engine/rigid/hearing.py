"""Impacts of bodies on colliders to which emitters react: of every body the first in a step, where it is hit the hardest.

What closes faster than forces bring about in two steps is an impact (`solver.aim`); what lies has none. Impacts count as in
the middle of a step, where impulses act, those of swift bodies at their time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import FEATURES, WORLD, place
from particlesim.engine.rigid.contact_rows import speed_along
from particlesim.engine.rigid.narrow import entry, minus
from particlesim.engine.rigid.rotation import cross


class Hearing(NamedTuple):
    """Numbers of colliders whose impacts emitters hear, by collider and group of bodies, −1 for others [colliders, groups];
    the rows of `state.table.HIT` of all bodies [12, n]; their radii in the state [n]."""

    numbers: Any
    rows: Any
    radius: Any


def silence(hearing: Any) -> None:
    """There has been no impact in this step."""
    for i in range(hearing.rows.shape[1]):
        hearing.rows[2, i] = 0.0


@outlined
def note_impacts(hearing: Any, b: Any, k: Any, motion: Any, t: Any) -> None:
    """Note the impacts among all contacts, whose impulses have been given at a time; velocities before them are in
    `motion.start`."""
    for c in range(k.number[0]):
        if k.struck[c] > 0:
            note(hearing, b, k, motion.start, c, k.struck[c], t)


@outlined
def note_swift(hearing: Any, b: Any, k: Any, motion: Any, close: Any, t: Any) -> None:
    """Note the impact of a swift body at a time, before it has its impulses: its contacts are those as close."""
    for c in range(k.number[0]):
        if k.gap[c] <= close:
            note(hearing, b, k, motion.now, c, -speed_along(k, motion, c, 0), t)


def note(hearing: Any, b: Any, k: Any, velocity: Any, c: Any, speed: Any, t: Any) -> None:
    """Write an impact of body `first` of contact c down, unless one was before it, or is harder at the same time."""
    i, rows = k.first[c], hearing.rows
    if k.second[c] == WORLD and i < rows.shape[1]:
        number = hearing.numbers[k.feature[c] // FEATURES - 1, b.group[i]]
        first = not rows[2, i] > 0 or (rows[0, i] == t and speed > rows[2, i])
        if number >= 0 and speed > 0 and first:
            u = velocity[i]
            arm = minus((k.point[0, c], k.point[1, c], k.point[2, c]), place(b, i))
            turned = cross((u[3], u[4], u[5]), arm)
            rows[0, i], rows[1, i], rows[2, i] = t, number, speed
            for axis in range(3):
                n = k.normal[axis, c]
                rows[3 + axis, i] = k.point[axis, c] + hearing.radius[i] * n
                rows[6 + axis, i] = n
                rows[9 + axis, i] = u[axis] + entry(turned, axis)
