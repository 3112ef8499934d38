"""Colliders that hard grains lie on, in the turns and solutions that find the impulses of a step (`impulses`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.moving import MovingRecord, carried, frame_at, spin_of, surface_velocity
from particlesim.colliders.plane import PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord
from particlesim.colliders.response import along_surface, bounce_at, put_back
from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.at_once import ALONG, FOUND, GIVEN, LEAST, PARTING, root
from particlesim.engine.interactions.hard.bench import (
    ABOVE,
    BENDS,
    BOUNCY,
    CARRIED,
    COUNT,
    FASTER,
    FREE,
    NEAR_WALL,
    OWN,
    PAIRED,
    REST,
    RUBS,
    STILL,
    SWERVED,
    THROWN,
    WALLS_WANTED,
    WORK,
)
from particlesim.engine.interactions.hard.friction import held_by, spin_up
from particlesim.engine.interactions.hard.turns import BLOW, CALMLY, MIDDLE, NOISE, give, given_at
from particlesim.engine.interactions.pressing import cross
from particlesim.engine.state.columns import fetch, held, type_of
from particlesim.engine.step.contacts import Simple
from particlesim.laws.registry import PASS, force, gap_and_normal, moved_to

ON_WALL = 1e-4
"""Gap to a collider, as a part of the radius, below which a particle lies on it."""
BENT = 0.5
"""How far the velocity of what slides may turn otherwise than its surface does, as a part of that."""
ROUNDED = 2.0**-21
"""Rounding errors of speeds in single precision, as parts of them."""
SAME_SIDE, OTHER_SIDE, OPPOSITE = 0.99, 0.5, -0.5
"""The cosine of the angle between two normals from which on they are of one side, up to which they are of different ones
also where a surface bends, and up to which of opposite ones."""
OUT, NEARER, MOST_TURNS_OUT = 1e-9, 0.9, 64
"""How deep in a collider counts as outside, as a part of the radius; how much less deep each turn makes it, at least, to be
followed by another; and how many turns there are at most."""
IN_BODIES = 0.5
"""How deep a guest among bodies may be in one of these after its own step, as a part of its radius: next to nothing rests
so deep, and further in it might be pushed through."""
FLAT = (PlaneRecord, PlaneXRecord, PlaneYRecord, PlaneZRecord)
"""Shapes without corners."""


def colliders_of(part: Any) -> Any:
    """All colliders of a group that have a surface."""
    if len(part.rubbing) > 0:
        return part.rubbing
    contacts = part.contacts
    found = contacts.colliders if isinstance(contacts, Simple) else contacts.continuous + contacts.discrete
    return tuple(c for c in found if not isinstance(c.shape, BoundsRecord))


def whole(n: Any, like: Any) -> Any:
    """A normal without components that are left out."""
    return tuple(type_of(like, 0) if axis is None else axis for axis in n)


def watch_walls(each: Any, parts: Any, c: Any, before: Any, crowded: Any, t: Any, h: Any) -> Any:
    """List particles in pairs that are near a collider, collider after collider; returns how many there are. Those that are
    `crowded` by others may be moved further, and into colliders that are not as near."""
    end, k = each.report[COUNT] - each.report[COUNT], 0
    for part in parts:
        for collider in colliders_of(part):
            begin = end
            end = watch_wall(
                each, part.rolling, collider, k, c, before, crowded, t, h, part.first, part.last, end
            )
            note_carried(each, part.forces, c, before, begin, end, t, h)
            each.bench.ends[k] = end
            k += 1
    return end


@outlined
def watch_wall(
    each: Any,
    rolling: Any,
    collider: Any,
    number: Any,
    c: Any,
    before: Any,
    crowded: Any,
    t: Any,
    h: Any,
    first: Any,
    last: Any,
    end: Any,
) -> Any:
    """List those of particles [first, last) in pairs that are near a collider, in a corner once for each of its sides;
    returns the end of the list."""
    bench = each.bench
    for i in range(first, last):
        if ((bench.mark[i] & PAIRED) != 0) & (each.a[i] > 0):  # noqa: SIM102
            if (not held(c.clock, i)) & (collider.response.outcome == PASS):
                p = fetch(c, i, t)
                g, n = gap_and_normal(collider.shape, p)
                if g < type_of(g, NEAR_WALL) * p.r:
                    mark, q = bench.mark[i], end
                    end = list_side(each, rolling, collider, number, c, before, h, i, p, g, whole(n, g), end)
                    if not isinstance(collider.shape, FLAT):
                        if q < end and slides_around(each, collider, c, before, h, i, p, q):
                            bench.mark[i] = mark
                        end = list_corner(
                            each, rolling, collider, number, c, before, h, i, p, whole(n, g), end
                        )
                        end = list_held(each, rolling, collider, number, c, before, h, i, p, q, end)
                        end = list_ahead(each, rolling, collider, number, c, before, h, i, p, q, end)
                elif thrown_back(collider, before, h, i, p, g, whole(n, g)):
                    bench.mark[i] = PAIRED | THROWN
                if crowded & (g >= type_of(g, NEAR_WALL) * p.r) & (g < p.r):
                    mark = bench.mark[i]
                    end = list_side(each, rolling, collider, number, c, before, h, i, p, g, whole(n, g), end)
                    bench.mark[i] = mark
    return end


@outlined
def note_carried(each: Any, forces: Any, c: Any, before: Any, begin: Any, end: Any, t: Any, h: Any) -> None:
    """Note which of particles [begin, end) of the list rest on their colliders, and what these have taken up of the kick of
    forces on them: moved off, they have it against them, which their velocities do not tell."""
    w, s = each.bench.wall_normal, each.bench.start
    for q in range(begin, end):
        i = each.bench.wall[q]
        n = (w[0, q], w[1, q], w[2, q])
        rate = float(c.vx[i] * n[0] + c.vy[i] * n[1] + c.vz[i] * n[2] - w[ALONG, q])
        came = float(before[3, i] * n[0] + before[4, i] * n[1] + before[5, i] * n[2] - w[ALONG, q])
        w[STILL, q] = 0
        if (w[LEAST, q] >= 0) & (w[ABOVE, q] <= 0):
            x, y, z = force(forces, fetch(c, i, t)) if len(forces) > 0 else (0.0, 0.0, 0.0)
            by = float(h) * float(each.a[i])
            kick = by * (float(x) * n[0] + float(y) * n[1] + float(z) * n[2])
            w[STILL, q] = 1 if abs(came) <= -CALMLY * kick else 0
            along = abs(rate) <= -NOISE * kick + rounding_of(c.vx[i], c.vy[i], c.vz[i])
            given = -kick if along else -np.inf
            for axis, now in enumerate((c.vx, c.vy, c.vz)):
                given += n[axis] * (float(now[i]) - float(before[3 + axis, i]) - s[CARRIED + axis, i])
            given = min(max(given, 0.0), max(-kick, 0.0))
            for axis in range(3):
                s[CARRIED + axis, i] += given * n[axis]


@outlined
def slides_around(each: Any, collider: Any, c: Any, before: Any, h: Any, i: Any, p: Any, q: Any) -> bool:
    """Whether a particle at side q of a collider has done nothing but slide along it, and that has turned its velocity. Then
    the side gets its normal when impulses act: along that at the end of the way they would take energy, or give it. So does
    the side of one that hovers closely above it, as small hops count as rest: along the later normal all that holds it up
    would brake it, step after step, at a height that it keeps."""
    w, s = each.bench.wall_normal, each.bench.start
    x, y, z, u, v, o = (before[row, i] for row in range(6))
    was, axes = gap_and_normal(collider.shape, moved_to(p, x, y, z, u, v, o, p.t - h))
    one, other = (w[0, q], w[1, q], w[2, q]), whole(axes, was)
    mean = (0.5 * float(u + p.vx), 0.5 * float(v + p.vy), 0.5 * float(o + p.vz))
    turned, change, rate, square = 0.0, 0.0, 0.0, 0.0
    for axis, (a, b) in enumerate(((p.vx, u), (p.vy, v), (p.vz, o))):
        turned -= float(one[axis] - other[axis]) * mean[axis]
        change += float(one[axis]) * float(a - b)
        rate += float(one[axis]) * float(a)
        square += float(a - b) * float(a - b)
    slides = (w[LEAST, q] >= 0) & (w[ABOVE, q] <= 0) & (w[ALONG, q] == 0)
    slides &= abs(rate) <= NOISE * np.sqrt(square) + rounding_of(p.vx, p.vy, p.vz)
    slides &= abs(change - turned) < BENT * abs(turned)
    here = one[0] * other[0] + one[1] * other[1] + one[2] * other[2] > OTHER_SIDE  # and not over an edge
    hovers = (w[LEAST, q] == FREE) & (w[ALONG, q] == 0) & (each.bench.mark[i] == PAIRED) & here
    if slides | hovers:
        size, rate, way = 0.0, 0.0, MIDDLE + each.ways.late[0]
        for axis in range(3):
            then = (1 - way) * float(one[axis]) + way * float(other[axis])
            w[axis, q], size = then, size + then * then
        for axis, a in enumerate((p.vx, p.vy, p.vz)):
            w[axis, q] /= np.sqrt(size)
            rate += float(w[axis, q]) * float(a)
    if slides:
        v = (float(p.vx), float(p.vy), float(p.vz))
        back = along_side(v, (float(w[0, q]), float(w[1, q]), float(w[2, q])), one) if here else v
        for axis in range(3):
            s[SWERVED + axis, i] += (v[axis] - back[axis]) / way if here else turned * float(one[axis])
        w[ALONG, q], w[BENDS, q] = rate, 1 if here else 0
    return slides


def along_side(v: Any, n: Any, push: Any) -> Any:
    """A velocity turned along a side with the normal n by a push along a direction, as fast."""
    by = (v[0] * n[0] + v[1] * n[1] + v[2] * n[2]) / (push[0] * n[0] + push[1] * n[1] + push[2] * n[2])
    x, y, z = v[0] - by * push[0], v[1] - by * push[1], v[2] - by * push[2]
    was, now = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], x * x + y * y + z * z
    by = np.sqrt(was / now) if now > 0 else 1.0
    return by * x, by * y, by * z


def rounding_of(vx: Any, vy: Any, vz: Any) -> float:
    """How fast along a normal what has no such speed may be by rounding, in single precision [m/s]."""
    return ROUNDED * float(abs(vx) + abs(vy) + abs(vz)) if isinstance(vx, np.float32) else 0.0


def thrown_back(collider: Any, before: Any, h: Any, i: Any, p: Any, g: Any, n: Any) -> Any:
    """Whether a particle with a gap g comes from a collider that it may have touched in the step."""
    along = speed_along(collider, p, n)
    came = before[3, i] * n[0] + before[4, i] * n[1] + before[5, i] * n[2] - along
    leaves = p.vx * n[0] + p.vy * n[1] + p.vz * n[2] - along
    return (leaves > came) & (g <= type_of(g, h) * max(abs(leaves), abs(came)))


def list_corner(
    each: Any,
    rolling: Any,
    collider: Any,
    number: Any,
    c: Any,
    before: Any,
    h: Any,
    i: Any,
    p: Any,
    n: Any,
    end: Any,
) -> Any:
    """List further sides of a collider that a particle is near, seen from places further away from those that are known."""
    w, far = each.bench.wall_normal, type_of(p.r, NEAR_WALL) * p.r
    x, y, z = far * n[0], far * n[1], far * n[2]
    known = end
    for _ in range(2):
        g, axes = gap_and_normal(
            collider.shape, moved_to(p, p.x + x, p.y + y, p.z + z, p.vx, p.vy, p.vz, p.t)
        )
        m, new = whole(axes, g), True
        for q in range(known - 1, end):
            new = new & (w[0, q] * m[0] + w[1, q] * m[1] + w[2, q] * m[2] < type_of(g, SAME_SIDE))
        g -= x * m[0] + y * m[1] + z * m[2]
        if new & (g < far):
            end = list_side(each, rolling, collider, number, c, before, h, i, p, g, m, end)
        if new & (n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < type_of(g, OPPOSITE)):
            half = type_of(g, 0.5) * g  # in a tube that is hardly wider: from its middle the ends are nearer
            x, y, z = half * n[0], half * n[1], half * n[2]
        elif new & (g < far):
            x, y, z = x + far * m[0], y + far * m[1], z + far * m[2]
    return end


def list_held(
    each: Any,
    rolling: Any,
    collider: Any,
    number: Any,
    c: Any,
    before: Any,
    h: Any,
    i: Any,
    p: Any,
    first: Any,
    end: Any,
) -> Any:
    """List the sides of a collider that have held a particle in the last step, if they are not among those that are known,
    from `first` on: in the tip of a cone, where it touches all around, one is needed wherever others push it to."""
    w, known, far = each.bench.wall_normal, each.known, type_of(p.r, NEAR_WALL) * p.r
    for at in range(known.begin[i], known.begin[i + 1]):
        x, y, z = known.push[at, 0], known.push[at, 1], known.push[at, 2]
        square = x * x + y * y + z * z
        if (known.partner[at] == -1 - number) & (square > 0):
            by = -far / np.sqrt(square)
            x, y, z = by * x, by * y, by * z
            g, axes = gap_and_normal(
                collider.shape, moved_to(p, p.x + x, p.y + y, p.z + z, p.vx, p.vy, p.vz, p.t)
            )
            m, new = whole(axes, g), True
            for q in range(first, end):
                new = new & (w[0, q] * m[0] + w[1, q] * m[1] + w[2, q] * m[2] < type_of(g, SAME_SIDE))
            g -= x * m[0] + y * m[1] + z * m[2]
            if new & (g < far):
                end = list_side(each, rolling, collider, number, c, before, h, i, p, g, m, end)
    return end


def list_ahead(
    each: Any,
    rolling: Any,
    collider: Any,
    number: Any,
    c: Any,
    before: Any,
    h: Any,
    i: Any,
    p: Any,
    first: Any,
    end: Any,
) -> Any:
    """List the side of a collider that a particle would have come to in the step, and has been thrown back by, if it is not
    among those that are known, from `first` on: beside the walls of a tube that is hardly wider its end is seen from nowhere
    else."""
    w, zero = each.bench.wall_normal, p.x - p.x
    x, y, z = (before[axis, i] + h * before[3 + axis, i] for axis in range(3))
    dx, dy, dz = p.x - x, p.y - y, p.z - z
    far = dx * dx + dy * dy + dz * dz
    if (far > zero) & (far < p.r * p.r):
        g, axes = gap_and_normal(collider.shape, moved_to(p, x, y, z, p.vx, p.vy, p.vz, p.t))
        m = whole(axes, g)
        new = g < zero
        for q in range(first, end):
            new = new & (w[0, q] * m[0] + w[1, q] * m[1] + w[2, q] * m[2] < type_of(g, OTHER_SIDE))
        g += dx * m[0] + dy * m[1] + dz * m[2]
        if new and thrown_back(collider, before, h, i, p, g, m):
            end = list_side(each, rolling, collider, number, c, before, h, i, p, g, m, end)
    return end


def list_side(
    each: Any,
    rolling: Any,
    collider: Any,
    number: Any,
    c: Any,
    before: Any,
    h: Any,
    i: Any,
    p: Any,
    g: Any,
    n: Any,
    end: Any,
) -> Any:
    """List a particle at one side of a collider; returns the end of the list."""
    bench, w = each.bench, each.bench.wall_normal
    if end >= bench.wall.size:
        # one is missed at least, and others may be
        each.report[WALLS_WANTED] = 2 * end
        return end
    dx, dy, dz = p.vx - before[3, i], p.vy - before[4, i], p.vz - before[5, i]
    bench.wall[end], bench.collider[end] = i, number
    w[0, end], w[1, end], w[2, end] = n
    # what has been thrown back in the step has touched it
    lies = (g < type_of(g, ON_WALL) * p.r) | thrown_back(collider, before, h, i, p, g, n)
    least = type_of(g, REST) * np.sqrt(dx * dx + dy * dy + dz * dz)
    free = type_of(g, FREE if collider.response.bounce < 2 else BOUNCY)
    w[LEAST, end], w[PARTING, end] = least if lies else free, 0
    w[ABOVE, end], w[BENDS, end] = type_of(g, 0) if lies else g, 0
    w[ALONG, end] = speed_along(collider, p, n)
    now = surface_of(collider, c, p, n, p.t)
    was = surface_of(collider, c, p, n, p.t - 0.5 * h) if isinstance(collider.shape, MovingRecord) else now
    for axis in range(3):
        w[OWN + axis, end], w[FASTER + axis, end] = now[axis], now[axis] - was[axis]
    w[RUBS, end] = static_of(collider, c)
    if bench.wall_rolls is not None:
        note_rolling(bench.wall_rolls, rolling, collider, end)
    if dx * n[0] + dy * n[1] + dz * n[2] > 0:
        bench.mark[i] = PAIRED | THROWN
    return end + 1


def static_of(collider: Any, c: Any) -> Any:
    """The coefficient of friction that holds what lies on a collider: of spheres that turn the one at rest."""
    friction = collider.response.friction
    if friction is None:
        return type_of(c.x[0], 0)
    return type_of(c.x[0], friction.static if c.spin is not None else friction.kinetic)


def surface_of(collider: Any, c: Any, p: Any, n: Any, t: Any) -> Any:
    """The velocity of a collider's surface at a time where it rubs a particle: of spheres that turn where they touch, of
    others where they are [m/s]."""
    u = (p.x - p.x, p.x - p.x, p.x - p.x)
    if isinstance(collider.shape, MovingRecord):
        r = p.r if c.spin is not None else p.r - p.r
        f = frame_at(collider.shape, t, p.x)
        u = surface_velocity(collider.shape, f, p.x - r * n[0], p.y - r * n[1], p.z - r * n[2])
    belt = along_surface(carried(collider.shape, collider.response.belt, t, p.x), n)
    return tuple(a if b is None else a + b for a, b in zip(u, belt, strict=True))


def note_rolling(rolls: Any, rolling: Any, collider: Any, k: Any) -> None:
    """Note the rolling friction of what lies on a collider, and how that turns."""
    acts = rolling is not None and collider.response.friction is not None
    rolls[0, k] = rolling if acts else 0
    for axis, turn in enumerate(spin_of(collider.shape)):
        rolls[1 + axis, k] = turn


def speed_along(collider: Any, p: Any, n: Any) -> Any:
    """How fast a collider moves along its normal where it touches a particle [m/s]."""
    if not isinstance(collider.shape, MovingRecord):
        return p.x - p.x
    f = frame_at(collider.shape, p.t, p.x)
    place = (p.x - p.r * n[0], p.y - p.r * n[1], p.z - p.r * n[2])
    u, v, w = surface_velocity(collider.shape, f, *place)
    return u * n[0] + v * n[1] + w * n[2]


def push_off_walls(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Velocities of particles that lie on colliders and are pressed into them."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            push_off_wall(each, collider, c, begin, each.bench.ends[k], t)
            begin = each.bench.ends[k]
            k += 1


@outlined
def push_off_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any, t: Any) -> None:
    """`push_off_walls` for particles [begin, end) of the list."""
    bench, response, w = each.bench, collider.response, each.bench.wall_normal
    for q in range(begin, end):
        i, k, least = bench.wall[q], each.report[COUNT] + q, w[LEAST, q]
        n = (w[0, q], w[1, q], w[2, q])
        rate = c.vx[i] * n[0] + c.vy[i] * n[1] + c.vz[i] * n[2] - w[ALONG, q]
        given = type_of(rate, bench.desk.contacts[GIVEN, k])
        lively = (-rate > least) | ((response.bounce >= 2) & (rate < 0) & (w[STILL, q] == 0))
        # what is above it will hit it in the next step
        if (least >= 0) & ((rate < 0) | (given > 0)) & ((w[ABOVE, q] <= 0) | (not lively)):
            e = bounce_at(response, rate) - type_of(rate, 1)
            change, push = given_at(bench, k, w, q, -rate, rate - rate, e, lively, type_of(e, BLOW) * least)
            push_at_wall(each, c, q, change * n[0], change * n[1], change * n[2])
            if response.friction is not None:
                hold_at_wall(each, response.friction, c, q, push)
                if bench.rolled is not None:
                    hold_rolling_at_wall(each, c, q, push)


def push_at_wall(each: Any, c: Any, q: Any, dx: Any, dy: Any, dz: Any) -> None:
    """Change the velocity of a particle at a collider, which may do work by it [m/s]."""
    w, i = each.bench.wall_normal, each.bench.wall[q]
    x, y, z = w[OWN, q] - w[FASTER, q], w[OWN + 1, q] - w[FASTER + 1, q], w[OWN + 2, q] - w[FASTER + 2, q]
    work = float(dx) * float(x) + float(dy) * float(y) + float(dz) * float(z)
    each.bench.start[WORK, root(each.bench.desk.cluster, i)] += work / float(each.a[i])
    give(c, i, type_of(dx, 1), dx, dy, dz)


@outlined
def push_from_walls(each: Any, c: Any, pairs: Any, walls: Any) -> None:
    """Give all particles at walls the impulses that have been found at once."""
    bench = each.bench
    for q in range(walls):
        change = type_of(c.x[0], bench.desk.contacts[FOUND, pairs + q])
        if change != 0:
            n = bench.wall_normal
            push_at_wall(each, c, q, change * n[0, q], change * n[1, q], change * n[2, q])


def hold_at_wall(each: Any, friction: Any, c: Any, q: Any, given: Any) -> None:
    """Bring the friction of a particle on a collider up to what that has given it along the normal."""
    bench, w, i, k = each.bench, each.bench.wall_normal, each.bench.wall[q], each.report[COUNT] + q
    n = (w[0, q], w[1, q], w[2, q])
    u = (c.vx[i] - w[OWN, q], c.vy[i] - w[OWN + 1, q], c.vz[i] - w[OWN + 2, q])
    up = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    sx, sy, sz = u[0] - up * n[0], u[1] - up * n[1], u[2] - up * n[2]
    share = type_of(up, 1)
    if c.spin is not None:
        tx, ty, tz = cross((c.spin.wx[i], c.spin.wy[i], c.spin.wz[i]), n)
        sx, sy, sz = sx - c.r[i] * tx, sy - c.r[i] * ty, sz - c.r[i] * tz
        share = type_of(up, 2 / 7)
    t = held_by(bench.held, k, (sx, sy, sz), share, given, w[RUBS, q], friction.kinetic)
    turn_at_wall(c, i, n, t)
    push_at_wall(each, c, q, t[0], t[1], t[2])


def turn_at_wall(c: Any, i: Any, n: Any, t: Any) -> None:
    """Turn a sphere by friction of a collider that changes its velocity by t [m/s]."""
    if c.spin is not None:
        turn, by = cross(n, t), type_of(t[0], 2.5) / c.r[i]
        c.spin.wx[i] -= by * turn[0]
        c.spin.wy[i] -= by * turn[1]
        c.spin.wz[i] -= by * turn[2]


@outlined
def hold_rolling_at_wall(each: Any, c: Any, q: Any, given: Any) -> None:
    """Bring the rolling friction of a particle on a collider up to what that has given it along the normal."""
    bench, w, s, i, k = (
        each.bench,
        each.bench.wall_normal,
        each.bench.wall_rolls,
        each.bench.wall[q],
        each.report[COUNT] + q,
    )
    x, y, z = c.spin.wx[i] - s[1, q], c.spin.wy[i] - s[2, q], c.spin.wz[i] - s[3, q]
    up = x * w[0, q] + y * w[1, q] + z * w[2, q]
    rolls = (x - up * w[0, q], y - up * w[1, q], z - up * w[2, q])
    share = type_of(up, 0.4) * c.r[i]
    roll_at_wall(each, c, q, held_by(bench.rolled, k, rolls, share, given, s[0, q], s[0, q]))


def roll_at_wall(each: Any, c: Any, q: Any, roll: Any) -> None:
    """Turn a sphere on a collider, which may do work by it, by rolling friction [m/s]."""
    s, i = each.bench.wall_rolls, each.bench.wall[q]
    work = float(c.r[i]) * float(roll[0] * s[1, q] + roll[1] * s[2, q] + roll[2] * s[3, q])
    each.bench.start[WORK, root(each.bench.desk.cluster, i)] += work / float(each.a[i])
    spin_up(c, i, type_of(roll[0], 2.5) / c.r[i], roll)


def rub_walls(each: Any, parts: Any, c: Any) -> None:
    """Friction of colliders on particles that they push at rest."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            if collider.response.friction is not None:
                rub_wall(each, collider, c, begin, each.bench.ends[k])
            begin = each.bench.ends[k]
            k += 1


