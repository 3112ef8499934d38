"""The block kernel of adaptive methods: every particle takes as many steps of its own inside a grid step as its error asks.

The particles of a block that are still under way are packed into columns of their own, the *desk*, so that the loop that
tries a step for each of them vectorises whatever is left of the block. A second loop accepts or rejects, lets particles meet
colliders, and takes those off the desk that have arrived. The last step ends exactly at the end of the grid step; the
step that a particle would have taken stays in its memory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from particlesim.engine.cache import kernel
from particlesim.engine.columns import (
    KEPT,
    Thermal,
    block_of,
    fetch,
    keep,
    load,
    note,
    put_back,
    span,
    store,
    temperature,
    type_of,
)
from particlesim.engine.compile import inline, inlined, outline, stub
from particlesim.engine.contact import overlapped, respond, trace
from particlesim.engine.independent import refresh
from particlesim.engine.steppers import Rate, derivative, moved, stages, weigh
from particlesim.laws import PASS, Particle, moved_to

Impl = Callable[..., Any]

NOT_FINITE, TOO_SHORT, TOO_MANY = 1, 2, 3
"""Why a particle's steps ended: its force is not finite, the step fell below the least, or there was no end of steps."""

MOST_STEPS = 10_000_000
"""Own steps of a particle within one grid step: seconds of work, after which a run had better say so."""
RESOLVED = 16 * 2.0**-52
"""Shortest step over the time that it leads to: shorter ones are lost in the rounding of the clock."""
SAFETY = 0.9
SMALLEST = 1e-4
"""Errors below this do not count as history (Hairer and Wanner)."""


class Desk(NamedTuple):
    """Particles under way, packed: [n] each. Times are double precision.

    `row` in the block; `now`, `stop` [s]; `step` that is proposed, `taken` in this try; `error` of this try, `previous` of
    the last accepted step (0: unknown); `tries` so far, `again` after a rejection. `state` and `slope` are those at `now`,
    `ahead` and `beyond` those at the end of the try.
    """

    row: Any
    now: Any
    stop: Any
    step: Any
    taken: Any
    error: Any
    previous: Any
    tries: Any
    again: Any
    state: tuple[Any, ...]
    slope: tuple[Any, ...]
    ahead: tuple[Any, ...]
    beyond: tuple[Any, ...]
    m: Any
    w: Any
    r: Any
    thermal: Any


class Heated(NamedTuple):
    """Dynamics of particle k of a desk whose temperature changes within the step."""

    dynamics: Any
    thermal: Any
    k: int


@inline(derivative)
def _heated_derivative(dynamics: Any, forces: Any, p: Any) -> Impl | None:
    if getattr(dynamics, "instance_class", None) is not Heated:
        return None

    def impl(dynamics: Any, forces: Any, p: Any) -> Any:
        warmth = temperature(dynamics.thermal, dynamics.k, p.t, p.x)
        q = Particle(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.m, p.r, warmth, p.t, p.w)
        return derivative(dynamics.dynamics, forces, q)

    return impl


def response(dynamics: Any, d: Any, k: Any) -> Any:
    """How particle k of a desk responds to force; with its temperature if a law reads it."""
    return stub()


@inline(response)
def _response(dynamics: Any, d: Any, k: Any) -> Impl:
    if isinstance(d.types[d.fields.index("thermal")], types.NoneType):
        return lambda dynamics, d, k: dynamics
    return lambda dynamics, d, k: Heated(dynamics, d.thermal, k)


# The desk


def new_desk(c: Any, size: Any) -> Any:
    """A desk for `size` particles."""
    return stub()


@inline(new_desk)
def _new_desk(c: Any, size: Any) -> Impl:
    def impl(c: Any, size: Any) -> Any:
        like = c.x
        return Desk(
            np.empty(size, np.int64),
            np.empty(size),
            np.empty(size),
            np.empty(size),
            np.empty(size),
            np.empty(size),
            np.empty(size),
            np.empty(size, np.int64),
            np.empty(size, np.bool_),
            _six(like, size),
            _six(like, size),
            _six(like, size),
            _six(like, size),
            np.empty(size, like.dtype),
            np.empty(size, like.dtype),
            _like(c.r, size),
            _like(c.thermal, size),
        )

    return impl


