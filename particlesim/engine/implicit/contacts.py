"""What colliders hold back in an implicit step: its equations are solved again around that.

Put back after the step alone, particles would stretch what joins them to others by as much as these all move in a step, and
methods that are stable in long steps would not be where something lies, or lands. So each particle that meets a single
collider ends the step where that has it along its normal, and is free across it, with friction by the forces that the
solution finds (`sliding`). Those in corners end it as colliders have them. What is hit only now, as others are held, is held
in turn.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.coupled.contact import collide, forget
from particlesim.engine.coupled.kernel import inertialess
from particlesim.engine.implicit.krylov import SOLVED, summed
from particlesim.engine.implicit.linear_system import (
    BEFORE,
    CAUGHT,
    FREE,
    HELD,
    RESTS,
    multiply,
    told_all,
)
from particlesim.engine.implicit.sliding import end_along, free_along, recollect_pull, rub
from particlesim.engine.implicit.solution import finish, solve_step
from particlesim.engine.implicit.staged import begin_anew, first_step
from particlesim.engine.interactions.hard.walls import colliders_of
from particlesim.engine.state.columns import in_step, type_of
from particlesim.engine.state.prescribed import drive
from particlesim.engine.step.contacts import Simple

STEADY = 2.0**-4
"""By what part of the motion in what is coupled colliders may push it otherwise than in the step before."""
SOFT, LONG = 0.03, 0.5
"""By what part springs shorten the way of a particle under a force in a step, all axes together, from which on they are
stiff, by methods that keep energy, and from which on a step is so long for them that looking back beyond a push gives
energy. A single spring does it by (ω h)²/4 and 4/9 (ω h)² over 1 and that."""
ROUNDS = 3
"""How often it is looked for what is hit as others are held, at most."""
TURNS = 10
"""How often friction is found again, at most, as long as that lets go some that rested: what it held weighs on others."""


def may_be_held(parts: Any, bonds: Any, c: Any, work: Any, share: Any) -> bool:
    """Whether colliders may hold back particles that are coupled to others, and nothing else changes what they do then."""
    coupled = len(bonds) > 0 or any(type(each).numbers > 0 for each in share.elements)
    plain = share.rods is None and c.spin is None and not inertialess(parts)
    hard = all(part.cores is None and len(part.contacts.soft) == 0 for part in parts)
    return coupled and plain and hard and any(has_colliders(part) for part in parts)


def has_colliders(part: Any) -> bool:
    """Whether a group may meet colliders."""
    return not isinstance(part.contacts, Simple) or len(part.contacts.colliders) > 0


def around(parts: Any, work: Any, share: Any) -> bool:
    """Whether equations are to be solved around what colliders hold back: that loses some energy, which nobody misses where
    colliders take some, or where springs are stiff, of which else more would be gained. Others keep theirs (`rebounds`)."""
    if work.rebounds is None:
        return True
    lossy = all(loses(part) for part in parts)
    return lossy or told_all(stiff(work.system, share, SOFT), work.system, share)


def stiff(s: Any, share: Any, part: float) -> bool:
    """Whether springs shorten the way of some particle under a force in the step by more than a part."""
    some = False
    for i in range(share.first, share.last):
        trace = s.block[0, i] + s.block[1, i] + s.block[2, i]
        some = some | ((s.free[i] > 0) & (type_of(trace, 3) - s.inertia[i] * trace > type_of(trace, part)))
    return bool(some)


def loses(part: Any) -> bool:
    """Whether what hits the colliders of a group loses energy there."""
    lossy = True
    for collider in colliders_of(part):
        lossy = lossy & (collider.response.bounce < 2)
    return bool(lossy)


@outlined
def solve_around(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """Solve the equations of a step again, around those particles that colliders have held back in it."""
    more = good(share) and around(parts, work, share) and some_held(parts, c, work, share, t, end, h)
    rounds = 0
    looks_back = len(c.memory) > 0 and more and told_all(stiff(work.system, share, LONG), work.system, share)
    struck = looks_back and is_struck(c, work, share, False)
    if struck:  # what it looks back to led to nothing like this
        method = first_step(method)
        begin_anew(work, share, h)
    while more:
        begin_around(method, c, work, share, h)
        for part in parts:
            free_along(method, part, c, work, share, t, end, h)
        rounds += 1
        solved = solve_with_friction(method, parts, bonds, in_step(c, t, end), work, share, t, end, h)
        if solved:
            finish(method, in_step(c, t, end), work, share, type_of(h, method.gamma) * h, t, end, h)
            end_along(method, c, work, share, h)
        else:
            end_before(c, work.system, share)
        meet(share.gate, share.threads)
        more = solved and rounds < ROUNDS and some_held(parts, c, work, share, t, end, h)
    if looks_back and (struck or is_struck(c, work, share, True)):
        for i in range(share.first, share.last):
            forget(c.memory, i)


def is_struck(c: Any, work: Any, share: Any, whole: bool) -> bool:
    """Whether colliders give what is coupled another push than in the step before, by a part of the motion in it, less that
    of all: those particles that they have just caught, or the `whole` of it. A method that looks back would go on as if
    they did not."""
    s, before = work.system, work.before
    for lo in range(share.first, share.last, share.chunk):
        px, py, pz, mass = 0.0, 0.0, 0.0, 0.0
        for i in range(lo, min(lo + share.chunk, share.last)):
            if (s.free[i] > 0) | (s.held[i] != FREE):
                m = float(s.inertia[i])
                u, v, w = float(before[3, i]), float(before[4, i]), float(before[5, i])
                px, py, pz, mass = px + m * u, py + m * v, pz + m * w, mass + m
        for k, each in enumerate((px, py, pz, mass)):
            s.partial[k, lo // share.chunk] = each
    meet(share.gate, share.threads)
    mass = summed(s.partial, 3)
    mx, my, mz = summed(s.partial, 0) / mass, summed(s.partial, 1) / mass, summed(s.partial, 2) / mass
    meet(share.gate, share.threads)
    for lo in range(share.first, share.last, share.chunk):
        px, py, pz, motion, push = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(lo, min(lo + share.chunk, share.last)):
            if (s.free[i] > 0) | (s.held[i] != FREE):
                m = float(s.inertia[i])
                x = float(c.vx[i] - before[3, i] - s.wall[BEFORE, i])
                y = float(c.vy[i] - before[4, i] - s.wall[BEFORE + 1, i])
                z = float(c.vz[i] - before[5, i] - s.wall[BEFORE + 2, i])
                u, v, w = float(before[3, i]) - mx, float(before[4, i]) - my, float(before[5, i]) - mz
                motion += m * (u * u + v * v + w * w)
                px, py, pz = px + m * x, py + m * y, pz + m * z
                push += m * (x * x + y * y + z * z) if s.held[i] == CAUGHT else 0.0
        for k, each in enumerate((px, py, pz, motion, push)):
            s.partial[k, lo // share.chunk] = each
    meet(share.gate, share.threads)
    px, py, pz = summed(s.partial, 0), summed(s.partial, 1), summed(s.partial, 2)
    motion, push = summed(s.partial, 3), summed(s.partial, 4)
    meet(share.gate, share.threads)
    if whole:
        return bool(px * px + py * py + pz * pz > STEADY * STEADY * mass * motion)
    return bool(push > STEADY * STEADY * motion)


def solve_with_friction(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> bool:
    """Solve the equations, and again with the friction that belongs to what presses then, until that is found; a single
    linear solve finds it once."""
    s, turn, turns = work.system, 0, 1 if method.linear else TURNS
    to_beginning(method, c, work, share, h)
    meet(share.gate, share.threads)
    solved = solve_step(method, parts, bonds, c, work, share, t, end, h, True)
    while solved and turn < turns:
        if method.linear:
            multiply(bonds, s.springs, s, s.solution, s.product, False, share)
            back_to_end(c, s, share)
        if not told_all(rub(method, c, work, share, h, turn), s, share):
            break
        to_beginning(method, c, work, share, h)
        meet(share.gate, share.threads)
        solved = solve_step(method, parts, bonds, c, work, share, t, end, h, True)
        turn += 1
    return bool(solved)


def good(share: Any) -> bool:
    """Whether the step has been one so far, in all shares."""
    meet(share.gate, share.threads)
    found = share.wild.sum() == 0
    meet(share.gate, share.threads)
    return bool(found)


def some_held(parts: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> bool:
    """Let particles that are free meet colliders; returns whether these have held some back. Those that are still free will
    meet them again at the end of the step, and what they have passed unseen is counted then."""
    s, some = work.system, False
    drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, end)
    for axis, speed in enumerate((c.vx, c.vy, c.vz)):
        for i in range(share.first, share.last):
            s.near[axis, i] = speed[i]
    if c.missed is not None:
        for i in range(share.first, share.last):
            s.missed[i] = c.missed[i]
    collide(parts, c, work.before, share, t, end, h, None, work.again, s.held)
    for i in range(share.first, share.last):
        if s.held[i] == CAUGHT:
            some = True
            recollect_pull(c, (s.near[0, i], s.near[1, i], s.near[2, i]), work.before, i, h)
        elif c.missed is not None and s.held[i] == FREE:
            c.missed[i] = s.missed[i]
    return told_all(some, s, share)


def begin_around(method: Any, c: Any, work: Any, share: Any, h: Any) -> None:
    """The state from which the equations are solved again: what is held is where the step takes it, others go on as they
    were, all at the time of the equations. Near rest that is next to the solution."""
    s, half, reach = work.system, type_of(h, 0.5), type_of(h, method.gamma) * h
    for axis, (place, speed) in enumerate(zip((c.x, c.y, c.z), (c.vx, c.vy, c.vz), strict=True)):
        for i in range(share.first, share.last):
            s.ended[axis, i], s.ended[3 + axis, i] = place[i], speed[i]
            was, v = work.before[axis, i], work.before[3 + axis, i]
            if s.held[i] == FREE:
                if s.free[i] > 0:
                    place[i], speed[i] = s.base[axis, i] + reach * v, v
            elif method.middle:
                place[i], speed[i] = half * (place[i] + was), half * (speed[i] + v)
    for i in range(share.first, share.last):
        s.free[i] = h - h if s.held[i] == CAUGHT else s.free[i]


def to_beginning(method: Any, c: Any, work: Any, share: Any, h: Any) -> None:
    """Of a method with a single linear solve, put particles back to the beginning of the step, and expect them to move to
    where they have been: its forces are those at the beginning."""
    if method.linear:
        s, reach = work.system, type_of(h, method.gamma) * h
        for axis, place in enumerate((c.x, c.y, c.z)):
            for i in range(share.first, share.last):
                if (s.held[i] != FREE) | (s.free[i] > 0):
                    s.lead[axis, i] = (place[i] - work.before[axis, i]) / reach
                    place[i] = work.before[axis, i]


def back_to_end(c: Any, s: Any, share: Any) -> None:
    """Of a method with a single linear solve, put what is held to where it ends the step."""
    for axis, place in enumerate((c.x, c.y, c.z)):
        for i in range(share.first, share.last):
            if (s.held[i] == HELD) | (s.held[i] == RESTS):
                place[i] = s.ended[axis, i]


def end_before(c: Any, s: Any, share: Any) -> None:
    """Where nothing has been found, all end the step as before."""
    for axis, (place, speed) in enumerate(zip((c.x, c.y, c.z), (c.vx, c.vy, c.vz), strict=True)):
        for i in range(share.first, share.last):
            place[i], speed[i] = s.ended[axis, i], s.ended[3 + axis, i]
    if share.number == 0:
        s.report[0] = SOLVED  # as it is by the solution before
