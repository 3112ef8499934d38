"""Contacts of particles that step together, at the end of a step."""

from __future__ import annotations

from typing import Any

from particlesim.colliders.response import crossable
from particlesim.compiler import outlined
from particlesim.engine.coupled.again import end_of, is_same, keep_end, worthwhile
from particlesim.engine.coupled.rebounds import note_rebound
from particlesim.engine.state.columns import (
    block_of,
    fetch,
    let_know,
    note,
    span,
    stop_turning,
    store,
    tire,
    type_of,
)
from particlesim.engine.step.at_rest import overlapped, respond, turning
from particlesim.engine.step.contacts import Careful, Simple, late_contacts, nearest, pushed
from particlesim.engine.step.crossing import crossings, passable, passed, thin
from particlesim.engine.step.hits import tell
from particlesim.engine.step.impacts import BOUNCED, LANDED, NOTHING, trace
from particlesim.engine.step.lateness import (
    along_contacts,
    hastened,
    lateness,
    way_between,
    with_places,
)
from particlesim.engine.step.particle_step import BentRecord, Newtonian
from particlesim.engine.step.program import BLOCK
from particlesim.engine.step.rubbing import rubbed
from particlesim.laws.registry import PASS, Particle, further, moved_to


def forget(memory: Any, i: Any) -> None:
    """Invalidate the method's memory of particle i."""
    if len(memory) > 0:
        memory[-1][i] = 0


def nudge(memory: Any, i: Any, q: Any, r: Any) -> None:
    """Let the method's memory of particle i know that it lies on something, and ends its step with the velocity of r instead
    of that of q."""
    let_know(memory, i, r.vx - q.vx, r.vy - q.vy, r.vz - q.vz)


def collide(
    parts: Any,
    c: Any,
    before: Any,
    share: Any,
    t: Any,
    end: Any,
    h: Any,
    rebounds: Any = None,
    kept: Any = None,
    held: Any = None,
) -> None:
    """Contacts at the end of a step; with `rebounds`, those that bounce are listed there; `kept`: what the step before has
    led to (`again`), None where that is not kept; `held`: not 0 of those that have been held back in the step already,
    and 1 of those that are now, None where it does not matter.

    A particle that ends inside a collider is followed from impact to impact on the parabola from the beginning of the step
    to where its method has led it. With another path, particles that lie on a collider would oscillate with growing
    amplitude.
    """
    if rebounds is not None:
        share.struck[8 * share.number] = 0
    for part in parts:
        hard = not isinstance(part.contacts, Simple) or len(part.contacts.colliders) > 0
        if hard or len(part.contacts.soft) > 0:
            first, last = max(share.first, part.first), min(share.last, part.last)
            rubs = (part.rubbing, part.rolling)
            _collide(
                part.contacts, rubs, c, before, first, last, t, end, h, False, share, rebounds, kept, held
            )
        if part.cores is not None:
            first, last = max(share.first, part.first), min(share.last, part.last)
            for lo in range(first, last, BLOCK):
                hi = min(lo + BLOCK, last)
                if is_deep(part.cores, block_of(c, lo, hi), end):
                    _collide(
                        part.cores, ((), None), c, before, lo, hi, t, end, h, True, share, None, None, None
                    )


def core_of(p: Any) -> Any:
    """The hard core of a soft particle: half of its radius. One that is too fast for its law, or pressed too hard, gets that
    far into a collider and no further."""
    return Particle(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.m, type_of(p.r, 0.5) * p.r, p.T, p.t, p.w, *further(p))


def came_from(before: Any, i: Any, q: Any, begin: Any) -> Any:
    """Where a step to q began."""
    return moved_to(
        q, before[0, i], before[1, i], before[2, i], before[3, i], before[4, i], before[5, i], begin
    )


def leapt(memory: Any, i: Any, p: Any, q: Any) -> Any:
    """The beginning p of a step to q with the velocity that its method has begun with, where it remembers that in the middle
    of the step."""
    ux, uy, uz = memory[0][i], memory[1][i], memory[2][i]
    return moved_to(p, p.x, p.y, p.z, ux + ux - q.vx, uy + uy - q.vy, uz + uz - q.vz, p.t)


def quick(rebounds: Any, p: Any, q: Any, h: Any) -> Any:
    """Whether what goes from p to q in a step is too fast to lie on others."""
    if rebounds is None or rebounds.slow is None:
        return rebounds is not None
    x, y, z = q.vx - p.vx, q.vy - p.vy, q.vz - p.vz
    least = type_of(h, rebounds.slow * rebounds.slow) * (x * x + y * y + z * z)
    return p.vx * p.vx + p.vy * p.vy + p.vz * p.vz >= least


def creeps(rebounds: Any, p: Any, q: Any) -> Any:
    """Whether what may lie on others is slower than forces make it in a step from p to q: what presses it is not known, and
    what its velocity is late by is next to nothing where it rests."""
    if rebounds.slow is None:
        return False
    x, y, z = q.vx - p.vx, q.vy - p.vy, q.vz - p.vz
    return p.vx * p.vx + p.vy * p.vy + p.vz * p.vz < x * x + y * y + z * z