@inlined
def _six(like: Any, size: Any) -> Any:
    return (
        np.empty(size, like.dtype),
        np.empty(size, like.dtype),
        np.empty(size, like.dtype),
        np.empty(size, like.dtype),
        np.empty(size, like.dtype),
        np.empty(size, like.dtype),
    )


def _like(column: Any, size: Any) -> Any:
    return stub()


@inline(_like)
def _like_column(column: Any, size: Any) -> Impl:
    if isinstance(column, types.NoneType):
        return lambda column, size: None
    if isinstance(column, types.Array):
        return lambda column, size: np.empty(size, column.dtype)
    return lambda column, size: Thermal(np.empty(size), np.empty(size), column.rate, column.ambient)


def move(target: Any, k: Any, source: Any, i: Any) -> Any:
    """Copy element i of every array of `source` to element k of its counterpart in `target`."""
    return stub()


@inline(move)
def _move(target: Any, k: Any, source: Any, i: Any) -> Impl:
    if isinstance(target, types.Array):

        def element(target: Any, k: Any, source: Any, i: Any) -> None:
            target[k] = source[i]

        return element
    if getattr(target, "instance_class", None) is Thermal:

        def warmth(target: Any, k: Any, source: Any, i: Any) -> None:
            target.start[k] = source.start[i]
            target.birth[k] = source.birth[i]

        return warmth
    if not isinstance(target, types.BaseTuple) or len(target) == 0:  # nothing to keep
        return lambda target, k, source, i: None

    def rows(target: Any, k: Any, source: Any, i: Any) -> None:
        move(target[0], k, source[0], i)
        move(target[1:], k, source[1:], i)

    return rows


@inlined
def at(d: Any, k: Any, s: Any, t: Any) -> Any:
    """Particle k of a desk with one of its states, as the laws see it at time t."""
    x = s[0][k]
    warmth = temperature(d.thermal, k, t, x)
    return Particle(
        x, s[1][k], s[2][k], s[3][k], s[4][k], s[5][k], d.m[k], load(d.r, k, x), warmth, t, d.w[k]
    )


@inlined
def put(s: Any, k: Any, x: Any, y: Any, z: Any, vx: Any, vy: Any, vz: Any) -> None:
    """Six numbers to element k of six arrays."""
    s[0][k], s[1][k], s[2][k], s[3][k], s[4][k], s[5][k] = x, y, z, vx, vy, vz


# One try


@inlined
def scales(method: Any, p: Any, q: Any) -> Any:
    """Inverse squares of the errors of position and velocity that a step from p to q may have."""
    x2 = max(p.x * p.x + p.y * p.y + p.z * p.z, q.x * q.x + q.y * q.y + q.z * q.z)
    v2 = max(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz, q.vx * q.vx + q.vy * q.vy + q.vz * q.vz)
    one = type_of(p.x, 1)
    x, v = method.position + method.tolerance * np.sqrt(x2), method.velocity + method.tolerance * np.sqrt(v2)
    return one / (x * x), one / (v * v)


@inlined
def size2(r: Any, sx: Any, sv: Any) -> Any:
    """Square of a rate's length in units of the allowed errors."""
    return sx * (r.x * r.x + r.y * r.y + r.z * r.z) + sv * (r.vx * r.vx + r.vy * r.vy + r.vz * r.vz)


def combined(h: Any, first: Any, second: Any) -> Any:
    """The error of a step from the squared sizes of one estimate, or of two."""
    return stub()


@inline(combined)
def _combined(h: Any, first: Any, second: Any) -> Impl:
    if isinstance(second, types.NoneType):
        return lambda h, first, second: h * np.sqrt(first)

    def two(h: Any, first: Any, second: Any) -> Any:
        below = first + type_of(first, 0.01) * second
        return h * first / np.sqrt(below if below > 0 else type_of(first, 1))

    return two