@outlined
def rub_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any) -> None:
    """`rub_walls` for particles [begin, end) of the list."""
    for q in range(begin, end):
        given = type_of(c.x[0], each.bench.desk.contacts[GIVEN, each.report[COUNT] + q])
        if given > 0:
            hold_at_wall(each, collider.response.friction, c, q, given)
            if each.bench.rolled is not None:
                hold_rolling_at_wall(each, c, q, given)


def put_on_walls(each: Any, parts: Any, c: Any, t: Any) -> Any:
    """Particles that have been moved into colliders go back to their surface, one collider after the other; returns how deep
    one was, in radii."""
    begin, k, deepest = 0, 0, 0.0
    for part in parts:
        for collider in colliders_of(part):
            deepest = max(deepest, put_on_wall(each, collider, c, begin, each.bench.ends[k], t))
            begin = each.bench.ends[k]
            k += 1
    return deepest


@outlined
def put_on_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any, t: Any) -> Any:
    """`put_on_walls` for particles [begin, end) of the list."""
    bench, deepest = each.bench, 0.0
    for k in range(begin, end):
        i = bench.wall[k]
        p = fetch(c, i, t)
        g, n = gap_and_normal(collider.shape, p)
        if g < 0:
            deepest = max(deepest, -float(g) / float(p.r))
            x, y, z = put_back(collider.shape, p, g, whole(n, g))
            c.x[i], c.y[i], c.z[i] = x, y, z
    return deepest


