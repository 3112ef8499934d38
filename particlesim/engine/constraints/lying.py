"""Particles on rods that lie on colliders: what lies is all that hangs together.

Contact of a particle by itself cancels what presses it; what rods add, of the weight of others, it does not know. So where
rods change what contact has done, the contact forces of a component are found together (Moreau and Jean's time-stepping). An
impulse P at a contact, along its normal n or along the surface, moves all, as rods pass it on; from the velocity v of the
free step to

    V = v + Σ P_j (1 − M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹ J) M⁻¹ d_j,   P_n ≥ 0,   n·V ≥ u,   one of both with equality,

and, by Coulomb, what lies still has |P_t| ≤ μ_s P_n, what slides P_t = −μ_k P_n V_t/|V_t|, relative to the surface. It is
solved by sweeps (Gauss–Seidel, projected). u is 0 for what touches, less for what is above the surface by a gap. Places
change by θ h (V − v), where θ is how the method has moved them by what it has added to velocities: ½ for velocity Verlet, 1
for symplectic Euler. So what lies stays where it was.

Rods are of second order: what has come into a collider as they were put right is moved out of it along normals in the same
manner, by lengths instead of impulses.

Sources: M. Jean, Comput. Methods Appl. Mech. Eng. 177, 235 (1999); J. J. Moreau, ibid. 177, 329 (1999).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.dents import dented
from particlesim.colliders.moving import MovingRecord, carried, lead_of
from particlesim.colliders.response import crossable
from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.constraints.blows import (
    LIES,
    SETTLED,
    STUCK,
    SWEEPS,
    find_moves,
    pass_blows_on,
)
from particlesim.engine.constraints.shake_rattle import (
    ROUNDING,
    aim,
    assemble,
    eliminate,
    hold,
    level,
    load,
    places,
    shake,
)
from particlesim.engine.state.columns import fetch, type_of
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.crossing import through
from particlesim.engine.step.resting import cross
from particlesim.laws.registry import PASS, gap_and_normal, moved_to

NORMAL, SMOOTH, ALONG, DRAGGED = 0, 1, 2, 3
"""What a row is: a normal with two directions of friction after it, one without, such a direction, or one along which a part
of the velocity is lost."""
SLIPS, SLIDES = 8, 1e-7
"""How often contacts are looked at that static friction may not hold; the part of the largest velocity, and of the friction
that there may be, that tells."""
TURNS = 4
"""How often what is inside of a collider is put out, and rods put right after that."""
WALLS, SAME_WALL = 3, 0.9
"""Walls of one collider that a particle may touch, as in a corner of a room; the cosine of the angle between two normals
from which on they are those of one wall."""
NEAR = 8.0
"""Gap up to which a particle takes part, in ways that forces move the fastest in a step."""


def hard(contacts: Any) -> Any:
    """The colliders that do not yield."""
    return contacts.colliders if isinstance(contacts, Simple) else contacts.continuous + contacts.discrete


def after_contact(parts: Any, rods: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """Pass on what components of a thread have hit in a step of h that has begun at `before`, find what lies, and hold their
    rods; returns when those of all threads are held."""
    if rods is not None and rods.touched:
        meet(share.gate, share.threads)
        here = places(c)
        if c.spin is not None:  # what impulses do to spheres that turn is not known here
            held = hold(rods, here, 0.0, True)
        else:
            held = pass_blows_on(rods, c.clock, here, before, h)
            held = held and settle(parts, rods, c, before, t, end, h)
        if not held:
            share.wild[8 * share.number] = 1
        meet(share.gate, share.threads)


def settle(parts: Any, rods: Any, c: Any, before: Any, t: Any, end: Any, h: Any) -> bool:
    """Find what lies on colliders anew in all components of a thread for which contact and rods disagree, and put out of
    colliders what rods have led there; whether rods could be held."""
    held = True
    if any(len(hard(part.contacts)) > 0 for part in parts):
        for k in range(rods.first, rods.last):
            state = rods.blows.state[k]
            if state > 0:
                held = _settle(parts, rods, c, before, k, state, t, end, h) and held
    return held


@outlined
def _settle(parts: Any, rods: Any, c: Any, before: Any, k: Any, state: Any, t: Any, end: Any, h: Any) -> bool:
    held = True
    if state == LIES:
        part, change = lateness(rods, before, k, h)
        count = find_touch(parts, rods, c, before, k, t, end, part * h, NEAR * h * change)
        held = count == 0 or lie(parts, rods, c, before, count, k, end, part * h)
    else:
        count = find_touch(parts, rods, c, before, k, t, end, 0.0, h * fastest(rods, k))
        held = count == 0 or lift_out(parts, rods, c, count, k, end)
        if held and count > 0:
            level(rods, places(c), k)
    if held and c.missed is not None:
        count_missed(parts, rods, c, before, k, t, end)
    return held


@outlined
def lateness(rods: Any, before: Any, k: Any, h: Any) -> Any:
    """θ of a component in the free step, and the largest change of a velocity in it [m/s]."""
    rig, free, way, all_of_it, most = rods.rig, rods.blows.free, 0.0, 0.0, 0.0
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i, square = rig.rows[s], 0.0
        if rig.inverse[s] > 0:
            for axis in range(3):
                a = free[3 + axis, s] - before[3 + axis, i]
                way += a * (free[axis, s] - before[axis, i] - h * before[3 + axis, i]) / rig.inverse[s]
                square += a * a
            all_of_it += h * square / rig.inverse[s]
            most = max(most, square)
    return (min(max(way / all_of_it, 0.0), 1.0) if all_of_it > 0 else 0.5), np.sqrt(most)


def fastest(rods: Any, k: Any) -> Any:
    """The largest speed in a component before or after contact [m/s]."""
    rig, free, own, most = rods.rig, rods.blows.free, rods.blows.own, 0.0
    for s in range(rig.slots[k], rig.slots[k + 1]):
        a, b = 0.0, 0.0
        for axis in range(3, 6):
            a, b = a + free[axis, s] * free[axis, s], b + own[axis, s] * own[axis, s]
        most = max(most, a, b)
    return np.sqrt(most)


@outlined
def find_touch(
    parts: Any, rods: Any, c: Any, before: Any, k: Any, t: Any, end: Any, late: Any, near: Any
) -> int:
    """The rows of what a component touches, or is near to; 0 if that is nothing, too much, or nothing that is known here.
    `late`: the time by which impulses of the step act on places."""
    rig, count = rods.rig, 0
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        if rig.inverse[s] > 0:
            for part in parts:
                if (part.first <= i) & (i < part.last):
                    for number, each in enumerate(hard(part.contacts)):
                        if count >= 0:
                            count = note_touch(each, number, rods, c, before, s, count, t, end, late, near)
    return max(count, 0)


@outlined
def note_touch(
    each: Any,
    number: Any,
    rods: Any,
    c: Any,
    before: Any,
    s: Any,
    count: Any,
    t: Any,
    end: Any,
    late: Any,
    near: Any,
) -> int:
    """Add rows for slot s if it is near a collider, or near several walls of one; how many there are then, −1 if there is no
    room, or nothing to do with this collider."""
    blows, own, free, first = rods.blows, rods.blows.own, rods.blows.free, count
    i = rods.rig.rows[s]
    p = fetch(c, i, end)
    x, y, z = (type_of(p.x, own[axis, s]) for axis in range(3))
    response = each.response
    rubs, drags = response.friction is not None, response.loss > 0
    rows = 1 + (2 if rubs else 0) + (2 if drags else 0)
    u = tuple(float(axis) for axis in lead_of(each.shape, (x, y, z), end))
    met, ways = False, (0.0, 0.0, 0.0)
    for axis in range(3):
        met |= own[3 + axis, s] != free[3 + axis, s]
    several = dented(each.shape)
    for look in range(WALLS + 1 if several else 1):
        there = moved_to(
            p,
            x + type_of(x, ways[0]),
            y + type_of(x, ways[1]),
            z + type_of(x, ways[2]),
            p.vx,
            p.vy,
            p.vz,
            end,
        )
        found, normal = gap_and_normal(each, there)
        n = tuple(0.0 if axis is None else float(axis) for axis in normal)
        # Looked at from some way off a wall, the next one is nearest; and where two meet, one of them, not their edge.
        distance = float(found) - (n[0] * ways[0] + n[1] * ways[1] + n[2] * ways[2])
        gone, arrives, leaves, away = 0.0, 0.0, 0.0, 0.0
        for axis in range(3):
            gone += n[axis] * (free[axis, s] - own[axis, s])
            arrives += n[axis] * (free[3 + axis, s] - u[axis])
            leaves += n[axis] * (own[3 + axis, s] - u[axis])
            away += n[axis] * own[axis, s]
        above, need = distance + gone, 0.0
        new = min(distance, above) <= near and (look > 0 or not several)
        for m in range(first, count):
            d = blows.direction
            other_wall = n[0] * d[0, m] + n[1] * d[1, m] + n[2] * d[2, m] < SAME_WALL
            new &= (blows.hit[1, m] > SMOOTH) | other_wall
        if new:
            if count + rows > blows.hit.shape[1] or response.outcome != PASS:
                return -1
            if above > 0:
                need = min(0.0, arrives - above / late) if late > 0 else -np.inf
            elif met and arrives < 0:
                need = min(max(leaves, 0.0), -arrives)  # not as fast as at the impact, if it is slower now
            need += n[0] * u[0] + n[1] * u[1] + n[2] * u[2]
            add_row(blows, count, s, NORMAL if rubs else SMOOTH, n)
            find_begun(each, p, before, i, blows, count, n, ways, t, near)
            blows.hit[2, count] = number
            blows.number[3, count], blows.number[4, count] = need, away - distance
            if response.friction is not None:
                friction = response.friction
                blows.number[5, count] = float(friction.static)
                blows.number[6, count] = float(friction.kinetic)
                blows.number[7, count] = float(friction.static)
            if rubs or drags:
                runs = carried(each.shape, response.belt, end, x)
                w = u if runs is None else tuple(a + float(b) for a, b in zip(u, runs, strict=True))
                one = aside(n)
                other = cross(n, one)
                at = count + 1
                if rubs:
                    add_along(blows, at, s, ALONG, one, other, w, 0.0)
                    at += 2
                if drags:
                    alone = float(response.keep) / float(response.loss) * rods.rig.inverse[s]
                    add_along(blows, at, s, DRAGGED, one, other, w, alone)
            count += rows
        ways = tuple(way + 2 * near * axis for way, axis in zip(ways, n, strict=True))
    return int(count)


@outlined
def find_begun(
    each: Any, p: Any, before: Any, i: Any, blows: Any, m: Any, n: Any, ways: Any, t: Any, near: Any
) -> None:
    """Note the normal that the surface of a row had where its particle began the step, if it lay there; else its own. Along
    the mean of both a bent surface gives no energy: v·n₀ = 0 and V·n = 0 are that of (v + V)·(n₀ + n)."""
    u = n
    if not isinstance(each.shape, MovingRecord):
        x, y, z = (before[axis, i] + type_of(p.x, ways[axis]) for axis in range(3))
        found, normal = gap_and_normal(each, moved_to(p, x, y, z, p.vx, p.vy, p.vz, t))
        first = tuple(0.0 if axis is None else float(axis) for axis in normal)
        same = first[0] * n[0] + first[1] * n[1] + first[2] * n[2] > SAME_WALL
        distance = float(found) - (first[0] * ways[0] + first[1] * ways[1] + first[2] * ways[2])
        u = tuple(a if same and distance <= near else b for a, b in zip(first, n, strict=True))
    for axis in range(3):
        blows.begun[axis, m] = u[axis]


def add_along(blows: Any, at: Any, s: Any, kind: Any, one: Any, other: Any, w: Any, softness: Any) -> None:
    """Note two rows along a surface that has the velocity w; what is dragged keeps so much velocity for every unit of the
    impulse."""
    for m, way in ((at, one), (at + 1, other)):
        add_row(blows, m, s, kind, way)
        blows.number[3, m] = w[0] * way[0] + w[1] * way[1] + w[2] * way[2]
        blows.number[4, m], blows.number[5, m], blows.number[6, m] = 0.0, softness, 0.0


def add_row(blows: Any, at: Any, s: Any, kind: Any, direction: Any) -> None:
    """Note a row of slot s."""
    blows.hit[0, at], blows.hit[1, at] = s, kind
    for axis in range(3):
        blows.direction[axis, at] = direction[axis]


def aim_impulses(blows: Any, count: Any, mean: bool) -> None:
    """Let the impulses of rows be along their directions; those of normals along the `mean` of those that the surface has at
    the beginning and at the end of the step, if asked for."""
    d, u = blows.direction, blows.begun
    for m in range(count):
        bent = mean and blows.hit[1, m] <= SMOOTH
        square = 0.0
        for axis in range(3):
            blows.push[axis, m] = 0.5 * (d[axis, m] + u[axis, m]) if bent else d[axis, m]
            square += blows.push[axis, m] * blows.push[axis, m]
        for axis in range(3):
            blows.push[axis, m] /= np.sqrt(square)


def aside(n: Any) -> Any:
    """A unit vector across another one."""
    x, y, z = abs(n[0]), abs(n[1]), abs(n[2])
    if x <= y and x <= z:
        k = 1 / np.sqrt(n[1] * n[1] + n[2] * n[2])
        return 0.0, -k * n[2], k * n[1]
    if y <= z:
        k = 1 / np.sqrt(n[0] * n[0] + n[2] * n[2])
        return k * n[2], 0.0, -k * n[0]
    k = 1 / np.sqrt(n[0] * n[0] + n[1] * n[1])
    return -k * n[1], k * n[0], 0.0


@outlined
def lie(parts: Any, rods: Any, columns: Any, before: Any, count: Any, k: Any, end: Any, late: Any) -> bool:
    """End the step of a component anew, from its free one, with the contact forces of its rows; whether its rods could be
    held. `late`: θ h [s]."""
    c = places(columns)
    rig, blows, free = rods.rig, rods.blows, rods.blows.free
    rods.effort[k] = blows.spent[k]
    for s in range(rig.slots[k], rig.slots[k + 1]):
        i = rig.rows[s]
        if rig.inverse[s] > 0:
            c.x[i], c.y[i], c.z[i] = free[0, s], free[1, s], free[2, s]
            c.vx[i], c.vy[i], c.vz[i] = free[3, s], free[4, s], free[5, s]
    load(rig, rods.bench, c, k)
    aim(rig, rods.bench, c, k)
    for m in range(count):
        blows.number[1, m] = 0.0
    find_lacking(rods, c, count)
    factor(rods, k)
    aim_impulses(blows, count, True)
    find_moves(rods, rods.bench.arm, count, k)
    find_forces(rods, count, True)
    shift(rods, c, count, k, late)
    for m in range(count):
        blows.number[9, m] = blows.number[1, m]
    if not (shake(rods, c, k, 0.0) and lift_out(parts, rods, columns, count, k, end)):
        return False
    for m in range(count):
        blows.number[1, m] = blows.number[9, m]
    level(rods, c, k)
    find_lacking(rods, c, count)
    factor_mean(rods, before, k)
    aim_impulses(blows, count, True)
    find_moves(rods, rods.bench.reach, count, k)
    find_forces(rods, count, True)
    first = rig.slots[k]
    for m in range(count):
        rods.effort[k] += blows.number[1, m] * blows.number[2, m]
    for s in range(first, rig.slots[k + 1]):
        i, gain = rig.rows[s], gained(blows, count, s - first)
        if rig.inverse[s] > 0:
            c.vx[i], c.vy[i], c.vz[i] = c.vx[i] + gain[0], c.vy[i] + gain[1], c.vz[i] + gain[2]
    return True


def factor(rods: Any, k: Any) -> None:
    """Get the matrix of a component ready that is aimed at where it is."""
    rig, bench = rods.rig, rods.bench
    assemble(rig, bench, bench.arm, bench.arm, k)
    eliminate(rig, bench, k, rig.looped[k])


def factor_mean(rods: Any, before: Any, k: Any) -> None:
    """As `factor`, with impulses along the means of where rods are and were at the beginning of the step, in `reach`: what
    turns them does no work."""
    rig, bench = rods.rig, rods.bench
    factor(rods, k)
    for e in range(rig.rods[k], rig.rods[k + 1]):
        i, j = rig.rows[rig.first[e]], rig.rows[rig.second[e]]
        for axis in range(3):
            was = before[axis, i] - before[axis, j]
            bench.reach[axis, e] = 0.5 * (bench.arm[axis, e] + was)
    assemble(rig, bench, bench.arm, bench.reach, k)
    eliminate(rig, bench, k, False)


def find_lacking(rods: Any, c: Any, count: Any) -> None:
    """The velocity that every row lacks [m/s]."""
    blows, d = rods.blows, rods.blows.direction
    for m in range(count):
        i = rods.rig.rows[blows.hit[0, m]]
        speed = d[0, m] * c.vx[i] + d[1, m] * c.vy[i] + d[2, m] * c.vz[i]
        blows.number[0, m] = blows.number[3, m] - speed


def gained(blows: Any, count: Any, at: Any) -> Any:
    """What the impulses of all rows do to one slot of their component."""
    x, y, z = 0.0, 0.0, 0.0
    for m in range(count):
        size = blows.number[1, m]
        x += size * blows.moves[3 * m, at]
        y += size * blows.moves[3 * m + 1, at]
        z += size * blows.moves[3 * m + 2, at]
    return x, y, z


def shift(rods: Any, c: Any, count: Any, k: Any, late: Any) -> None:
    """Move a component by what the impulses of its rows do in a time."""
    rig, first = rods.rig, rods.rig.slots[k]
    for s in range(first, rig.slots[k + 1]):
        i, way = rig.rows[s], gained(rods.blows, count, s - first)
        if rig.inverse[s] > 0:
            c.x[i], c.y[i], c.z[i] = c.x[i] + late * way[0], c.y[i] + late * way[1], c.z[i] + late * way[2]


@outlined
def lift_out(parts: Any, rods: Any, columns: Any, count: Any, k: Any, end: Any) -> bool:
    """Put what is inside of a collider, or behind one, out of it along the normals of its rows; whether rods could be
    held."""
    c = places(columns)
    for _ in range(TURNS):
        deepest, slack = find_depths(parts, rods, columns, count, end)
        if not deepest > slack:
            break
        factor(rods, k)
        aim_impulses(rods.blows, count, False)
        find_moves(rods, rods.bench.arm, count, k)
        find_forces(rods, count, False)
        shift(rods, c, count, k, 1.0)
        if not shake(rods, c, k, 0.0):
            return False
    return True


@outlined
def find_depths(parts: Any, rods: Any, c: Any, count: Any, end: Any) -> Any:
    """How deep every row is in its collider [m]; the greatest depth, and how much is but rounding."""
    blows, size, deepest = rods.blows, 0.0, 0.0
    for m in range(count):
        i = rods.rig.rows[blows.hit[0, m]]
        blows.number[0, m], blows.number[1, m] = 0.0, 0.0
        if blows.hit[1, m] <= SMOOTH:
            for part in parts:
                if (part.first <= i) & (i < part.last):
                    for number, each in enumerate(hard(part.contacts)):
                        if number == blows.hit[2, m]:
                            blows.number[0, m] = depth_in(each, rods, c, m, end)
            deepest = max(deepest, blows.number[0, m])
            size = max(size, abs(c.x[i]), abs(c.y[i]), abs(c.z[i]), abs(blows.number[4, m]))
    return deepest, ROUNDING * size


@outlined
def depth_in(each: Any, rods: Any, c: Any, m: Any, end: Any) -> float:
    """How deep the particle of a row is in a collider [m], below where contact by itself has left it; negative outside. The
    row's direction is that of the surface where it is, unless it is behind that."""
    blows, s = rods.blows, rods.blows.hit[0, m]
    own, d, q = blows.own, blows.direction, fetch(c, rods.rig.rows[s], end)
    x, y, z = (type_of(q.x, own[axis, s]) for axis in range(3))
    p = moved_to(q, x, y, z, q.vx, q.vy, q.vz, end)
    found, normal = gap_and_normal(each, q)
    behind = passes(each, p, q)
    if found >= 0 and not behind:
        return float(-found)
    n = tuple(0.0 if axis is None else float(axis) for axis in normal)
    if behind or n[0] * d[0, m] + n[1] * d[1, m] + n[2] * d[2, m] < SAME_WALL:
        return float(blows.number[4, m] - (d[0, m] * q.x + d[1, m] * q.y + d[2, m] * q.z))
    for axis in range(3):
        d[axis, m] = n[axis]
    blows.number[4, m] = n[0] * q.x + n[1] * q.y + n[2] * q.z - found
    return float(-found)


