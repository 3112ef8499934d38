"""The solution of the equations of an implicit step, and the end of the step that it gives."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.barrier import meet, team_of
from particlesim.engine.coupled.forces import evaluate
from particlesim.engine.implicit.krylov import (
    INDEFINITE,
    SOLVED,
    UNSOLVED,
    WILD,
    clear,
    conjugate_gradients,
    copy,
    size2,
    stabilised,
    summed,
)
from particlesim.engine.implicit.linear_system import FREE, linearise
from particlesim.engine.state.columns import span, type_of
from particlesim.engine.step.newton import GROWTH, HALVINGS

GOING = -1
"""A solution is still looked for."""
GOAL, ENOUGH = 4, 5
"""Where a system keeps how small the residual of the first solution of a step had to be, by Newton's method and by a single
linear solve."""
FORCING = 1e-2
"""How far the linear solve of a Newton iteration reduces the residual."""
STALL = 0.9
"""A residual that is more than this part of the one before falls no longer."""
LEAST = 1e-4
"""How far the first linear solve of a step reduces the residual at least, also where that is less than rounding of
positions: particles that move less in a step than that are still accelerated."""


@outlined
def solve_step(
    method: Any,
    parts: Any,
    bonds: Any,
    c: Any,
    work: Any,
    share: Any,
    t: Any,
    end: Any,
    h: Any,
    again: bool,
) -> bool:
    """Newton iterations, each with a linear solve, until the residual is small; returns whether it is. `again`: it is
    as small as after the first solution of the step."""
    s = work.system
    reach, now = type_of(h, method.gamma) * h, t + method.node * (end - t)
    ended, iterations, spent, halved, taken = GOING, 0, 0, 0, 1.0
    first, last, goal, enough, size, slack = 0.0, np.inf, 0.0, 0.0, 0.0, 0.0
    clear(s.solution, share.first, share.last)  # of what is held alone nothing is solved
    while ended == GOING:
        evaluate(parts, bonds, c, work, share, now, None)
        plain, symmetric, rounding = linearise(parts, bonds, c, s, work.force, share, now, reach, method.mass)
        size = size2(s, share)
        if iterations == 0:
            first, slack = size, left_by_errors(c, s, share)
            exact, rounded = method.tolerance * method.tolerance * size, method.rounding**2 * rounding
            goal, enough = max(exact, rounded), max(exact, min(rounded, LEAST * LEAST * size))
            if again:
                goal, enough = max(goal, s.report[GOAL]), max(enough, s.report[ENOUGH])
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
        if not again:
            s.report[GOAL], s.report[ENOUGH] = goal, enough
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
            keep_momentum(s.residual, s.solution, s.inertia, s.free, s.held, s.partial, team_of(share))
        if status == INDEFINITE:
            copy(s.other, s.residual, share.first, share.last)
    if status == INDEFINITE:
        status, left, more = stabilised(solver, bonds, s, share, plain, size, goal, limit)
    return status, left, turns + more


def only_internal(elements: Any) -> Any:
    """Whether what acts between particles does not care how they move as one: wind on triangles does."""
    return all(type(each).internal for each in elements)


@shared
def keep_momentum(
    residual: Any, solution: Any, inertia: Any, free: Any, held: Any, partial: Any, team: Any
) -> None:
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
            whole += float(inertia[i]) if (free[i] > 0) & (held[i] == FREE) else np.inf
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
