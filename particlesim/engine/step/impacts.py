"""Contact inside a step: projection after it (discrete), or the time of impact within it (continuous).

`meet` applies every collider once, in order; particles that overlap nothing pass unchanged. One collider, or several at
right angles to each other, need nothing more (`Simple`), and the loop over a block stays vectorised. Otherwise
(`Careful`) the few particles that end a step inside a collider, or cross one on the way, are stepped again one by one by
`trace`, which follows their way (`following`).

Particles that lie on colliders rest or slide there (`resting`); only impacts need a search (`moments`). In the loop over a
block `at_rest.rest` takes them through their step, in vectors.

Whether a path goes into a collider, such as a ball or a thin sheet, and comes out again is found on the parabola from its
beginning to its end (`particlesim.colliders.way`).

Where places are kept in single precision, `trace` follows them in double: they would be rounded at every impact.

The velocities of a leapfrog may be late, as those of symplectic Euler are by half a step: an impact that turned them around
would change the energy by h v·f. So what flies into a step with an impact is followed with the velocities of its places, by
velocity Verlet, which without an impact is the same step (`particle_step`). What lies goes its method's own way, unless it
hits something: with two ways in turn, swings along a surface would grow.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.response import along
from particlesim.compiler import outlined
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.at_rest import runs, turning
from particlesim.engine.step.contacts import (
    Careful,
    Simple,
    by_calls,
    coarse,
    nearest,
    rounding,
    rounding_of_step,
)
from particlesim.engine.step.following import ENDED, FLYING, LYING, follow, separate
from particlesim.engine.step.gliding import CALM, SURE, step_of
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
    taken_off,
)
from particlesim.engine.step.lying import settled_one
from particlesim.engine.step.particle_step import BentRecord, Newtonian, advance, restart
from particlesim.engine.step.rebounds import balanced_alone, is_soft, kept_by, lain_alone, settled_alone
from particlesim.engine.step.resting import NOISE
from particlesim.integrators.base import CompositionRecord, VerletRecord
from particlesim.laws.registry import PASS, gap_and_normal, moved_to

EXACT = 2.0**-48
"""The tolerance of contacts in double precision (`records.CONTACT_TOLERANCE`)."""

NOTHING, BOUNCED, LANDED = 0, 1, 2
"""What has happened in a step: no impact, or only of what lay on something before; one, and it flies; it lies now."""


@outlined
def trace(method: Any, dynamics: Any, forces: Any, contacts: Any, p: Any, h: Any, memory: Any) -> Any:
    """One step of one particle from impact to impact: the particle, the method's memory, the outcome, the first impact
    to which an emitter reacts (None where none would), whether it had more impacts than are followed, and whether it has
    bounced, or landed.

    The particle's time is where its step ended: before t + h when it stuck or died.
    """
    if isinstance(contacts, Simple):
        return p, memory, PASS, None, False, NOTHING
    contacts = by_calls(contacts)
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
    elif (
        isinstance(method, (CompositionRecord, VerletRecord))
        and turning(contacts)
        and not any(map(runs, contacts.continuous))
    ):
        q, after, outcome, hit, exhausted, legal, struck = _under_turning(
            method, dynamics, forces, contacts, p, h, memory
        )
    elif lags(method):
        q, after, outcome, hit, exhausted, legal, struck, _, _ = _on_time(
            method, dynamics, forces, contacts, p, h, memory
        )
    else:
        q, after, outcome, hit, exhausted, legal, ends, alone, _ = follow(
            method, dynamics, forces, contacts, p, h, memory, CALM
        )
        struck = _struck(ends, alone)
    if outcome == PASS and nearest(contacts.discrete, q) < 0:
        hit = hear(contacts.discrete, q, hit)
        # Out of one collider must not mean into another, and only the beginning of the step is legal for all.
        q, outcome = separate(contacts.discrete + contacts.continuous, q, legal, contacts)
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
    begun = p if lies else _begun(contacts, p, on_time(method, forces, p, h, memory), h, slack)
    # On what is elastic hops that are shorter than the step would not end.
    elastic = [here & (c.response.bounce >= 2) for here, c in zip(on, contacts.continuous, strict=True)]
    calm = SURE if any(elastic) else CALM
    q, after, outcome, hit, exhausted, legal, ends, alone, hits = follow(
        centred(method, h, lies), dynamics, forces, contacts, begun, h, restart(memory), calm
    )
    if hits and lies and isinstance(method, CompositionRecord):
        # What it hits turns velocities of their places around, also along what it lies on.
        late, _ = along_contacts(contacts, p, _change(p, on_time(method, forces, p, h, memory)), False)
        q, after, outcome, hit, exhausted, legal, ends, alone, _ = follow(
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
            back, _ = along_contacts(contacts, q, _change(q, late), True)
            q = hastened(q, back) if ends == LYING else late
        elif ends == FLYING and not isinstance(method, BentRecord):
            q = taken_off(q, late)
    return q, after, outcome, hit, exhausted, legal, _struck(ends, alone or lies), ends, alone and not lies


def _begun(contacts: Any, p: Any, ahead: Any, h: Any, slack: Any) -> Any:
    """A particle p with the velocity of its place, as it has it `ahead` in flight; less what a collider takes up on which it
    lies, if only for a part of the step."""
    change = _change(p, ahead)
    late, _ = along_contacts(contacts, p, change, False)
    into = (change[0] - late[0], change[1] - late[1], change[2] - late[2])
    leaving = -(p.vx * into[0] + p.vy * into[1] + p.vz * into[2]) * h
    size = np.sqrt(into[0] * into[0] + into[1] * into[1] + into[2] * into[2])
    return chosen((size > 0) & (leaving <= slack * size), hastened(p, late), ahead)


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
        q, after, outcome, hit, exhausted, legal, ends, alone, _ = follow(
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
