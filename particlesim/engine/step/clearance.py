"""Lower bounds on the distances of particles from colliders whose gaps take a search, so that most steps need none.

A gap changes by no more than the displacement. So a particle whose distance from all colliders is larger than its
displacement in a step meets none of them, and after the step the difference is a bound again. One search thus covers many
steps. It decides only which steps are free of contact, and a free step has the same bits whichever way that was found out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.response import crossable
from particlesim.colliders.way import longest, way_of
from particlesim.compiler import exact, outlined
from particlesim.engine.state.columns import load, type_of
from particlesim.engine.step.contacts import Careful, Simple, rounding
from particlesim.engine.step.program import Program
from particlesim.engine.step.resting import bends
from particlesim.laws.registry import PASS, gap, gap_and_normal, least_gap

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
    return len(others) > 0 and not any(
        crossable(c) or isinstance(c.shape, MovingRecord) or c.response.belt is not None for c in others
    )


def without_crossable(program: Any) -> Program:
    """The program without colliders that paths may cross, for a particle far from them: its step has the same bits."""
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
            least = min(least, least_gap(c.shape, p, need))
    return least * type_of(p.x, 1 - SURE)


# What stands on a collider, held by friction


def holds(contacts: Any) -> bool:
    """Whether particles may stand on some collider, held by friction, until forces change: all colliders are at rest."""
    colliders = contacts.continuous + contacts.discrete
    rough = any(c.response.friction is not None and c.response.belt is None for c in contacts.continuous)
    return rough and not any(isinstance(c.shape, MovingRecord) for c in colliders)


@outlined
def foothold(contacts: Any, p: Any) -> tuple[Any, Any, Any, Any, Any]:
    """The normal of the only collider that a particle touches; its coefficient of static friction, −1 where there is no such
    collider; and how deep the end of a free step must be below the place, so that it is surely inside [m].

    What stands stays where it is, so that this holds from step to step, until forces change or the interval ends."""
    slack = rounding(contacts, p)
    zero, none = slack - slack, -type_of(p.x, 1)
    nx, ny, nz, static, number = zero, zero, zero, none, 0
    for c in contacts.continuous:
        g, n = gap_and_normal(c, p)
        if g <= slack:
            number += 1
        rough = c.response.friction is not None and c.response.belt is None
        if rough and abs(g) <= slack and c.response.outcome == PASS:
            nx, ny, nz = tuple(zero if axis is None else axis for axis in n)
            static = type_of(p.x, c.response.friction.static)
    for c in contacts.discrete:
        if gap(c, p) <= slack:
            number += 1
    return nx, ny, nz, static if number == 1 else none, 4 * slack


@exact
def stands(foothold: Any, i: Any, p: Any, q: Any) -> Any:
    """Whether friction holds particle i, which is at rest at p, against the forces that would take it to q:
    |Δv_t| ≤ μ_s J, with J the normal impulse over mass. The answer is the same in every place where it is asked for."""
    nx, ny, nz = foothold[0, i], foothold[1, i], foothold[2, i]
    static, least = foothold[3, i], foothold[4, i]
    sink = nx * (p.x - q.x) + ny * (p.y - q.y) + nz * (p.z - q.z)
    push = -(nx * q.vx + ny * q.vy + nz * q.vz)
    x, y, z = q.vx + push * nx, q.vy + push * ny, q.vz + push * nz
    most = static * push
    return (static >= 0) & (sink > least) & (push > 0) & (x * x + y * y + z * z <= most * most)


# What a step has led nowhere


def repeats(contacts: Any, memory: Any) -> bool:
    """Whether a step that ends where and as fast as it began does so again under the same forces, and it is worth it to
    remember that: some collider is no plane, all are at rest, no emitter reacts to impacts, and nothing but steps moves
    particles or changes what their method remembers."""
    slow = any(crossable(c) or bends(c) for c in contacts.continuous)
    return slow and is_steady(contacts, memory)


def is_steady(contacts: Any, memory: Any) -> bool:
    """Whether contact does the same in all steps, nobody hears of it, and nothing but steps moves particles or changes what
    their method remembers."""
    if isinstance(contacts, Simple):
        return False
    colliders = contacts.continuous + contacts.discrete
    still = not any(isinstance(c.shape, MovingRecord) or c.response.heard is not None for c in colliders)
    return still and len(contacts.soft) == 0 and len(memory) == 0


def lasts(contacts: Any, memory: Any) -> bool:
    """Whether that is remembered from one interval to the next, too."""
    return not isinstance(contacts, Simple) and repeats(contacts, memory)


def leads_back(ways: Any, i: Any, q: Any, t: Any) -> Any:
    """Whether the last step of particle i, until t, ended as it began, and its free step was the one to q, to the last bit:
    then so does this one. A particle in a crease would otherwise need a dozen searches in every step, with the same result
    each time."""
    same = (ways[0, i] == q.x) & (ways[1, i] == q.y) & (ways[2, i] == q.z)
    same &= (ways[3, i] == q.vx) & (ways[4, i] == q.vy) & (ways[5, i] == q.vz)
    return same & (ways[6, i] == t)


def note_way(ways: Any, i: Any, p: Any, q: Any, r: Any, end: Any) -> None:
    """Note the end q of the free step of particle i, if its step led back from p to p, as r, and when that was."""
    if (p.x == r.x) & (p.y == r.y) & (p.z == r.z) & (p.vx == r.vx) & (p.vy == r.vy) & (p.vz == r.vz):
        for row, number in enumerate((q.x, q.y, q.z, q.vx, q.vy, q.vz)):
            ways[row, i] = number
        ways[6, i] = end


WAYS, RESTED, KEPT = 7, 14, 6
"""Rows of what `note_way` notes; those of what is kept of a particle from one interval to the next: after these the place
and the velocity that it had then, and its radius. In row KEPT is 1 if there is something, in place of a time; else 0, so
that what nobody has written takes no memory."""


def are_kept(rested: Any) -> Any:
    """Whether something is kept of some particle of a block."""
    some = False
    for i in range(rested.shape[1]):
        some |= rested[KEPT, i] > 0
    return some


def recall_way(ways: Any, i: Any, rested: Any, c: Any, t: Any) -> None:
    """Go on with what the last interval has noted of particle i of a block, if it is at time t as it was then."""
    same = (rested[KEPT, i] > 0) & (rested[WAYS + 6, i] == load(c.r, i, c.x[i]))
    for row, column in enumerate((c.x, c.y, c.z, c.vx, c.vy, c.vz)):
        same &= rested[WAYS + row, i] == column[i]
    for row in range(KEPT):
        ways[row, i] = rested[row, i]
    ways[KEPT, i] = t if same else -np.inf


def keep_way(ways: Any, i: Any, rested: Any, c: Any, t: Any) -> None:
    """Keep what is noted of particle i of a block at the end t of an interval."""
    for row in range(KEPT):
        rested[row, i] = ways[row, i]
    for row, column in enumerate((c.x, c.y, c.z, c.vx, c.vy, c.vz)):
        rested[WAYS + row, i] = column[i]
    rested[WAYS + 6, i] = load(c.r, i, c.x[i])
    rested[KEPT, i] = 1 if ways[KEPT, i] == t else 0
