"""The block kernel of adaptive methods: every particle takes as many steps of its own inside a grid step as its error asks.

The particles of a block that have not reached the end of the grid step are packed into columns of their own, the *desk*, so
that the loop that tries a step for each of them vectorises, however few are left. A second loop accepts or rejects, lets
particles meet colliders, and removes those that have arrived from the desk. The last step ends exactly at the end of the
grid step; the step that a particle would have taken stays in its memory.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, outlined
from particlesim.engine.independent.active_set import (
    AGAIN,
    AHEAD,
    BEYOND,
    DESK,
    ERROR,
    NOW,
    PREVIOUS,
    SLOPE,
    STATE,
    STEP,
    STOP,
    TAKEN,
    TRIES,
    at,
    bring_attributes,
    bring_heat,
    leave,
    move,
    new_desk,
    put,
    rate_at,
    response,
    slope_here,
)
from particlesim.engine.independent.kernel import refresh
from particlesim.engine.state.columns import (
    block_of,
    fetch,
    keep,
    note,
    put_back,
    span,
    tire,
    type_of,
)
from particlesim.engine.step.at_rest import overlapped
from particlesim.engine.step.contacts import Simple, meet, pushed
from particlesim.engine.step.crossing import crossings, passable, passed, thin
from particlesim.engine.step.hits import tell
from particlesim.engine.step.impacts import trace
from particlesim.engine.step.particle_step import Rate, derivative, moved, stages, weigh
from particlesim.engine.step.step_size import (
    MOST_STEPS,
    RESOLVED,
    SMALLEST,
    TOO_MANY,
    combined,
    factor,
    scales,
    size2,
    why_short,
)
from particlesim.laws.registry import PASS

# The log of steps


class StepLog(NamedTuple):
    """Steps of their own that particles have taken, for callers that need them.

    `number` [2]: how many, and the row at which the present block begins. Of the first of them, `spans` [3, room] has row,
    beginning and length [s], and `states` [18, room] position and velocity at the beginning, at the end without contact, and
    with it.
    """

    number: NDArray[np.int64]
    spans: NDArray[np.float64]
    states: NDArray[np.float64]


def new_log(room: int = 0) -> StepLog:
    """A log with room for so many steps; those beyond are only counted."""
    return StepLog(np.zeros(2, np.int64), np.empty((3, room)), np.empty((18, room)))


def enter(log: Any, d: Any, k: Any, q: Any, r: Any) -> None:
    """Log the step of particle k of a desk from its state to q, which contact makes r."""
    n = log.number[0]
    log.number[0] = n + 1
    if n < log.spans.shape[1]:
        log.spans[0, n] = log.number[1] + d.row[k]
        log.spans[1, n], log.spans[2, n] = d.clock[NOW, k], d.clock[TAKEN, k]
        for s in range(6):
            log.states[s, n] = d.body[STATE + s, k]
        write(log.states[6:12, n], q)
        write(log.states[12:18, n], r)


def write(column: Any, p: Any) -> None:
    """Position and velocity of a particle."""
    column[0], column[1], column[2] = p.x, p.y, p.z
    column[3], column[4], column[5] = p.vx, p.vy, p.vz


# One try


def error_of(method: Any, slopes: Any, h: Any, p: Any, q: Any) -> Any:
    """The error of a step from p to q in units of what is allowed: E of `particlesim.integrators.adaptive`."""
    sx, sv = scales(method, p, q)
    first = size2(weigh(method.errors[0], slopes), sx, sv)
    second = size2(weigh(method.errors[1], slopes), sx, sv) if len(method.errors) > 1 else None
    return combined(h, first, second)


def attempt(program: Any, d: Any, n: Any) -> None:
    """Try a step with each of the n particles of a desk. No branches: this loop vectorises."""
    method, forces = program.method, program.forces
    for k in range(n):
        p = at(d, k, STATE, d.clock[NOW, k])
        h = type_of(p.x, d.clock[TAKEN, k])
        dynamics = response(program.dynamics, d, k)
        slopes = stages(method.a[1:], method.c[1:], dynamics, forces, p, h, (rate_at(d, k, SLOPE),))
        q = moved(p, h, weigh(method.b, slopes), d.clock[NOW, k] + d.clock[TAKEN, k])
        last = derivative(dynamics, forces, q)
        d.clock[ERROR, k] = error_of(method, (*slopes, last), h, p, q)
        put(d, k, AHEAD, q)
        put(d, k, BEYOND, last)


# The choice of steps


@outlined
def first_step(program: Any, d: Any, k: Any, most: Any) -> Any:
    """A first step for particle k of a desk [s], at most `most`: from the sizes of state, slope, and change of the slope
    (Hairer, Nørsett, Wanner I, section II.4)."""
    p, a = at(d, k, STATE, d.clock[NOW, k]), rate_at(d, k, SLOPE)
    sx, sv = scales(program.method, p, p)
    size, speed = float(np.sqrt(size2(p, sx, sv))), float(np.sqrt(size2(a, sx, sv)))
    h = min(0.01 * size / speed, most) if size > 0 and speed > 0 else 1e-3 * most
    q = moved(p, type_of(p.x, h), a, d.clock[NOW, k] + h)
    b = derivative(response(program.dynamics, d, k), program.forces, q)
    bend = Rate(b.x - a.x, b.y - a.y, b.z - a.z, b.vx - a.vx, b.vy - a.vy, b.vz - a.vz)
    curve = max(float(np.sqrt(size2(bend, sx, sv))) / h, speed)
    wish = min(100 * h, (0.01 / curve) ** program.method.alpha) if curve > 0 else most
    return min(wish, most) if wish > 0 else most  # a slope that is not finite is found by the first try


# Steps of a block


def sit_down(program: Any, c: Any, d: Any, t: Any, end: Any) -> Any:
    """Put all particles of a block that move between t and end on the desk; returns how many."""
    n = 0
    whole = end - t
    for i in range(c.x.size):
        begin, length = span(c.clock, i, t, end, whole)
        if length > 0:
            d.row[n] = i
            d.clock[NOW, n] = begin
            d.clock[STOP, n] = end if length >= whole else begin + length
            d.clock[STEP, n] = c.memory[0][i]
            d.clock[PREVIOUS, n] = c.memory[1][i]
            d.clock[TRIES, n] = d.clock[AGAIN, n] = 0
            bring_heat(c.thermal, i, d.clock, n)
            p = fetch(c, i, begin)
            put(d, n, STATE, p)
            bring_attributes(d, n, p)
            n += 1
    for k in range(n):
        slope_here(program, d, k)
    for k in range(n):
        if not d.clock[STEP, k] > 0:
            d.clock[STEP, k] = first_step(program, d, k, whole)
        aim(d, k, whole)
    return n


def aim(d: Any, k: Any, most: Any) -> None:
    """Settle the length of the next try: what is proposed, or all that is left if that is hardly more."""
    left = d.clock[STOP, k] - d.clock[NOW, k]
    d.clock[STEP, k] = min(d.clock[STEP, k], most)
    d.clock[TAKEN, k] = left if left <= 1.01 * d.clock[STEP, k] else d.clock[STEP, k]


def land(program: Any, c: Any, d: Any, k: Any, log: Any) -> Any:
    """Particle k of a desk has taken its step: contacts, and whether it is done."""
    now, taken = d.clock[NOW, k], d.clock[TAKEN, k]
    arrived = taken >= d.clock[STOP, k] - now
    then = d.clock[STOP, k] if arrived else now + taken
    q = at(d, k, AHEAD, then)
    touched, r, outcome = touch(program, c, d, k, q)
    if c.missed is not None and len(passable(program.contacts)) > 0:
        begin = at(d, k, STATE, now)
        c.missed[d.row[k]] += crossings(program.contacts, begin, r, type_of(begin.x, taken))
    enter(log, d, k, q, r)
    d.clock[NOW, k] = then
    put(d, k, STATE, r)
    if touched:
        d.clock[PREVIOUS, k] = 0
        slope_here(program, d, k)
    else:
        for s in range(6):
            d.body[SLOPE + s, k] = d.body[BEYOND + s, k]
    note(c.clock, d.row[k], outcome, r.t)
    return arrived or outcome != PASS


def touch(program: Any, c: Any, d: Any, k: Any, q: Any) -> Any:
    """Contacts of particle k of a desk, whose step ends as q: whether there was one, the particle, the outcome."""
    if isinstance(program.contacts, Simple):
        if len(program.contacts.colliders) + len(program.contacts.soft) == 0:
            return False, q, PASS
        r, outcome = meet(program.contacts.colliders, q)
        if len(program.contacts.soft) > 0:
            r = pushed(program.contacts.soft, r, type_of(r.x, d.clock[TAKEN, k]))
        still = (r.x == q.x) & (r.y == q.y) & (r.z == q.z)
        still &= (r.vx == q.vx) & (r.vy == q.vy) & (r.vz == q.vz)
        return not still, r, outcome
    outcome = PASS
    p = at(d, k, STATE, d.clock[NOW, k])
    h = type_of(p.x, d.clock[TAKEN, k])
    inside = overlapped(program.contacts, p, q, h)
    if inside:
        q, _, outcome, hit, exhausted, _ = trace(
            program.method, program.dynamics, program.forces, program.contacts, p, h, (h,)
        )
        if c.missed is not None and len(thin(program.contacts)) > 0:
            c.missed[d.row[k]] += passed(program.contacts, p, q, h)
        tell(c.hit, d.row[k], hit)
        tire(c, d.row[k], exhausted)
    if len(program.contacts.soft) > 0:
        r = pushed(program.contacts.soft, q, h)
        inside |= (r.vx != q.vx) | (r.vy != q.vy) | (r.vz != q.vz)
        q = r
    return inside, q, outcome


def judge(program: Any, c: Any, d: Any, k: Any, most: Any, log: Any) -> Any:
    """Accept or reject the try of particle k of a desk: 0 it goes on, −1 it has arrived, else why it cannot go on."""
    w, method = d.clock, program.method
    error, taken = w[ERROR, k], w[TAKEN, k]
    wish = taken * factor(method, error, w[PREVIOUS, k], w[AGAIN, k] > 0)
    w[TRIES, k] += 1
    if error <= 1:
        w[AGAIN, k] = 0
        if taken >= w[STEP, k]:
            w[STEP, k] = wish
            w[PREVIOUS, k] = max(error, SMALLEST)
        else:  # a try that was cut short by the end of the grid step says nothing against the step that was meant
            w[STEP, k] = max(w[STEP, k], wish)
        if land(program, c, d, k, log):
            return -1
    else:
        w[AGAIN, k], w[STEP, k] = 1, wish
    if wish < taken and w[STEP, k] < max(method.least, RESOLVED * w[STOP, k]):
        return why_short(rate_at(d, k, SLOPE))
    aim(d, k, most)
    return TOO_MANY if w[TRIES, k] >= MOST_STEPS else 0


def step_block(program: Any, c: Any, d: Any, t: Any, end: Any, moment: Any, log: Any) -> Any:
    """All steps of a block from t to `end`. Returns 0, or why a particle cannot go on; moment[0] is then when."""
    n = sit_down(program, c, d, t, end)
    while n > 0:
        attempt(program, d, n)
        k = 0
        while k < n:
            verdict = judge(program, c, d, k, end - t, log)
            if verdict > 0:
                moment[0] = d.clock[NOW, k]
                leave(c, d, k)
                return verdict
            if verdict < 0:
                leave(c, d, k)
                n -= 1
                move(d, k, n)
            else:
                k += 1
    return 0


@kernel
def step_range_adaptive(
    program: Any,
    columns: Any,
    first_step: Any,
    steps: Any,
    dt: Any,
    first: Any,
    last: Any,
    block: Any,
    restore: Any,
    faults: Any,
    moment: Any,
    log: Any,
) -> None:
    """Advance particles [first, last) by `steps` steps of dt, the first of which begins at first_step · dt.

    When a particle cannot go on, faults[k] says why for the first particle k of its block, and moment[0] when. With
    `restore` the block is put back to its state at the beginning; without, the particle stays where it could not go on.
    Every own step is entered into `log`.
    """
    some = min(block, DESK)
    desk = new_desk(columns)
    for lo in range(first, last, some):
        c = block_of(columns, lo, min(last, lo + some))
        log.number[1] = lo
        for i in range(c.x.size):
            keep(c, desk.kept, i)
        verdict = 0
        for s in range(steps):
            t, end = (first_step + s) * dt, (first_step + s + 1) * dt
            verdict = step_block(program, c, desk, t, end, moment, log)
            if verdict != 0:
                break
        if verdict == 0:
            refresh(program, c, (first_step + steps) * dt)
        else:
            faults[lo] = verdict
            if restore:
                for i in range(c.x.size):
                    put_back(c, desk.kept, i)