@outlined
def find_forces(rods: Any, count: Any, rubs: Any) -> None:
    """The impulses of all rows of a component [kg m/s], from those that there are."""
    rig, blows, number, matrix, largest = rods.rig, rods.blows, rods.blows.number, rods.blows.matrix, 0.0
    for m in range(count):
        largest = max(largest, abs(number[0, m])) if number[0, m] > -np.inf else largest
    for _ in range(SLIPS):
        find_left(blows, count)
        for _ in range(SWEEPS):
            worst = 0.0
            for m in range(count):
                kind, least, own = blows.hit[1, m], STUCK * rig.inverse[blows.hit[0, m]], matrix[m, m]
                was, left = number[1, m], number[8, m]
                if kind <= SMOOTH and own > least and number[0, m] > -np.inf:
                    worst = max(worst, give(blows, count, m, max(was + left / own, 0.0)))
                if kind == DRAGGED and rubs:
                    worst = max(worst, give(blows, count, m, (left + own * was) / (own + number[5, m])))
                if kind == NORMAL and rubs:
                    worst = max(worst, rub(blows, count, m, least))
            if not worst > SETTLED * largest:
                break
        if not (rubs and some_slip(blows, count, SLIDES * largest)):
            break


@outlined
def find_left(blows: Any, count: Any) -> None:
    """What all rows lack beside what the impulses give that there are."""
    number = blows.number
    for m in range(count):
        number[8, m] = number[0, m]
    for o in range(count):
        if number[1, o] != 0:
            for m in range(count):
                number[8, m] -= blows.matrix[o, m] * number[1, o]


