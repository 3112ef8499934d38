"""The kernel of IAS15: an island steps by polynomials of its acceleration, which all threads iterate together.

The formulas and their sources are those of `particlesim.integrators.ias15`. The step of all follows from the particle whose
acceleration changes fastest, and iterations end by largest values, so that results do not depend on how many threads
there are. What a step needs of the last one is in the memory of the particles, as for all methods; its rows are read as a
table here.
"""

from __future__ import annotations

from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import exact, kernel, outlined
from particlesim.compiler.barrier import meet
from particlesim.engine.coupled.adaptive import after, give_up, next_event, worst
from particlesim.engine.coupled.contact import collide
from particlesim.engine.coupled.forces import evaluate
from particlesim.engine.coupled.kernel import end_interval, restore, save
from particlesim.engine.interactions.bonds import break_bonds
from particlesim.engine.state.columns import block_of, in_step, rests, type_of
from particlesim.engine.step.step_size import MOST_STEPS, NOT_FINITE, RESOLVED, TOO_MANY, TOO_SHORT
from particlesim.integrators.ias15 import (
    COEFFICIENTS,
    NODES,
    GaussRadauMethod,
    monomial_to_newton,
    newton_to_monomial,
)

ROWS = 3 * COEFFICIENTS
STEP, TAKEN, B, E, CARRY, KNOWN = 0, 1, 2, 2 + ROWS, 2 + 2 * ROWS, 8 + 2 * ROWS
"""Rows of the memory: the next step and the last one [s]; b of the last one and its prediction [m/s²], coefficient by
coefficient x, y, z; what rounding took from position and velocity; whether all this holds."""
MOST_ITERATIONS = 12
CONVERGED = 1e-16
"""Change of b₆ in an iteration, relative to the acceleration, that is rounding."""
TOO_LONG = 4.0
"""A step is done again that is this many times too long; the next one is at most as many times longer."""
FORGETS = 20.0
"""Ratio of steps beyond which the last polynomial predicts nothing."""


class StagedGaussRadau(NamedTuple):
    """Nodes, 1 over their differences, tables of `integrators.ias15`, weights of b in v and x, binomials, (5040 ε)^(1/7),
    the shortest step [s]."""

    nodes: NDArray[np.float64]
    over: NDArray[np.float64]
    to_b: NDArray[np.float64]
    to_g: NDArray[np.float64]
    in_v: NDArray[np.float64]
    in_x: NDArray[np.float64]
    binomials: NDArray[np.float64]
    reach: float
    least: float


class Room(NamedTuple):
    """The polynomials of the present step: g, b, and b as it was predicted [3 coefficients, n], the accelerations at its
    beginning [3, n]; `memory` is that of the particles [rows, n]."""

    g: Any
    b: Any
    predicted: Any
    start: Any
    memory: Any


def staged_gauss_radau(method: GaussRadauMethod) -> StagedGaussRadau:
    """The method's numbers for the kernel."""
    k = np.arange(COEFFICIENTS)
    binomials = [[comb(j + 1, i + 1) if j >= i else 0 for j in k] for i in k]
    return StagedGaussRadau(
        np.array(NODES),
        1 / (np.subtract.outer(NODES, NODES) + np.eye(len(NODES))),
        np.array(newton_to_monomial()),
        np.array(monomial_to_newton()),
        1.0 / (k + 2),
        1.0 / ((k + 2) * (k + 3)),
        np.array(binomials, float),
        (5040 * method.tolerance) ** (1 / 7),
        method.minimum_step or 0.0,
    )


def new_room(memory: NDArray[Any]) -> Room:
    """Room for the particles whose memory this is, [rows, n]."""
    count = memory.shape[1]
    g, b, predicted = (np.zeros((ROWS, count)) for _ in range(3))
    return Room(g, b, predicted, np.zeros((3, count)), memory)


