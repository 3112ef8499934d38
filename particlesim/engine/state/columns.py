"""How kernels read and write particles: columns of numbers, some of them optional.

A column that a program does not use is None, and the compiler drops everything that would have read it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from particlesim.engine.state.table import CHANGING
from particlesim.laws.registry import KILL, PASS, STICK, Particle, further, moved_to


class Thermal(NamedTuple):
    """Newton cooling in closed form: T(t) = T_a + (T_0 − T_a) exp(−rate (t − birth)); rate and T_a are numbers, or arrays
    where groups that step together cool differently."""

    start: Any
    birth: Any
    rate: Any
    ambient: Any


class Clock(NamedTuple):
    """When each particle moves: from `start` to `stop` [s]; `outcome` says what a contact did to it.

    Births and deaths of an interval of many steps are in these two: particles that are born in it wait for their `start`
    from its beginning, and the dead stay until its end. What acts on them has no effect, as they do not move, and they act
    on others as far as they are there (`presence`). Pinned and stuck particles, whose `start` is infinite, act as all
    others do. `begin` and `end` are those of the present step [s] where particles step together (`in_step`), else None.
    `stuck`: when each has stuck [s], None where nobody asks.
    """

    start: Any
    stop: Any
    outcome: Any
    begin: Any = None
    end: Any = None
    stuck: Any = None


class Spin(NamedTuple):
    """The angular velocity of spheres [rad/s], and the angle by which each has turned since its step began [rad], which is
    zero between steps: contacts need it for rolling within the step."""

    wx: Any
    wy: Any
    wz: Any
    ax: Any
    ay: Any
    az: Any


class Columns(NamedTuple):
    """The arrays of a group, or their slices for a block. `further` are further attributes in the order of their table,
    each None where no law reads it; `spin` is None where particles do not turn; `missed` how many colliders a particle has
    passed unseen, None where none can be; `exhausted` in how many steps it had more impacts than are followed, None where
    none are; `hit` the first impact of the present step, in the order of `HIT`, empty where no
    emitter reacts to it."""

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
    further: tuple[Any, ...] = ()
    spin: Any = None
    missed: Any = None
    exhausted: Any = None
    hit: tuple[Any, ...] = ()


def cut(column: Any, first: Any, last: Any) -> Any:
    """Elements [first, last) of an array, or what all have in common, None or a number."""
    return column[first:last] if isinstance(column, np.ndarray) else column


def block_of(c: Any, lo: Any, hi: Any) -> Any:
    """The columns of particles [lo, hi)."""
    if not isinstance(c, tuple):
        return cut(c, lo, hi)
    parts = tuple(block_of(each, lo, hi) for each in c)
    return parts if type(c) is tuple else type(c)(*parts)


def arrays_in(c: Any) -> Any:
    """All arrays of some columns, one after the other."""
    if isinstance(c, np.ndarray):
        return (c,)
    if not isinstance(c, tuple) or len(c) == 0:
        return ()
    return arrays_in(c[0]) + arrays_in(c[1:])


CHANGED = tuple(Columns._fields.index(name) for name in CHANGING)


def changing(c: Any) -> Any:
    """The arrays that a step may change."""
    return arrays_in(tuple(c[k] for k in CHANGED))


def keep(c: Any, kept: Any, i: Any) -> None:
    """Copy what a step changes in particle i to column i of `kept`, a float64 row for every array of `changing`."""
    for row, array in enumerate(changing(c)):
        kept[row, i] = array[i]


def put_back(c: Any, kept: Any, i: Any) -> None:
    """Give particle i back what `keep` copied."""
    for row, array in enumerate(changing(c)):
        array[i] = kept[row, i]


def mapped(function: Callable[[Any], Any], c: Any) -> Any:
    """Columns with every array made another by a function; not for kernels."""
    if isinstance(c, np.ndarray):
        return function(c)
    if not isinstance(c, tuple):
        return c
    parts = [mapped(function, each) for each in c]
    return tuple(parts) if type(c) is tuple else type(c)(*parts)


def copied(c: Columns) -> Columns:
    """Columns with all that a step changes copied."""
    return c._replace(**{name: mapped(np.copy, getattr(c, name)) for name in CHANGING})


def replaced(c: Columns, arrays: Iterator[Any]) -> Columns:
    """Columns with the next of other arrays in place of each that a step changes, in the order of `changing`."""
    return c._replace(**{name: mapped(lambda _: next(arrays), getattr(c, name)) for name in CHANGING})


def load(column: Any, i: Any, like: Any) -> Any:
    """Value of an optional column; zero in the precision of `like` when it is absent."""
    return type_of(like, 0) if column is None else column[i]


def element(column: Any, i: Any) -> Any:
    """Element i of an array, or the number that all share."""
    return column[i] if isinstance(column, np.ndarray) else column


def temperature(thermal: Any, i: Any, t: Any, like: Any) -> Any:
    """Temperature of particle i at time t [K]; zero when no law asks for it."""
    if thermal is None:
        return type_of(like, 0)
    rate, ambient = element(thermal.rate, i), element(thermal.ambient, i)
    excess = (thermal.start[i] - ambient) * np.exp(-rate * (t - thermal.birth[i]))
    return type_of(like, ambient + excess)


def fetch(c: Any, i: Any, t: Any) -> Any:
    """Particle i as the laws see it at time t."""
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
        *[load(column, i, x) for column in c.further],
    )


def fetch_known(c: Any, inverse: Any, i: Any, t: Any) -> Any:
    """Particle i with its inverse mass from an array: division and square root share a slow unit."""
    p = fetch(c, i, t)
    return Particle(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.m, p.r, p.T, p.t, inverse[i], *further(p))


def motion(c: Any) -> Any:
    """Columns of position and velocity, and where particles spin of the angle and the angular velocity."""
    moves = (c.x, c.y, c.z, c.vx, c.vy, c.vz)
    if c.spin is None:
        return moves
    s = c.spin
    return (*moves, s.ax, s.ay, s.az, s.wx, s.wy, s.wz)


def store(c: Any, i: Any, p: Any) -> None:
    """Write position and velocity of particle i."""
    c.x[i] = p.x
    c.y[i] = p.y
    c.z[i] = p.z
    c.vx[i] = p.vx
    c.vy[i] = p.vy
    c.vz[i] = p.vz


def save(rows: Any, i: Any, p: Any) -> None:
    """Position and velocity of a particle to column i of rows [6, n]."""
    rows[0, i], rows[1, i], rows[2, i] = p.x, p.y, p.z
    rows[3, i], rows[4, i], rows[5, i] = p.vx, p.vy, p.vz


def saved(rows: Any, i: Any, p: Any, t: Any) -> Any:
    """The particle as column i of rows has it, at time t."""
    return moved_to(p, rows[0, i], rows[1, i], rows[2, i], rows[3, i], rows[4, i], rows[5, i], t)


def chosen(condition: Any, p: Any, q: Any) -> Any:
    """Position and velocity of p where the condition holds, else of q: selects, not branches."""
    if condition is None:
        return q
    return moved_to(
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
    """The method's memory of particle i: element i of every array of the tuple."""
    return tuple(array[i] for array in memory)


