"""When a particle meets a collider within a step: how far it goes until then, and the moment of the impact."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.dents import dented
from particlesim.compiler import outlined
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.contacts import ahead, nearest, nowhere, rounding, rounding_of_step
from particlesim.engine.step.crossing import beyond, crossing, even, turned_away
from particlesim.engine.step.gliding import LIVELY, MAX_SWEEPS, glide
from particlesim.laws.registry import gap_and_normal, moved_to

SAME = 1 - 1e-6
"""The part of a step at the end of which a particle turns around counts as the whole step beyond this, where it ends outside
of all colliders."""
NO_TIME = 2.0**20
"""Impacts that lie no further apart than this part of a step (1 over it) take no time."""
AT_ONCE = 2.0**10
"""What is met before this part of a way (1 over it) has been touched all the time."""
MAX_LEAVES = 40
"""The shortest part of a step, as a power of two, after which it is looked whether a particle has left a surface."""
MAX_HALVINGS = 80
"""Bound on the search for the time of impact; bisection alone ends after 53."""
WIDE = 16
"""The ratio of the ends of a bracket from which on it is halved in its logarithm: hops end soon after their beginning."""
LAST_PLACES, FARTHER = 2, 4
"""How far into its bracket that search goes from an end at least, in last places, and how much farther each time."""
MAX_SOONER = 8
"""How often it is looked for what is met before an impact that was found on a way that bends otherwise."""
MAX_GUESSES = 24
"""Turns of that search that may guess: where a way ends in a seam, gaps stop falling, and guesses help little."""


@outlined
def time_of_impact(
    method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any, calm: Any
) -> Any:
    """The first representable time in (0, h] at which a collider is overlapped, by Muller's method."""
    # The root of the parabola through the ends of a bracket and the end that it had before (Muller, MTAC 10, 208 (1956)),
    # kept inside the bracket: gaps above a plane under gravity are one. A turn bisects where three have not halved the
    # bracket, and in the end all do, so that it is sure to close. Roots that come from one side alone would leave it wide:
    # one at an end goes a few last places into it, and farther each time, as in Brent's method.
    half = type_of(h, 0.5)  # dividing by the integer 2 would turn single precision into double
    early, late = h - h, h
    q, _, on, _ = glide(method, dynamics, forces, contacts, p, late, memory, calm)
    above = max(ahead(contacts, on, p), h - h)
    below = ahead(contacts, on, q)
    # A particle that touches and sinks at once hits now: resting contact must not cost a search. A fast one would be deep
    # by then, and gain the energy of being put back: it hits as soon as it is deep enough to be seen.
    now = h * type_of(h, 2.0**-30)
    q, _, on, _ = glide(method, dynamics, forces, contacts, p, now, memory, calm)
    depth = -ahead(contacts, on, q)
    if depth > 0:
        seen = type_of(h, 8) * rounding(contacts, p)
        if depth <= seen:
            return now
        sooner = now * (seen / depth)
        q, _, on, _ = glide(method, dynamics, forces, contacts, p, sooner, memory, calm)
        return sooner if ahead(contacts, on, q) < 0 else now
    other, beyond = early, above
    if now < late:
        # Before, as after a rebound, gaps are rounding errors, which may well be an overlap.
        early, above = now, -depth
    aside = type_of(h, LAST_PLACES * (2.0**-23 if isinstance(h, np.float32) else 2.0**-52))
    slow, wide = 0, late - early
    for turn in range(MAX_HALVINGS):
        middle = early + (late - early) * half
        if not (early < middle < late):
            break
        if late > type_of(h, WIDE) * early > 0:
            middle = np.sqrt(early) * np.sqrt(late)
        if late - early < half * wide:
            slow, wide = 0, late - early
        slow = (slow + 1) % 4
        if slow > 0 and turn < MAX_GUESSES and other != early:
            guess = early + _root(early, above, late, below, other, beyond)
            least = aside * late
            aside = aside if early + least < guess < late - least else FARTHER * aside
            guess = max(min(guess, late - least), early + least)
            middle = guess if early < guess < late else middle
        q, _, on, _ = glide(method, dynamics, forces, contacts, p, middle, memory, calm)
        value = ahead(contacts, on, q)
        if value < 0:
            other, beyond = late, below
            late, below = middle, value
        else:
            other, beyond = early, above
            early, above = middle, value
    return late


