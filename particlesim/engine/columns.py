"""How kernels read and write particles: columns of numbers, some of them optional.

A column that a program does not use is None, and the compiler drops everything that would have read it. All functions
here are inlined and chosen by types.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from particlesim.engine.compile import inline, stub
from particlesim.laws import KILL, PASS, STICK, Particle, moved_to

Impl = Callable[..., Any]


class Thermal(NamedTuple):
    """Newton cooling in closed form: T(t) = T_a + (T_0 − T_a) exp(−rate (t − birth))."""

    start: Any
    birth: Any
    rate: float
    ambient: float


class Clock(NamedTuple):
    """When each particle moves: from `start` to `stop` [s]; `outcome` says what a contact did to it."""

    start: Any
    stop: Any
    outcome: Any


class Columns(NamedTuple):
    """The arrays of a group, or their slices for a block."""

    x: Any
    y: Any
    z: Any
    vx: Any
    vy: Any
    vz: Any
    m: Any
    r: Any
    thermal: Any
    clock: Any
    memory: tuple[Any, ...]


def cut(column: Any, first: Any, last: Any) -> Any:
    """A tuple of one, which parts of kernels may return while they may not return an array: elements [first, last) of an
    array, or what all have in common, None or a number."""
    return stub()


@inline(cut)
def _cut(column: Any, first: Any, last: Any) -> Impl:
    if isinstance(column, types.Array):
        return lambda column, first, last: (column[first:last],)
    return lambda column, first, last: (column,)


def block_of(c: Any, lo: Any, hi: Any) -> Any:
    """The columns of particles [lo, hi)."""
    return stub()


@inline(block_of)
def _block_of(c: Any, lo: Any, hi: Any) -> Impl:
    if isinstance(c, types.NoneType):
        return lambda c, lo, hi: None
    cls = getattr(c, "instance_class", None)
    if cls is Clock:
        return lambda c, lo, hi: Clock(c.start[lo:hi], c.stop[lo:hi], c.outcome[lo:hi])
    if cls is Thermal:
        return lambda c, lo, hi: Thermal(c.start[lo:hi], c.birth[lo:hi], c.rate, c.ambient)
    if cls is Columns:
        return lambda c, lo, hi: Columns(
            c.x[lo:hi],
            c.y[lo:hi],
            c.z[lo:hi],
            c.vx[lo:hi],
            c.vy[lo:hi],
            c.vz[lo:hi],
            c.m[lo:hi],
            cut(c.r, lo, hi)[0],
            block_of(c.thermal, lo, hi),
            block_of(c.clock, lo, hi),
            block_of(c.memory, lo, hi),
        )
    if len(c) == 0:
        return lambda c, lo, hi: ()
    return lambda c, lo, hi: (c[0][lo:hi], *block_of(c[1:], lo, hi))


KEPT = 16
"""Numbers per particle that `keep` and `put_back` may use: position, velocity, memory, clock."""


def keep(c: Any, kept: Any, i: Any) -> Any:
    """Copy what a step changes in particle i to column i of `kept`, shape [KEPT, block], float64."""
    return stub()


@inline(keep)
def _keep(c: Any, kept: Any, i: Any) -> Impl:
    def impl(c: Any, kept: Any, i: Any) -> None:
        _save((c.x, c.y, c.z, c.vx, c.vy, c.vz), kept, 0, i)
        _save(c.memory, kept, 6, i)
        _save(c.clock, kept, 13, i)

    return impl


def put_back(c: Any, kept: Any, i: Any) -> Any:
    """Give particle i back what `keep` copied."""
    return stub()


@inline(put_back)
def _put_back(c: Any, kept: Any, i: Any) -> Impl:
    def impl(c: Any, kept: Any, i: Any) -> None:
        _restore((c.x, c.y, c.z, c.vx, c.vy, c.vz), kept, 0, i)
        _restore(c.memory, kept, 6, i)
        _restore(c.clock, kept, 13, i)

    return impl


def _save(arrays: Any, kept: Any, row: Any, i: Any) -> Any:
    return stub()


@inline(_save)
def _save_rows(arrays: Any, kept: Any, row: Any, i: Any) -> Impl:
    if isinstance(arrays, types.NoneType) or len(arrays) == 0:
        return lambda arrays, kept, row, i: None

    def impl(arrays: Any, kept: Any, row: Any, i: Any) -> None:
        kept[row, i] = arrays[0][i]
        _save(arrays[1:], kept, row + 1, i)

    return impl


def _restore(arrays: Any, kept: Any, row: Any, i: Any) -> Any:
    return stub()


@inline(_restore)
def _restore_rows(arrays: Any, kept: Any, row: Any, i: Any) -> Impl:
    if isinstance(arrays, types.NoneType) or len(arrays) == 0:
        return lambda arrays, kept, row, i: None

    def impl(arrays: Any, kept: Any, row: Any, i: Any) -> None:
        arrays[0][i] = kept[row, i]
        _restore(arrays[1:], kept, row + 1, i)

    return impl


def load(column: Any, i: Any, like: Any) -> Any:
    """Value of an optional column; zero in the precision of `like` when it is absent."""
    return stub()


@inline(load)
def _load(column: Any, i: Any, like: Any) -> Impl:
    if isinstance(column, types.NoneType):
        zero = like
        return lambda column, i, like: zero(0)
    return lambda column, i, like: column[i]


def temperature(thermal: Any, i: Any, t: Any, like: Any) -> Any:
    """Temperature of particle i at time t [K]; zero when no law asks for it."""
    return stub()


@inline(temperature)
def _temperature(thermal: Any, i: Any, t: Any, like: Any) -> Impl:
    cast = like
    if isinstance(thermal, types.NoneType):
        return lambda thermal, i, t, like: cast(0)

    def impl(thermal: Any, i: Any, t: Any, like: Any) -> Any:
        excess = (thermal.start[i] - thermal.ambient) * np.exp(-thermal.rate * (t - thermal.birth[i]))
        return cast(thermal.ambient + excess)

    return impl


def fetch(c: Any, i: Any, t: Any) -> Any:
    """Particle i as the laws see it at time t."""
    return stub()


@inline(fetch)
def _fetch(c: Any, i: Any, t: Any) -> Impl:
    def impl(c: Any, i: Any, t: Any) -> Any:
        x, m = c.x[i], c.m[i]
        return Particle(
            x,
            c.y[i],
            c.z[i],
            c.vx[i],
            c.vy[i],
            c.vz[i],
            m,
            load(c.r, i, x),
            temperature(c.thermal, i, t, x),
            t,
            type_of(m, 1) / m,
        )

    return impl


def fetch_known(c: Any, inverse: Any, i: Any, t: Any) -> Any:
    """Particle i with its inverse mass from an array: division and square root share a slow unit."""
    return stub()


@inline(fetch_known)
def _fetch_known(c: Any, inverse: Any, i: Any, t: Any) -> Impl:
    def impl(c: Any, inverse: Any, i: Any, t: Any) -> Any:
        p = fetch(c, i, t)
        return Particle(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.m, p.r, p.T, p.t, inverse[i])

    return impl


def store(c: Any, i: Any, p: Any) -> Any:
    """Write position and velocity of particle i."""
    return stub()


@inline(store)
def _store(c: Any, i: Any, p: Any) -> Impl:
    def impl(c: Any, i: Any, p: Any) -> None:
        c.x[i] = p.x
        c.y[i] = p.y
        c.z[i] = p.z
        c.vx[i] = p.vx
        c.vy[i] = p.vy
        c.vz[i] = p.vz

    return impl


def chosen(condition: Any, p: Any, q: Any) -> Any:
    """Position and velocity of p where the condition holds, else of q: selects, not branches."""
    return stub()


@inline(chosen)
def _chosen(condition: Any, p: Any, q: Any) -> Impl:
    if isinstance(condition, types.BooleanLiteral | types.NoneType):
        return lambda condition, p, q: q
    return lambda condition, p, q: moved_to(
        q,
        p.x if condition else q.x,
        p.y if condition else q.y,
        p.z if condition else q.z,
        p.vx if condition else q.vx,
        p.vy if condition else q.vy,
        p.vz if condition else q.vz,
        q.t,
    )


def recall(memory: Any, i: Any) -> Any:
    """What the method remembers of particle i: element i of every array of the tuple."""
    return stub()


@inline(recall)
def _recall(memory: Any, i: Any) -> Impl:
    if len(memory) == 0:
        return lambda memory, i: ()
    return lambda memory, i: (memory[0][i], *recall(memory[1:], i))


def remember(memory: Any, i: Any, condition: Any, values: Any) -> Any:
    """Store element i of every array of the tuple where the condition holds."""
    return stub()


@inline(remember)
def _remember(memory: Any, i: Any, condition: Any, values: Any) -> Impl:
    if len(memory) == 0:
        return lambda memory, i, condition, values: None

    def impl(memory: Any, i: Any, condition: Any, values: Any) -> None:
        memory[0][i] = values[0] if condition else memory[0][i]
        remember(memory[1:], i, condition, values[1:])

    return impl


def span(clock: Any, i: Any, t: Any, end: Any, h: Any) -> Any:
    """Begin and length of the part of the step [t, end] in which particle i moves; a whole step has the length h."""
    return stub()


@inline(span)
def _span(clock: Any, i: Any, t: Any, end: Any, h: Any) -> Impl:
    if isinstance(clock, types.NoneType):
        return lambda clock, i, t, end, h: (t, h)

    def impl(clock: Any, i: Any, t: Any, end: Any, h: Any) -> Any:
        start, stop = clock.start[i], clock.stop[i]
        begin = max(t, start)
        length = max(min(end, stop) - begin, 0.0)
        whole = (start <= t) & (stop >= end)
        return begin, h if whole else type_of(h, length)

    return impl


def type_of(like: Any, value: Any) -> Any:
    """A value in the precision of `like`."""
    return stub()


@inline(type_of)
def _type_of(like: Any, value: Any) -> Impl:
    cast = like
    return lambda like, value: cast(value)


def note(clock: Any, i: Any, outcome: Any, t: Any) -> Any:
    """Stop the clock of a particle that stuck or died in contact at time t."""
    return stub()


@inline(note)
def _note(clock: Any, i: Any, outcome: Any, t: Any) -> Impl:
    if isinstance(clock, types.NoneType):
        return lambda clock, i, outcome, t: None

    def impl(clock: Any, i: Any, outcome: Any, t: Any) -> None:
        clock.start[i] = np.inf if outcome == STICK else clock.start[i]
        clock.stop[i] = t if outcome >= KILL else clock.stop[i]
        clock.outcome[i] = max(clock.outcome[i], np.int8(outcome))

    return impl


def still(clock: Any, h: Any) -> Any:
    """Whether a particle does not move in this step: not yet born, dead, stuck or pinned. None: no clock, it moves."""
    return stub()


@inline(still)
def _still(clock: Any, h: Any) -> Impl:
    if isinstance(clock, types.NoneType):
        return lambda clock, h: None
    return lambda clock, h: h <= 0


def unless(idle: Any, outcome: Any) -> Any:
    """The outcome of a contact, none for an idle particle."""
    return stub()


@inline(unless)
def _unless(idle: Any, outcome: Any) -> Impl:
    if isinstance(idle, types.NoneType):
        return lambda idle, outcome: outcome
    return lambda idle, outcome: PASS if idle else outcome


def held(clock: Any, i: Any) -> Any:
    """Whether particle i is pinned or stuck."""
    return stub()


@inline(held)
def _held(clock: Any, i: Any) -> Impl:
    if isinstance(clock, types.NoneType):
        return lambda clock, i: False
    return lambda clock, i: clock.start[i] == np.inf