STORMER = 4
"""How many numbers Störmer's rule remembers: a velocity, and the step with which it came about."""


def let_know(memory: Any, i: Any, x: Any, y: Any, z: Any) -> None:
    """Let a method know that something at the end of a step has changed the velocity of particle i by so much [m/s].
    Störmer's rule goes on with it: where it began again in each step, springs would gain energy, and where it did so at one
    end of a spring alone momentum. Others begin again."""
    if len(memory) == STORMER:
        memory[0][i] += type_of(memory[0][i], x)
        memory[1][i] += type_of(memory[1][i], y)
        memory[2][i] += type_of(memory[2][i], z)
    elif len(memory) > 0:
        memory[-1][i] = 0


def remember(memory: Any, i: Any, condition: Any, values: Any) -> None:
    """Store element i of every array of the tuple where the condition holds."""
    for array, value in zip(memory, values, strict=True):
        array[i] = value if condition else array[i]


def span(clock: Any, i: Any, t: Any, end: Any, h: Any) -> Any:
    """Begin and length of the part of the step [t, end] in which particle i moves; a whole step has the length h."""
    if clock is None:
        return t, h
    start, stop = clock.start[i], clock.stop[i]
    begin = max(t, start)
    length = max(min(end, stop) - begin, 0.0)
    whole = (start <= t) & (stop >= end)
    return begin, h if whole else type_of(h, length)