@outlined
def give(blows: Any, count: Any, o: Any, impulse: Any) -> float:
    """Give a row another impulse; by how much that changes its velocity [m/s]."""
    number, matrix, change = blows.number, blows.matrix, impulse - blows.number[1, o]
    if change != 0:
        number[1, o] = impulse
        for m in range(count):
            number[8, m] -= matrix[o, m] * change
    return float(abs(change) * matrix[o, o])


def some_slip(blows: Any, count: Any, least: Any) -> bool:
    """Let contacts slide by kinetic friction that static friction does not hold, as they are faster than something; whether
    there are any that had been held."""
    number, some = blows.number, False
    for m in range(count):
        if blows.hit[1, m] == NORMAL and number[7, m] > number[6, m]:
            p, q, most = number[1, m + 1], number[1, m + 2], number[7, m] * number[1, m]
            x, y = number[8, m + 1], number[8, m + 2]
            full = p * p + q * q >= (1 - SLIDES) * most * most
            if full and x * x + y * y > least * least:
                number[7, m], some = number[6, m], True
    return bool(some)


@outlined
def rub(blows: Any, count: Any, m: Any, least: Any) -> float:
    """Friction of the contact whose normal is row m: what holds still, if that is not too much, else what drags; by how much
    it has changed what it acts on [m/s]."""
    number, matrix, i, j = blows.number, blows.matrix, m + 1, m + 2
    a, b, d = matrix[i, i], matrix[i, j], matrix[j, j]
    x, y = number[8, i], number[8, j]
    was, other = number[1, i], number[1, j]
    spread = a * d - b * b
    if spread > least * least:
        p, q = was + (d * x - b * y) / spread, other + (a * y - b * x) / spread
    elif max(a, d) > least:
        p, q = (was + x / a, 0.0) if a > d else (0.0, other + y / d)
    else:
        return 0.0
    press = number[1, m]
    if p * p + q * q > number[7, m] * number[7, m] * press * press:
        # along what slides: a step that is as long in both directions
        most = 0.5 * (a + d) + np.sqrt(0.25 * (a - d) * (a - d) + b * b)
        p, q = was + x / most, other + y / most
        size, drag = np.sqrt(p * p + q * q), number[7, m] * press
        k = drag / size if size > drag else 1.0
        p, q = k * p, k * q
    return float(max(give(blows, count, i, p), give(blows, count, j, q)))


@outlined
def count_missed(parts: Any, rods: Any, c: Any, before: Any, k: Any, t: Any, end: Any) -> None:
    """Count particles of a component that are on the other side of something thin than at the beginning of the step."""
    for s in range(rods.rig.slots[k], rods.rig.slots[k + 1]):
        i = rods.rig.rows[s]
        if rods.rig.inverse[s] > 0:
            for part in parts:
                if (part.first <= i) & (i < part.last):
                    for each in hard(part.contacts):
                        if crossable(each):
                            q = fetch(c, i, end)
                            p = moved_to(q, before[0, i], before[1, i], before[2, i], q.vx, q.vy, q.vz, t)
                            c.missed[i] += 1 if passes(each, p, q) else 0


@outlined
def passes(each: Any, p: Any, q: Any) -> bool:
    """Whether the straight way from p to q leads through a collider, out of its other side."""
    if not crossable(each):
        return False
    size = abs(q.x) + abs(q.y) + abs(q.z) + q.r
    return bool(through(each, p, q, type_of(q.x, ROUNDING) * size) < 1)
