"""Contact inside a step: projection after it (discrete), or the time of impact within it (continuous).

`meet` applies every collider once, in order; particles that overlap nothing pass unchanged. One collider, or several at
right angles to each other, need nothing more (`Simple`), and the loop over a block stays vectorised. Otherwise
(`Careful`) the few particles that end a step inside a collider, or cross one on the way, are stepped again one by one by
`trace`.

Whether a way crosses a collider, such as a ball, and comes out of it again is seen on the straight line from its beginning
to its end.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.colliders.response import crossable
from particlesim.compiler import outlined
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.particle_step import advance, restart
from particlesim.laws.registry import PASS, contact, gap, moved_to, passing

MAX_IMPACTS = 1024
"""Impacts followed within one step; a particle with more finishes the step without rebound. Only a bound on the work:
a fast particle in a narrow place may have hundreds, and bounces that die out (Zeno) end by `MAX_STALLS`."""
MAX_STALLS = 2
"""Impacts in a row that take no time, or lie no further apart than rounding, before a particle counts as resting."""
MAX_SWEEPS = 8
"""Passes over the colliders of a corner before the particle goes back to where its step began."""
MAX_CROSSINGS = 8
"""Colliders in each other's shadow among which the first one that a way crosses is looked for."""
MAX_HALVINGS = 80
"""Bound on the search for the time of impact; bisection alone would end after 53."""


class Simple(NamedTuple):
    """Colliders met once after each step: none, one, or several that are perpendicular or parallel."""

    colliders: tuple[Any, ...]


class Careful(NamedTuple):
    """Colliders that need more: a time of impact (continuous), or several passes in a corner.

    `resting` are the continuous ones without rebound; `tolerance` is the relative rounding error of a position, and `reach`
    the size of the numbers beside it that gaps are made of [m].
    """

    continuous: tuple[Any, ...]
    resting: tuple[Any, ...]
    discrete: tuple[Any, ...]
    tolerance: float
    reach: float


def meet(colliders: Any, p: Any) -> Any:
    """The particle after every collider in turn, and the strongest outcome."""
    if len(colliders) == 0:
        return p, PASS
    if len(colliders) == 1:
        return contact(colliders[0], p)
    q, first = contact(colliders[0], p)
    r, rest = meet(colliders[1:], q)
    return r, max(first, rest)


def nearest(colliders: Any, p: Any) -> Any:
    """The smallest gap to any collider [m]; positive where there are none."""
    if len(colliders) == 0:
        return 1.0
    if len(colliders) == 1:
        return gap(colliders[0], p)
    return min(gap(colliders[0], p), nearest(colliders[1:], p))