@outlined
def predict(method: Any, room: Any, first: Any, last: Any, ratio: Any) -> None:
    """Continue the polynomial of the last step over one `ratio` times as long; where nothing is known, b = 0."""
    memory, b, g = room.memory, room.b, room.g
    for i in range(first, last):
        known = memory[KNOWN, i] > 0
        if not known:
            for k in range(6):
                memory[CARRY + k, i] = 0.0
        useful = known & (ratio <= FORGETS)
        for axis in range(3):
            power = 1.0
            for k in range(COEFFICIENTS):
                power *= ratio
                continued = 0.0
                for j in range(k, COEFFICIENTS):
                    continued += method.binomials[k, j] * memory[B + 3 * j + axis, i]
                row = 3 * k + axis
                room.predicted[row, i] = power * continued if useful else 0.0
                missed = memory[B + row, i] - memory[E + row, i]
                b[row, i] = power * continued + missed if useful else 0.0
            for k in range(COEFFICIENTS):
                total = 0.0
                for j in range(k, COEFFICIENTS):
                    total += method.to_g[j, k] * b[3 * j + axis, i]
                g[3 * k + axis, i] = total


@outlined
def go_to_node(method: Any, c: Any, work: Any, first: Any, last: Any, s: Any, h: Any) -> None:
    """Put particles where their polynomials lead at a part s of the step."""
    room, before = work.radau, work.before
    memory = room.memory
    for i in range(first, last):
        if not rests(c.clock, i):
            for axis in range(3):
                in_x, in_v = 0.0, 0.0
                for k in range(COEFFICIENTS - 1, -1, -1):
                    b = room.b[3 * k + axis, i]
                    in_x = in_x * s + b * method.in_x[k]
                    in_v = in_v * s + b * method.in_v[k]
                a = room.start[axis, i]
                v0 = before[3 + axis, i]
                dx = s * h * (v0 + s * h * (0.5 * a + s * in_x)) - memory[CARRY + axis, i]
                dv = s * h * (a + s * in_v) - memory[CARRY + 3 + axis, i]
                put(c, axis, i, before[axis, i] + dx, v0 + dv)


def put(c: Any, axis: Any, i: Any, x: Any, v: Any) -> None:
    """Set a component of position and velocity of particle i."""
    if axis == 0:
        c.x[i], c.vx[i] = x, v
    elif axis == 1:
        c.y[i], c.vy[i] = x, v
    else:
        c.z[i], c.vz[i] = x, v


@outlined
def learn(method: Any, c: Any, work: Any, first: Any, last: Any, node: Any) -> tuple[float, float]:
    """Take the forces at a node into g and b. Returns the largest change of the last b, and the largest acceleration."""
    room = work.radau
    g, over = room.g, method.over
    change, size = 0.0, 0.0
    for i in range(first, last):
        if not rests(c.clock, i):
            for axis in range(3):
                a = work.force[axis, i] / c.m[i]
                term = (a - room.start[axis, i]) * over[node, 0]
                for k in range(node - 1):
                    term = (term - g[3 * k + axis, i]) * over[node, k + 1]
                row = 3 * (node - 1) + axis
                difference = term - g[row, i]
                g[row, i] = term
                for k in range(node):
                    room.b[3 * k + axis, i] += method.to_b[node - 1, k] * difference
                # NaN compares as false both ways: then the size is infinite
                change = max(change, abs(difference)) if abs(difference) < np.inf else np.inf
                size = max(size, abs(a)) if abs(a) < np.inf else np.inf
    return change, size


@exact
def carried(x: float, dx: float, carry: float) -> tuple[float, float]:
    """x + dx, and what rounding took from it, with the carry of the sum before (Kahan)."""
    y = dx - carry
    total = x + y
    return total, (total - x) - y


