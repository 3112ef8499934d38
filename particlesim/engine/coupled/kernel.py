"""The stage-wise kernel: particles that pull on each other take every stage of every step together.

One call steps a thread's share of an island through a whole interval; the threads meet before and after forces are added
up. Forces are added up in a fixed order (`forces`), and every loop runs over the chunks of a share, so
that results do not depend on how many threads there are. The coefficients are those of `particlesim.integrators`, as arrays.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import kernel
from particlesim.engine.barrier import meet
from particlesim.engine.constraints.blows import before_contact
from particlesim.engine.constraints.lying import after_contact
from particlesim.engine.constraints.shake_rattle import after_kicks, hold, places, take_aim
from particlesim.engine.coupled.contact import collide
from particlesim.engine.coupled.forces import (
    Move,
    all_finite,
    evaluate,
    kick_and_drift,
    look,
    rates,
    roll,
    twist,
)
from particlesim.engine.coupled.rebounds import settle_rebounds
from particlesim.engine.coupled.workspace import StagedComposition, StagedRungeKutta, StagedVerlet
from particlesim.engine.interactions.bonds import break_bonds
from particlesim.engine.interactions.interaction import conclude_elements, leave_elements, tired_elements
from particlesim.engine.state.columns import block_of, fetch, held, in_step, motion, span, still, type_of
from particlesim.engine.state.prescribed import drive
from particlesim.engine.step.particle_step import Newtonian
from particlesim.engine.step.program import BLOCK
from particlesim.laws.registry import velocity


def combine(
    target: Any, before: Any, slopes: Any, weights: Any, clock: Any, t: Any, end: Any, h: Any
) -> None:
    """target = before + h Σ weights[j] slopes[j] for one column of a block; as many slopes as weights."""
    for i in range(target.size):
        target[i] = 0
    for j in range(weights.size):
        if weights[j] != 0:
            weight, slope = type_of(h, weights[j]), slopes[j]
            for i in range(target.size):
                target[i] += weight * slope[i]
    for i in range(target.size):
        _, hi = span(clock, i, t, end, h)
        idle, moved = still(clock, hi), before[i] + hi * target[i]
        target[i] = moved if idle is None else (before[i] if idle else moved)


def stormer(q: Any, gx: Any, gy: Any, gz: Any, t: Any, end: Any, h: Any) -> None:
    """Störmer's rule for all particles of a block with total forces g; remembers the velocity between the steps."""
    ux, uy, uz, known = q.memory
    half = type_of(h, 0.5)
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        if hi > 0:
            k = hi / q.m[i]
            ax, ay, az = k * gx[i], k * gy[i], k * gz[i]
            again = known[i] == hi
            ux[i] = (ux[i] if again else q.vx[i] - half * ax) + ax
            uy[i] = (uy[i] if again else q.vy[i] - half * ay) + ay
            uz[i] = (uz[i] if again else q.vz[i] - half * az) + az
            q.x[i] += hi * ux[i]
            q.y[i] += hi * uy[i]
            q.z[i] += hi * uz[i]
            q.vx[i] = ux[i] + half * ax
            q.vy[i] = uy[i] + half * ay
            q.vz[i] = uz[i] + half * az
            known[i] = hi


