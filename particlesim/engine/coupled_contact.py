"""Contacts of particles that step together, at the end of a step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from particlesim.engine.columns import fetch, note, span, store, type_of
from particlesim.engine.compile import inline, stub
from particlesim.engine.contact import Simple, overlapped, respond, trace
from particlesim.engine.steppers import Newtonian
from particlesim.integrators.base import CompositionRecord
from particlesim.laws import Particle, Vector, force, law, moved_to

Impl = Callable[..., Any]


class FrozenRecord(NamedTuple):
    """A force that stays the same over a step [N]."""

    x: float
    y: float
    z: float


@law(force, FrozenRecord)
def frozen_force(f: FrozenRecord, p: Particle) -> Vector:
    return f.x, f.y, f.z


def forget(memory: Any, i: Any) -> Any:
    """What the method remembers of particle i no longer holds."""
    return stub()


@inline(forget)
def _forget(memory: Any, i: Any) -> Impl:
    if len(memory) == 0:
        return lambda memory, i: None

    def impl(memory: Any, i: Any) -> None:
        memory[-1][i] = 0

    return impl


def collide(parts: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> Any:
    """Contacts at the end of a step.

    A particle that ends inside a collider is followed from impact to impact under the mean force of the step.
    """
    return stub()


@inline(collide)
def _collide(parts: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, before, share, t, end, h: None
    contacts = parts[0].types[2]
    if contacts.instance_class is Simple and len(contacts.types[0]) == 0:
        return lambda parts, c, before, share, t, end, h: collide(parts[1:], c, before, share, t, end, h)

    def impl(parts: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> None:
        part = parts[0]
        for i in range(max(share.first, part.first), min(share.last, part.last)):
            begin, hi = span(c.clock, i, t, end, h)
            if hi > 0:
                q = fetch(c, i, end)
                if overlapped(part.contacts, q):
                    k = q.m / hi
                    mean = FrozenRecord(
                        k * (q.vx - before[3, i]), k * (q.vy - before[4, i]), k * (q.vz - before[5, i])
                    )
                    p = moved_to(
                        q,
                        before[0, i],
                        before[1, i],
                        before[2, i],
                        before[3, i],
                        before[4, i],
                        before[5, i],
                        begin,
                    )
                    whole = CompositionRecord((type_of(h, 1),), (type_of(h, 1),))
                    r, _, outcome = trace(whole, Newtonian(), (mean,), part.contacts, p, hi, ())
                    forget(c.memory, i)
                else:
                    r, outcome = respond(part.contacts, q)
                    if r.vx != q.vx or r.vy != q.vy or r.vz != q.vz:
                        forget(c.memory, i)
                store(c, i, r)
                note(c.clock, i, outcome, r.t)
        collide(parts[1:], c, before, share, t, end, h)

    return impl
