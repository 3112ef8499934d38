"""The way of one particle within a step, from impact to impact, on what it lies on in between."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.dents import dented
from particlesim.colliders.moving import MovingRecord, alight, ride
from particlesim.colliders.response import at_rest
from particlesim.compiler import outlined
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.contacts import (
    ahead,
    coarse,
    meet,
    nearest,
    rounding,
    rounding_of_step,
    shallow,
)
from particlesim.engine.step.crossing import beyond, even, through
from particlesim.engine.step.gliding import CALM, LIVELY, SURE, glide, step_of
from particlesim.engine.step.hits import hear, louder, silence
from particlesim.engine.step.moments import (
    AT_ONCE,
    NO_TIME,
    first_met,
    leaving,
    lying_for,
    met_before,
    reached,
    stretch,
    time_of_impact,
)
from particlesim.engine.step.particle_step import restart
from particlesim.engine.step.pits import bottom, may_hold, no_parts, with_part
from particlesim.laws.registry import PASS, contact, gap, gap_and_normal, moved_to, with_radius

MAX_IMPACTS = 1024
"""Impacts followed within one step; a particle with more is counted, and finishes the step without rebound. A bound on the
work: a fast particle in a narrow place may have hundreds, and bounces that die out (Zeno) end by `MAX_STALLS`."""
MAX_STALLS = 2
"""Impacts in a row that take no time, or lie no further apart than rounding, before a particle counts as resting."""
BRIEF = 16
"""Hops that last less than this part of a step (1 over it) count as rest: forces give as much speed in half of that."""
BOUNCY = 1.8
"""1 + e from which on they do: with less restitution they end soon."""
DEEP, SOONER = 64, 1 - 2.0**-20
"""How deep impacts are found at most, in rounding errors; and up to what part of the time at which it ends a glide is taken
that does not end in an impact."""
SHORTEST = 2.0**40
"""The shortest part of a step (1 over it) for which a way that bends is followed."""
STEEP = 2.0**-20
"""The square of the change of a velocity, over its own, above which an impact is no graze."""
AHEAD = 8
"""Places on a way, each four times as far as the last, at which the other part of a shape is looked for."""
TURNS, NARROW, CALMLY, TURNED = 32, 2.0**-10, 0.25, 0.5
"""In how many impacts what circles in the tip of a cone, or in a corner, comes no further than a part of what forces move in
a step, is slower than a part of what they give, and goes elsewhere: the cosine of the angle is less. Then it rests."""
MOST_PUSHES = 64
"""Passes over the colliders of a corner that put a particle out of it: each leaves cos² of the angle between two parts."""

FLYING, LYING, ENDED = 0, 1, 2
"""How a particle ends its step: in flight, on a collider, or otherwise, as where it stuck."""


@outlined
def separate(colliders: Any, p: Any, legal: Any, contacts: Any) -> Any:
    """Push a particle out of all colliders; one that stays caught in a corner goes back to the legal place, unless that is
    deeper in a collider that has moved there, or that is farther than something thin."""
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
    way = abs(q.x - p.x) + abs(q.y - p.y) + abs(q.z - p.z)
    if outcome == PASS and way > -type_of(slack, DEEP) * slack:
        q = _held(contacts, legal, q)  # one collider may have put it to the other side of something thin
    return q, outcome


@outlined
def follow(
    method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any, calm: Any
) -> Any:
    """The way of a particle with continuous colliders: what `trace` tells, a place out of all of these, how it ends the
    step, whether it has met nothing, and whether it has hit something."""
    left = h
    end = p.t + h
    ends, alone, hits, impacts = ENDED, False, False, 0
    hit = silence(contacts.continuous + contacts.discrete, p)
    outcome = PASS
    legal = p
    exhausted = False
    stalls = 0
    early = False
    begun = here = p
    p, outcome = separate(contacts.continuous, p, p, contacts)
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
            holds, lain = _in_pit(contacts, parts, p, legal, push, h, end)
            if holds:
                p, memory = lain, restart(memory)
                break
        if impacts > 0 and impacts % TURNS == 0:
            if impacts > TURNS and not cramped and _circles(contacts, here, p, push, h):
                p, memory, early = _at_rest(p), restart(memory), True
                break
            here = p
        whole = impacts == MAX_IMPACTS
        q, after, on, length, stuck = stretch(
            method, dynamics, forces, contacts, p, left, memory, calm, whole
        )
        if stuck:
            p, memory, exhausted, early = q, restart(memory), not cramped, True
            break
        late, place = first_met(method, dynamics, forces, contacts, p, q, on, length, memory, calm)
        if not (late < length or ahead(contacts, on, q) < 0):
            p, struck = q, False
            if length < left and any(on):
                pull = (push[0] / h, push[1] / h, push[2] / h)
                p, struck, blow = _arrived(contacts, on, p, pull, force, left - length)
                if struck:
                    hits = True
                    hit = louder(
                        hit,
                        hear(contacts.continuous, blow, silence(contacts.continuous + contacts.discrete, p)),
                    )
            if length == left:
                memory, ends = after, LYING if any(on) else FLYING
                alone = ends == FLYING and impacts == 0 and not put_out
                break
            memory = restart(memory)
            left = left - length
            impacts += 1
            calm = CALM if struck else calm  # no hops have died out on what it has hit
            continue
        if may_hold(contacts.continuous):
            parts = with_part(parts, contacts.continuous, q)
        exhausted, rests = impacts == MAX_IMPACTS and not cramped, stalls == MAX_STALLS and calm == SURE
        done = impacts == MAX_IMPACTS or rests
        # It may lie for a shorter time, as where this one ends beside an edge; or come somewhere else on a way that bends.
        over = calm == SURE and (not any(on) or late * AT_ONCE < length)
        bent = any(on) and late < length and not even(p, q, length)
        if (over or bent) and not done:
            least = h - h if over else h / type_of(h, SHORTEST)
            shorter, r, lain, leaves = _lain(
                method, dynamics, forces, contacts, p, length, memory, h, not any(on), calm, least
            )
            if shorter > 0:
                q, on, length = r, lain, shorter
                late, place = first_met(method, dynamics, forces, contacts, p, q, on, length, memory, calm)
                if not late < length and (leaves or ahead(contacts, on, q) >= 0):
                    # What it comes to now, it may hit.
                    p, memory, left, impacts = q, restart(memory), left - length, impacts + 1
                    calm, stalls = LIVELY if leaves else CALM, 0
                    continue
        # What flies to the end has flown all the way, though it might lie for a shorter time.
        how, exact, off = calm if any(on) else LIVELY, True, False
        if late < length:
            q, exact, off = reached(method, dynamics, forces, contacts, p, late, place, memory, how)
        if done:
            p, outcome = separate(contacts.resting, q, p, contacts)
            memory = restart(memory)
            early = outcome == PASS
            break
        if stalls == MAX_STALLS:
            # From now on it lies where it touches.
            calm, stalls = SURE, 0
            continue
        tau, q, still_on, dies_out, lay = _impact(
            method, dynamics, forces, contacts, p, q, late, memory, h, how, exact, off, force, bouncy
        )
        if any(_left(on, still_on)):
            q = _held(contacts, p, q)
        on = still_on
        impacts += 1
        stalls = stalls + 1 if dies_out else 0
        if lay:
            # It goes on from where it was until then.
            p, memory, left, calm = q, restart(memory), left - tau, LIVELY
            continue
        hit, hits = hear(contacts.continuous, q, hit), True
        p, outcome = separate(contacts.continuous, q, p, contacts)
        p = _struck(contacts, on, q, p) if outcome == PASS else p
        memory = restart(memory)
        left = left - tau
        calm = LIVELY
    if early:  # what moves has gone on meanwhile
        ends = LYING
        p = _pushed(contacts.continuous, p, rounding(contacts, p), end)
        p, outcome = separate(contacts.resting, p, p, contacts)
    if outcome == PASS and nearest(contacts.continuous, p) < -rounding_of_step(contacts, legal, p, h):
        p, outcome = separate(contacts.resting, p, legal, contacts)  # what friction moved in a corner
    return p, memory, outcome, hit, exhausted, legal, ends, alone, hits


@outlined
def _pushed(colliders: Any, p: Any, slack: Any, end: Any) -> Any:
    """A particle that has had too many impacts, at the end of its step: it stays, or goes with what comes upon it. What is
    thin may go over it altogether in that time."""
    r = moved_to(p, p.x, p.y, p.z, p.vx, p.vy, p.vz, end)
    for c in colliders:
        if isinstance(c.shape, MovingRecord):
            local, there, zero = ride(c.shape, p), ride(c.shape, r), p.x - p.x
            s = through(c, p, r, slack)
            if s < 1 or gap(c, r) < -slack:
                x, y, z = (
                    a + s * (b - a) if s < 1 else a
                    for a, b in zip((local.x, local.y, local.z), (there.x, there.y, there.z), strict=True)
                )
                r = alight(c.shape, moved_to(p, x, y, z, zero, zero, zero, end))
    return r


def _left(before: Any, on: Any) -> Any:
    """Which of the colliders that a particle lay on it lies on no more."""
    return tuple(was and not here for was, here in zip(before, on, strict=True))


def _held(contacts: Any, p: Any, q: Any) -> Any:
    """The particle q after p on this side of what is thin, though it would lie there for a longer time only."""
    slack = rounding(contacts, p)
    if beyond(contacts.continuous, p, q, slack):
        r = _pushed(contacts.continuous, p, slack, q.t)
        q = moved_to(q, r.x, r.y, r.z, q.vx, q.vy, q.vz, q.t)
    return q


@outlined
def _circles(contacts: Any, p: Any, q: Any, push: Any, h: Any) -> bool:
    """Whether a particle q, which was at p some impacts ago, circles about one place; `push`: what forces give in the step
    [m/s]."""
    calmly, turned = type_of(p.x, CALMLY), type_of(p.x, TURNED)
    much = np.sqrt(push[0] * push[0] + push[1] * push[1] + push[2] * push[2])
    far = max(type_of(p.x, NARROW) * h * much, rounding(contacts, p))
    for c in contacts.continuous:
        if isinstance(c.shape, MovingRecord) and gap(c, q) < far:
            return False
    x, y, z = q.x - p.x, q.y - p.y, q.z - p.z
    speed, was = (
        np.sqrt(q.vx * q.vx + q.vy * q.vy + q.vz * q.vz),
        np.sqrt(p.vx * p.vx + p.vy * p.vy + p.vz * p.vz),
    )
    along = p.vx * q.vx + p.vy * q.vy + p.vz * q.vz
    near, slow = x * x + y * y + z * z <= far * far, speed <= calmly * much
    return near & slow & (along <= turned * speed * was)


def _at_rest(p: Any) -> Any:
    """A particle that stays where it is."""
    zero = p.vx - p.vx
    return moved_to(p, p.x, p.y, p.z, zero, zero, zero, p.t)


@outlined
def _in_pit(contacts: Any, parts: Any, p: Any, legal: Any, push: Any, h: Any, end: Any) -> Any:
    """Whether a particle lies in a pit of a shape with dents, and stays there until a time `end`; and the particle then."""
    slack, zero = rounding(contacts, p), h - h
    rubs = any(c.response.friction is not None for c in contacts.continuous)
    holds, x, y, z = bottom(contacts.continuous, parts, p, legal, push, h, slack, rubs)
    lain = moved_to(p, x, y, z, zero, zero, zero, end)
    return holds and nearest(contacts.continuous, lain) >= -slack, lain


@outlined
def _lain(
    method: Any,
    dynamics: Any,
    forces: Any,
    contacts: Any,
    p: Any,
    length: Any,
    memory: Any,
    h: Any,
    flies: Any,
    calm: Any,
    least: Any,
) -> Any:
    """How long a particle lies that does not until the end of a time `length`, where it `flies`; the particle then; on what
    it lies; and whether it takes off instead."""
    tau, q, on = lying_for(method, dynamics, forces, contacts, p, length, memory, calm, least)
    leaves = tau * NO_TIME < h
    if leaves and flies:
        # For so short a time rounding errors may press.
        free, r = leaving(method, dynamics, forces, contacts, p, length, memory)
        leaves = free > 0
        tau, q = (free, r) if leaves else (tau, q)
    return tau, q, on, leaves


@outlined
def _impact(
    method: Any,
    dynamics: Any,
    forces: Any,
    contacts: Any,
    p: Any,
    q: Any,
    late: Any,
    memory: Any,
    h: Any,
    how: Any,
    exact: Any,
    off: Any,
    force: Any,
    bouncy: Any,
) -> Any:
    """The time of the impact of a particle that is in a collider at q at the time `late`; the particle then; on what it
    lies until then; whether such hops die out; and whether it is no impact, as the particle has lain there until then. Where
    it is `off` the way on which it was found, something else may come first."""
    tau, half, lay = late, type_of(h, 0.5), False
    if exact:
        tau = time_of_impact(method, dynamics, forces, contacts, p, late, memory, how)
        if off:
            q, _, on, _ = glide(method, dynamics, forces, contacts, p, tau, memory, how)
            first, q, _ = met_before(method, dynamics, forces, contacts, p, q, on, tau, memory, how)
            exact, tau = first == tau or ahead(contacts, on, q) < 0, first
    # Hops that die out are counted to rest while their height means something, not for ever in rounding errors.
    top, _, on, _ = glide(method, dynamics, forces, contacts, p, half * tau, memory, how)
    height = ahead(contacts, on, top)
    low = height <= rounding(contacts, p)
    # So are brief hops, twice as high as by forces at most: those on what is elastic have no end.
    brief = (type_of(h, BRIEF) * tau < h) & (height <= type_of(h, 0.25) * force * tau * tau)
    low |= brief & bouncy
    dies_out = low or tau * NO_TIME < h
    if exact:
        q, _, on, _ = glide(method, dynamics, forces, contacts, p, tau, memory, how)
        slack = rounding_of_step(contacts, p, q, h)
        if -ahead(contacts, on, q) > type_of(h, DEEP) * slack:
            # Until now it lay there, and in a longer time it would not.
            sooner = tau * type_of(h, SOONER)
            r, _, lain, _ = glide(method, dynamics, forces, contacts, p, sooner, memory, how)
            lay = any(lain) and ahead(contacts, lain, r) >= -slack
            lay = lay and not beyond(contacts.continuous, p, r, rounding(contacts, p))
            tau, q = (sooner, r) if lay else (tau, q)
            on = tuple(before if not lay else after for before, after in zip(on, lain, strict=True))
    return tau, q, on, dies_out, lay


@outlined
def _arrived(contacts: Any, on: Any, p: Any, pull: Any, force: Any, left: Any) -> Any:
    """A particle that has come along a shape to just before another part of it, with the velocity after the impact there;
    whether there was one; and the particle in the other part with the velocity before that. Beside what it lies on gaps do
    not tell the other part: it is looked for on the way. Hops that forces end in the time that is left are none (`pull` over
    mass; the size of that is `force`)."""
    slack, struck, blow = rounding(contacts, p), False, p
    for c, here in zip(contacts.continuous, on, strict=True):
        if dented(c.shape):
            rest, r = c, p
            if isinstance(c.shape, MovingRecord):
                rest, r = at_rest(c), ride(c.shape, p)
            square, hits, far = r.vx * r.vx + r.vy * r.vy + r.vz * r.vz, False, type_of(p.x, 4) * slack
            if here and c.response.outcome == PASS and square > 0:
                for _ in range(AHEAD):
                    s = far / np.sqrt(square)
                    q = moved_to(r, r.x + s * r.vx, r.y + s * r.vy, r.z + s * r.vz, r.vx, r.vy, r.vz, r.t)
                    g, axes = gap_and_normal(rest, q)
                    n = tuple(g - g if axis is None else axis for axis in axes)
                    into = min(n[0] * r.vx + n[1] * r.vy + n[2] * r.vz, g - g)
                    press = -(n[0] * pull[0] + n[1] * pull[1] + n[2] * pull[2])
                    if isinstance(c.shape, MovingRecord):  # its axes are others
                        press = force
                    lively = -into > type_of(p.x, 0.5) * press * left
                    if not hits and g < 0 and lively and into * into > type_of(p.x, STEEP) * square:
                        hits = True
                        blow = alight(c.shape, q) if isinstance(c.shape, MovingRecord) else q
                        after, _ = contact(rest, q)
                        r = moved_to(r, r.x, r.y, r.z, after.vx, after.vy, after.vz, r.t)
                    far = type_of(p.x, 4) * far
            if hits:
                struck = True
                p = alight(c.shape, r) if isinstance(c.shape, MovingRecord) else r
    return p, struck, blow


def _struck(contacts: Any, on: Any, q: Any, p: Any) -> Any:
    """A particle p after an impact at q. What it lies on may have put it back by rounding errors, out of what it hits and
    goes on to approach, as it would for ever: with the velocity after that."""
    for c, here in zip(contacts.continuous, on, strict=True):
        after, _ = contact(c, with_radius(p, p.r + rounding(contacts, p)))
        x, y, z = after.vx - p.vx, after.vy - p.vy, after.vz - p.vz
        steep = x * x + y * y + z * z > type_of(x, STEEP) * (p.vx * p.vx + p.vy * p.vy + p.vz * p.vz)
        hits = steep & (not here) & (gap(c, q) < 0) & (c.response.outcome == PASS)
        p = chosen(hits, moved_to(p, p.x, p.y, p.z, after.vx, after.vy, after.vz, p.t), p)
    return p
