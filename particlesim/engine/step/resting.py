"""Lasting contact: the step of a particle that lies on a collider, in closed form.

A particle lies on a collider where it touches it and forces, not its own velocity, move it in (`lies`). The contact force
then cancels the force into the surface. Over the step it gives the normal impulse per mass J = −(v·n), with v the velocity
at the end of a step without contact; that end is put back on the surface without rebound. Friction acts as a constant force
during the step. With v the velocity along the surface relative to it, v₀ at the beginning and a h = v₁ − v₀ its change by
the other forces,

- a particle at rest stays at rest, to the last bit, as long as |a h| ≤ μ_s J; beyond that it starts in the direction of a;
- a sliding particle loses μ_k J against its direction, and stops during the step where that is more than its speed.

Both are exact for a force that does not change within the step and a straight path, at any length of the step. A particle
that stops on a slope that is too steep for rest turns around within the step: `turn` says when.

Everything here is selects, so that a loop over a block stays vectorised. The projection is that of time-stepping schemes for
rigid bodies (Moreau 1988; Stewart, Trinkle, Int. J. Numer. Meth. Eng. 39, 2673 (1996)), the stop that of an event.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.box import BoxRecord
from particlesim.colliders.dents import dented
from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.plane import HalfSpaceRecord, PlaneRecord
from particlesim.colliders.pose import ShiftedRecord, TurnedRecord
from particlesim.colliders.response import (
    ColliderRecord,
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
from particlesim.colliders.solid import HollowConvexRecord
from particlesim.colliders.sphere import BowlRecord
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.contacts import ALONG_AXES, coarse, presses
from particlesim.laws.registry import PASS, gap, gap_and_normal, has_law, moved_to, side_from, surface

LEVEL = 2.0**-10
"""How far into a surface the velocity of a particle that moves along it may lead, in units of how deep the free step is:
normals that take a search are not exact."""

STRAIGHT = 1 - 2.0**-20
"""The cosine of the angle between two normals from which on they are those of one flat side."""

EDGE, ROUNDED = 2.0**-20, 2.0**-44
"""How near to an edge is on it, in units of the depth of a step and of coordinates."""

NOISE = 2.0**-19
"""Part of a speed that its rounding errors in single precision stay below, as `records.CONTACT_TOLERANCE` says."""


def lies(c: Any, p: Any, q: Any, touch: Touch, h: Any, tolerance: Any, slack: Any, sure: Any) -> Any:
    """Whether a step from p to q is rest on a collider: p touches it and does not approach it, its own velocity explains
    less than half of how deep q is, as in a bowl, and forces the rest. Any hop of p is then shorter than the step, and so
    are all that would follow; one on an elastic collider does not end, unless there is none. Where it is `sure` that hops
    have died out, only touching counts. What ends beside another face, as over an edge, does not lie on this one."""
    coasting = gap(c, moved_to(q, p.x + h * p.vx, p.y + h * p.vy, p.z + h * p.vz, p.vx, p.vy, p.vz, q.t))
    n = touch.up
    level = type_of(h, LEVEL) * touch.depth - slack if crossable(c) else -slack
    calm = (
        (coasting >= type_of(h, 0.5) * touch.depth - slack)
        & (h * along(n, p) >= level)
        & (c.response.bounce < 2)
    )
    if glides_in(c):
        # Along a round side nothing hops, however fast it is.
        calm |= (h * along(n, p) >= level) & (c.response.bounce < 2)
    calm |= abs(coasting) <= slack
    if coarse(tolerance):
        # A slow impact is no deeper than rounding errors, either: velocities tell it from rest.
        own, noise = along(n, p), type_of(h, NOISE) * (abs(p.vx) + abs(p.vy) + abs(p.vz))
        slow = own >= type_of(h, 0.5) * along(touch.normal, q) - noise
        slow = (slow & (c.response.bounce < 2)) | (abs(own) <= noise)
        calm = slow if touch.depth > -(slack + slack) else calm
    calm |= sure
    calm &= same_face(c, touch)
    down = presses(touch.depth, touch.normal, q, slack, tolerance)
    return (touch.start <= slack) & down & calm & (c.response.outcome == PASS)


BESIDE = 2.0**-30
"""How far beside one side of a container it is looked for another one that a particle touches, in parts of coordinates."""
SWIFT = 4.0
"""How much faster than what friction takes in a step is what slides, and does not stop soon."""
LESS = 1.01
"""How much nearer than its energy allows a swing ends: what lifts it onto the surface again is less than that."""


class Touch(NamedTuple):
    """Gap and normal of a collider at the beginning of a step, and at its end."""

    start: Any
    up: Any
    depth: Any
    normal: Any


def same_face(c: Any, touch: Touch) -> Any:
    """Whether a step ends at the face of a collider at which it began, and not beside another one, as over an edge."""
    n, m = touch.up, touch.normal
    if not crossable(c):
        return True
    return n[0] * m[0] + n[1] * m[1] + n[2] * m[2] > type_of(touch.start, 0.5)


def touched(c: Any, p: Any, q: Any) -> Touch:
    """How a step from p to q touches a collider. Where p touches two sides, as in the rim of a pipe, that of q counts."""
    start, up = gap_and_normal(c, p)
    if not (glides_in(c) and dented(c.shape)):
        return Touch(start, up, *sunk(c, p, start, up, q))
    _, m = gap_and_normal(c, q)
    away = type_of(start, BESIDE) * (abs(p.x) + abs(p.y) + abs(p.z) + p.r)
    x, y, z = (a + away * n for a, n in zip((p.x, p.y, p.z), up, strict=True))
    other, n = gap_and_normal(c, moved_to(p, x, y, z, p.vx, p.vy, p.vz, p.t))
    half = type_of(start, 0.5)
    there = (dot(up, m) < half) & (dot(n, m) > half) & (other < half * away)
    side = tuple(b if there else a for a, b in zip(up, n, strict=True))
    start = other - away * dot(up, n) if there else start
    return Touch(start, side, *sunk(c, p, start, side, q))


def sunk(c: Any, p: Any, start: Any, up: Any, q: Any) -> Any:
    """Gap and normal of a collider for the end q of a step from p, which touches it with the gap `start` and the normal
    `up`: those of the side that p is on. A free step may well lead through a thin sheet on which a particle lies, and there
    is no other side for it; and near an edge another side may be nearer than the one under which it ends."""
    g, n = side_from(c, p, q)
    if not crossable(c):
        return g, n
    depth = start + up[0] * (q.x - p.x) + up[1] * (q.y - p.y) + up[2] * (q.z - p.z)
    lean, half = dot(n, up), type_of(g, 0.5)
    behind = (lean < -half) & (depth < 0)
    x, y, z = (b - depth * a for a, b in zip(up, (q.x, q.y, q.z), strict=True))
    over, m = side_from(c, p, moved_to(q, x, y, z, q.vx, q.vy, q.vz, q.t))
    # Of what begins on the edge between both, it is not known on which of them it lies.
    height = g + dot(n, (p.x - q.x, p.y - q.y, p.z - q.z))
    under = (
        (abs(over) <= type_of(g, -LEVEL) * depth)
        & (height < type_of(g, EDGE) * depth - type_of(g, ROUNDED) * (abs(p.x) + abs(p.y) + abs(p.z) + p.r))
        & (dot(m, up) >= type_of(g, STRAIGHT))
        & (lean < half)
        & (g < 0)
    )
    behind |= under & (depth < 0)
    return depth if behind else g, tuple(a if behind else b for a, b in zip(up, n, strict=True))


def bends(c: Any) -> bool:
    """Whether the surface of a collider may bend smoothly under what lies on it."""
    return not isinstance(c.shape, (PlaneRecord, HalfSpaceRecord, *ALONG_AXES)) and c.response.belt is None


def turns(c: Any) -> bool:
    """Whether what presses on a collider may turn along the way there: forces do, or it is a container that is round."""
    return bends(c) and (c.response.turning is not None or glides_in(c))


def glides_in(c: Any) -> bool:
    """Whether a collider is a container with round sides, under forces that are the same along it. Edges between its sides
    are right or sharper, which no step along a side leads around (`same_face`)."""
    return c.response.even is not None and c.response.belt is None and round_inside(c.shape)


def round_inside(shape: Any) -> bool:
    """Whether a shape is the inside of a sphere, or of a solid with round sides and no dents."""
    if isinstance(shape, MovingRecord):
        return shape.spin is None and round_inside(shape.shape)
    if isinstance(shape, (ShiftedRecord, TurnedRecord)):
        return round_inside(shape.shape)
    if isinstance(shape, HollowConvexRecord):
        return not flat_sided(shape.shape)
    return isinstance(shape, BowlRecord)


def flat_sided(shape: Any) -> bool:
    """Whether a solid has flat sides alone, but for its edges."""
    if isinstance(shape, (ShiftedRecord, TurnedRecord)):
        return flat_sided(shape.shape)
    return isinstance(shape, BoxRecord)


def glided(c: Any, p: Any, q: Any, touch: Touch, h: Any, tolerance: Any) -> tuple[Any, Any]:
    """As `held`, for a step from p to q along the inside of a round container: as if it were smooth, and less what friction
    takes of that. What comes to a stop, or turns back, is `held`."""
    start, end, way = carried(c, p, q, touch, h, tolerance)
    response, one = c.response, type_of(h, 1)
    dull = ResponseRecord(one, response.loss, response.keep, response.outcome, even=response.even)
    smooth = ColliderRecord(c.shape, dull)
    r, _ = held(smooth, start, end, way, h, tolerance, True)
    if len(response.even) == 0:  # what late velocities tell is not the energy
        r = with_energy(smooth, p, q, r, touch.up, way.normal, h)
    if response.friction is None:
        return r, one
    slow, turn = held(c, p, q, touch, h, tolerance)
    half, v = type_of(h, 0.5), (r.vx, r.vy, r.vz)
    drag = response.friction.kinetic * max(-along(way.normal, end), h - h)
    change = square((q.vx - p.vx, q.vy - p.vy, q.vz - p.vz))
    least = type_of(h, SWIFT) * drag + half * np.sqrt(change)
    old, new = square((p.vx, p.vy, p.vz)), square(v)
    fast = min(old, new) > least * least
    inverse = one / np.sqrt(new) if new > 0 else one
    # What turns it presses less as it is slowed, with the square of its speed.
    turning = max(-dot((p.vx, p.vy, p.vz), way.normal), h - h)
    drag -= response.friction.kinetic * turning * min(drag * inverse, one)
    back = half * h * drag * inverse
    there = at_place(
        r,
        tuple(x - back * u for x, u in zip((r.x, r.y, r.z), v, strict=True)),
        tuple(u - drag * inverse * u for u in v),
    )
    depth, m = gap_and_normal(c, there)
    speed = turned((there.vx, there.vy, there.vz), way.normal, m, False)
    lift = at_place(r, lifted(c, there, depth, m), speed)
    slid = chosen(dot(m, way.normal) > half, lift, there)  # not off another side
    return chosen(fast, slid, slow), one if fast else turn


def with_energy(c: Any, p: Any, q: Any, r: Any, up: Any, n: Any, h: Any) -> Any:
    """The end r of a step from p along a smooth collider with the normals `up` and n at its ends, with the energy that the
    uniform force gives that would lead to q without it. All is exact but along the direction in which it bends: that speed
    is changed. Where there is none left, at the end of a swing, it has not come as far."""
    zero, one, two = h - h, type_of(h, 1), type_of(h, 2) / h
    v, way = (r.vx, r.vy, r.vz), (r.x - p.x, r.y - p.y, r.z - p.z)
    change = (q.vx - p.vx, q.vy - p.vy, q.vz - p.vz)
    bend = tuple(b - a for a, b in zip(up, n, strict=True))
    level = dot(bend, n)
    bend = tuple(a - level * b for a, b in zip(bend, n, strict=True))
    length2 = dot(bend, bend)
    inverse = one / length2 if length2 > 0 else zero
    part = inverse * dot(v, bend)
    straight = tuple(a - part * b for a, b in zip(v, bend, strict=True))
    left = dot((p.vx, p.vy, p.vz), (p.vx, p.vy, p.vz)) + two * dot(change, way) - dot(straight, straight)
    along = part * part * length2
    k = np.sqrt(left / along) if (left > 0) & (along > 0) else zero
    short, pull, gone = left < 0, dot(change, bend), inverse * dot(way, bend)
    nearer = type_of(h, -LESS) * left / (two * pull) if short & (pull * gone < 0) else zero
    nearer = min(max(nearer, -abs(gone)), abs(gone))
    there = at_place(
        q,
        tuple(x + nearer * b for x, b in zip((r.x, r.y, r.z), bend, strict=True)),
        tuple(a + k * part * b for a, b in zip(straight, bend, strict=True)),
    )
    depth, m = gap_and_normal(c, there)
    ends = lifted(c, there, depth, m)
    short &= dot(m, n) > type_of(h, 0.5)  # not into another side
    return chosen(short, at_place(q, ends, (there.vx, there.vy, there.vz)), chosen(length2 > 0, there, r))


def carried(c: Any, p: Any, q: Any, touch: Touch, h: Any, tolerance: Any) -> tuple[Any, Any, Touch]:
    """A step from p to q along a surface that bends under it, as if it were flat: p and q with velocities along the tangent
    at its end, and how they touch it there.

    What presses has to lead nowhere. Forces at the beginning, which move the particle, press along the normal there, and
    those at the end along that at the end; the impulses of both are told by the free step: (x' − x)/h − v, and the rest of
    v' − v. Otherwise a force that turns with the surface, as that of a spring, would pull the particle along by its
    speed times h/2 or h, for ever. Between the two the velocity turns, and keeps its size.
    """
    one, zero = type_of(h, 1), h - h
    up, v = touch.up, (p.vx, p.vy, p.vz)
    k = one / h
    moved = (q.x - p.x, q.y - p.y, q.z - p.z)
    early = tuple(k * a - b for a, b in zip(moved, v, strict=True))
    late = tuple(b - a - c for a, b, c in zip(v, (q.vx, q.vy, q.vz), early, strict=True))
    press = min(dot(early, up), zero)
    flown = tuple(a + b - press * n for a, b, n in zip(v, early, up, strict=True))
    s = h * press
    there = at_place(q, (q.x - s * up[0], q.y - s * up[1], q.z - s * up[2]), (q.vx, q.vy, q.vz))
    depth, n = sunk(c, p, touch.start, up, there)
    rise, sharp = dot(flown, up), dented(c.shape)
    begun, gone = turned(v, up, n, sharp), turned(flown, up, n, sharp)
    fall = dot(late, n)
    approach = rise + press + fall + dot(flown, n) - rise * dot(up, n)
    # not around an edge, where another side begins
    here = (dot(up, n) < one - tolerance) & (dot(up, n) > type_of(h, 0.5)) & (approach < 0)
    ends = tuple(a + b + (approach - fall) * m for a, b, m in zip(gone, late, n, strict=True))
    return (
        chosen(here, at_place(p, (p.x, p.y, p.z), begun), p),
        chosen(here, at_place(there, (there.x, there.y, there.z), ends), q),
        Touch(
            touch.start,
            up,
            depth if here else touch.depth,
            tuple(a if here else b for a, b in zip(n, touch.normal, strict=True)),
        ),
    )


def turned(v: Any, up: Any, n: Any, sharp: bool) -> Any:
    """The part of a velocity along a surface with the normal `up`, along that with the normal n, as fast; of one that may
    be `sharp`, what leads into a crease is lost."""
    one, a = type_of(v[0], 1), dot(v, up)
    flat = tuple(x - a * axis for x, axis in zip(v, up, strict=True))
    b = dot(flat, n)
    ahead = tuple(x - b * axis for x, axis in zip(flat, n, strict=True))
    size = square(ahead)
    k = np.sqrt(square(flat) / size) if size > 0 else one
    k = one if sharp & (b < 0) else k
    return tuple(k * x for x in ahead)


def lifted(c: Any, q: Any, depth: Any, n: Any) -> Any:
    """The place of q put back on the side of a collider where it has this depth and normal."""
    if has_law(surface, c.shape):
        return surface(c.shape, q)
    return put_back(c.shape, q, depth, n)


def stays(c: Any, p: Any, q: Any, h: Any, tolerance: Any, slack: Any) -> Any:
    """As `borne`, with less to work out: whether p was at rest on a plane along an axis, or slid on it without friction, and
    is pressed so that it goes on like that. It is not sure of others."""
    touch = touched(c, p, q)
    n, approach = touch.normal, along(touch.normal, q)
    here = (along(n, p) == 0) & (touch.depth < 0) & (c.response.outcome == PASS)
    if c.response.friction is None:
        # It has been put there, to the last bit.
        pairs = zip(surface(c.shape, p), (p.x, p.y, p.z), n, strict=True)
        return here & all(True if axis is None else new == old for new, old, axis in pairs), held(
            c, p, q, touch, h, tolerance
        )[0]
    zero = h - h
    most = c.response.friction.static * max(-approach, zero)
    here &= (p.vx == 0) & (p.vy == 0) & (p.vz == 0) & (approach <= 0) & (abs(touch.start) <= slack)
    here &= square(sliding(c.response, n, approach, q)) <= most * most
    stopped = tuple(None if axis is not None else zero for axis in n)
    return here, at_place(q, (p.x, p.y, p.z), with_slide(c.response, n, zero, c.response.keep, stopped))


def held(c: Any, p: Any, q: Any, touch: Touch, h: Any, tolerance: Any, level: bool = False) -> Any:
    """The end of a step from p to q on a collider on which p lies, and the part of the step after which p turns around.
    `level`: velocities are along the surface at the end."""
    response, one = c.response, type_of(h, 1)
    zero = one - one
    n = touch.normal
    approach = along(n, q)
    push = max(-approach, zero)
    if response.friction is None:
        dull = ResponseRecord(one, response.loss, response.keep, response.outcome, None, None, response.belt)
        after, ends = rebound(dull, n, approach, q), lifted(c, q, touch.depth, n)
        hit = approach < 0
        after = tuple(new if hit else old for new, old in zip(after, (q.vx, q.vy, q.vz), strict=True))
        if not level:
            after = unlifted(c, p, q, touch, h, tolerance, (q.x, q.y, q.z), ends, push * push, after)
        return at_place(q, ends, after), one
    before, after = sliding(response, n, along(n, p), p), sliding(response, n, approach, q)
    change = tuple(None if b is None else a - b for a, b in zip(after, before, strict=True))
    # A velocity that is nothing but rounding is none: what stops must be at rest.
    speed2, noise = square(before), tolerance * (abs(q.vx) + abs(q.vy) + abs(q.vz))
    calm = speed2 <= noise * noise
    drag = response.friction.kinetic * push
    base = tuple(None if b is None else (a if calm else b) for a, b in zip(change, before, strict=True))
    # A path that turns by more than friction can hold back does not stop where it turns: friction is against its mean
    # velocity, which is more than friction takes, so that it never works for it.
    length2, ahead, most2 = square(base), dot(after, base), drag * drag
    stops = (ahead <= 0) | (ahead * ahead <= most2 * length2)
    bends = stops & (square(after) * length2 - ahead * ahead > most2 * length2)
    base = tuple(None if b is None else (a + b if bends else b) for a, b in zip(after, base, strict=True))
    length2 = square(base)
    size = np.sqrt(length2)
    inverse = one / size if size > 0 else zero
    way = tuple(None if b is None else inverse * b for b in base)
    left = dot(after, way) - drag
    firm = square(change) <= (response.friction.static * push) * (response.friction.static * push)
    slides = bends | ((left > 0) & ((not calm) | (not firm)))
    # Where it slides to the end: what friction takes from the free end, and half of that for the place. Where it stops: the
    # part `f` of the step until then, at a speed that falls evenly.
    f = zero if calm else length2 / (length2 - dot(after, base) + drag * size)
    half = type_of(h, 0.5) * h
    belt, taken = belt_along(response, n), half * drag
    if response.belt is None:
        # A method that moves from rest a step later is not held back before.
        moved = dot(way, (q.x - p.x, q.y - p.y, q.z - p.z))
        taken = min(taken, max(moved, zero)) if calm else taken
    ends = tuple(
        _along_way(place, old, u, w, slides, taken, h, half * f * size)
        for place, old, u, w in zip((q.x, q.y, q.z), (p.x, p.y, p.z), belt, way, strict=True)
    )
    there = at_place(q, ends, (q.vx, q.vy, q.vz))
    depth, m = sunk(c, p, touch.start, touch.up, there)
    if crossable(c):
        # Held back near an edge, it may be nearer to another side than it is deep.
        beside = dot(n, m) < type_of(h, 0.5)
        depth = touch.depth if beside else depth
        m = tuple(a if beside else b for a, b in zip(n, m, strict=True))
    ends = lifted(c, there, depth, m)
    if response.belt is None:
        rests = calm & (not slides)
        ends = tuple(old if rests else new for old, new in zip((p.x, p.y, p.z), ends, strict=True))
    bent = False
    if crossable(c) and response.belt is None:
        # Held back by friction, it ends where the surface has another direction: what presses it until there.
        bent = dot(n, m) < one - tolerance
        lean = type_of(h, 0.5) * drag * (dot(way, m) - dot(way, touch.up))
        pressed = response.friction.kinetic * max(lean - along(m, q), zero)
        drag = min(pressed, size if bends else dot(after, way)) if bent else drag
    slid = tuple(
        None if a is None else (a - drag * w if slides else zero) for a, w in zip(after, way, strict=True)
    )
    if crossable(c) and response.belt is None:
        up = dot(slid, m)
        slid = tuple(v - up * axis if bent else v for v, axis in zip(slid, m, strict=True))
    if not level:
        slid = unlifted(c, p, q, touch, h, tolerance, (there.x, there.y, there.z), ends, push * push, slid)
    turns = not (slides | calm | firm)
    r = at_place(q, ends, with_slide(response, n, approach + push, response.keep, slid))
    if crossable(c) and response.belt is None:
        # A curved surface may put back what creeps higher than where it came from: what it has not got, it does not gain.
        # What it lay deeper than the surface, by rounding, it is given back.
        force, deep = (q.vx - p.vx, q.vy - p.vy, q.vz - p.vz), min(touch.start, zero)
        climbed = tuple(
            b - a + deep * u for a, b, u in zip((p.x, p.y, p.z), (r.x, r.y, r.z), touch.up, strict=True)
        )
        rise = -dot(force, climbed)
        rounded = tolerance * (abs(r.x) + abs(r.y) + abs(r.z) + p.r)
        rounded *= abs(force[0]) + abs(force[1]) + abs(force[2])
        stuck = rise + rise > h * dot((p.vx, p.vy, p.vz), (p.vx, p.vy, p.vz)) + rounded
        r = chosen(stuck, at_place(q, (p.x, p.y, p.z), (zero, zero, zero)), r)
        turns = turns & (not stuck)
    return r, f if turns else one


def unlifted(
    c: Any,
    p: Any,
    q: Any,
    touch: Touch,
    h: Any,
    tolerance: Any,
    found: Any,
    ends: Any,
    lost: Any,
    v: Any,
) -> Any:
    """A velocity along a surface after a step from p to q that was put back on it, from the place `found` to `ends`, and
    lost `lost` of the square of its speed: slower, where the lift took more work than that.

    On a flat surface both are the same. Where a convex one falls away under the way, less speed than that is lost into it,
    and the lift would add energy.
    """
    if not crossable(c) or c.response.belt is not None:
        return v
    zero = h - h
    change = (q.vx - p.vx, q.vy - p.vy, q.vz - p.vz)
    lift = tuple(b - a for a, b in zip(found, ends, strict=True))
    free = (q.x - p.x, q.y - p.y, q.z - p.z)
    work = dot(change, tuple(a + b for a, b in zip(lift, free, strict=True)))
    had = square(v)
    # A method of first order falls further in a step than its speed tells, and is lifted by as much more.
    gained = dot((q.vx, q.vy, q.vz), (q.vx, q.vy, q.vz)) - dot((p.vx, p.vy, p.vz), (p.vx, p.vy, p.vz))
    left = had + min(lost - gained + work / (type_of(h, 0.5) * h), zero)
    # The lift took it from the motion in which the surface bends; what goes across that, as into a floor, has its own end.
    one, level = type_of(h, 1), dot(touch.up, touch.normal)
    bend = tuple(a - level * b for a, b in zip(touch.up, touch.normal, strict=True))
    length2 = square(bend)
    part = dot(v, bend) / length2 if length2 > 0 else zero
    across = tuple(a - part * b for a, b in zip(v, bend, strict=True))
    rest, turning = square(across), part * part * length2
    k = np.sqrt((left - rest) / turning) if (left > rest) & (turning > 0) else zero
    kept = np.sqrt(max(left, zero) / rest) if (left < rest) & (rest > 0) else one
    slower = (level < one - tolerance) & (left < had)
    return tuple(
        kept * a + k * part * b if slower else each for a, b, each in zip(across, bend, v, strict=True)
    )


def at_place(q: Any, place: Any, velocity: Any) -> Any:
    """The particle at another place, with another velocity."""
    x, y, z = place
    vx, vy, vz = velocity
    return moved_to(q, x, y, z, vx, vy, vz, q.t)


def dot(a: Any, b: Any) -> Any:
    """a·b of vectors that lack the same component, if any."""
    if a[0] is None:
        return a[1] * b[1] + a[2] * b[2]
    if a[1] is None:
        return a[0] * b[0] + a[2] * b[2]
    if a[2] is None:
        return a[0] * b[0] + a[1] * b[1]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Any, b: Any) -> Any:
    """a × b of vectors that lack no component."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _along_way(free: Any, old: Any, belt: Any, way: Any, slides: Any, taken: Any, h: Any, gone: Any) -> Any:
    """A coordinate of a particle that slides to the end, `taken` less than without friction, or stops after it has `gone` so
    far."""
    if way is None:
        return free if slides else old
    stop = old + gone * way if belt is None else old + h * belt + gone * way
    return free - taken * way if slides else stop