def error_of(method: Any, slopes: Any, h: Any, p: Any, q: Any) -> Any:
    """The error of a step from p to q in units of what is allowed: E of `particlesim.integrators.adaptive`."""
    return stub()


@inline(error_of)
def _error_of(method: Any, slopes: Any, h: Any, p: Any, q: Any) -> Impl:
    if len(method.types[method.fields.index("errors")]) == 1:

        def one(method: Any, slopes: Any, h: Any, p: Any, q: Any) -> Any:
            sx, sv = scales(method, p, q)
            return combined(h, size2(weigh(method.errors[0], slopes), sx, sv), None)

        return one

    def two(method: Any, slopes: Any, h: Any, p: Any, q: Any) -> Any:
        sx, sv = scales(method, p, q)
        first = size2(weigh(method.errors[0], slopes), sx, sv)
        return combined(h, first, size2(weigh(method.errors[1], slopes), sx, sv))

    return two


def attempt(program: Any, d: Any, n: Any) -> Any:
    """Try a step with each of the n particles of a desk. No branches: this loop vectorises."""
    return stub()


@inline(attempt)
def _attempt(program: Any, d: Any, n: Any) -> Impl:
    def impl(program: Any, d: Any, n: Any) -> None:
        method, forces = program.method, program.forces
        k1 = d.slope
        for k in range(n):
            p = at(d, k, d.state, d.now[k])
            h = type_of(p.x, d.taken[k])
            dynamics = response(program.dynamics, d, k)
            first = Rate(k1[0][k], k1[1][k], k1[2][k], k1[3][k], k1[4][k], k1[5][k])
            slopes = stages(method.a[1:], method.c[1:], dynamics, forces, p, h, (first,))
            q = moved(p, h, weigh(method.b, slopes), d.now[k] + d.taken[k])
            last = derivative(dynamics, forces, q)
            d.error[k] = error_of(method, (*slopes, last), h, p, q)
            put(d.ahead, k, q.x, q.y, q.z, q.vx, q.vy, q.vz)
            put(d.beyond, k, last.x, last.y, last.z, last.vx, last.vy, last.vz)

    return impl


# The choice of steps


@inlined
def factor(method: Any, error: Any, previous: Any, again: Any) -> float:
    """h_new/h after a try of a certain error; `previous` is 0 where there is no history, `again` after a rejection."""
    if not error < np.inf:
        return float(method.shrink)
    wish = SAFETY * max(error, 1e-300) ** -method.alpha
    if previous > 0:
        wish *= previous**method.beta
    most = 1.0 if again or error > 1 else method.grow
    return float(min(max(wish, method.shrink), most))


@inlined
def length2(x: Any, y: Any, z: Any, vx: Any, vy: Any, vz: Any, sx: Any, sv: Any) -> float:
    """Squared length of a state or rate in units of the allowed errors."""
    return float(sx * (x * x + y * y + z * z) + sv * (vx * vx + vy * vy + vz * vz))


def first_step(program: Any, d: Any, k: Any, most: Any) -> Any:
    """A first step for particle k of a desk [s], at most `most`: from the sizes of state, slope, and change of the slope
    (Hairer, Nørsett, Wanner I, section II.4)."""
    return stub()