def _composition(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    now, rolled = t, False
    for stage in range(method.kicks.size):
        push, glide = type_of(h, method.kicks[stage]), type_of(h, method.drifts[stage])
        move = Move(push, glide, not rolled, stage == method.kicks.size - 1, t, end, h)
        rolled = rolled | (glide != 0)
        if push != 0:
            if stage > 0:
                meet(share.gate, share.threads)
            evaluate(parts, bonds, c, work, share, now, move)
        else:
            kick_and_drift(move, c, work, share, share.first, share.last)
        now += method.drifts[stage] * (end - t)


def _held_composition(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    # A component of rods has particles of several threads: all must have drifted before it is held, and be held before
    # anybody reads them.
    now, here = t, places(c)
    take_aim(share.rods, here)
    for stage in range(method.kicks.size):
        push, glide = type_of(h, method.kicks[stage]), type_of(h, method.drifts[stage])
        if push != 0:
            evaluate(parts, bonds, c, work, share, now, None)
        elif stage == 0:
            meet(share.gate, share.threads)
        kick_and_drift(Move(push, glide, False, False, t, end, h), c, work, share, share.first, share.last)
        now += method.drifts[stage] * (end - t)
        if glide != 0:
            drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, now)
            meet(share.gate, share.threads)
            if not hold(share.rods, here, method.drifts[stage] * (end - t), share.rods.eager):
                share.wild[8 * share.number] = 1
        meet(share.gate, share.threads)
    after_kicks(share.rods, here)
    meet(share.gate, share.threads)


def displace(c: Any, work: Any, weights: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """All particles of a share go from the beginning of the step by h Σ weights[j] slopes[j]."""
    for lo in range(share.first, share.last, share.chunk):
        hi = min(lo + share.chunk, share.last)
        q = block_of(c, lo, hi)
        for k, target in enumerate(motion(q)):
            before, slopes = work.before[k, lo:hi], work.slopes[:, k, lo:hi]
            combine(target, before, slopes, weights, q.clock, t, end, h)


def find_slopes(parts: Any, bonds: Any, c: Any, work: Any, share: Any, stage: Any, t: Any) -> None:
    """Slopes of all particles of a share where they are; positions and velocities of all shares must be in place."""
    evaluate(parts, bonds, c, work, share, t, None)
    for lo in range(share.first, share.last, share.chunk):
        rates(parts, c, work.force, work.slopes[stage], t, lo, min(lo + share.chunk, share.last))


def _runge_kutta(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    for stage in range(method.b.size):
        if stage > 0:
            displace(c, work, method.a[stage, :stage], share, t, end, h)
            meet(share.gate, share.threads)
        find_slopes(parts, bonds, c, work, share, stage, t + method.c[stage] * (end - t))
    displace(c, work, method.b, share, t, end, h)


def _verlet(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    evaluate(parts, bonds, c, work, share, t, None)
    for lo in range(share.first, share.last, BLOCK):
        hi = min(lo + BLOCK, share.last)
        force = work.force
        q = block_of(c, lo, hi)
        stormer(q, force[0, lo:hi], force[1, lo:hi], force[2, lo:hi], t, end, h)
        if q.spin is not None:  # which is known at the ends of steps alone
            twist(q, force[3, lo:hi], force[4, lo:hi], force[5, lo:hi], type_of(h, 1), t, end, h)
            roll(q, type_of(h, 1), t, end, h)
        look(work.before, c, lo, hi, share)


def evolve(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """One step of a method for a share of particles, without contacts."""
    if isinstance(method, StagedRungeKutta):
        _runge_kutta(method, parts, bonds, c, work, share, t, end, h)
    elif isinstance(method, StagedVerlet):
        _verlet(method, parts, bonds, c, work, share, t, end, h)
    elif share.rods is None:
        _composition(method, parts, bonds, c, work, share, t, end, h)
    else:
        _held_composition(method, parts, bonds, c, work, share, t, end, h)


def settle(dynamics: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    """Give particles [first, last) without inertia the velocity of their place, for the record."""
    for i in range(first, last):
        wx, wy, wz = velocity(dynamics.flow, fetch(c, i, t))
        fixed = held(c.clock, i)
        c.vx[i] = type_of(c.x[i], 0 if fixed else wx + total[0, i] / dynamics.gamma)
        c.vy[i] = type_of(c.x[i], 0 if fixed else wy + total[1, i] / dynamics.gamma)
        c.vz[i] = type_of(c.x[i], 0 if fixed else wz + total[2, i] / dynamics.gamma)


def settle_all(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any) -> None:
    """`settle` with the forces at time t; without them where all have inertia."""
    if inertialess(parts):
        evaluate(parts, bonds, c, work, share, t, None)
        for part in parts:
            if not isinstance(part.dynamics, Newtonian):
                first, last = max(share.first, part.first), min(share.last, part.last)
                settle(part.dynamics, c, work.force, first, last, t)


def inertialess(parts: Any) -> bool:
    """Whether some particles have no inertia."""
    return any(not isinstance(part.dynamics, Newtonian) for part in parts)


def save(q: Any, before: Any) -> None:
    """Copy the motion of a block to the rows of before [rows, block], as many as there are."""
    for k, column in enumerate(motion(q)):
        if k < before.shape[0]:
            for i in range(column.size):
                before[k, i] = column[i]


def restore(q: Any, before: Any) -> None:
    """Undo `save`."""
    for k, column in enumerate(motion(q)):
        for i in range(column.size):
            column[i] = before[k, i]


def keep_beginning(before: Any, c: Any, share: Any) -> None:
    """Keep the state of a share at the beginning of a step, where the step needs it later."""
    if before is None:
        return
    for lo in range(share.first, share.last, share.chunk):
        hi = min(lo + share.chunk, share.last)
        save(block_of(c, lo, hi), before[:, lo:hi])


def look_at_all(before: Any, c: Any, share: Any) -> None:
    """Mark the share if a number of its particles is not finite, unless `look` has done so."""
    if before is None:
        return
    for lo in range(share.first, share.last, share.chunk):
        if not all_finite(block_of(c, lo, min(lo + share.chunk, share.last))):
            share.wild[8 * share.number] = 1


def back_to_beginning(before: Any, c: Any, share: Any) -> None:
    """Return a share to the beginning of the step, if all of that has been kept."""
    if before is not None and before.shape[0] == len(motion(c)):
        restore(block_of(c, share.first, share.last), before[:, share.first : share.last])


def rolls_anew(method: Any, share: Any) -> bool:
    """Whether the first drift of a step sets angles, so that nobody need set them to 0 before it: nobody reads them then,
    as forces are those with which the last step has ended."""
    return isinstance(method, StagedComposition) and share.rods is None


def begin_turns(c: Any, share: Any) -> None:
    """Angles count from here on; returns when those of all shares do."""
    if c.spin is not None:
        for i in range(share.first, share.last):
            c.spin.ax[i] = c.spin.ay[i] = c.spin.az[i] = 0
        meet(share.gate, share.threads)


def begin_step(c: Any, work: Any, share: Any) -> None:
    """Keep the state at the beginning of a step."""
    keep_beginning(work.before, c, share)
    share.wild[8 * share.number] = 0


def end_step(
    parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any, anew: Any = False
) -> bool:
    """Contacts, what interactions do then, and breaking after a step; returns whether it was a good one in all shares, else
    restores its beginning if that has been kept. `anew`: as `rolls_anew`."""
    drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, end)
    held = None if work.system is None else work.system.held
    before_contact(share.rods, c, share)
    collide(parts, c, work.before, share, t, end, h, work.rebounds, work.again, held)
    if work.rebounds is not None:
        settle_rebounds(parts, bonds, c, work, share, t, end, h)
    after_contact(parts, share.rods, c, work.before, share, t, end, h)
    look_at_all(work.before, c, share)
    meet(share.gate, share.threads)
    good = share.wild.sum() == 0
    if good:
        free = len(bonds) == 0 and share.rods is None
        conclude_elements(share.elements, free, parts, c, work.before, share, end, h)
        if not anew:
            begin_turns(c, share)
        break_bonds(bonds, c, share, end)
    else:
        back_to_beginning(work.before, c, share)
    return good


def pauses(share: Any, step: Any, steps: Any) -> Any:
    """Whether to return after a step, with more to come: the caller may look at the state, and calls again for the rest,
    which then has the same bits."""
    if not any(type(each).tires for each in share.elements):
        return False
    return (step + 1 < steps) & tired_elements(share.elements)


def end_interval(parts: Any, bonds: Any, c: Any, work: Any, share: Any, end: Any) -> None:
    """Velocities at the end of an interval of those that are led or have no inertia."""
    leave_elements(share.elements)
    settle_all(parts, bonds, in_step(c, end, end), work, share, end)
    drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, end)


@kernel
def step_island(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, first_step: Any, steps: Any, dt: Any
) -> int:
    """Advance a share of an island by `steps` steps of dt, the first of which begins at first_step · dt.

    As many threads as there are shares must call this at the same time. Returns the number of steps done: fewer when in the
    next one a number stopped being finite; its beginning is then restored if it has been kept. Also fewer where it `pauses`.
    """
    h, anew = type_of(c.x[0], dt), rolls_anew(method, share)
    for step in range(steps):
        t, end = (first_step + step) * dt, (first_step + step + 1) * dt
        begin_step(c, work, share)
        evolve(method, parts, bonds, in_step(c, t, end), work, share, t, end, h)
        if not end_step(parts, bonds, c, work, share, t, end, h, anew):
            return step
        if pauses(share, step, steps):
            return step + 1
    begin_turns(c, share)
    end_interval(parts, bonds, c, work, share, (first_step + steps) * dt)
    return steps
