"""The way of a particle for a part of a step as if it met nothing new: free, or on the colliders that it lies on."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.dents import dented
from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.response import crossable
from particlesim.compiler import on_stack, outlined
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.at_rest import rough, runs
from particlesim.engine.step.contacts import loose, nowhere, rounding_of_step, sunk, touches
from particlesim.engine.step.creases import no_faster, wedged
from particlesim.engine.step.lying import borne, no_higher, settled_one
from particlesim.engine.step.particle_step import advance, restart
from particlesim.engine.step.resting import LEVEL
from particlesim.laws.registry import gap, moved_to

MAX_SWEEPS = 8
"""Passes over the colliders that a particle lies on before it rests where its step began, and looks for when it turns."""
LIVELY, CALM, SURE = 0, 1, 2
"""What happens to a particle that touches: it rebounds; lies, if its hops are shorter than the step; lies in any case."""


@outlined
def step_of(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """`advance`, for where it is looked at one particle by itself."""
    return advance(method, dynamics, forces, p, h, memory)


@outlined
def glide(
    method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any, calm: Any
) -> Any:
    """The way of a particle for a time h as if it met nothing new: free, or, where it is `calm`, on the colliders that it
    lies on. Returns the particle, the method's memory, on which it lies, and the part of h after which it turns around."""
    q, memory = step_of(method, dynamics, forces, p, h, memory)
    on, turn = nowhere(contacts.continuous), type_of(h, 1)
    if calm > LIVELY:
        slack, sure = rounding_of_step(contacts, p, q, h), calm == SURE
        r, on, turn = settled_one(contacts.continuous, p, q, h, contacts.tolerance, slack, sure)
        if any(on) and turn >= 1 and touches(contacts.continuous, on, p, slack):
            # Beside the edge of one that it touches it may only be without the others, which keep it from there.
            for _ in range(len(contacts.continuous)):
                r, more, _ = settled_one(contacts.continuous, p, r, h, contacts.tolerance, slack, sure)
                on = tuple(one | other for one, other in zip(on, more, strict=True))
        # The way along a shape with dents may end at another part of it: what is behind that does not matter.
        blocked = any(dented(c.shape) for c in contacts.continuous) & (turn < 1)
        wedge = rough(contacts.continuous) & (sum(on) > 1)
        if (wedge or loose(contacts.continuous, on, p, r, slack)) and not blocked:
            r, on, turn = _corner(contacts, p, q, r, on, h, slack, sure)
        elif turn >= 1:
            r = no_higher(contacts.continuous, on, p, q, r, h, contacts.tolerance, slack)
        if any(on) and _off(contacts.continuous, on, q, r, slack):
            on, turn = nowhere(contacts.continuous), type_of(h, 1)  # beyond an edge, where nothing bears it
        if any(on):
            q, memory = r, restart(memory)
    return q, memory, on, turn


def _carried(colliders: Any, on: Any) -> Any:
    """Whether a particle lies on a collider that moves."""
    if len(colliders) == 0:
        return False
    others = _carried(colliders[1:], on[1:])
    return others | on[0] if isinstance(colliders[0].shape, MovingRecord) else others


def _off(colliders: Any, on: Any, q: Any, r: Any, slack: Any) -> Any:
    """Whether the end r of a step that would be free to q is above all thin colliders on which a particle lies."""
    if len(colliders) == 0:
        return True
    others = _off(colliders[1:], on[1:], q, r, slack)
    if not others or not on[0]:
        return others
    lift = abs(r.x - q.x) + abs(r.y - q.y) + abs(r.z - q.z)
    return crossable(colliders[0]) and gap(colliders[0], r) > slack + type_of(slack, LEVEL) * lift


@outlined
def _sunk(colliders: Any, on: Any, p: Any, q: Any, slack: Any) -> Any:
    return sunk(colliders, on, p, q, slack)


def _note(lies: Any, on: Any) -> None:
    """Write down on which colliders a particle lies."""
    for k, here in enumerate(on):
        lies[k] = here