@outline(first_step)
def _first_step(program: Any, d: Any, k: Any, most: Any) -> Impl:
    def impl(program: Any, d: Any, k: Any, most: Any) -> float:
        p = at(d, k, d.state, d.now[k])
        sx, sv = scales(program.method, p, p)
        a = d.slope
        there = length2(p.x, p.y, p.z, p.vx, p.vy, p.vz, sx, sv)
        fast = length2(a[0][k], a[1][k], a[2][k], a[3][k], a[4][k], a[5][k], sx, sv)
        h = 0.01 * np.sqrt(there / fast) if there > 0 and fast > 0 else 1e-3 * most
        h = min(h, most)
        rate = Rate(a[0][k], a[1][k], a[2][k], a[3][k], a[4][k], a[5][k])
        q = moved(p, type_of(p.x, h), rate, d.now[k] + h)
        b = derivative(response(program.dynamics, d, k), program.forces, q)
        bend = length2(
            b.x - rate.x, b.y - rate.y, b.z - rate.z, b.vx - rate.vx, b.vy - rate.vy, b.vz - rate.vz, sx, sv
        )
        curve = max(np.sqrt(bend) / h, np.sqrt(fast))
        wish = (0.01 / curve) ** program.method.alpha if curve > 0 else most
        wish = min(100 * h, wish)
        return min(wish, most) if wish > 0 else most  # a slope that is not finite is found by the first try

    return impl


# Steps of a block


def sit_down(program: Any, c: Any, d: Any, t: Any, end: Any) -> Any:
    """Put all particles of a block that move between t and end on the desk; returns how many."""
    return stub()


@inline(sit_down)
def _sit_down(program: Any, c: Any, d: Any, t: Any, end: Any) -> Impl:
    def impl(program: Any, c: Any, d: Any, t: Any, end: Any) -> int:
        n = 0
        whole = end - t
        for i in range(c.x.size):
            begin, length = span(c.clock, i, t, end, whole)
            if length > 0:
                d.row[n] = i
                d.now[n] = begin
                d.stop[n] = end if length >= whole else begin + length
                d.step[n] = c.memory[0][i]
                d.previous[n] = c.memory[1][i]
                d.tries[n] = 0
                d.again[n] = False
                move((d.m, *d.state), n, (c.m, c.x, c.y, c.z, c.vx, c.vy, c.vz), i)
                move((d.r, d.thermal), n, (c.r, c.thermal), i)
                n += 1
        for k in range(n):
            d.w[k] = type_of(d.m[k], 1) / d.m[k]
            p = at(d, k, d.state, d.now[k])
            s = derivative(response(program.dynamics, d, k), program.forces, p)
            put(d.slope, k, s.x, s.y, s.z, s.vx, s.vy, s.vz)
        for k in range(n):
            if not d.step[k] > 0:
                d.step[k] = first_step(program, d, k, whole)
            aim(d, k, whole)
        return n

    return impl


@inlined
def aim(d: Any, k: Any, most: Any) -> None:
    """Settle the length of the next try: what is proposed, or all that is left if that is hardly more."""
    left = d.stop[k] - d.now[k]
    d.step[k] = min(d.step[k], most)
    d.taken[k] = left if left <= 1.01 * d.step[k] else d.step[k]


def land(program: Any, c: Any, d: Any, k: Any) -> Any:
    """Particle k of a desk has taken its step: contacts, and whether it is done."""
    return stub()


@inline(land)
def _land(program: Any, c: Any, d: Any, k: Any) -> Impl:
    def impl(program: Any, c: Any, d: Any, k: Any) -> bool:
        arrived = d.taken[k] >= d.stop[k] - d.now[k]
        then = d.stop[k] if arrived else d.now[k] + d.taken[k]
        q = at(d, k, d.ahead, then)
        if overlapped(program.contacts, q):
            p = at(d, k, d.state, d.now[k])
            h = type_of(p.x, d.taken[k])
            r, _, outcome = trace(program.method, program.dynamics, program.forces, program.contacts, p, h, (h,))
            touched = True
        else:
            r, outcome = respond(program.contacts, q)
            touched = (r.vx != q.vx) | (r.vy != q.vy) | (r.vz != q.vz) | (r.x != q.x) | (r.y != q.y) | (r.z != q.z)
        put(d.state, k, r.x, r.y, r.z, r.vx, r.vy, r.vz)
        move(d.slope, k, d.beyond, k)
        if touched:
            p = at(d, k, d.state, then)
            s = derivative(response(program.dynamics, d, k), program.forces, p)
            put(d.slope, k, s.x, s.y, s.z, s.vx, s.vy, s.vz)
            d.previous[k] = 0
        d.now[k] = then
        note(c.clock, d.row[k], outcome, r.t)
        return arrived or outcome != PASS

    return impl


