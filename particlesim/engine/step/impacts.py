"""Contact inside a step: projection after it (discrete), or the time of impact within it (continuous).

`meet` applies every collider once, in order; particles that overlap nothing pass unchanged. One collider, or several at
right angles to each other, need nothing more (`Simple`), and the loop over a block stays vectorised. Otherwise
(`Careful`) the few particles that end a step inside a collider, or cross one on the way, are stepped again one by one by
`trace`.

Particles that lie on colliders rest or slide there (`resting`); only impacts need a search (`moments`). In the loop over a
block `at_rest.rest` takes them through their step, in vectors.

Whether a path goes into a collider, such as a ball or a thin sheet, and comes out again is found on the parabola from its
beginning to its end (`particlesim.colliders.way`).

Where places are kept in single precision, `trace` follows them in double: they would be rounded at every impact.

The velocities of a leapfrog may be late, as those of symplectic Euler are by half a step: an impact that turned them around
would change the energy by h v·f. So what flies into a step with an impact is followed with the velocities of its places, by
velocity Verlet, which without an impact is the same step (`particle_step`). What lies goes its method's own way: with two
ways in turn, swings along a surface would grow.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.response import along
from particlesim.compiler import outlined
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.at_rest import turning
from particlesim.engine.step.contacts import (
    Careful,
    Simple,
    ahead,
    coarse,
    meet,
    nearest,
    rounding,
    rounding_of_step,
    shallow,
)
from particlesim.engine.step.gliding import CALM, LIVELY, SURE, glide, step_of
from particlesim.engine.step.hits import hear, silence
from particlesim.engine.step.lateness import (
    along_contacts,
    centred,
    delayed,
    hastened,
    lags,
    leaps,
    on_time,
    parabola,
    slowed,
    taken_off,
)
from particlesim.engine.step.lying import settled_one
from particlesim.engine.step.moments import (
    AT_ONCE,
    NO_TIME,
    first_met,
    leaving,
    lying_for,
    reached,
    stretch,
    time_of_impact,
    until_met,
)
from particlesim.engine.step.particle_step import BentRecord, Newtonian, advance, restart
from particlesim.engine.step.pits import bottom, may_hold, no_parts, with_part
from particlesim.engine.step.rebounds import balanced_alone, is_soft, kept_by, lain_alone, settled_alone
from particlesim.engine.step.resting import NOISE
from particlesim.integrators.base import CompositionRecord, VerletRecord
from particlesim.laws.registry import PASS, gap_and_normal, moved_to

MAX_IMPACTS = 1024
"""Impacts followed within one step; a particle with more is counted, and finishes the step without rebound. A bound on the
work: a fast particle in a narrow place may have hundreds, and bounces that die out (Zeno) end by `MAX_STALLS`."""
MAX_STALLS = 2
"""Impacts in a row that take no time, or lie no further apart than rounding, before a particle counts as resting."""
EXACT = 2.0**-48
"""The tolerance of contacts in double precision (`records.CONTACT_TOLERANCE`)."""
BRIEF = 16
"""Hops that last less than this part of a step (1 over it) count as rest: forces give as much speed in half of that."""
BOUNCY = 1.8
"""1 + e from which on they do: with less restitution they end soon."""
DEEP, SOONER = 64, 1 - 2.0**-20
"""How deep impacts are found at most, in rounding errors; and up to what part of the time at which it ends a glide is taken
that does not end in an impact."""
MOST_PUSHES = 64
"""Passes over the colliders of a corner that put a particle out of it: each leaves cos² of the angle between two parts."""

NOTHING, BOUNCED, LANDED = 0, 1, 2
"""What has happened in a step: no impact, or only of what lay on something before; one, and it flies; it lies now."""
FLYING, LYING, ENDED = 0, 1, 2
"""How a particle ends its step: in flight, on a collider, or otherwise, as where it stuck."""


@outlined
def _separate(colliders: Any, p: Any, legal: Any, contacts: Any) -> Any:
    """Push a particle out of all colliders; one that stays caught in a corner goes back to the legal place, unless that is
    deeper in a collider that has moved there."""
    slack = -rounding(contacts, p)
    q, outcome = meet(colliders, p)
    if coarse(contacts.tolerance) and nearest(colliders, p) >= -shallow(contacts, p):
        q = moved_to(q, p.x, p.y, p.z, q.vx, q.vy, q.vz, q.t)  # to lift it by rounding errors is a gain
    left, sweeps = nearest(colliders, q), 1
    while left < slack and sweeps < MOST_PUSHES:
        q, more = meet(colliders, q)
        outcome = max(outcome, more)
        left = nearest(colliders, q)
        sweeps += 1
    if left < slack:
        back = moved_to(q, legal.x, legal.y, legal.z, q.vx, q.vy, q.vz, q.t)
        q = chosen(nearest(colliders, back) >= left, back, q)
    return q, outcome


@outlined
def trace(method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any) -> Any:
    """One step of one particle from impact to impact: the particle, the method's memory, the outcome, the first impact
    to which an emitter reacts (None where none would), whether it had more impacts than are followed, and whether it has
    bounced, or landed.

    The particle's time is where its step ended: before t + h when it stuck or died.
    """
    if isinstance(contacts, Simple):
        return p, memory, PASS, None, False, NOTHING
    if not coarse(contacts.tolerance):
        return _trace(method, dynamics, forces, contacts, p, h, memory)
    # Impacts are between the places that single precision knows: rounded to one of them, each would gain or lose energy.
    # Only the beginning has been rounded: from what it touches but for that, all is as exact as in double precision.
    fine = type(p)(*(each if each is None else np.float64(each) for each in p))
    known = tuple(np.float64(each) for each in memory)
    if any(isinstance(c.shape, MovingRecord) for c in contacts.continuous):
        q, after, outcome, hit, exhausted, struck = _trace(
            method, dynamics, forces, contacts, fine, np.float64(h), known
        )
    else:
        exact = Careful(
            contacts.continuous,
            contacts.resting,
            contacts.discrete,
            np.float64(EXACT),
            np.float64(contacts.reach),
            contacts.one_by_one,
            contacts.soft,
            contacts.sized_by,
        )
        begun = _put_on(method, dynamics, forces, contacts, fine, np.float64(h), known)
        q, after, outcome, hit, exhausted, struck = _trace(
            method, dynamics, forces, exact, begun, np.float64(h), known
        )
    x, y, z, vx, vy, vz = (type_of(p.x, each) for each in q[:6])
    coarsened = tuple(type_of(p.x, each) for each in after)
    return moved_to(p, x, y, z, vx, vy, vz, q.t), coarsened, outcome, hit, exhausted, struck


@outlined
def _put_on(method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any) -> Any:
    """A particle whose place has been rounded, on the colliders that it touches but for that; with the same energy, if it
    does not lie there."""
    slack, half = rounding(contacts, p), type_of(h, 0.5)
    q, _ = step_of(method, dynamics, forces, p, h, memory)
    change = (q.vx - p.vx, q.vy - p.vy, q.vz - p.vz)
    for c in contacts.continuous + contacts.continuous:
        g, axes = gap_and_normal(c, p)
        zero = g - g
        n = tuple(zero if axis is None else axis for axis in axes)
        own, push = along(n, p), n[0] * change[0] + n[1] * change[1] + n[2] * change[2]
        near = (abs(g) <= slack) & ((g < 0) | (abs(own) * h <= slack))
        noise = abs(own) <= type_of(h, NOISE) * (abs(p.vx) + abs(p.vy) + abs(p.vz))
        speed = np.sqrt(max(own * own - 2 * push * g / h, zero))
        quick = abs(own) > half * abs(push)
        speed = (speed if own > 0 else -speed) if quick else own
        s, u = g if near else zero, (own if noise else own - speed) if near else zero
        x, y, z = (x - s * axis for x, axis in zip((p.x, p.y, p.z), n, strict=True))
        vx, vy, vz = (v - u * axis for v, axis in zip((p.vx, p.vy, p.vz), n, strict=True))
        p = moved_to(p, x, y, z, vx, vy, vz, p.t)
    return p


@outlined
def _trace(method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any) -> Any:
    """As `trace`, in the precision of p."""
    if len(contacts.continuous) == 0:
        q, after = advance(method, dynamics, forces, p, h, memory)
        legal, outcome, hit, exhausted, struck = p, PASS, silence(contacts.discrete, p), False, NOTHING
    elif isinstance(method, (CompositionRecord, VerletRecord)) and turning(contacts):
        q, after, outcome, hit, exhausted, legal, struck = _under_turning(
            method, dynamics, forces, contacts, p, h, memory
        )
    elif lags(method):
        q, after, outcome, hit, exhausted, legal, struck, _, _ = _on_time(
            method, dynamics, forces, contacts, p, h, memory
        )
    else:
        q, after, outcome, hit, exhausted, legal, ends, alone, _ = _follow(
            method, dynamics, forces, contacts, p, h, memory, CALM
        )
        struck = _struck(ends, alone)
    if outcome == PASS and nearest(contacts.discrete, q) < 0:
        hit = hear(contacts.discrete, q, hit)
        # Out of one collider must not mean into another, and only the beginning of the step is legal for all.
        q, outcome = _separate(contacts.discrete + contacts.continuous, q, legal, contacts)
        after, struck = restart(after), NOTHING
    return q, after, outcome, hit, exhausted, struck


@outlined
def _on_time(method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any) -> Any:
    """The step of a method that `lags`, followed with the velocities of its places: as `trace`, but for discrete colliders,
    with a place out of the others, how it ends the step, and whether it has met nothing."""
    free, _ = step_of(centred(method, h, True), dynamics, forces, p, h, restart(memory))
    slack = rounding_of_step(contacts, p, free, h)
    _, on, _ = settled_one(contacts.resting, p, free, h, contacts.tolerance, slack, False)
    lies = any(on)
    begun = p if lies else on_time(method, forces, p, h, memory)
    # On what is elastic hops that are shorter than the step would not end.
    elastic = [here & (c.response.bounce >= 2) for here, c in zip(on, contacts.continuous, strict=True)]
    calm = SURE if any(elastic) else CALM
    q, after, outcome, hit, exhausted, legal, ends, alone, hits = _follow(
        centred(method, h, lies), dynamics, forces, contacts, begun, h, restart(memory), calm
    )
    if hits and lies and isinstance(method, CompositionRecord):
        # What it hits turns velocities of their places around, also along what it lies on.
        late, _ = along_contacts(contacts, p, _change(p, on_time(method, forces, p, h, memory)), False)
        q, after, outcome, hit, exhausted, legal, ends, alone, _ = _follow(
            centred(method, h, False), dynamics, forces, contacts, hastened(p, late), h, restart(memory), calm
        )
        if ends != ENDED:
            back, _ = along_contacts(contacts, q, _change(delayed(method, forces, q, h), q), False)
            q = hastened(q, (-back[0], -back[1], -back[2]))
    elif alone and not lies:
        q, after = advance(method, dynamics, forces, p, h, memory)  # the same bits as without a look
    elif ends != ENDED:
        late = delayed(method, forces, q, h)
        if not lies:
            q = slowed(q, late) if ends == LYING else late
        elif ends == FLYING and not isinstance(method, BentRecord):
            q = taken_off(q, late)
    return q, after, outcome, hit, exhausted, legal, _struck(ends, alone or lies), ends, alone and not lies


def _change(p: Any, q: Any) -> Any:
    """The change of the velocity from p to q."""
    return q.vx - p.vx, q.vy - p.vy, q.vz - p.vz


def elastic(colliders: Any) -> Any:
    """Whether impacts on all of some colliders keep the energy: they are at rest, smooth, and throw back all."""
    for c in colliders:
        r = c.response
        if isinstance(c.shape, MovingRecord) or any(
            each is not None for each in (r.friction, r.falling, r.belt)
        ):
            return False
    return all(tuple((c.response.bounce >= 2) & (c.response.loss <= 0) for c in colliders))


def without_rebounds(contacts: Careful) -> Careful:
    """The same contacts, where nothing rebounds."""
    return Careful(
        contacts.resting,
        contacts.resting,
        contacts.discrete,
        contacts.tolerance,
        contacts.reach,
        contacts.one_by_one,
        contacts.soft,
        contacts.sized_by,
    )


@outlined
def _under_turning(
    method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any
) -> Any:
    """As `_on_time`, of a symplectic method under forces that change along the way: on the parabola of its step, so that an
    impact divides only the motion against it, and with what forces would give by the impact taken back (`rebounds`). Swings
    along the surface, divided at each impact, would grow, as those in steps that change do."""
    begun, lay, known = p, False, kept_by(method)
    if not leaps(method):
        # A method of higher order keeps that in short steps, where little is gained.
        free, _ = step_of(method, dynamics, forces, p, h, memory)
        q, after, outcome, hit, exhausted, legal, ends, alone, _ = _follow(
            method, dynamics, forces, contacts, p, h, memory, CALM
        )
        struck = _struck(ends, alone)
        if struck != BOUNCED or is_soft(forces, free, q, h):
            if struck != NOTHING and outcome == PASS and known is not None:
                if struck == BOUNCED and elastic(contacts.continuous):
                    q = balanced_alone(forces, free, q, h, known)
                else:
                    q, _ = lain_alone(forces, free, q, h, known)
            return q, after, outcome, hit, exhausted, legal, struck
    else:
        if lags(method):
            begun = on_time(method, forces, p, h, memory)
            late, lay = along_contacts(contacts, p, _change(p, begun), False)
            begun = hastened(p, late) if isinstance(method, CompositionRecord) else begun
        leapfrog = centred(method, h, False) if lags(method) else method
        free, _ = step_of(leapfrog, dynamics, forces, begun, h, ())
    way = parabola(begun, free, h)
    q, _, outcome, hit, exhausted, legal, struck, ends, alone = _on_time(
        way, Newtonian(), (), contacts, begun, h, ()
    )
    if alone and not lay:
        q, after = advance(method, dynamics, forces, p, h, memory)  # the same bits as without a look
        return q, after, outcome, hit, exhausted, legal, struck
    if outcome == PASS:
        q, lacks = _kept(forces, way, free, q, h, struck, known)
        if lacks:
            # It would go farther than its speed can pay: it rebounds from nothing in this step, or ends where it began.
            dull = without_rebounds(contacts)
            q, _, outcome, _, exhausted, legal, struck, ends, _ = _on_time(
                way, Newtonian(), (), dull, begun, h, ()
            )
            q, lacks = lain_alone(forces, free, q, h, known)  # it may have slid, whatever it ends with
            if lacks:
                zero = h - h
                q = moved_to(q, begun.x, begun.y, begun.z, zero, zero, zero, q.t)
    if isinstance(method, CompositionRecord) and lags(method) and outcome == PASS:
        # as the next step begins
        back, _ = along_contacts(contacts, q, _change(delayed(method, forces, q, h), q), False)
        q = hastened(q, (-back[0], -back[1], -back[2]))
    return q, restart(memory), outcome, hit, exhausted, legal, struck


def _kept(forces: Any, way: Any, free: Any, q: Any, h: Any, struck: Any, known: Any) -> Any:
    """The end q of a step without what forces have given it by contact, and whether its speed was too little for that."""
    if struck == BOUNCED:
        return settled_alone(forces, way, free, q, h, known)
    return lain_alone(forces, free, q, h, known)


def _struck(ends: Any, calm: Any) -> Any:
    """What a step that ends like this was, unless it was `calm`: in flight all the time, or on something from its
    beginning."""
    return NOTHING if calm or ends == ENDED else (BOUNCED if ends == FLYING else LANDED)


@outlined
def _follow(
    method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any, calm: Any
) -> Any:
    """The way of a particle with continuous colliders: what `trace` tells, a place out of all of these, how it ends the
    step, whether it has met nothing, and whether it has hit something."""
    left, half = h, type_of(h, 0.5)
    end = p.t + h
    ends, alone, hits, impacts = ENDED, False, False, 0
    hit = silence(contacts.continuous + contacts.discrete, p)
    outcome = PASS
    legal = p
    exhausted = False
    stalls = 0
    early = False
    begun = p
    p, outcome = _separate(contacts.continuous, p, p, contacts)
    put_out = (p.x != begun.x) | (p.y != begun.y) | (p.z != begun.z)
    put_out |= (p.vx != begun.vx) | (p.vy != begun.vy) | (p.vz != begun.vz)
    cramped = nearest(contacts.continuous, p) < -rounding(contacts, p)
    if cramped:
        impacts = MAX_IMPACTS  # it finds no room, and would bounce as often as it may
    legal = p
    q, _ = step_of(method, dynamics, forces, p, h, memory)
    push = (q.vx - p.vx, q.vy - p.vy, q.vz - p.vz)
    bouncy = sum([c.response.bounce > BOUNCY for c in contacts.continuous]) > 0
    force = np.sqrt(push[0] * push[0] + push[1] * push[1] + push[2] * push[2]) / h
    if may_hold(contacts.continuous):
        parts = no_parts(h)
    while outcome == PASS:
        if may_hold(contacts.continuous):
            parts = with_part(parts, contacts.continuous, p)
            slack, zero = rounding(contacts, p), h - h
            rubs = any(c.response.friction is not None for c in contacts.continuous)
            holds, x, y, z = bottom(parts, p, legal, push, h, slack, rubs)
            lain = moved_to(p, x, y, z, zero, zero, zero, end)
            if holds and nearest(contacts.continuous, lain) >= -slack:
                p, memory = lain, restart(memory)
                break
        whole = impacts == MAX_IMPACTS
        q, after, on, length, stuck = stretch(
            method, dynamics, forces, contacts, p, left, memory, calm, whole
        )
        if stuck:
            p, memory, exhausted, early = q, restart(memory), not cramped, True
            break
        late, place = first_met(method, dynamics, forces, contacts, p, q, on, length, memory, calm)
        if not (late < length or ahead(contacts, on, q) < 0):
            p = q
            if length == left:
                memory, ends = after, LYING if any(on) else FLYING
                alone = ends == FLYING and impacts == 0 and not put_out
                break
            memory = restart(memory)
            left = left - length
            impacts += 1
            continue
        if may_hold(contacts.continuous):
            parts = with_part(parts, contacts.continuous, q)
        exhausted, rests = impacts == MAX_IMPACTS and not cramped, stalls == MAX_STALLS and calm == SURE
        done = impacts == MAX_IMPACTS or rests
        # It may lie for a shorter time: at the end of this one it would be beside an edge, not behind what it lies on.
        if calm == SURE and not done and (not any(on) or late * AT_ONCE < length):
            flies = not any(on)
            tau, r, lain = lying_for(method, dynamics, forces, contacts, p, length, memory)
            leaves = tau * NO_TIME < h
            if leaves and flies:
                # For so short a time rounding errors may press.
                free, s = leaving(method, dynamics, forces, contacts, p, length, memory)
                leaves = free > 0
                tau, r = (free, s) if leaves else (tau, r)
            if tau > 0:
                q, on, length = r, lain, tau
                late, place = first_met(method, dynamics, forces, contacts, p, q, on, length, memory, calm)
                if leaves or not (late < length or ahead(contacts, on, q) < 0):
                    # What it comes to now, it may hit.
                    p, memory, left, impacts = q, restart(memory), left - length, impacts + 1
                    calm, stalls = LIVELY if leaves else CALM, 0
                    continue
        # What flies to the end has flown all the way, though it might lie for a shorter time.
        how, exact = calm if any(on) else LIVELY, True
        if late < length:
            q, exact = reached(method, dynamics, forces, contacts, p, late, place, memory, how)
            if not exact and not done and any(on):
                # Along what it lies on it may come there later than it would at an even speed.
                before, r = until_met(method, dynamics, forces, contacts, p, late, h, memory, how)
                if before > 0:
                    p, memory, left, impacts = r, restart(memory), left - before, impacts + 1
                    calm = CALM
                    continue
        if done:
            p, outcome = _separate(contacts.resting, q, p, contacts)
            memory = restart(memory)
            early = outcome == PASS
            break
        if stalls == MAX_STALLS:
            # From now on it lies where it touches.
            calm, stalls = SURE, 0
            continue
        tau = late
        if exact:
            tau = time_of_impact(method, dynamics, forces, contacts, p, late, memory, how)
        # Hops that die out are counted to rest while their height means something, not for ever in rounding errors.
        top, _, on, _ = glide(method, dynamics, forces, contacts, p, half * tau, memory, how)
        height = ahead(contacts, on, top)
        low = height <= rounding(contacts, p)
        # So are brief hops, twice as high as by forces at most: those on what is elastic have no end.
        brief = (type_of(h, BRIEF) * tau < h) & (height <= type_of(h, 0.25) * force * tau * tau)
        low |= brief & bouncy
        stalls = stalls + 1 if low or tau * NO_TIME < h else 0
        impacts += 1
        if exact:
            q, after, on, _ = glide(method, dynamics, forces, contacts, p, tau, memory, how)
            if -ahead(contacts, on, q) > type_of(h, DEEP) * rounding_of_step(contacts, p, q, h):
                # No impact: until now it lay there, and in a longer time it would not. It goes on from where it was then.
                sooner = tau * type_of(h, SOONER)
                r, _, on, _ = glide(method, dynamics, forces, contacts, p, sooner, memory, how)
                if any(on) and ahead(contacts, on, r) >= 0:
                    p, memory, left, calm = r, restart(memory), left - sooner, LIVELY
                    continue
        hit, hits = hear(contacts.continuous, q, hit), True
        p, outcome = _separate(contacts.continuous, q, p, contacts)
        memory = restart(memory)
        left = left - tau
        calm = LIVELY
    if early:  # what moves has gone on meanwhile
        ends = LYING
        p = moved_to(p, p.x, p.y, p.z, p.vx, p.vy, p.vz, end)
        p, outcome = _separate(contacts.resting, p, p, contacts)
    if outcome == PASS and nearest(contacts.continuous, p) < -rounding_of_step(contacts, legal, p, h):
        p, outcome = _separate(contacts.resting, p, legal, contacts)  # what friction moved in a corner
    return p, memory, outcome, hit, exhausted, legal, ends, alone, hits