@outlined
def _caught_up(contacts: Any, rebounds: Any, share: Any, i: Any, p: Any, q: Any, h: Any, kept: Any) -> Any:
    """The step of particle i from p to q with velocities half a step behind, as one with the velocities of its places; what
    `trace` tells of it."""
    half = type_of(h, 0.5)
    a = half * (q.vx - p.vx), half * (q.vy - p.vy), half * (q.vz - p.vz)
    late, lay = along_contacts(contacts, p, a, False)
    begun, end, late = with_places(p, q, a, late, h)
    way, zero = way_between(begun, end, h), h - h
    on = BentRecord(way.turn, way.bend, (zero, zero, zero))
    r, outcome, hit, exhausted, struck = _followed(on, contacts, begun, end, h, kept, i)
    rebounds.lies[i] = struck != BOUNCED
    if struck == BOUNCED:
        late = a
    elif lay or struck == LANDED:
        # what it will begin the next step with
        late, _ = along_contacts(contacts, r, a, False)
    if struck != NOTHING:
        note_rebound(rebounds, share, i, BentRecord(way.turn, way.bend, a), q)
    return hastened(r, (-late[0], -late[1], -late[2])), outcome, hit, exhausted


def _followed(on: Any, contacts: Any, p: Any, q: Any, h: Any, kept: Any, i: Any) -> Any:
    """What `trace` tells of the step of particle i from p, which would lead to q without contact."""
    if kept is None or not worthwhile(contacts):
        r, _, outcome, hit, exhausted, struck = trace(on, Newtonian(), (), contacts, p, h, ())
        return r, outcome, hit, exhausted, struck
    if is_same(kept, i, p, q):
        r, struck = end_of(kept, i, q)
        outcome, hit, exhausted = PASS, None, False
    else:
        r, _, outcome, hit, exhausted, struck = trace(on, Newtonian(), (), contacts, p, h, ())
        if (outcome == PASS) & (not exhausted):
            keep_end(kept, i, p, q, r, struck)
    return r, outcome, hit, exhausted, struck


def is_other(q: Any, r: Any) -> bool:
    """Whether a particle ends its step otherwise."""
    moved = (r.x != q.x) | (r.y != q.y) | (r.z != q.z)
    return bool(moved | (r.vx != q.vx) | (r.vy != q.vy) | (r.vz != q.vz))


def is_deep(contacts: Any, q: Any, t: Any) -> Any:
    """Whether the core of some particle of a block may be in a collider, or behind a thin one."""
    if isinstance(contacts, Careful) and (
        contacts.one_by_one is not None or any(crossable(each) for each in contacts.continuous)
    ):
        return True
    colliders = (
        contacts.colliders if isinstance(contacts, Simple) else contacts.continuous + contacts.discrete
    )
    deep = False
    for i in range(q.x.size):
        deep |= nearest(colliders, core_of(fetch(q, i, t))) < 0
    return deep


def _collide(
    contacts: Any,
    rubs: Any,
    c: Any,
    before: Any,
    first: Any,
    last: Any,
    t: Any,
    end: Any,
    h: Any,
    soft: Any,
    share: Any,
    rebounds: Any,
    kept: Any,
    held: Any,
) -> None:
    """`collide` for particles [first, last), which meet the same colliders; for the cores of those that are `soft`. `rubs`:
    colliders with friction of those that turn, and rolling friction."""
    rubbing, rolling = rubs
    for i in range(first, last):
        begin, hi = span(c.clock, i, t, end, h)
        if rebounds is not None:
            rebounds.lies[i] = False
        if hi > 0 and (held is None or held[i] == 0):
            q = core_of(fetch(c, i, end)) if soft else fetch(c, i, end)
            p = came_from(before, i, q, begin)
            if overlapped(contacts, p, q, hi):
                behind = rebounds is not None and rebounds.behind is not None and turning(contacts)
                if behind and not creeps(rebounds, p, q):
                    r, outcome, hit, exhausted = _caught_up(contacts, rebounds, share, i, p, q, hi, kept)
                    forget(c.memory, i)
                else:
                    leaps = rebounds is not None and rebounds.between is not None
                    begun = leapt(c.memory, i, p, q) if leaps else p
                    way, known = way_between(begun, q, hi), quick(rebounds, begun, q, hi)
                    late = None if rebounds is None else lateness(way, hi, known)
                    on = BentRecord(way.turn, way.bend, late)
                    held_by = late_contacts(contacts) if behind else contacts
                    r, outcome, hit, exhausted, struck = _followed(on, held_by, begun, q, hi, kept, i)
                    if rebounds is not None:
                        rebounds.lies[i] = struck != BOUNCED
                        landed = (struck == LANDED) & (rebounds.begun != 0)
                        if known and (struck == BOUNCED or landed):
                            note_rebound(rebounds, share, i, on, q)
                    if leaps and struck != BOUNCED:
                        nudge(c.memory, i, q, r)
                    else:
                        forget(c.memory, i)
                if c.missed is not None and len(thin(contacts)) > 0:
                    c.missed[i] += passed(contacts, p, r, hi)
                tell(c.hit, i, hit)
                tire(c, i, exhausted)
            else:
                r, outcome = respond(contacts, q)
                if r.vx != q.vx or r.vy != q.vy or r.vz != q.vz:
                    forget(c.memory, i)
            if len(rubbing) > 0 and c.spin is not None:
                free = r
                r = rubbed(rubbing, rolling, c, i, p, q, free, hi)
                if rebounds is not None and rebounds.between is not None:
                    nudge(c.memory, i, free, r)
            if len(contacts.soft) > 0:
                free = r
                r = pushed(contacts.soft, free, hi)
                if r.vx != free.vx or r.vy != free.vy or r.vz != free.vz:
                    forget(c.memory, i)
            if c.missed is not None and len(passable(contacts)) > 0:
                c.missed[i] += crossings(contacts, p, r, hi)
            if held is not None:
                held[i] = 1 if is_other(q, r) else 0
            store(c, i, r)
            note(c.clock, i, outcome, r.t)
            stop_turning(c, i, outcome)
