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

from particlesim.compiler import exact, kernel, lanes, on_stack, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.coupled.adaptive import after, give_up, next_event, worst
from particlesim.engine.coupled.contact import collide
from particlesim.engine.coupled.forces import evaluate
from particlesim.engine.coupled.kernel import end_interval, restore, save
from particlesim.engine.coupled.rebounds import settle_rebounds
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

LASTING = 2 * COEFFICIENTS + 2
STEP, TAKEN, LAST, KNOWN = 0, 1, 2, 2 + 3 * LASTING
"""Rows of the memory: the next step and the last one [s]; what lasts, vector by vector; whether it holds."""
G, B, PREDICTED, LAST_B, LAST_GUESS, LOST_X, LOST_V, START, PLACE, SPEED, ROOM = (
    *(k * COEFFICIENTS for k in range(5)),
    *(5 * COEFFICIENTS + k for k in range(6)),
)
"""Rows of a particle in the room: g, b, and b as it was predicted, of this step; what lasts: b of the last step and its
prediction, and what rounding has taken from position and velocity; at the beginning of the step the acceleration [m/s²],
position and velocity."""
LANES = 4
"""Numbers in a row, which fit into a vector: x, y, z and nothing."""
UPWARDS, DOWNWARDS = tuple(range(COEFFICIENTS)), tuple(range(COEFFICIENTS - 1, -1, -1))
MOST_ITERATIONS = 12
CONVERGED = 1e-16
"""Change of b₆ in an iteration, relative to the acceleration, that is rounding."""
TOO_LONG = 4.0
"""A step is done again that is this many times too long; the next one is at most as many times longer."""
FORGETS = 20.0
"""Ratio of steps beyond which the last polynomial predicts nothing."""


class StagedGaussRadau(NamedTuple):
    """Nodes and, as their last, the end of the step; weights of b, and then of a₀, in v/h and x/h² at each [nodes, 8]; of
    the acceleration in the g that follows from it [nodes], and of the g before [nodes, 7]; tables of `integrators.ias15`;
    binomials; (5040 ε)^(1/7), the shortest step [s]."""

    nodes: NDArray[np.float64]
    in_v: NDArray[np.float64]
    in_x: NDArray[np.float64]
    of_a: NDArray[np.float64]
    of_g: NDArray[np.float64]
    to_b: NDArray[np.float64]
    to_g: NDArray[np.float64]
    binomials: NDArray[np.float64]
    reach: float
    least: float


class Room(NamedTuple):
    """What a step works on: the rows of each particle [n, ROOM LANES], side by side in memory, and whether its last
    polynomial is known [n]; `memory` is that of the particles [rows, n], where all this lasts between intervals."""

    rows: Any
    known: Any
    memory: Any


def staged_gauss_radau(method: GaussRadauMethod) -> StagedGaussRadau:
    """The method's numbers for the kernel."""
    k = np.arange(COEFFICIENTS)
    powers = np.append(k + 1, 0)  # those of s in the acceleration, a₀ the last
    s = np.array((*NODES, 1.0))[:, None]
    over = 1 / (np.subtract.outer(NODES, NODES) + np.eye(len(NODES)))
    of_a, of_g = np.zeros(len(NODES)), np.zeros((len(NODES), COEFFICIENTS))
    for node in range(1, len(NODES)):
        # g = (… ((a − a₀) o₀ − g₀) o₁ − …) o with o_j = 1/(s − s_j), multiplied out
        of_a[node] = over[node, :node].prod()
        of_g[node, : node - 1] = [over[node, j + 1 : node].prod() for j in range(node - 1)]
    return StagedGaussRadau(
        np.array(NODES),
        s ** (powers + 1) / (powers + 1),
        s ** (powers + 2) / ((powers + 1) * (powers + 2)),
        of_a,
        of_g,
        np.array(newton_to_monomial()),
        np.array(monomial_to_newton()).T.copy(),
        np.array([[comb(j + 1, i + 1) if j >= i else 0 for j in k] for i in k], float),
        (5040 * method.tolerance) ** (1 / 7),
        method.minimum_step or 0.0,
    )


def new_room(memory: NDArray[Any]) -> Room:
    """Room for the particles whose memory this is, [rows, n]."""
    count = memory.shape[1]
    return Room(np.zeros((count, ROOM * LANES)), np.zeros(count), memory)


@outlined
def take(room: Any, first: Any, last: Any) -> None:
    """Fetch what lasts from the memory of particles."""
    for i in range(first, last):
        for k in range(LASTING):
            for axis in range(3):
                room.rows[i, LANES * (LAST_B + k) + axis] = room.memory[LAST + 3 * k + axis, i]
        room.known[i] = room.memory[KNOWN, i]


@outlined
def leave(room: Any, first: Any, last: Any, step: Any, taken: Any) -> None:
    """Put what lasts into the memory of particles: the next step and the last one, and the rest."""
    for i in range(first, last):
        for k in range(LASTING):
            for axis in range(3):
                room.memory[LAST + 3 * k + axis, i] = room.rows[i, LANES * (LAST_B + k) + axis]
        room.memory[KNOWN, i], room.memory[STEP, i], room.memory[TAKEN, i] = room.known[i], step, taken


