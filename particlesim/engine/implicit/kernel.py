"""Implicit steps of an island: one linear solve, or Newton's method.

The unknown is the velocity V of all particles at a time t + c h, with X = X₀ + γ h V. A Newton iteration linearises at
(X, V), without the indefinite part of compressed springs (`linear_system`), and solves for the change of V. That part is
missing in the matrix only, not in the forces, so that a converged step solves the equations of the method; even without
convergence, backward Euler is of first order. Pinned particles have no unknown: they do not move, or follow a path.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import kernel, outlined, shared
from particlesim.engine.barrier import meet, team_of
from particlesim.engine.coupled.contact import collide
from particlesim.engine.coupled.forces import evaluate, roll, twist
from particlesim.engine.coupled.kernel import begin_step, end_interval, end_step, inertialess, pauses
from particlesim.engine.implicit.krylov import (
    INDEFINITE,
    SOLVED,
    UNSOLVED,
    WILD,
    General,
    Symmetric,
    clear,
    conjugate_gradients,
    copy,
    size2,
    stabilised,
    summed,
)
from particlesim.engine.implicit.linear_system import FLAGS, HELD, linearise
from particlesim.engine.interactions.hard.walls import colliders_of
from particlesim.engine.state.columns import block_of, fetch, in_step, recall, span, type_of
from particlesim.engine.state.prescribed import drive
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.newton import GROWTH, HALVINGS, ROUNDING
from particlesim.engine.step.particle_step import Newtonian
from particlesim.integrators import ImplicitMethod
from particlesim.laws.registry import velocity

GOING = -1
"""A solution is still looked for."""
FORCING = 1e-2
"""How far the linear solve of a Newton iteration reduces the residual."""
STALL = 0.9
"""A residual that is more than this part of the one before falls no longer."""
LEAST = 1e-4
"""How far the first linear solve of a step reduces the residual at least, also where that is less than rounding of
positions: particles that move less in a step than that are still accelerated."""


class StagedImplicit(NamedTuple):
    """Numbers of an implicit method: γ, c, weights of the past and of the slope at the start, whether (X, V) is the middle;
    whether one linear solve is all; relative tolerance, and what rounding leaves; bounds on Newton and linear iterations;
    what equations the kernel can solve."""

    gamma: float
    node: float
    past: float
    slope: float
    middle: bool
    linear: bool
    tolerance: float
    rounding: float
    limit: int
    linear_limit: int
    solver: Symmetric | General


def staged_implicit(method: ImplicitMethod, dtype: Any, solver: Symmetric | General) -> StagedImplicit:
    """A method's numbers for the stage-wise kernel."""
    newton = method.record().newton
    return StagedImplicit(
        method.gamma,
        method.node,
        method.past,
        method.slope,
        method.ahead,
        newton is None,
        method.residual,
        ROUNDING * float(np.finfo(dtype).eps),
        1 if newton is None else newton.limit,
        method.max_linear_iterations,
        solver,
    )