def rests(colliders: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    """Whether a step from p to q is rest: p touches a collider that takes energy, does not move into it, and yet ends
    inside. Any hop between is shorter than the step, and so are all that would follow."""
    if len(colliders) == 0:
        return False
    c = colliders[0]
    coasting = moved_to(p, p.x + h * p.vx, p.y + h * p.vy, p.z + h * p.vz, p.vx, p.vy, p.vz, p.t)
    here = (gap(c, p) <= slack) & (gap(c, q) < 0) & (gap(c, coasting) >= -slack) & (c.response.bounce < 2)
    return here | rests(colliders[1:], p, q, h, slack)


def crossing(colliders: Any, p: Any, q: Any) -> Any:
    """Where the straight way from p to q first is deepest inside a collider that it comes out of again: a part of the way,
    1 where there is none."""
    if len(colliders) == 0:
        return 1.0
    rest = crossing(colliders[1:], p, q)
    if not crossable(colliders[0]):
        return rest
    s = passing(colliders[0], p, q)
    x, y, z = p.x + s * (q.x - p.x), p.y + s * (q.y - p.y), p.z + s * (q.z - p.z)
    there = moved_to(q, x, y, z, q.vx, q.vy, q.vz, q.t)
    return min(s if (s > 0) & (gap(colliders[0], there) < 0) else type_of(s, 1), type_of(s, rest))


def overlapped(contacts: Any, p: Any, q: Any) -> Any:
    """Whether `trace` must take the step from p to q again; never for simple contacts."""
    if isinstance(contacts, Simple):
        return False
    inside = (nearest(contacts.continuous, q) < 0) | (nearest(contacts.discrete, q) < 0)
    if not any(crossable(c) for c in contacts.continuous):
        return inside
    return inside | (crossing(contacts.continuous, p, q) < 1)


def respond(contacts: Any, p: Any) -> Any:
    """Simple contacts at the end of a step; careful ones leave the particle to `trace`."""
    if isinstance(contacts, Simple):
        return meet(contacts.colliders, p)
    return p, PASS


def rounding(contacts: Any, p: Any) -> Any:
    """Gaps that are nothing but rounding errors [m]."""
    return contacts.tolerance * (abs(p.x) + abs(p.y) + abs(p.z) + p.r + contacts.reach)


@outlined
def _separate(colliders: Any, p: Any, legal: Any, contacts: Any) -> Any:
    """Push a particle out of all colliders; one that stays caught in a corner goes back to the legal place."""
    slack = -rounding(contacts, p)
    q, outcome = meet(colliders, p)
    sweeps = 1
    while nearest(colliders, q) < slack and sweeps < MAX_SWEEPS:
        q, more = meet(colliders, q)
        outcome = max(outcome, more)
        sweeps += 1
    if nearest(colliders, q) < slack:
        q = moved_to(q, legal.x, legal.y, legal.z, q.vx, q.vy, q.vz, q.t)
    return q, outcome


@outlined
def _time_of_impact(
    method: Any, dynamics: Any, forces: Any, colliders: Any, p: Any, h: Any, memory: Any
) -> Any:
    """The first representable time in (0, h] at which a collider is overlapped, by the Illinois method."""
    # Regula falsi with the Illinois modification (Dowell, Jarratt, BIT 11, 168 (1971)), kept inside the bracket; every
    # third turn bisects, so that the bracket is sure to close.
    half = type_of(h, 0.5)  # dividing by the integer 2 would turn single precision into double
    early, late = h - h, h
    above = max(nearest(colliders, p), h - h)
    below = nearest(colliders, advance(method, dynamics, forces, p, late, memory)[0])
    # A particle that touches and sinks at once hits now: resting contact must not cost a search.
    now = h * type_of(h, 2.0**-30)
    if nearest(colliders, advance(method, dynamics, forces, p, now, memory)[0]) < 0:
        return now
    side = 0
    for turn in range(MAX_HALVINGS):
        middle = early + (late - early) * half
        if not (early < middle < late):
            break
        if turn % 3 != 2 and above > 0:
            guess = (late * above - early * below) / (above - below)
            middle = guess if early < guess < late else middle
        value = nearest(colliders, advance(method, dynamics, forces, p, middle, memory)[0])
        if value < 0:
            late, below = middle, value
            above = above * half if side == -1 else above
            side = -1
        else:
            early, above = middle, value
            below = below * half if side == 1 else below
            side = 1
    return late


def _end(method: Any, dynamics: Any, forces: Any, colliders: Any, p: Any, h: Any, memory: Any) -> Any:
    """When the first impact in (0, h] is sure to have been: h, or where the particle is deepest inside the first collider
    that it crosses."""
    if not any(crossable(c) for c in colliders):
        return h
    end = h
    for _ in range(MAX_CROSSINGS):
        s = crossing(colliders, p, advance(method, dynamics, forces, p, end, memory)[0])
        middle = end * type_of(h, s)
        if not (s < 1 and nearest(colliders, advance(method, dynamics, forces, p, middle, memory)[0]) < 0):
            break
        end = middle
    return end


@outlined
def trace(method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any) -> Any:
    """One step of one particle from impact to impact: the particle, the method's memory, the outcome.

    The particle's time is where its step ended: before t + h when it stuck or died.
    """
    if isinstance(contacts, Simple):
        return p, memory, PASS
    left = h
    outcome = PASS
    legal = p
    if len(contacts.continuous) > 0:
        impacts = 0
        stalls = 0
        p, outcome = _separate(contacts.continuous, p, p, contacts)
        legal = p
        while outcome == PASS:
            q, after = advance(method, dynamics, forces, p, left, memory)
            late = _end(method, dynamics, forces, contacts.continuous, p, left, memory)
            if not (late < left or nearest(contacts.continuous, q) < 0):
                p, memory = q, after
                break
            if late < left:
                q, after = advance(method, dynamics, forces, p, late, memory)
            slack = rounding(contacts, p)
            resting = impacts == 0 and rests(contacts.continuous, p, q, left, slack)
            if resting or impacts == MAX_IMPACTS or stalls == MAX_STALLS:
                p, outcome = _separate(contacts.resting, q, p, contacts)
                memory = restart(memory)
                break
            tau = _time_of_impact(method, dynamics, forces, contacts.continuous, p, late, memory)
            # Hops that die out are counted to rest while their height means something, not for ever in rounding errors.
            half = type_of(h, 0.5)
            top = advance(method, dynamics, forces, p, half * tau, memory)[0]
            flat = nearest(contacts.continuous, top) <= slack
            stalls = stalls + 1 if flat or tau < h / 1048576 else 0
            impacts += 1
            q, after = advance(method, dynamics, forces, p, tau, memory)
            p, outcome = _separate(contacts.continuous, q, p, contacts)
            memory = restart(memory)
            left = left - tau
    else:
        q, after = advance(method, dynamics, forces, p, left, memory)
        p, memory = q, after
    if outcome == PASS and nearest(contacts.discrete, p) < 0:
        # Out of one collider must not mean into another, and only the beginning of the step is legal for all.
        p, outcome = _separate(contacts.discrete + contacts.continuous, p, legal, contacts)
        memory = restart(memory)
    return p, memory, outcome