@outlined
def begin(c: Any, work: Any, first: Any, last: Any) -> None:
    """Keep accelerations, positions and velocities at the beginning of a step."""
    for i in range(first, last):
        p = work.radau.rows[i]
        a, x, v = acceleration(c, work.force, i), (c.x[i], c.y[i], c.z[i]), (c.vx[i], c.vy[i], c.vz[i])
        for row, vector in ((START, a), (PLACE, x), (SPEED, v)):
            for axis in lanes(LANES):
                p[LANES * row + axis] = lane(vector, axis)


def acceleration(c: Any, force: Any, i: Any) -> Any:
    """The acceleration of particle i."""
    m = c.m[i]
    return force[0, i] / m, force[1, i] / m, force[2, i] / m


def lane(vector: Any, axis: Any) -> Any:
    """A component of a vector, 0 where it has none: registers become a row by blending, which memory would do slowly."""
    x, y, z = vector
    return x if axis == 0 else (y if axis == 1 else (z if axis == 2 else 0.0))


@outlined
def predict(method: Any, room: Any, first: Any, last: Any, ratio: Any) -> None:
    """Continue the polynomial of the last step over one `ratio` times as long; where nothing is known, b = 0."""
    for i in range(first, last):
        p = room.rows[i]
        if not room.known[i] > 0:
            for k in range(LANES * LOST_X, LANES * (LOST_V + 1)):
                p[k] = 0.0
        useful = (room.known[i] > 0) & (ratio <= FORGETS)
        power = 1.0
        for k in range(COEFFICIENTS):
            power *= ratio
            at, given = LANES * k, method.binomials[k]
            for axis in lanes(LANES):
                continued, missed = 0.0, p[LANES * LAST_B + at + axis] - p[LANES * LAST_GUESS + at + axis]
                for j in UPWARDS:
                    continued += given[j] * p[LANES * (LAST_B + j) + axis]
                p[LANES * PREDICTED + at + axis] = power * continued if useful else 0.0
                p[LANES * B + at + axis] = power * continued + missed if useful else 0.0
        for k in range(COEFFICIENTS):
            given = method.to_g[k]
            for axis in lanes(LANES):
                total = 0.0
                for j in UPWARDS:
                    total += given[j] * p[LANES * (B + j) + axis]
                p[LANES * (G + k) + axis] = total


@outlined
def go_to_node(method: Any, c: Any, work: Any, first: Any, last: Any, node: Any, h: Any) -> None:
    """Put particles where their polynomials lead at a node of the step."""
    in_x, in_v, s = method.in_x[node], method.in_v[node], method.nodes[node]
    put = on_stack(2, LANES, np.float64)
    x, v = put[0], put[1]
    for i in range(first, last):
        if not rests(c.clock, i):
            p = work.radau.rows[i]
            for axis in lanes(LANES):
                dx, dv = moved(p, axis, in_x, in_v)
                v0 = p[LANES * SPEED + axis]
                x[axis] = p[LANES * PLACE + axis] + (h * (s * v0 + h * dx) - p[LANES * LOST_X + axis])
                v[axis] = v0 + (h * dv - p[LANES * LOST_V + axis])
            c.x[i], c.y[i], c.z[i] = x[0], x[1], x[2]
            c.vx[i], c.vy[i], c.vz[i] = v[0], v[1], v[2]


def moved(p: Any, axis: Any, in_x: Any, in_v: Any) -> tuple[float, float]:
    """The contributions of the acceleration's polynomial to a component of position and velocity, over h² and h."""
    dx, dv = 0.0, 0.0
    for k in DOWNWARDS:  # small ones first
        b = p[LANES * (B + k) + axis]
        dx += b * in_x[k]
        dv += b * in_v[k]
    a = p[LANES * START + axis]
    return dx + a * in_x[COEFFICIENTS], dv + a * in_v[COEFFICIENTS]