def leave_walls(each: Any, parts: Any, c: Any, t: Any, deepest: Any) -> None:
    """Particles that still are in colliders, as in the tip of a cone, where to leave one side leads into another, go on
    leaving them while they come nearer to where they may be."""
    turn, before = 0, np.inf
    while (deepest > OUT) & (deepest < NEARER * before) & (turn < MOST_TURNS_OUT):
        before = deepest
        deepest = put_on_walls(each, parts, c, t)
        turn += 1


def put_out(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Particles in pairs that have been moved into colliders, whether these are watched or not, go back to their surface; in
    corners again and again."""
    turn, deep = 0, True
    while deep & (turn < MOST_TURNS_OUT):
        deep = False
        for part in parts:
            for collider in colliders_of(part):
                deep = put_out_of(each, collider, c, t, part.first, part.last) | deep
        turn += 1


@outlined
def put_out_of(each: Any, collider: Any, c: Any, t: Any, first: Any, last: Any) -> bool:
    """`put_out` for particles [first, last); returns whether one was deep in the collider."""
    deep = False
    for i in range(first, last):
        if ((each.bench.mark[i] & PAIRED) != 0) & (each.a[i] > 0):  # noqa: SIM102
            if (not held(c.clock, i)) & (collider.response.outcome == PASS):
                p = fetch(c, i, t)
                g, n = gap_and_normal(collider.shape, p)
                if g < type_of(g, -OUT) * p.r:
                    c.x[i], c.y[i], c.z[i] = put_back(collider.shape, p, g, whole(n, g))
                    deep = True
    return deep


@outlined
def put_out_of_bodies(o: Any, parts: Any, c: Any, t: Any) -> None:
    """What has been among bodies in the step, and has come deep into one since then, as between the others of a heap into
    which that one falls, or as springs pull it, is put out of it, but not into colliders; `o`: the bodies, None without."""
    if o is None:
        return
    for i in range(c.r.size):
        if (o.guests[i] > 0) & (not held(c.clock, i)):
            r, at = float(c.r[i]), (float(c.x[i]), float(c.y[i]), float(c.z[i]))
            x = type(o).outside(o, at, r, i, IN_BODIES * r)
            if x[0] != at[0] or x[1] != at[1] or x[2] != at[2]:
                c.x[i], c.y[i], c.z[i] = type_of(c.x[i], x[0]), type_of(c.x[i], x[1]), type_of(c.x[i], x[2])
                for part in parts:
                    for collider in colliders_of(part):
                        put_one_out_of(collider, part, c, i, t)


@outlined
def put_one_out_of(collider: Any, part: Any, c: Any, i: Any, t: Any) -> None:
    """Put a particle out of a collider, if that holds it back."""
    if (part.first <= i) & (i < part.last) & (collider.response.outcome == PASS):
        p = fetch(c, i, t)
        g, n = gap_and_normal(collider.shape, p)
        if g < 0:
            c.x[i], c.y[i], c.z[i] = put_back(collider.shape, p, g, whole(n, g))