@outlined
def arrive(method: Any, c: Any, work: Any, first: Any, last: Any, h: Any) -> None:
    """The end of a step: positions and velocities by the whole polynomial, with carried sums."""
    room, before = work.radau, work.before
    memory = room.memory
    for i in range(first, last):
        if not rests(c.clock, i):
            for axis in range(3):
                in_x, in_v = 0.0, 0.0
                for k in range(COEFFICIENTS - 1, -1, -1):
                    b = room.b[3 * k + axis, i]
                    in_x += b * method.in_x[k]
                    in_v += b * method.in_v[k]
                a, x0, v0 = room.start[axis, i], before[axis, i], before[3 + axis, i]
                x, lost = carried(x0, h * h * (in_x + 0.5 * a), memory[CARRY + axis, i])
                x, memory[CARRY + axis, i] = carried(x, h * v0, lost)
                v, memory[CARRY + 3 + axis, i] = carried(v0, h * (in_v + a), memory[CARRY + 3 + axis, i])
                put(c, axis, i, x, v)
            for k in range(ROWS):
                memory[B + k, i], memory[E + k, i] = room.b[k, i], room.predicted[k, i]
            memory[KNOWN, i] = 1.0


@outlined
def haste(room: Any, c: Any, first: Any, last: Any) -> tuple[float, int]:
    """The largest 1/τ² of some particles times h², and whose it is."""
    most, row = 0.0, first
    for i in range(first, last):
        if not rests(c.clock, i):
            a2, jerk2, snap2, crackle2 = 0.0, 0.0, 0.0, 0.0
            for axis in range(3):
                a, jerk, snap, crackle = room.start[axis, i], 0.0, 0.0, 0.0
                for k in range(COEFFICIENTS):
                    b = room.b[3 * k + axis, i]
                    a += b
                    jerk += (k + 1) * b
                    snap += k * (k + 1) * b
                    crackle += (k - 1) * k * (k + 1) * b
                a2 += a * a
                jerk2 += jerk * jerk
                snap2 += snap * snap
                crackle2 += crackle * crackle
            mine = (jerk2 + np.sqrt(a2 * snap2)) / (2 * a2) if a2 > 0 else np.inf
            # Where the acceleration passes through zero, how its change changes tells the time, not its size.
            later = (snap2 + np.sqrt(jerk2 * crackle2)) / (2 * jerk2) if jerk2 > 0 else np.inf
            mine = min(mine, later) if (a2 > 0) | (jerk2 > 0) else 0.0
            if mine > most or mine != mine:
                most, row = mine, i
    return most, row


@outlined
def first_step(room: Any, c: Any, first: Any, last: Any) -> float:
    """1/h² of a first step: a hundredth of the time in which the acceleration changes the velocity or the place."""
    most = 0.0
    for i in range(first, last):
        if not rests(c.clock, i):
            x2 = c.x[i] * c.x[i] + c.y[i] * c.y[i] + c.z[i] * c.z[i]
            v2 = c.vx[i] * c.vx[i] + c.vy[i] * c.vy[i] + c.vz[i] * c.vz[i]
            a2 = room.start[0, i] ** 2 + room.start[1, i] ** 2 + room.start[2, i] ** 2
            if v2 > 0:
                most = max(most, 1e4 * a2 / v2)
            elif x2 > 0:
                most = max(most, 1e4 * np.sqrt(a2 / x2))
    return float(most)


def keep_accelerations(c: Any, work: Any, first: Any, last: Any) -> None:
    """The accelerations at the beginning of a step."""
    for axis in range(3):
        for i in range(first, last):
            work.radau.start[axis, i] = work.force[axis, i] / c.m[i]


def both(share: Any, slots: Any, a: Any, b: Any) -> Any:
    """The largest values of all threads of two numbers each."""
    slots[8 * share.number + 2], slots[8 * share.number + 3] = a, b
    meet(share.gate, share.threads)
    for k in range(share.threads):
        a, b = max(a, slots[8 * k + 2]), max(b, slots[8 * k + 3])
    return a, b


@outlined
def iterate(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, slots: Any, t: Any, h: Any
) -> bool:
    """Polynomials that agree with the forces; whether these were finite."""
    first, last = share.first, share.last
    error, previous, iteration = 2.0, 4.0, 0
    while iteration < MOST_ITERATIONS and error > CONVERGED and (iteration <= 2 or error < previous):
        previous, change, size = error, 0.0, 0.0
        for node in range(1, COEFFICIENTS + 1):
            go_to_node(method, c, work, first, last, method.nodes[node], h)
            meet(share.gate, share.threads)
            evaluate(parts, bonds, c, work, share, t + method.nodes[node] * h, None)
            change, size = learn(method, c, work, first, last, node)
        change, size = both(share, slots, change, size)
        if not size < np.inf or not change < np.inf:
            return False
        error = change / size if size > 0 else 0.0
        iteration += 1
    return True