@outlined
def learn(method: Any, c: Any, work: Any, first: Any, last: Any, node: Any) -> tuple[float, float]:
    """Take the forces at a node into g and b. Returns the largest change of the last b, and the largest acceleration, at the
    last node."""
    of_a, of_g, to_b = method.of_a[node], method.of_g[node], [method.to_b[node - 1, k] for k in UPWARDS]
    stack = on_stack(2, LANES, np.float64)
    term, difference = stack[0], stack[1]
    change, size = 0.0, 0.0
    for i in range(first, last):
        if not rests(c.clock, i):
            p, a = work.radau.rows[i], acceleration(c, work.force, i)
            own = p[LANES * (G + node - 1) : LANES * (G + node)]
            for axis in lanes(LANES):
                known = 0.0
                for k in UPWARDS:
                    known += of_g[k] * p[LANES * (G + k) + axis]
                term[axis] = (lane(a, axis) - p[LANES * START + axis]) * of_a - known
                difference[axis] = term[axis] - own[axis]
            for axis in lanes(LANES):
                own[axis] = term[axis]
            for axis in lanes(LANES):
                for k in UPWARDS:
                    p[LANES * (B + k) + axis] += to_b[k] * difference[axis]
            if node == COEFFICIENTS:
                for axis in range(3):
                    # NaN compares as false both ways: then the size is infinite
                    off, much = abs(difference[axis]), abs(a[axis])
                    change = max(change, off) if off < np.inf else np.inf
                    size = max(size, much) if much < np.inf else np.inf
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
    room, end = work.radau, len(NODES)
    in_x, in_v = method.in_x[end], method.in_v[end]
    put = on_stack(2, LANES, np.float64)
    x, v = put[0], put[1]
    for i in range(first, last):
        p = room.rows[i]
        if not rests(c.clock, i):
            for axis in lanes(LANES):
                dx, dv = moved(p, axis, in_x, in_v)
                x0, v0 = p[LANES * PLACE + axis], p[LANES * SPEED + axis]
                there, lost = carried(x0, h * h * dx, p[LANES * LOST_X + axis])
                x[axis], p[LANES * LOST_X + axis] = carried(there, h * v0, lost)
                v[axis], p[LANES * LOST_V + axis] = carried(v0, h * dv, p[LANES * LOST_V + axis])
            c.x[i], c.y[i], c.z[i] = x[0], x[1], x[2]
            c.vx[i], c.vy[i], c.vz[i] = v[0], v[1], v[2]
        for k in range(LANES * COEFFICIENTS):
            p[LANES * LAST_B + k], p[LANES * LAST_GUESS + k] = p[LANES * B + k], p[LANES * PREDICTED + k]
        room.known[i] = 1.0


@outlined
def haste(room: Any, c: Any, first: Any, last: Any) -> tuple[float, int]:
    """The largest 1/τ² of some particles times h², and whose it is."""
    most, row = 0.0, first
    squares = on_stack(4, LANES, np.float64)
    for i in range(first, last):
        if not rests(c.clock, i):
            p = room.rows[i]
            for axis in lanes(LANES):
                a, jerk, snap, crackle = p[LANES * START + axis], 0.0, 0.0, 0.0
                for k in UPWARDS:
                    b = p[LANES * (B + k) + axis]
                    a += b
                    jerk += (k + 1) * b
                    snap += k * (k + 1) * b
                    crackle += (k - 1) * k * (k + 1) * b
                squares[0, axis], squares[1, axis] = a * a, jerk * jerk
                squares[2, axis], squares[3, axis] = snap * snap, crackle * crackle
            a2, jerk2, snap2, crackle2 = [sum3(squares[k]) for k in range(4)]
            mine = (jerk2 + np.sqrt(a2 * snap2)) / (2 * a2) if a2 > 0 else np.inf
            # Where the acceleration passes through zero, how its change changes tells the time, not its size.
            later = (snap2 + np.sqrt(jerk2 * crackle2)) / (2 * jerk2) if jerk2 > 0 else np.inf
            mine = min(mine, later) if (a2 > 0) | (jerk2 > 0) else 0.0
            if mine > most or mine != mine:
                most, row = mine, i
    return most, row


def sum3(row: Any) -> Any:
    """The sum of a row's first three numbers."""
    return row[0] + row[1] + row[2]


@outlined
def first_step(room: Any, c: Any, first: Any, last: Any) -> float:
    """1/h² of a first step: a hundredth of the time in which the acceleration changes the velocity or the place."""
    most = 0.0
    for i in range(first, last):
        if not rests(c.clock, i):
            x2, v2, a2 = [squared(room.rows[i], row) for row in (PLACE, SPEED, START)]
            if v2 > 0:
                most = max(most, 1e4 * a2 / v2)
            elif x2 > 0:
                most = max(most, 1e4 * np.sqrt(a2 / x2))
    return float(most)


def squared(p: Any, row: Any) -> Any:
    """The square of a row's length."""
    return p[LANES * row] ** 2 + p[LANES * row + 1] ** 2 + p[LANES * row + 2] ** 2


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
            go_to_node(method, c, work, first, last, node, h)
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
    take(room, first, last)
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
            begin(c, work, first, last)
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
                    leave(room, first, last, step, before)
                    return s
            arrive(method, q, work, first, last, taken)
            if pace.disturbed:
                length = type_of(c.x[0], taken)
                collide(parts, c, work.before, share, now, then, length, work.rebounds)
                if work.rebounds is not None:
                    settle_rebounds(parts, bonds, c, work, share, now, then, length)
                meet(share.gate, share.threads)
                break_bonds(bonds, c, share, then)
            meet(share.gate, share.threads)
            here, landed = goal, arrives
            if arrives and is_event(pace.events, goal):
                for i in range(first, last):
                    room.known[i] = 0.0
            passed, before = dt if arrives & (goal == end) else passed + taken, taken
    leave(room, first, last, step, before)
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