@inlined
def leave(c: Any, d: Any, k: Any) -> None:
    """Write particle k of a desk back to the block."""
    i, s = d.row[k], d.state
    c.x[i], c.y[i], c.z[i] = s[0][k], s[1][k], s[2][k]
    c.vx[i], c.vy[i], c.vz[i] = s[3][k], s[4][k], s[5][k]
    c.memory[0][i], c.memory[1][i] = d.step[k], d.previous[k]


def judge(program: Any, c: Any, d: Any, k: Any, most: Any) -> Any:
    """Accept or reject the try of particle k of a desk: 0 it goes on, −1 it has arrived, else why it cannot go on."""
    return stub()


@inline(judge)
def _judge(program: Any, c: Any, d: Any, k: Any, most: Any) -> Impl:
    def impl(program: Any, c: Any, d: Any, k: Any, most: Any) -> int:
        method, error = program.method, d.error[k]
        scale = factor(method, error, d.previous[k], d.again[k])
        d.tries[k] += 1
        if error <= 1:
            whole = d.taken[k] >= d.step[k]
            # A try that was cut short by the end of the grid step says nothing against the step that was meant.
            d.step[k] = scale * d.taken[k] if whole else max(d.step[k], scale * d.taken[k])
            d.previous[k] = max(error, SMALLEST) if whole else d.previous[k]
            d.again[k] = False
            if land(program, c, d, k):
                return -1
        else:
            d.step[k] = scale * d.taken[k]
            d.again[k] = True
            if d.step[k] < max(method.least, RESOLVED * abs(d.stop[k])):
                s = d.slope
                still = (s[0][k] - s[0][k]) + (s[1][k] - s[1][k]) + (s[2][k] - s[2][k])
                still += (s[3][k] - s[3][k]) + (s[4][k] - s[4][k]) + (s[5][k] - s[5][k])
                return TOO_SHORT if still == 0 else NOT_FINITE
        aim(d, k, most)
        return TOO_MANY if d.tries[k] >= MOST_STEPS else 0

    return impl


def step_block(program: Any, c: Any, d: Any, t: Any, end: Any, moment: Any) -> Any:
    """All steps of a block from t to `end`. Returns 0, or why a particle cannot go on; moment[0] is then when."""
    return stub()


@inline(step_block)
def _step_block(program: Any, c: Any, d: Any, t: Any, end: Any, moment: Any) -> Impl:
    def impl(program: Any, c: Any, d: Any, t: Any, end: Any, moment: Any) -> int:
        n = sit_down(program, c, d, t, end)
        while n > 0:
            attempt(program, d, n)
            k = 0
            while k < n:
                verdict = judge(program, c, d, k, end - t)
                if verdict > 0:
                    moment[0] = d.now[k]
                    leave(c, d, k)
                    return verdict
                if verdict < 0:
                    leave(c, d, k)
                    n -= 1
                    move(d, k, d, n)
                else:
                    k += 1
        return 0

    return impl


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
) -> None:
    """Advance particles [first, last) by `steps` steps of dt, the first of which begins at first_step · dt.

    When a particle cannot go on, faults[k] says why for the first particle k of its block, and moment[0] when. With
    `restore` the block is put back to its state at the beginning; without, the particle stays where it could not go on.
    """
    kept = np.empty((KEPT, block))
    desk = new_desk(columns, block)
    for lo in range(first, last, block):
        c = block_of(columns, lo, min(last, lo + block))
        for i in range(c.x.size):
            keep(c, kept, i)
        verdict = 0
        for s in range(steps):
            t, end = (first_step + s) * dt, (first_step + s + 1) * dt
            verdict = step_block(program, c, desk, t, end, moment)
            if verdict != 0:
                break
        if verdict == 0:
            refresh(program, c, (first_step + steps) * dt)
        else:
            faults[lo] = verdict
            if restore:
                for i in range(c.x.size):
                    put_back(c, kept, i)