@kernel
def step_island_gauss_radau(
    method: Any,
    parts: Any,
    bonds: Any,
    c: Any,
    work: Any,
    share: Any,
    pace: Any,
    first_step_number: Any,
    steps: Any,
    dt: Any,
) -> int:
    """Advance a share of an island by `steps` steps of dt, the first of which begins at first_step_number · dt.

    As many threads as there are shares must call this at the same time. Returns the number of grid steps done; fewer when
    the next one could not be crossed (the island is then where its last own step ended, and `pace.report` says why).
    """
    room, first, last = work.radau, share.first, share.last
    step, before = float(room.memory[STEP, 0]), float(room.memory[TAKEN, 0])
    for s in range(steps):
        t, end = (first_step_number + s) * dt, (first_step_number + s + 1) * dt
        # Time runs within the grid step, from 0 to dt: sums of small numbers lose less than those of large ones.
        passed, tries, here, landed = 0.0, 0, t, False
        while passed < dt:
            now = here if landed else t + passed
            goal = next_event(pace.events, now, end)
            left = dt - passed if goal == end else goal - now
            q = in_step(c, now, goal)
            evaluate(parts, bonds, q, work, share, now, None)
            keep_accelerations(c, work, first, last)
            save(block_of(c, first, last), work.before[:, first:last])
            if not step > 0:
                most, _ = worst(share, pace.slots, first_step(room, q, first, last), 0)
                step = 1 / np.sqrt(most) if most > 0 else dt
            good = False
            while not good:
                taken, arrives = next_step(min(step, dt), left)
                then = goal if arrives else t + passed + taken
                predict(method, room, first, last, taken / before if before > 0 else 2 * FORGETS)
                finite = iterate(method, parts, bonds, q, work, share, pace.slots, now, taken)
                rate, row = haste(room, q, first, last)
                rate, row = worst(share, pace.slots, rate, row)
                wish = taken * (min(method.reach / np.sqrt(rate), TOO_LONG) if rate > 0 else TOO_LONG)
                good = finite & (wish * TOO_LONG >= taken)
                step = wish if finite else taken / TOO_LONG
                tries += 1
                short = step < max(method.least, RESOLVED * end)
                if short or tries >= MOST_STEPS:
                    restore(block_of(c, first, last), work.before[:, first:last])
                    why = (TOO_SHORT if finite else NOT_FINITE) if short else TOO_MANY
                    give_up(share, pace, why, now, row)
                    return s
            arrive(method, q, work, first, last, taken)
            if pace.disturbed:
                collide(parts, c, work.before, share, now, then, type_of(c.x[0], taken))
                meet(share.gate, share.threads)
                break_bonds(bonds, c, share, then)
            meet(share.gate, share.threads)
            here, landed = goal, arrives
            if arrives and is_event(pace.events, goal):
                for i in range(first, last):
                    room.memory[KNOWN, i] = 0.0
            passed, before = dt if arrives & (goal == end) else passed + taken, taken
    for i in range(first, last):
        room.memory[STEP, i], room.memory[TAKEN, i] = step, before
    end_interval(parts, bonds, c, work, share, (first_step_number + steps) * dt)
    return steps


def is_event(events: Any, t: Any) -> Any:
    """Whether particles are born or die at a time: forces jump then, and the last polynomial predicts nothing."""
    k = after(events, t)
    return False if k == 0 else events[k - 1] == t


def next_step(step: Any, left: Any) -> tuple[float, bool]:
    """Length of the next step, and whether it is the last before the end of the grid step, which is `left` away: to the end
    if that is near, or half-way to it, so that no tiny step is left."""
    if left <= 1.01 * step:
        return left, True
    return (0.5 * left, False) if left < 2 * step else (step, False)
