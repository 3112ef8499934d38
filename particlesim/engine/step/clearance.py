"""How far particles surely are from colliders whose gaps take a search, so that the next steps need not look.

A gap changes no faster than the place. So a particle that is farther from all colliders than it moves in a step meets none
of them, and after the step is farther away than the difference. That holds for whole runs of steps, from one look; it says
only which steps are free, and a free step is the same however that is known.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.combination import UnionRecord
from particlesim.colliders.level_set import LevelRecord, at_least
from particlesim.colliders.mesh import MeshRecord, mesh_clearance
from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.pose import ShiftedRecord, TurnedRecord, seen_from
from particlesim.colliders.response import crossable
from particlesim.colliders.way import longest, way_of
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.contacts import Careful, Simple
from particlesim.engine.step.program import Program
from particlesim.laws.registry import gap

SURE = 1e-5
"""Part of a distance that its rounding errors, also in single precision, stay below."""


def keeps_clear(contacts: Any, memory: Any) -> bool:
    """Whether it is worth it to remember how far particles are from colliders: gaps take a search, and nothing but steps
    moves particles or changes what their method remembers."""
    if isinstance(contacts, Simple) or contacts.one_by_one is None:
        return False
    return len(contacts.soft) == 0 and len(memory) == 0


AWAY = 4
"""How far a particle that meets planes alone goes in a step at most, in units of its free way: it is never faster than at
the beginning of the step and all that forces may add, |v₀| h + |a| h² ≤ 3 ways, and is put back by one at most."""


def sets_aside(contacts: Any, memory: Any) -> bool:
    """Whether what is far from all colliders that a way may cross is stepped as if they were not there: the others do not
    make it faster."""
    if not keeps_clear(contacts, memory):
        return False
    others = tuple(c for c in contacts.continuous if not crossable(c)) + contacts.discrete
    return len(others) > 0 and all(
        isinstance(c, BoundsRecord)
        or not (crossable(c) or isinstance(c.shape, MovingRecord) or c.response.belt is not None)
        for c in others
    )


def without_crossable(program: Any) -> Program:
    """What is left for a particle that is set aside: its step has the same bits."""
    contacts = program.contacts
    left = Careful(
        tuple(c for c in contacts.continuous if not crossable(c)),
        tuple(c for c in contacts.resting if not crossable(c)),
        contacts.discrete,
        contacts.tolerance,
        contacts.reach,
        None,
        contacts.soft,
        contacts.continuous,
    )
    return Program(program.method, program.dynamics, program.forces, left)


def distance_of(p: Any, q: Any, h: Any) -> Any:
    """How far a particle may go in a step from p to q, at least [m]."""
    return type_of(h, 1 + SURE) * longest(way_of(p, q, h))


def clearance(contacts: Any, p: Any, need: Any) -> Any:
    """A lower bound of the gaps of all colliders that a way may cross [m]; a good one if a quick one is below `need`."""
    least = type_of(p.x, np.inf)
    for c in contacts.continuous:
        if crossable(c):
            least = min(least, _clearance(c.shape, p, need))
    return least * type_of(p.x, 1 - SURE)


def _clearance(shape: Any, p: Any, need: Any) -> Any:
    if isinstance(shape, MovingRecord):
        return type_of(p.x, -1)
    if isinstance(shape, (ShiftedRecord, TurnedRecord)):
        return _clearance(shape.shape, seen_from(shape, p), need)
    if isinstance(shape, UnionRecord):
        return min([_clearance(part, p, need) for part in shape.parts])
    if isinstance(shape, MeshRecord):
        return mesh_clearance(shape, p, need)
    if isinstance(shape, LevelRecord):
        return at_least(shape, p) - p.r
    return gap(shape, p)