def evolve_implicit(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """A step of an island: its equations are solved, and give its end."""
    reach = type_of(h, method.gamma) * h
    begin(method, parts, bonds, c, work, share, t, end, h)
    turn_ahead(c, share, type_of(h, method.node) * h)
    if solve_step(method, parts, bonds, c, work, share, t, end, h):
        finish(method, c, work, share, reach, t, end, h)
        turn(c, work.force, share, t, end, h)
    else:
        share.wild[8 * share.number] = 1


@outlined
def solve_step(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> bool:
    """Newton iterations, each with a linear solve, until the residual is small; returns whether it is."""
    s = work.system
    reach, now = type_of(h, method.gamma) * h, t + method.node * (end - t)
    ended, iterations, spent, halved, taken = GOING, 0, 0, 0, 1.0
    first, last, goal, enough, size, slack = 0.0, np.inf, 0.0, 0.0, 0.0, 0.0
    while ended == GOING:
        evaluate(parts, bonds, c, work, share, now, None)
        plain, symmetric, rounding = linearise(parts, bonds, c, s, work.force, share, now, reach)
        size = size2(s, share)
        if iterations == 0:
            first, slack = size, left_by_errors(c, s, share)
            exact, rounded = method.tolerance * method.tolerance * size, method.rounding**2 * rounding
            goal, enough = max(exact, rounded), max(exact, min(rounded, LEAST * LEAST * size))
        if not size < np.inf:
            ended = WILD
        elif size <= goal and (iterations > 0 or size == 0):
            ended = SOLVED
        elif STALL * STALL * last < size <= slack:
            ended = SOLVED
            if size > last:  # the state before was the better one
                change(c, s, share, -taken, reach)
        elif size > GROWTH * GROWTH * last and halved < HALVINGS:
            halved, taken = halved + 1, 0.5 * taken
            change(c, s, share, -taken, reach)
            meet(share.gate, share.threads)
        elif iterations == method.limit:
            ended = SOLVED if size <= slack else UNSOLVED
        else:
            wanted = max(FORCING * FORCING * size, 0.25 * goal)
            if method.linear or (iterations == 0 and wanted > FORCING * FORCING * size):
                wanted = enough
            last, halved, taken, iterations = size, 0, 1.0, iterations + 1
            status, left, turns = solve(
                method.solver, bonds, s, share, plain, symmetric, size, wanted, method.linear_limit
            )
            spent += turns
            if status != SOLVED or method.linear:
                ended, size = status, left
            if status == SOLVED:
                change(c, s, share, 1.0, reach)
            meet(share.gate, share.threads)
    if share.number == 0:
        s.report[0], s.report[2], s.report[3] = ended, iterations, spent
        s.report[1] = np.sqrt(size / first) if first > 0 else 0.0
    return bool(ended == SOLVED)


def left_by_errors(c: Any, s: Any, share: Any) -> Any:
    """The square of the residual that errors of forces leave which are not exact, as those by a tree; 0 without such.

    They jump by about as much where particles move from one cell to the next, in iterations, too: the equations may have no
    solution, and none is closer to that of exact forces.
    """
    if not any(type(each).inexact for each in share.elements):
        return 0.0
    for lo in range(share.first, share.last, share.chunk):
        total = 0.0
        for each in share.elements:
            total += of_errors(each, c, s, lo, min(lo + share.chunk, share.last))
        s.partial[1, lo // share.chunk] = total
    meet(share.gate, share.threads)
    found = summed(s.partial, 1)
    meet(share.gate, share.threads)  # before the solver writes there
    return found


@outlined
def of_errors(each: Any, c: Any, s: Any, lo: Any, hi: Any) -> float:
    """Σ tr(M⁻¹)/3 δf² over particles [lo, hi) for one set: rᵀ M⁻¹ r of errors δf in no particular direction."""
    total = 0.0
    if type(each).inexact:
        for i in range(lo, hi):
            trace = float(s.block[0, i]) + float(s.block[1, i]) + float(s.block[2, i])
            miss = float(type(each).error_of(each, c, i))
            total += trace / 3 * miss * miss
    return total


def solve(
    solver: Any, bonds: Any, s: Any, share: Any, plain: Any, symmetric: Any, size: Any, goal: Any, limit: Any
) -> Any:
    """Solve the linear equations; returns how that ended, the size of the residual, and the number of iterations."""
    status, left, turns, more = INDEFINITE, size, 0, 0
    if symmetric:
        copy(s.residual, s.other, share.first, share.last)
        status, left, turns = conjugate_gradients(bonds, s, share, plain, size, goal, limit)
        if status == SOLVED and plain and only_internal(share.elements):
            keep_momentum(s.residual, s.solution, s.inertia, s.free, s.partial, team_of(share))
        if status == INDEFINITE:
            copy(s.other, s.residual, share.first, share.last)
    if status == INDEFINITE:
        status, left, more = stabilised(solver, bonds, s, share, plain, size, goal, limit)
    return status, left, turns + more


def only_internal(elements: Any) -> Any:
    """Whether what acts between particles does not care how they move as one: wind on triangles does."""
    return all(type(each).internal for each in elements)


@shared
def keep_momentum(residual: Any, solution: Any, inertia: Any, free: Any, partial: Any, team: Any) -> None:
    """Change the velocities of all particles of an island equally, such that the sum of the residuals vanishes, if all can
    move. Forces between them do not feel that: the momentum is kept to rounding, whatever the tolerance of the solution.
    """
    for lo in range(team.first, team.last, team.chunk):
        hi = min(lo + team.chunk, team.last)
        for axis in range(3):
            total = 0.0
            for i in range(lo, hi):
                total += float(residual[axis, i])
            partial[axis, lo // team.chunk] = total
        whole = 0.0
        for i in range(lo, hi):
            whole += float(inertia[i]) if free[i] > 0 else np.inf
        partial[3, lo // team.chunk] = whole
    meet(team.gate, team.threads)
    whole = summed(partial, 3)
    for axis in range(3):
        shift = type_of(residual[axis, 0], summed(partial, axis) / whole)
        for i in range(team.first, team.last):
            solution[axis, i] += shift


def change(c: Any, s: Any, share: Any, taken: Any, reach: Any) -> None:
    """Add part of the solution to the velocities of a share, and put the particles where these lead."""
    x, v = (c.x, c.y, c.z), (c.vx, c.vy, c.vz)
    _change(x, v, s.base, s.solution, s.free, share.first, share.last, type_of(reach, taken), reach)


@shared
def _change(
    x: Any, v: Any, base: Any, solution: Any, free: Any, first: Any, last: Any, taken: Any, reach: Any
) -> None:
    for k, (place, speed) in enumerate(zip(x, v, strict=True)):
        for i in range(first, last):
            if free[i] > 0:
                speed[i] += taken * solution[k, i]
                place[i] = base[k, i] + reach * speed[i]


def history(memory: Any, i: Any) -> Any:
    """x − x₋ and v − v₋ of particle i, and the step for which they hold; zeros for a method without a past."""
    if len(memory) == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return recall(memory, i)


def slope_of(dynamics: Any, forces: Any, p: Any, fx: Any, fy: Any, fz: Any) -> Any:
    """Velocity and acceleration of a particle under a force, and which of both the solution begins with."""
    if isinstance(dynamics, Newtonian):
        return p.vx, p.vy, p.vz, p.w * fx, p.w * fy, p.w * fz
    wx, wy, wz = velocity(dynamics.flow, p)
    g, zero = dynamics.gamma, p.x - p.x
    return wx + fx / g, wy + fy / g, wz + fz / g, zero, zero, zero


def begin(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """X₀, V₀ and the first guess; returns when those of all shares are there."""
    if method.slope != 0 or method.past != 0 or inertialess(parts):
        evaluate(parts, bonds, c, work, share, t, None)
    else:
        clear(work.force, share.first, share.last)
    for part in parts:
        begin_part(method, part, c, work, share, t, end, h)
    meet(share.gate, share.threads)


def begin_part(method: Any, part: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """`begin` for the particles of a group that are in a share."""
    s, force = work.system, work.force
    past, half = type_of(h, method.past), type_of(h, 0.5)
    lean, reach = type_of(h, method.slope) * h, type_of(h, method.gamma) * h
    for i in range(max(share.first, part.first), min(share.last, part.last)):
        _, hi = span(c.clock, i, t, end, h)
        s.free[i], s.held[i] = type_of(h, 1 if hi > 0 else 0), 0
        p = fetch(c, i, t)
        ux, uy, uz, ax, ay, az = slope_of(
            part.dynamics, part.forces, p, force[0, i], force[1, i], force[2, i]
        )
        dx, dy, dz, ex, ey, ez, known = history(c.memory, i)
        if known != h:  # as from a step before under the same force
            dx, dy, dz = h * (ux - half * h * ax), h * (uy - half * h * ay), h * (uz - half * h * az)
            ex, ey, ez = h * ax, h * ay, h * az
        s.base[0, i], s.base[3, i] = p.x + past * dx + lean * ux, p.vx + past * ex + lean * ax
        s.base[1, i], s.base[4, i] = p.y + past * dy + lean * uy, p.vy + past * ey + lean * ay
        s.base[2, i], s.base[5, i] = p.z + past * dz + lean * uz, p.vz + past * ez + lean * az
        if hi > 0:
            c.vx[i], c.vy[i], c.vz[i] = ux, uy, uz
            if not method.linear:
                c.x[i] = s.base[0, i] + reach * ux
                c.y[i] = s.base[1, i] + reach * uy
                c.z[i] = s.base[2, i] + reach * uz
        led = s.free[i] if method.linear else type_of(h, 0)
        s.lead[0, i], s.lead[1, i], s.lead[2, i] = led * ux, led * uy, led * uz


def turn_ahead(c: Any, share: Any, ahead: Any) -> None:
    """Spheres turn explicitly: by as much as they would at their present rate until the time at which forces are taken."""
    if c.spin is not None:
        s = c.spin
        for i in range(share.first, share.last):
            s.ax[i], s.ay[i], s.az[i] = ahead * s.wx[i], ahead * s.wy[i], ahead * s.wz[i]
        meet(share.gate, share.threads)


def turn(c: Any, force: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """The end of a step of spinning particles, by the torques of the solved state."""
    if c.spin is not None:
        half, whole = type_of(h, 0.5), type_of(h, 1)
        for i in range(share.first, share.last):
            c.spin.ax[i] = c.spin.ay[i] = c.spin.az[i] = 0
        for lo in range(share.first, share.last, share.chunk):
            hi = min(lo + share.chunk, share.last)
            q = block_of(c, lo, hi)
            roll(q, half, t, end, h)
            twist(q, force[3, lo:hi], force[4, lo:hi], force[5, lo:hi], whole, t, end, h)
            roll(q, half, t, end, h)


def cut_short(clock: Any, i: Any, before: Any, columns: Any, t: Any, end: Any, h: Any) -> Any:
    """How long particle i moved in the step [t, end]; one that is born or dies in it moves for that part of the step of the
    others, along a straight line, so that it stays between the beginning and a solution however stiff forces are."""
    if clock is None:
        return h
    _, hi = span(clock, i, t, end, h)
    if hi < h:
        part = hi / h
        for k, column in enumerate(columns):
            column[i] = before[k, i] + part * (column[i] - before[k, i])
    return hi


def recollect(memory: Any, i: Any, before: Any, columns: Any, h: Any) -> None:
    """Remember how far particle i came in the step of length h that has been done."""
    if len(memory) == 0:
        return
    for k, column in enumerate(columns):
        memory[k][i] = column[i] - before[k, i]
    memory[6][i] = h


def finish(method: Any, c: Any, work: Any, share: Any, reach: Any, t: Any, end: Any, h: Any) -> None:
    """The new state of a share from the solved one."""
    s = work.system
    x, v = (c.x, c.y, c.z), (c.vx, c.vy, c.vz)
    span_of = (t, end, h)
    part = (share.first, share.last)
    _finish(x, v, c.memory, c.clock, s.base, s.free, work.before, *part, method.middle, reach, *span_of)


@shared
def _finish(
    x: Any,
    v: Any,
    memory: Any,
    clock: Any,
    base: Any,
    free: Any,
    before: Any,
    first: Any,
    last: Any,
    middle: Any,
    reach: Any,
    t: Any,
    end: Any,
    h: Any,
) -> None:
    two = type_of(h, 2)
    for k, (place, speed) in enumerate(zip(x, v, strict=True)):
        for i in range(first, last):
            if free[i] > 0:
                place[i] = base[k, i] + reach * speed[i]
                if middle:
                    place[i] = two * place[i] - before[k, i]
                    speed[i] = two * speed[i] - before[3 + k, i]
    for i in range(first, last):
        if free[i] > 0:
            recollect(memory, i, before, (*x, *v), cut_short(clock, i, before, (*x, *v), t, end, h))


# What colliders hold back


def may_be_held(parts: Any, bonds: Any, c: Any, work: Any, share: Any) -> bool:
    """Whether colliders may hold back particles that are coupled to others, and nothing else changes what they do then."""
    coupled = len(bonds) > 0 or any(type(each).numbers > 0 for each in share.elements)
    plain = share.rods is None and c.spin is None and not inertialess(parts)
    hard = all(part.cores is None and len(part.contacts.soft) == 0 for part in parts)
    return coupled and plain and hard and any(has_colliders(part) for part in parts)


def has_colliders(part: Any) -> bool:
    """Whether a group may meet colliders."""
    return not isinstance(part.contacts, Simple) or len(part.contacts.colliders) > 0


def loses(part: Any) -> bool:
    """Whether what hits the colliders of a group loses energy there, so that nobody misses what is lost by the way."""
    lossy = True
    for collider in colliders_of(part):
        lossy = lossy & (collider.response.bounce < 2)
    return bool(lossy)


@outlined
def solve_around(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """Solve the equations of a step again, around those particles that colliders have held back in it.

    Put back alone, they would stretch what joins them to others by as much as these all move in a step, and methods that are
    stable in long steps would not be where something lies, or lands. Not so with a single linear solve: it damps what
    presses those that lie, and around these it would leave no friction.
    """
    lossy = (not method.linear) and (work.rebounds is None or all(loses(part) for part in parts))
    if good(share) and lossy and some_held(parts, c, work, share, t, end, h):
        begin_around(method, c, work, share, h)
        meet(share.gate, share.threads)
        solved = solve_step(method, parts, bonds, in_step(c, t, end), work, share, t, end, h)
        if solved:
            finish(method, in_step(c, t, end), work, share, type_of(h, method.gamma) * h, t, end, h)
        end_around(c, work.system, share, solved)


def good(share: Any) -> bool:
    """Whether the step has been one so far, in all shares."""
    meet(share.gate, share.threads)
    found = share.wild.sum() == 0
    meet(share.gate, share.threads)
    return bool(found)


def some_held(parts: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> bool:
    """Let particles meet colliders; returns whether these have held some back."""
    s, some = work.system, False
    drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, end)
    for axis, speed in enumerate((c.vx, c.vy, c.vz)):
        for i in range(share.first, share.last):
            s.near[axis, i] = speed[i]
    collide(parts, c, work.before, share, t, end, h, None, work.again, s.held)
    for i in range(share.first, share.last):
        if s.held[i] != 0:
            some = True
            recollect_pull(c, s.near, work.before, i, h)
    s.flags[FLAGS * share.number + HELD] = 1 if some else 0
    meet(share.gate, share.threads)
    for k in range(share.threads):
        some = some | (s.flags[FLAGS * k + HELD] != 0)
    meet(share.gate, share.threads)
    return some


def recollect_pull(c: Any, free: Any, before: Any, i: Any, h: Any) -> None:
    """Have the method remember of particle i, which a collider has held back, that it came where it is under the force that
    the solution has found, with which it would have the velocity `free`. The present force may be that of a stiff spring,
    and by so much in a step it would be thrown away."""
    if len(c.memory) > 0:
        for axis, speed in enumerate((c.vx, c.vy, c.vz)):
            change = free[axis, i] - before[3 + axis, i]
            c.memory[axis][i] = h * (speed[i] - type_of(h, 0.5) * change)
            c.memory[3 + axis][i] = change
        c.memory[6][i] = h


def begin_around(method: Any, c: Any, work: Any, share: Any, h: Any) -> None:
    """The state from which the equations are solved again: what is held is where the step takes it, others are where it has
    taken them, all at the time of the equations."""
    s, half = work.system, type_of(h, 0.5)
    for axis, (place, speed) in enumerate(zip((c.x, c.y, c.z), (c.vx, c.vy, c.vz), strict=True)):
        for i in range(share.first, share.last):
            s.ended[axis, i], s.ended[3 + axis, i] = place[i], speed[i]
            if (s.held[i] != 0) | (s.free[i] > 0):
                was, x, v = work.before[axis, i], place[i], speed[i]
                if method.middle:
                    x, v = half * (x + was), half * (v + work.before[3 + axis, i])
                place[i], speed[i] = x, v
    for i in range(share.first, share.last):
        s.free[i] = s.free[i] if s.held[i] == 0 else h - h


def end_around(c: Any, s: Any, share: Any, solved: Any) -> None:
    """What is held ends the step where colliders have it; where nothing has been found all end it as before."""
    for axis, (place, speed) in enumerate(zip((c.x, c.y, c.z), (c.vx, c.vy, c.vz), strict=True)):
        for i in range(share.first, share.last):
            if (s.held[i] != 0) | (not solved):
                place[i], speed[i] = s.ended[axis, i], s.ended[3 + axis, i]
    if share.number == 0:
        s.report[0] = SOLVED  # as it is by the first solution
    meet(share.gate, share.threads)


@kernel
def step_island_implicit(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, first_step: Any, steps: Any, dt: Any
) -> int:
    """As `step_island`, by an implicit method. What it left in `report` of the system tells how the last step ended."""
    h = type_of(c.x[0], dt)
    for step in range(steps):
        t, end = (first_step + step) * dt, (first_step + step + 1) * dt
        begin_step(c, work, share)
        evolve_implicit(method, parts, bonds, in_step(c, t, end), work, share, t, end, h)
        if may_be_held(parts, bonds, c, work, share):
            solve_around(method, parts, bonds, c, work, share, t, end, h)
        if not end_step(parts, bonds, c, work, share, t, end, h):
            return step
        if pauses(share, step, steps):
            return step + 1
    end_interval(parts, bonds, c, work, share, (first_step + steps) * dt)
    return steps
