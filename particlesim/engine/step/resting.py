"""Lasting contact: the step of a particle that lies on a collider, in closed form.

A particle lies where it touches a collider and does not move into it by its own velocity, and yet the free step ends
inside. The contact force then cancels what presses. Over the step it gives the normal impulse over mass J = −(v·n) of the
free end, which is put back on the surface without rebound. Friction acts as a constant force of the step, with v the
velocity along the surface relative to it, v₀ at its beginning and a h = v₁ − v₀ the change that the other forces make:

- what is at rest stays at rest, to the last bit, as long as |a h| ≤ μ_s J; beyond that it starts in the direction of a;
- what slides loses μ_k J against its direction, and stops in mid-step where that is more than there is.

Both are exact for a force that does not change within the step and a straight path, at any length of the step. A particle
that comes to a stop on a slope that is too steep for it turns around in mid-step: `turn` says when.

Everything here is selects, so that a loop over a block stays vectorised. The projection is that of time-stepping schemes for
rigid bodies (Moreau 1988; Stewart, Trinkle, Int. J. Numer. Meth. Eng. 39, 2673 (1996)), the stop that of an event.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.response import (
    ResponseRecord,
    along,
    belt_along,
    crossable,
    put_back,
    rebound,
    sliding,
    square,
    with_slide,
)
from particlesim.engine.state.columns import type_of
from particlesim.laws.registry import PASS, gap, gap_and_normal, has_law, moved_to, surface


def lies(c: Any, p: Any, q: Any, h: Any, slack: Any) -> Any:
    """Whether a step from p to q is rest on a collider. Any hop of p is shorter than the step, and so are all that would
    follow; one on an elastic collider does not end, unless there is none."""
    coasting = gap(c, moved_to(q, p.x + h * p.vx, p.y + h * p.vy, p.z + h * p.vz, p.vx, p.vy, p.vz, q.t))
    here = (gap(c, p) <= slack) & (sunk(c, p, q)[0] < 0) & (coasting >= -slack)
    return here & ((c.response.bounce < 2) | (coasting <= slack)) & (c.response.outcome == PASS)


def sunk(c: Any, p: Any, q: Any) -> Any:
    """Gap and normal of a collider for the end q of a step from p, which touches it: those of the side that p is on. A free
    step may well lead through a thin sheet on which a particle lies, and there is no other side for it."""
    g, n = gap_and_normal(c, q)
    if not crossable(c):
        return g, n
    start, m = gap_and_normal(c, p)
    depth = start + m[0] * (q.x - p.x) + m[1] * (q.y - p.y) + m[2] * (q.z - p.z)
    behind = (n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < 0) & (depth < 0)
    return depth if behind else g, tuple(a if behind else b for a, b in zip(m, n, strict=True))


def lifted(c: Any, p: Any, q: Any) -> Any:
    """The place of q put back on the side of a collider that p is on."""
    if not crossable(c) or has_law(surface, c.shape):
        g, n = gap_and_normal(c, q)
        return put_back(c.shape, q, g, n)
    g, n = sunk(c, p, q)
    return q.x - g * n[0], q.y - g * n[1], q.z - g * n[2]


def settled(colliders: Any, p: Any, q: Any, h: Any, tolerance: Any, slack: Any) -> Any:
    """The end of a step from p that would end at q without contact, on the colliders on which p lies; which those are; and
    the part of the step after which p turns around, 1 if it does not."""
    if len(colliders) == 0:
        return q, (), type_of(h, 1)
    here = lies(colliders[0], p, q, h, slack)
    r, turn = held(colliders[0], p, q, h, tolerance)
    q = moved_to(
        q,
        r.x if here else q.x,
        r.y if here else q.y,
        r.z if here else q.z,
        r.vx if here else q.vx,
        r.vy if here else q.vy,
        r.vz if here else q.vz,
        q.t,
    )
    q, others, first = settled(colliders[1:], p, q, h, tolerance, slack)
    return q, (here, *others), min(turn if here else type_of(h, 1), first)


def held(c: Any, p: Any, q: Any, h: Any, tolerance: Any) -> Any:
    """The end of a step from p to q on a collider on which p lies, and the part of the step after which p turns around."""
    response, one = c.response, type_of(h, 1)
    zero = one - one
    _, n = sunk(c, p, q)
    approach = along(n, q)
    push = max(-approach, zero)
    if response.friction is None:
        there = _at(q, lifted(c, p, q), (q.vx, q.vy, q.vz))
        dull = ResponseRecord(one, response.loss, response.keep, response.outcome, None, None, response.belt)
        after = rebound(dull, n, approach, q)
        hit = approach < 0
        return _at(
            there,
            (there.x, there.y, there.z),
            tuple(new if hit else old for new, old in zip(after, (q.vx, q.vy, q.vz), strict=True)),
        ), one
    before, after = sliding(response, n, along(n, p), p), sliding(response, n, approach, q)
    change = tuple(None if b is None else a - b for a, b in zip(after, before, strict=True))
    # A velocity that is nothing but rounding is none: what stops must be at rest.
    speed2, noise = square(before), tolerance * (abs(q.vx) + abs(q.vy) + abs(q.vz))
    calm = speed2 <= noise * noise
    base = tuple(None if b is None else (a if calm else b) for a, b in zip(change, before, strict=True))
    size = np.sqrt(square(base))
    inverse = one / size if size > 0 else zero
    way = tuple(None if b is None else inverse * b for b in base)
    drag = response.friction.kinetic * push
    left = _dot(after, way) - drag
    firm = square(change) <= (response.friction.static * push) * (response.friction.static * push)
    slides = (left > 0) & ((not calm) | (not firm))
    # Where it slides to the end: what friction takes from the free end, and half of that for the place. Where it stops: the
    # part `f` of the step until then, at a speed that falls evenly.
    f = zero if calm else size / (size - left)
    half = type_of(h, 0.5) * h
    belt = belt_along(response, n)
    ends = tuple(
        _along_way(place, old, u, w, slides, half * drag, h, half * f * size)
        for place, old, u, w in zip((q.x, q.y, q.z), (p.x, p.y, p.z), belt, way, strict=True)
    )
    there = _at(q, ends, (q.vx, q.vy, q.vz))
    ends = lifted(c, p, there)
    if response.belt is None:
        rests = calm & (not slides)
        ends = tuple(old if rests else new for old, new in zip((p.x, p.y, p.z), ends, strict=True))
    slid = tuple(
        None if a is None else (a - drag * w if slides else zero) for a, w in zip(after, way, strict=True)
    )
    turns = not (slides | calm | firm)
    return _at(q, ends, with_slide(response, n, approach + push, response.keep, slid)), f if turns else one


def _at(q: Any, place: Any, velocity: Any) -> Any:
    """The particle at another place, with another velocity."""
    return moved_to(q, *place, *velocity, q.t)


def _dot(a: Any, b: Any) -> Any:
    """a·b of vectors that lack the same component, if any."""
    if a[0] is None:
        return a[1] * b[1] + a[2] * b[2]
    if a[1] is None:
        return a[0] * b[0] + a[2] * b[2]
    if a[2] is None:
        return a[0] * b[0] + a[1] * b[1]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _along_way(free: Any, old: Any, belt: Any, way: Any, slides: Any, taken: Any, h: Any, gone: Any) -> Any:
    """A coordinate of what slides to the end, `taken` less than without friction, or stops after it has `gone` so far."""
    if way is None:
        return free if slides else old
    stop = old + gone * way if belt is None else old + h * belt + gone * way
    return free - taken * way if slides else stop
