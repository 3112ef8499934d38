"""The block kernel: independent particles, which need not be at the same time, take all their steps block by block.

A block fits into the first-level cache, so an interval of many steps reads and writes main memory once.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import particlesim.engine.step.newton  # noqa: F401
from particlesim.compiler import kernel, outlined
from particlesim.engine.state.columns import (
    Columns,
    block_of,
    changing,
    chosen,
    fetch,
    fetch_known,
    held,
    keep,
    lifetimes,
    note,
    put_back,
    recall,
    remember,
    save,
    saved,
    span,
    still,
    store,
    tire,
    type_of,
    unless,
)
from particlesim.engine.step.at_rest import (
    keeps_still,
    overlapped,
    rest,
    rest_alone,
    rest_behind,
    stay,
    turning,
)
from particlesim.engine.step.clearance import (
    AWAY,
    are_kept,
    clearance,
    distance_of,
    foothold,
    holds,
    is_steady,
    keep_way,
    keeps_clear,
    leads_back,
    note_way,
    recall_way,
    repeats,
    sets_aside,
    stands,
    without_crossable,
)
from particlesim.engine.step.contacts import Simple, ends_inside, meet, pushed
from particlesim.engine.step.crossing import crossings, may_pass, passable, passed, thin
from particlesim.engine.step.hits import tell
from particlesim.engine.step.impacts import trace
from particlesim.engine.step.lateness import lags
from particlesim.engine.step.particle_step import Newtonian, advance, derivative, restart
from particlesim.laws.registry import PASS
from particlesim.model.arrays import zeros

IN_VAIN = 16
"""Steps for which a block in which nothing lay still is not searched for that again."""


def step_block(program: Any, c: Any, t: Any, end: Any, h: Any, inverse: Any, room: Any) -> None:
    """One step, from t to `end`, of all particles of a block. h is dt in the run's precision, `inverse` the
    inverse masses."""
    _step_block(program, c, t, end, h, inverse, room)
    if len(program.contacts.soft) > 0:
        _yield(program, c, t, end, h, inverse)
    if c.missed is not None and len(passable(program.contacts)) > 0:
        _watch(program, c, t, end, h, room)


def _yield(program: Any, c: Any, t: Any, end: Any, h: Any, inverse: Any) -> None:
    """What colliders that yield do to all particles of a block at the end of a step."""
    for i in range(c.x.size):
        _, hi = span(c.clock, i, t, end, h)
        q = fetch_known(c, inverse, i, end)
        r = pushed(program.contacts.soft, q, hi)
        touched = (r.vx != q.vx) | (r.vy != q.vy) | (r.vz != q.vz)
        store(c, i, chosen(still(c.clock, hi), q, r))
        remember(c.memory, i, touched, restart(recall(c.memory, i)))


def _watch(program: Any, c: Any, t: Any, end: Any, h: Any, room: Any) -> None:
    """Count the colliders that particles of a block have passed in a step without being seen."""
    found = False
    for i in range(c.x.size):
        begin, hi = span(c.clock, i, t, end, h)
        q = fetch(c, i, end)
        p = saved(room.before, i, q, begin)
        looks = may_pass(program.contacts, p, q, hi) & (hi > 0)
        room.marks[i] = mark(c, looks)
        found |= looks
    if found:
        for i in range(c.x.size):
            if room.marks[i] > 0:
                begin, hi = span(c.clock, i, t, end, h)
                q = fetch(c, i, end)
                c.missed[i] += crossings(program.contacts, saved(room.before, i, q, begin), q, hi)


def _step_block(program: Any, c: Any, t: Any, end: Any, h: Any, inverse: Any, room: Any) -> None:
    if isinstance(program.contacts, Simple):
        for i in range(c.x.size):
            begin, hi = span(c.clock, i, t, end, h)
            p = fetch_known(c, inverse, i, begin)
            if c.missed is not None:
                save(room.before, i, p)
            q, memory = advance(program.method, program.dynamics, program.forces, p, hi, recall(c.memory, i))
            r, outcome = meet(program.contacts.colliders, q)
            idle = still(c.clock, hi)
            store(c, i, chosen(idle, p, r))
            touched = (r.vx != q.vx) | (r.vy != q.vy) | (r.vz != q.vz)
            remember(c.memory, i, not touched, memory)
            remember(c.memory, i, touched, restart(memory))
            note(c.clock, i, unless(idle, outcome), end)
        return
    meets, aside = _fly(program, c, t, end, h, inverse, room)
    if meets:
        _meet(program, c, t, end, h, inverse, room, MEETS)
    if sets_aside(program.contacts, c.memory) and aside:
        _meet(without_crossable(program), c, t, end, h, inverse, room, ASIDE)


MEETS, ASIDE = 1, 2
"""Marks of particles that meet a collider in a step, and of those that meet none that a way may cross."""


def mark(c: Any, condition: Any, which: int = MEETS) -> Any:
    """A mark in the precision of the columns: vectors of flags are slow to pack and unpack."""
    x = c.x[0]
    return type_of(x, which) if condition else type_of(x, 0)


def _fly(program: Any, c: Any, t: Any, end: Any, h: Any, inverse: Any, room: Any) -> tuple[bool, bool]:
    """The free step of all particles of a block; those that meet a collider are marked. Returns whether there are any, and
    whether some of them are set aside."""
    found, some = False, False
    clear, parts = keeps_clear(program.contacts, c.memory), sets_aside(program.contacts, c.memory)
    for i in range(c.x.size):
        begin, hi = span(c.clock, i, t, end, h)
        p = fetch_known(c, inverse, i, begin)
        q, memory = advance(program.method, program.dynamics, program.forces, p, hi, recall(c.memory, i))
        free, aside = q, False
        if clear:
            strikes = ends_inside(program.contacts, q)
            way = _way(p, q, hi, strikes & parts)
            room.clear[i] -= way
            meets = not room.clear[i] > 0
            aside = strikes & (not meets) & parts & (hi > 0)
            meets |= strikes & (not parts)
            if holds(program.contacts):
                firm = stands(room.foothold, i, p, q)
                room.foothold[3, i] = room.foothold[3, i] if firm else -type_of(way, 1)
                q, meets, aside = chosen(firm, p, q), meets & (not firm), aside & (not firm)
        else:
            meets = overlapped(program.contacts, p, q, hi)
        if repeats(program.contacts, c.memory):
            back = leads_back(room.ways, i, free, t)
            room.ways[6, i] = end if back else room.ways[6, i]
            q, meets, aside = chosen(back, p, q), meets & (not back), aside & (not back)
        meets &= hi > 0
        room.marks[i] = mark(c, meets) + mark(c, aside, ASIDE)
        found |= meets
        some |= aside
        save(room.before, i, p)
        store(c, i, chosen(still(c.clock, hi), p, q))
        remember(c.memory, i, not meets, memory)
    if clear and found:
        found, more = _look(program, c, t, end, h, room)
        some |= more
    return found, some


def _way(p: Any, q: Any, h: Any, strikes: Any) -> Any:
    """How far a particle may go at most in a step from p to q, also if it strikes a plane [m]."""
    way = distance_of(p, q, h)
    return type_of(way, AWAY) * way if strikes else way


def _look(program: Any, c: Any, t: Any, end: Any, h: Any, room: Any) -> tuple[bool, bool]:
    """How far the particles that are marked to meet something were from colliders; those that were farther than they go do
    not, or are set aside. Returns whether others are left, and whether some are set aside."""
    left, some = False, False
    parts = sets_aside(program.contacts, c.memory)
    for i in range(c.x.size):
        if room.marks[i] == MEETS:
            begin, hi = span(c.clock, i, t, end, h)
            q = fetch(c, i, end)
            p = saved(room.before, i, q, begin)
            strikes = ends_inside(program.contacts, q)
            way = _way(p, q, hi, strikes & parts)
            ahead = clearance(program.contacts, p, way) - way
            meets = (not ahead > 0) | (strikes & (not parts))
            aside = strikes & (not meets)
            room.clear[i] = type_of(way, 0) if meets else ahead
            if holds(program.contacts) and meets:
                meets = not _step_on(program, c, i, p, q, room)
            room.marks[i] = mark(c, meets) + mark(c, aside, ASIDE)
            left |= meets
            some |= aside
    return left, some


@outlined
def _step_on(program: Any, c: Any, i: Any, p: Any, q: Any, room: Any) -> bool:
    """Whether friction holds particle i at p, where it touches a collider; its step then ends there."""
    if not ((p.vx == 0) & (p.vy == 0) & (p.vz == 0)):
        return False
    for row, number in enumerate(foothold(program.contacts, p)):
        room.foothold[row, i] = number
    firm = stands(room.foothold, i, p, q)
    if firm:
        store(c, i, p)
    else:
        room.foothold[3, i] = -type_of(p.x, 1)
    return firm


def _meet(program: Any, c: Any, t: Any, end: Any, h: Any, inverse: Any, room: Any, which: int) -> None:
    """The step of the particles with this mark: in vectors of those that rest on colliders, one by one of others."""
    if _rest(program, c, t, end, h, room, which):
        _hit(program, c, t, end, h, inverse, room, which)


def _rest(program: Any, c: Any, t: Any, end: Any, h: Any, room: Any, which: int) -> bool:
    """The step of the marked particles that rest on colliders, which then are no longer marked. Returns whether others are
    left."""
    behind = lags(program.method) and turning(program.contacts)
    if behind and len(c.memory) > 0:
        return True  # what the method remembers is not known here
    if keeps_still(program.contacts):
        if room.wait[0] > 0:
            room.wait[0] -= 1
        else:
            left, lain = _lie(program, c, t, end, h, room, _stay, which)
            if not left:
                return False
            if not lain:
                room.wait[0] = IN_VAIN
    return _lie(program, c, t, end, h, room, _behind if behind else _calm, which)[0]


def _stay(program: Any, p: Any, q: Any, h: Any) -> Any:
    return stay(program.contacts, p, q, h)


def _behind(program: Any, p: Any, q: Any, h: Any) -> Any:
    return rest_behind(program.forces, program.contacts, p, q, h)


def _calm(program: Any, p: Any, q: Any, h: Any) -> Any:
    alone = program.contacts.one_by_one is not None
    return rest_alone(program.contacts, p, q, h) if alone else rest(program.contacts, p, q, h)


def _lie(
    program: Any, c: Any, t: Any, end: Any, h: Any, room: Any, look: Any, which: int
) -> tuple[bool, bool]:
    """The step of the marked particles that lie on colliders as a `look` says, which then are no longer marked. Returns
    whether others are left, and whether there were any."""
    left, lain = False, False
    for i in range(c.x.size):
        if program.contacts.one_by_one is not None and room.marks[i] != which:
            continue
        begin, hi = span(c.clock, i, t, end, h)
        q = fetch(c, i, end)
        p = saved(room.before, i, q, begin)
        if len(program.contacts.continuous) > 0:
            r, calm = look(program, p, q, hi)
        else:
            r, calm = q, False
        marked = room.marks[i] == which
        lies, hits = marked & calm, marked & (not calm)
        room.marks[i] = mark(c, False) if lies else room.marks[i]
        left |= hits
        lain |= lies
        store(c, i, chosen(lies, r, q))
        remember(c.memory, i, lies, restart(recall(c.memory, i)))
        if repeats(program.contacts, c.memory) and lies:
            note_way(room.ways, i, p, q, r, end)
    return left, lain


def _hit(program: Any, c: Any, t: Any, end: Any, h: Any, inverse: Any, room: Any, which: int) -> None:
    """The step of the particles with this mark from impact to impact, one by one."""
    for i in range(c.x.size):
        if room.marks[i] == which:
            begin, hi = span(c.clock, i, t, end, h)
            p = saved(room.before, i, fetch_known(c, inverse, i, begin), begin)
            free = fetch(c, i, end)
            q, memory, outcome, hit, exhausted, _ = trace(
                program.method,
                program.dynamics,
                program.forces,
                program.contacts,
                p,
                hi,
                recall(c.memory, i),
            )
            if c.missed is not None and len(thin(program.contacts)) > 0:
                c.missed[i] += passed(program.contacts, p, q, hi)
            store(c, i, q)
            remember(c.memory, i, True, memory)
            note(c.clock, i, outcome, q.t)
            tell(c.hit, i, hit)
            tire(c, i, exhausted)
            if repeats(program.contacts, c.memory) and outcome == PASS:
                note_way(room.ways, i, p, free, q, end)


def first_moved(c: Any, before: Any, begin: Any) -> Any:
    """The first particle of a block, from one on, that a step has not led back to where it began, and as fast; −1 if there
    is none."""
    i = begin
    while i < c.x.size:
        same = (c.x[i] == before[0, i]) & (c.y[i] == before[1, i]) & (c.z[i] == before[2, i])
        if not (same & (c.vx[i] == before[3, i]) & (c.vy[i] == before[4, i]) & (c.vz[i] == before[5, i])):
            return i
        i += 1
    return -1


def refresh(program: Any, c: Any, t: Any) -> None:
    """Give particles without inertia the velocity of their place, for the record; others have it already."""
    if isinstance(program.dynamics, Newtonian):
        return
    for i in range(c.x.size):
        rate = derivative(program.dynamics, program.forces, fetch(c, i, t))
        fixed = held(c.clock, i)
        c.vx[i] = type_of(c.x[i], 0 if fixed else rate.x)
        c.vy[i] = type_of(c.x[i], 0 if fixed else rate.y)
        c.vz[i] = type_of(c.x[i], 0 if fixed else rate.z)


class Room(NamedTuple):
    """What a thread remembers of a block: its state at the beginning as `keep` has it, inverse masses [block], and of the
    present step marks [block], 1 or 0, and the beginning [6, block]; how far each is from colliders at least [block]; for
    how many steps nothing is looked for that lies still [1]; what each that stands still stands on, as `foothold` has
    it [5, block]; the free step that led each back to where it was, as `note_way` has it [7, block]."""

    kept: NDArray[np.float64]
    marks: NDArray[np.floating[Any]]
    inverse: NDArray[np.floating[Any]]
    before: NDArray[np.floating[Any]]
    clear: NDArray[np.floating[Any]]
    wait: NDArray[np.floating[Any]]
    foothold: NDArray[np.floating[Any]]
    ways: NDArray[np.float64]


def new_room(columns: Columns, block: int) -> Room:
    """Room for a block of some columns."""
    x, m = columns.x.dtype, columns.m.dtype
    return Room(
        zeros((len(changing(columns)), block), np.float64),
        zeros((block,), x),
        zeros((block,), m),
        zeros((6, block), x),
        zeros((block,), x),
        zeros((1,), x),
        zeros((5, block), x),
        zeros((7, block), np.float64),
    )


@kernel
def step_range(
    program: Any,
    columns: Any,
    first_step: Any,
    steps: Any,
    dt: Any,
    first: Any,
    last: Any,
    block: Any,
    faults: Any,
    room: Any,
    rested: Any = None,
    steady: bool = False,
) -> None:
    """Advance particles [first, last) by `steps` steps of dt, the first of which begins at first_step · dt.

    A block in which a number stops being finite is put back to its state at the beginning, and faults[k] is set for its
    first particle k, so that the caller can look for the step and the particle. `room` is that of `new_room` for these
    columns and this block, one for every thread; `rested` [14, n]: what is kept of every particle from one interval to the
    next (`lasts`), None if nothing is. `steady`: forces are the same in all steps, so that the steps of a block in which
    one has moved nothing are over, where contact does the same in all of them, too.
    """
    kept, inverse = room.kept, room.inverse
    for lo in range(first, last, block):
        c = block_of(columns, lo, min(last, lo + block))
        n = c.x.size
        h = type_of(c.x[0], dt)
        for i in range(n):
            keep(c, kept, i)
            inverse[i] = type_of(c.m[i], 1) / c.m[i]
            room.clear[i] = type_of(c.m[i], 0)
            room.foothold[3, i] = -type_of(c.m[i], 1)
            room.ways[6, i] = -np.inf
        some = False
        if rested is not None:
            some = are_kept(rested[:, lo : lo + n])
            if some:
                for i in range(n):
                    recall_way(room.ways, i, rested[:, lo : lo + n], c, first_step * dt)
        room.wait[0] = type_of(c.m[0], 0)
        born, gone = lifetimes(c.clock)
        last_step, moved = (first_step + steps) * dt, 0
        for s in range(steps):
            begin, end = (first_step + s) * dt, (first_step + s + 1) * dt
            if end > born and begin < gone:
                step_block(program, c, begin, end, h, inverse, room)
            if is_steady(program.contacts, c.memory) and c.clock is None and steady:
                # what has moved last is looked at first
                if first_moved(c, room.before, moved) != moved:
                    moved = first_moved(c, room.before, 0)
                if moved < 0:
                    for i in range(n):
                        room.ways[6, i] = last_step if room.ways[6, i] == end else room.ways[6, i]
                    break
        refresh(program, c, (first_step + steps) * dt)
        broken = False
        for i in range(n):
            # x − x is 0 for every finite x, NaN otherwise
            drop = (c.x[i] - c.x[i]) + (c.y[i] - c.y[i]) + (c.z[i] - c.z[i])
            drop += (c.vx[i] - c.vx[i]) + (c.vy[i] - c.vy[i]) + (c.vz[i] - c.vz[i])
            broken |= drop != 0
        if rested is not None:
            for i in range(n):
                some |= room.ways[6, i] == (first_step + steps) * dt
            if some:
                for i in range(n):
                    keep_way(room.ways, i, rested[:, lo : lo + n], c, (first_step + steps) * dt)
        if broken:
            faults[lo] = True
            for i in range(n):
                put_back(c, kept, i)
