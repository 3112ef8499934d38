"""Energy that particles get where contacts move them apart, which takes no force and leaves velocities as they are.

What overlaps, as at the start of a run, is moved apart a little in every step. So a particle that lies on another one is
lifted, and has the more potential energy: nothing is wrong with that, and the guard has to know of it (`engine.guard`). What
counts are the potentials of forces where particles are, less those of where their velocities have taken them, the mean of
the beginning and the end of the step: so what rests, which falls in every step and is put back, gets nothing. The potentials
of other interactions, such as springs, are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.state.columns import fetch, type_of
from particlesim.laws.registry import has_law, moved_to, potential


def stored(parts: Any, c: Any, marks: Any, t: Any) -> Any:
    """Potential energy of particles that are marked, in the fields of forces [J]."""
    total = 0.0
    for part in parts:
        total += _stored_in(part.forces, c, marks, part.first, part.last, t)
    return total


@outlined
def _stored_in(forces: Any, c: Any, marks: Any, first: Any, last: Any, t: Any) -> Any:
    total = 0.0
    for i in range(first, last):
        if (marks[i] & 1) != 0:
            total += energy_at(forces, fetch(c, i, t))
    return total


def energy_at(forces: Any, p: Any) -> Any:
    """Potential energy of a particle in the fields of forces [J]."""
    total = 0.0
    for each in forces:
        if has_law(potential, each):
            total += float(potential(each, p))
    return total


def lifted(parts: Any, c: Any, before: Any, marks: Any, t: Any, h: Any) -> Any:
    """The energy of particles that are marked which comes from where their velocities have not taken them in a step of h
    [s]; 0 where that has cost some [J]."""
    total = 0.0
    for part in parts:
        total += _lifted_in(part.forces, c, before, marks, part.first, part.last, t, h)
    return total if total > 0 else 0.0  # also where a potential has no value


@outlined
def _lifted_in(forces: Any, c: Any, before: Any, marks: Any, first: Any, last: Any, t: Any, h: Any) -> Any:
    total = 0.0
    for i in range(first, last):
        if (marks[i] & 1) != 0:
            p = fetch(c, i, t)
            half = type_of(p.x, 0.5 * h)
            x = before[0, i] + half * (before[3, i] + p.vx)
            y = before[1, i] + half * (before[4, i] + p.vy)
            z = before[2, i] + half * (before[5, i] + p.vz)
            total += energy_at(forces, p) - energy_at(forces, moved_to(p, x, y, z, p.vx, p.vy, p.vz, p.t))
    return total


def book(fed: Any, joule: Any) -> None:
    """Add an energy to what has been fed, where it has a value [J]."""
    if np.isfinite(joule):
        fed[0] += joule