@outlined
def _on_one(contacts: Any, on: Any, c: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    """The step on collider c alone, its turn, and whether that leads into none on which the particle lies."""
    here, lain, bend = borne(c, p, q, h, contacts.tolerance, slack, True)
    # As in `glide`: what is behind another part of a shape with dents does not matter.
    blocked = dented(c.shape) & (bend < 1)
    return lain, bend, here and (blocked or not _sunk(contacts.continuous, on, p, lain, slack))


@outlined
def _between_two(contacts: Any, on: Any, c: Any, d: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    """As `_on_one`, along the crease between colliders c and d."""
    crept, bend, presses = wedged(c, d, p, q, h, contacts.tolerance)
    free = presses and not _sunk(contacts.continuous, on, p, crept, slack)
    if free and (crossable(c) or crossable(d)):  # a curved crease, where a stop may be too high
        crept = no_faster(contacts.continuous, p, q, crept, h, contacts.tolerance, slack)
    return crept, bend, free


@outlined
def _beside(contacts: Any, on: Any, c: Any, k: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    """As `_between_two`, of collider c, the k-th, and the first before it for which there is such a step. That k is no known
    number makes this one function for all colliders of a kind."""
    r, turn, found = q, type_of(h, 1), False
    for j, d in enumerate(contacts.continuous):
        if (j < k) & on[j] & (not found):
            r, turn, found = _between_two(contacts, on, c, d, p, q, h, slack)
    return r, turn, found


def _stopped(p: Any, q: Any) -> Any:
    """The end of a step that stays where it began, at rest."""
    zero = p.x - p.x
    return moved_to(q, p.x, p.y, p.z, zero, zero, zero, q.t)


@outlined
def _corner(contacts: Any, p: Any, q: Any, r: Any, on: Any, h: Any, slack: Any, sure: Any) -> Any:
    """The step of a particle that lies on several colliders, one of which moves it off or into another: on one of them,
    along the crease between two, or on each in turn. One that stays caught comes to rest where it was; at a shape
    with dents, whose rounded edges no plane follows, or one that moves on, it lies on nothing, and hops."""
    turn, found = type_of(h, 1), False
    lies = on_stack(1, len(on), np.bool_)[0]  # one argument, however many colliders there are
    _note(lies, on)
    for k, c in enumerate(contacts.continuous):
        if on[k] & (not found):
            lain, bend, found = _on_one(contacts, lies, c, p, q, h, slack)
            r, turn = chosen(found, lain, r), bend if found else turn
    for k, c in enumerate(contacts.continuous):
        if k > 0 and on[k] & (not found):
            crept, bend, found = _beside(contacts, lies, c, k, p, q, h, slack)
            r, turn = chosen(found, crept, r), bend if found else turn
    dents = any(dented(c.shape) for c in contacts.continuous)
    moves = any(map(runs, contacts.continuous)) or _carried(contacts.continuous, on)
    if not found and sum(on) > 2 and not (dents or moves):
        r, found = (
            _stopped(p, r),
            True,
        )  # no side and no crease leads on, though pushes in turn might lift it out
    if not found:
        sweeps = 0
        while turn >= 1 and _sunk(contacts.continuous, lies, p, r, slack) and sweeps < MAX_SWEEPS:
            r, more, turn = settled_one(contacts.continuous, p, r, h, contacts.tolerance, slack, sure)
            on = tuple(one | other for one, other in zip(on, more, strict=True))
            _note(lies, on)
            sweeps += 1
        if _sunk(contacts.continuous, lies, p, r, slack):
            if dents or _carried(contacts.continuous, on):
                r, on, turn = q, nowhere(contacts.continuous), type_of(h, 1)
            else:
                r = _stopped(p, r)
        elif not any(map(runs, contacts.continuous)) and (dents or sweeps > 0):
            r = no_faster(contacts.continuous, p, q, r, h, contacts.tolerance, slack)
    return r, on, turn
