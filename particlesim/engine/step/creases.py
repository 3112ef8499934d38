"""Lasting contact in a crease: where two colliders meet, or two parts of one shape.

Two contact forces cancel the force into both surfaces, and the friction of both acts along the crease as on one surface
(`resting`).

A shape with dents gives one gap and one normal at a time. A particle that rests in a crease of it touches two or three
parts; these are found by evaluating gaps at points a little way inside the shape, and are taken as planes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.plane import PlaneRecord
from particlesim.colliders.response import ColliderRecord, crossable
from particlesim.compiler import outlined
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.contacts import nearest
from particlesim.engine.step.resting import Touch, at_place, cross, dot, held, same_face, touched, unlifted
from particlesim.laws.registry import PASS, first_contact, gap, gap_and_normal, thinnest

LIFT = 8
"""How far above a surface the way along it is looked at, in units of rounding errors."""
LEFT = 4
"""How far from what is in its way a glide may end, in units of that: what is so near is touched."""
LOOK, FURTHER = 64, 32
"""How far into a shape its parts are looked for at first, in units of rounding errors, and by how much further each time."""
GRAZES = 2.0**-6
"""The least sine of the angle at which what is in the way is taken to be met."""
SAME = 2.0**-20
"""How far apart normals of one face may be."""
SOON = 2.0**-16
"""The part of a step after which hops that have died out may come to a part of a shape that counts as touched."""
MOST_BENDS, STRAIGHT = 8, 1 - 2.0**-10
"""Looks for the place in a curved crease at which a glide ends; the least product of normals of one part at both ends of a
step."""
MOST_PARTS = 6
"""Looks for a further part that presses; in a corner there are three."""
THINNER = 26
"""Looks for how far in a shape is thick, each half as far as the last."""


def wedged(c: Any, d: Any, p: Any, q: Any, h: Any, tolerance: Any) -> Any:
    """The end of a step from p to q in the crease between two colliders on which p lies; the part of the step after which p
    turns around; and whether both of them press. Creases of surfaces that move or run are not this simple, and none."""
    one = type_of(h, 1)
    if c.response.belt is not None or d.response.belt is not None:
        return q, one, False
    if isinstance(c.shape, MovingRecord) or isinstance(d.shape, MovingRecord):
        return q, one, False
    zero = one - one
    one_touch, other = _touched_in(c, d, p, q, tolerance), _touched_in(d, c, p, q, tolerance)
    deep, low = one_touch.depth, other.depth
    n, m = _full(one_touch.normal, zero), _full(other.normal, zero)
    velocity = (q.vx, q.vy, q.vz)
    lean = dot(n, m)
    spread = one - lean * lean
    # Normal impulses J n + K m that end both approaches, and the shift that closes both gaps.
    a, b = -dot(n, velocity), -dot(m, velocity)
    j, k = (a - lean * b) / spread, (b - lean * a) / spread
    f, g = (lean * low - deep) / spread, (lean * deep - low) / spread
    found = (q.x, q.y, q.z)
    lifts = tuple(x + f * u + g * v for x, u, v in zip(found, n, m, strict=True))
    inverse = one / np.sqrt(spread)
    way = tuple(inverse * axis for axis in cross(n, m))
    static, kinetic = zero, zero
    for each, push in ((c.response, j), (d.response, k)):
        if each.friction is not None:
            static, kinetic = static + each.friction.static * push, kinetic + each.friction.kinetic * push
    # Along the crease, as `held` along a surface
    before, after = dot(way, (p.vx, p.vy, p.vz)), dot(way, velocity)
    change = after - before
    calm = abs(before) <= tolerance * (abs(q.vx) + abs(q.vy) + abs(q.vz))
    side = one if (change if calm else before) > 0 else -one
    left = side * after - kinetic
    firm = abs(change) <= static
    slides = (left > 0) & ((not calm) | (not firm))
    kept = c.response.keep * d.response.keep
    speed = kept * side * left if slides else zero
    part = zero if calm else abs(before) / (abs(before) - left)
    half = type_of(h, 0.5) * h
    shift = (
        -half * side * kinetic
        if slides
        else half * part * before - dot(way, (q.x - p.x, q.y - p.y, q.z - p.z))
    )
    ends = tuple(x + shift * w for x, w in zip(lifts, way, strict=True))
    stays = calm & (not slides)
    ends = tuple(old if stays else new for old, new in zip((p.x, p.y, p.z), ends, strict=True))
    turns = not (slides | calm | firm)
    lost = dot(velocity, velocity) - after * after
    r = at_place(
        q,
        ends,
        unlifted(c, p, q, one_touch, h, tolerance, found, lifts, lost, tuple(speed * w for w in way)),
    )
    presses = (j >= 0) & (k >= 0) & (spread > tolerance)
    return r, part if turns else one, presses & same_face(c, one_touch) & same_face(d, other)


def _touched_in(c: Any, d: Any, p: Any, q: Any, tolerance: Any) -> Any:
    """How a step from p to q touches a collider, in the crease with another one: where it would lead around an edge from
    there, as the edge of a thin sheet, the other one keeps it from that."""
    touch = touched(c, p, q)
    if not crossable(c) or dot(touch.up, touch.normal) > type_of(q.x, 1) - tolerance:
        return touch
    other = touched(d, p, q)
    place = tuple(
        x if axis is None else x - other.depth * axis
        for x, axis in zip((q.x, q.y, q.z), other.normal, strict=True)
    )
    touch = touched(c, p, at_place(q, place, (q.vx, q.vy, q.vz)))
    back = _full(other.normal, touch.depth - touch.depth)
    return Touch(touch.start, touch.up, touch.depth + other.depth * dot(touch.normal, back), touch.normal)


def _full(n: Any, zero: Any) -> Any:
    """A normal with the zeros that it leaves out."""
    return tuple(zero if axis is None else axis for axis in n)


@outlined
def free_part(c: Any, here: Any, p: Any, r: Any, n: Any, m: Any, h: Any, slack: Any) -> Any:
    """The part of a step along the surface of a shape with dents, from p with the normal n to r with m, before which no
    other part of the shape is in the way: 1 if none is, and 0 of what is not `here` on the surface."""
    if not here:
        return h - h
    # A little above the surface: along the plane that touches it at p, and from there along the one at r.
    half, lift, one = type_of(h, 0.5), type_of(h, LIFT) * slack, type_of(h, 1)
    a = tuple(x + lift * u for x, u in zip((p.x, p.y, p.z), n, strict=True))
    b = tuple(x + lift * u for x, u in zip((r.x, r.y, r.z), m, strict=True))
    way = tuple(half * (y - x) for x, y in zip(a, b, strict=True))
    part, begin = one, one - one
    ahead = way
    if np.sqrt(dot(way, way)) > half * max(type_of(h, thinnest(c.shape)), lift):
        up = tuple(half * (u + v) for u, v in zip(n, m, strict=True))
        rise = max(-dot(way, n) / dot(up, n), dot(way, m) / dot(up, m), one - one)
        middle = tuple(x + y + rise * u for x, y, u in zip(a, way, up, strict=True))
        for start, end in ((a, middle), (middle, b)):
            v = tuple((y - x) / h for x, y in zip(start, end, strict=True))
            if part >= 1:
                s = first_contact(c, at_place(p, start, v), at_place(p, end, v), h, slack)
                if s < 1:
                    # up to a place before it from which a free step meets it: without the lift that is earlier
                    met = tuple(x + s * h * w for x, w in zip(start, v, strict=True))
                    deep, wall = gap_and_normal(c, at_place(p, met, v))
                    ahead = tuple(-axis for axis in wall)
                    closing = max(-dot(wall, v), type_of(h, GRAZES) * np.sqrt(dot(v, v)))
                    s = s - (2 * lift - min(deep, one - one)) / (h * closing)
                    part = begin + half * max(s, one - one)
            begin = half
        part = _time_for(p, r, ahead, part, h) if part < 1 else part
    return part


def _time_for(p: Any, r: Any, ahead: Any, part: Any, h: Any) -> Any:
    """The part of a step of h from p to r after which a part of its straight way is done, in the direction of what is
    `ahead`: less where it becomes slower, and more where it begins slowly."""
    whole, b = dot(ahead, (r.x - p.x, r.y - p.y, r.z - p.z)), h * dot(ahead, (p.vx, p.vy, p.vz))
    return _until(b, whole, part * whole, h) if (whole > 0) & (part > 0) else part


def _facet(c: Any, p: Any, place: Any, g: Any, n: Any) -> Any:
    """The part of a shape that a particle sees from a place with this gap and normal, as a plane with the same response."""
    offset = dot(n, (place.x, place.y, place.z)) - p.r - g
    return ColliderRecord(PlaneRecord(n[0], n[1], n[2], offset), c.response)


@outlined
def _thickness(c: Any, p: Any, far: Any, least: Any) -> Any:
    """How far a shape that p touches goes on under it, looked at from as far as a step goes on: less than the half of how
    thick it is there."""
    half = type_of(far, 0.5)
    n, deep = _full(gap_and_normal(c, p)[1], far - far), far
    for _ in range(THINNER):
        if (deep <= least) | (gap(c, _beside(p, p, n, -deep)) <= -half * deep):
            break
        deep = half * deep
    return half * deep


@outlined
def _first_on(c: Any, p: Any, q: Any, up: Any, part: Any, lift: Any, h: Any, slack: Any) -> Any:
    """The first place a little above the straight way from p to q that is in a shape, and its part of the step of which that
    way is a `part`; q where none is."""
    place = tuple(x + lift * u for x, u in zip((p.x, p.y, p.z), up, strict=True))
    end = tuple(x + lift * u for x, u in zip((q.x, q.y, q.z), up, strict=True))
    v = tuple((b - a) / h for a, b in zip(place, end, strict=True))
    start = at_place(p, place, v)
    s = first_contact(c, start, at_place(p, end, v), h, slack)
    met = at_place(q, _further(start, tuple(h * axis for axis in v), s), (q.vx, q.vy, q.vz))
    return chosen(s < 1, met, q), (s * part if s < 1 else part)


def _beside(p: Any, q: Any, n: Any, way: Any) -> Any:
    """The particle q where p is, moved by a way along n."""
    place = tuple(x + way * axis for x, axis in zip((p.x, p.y, p.z), n, strict=True))
    return at_place(q, place, (q.vx, q.vy, q.vz))


def _pressed(c: Any, p: Any, q: Any, h: Any, slack: Any, most: Any, sure: Any) -> Any:
    """The part of a shape that a particle at p presses on the way to q, by looks up to `most` into it; its normal; how far
    it was looked into; and whether there is such a part, and forces, not hops, press."""
    one, half = type_of(h, 1), type_of(h, 0.5)
    zero, look, rests = one - one, type_of(h, LOOK) * slack, False
    way = (q.x - p.x, q.y - p.y, q.z - p.z)
    far = np.sqrt(dot(way, way))
    up = (zero, zero, zero)
    first = _facet(c, p, p, one, up)
    while (not rests) & (look < type_of(h, FURTHER) * most):
        near = _along(p, q, way, min(look, most) / far)
        g, up = gap_and_normal(c, near)
        first = _facet(c, p, near, g, up)
        rests = (gap(first, q) < -slack) & (gap(first, p) <= type_of(h, LIFT) * slack)
        look = look * type_of(h, FURTHER)
    if rests:
        rests = _dies_out(first, up, p, q, h, slack, sure)
    if rests:
        # So close, the edge between two triangles of one face was nearest, perhaps, and its normal is rounded more.
        ahead = (p.vx, p.vy, p.vz)
        speed = np.sqrt(dot(ahead, ahead))
        drift = min(most, half * h * speed) / speed if speed > 0 else zero
        moved = tuple(drift * v - look * u for v, u in zip(ahead, up, strict=True))
        near = _beside(p, q, moved, one)
        g, n = gap_and_normal(c, near)
        # A point sees it from so near that no look is better.
        if (p.r > look) & (dot(n, up) > one - type_of(h, SAME)):
            first, up = _facet(c, p, near, g, n), n
    return first, up, look, rests


@outlined
def crept(c: Any, p: Any, q: Any, h: Any, tolerance: Any, slack: Any, sure: Any) -> Any:
    """Whether a step from p to q is rest in a crease or a corner of one shape with dents, or on one side of it; its end;
    the part of the step after which the particle turns around, or meets another part of the shape; and whether instead it
    leaves a crease at its end.

    As in `lies`, hops of p must be shorter than the step, or it is `sure` that they have died out. Parts that press are
    found one after the other: what keeps it off one may lead into the next.
    """
    one, half = type_of(h, 1), type_of(h, 0.5)
    zero, lift, rests, both = one - one, type_of(h, LIFT) * slack, False, False
    leaves = False
    r, turn = q, one
    if (gap(c, p) <= slack) & (c.response.outcome == PASS):
        way = (q.x - p.x, q.y - p.y, q.z - p.z)
        far = np.sqrt(dot(way, way))
        # none looks through this part of the shape
        deepest = half * half * type_of(h, thinnest(c.shape))
        thin = deepest <= 0
        if thin:
            deepest = _thickness(c, p, far, lift)
        first, up, look, rests = _pressed(c, p, q, h, slack, min(deepest, far), sure)
        second = (zero, zero, zero)
        if rests:
            r, turn = held(first, p, q, touched(first, p, q), h, tolerance)
        free, seen = one, one
        for _ in range(MOST_PARTS):
            way = (r.x - p.x, r.y - p.y, r.z - p.z)
            far = np.sqrt(dot(way, way))
            part = min(deepest / far, seen) if far > 0 else seen
            near = _along(p, q, way, part)
            if rests & thin & (far > 0):
                # what is in the way may be thinner
                near, part = _first_on(c, p, near, up, part, lift, h, slack)
            g, n = gap_and_normal(c, near)
            if (not rests) | (g >= -slack):
                break
            if both and max(dot(n, up), dot(n, second)) > STRAIGHT:
                break  # one of the two, which is curved
            other = _facet(c, p, near, g, n)
            start = gap(other, p)
            if (start > lift) & (not both):
                # Perhaps it touches this part where it is, as a wall that curves towards it.
                close = _beside(p, q, n, -look)
                k, u = gap_and_normal(c, close)
                touches = gap(_facet(c, p, close, k, u), p)
                if (dot(u, n) > STRAIGHT) & (touches <= lift):
                    other, n, start, g = _facet(c, p, close, k, u), u, touches, k
            if (not both) & (start <= lift) & (dot(n, up) > STRAIGHT):
                r = _along_bend(c, r)  # the same, which is curved: others may press where it leads to
                continue
            # What has hopped from one to the other, ever sooner, is at both of them.
            approach = -h * dot(n, (p.vx, p.vy, p.vz))
            if start > max(type_of(h, LEFT) * lift, type_of(h, SOON) * approach if sure else lift):
                # before it comes to that, others may press
                seen = part * (start - half * lift) / (start - g)
                v = (p.vx, p.vy, p.vz)
                if both:
                    began = tuple(dot(v, way) / (far * far) * axis for axis in way) if far > 0 else v
                else:
                    began = tuple(axis - dot(v, up) * u for axis, u in zip(v, up, strict=True))
                free = min(free, _part_until(p, r, n, began, start - half * lift, h))
            else:
                rests = _dies_out(other, n, p, q, h, slack, sure & (not both))
                if both:
                    # a corner: three parts press
                    return rests, at_place(q, (p.x, p.y, p.z), (zero, zero, zero)), one, False
                r, turn, both = wedged(first, other, p, q, h, tolerance)
                if both:
                    second = n
                else:
                    first, up = other, n
                    r, turn = held(first, p, q, touched(first, p, q), h, tolerance)
                free, seen = one, one
        turn = min(turn, free)
        if rests and both and turn >= 1:
            r, up, second = _around_bend(c, r, up, second, slack)
        if rests:
            between = tuple(a + b for a, b in zip(up, second, strict=True))
            up = between if both else up
            above = tuple(axis / dot(up, up) for axis in up)
            above = tuple((one + one) * axis for axis in above) if both else above
            free = free_part(c, True, p, r, above, above, h, slack)
            turn, g = min(turn, free), gap(c, r)
            # along one part, as where it leaves the other, to the end; or along a crease, maybe up to the next part
            whole = (free > 0) & (turn >= 1) & (abs(g) <= slack)
            leaves = both & (free > 0) & (turn >= 1) & (g > lift)
            rests = ((free > 0) & (turn < 1)) | whole if both | sure else whole
    return rests, r, turn, leaves


def _along_bend(c: Any, r: Any) -> Any:
    """The end of a glide along a part that is curved, put back on it; its velocity turns with it."""
    g, u = gap_and_normal(c, r)
    v, none = (r.vx, r.vy, r.vz), g - g
    into, size = dot(v, u), np.sqrt(dot(v, v))
    along = tuple(axis - into * n for axis, n in zip(v, u, strict=True))
    left = np.sqrt(dot(along, along))
    if c.response.friction is not None:
        size = max(size + c.response.friction.kinetic * min(into, none), none)
    k = size / left if left > 0 else none
    place = tuple(x - g * n for x, n in zip((r.x, r.y, r.z), u, strict=True))
    return at_place(r, place, tuple(k * axis for axis in along))


def _around_bend(c: Any, r: Any, n: Any, m: Any, slack: Any) -> Any:
    """The end of a glide along the crease between two parts with normals n and m, put back into the crease where one of them
    is curved, as the wall of a glass; its velocity turns with the crease. Also the normals there."""
    one = type_of(slack, 1)
    for _ in range(MOST_BENDS):
        g, u = gap_and_normal(c, r)
        first = dot(u, n) > dot(u, m)
        if (g >= -slack) | (max(dot(u, n), dot(u, m)) < STRAIGHT):
            break
        along = cross(n, m)
        n, m = (
            tuple(b if first else a for a, b in zip(n, u, strict=True)),
            tuple(a if first else b for a, b in zip(m, u, strict=True)),
        )
        # the shift that closes this gap and leaves the other closed, in the plane of both normals
        lean = dot(n, m)
        k = -g / (one - lean * lean)
        i, j = (k if first else -lean * k), (-lean * k if first else k)
        place = tuple(x + i * a + j * b for x, a, b in zip((r.x, r.y, r.z), n, m, strict=True))
        # along the crease as it is here, as fast as before, but for the friction of what has turned it
        way, v = cross(n, m), (r.vx, r.vy, r.vz)
        size = np.sqrt(dot(v, v))
        if c.response.friction is not None:
            size = max(size + c.response.friction.kinetic * min(dot(v, u), g - g), g - g)
        size = size / np.sqrt(dot(way, way))
        speed = size if dot(v, along) > 0 else -size
        r = at_place(r, place, tuple(speed * axis for axis in way))
    return r, n, m


def no_faster(
    colliders: Any, p: Any, q: Any, r: Any, h: Any, tolerance: Any, slack: Any, rounds: bool = False
) -> Any:
    """The end r of a step along some colliders that would be free to q, no faster than the work of all forces allows, and
    no higher than its energy reaches: where a shape turns away under the way, its parts taken as planes may lift what
    glides on them. Where it `rounds`, the work of rounding errors of places is none."""
    over = _gained(p, r, q, h) - max(_gained(p, q, q, h), h - h)
    had = dot((r.vx, r.vy, r.vz), (r.vx, r.vy, r.vz))
    left = had - (over + over)
    least = 8 * tolerance * had
    if rounds:
        least += slack / h * (abs(q.vx - p.vx) + abs(q.vy - p.vy) + abs(q.vz - p.vz))
    slower = over > least
    kept = np.sqrt(left / had) if slower & (left > 0) else h - h
    slowed = chosen(slower, at_place(r, (r.x, r.y, r.z), (kept * r.vx, kept * r.vy, kept * r.vz)), r)
    if slower & (left < 0):
        # It stops where its energy ends, if that is on the way, or where it began.
        energy = dot((p.vx, p.vy, p.vz), (p.vx, p.vy, p.vz))
        way, stop = (r.x - p.x, r.y - p.y, r.z - p.z), (h - h, h - h, h - h)
        there = at_place(r, _further(p, way, energy / (energy - left)), stop)
        slowed = there if nearest(colliders, there) >= -slack else at_place(r, (p.x, p.y, p.z), stop)
    return slowed


def _further(p: Any, way: Any, part: Any) -> Any:
    """The place of p after a part of a way."""
    return p.x + part * way[0], p.y + part * way[1], p.z + part * way[2]


def _gained(p: Any, r: Any, q: Any, h: Any) -> Any:
    """The energy over mass that a step from p to r has added [J/kg], with the force of the free step to q."""
    v, w = (p.vx, p.vy, p.vz), (r.vx, r.vy, r.vz)
    force = (q.vx - p.vx, q.vy - p.vy, q.vz - p.vz)
    work = dot(force, (r.x - p.x, r.y - p.y, r.z - p.z)) / h
    return type_of(h, 0.5) * (dot(w, w) - dot(v, v)) - work


def _along(p: Any, q: Any, way: Any, part: Any) -> Any:
    """The particle q after a part of a way from p."""
    return at_place(q, _further(p, way, part), (q.vx, q.vy, q.vz))


def _part_until(p: Any, r: Any, n: Any, began: Any, gap_left: Any, h: Any) -> Any:
    """The part of an even glide of h from p to r, which has begun with a velocity, after which it has come nearer by a gap,
    against a normal n."""
    return _until(-h * dot(n, began), -dot(n, (r.x - p.x, r.y - p.y, r.z - p.z)), gap_left, h)


def _until(b: Any, whole: Any, way: Any, h: Any) -> Any:
    """The part of an even glide of h by `whole`, which has begun with a velocity of b in it, after which a way is done."""
    # s b + s² (whole − b) = way, by the root that does not cancel. A method of first order goes its whole way with the
    # velocity at the end: that one says nothing of shorter steps.
    return 2 * way / (b + np.sqrt(max(b * b + 4 * (whole - b) * way, h - h)))


def _dies_out(facet: Any, n: Any, p: Any, q: Any, h: Any, slack: Any, sure: Any) -> Any:
    """Whether forces, not its own velocity, take a particle from p to q into a part of a shape with a normal; hops on an
    elastic one do not end, unless there is none."""
    approach = -h * dot(n, (p.vx, p.vy, p.vz))
    hops = (approach <= type_of(h, -0.5) * gap(facet, q)) & (facet.response.bounce < 2)
    return sure | hops | (approach <= type_of(h, 2.0**-10) * slack)