def lifetimes(clock: Any) -> Any:
    """When the first of some particles begins to move, and when the last one ends. Those of an emitter stand in the order of
    their births, so that most of them can be left alone until then."""
    if clock is None:
        return -np.inf, np.inf
    born, gone = np.inf, -np.inf
    for i in range(clock.start.size):
        born = min(born, clock.start[i])
        gone = max(gone, clock.stop[i])
    return born, gone


def in_step(c: Any, begin: Any, end: Any) -> Any:
    """Columns in the step from `begin` to `end`, or at one moment if these are the same."""
    if c.clock is None:
        return c
    clock = Clock(c.clock.start, c.clock.stop, c.clock.outcome, begin, end, c.clock.stuck)
    return Columns(
        c.x,
        c.y,
        c.z,
        c.vx,
        c.vy,
        c.vz,
        c.m,
        c.r,
        c.thermal,
        clock,
        c.memory,
        c.further,
        c.spin,
        c.missed,
        c.exhausted,
        c.hit,
    )


def presence(clock: Any, i: Any) -> Any:
    """The part of the present step in which particle i is there, 0 to 1: others feel its force times that.

    As particle j takes the impulse of that part of the step in which it is there itself, the impulses that two give each
    other are opposite also in steps in which one of them is born or dies, and right to second order in the step.
    """
    if clock is None or clock.begin is None:
        return 1.0
    begin, end, stop = clock.begin, clock.end, clock.stop[i]
    first = begin if clock.start[i] == np.inf else max(begin, clock.start[i])
    whole = (first <= begin) & (stop >= end) & (stop > begin)
    length = max(min(stop, end) - first, 0.0)
    return 1.0 if whole else (length / (end - begin) if end > begin else 0.0)


def rests(clock: Any, i: Any) -> Any:
    """Whether particle i does not move at all in the present step: pinned, stuck, or not there."""
    return False if clock is None else (clock.start[i] == np.inf) | (presence(clock, i) == 0)


def type_of(like: Any, value: Any) -> Any:
    """A value in the precision of `like`."""
    return type(like)(value)


def note(clock: Any, i: Any, outcome: Any, t: Any) -> None:
    """Stop the clock of a particle that stuck or died in contact at time t."""
    if clock is None:
        return
    clock.start[i] = np.inf if outcome == STICK else clock.start[i]
    if clock.stuck is not None:
        clock.stuck[i] = t if outcome == STICK else clock.stuck[i]
    clock.stop[i] = t if outcome >= KILL else clock.stop[i]
    clock.outcome[i] = max(clock.outcome[i], outcome)


def stop_turning(c: Any, i: Any, outcome: Any) -> None:
    """End the rotation of a particle that stuck: it would go on for ever, and drive all that rubs on it."""
    if c.spin is not None and outcome == STICK:
        zero = c.spin.wx[i] - c.spin.wx[i]
        c.spin.wx[i], c.spin.wy[i], c.spin.wz[i] = zero, zero, zero


def tire(c: Any, i: Any, exhausted: Any) -> None:
    """Count a step in which particle i had more impacts than are followed."""
    if c.exhausted is not None:
        c.exhausted[i] += exhausted


def still(clock: Any, h: Any) -> Any:
    """Whether a particle does not move in this step: not yet born, dead, stuck or pinned. None: no clock, it moves."""
    return None if clock is None else h <= 0


def unless(idle: Any, outcome: Any) -> Any:
    """The outcome of a contact, none for an idle particle."""
    if idle is None:
        return outcome
    return PASS if idle else outcome


def held(clock: Any, i: Any) -> Any:
    """Whether particle i is pinned or stuck."""
    return False if clock is None else clock.start[i] == np.inf