def _root(early: Any, above: Any, late: Any, below: Any, other: Any, beyond: Any) -> Any:
    """The time after `early` at which the parabola through three points is 0; it is `above` there and `below` at `late`."""
    width, two = late - early, type_of(early, 2)
    slope = (below - above) / width
    bend = ((beyond - above) / (other - early) - slope) / (other - late)
    rise = slope - bend * width
    root = np.sqrt(max(rise * rise - two * two * bend * above, rise - rise))
    return -(rise + root) / (two * bend) if rise > 0 else two * above / (root - rise)


@outlined
def reached(
    method: Any,
    dynamics: Any,
    forces: Any,
    contacts: Any,
    p: Any,
    late: Any,
    place: Any,
    memory: Any,
    calm: Any,
) -> Any:
    """The particle in the collider that it crosses at the time `late`; whether its method brought it there; and whether that
    is farther from the parabola than rounding tells.

    A step to that time may lead elsewhere than the parabola, by its error of third order: beside the collider, or behind it.
    Then the parabola is right, as no path may lead through a collider.
    """
    q, _, on, _ = glide(method, dynamics, forces, contacts, p, late, memory, calm)
    there = moved_to(q, place.x, place.y, place.z, q.vx, q.vy, q.vz, q.t)
    exact = ahead(contacts, on, q) < 0
    if turned_away(contacts.continuous, there, q):
        exact = False
    x, y, z = q.x if exact else there.x, q.y if exact else there.y, q.z if exact else there.z
    off = abs(q.x - place.x) + abs(q.y - place.y) + abs(q.z - place.z) > rounding_of_step(
        contacts, p, q, late
    )
    return moved_to(q, x, y, z, q.vx, q.vy, q.vz, q.t), exact, off


@outlined
def met_before(
    method: Any,
    dynamics: Any,
    forces: Any,
    contacts: Any,
    p: Any,
    q: Any,
    on: Any,
    tau: Any,
    memory: Any,
    calm: Any,
) -> Any:
    """The time of the impact of a particle that goes from p to q in a time `tau`, where the way to another one was not the
    parabola to its end: that to q is nearer to it, and may lead into something else before. Also the particle there, and on
    what it lies until then."""
    for _ in range(MAX_SOONER):
        late, place = crossing(contacts, on, p, q, tau)
        if not late < tau:
            break
        r, exact, _ = reached(method, dynamics, forces, contacts, p, late, place, memory, calm)
        tau, q = late, r
        if exact:
            tau = time_of_impact(method, dynamics, forces, contacts, p, late, memory, calm)
            q, _, on, _ = glide(method, dynamics, forces, contacts, p, tau, memory, calm)
    return tau, q, on


@outlined
def stretch(
    method: Any,
    dynamics: Any,
    forces: Any,
    contacts: Any,
    p: Any,
    left: Any,
    memory: Any,
    calm: Any,
    whole: Any,
) -> Any:
    """The way of a particle for a time `left` (the `whole`, if asked for) or, where it comes to a stop and will not stay
    there, or to another part of what it lies on, up to then; its method's memory, on which it lies, and for how long; and
    whether another part is in the whole way, so that it rests where it is."""
    length, shorter = left, 0
    q, after, on, turn = glide(method, dynamics, forces, contacts, p, left, memory, calm)
    if turn < 1 and not whole:
        length = turn * left
        q, after, on, turn = glide(method, dynamics, forces, contacts, p, length, memory, calm)
        while (turn < SAME or (turn < 1 and _too_far(contacts, p, q))) and shorter < MAX_HALVINGS:
            # Near the end already, or, as it bends more than was seen, far from it.
            length = turn * length if shorter < MAX_SWEEPS else type_of(left, 0.5) * turn * length
            q, after, on, turn = glide(method, dynamics, forces, contacts, p, length, memory, calm)
            shorter += 1
        if not any(on):
            # It flies, which no other part ends: what is in its way it meets.
            length = left
            q, after, on, turn = glide(method, dynamics, forces, contacts, p, left, memory, LIVELY)
    stuck = whole and turn < 1 and _parts(contacts.continuous, on)
    if stuck:
        zero = left - left
        q = moved_to(q, p.x, p.y, p.z, zero, zero, zero, p.t)
    return q, after, on, length, stuck


def _too_far(contacts: Any, p: Any, q: Any) -> Any:
    """Whether a glide from p to q ends in a collider, deeper than rounding tells, or behind one."""
    slack = rounding(contacts, p)
    return nearest(contacts.continuous, q) < -slack or beyond(contacts.continuous, p, q, slack)


def _parts(colliders: Any, on: Any) -> Any:
    """Whether a particle lies on a shape that may have several parts."""
    if len(colliders) == 0:
        return False
    others = _parts(colliders[1:], on[1:])
    return others | on[0] if dented(colliders[0].shape) else others


@outlined
def first_met(
    method: Any,
    dynamics: Any,
    forces: Any,
    contacts: Any,
    p: Any,
    q: Any,
    on: Any,
    length: Any,
    memory: Any,
    calm: Any,
) -> Any:
    """What `crossing` tells of the way from p to q in a time `length`, on some colliders."""
    late, place = crossing(contacts, on, p, q, length)
    if late < length and any(on):
        # Up to there it may lie on less, as what touches is less in a shorter step, and meet the rest sooner.
        near, _, left_on, _ = glide(method, dynamics, forces, contacts, p, late, memory, calm)
        sooner, spot = crossing(contacts, left_on, p, near, late)
        late, place = (sooner, spot) if sooner < late else (late, place)
    return late, place


@outlined
def lying_for(
    method: Any,
    dynamics: Any,
    forces: Any,
    contacts: Any,
    p: Any,
    h: Any,
    memory: Any,
    calm: Any,
    least: Any,
) -> Any:
    """How long a particle lies that does not until the end of a time h, as one that slides over an edge, or does so on a way
    that is not even; the particle then; and on what it lies. The longest of h/2, h/4 ... that ends on the surface, or comes
    evenly to something that it does not touch now; 0 if none is longer than `least`."""
    half = type_of(h, 0.5)
    part, found, r, lain = h, h - h, p, nowhere(contacts.continuous)
    for _ in range(MAX_HALVINGS):
        part = part * half
        if part < least:
            break
        q, _, on, turn = glide(method, dynamics, forces, contacts, p, part, memory, calm)
        if any(on) and turn >= 1:
            late, _ = crossing(contacts, on, p, q, part)
            meets = late * AT_ONCE >= part if late < part else ahead(contacts, on, p) > rounding(contacts, p)
            ends = (meets and even(p, q, part)) or (late >= part and ahead(contacts, on, q) >= 0)
            if ends and _clears(contacts, on, p, q):
                found, r, lain = part, q, on
                break
    return found, r, lain


def _clears(contacts: Any, on: Any, p: Any, q: Any) -> Any:
    """Whether a particle that glides from p to q, maybe around a rounded edge, meets nothing halfway, where it is farther
    out than the straight line."""
    half = type_of(p.x, 0.5)
    x, y, z = half * (p.x + q.x), half * (p.y + q.y), half * (p.z + q.z)
    mid = moved_to(p, x, y, z, q.vx, q.vy, q.vz, half * (p.t + q.t))
    for c, here in zip(contacts.continuous, on, strict=True):
        g, n = gap_and_normal(c, mid)
        lift = min(g, g - g) if here else g - g
        x, y, z = (a if u is None else a - lift * u for a, u in zip((mid.x, mid.y, mid.z), n, strict=True))
        mid = moved_to(mid, x, y, z, mid.vx, mid.vy, mid.vz, mid.t)
    return ahead(contacts, on, mid) >= -rounding(contacts, mid)


@outlined
def leaving(method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any) -> Any:
    """How long a particle that touches, and is not pressed on, takes until it is off all surfaces but for rounding errors,
    and the particle then; 0 if it does not leave. Until then gaps may tell impacts that are none."""
    two = type_of(h, 2)
    part, found, r = h, h - h, p
    for _ in range(MAX_LEAVES):
        part = part / two
    for _ in range(MAX_LEAVES):
        q, _, on, _ = glide(method, dynamics, forces, contacts, p, part, memory, LIVELY)
        if ahead(contacts, on, q) > two * rounding(contacts, q):
            late, _ = crossing(contacts, on, p, q, part)
            if late >= part and not turned_away(contacts.continuous, p, q):
                found, r = part, q
            break
        part = part * two
    return found, r
