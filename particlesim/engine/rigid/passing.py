"""Blows that go through bodies which touch, as through a cradle of balls.

Impulses of a step are found together, as those of what rests have to be. A blow on a row of balls would be shared by them
all then, and what hits two that touch would come back. So blows are given ahead of the others, in rounds: all contacts that
close have their impacts, each with its own restitution, and then those that close by what these have done, until none does.
Those of a round that a body has at once are solved together, so that what is symmetric stays so. Rounds keep momentum, and
as each impulse along a normal obeys (u + e u₀) P = 0, u ≥ −e u₀, P ≥ 0, they give no energy, and keep it with e = 1. Joints
take their part of each impulse.

A blow comes in the middle of a step, with the half of its forces. It is left to the solver where nothing is sent on to
others, where it meets what is pressed, as bodies in a stack are, and where it would give energy, as rebounds with friction
may.

Source: B. Smith, D. Kaufman, E. Vouga, R. Tamstorf, E. Grinspun, ACM Trans. Graph. 31, 106 (2012).
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import outlined, shared
from particlesim.engine.rigid.bodies import GUEST, NOBODY, WORLD, row
from particlesim.engine.rigid.braced import HELD, MOST_WORK, part_left, rows_of
from particlesim.engine.rigid.clusters import gather
from particlesim.engine.rigid.contact_rows import speed_along
from particlesim.engine.rigid.energy import NOISE, is_driven
from particlesim.engine.rigid.hearing import note
from particlesim.engine.rigid.impact import save
from particlesim.engine.rigid.memory import address
from particlesim.engine.rigid.narrow import entry
from particlesim.engine.rigid.oncoming import LIVELY
from particlesim.engine.rigid.rotation import dot, turned_by
from particlesim.engine.rigid.solver import QUIET, TIED, kick_of
from particlesim.engine.rigid.stops import LIMIT, MOTOR
from particlesim.engine.rigid.sweeps import SETTLED, level_all, sweep
from particlesim.engine.rigid.timing import RESTING, restitution_at

MOST_CONTACTS, MOST_ROUNDS, MOST_SWEEPS = 256, 1000, 200
"""Contacts of a cluster that passes blows on, rounds, and sweeps in each of these, at most. What closes even then is left to
the solver."""
EXACT = 1e-15
"""Change of a speed in a sweep, as a part of that of the blow, below which nothing changes any more."""
PRESSED = 0.1
"""Speed that the impulse of the last step would give a contact, as a part of what forces give to both of its bodies, from
which on they are pressed on each other."""
ASIDE = 0.5
"""Part of the speed of a blow up to which it may press on what is pressed, as balls that roll do on the ground."""


@shared
def pass_on(b: Any, k: Any, motion: Any, memory: Any, joints: Any, hearing: Any, t: Any, h: Any) -> None:
    """Give the blows that bodies pass on, in the middle of a step, after the kick of its forces and before other impulses:
    changes velocities `now`, and the speeds of approach without the kick in `target`."""
    found = False
    for c in range(k.number[0]):
        found = found or is_blow(b, k, motion, c, h)
    if not found:
        return
    gather(k, motion, joints)
    for cluster in range(motion.clusters[0]):
        blow = blow_on(b, k, motion, joints, cluster, h)
        if blow > 0:
            begin(b, k, motion, memory, joints, cluster, h)
            passed = strike_in_rounds(b, k, motion, joints, hearing, cluster, blow, t, h)
            end(k, motion, cluster, passed)


def is_blow(b: Any, k: Any, motion: Any, c: Any, h: Any) -> bool:
    """Whether a contact has a lively impact in a step."""
    before = k.target[c] + k.bend[c]
    if not (k.turns[c] == 0 and before < 0 and k.surface[0, c] >= LIVELY):
        return False
    now = speed_along(k, motion, c, 0)
    quick = before < -max(RESTING * abs(now - before), QUIET * kick_of(b, k, motion, c, h))
    return bool(quick and now * h < -max(k.gap[c], 0.0))


@outlined
def blow_on(b: Any, k: Any, motion: Any, joints: Any, cluster: Any, h: Any) -> float:
    """The speed of the fastest blow on a cluster; 0 without one, for one body, and where limits, motors or particles
    take part."""
    first, last = motion.contact_from[cluster], motion.contact_from[cluster + 1]
    if last - first > MOST_CONTACTS or motion.body_from[cluster + 1] - motion.body_from[cluster] < 2:
        return 0.0
    blow, rows, alone = 0.0, 0, True
    if joints is not None:
        rows = rows_of(motion, joints, cluster)
    for at in range(first, last):
        c = k.order[at]
        alone = alone and k.names[0, c] > GUEST and k.names[1, c] > GUEST and not k.late[0, c] > 0
        alone = alone and k.turns[c] != LIMIT and k.turns[c] != MOTOR
        if is_blow(b, k, motion, c, h):
            blow = max(blow, -k.target[c])
    return float(blow) if alone and rows * (last - first) <= MOST_WORK else 0.0


@outlined
def begin(b: Any, k: Any, motion: Any, memory: Any, joints: Any, cluster: Any, h: Any) -> None:
    """Give bodies the velocities that they have with half of the kick, also into `start`; those with all of it go into
    `other`. Into `before` of contacts: the speeds without the kick, with half of it, and by it; into `grip` what presses
    them, as a speed, and into `kept` the masses that they meet, which are those with joints now."""
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        save(motion, motion.other, motion.bodies[at])
    level_all(b, motion, motion.now, motion.gained, joints, cluster)
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        k.before[c, 0], k.before[c, 2] = k.target[c], speed_along(k, motion, c, 0) - k.target[c]
        k.bound[c], k.grip[c] = 0.0, pressure(k, memory, c) if k.turns[c] == 0 else 0.0
        for d in range(3):
            k.kept[c, d] = k.rows[c, d, 15]
        if joints is not None and motion.first_component[cluster] >= 0 and k.turns[c] == 0:
            meet_joints(b, k, joints, c)
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        f, inverse = motion.pull[i], motion.inverse[i]
        turned = turned_by(inverse, (f[3], f[4], f[5]))
        for axis in range(3):
            motion.now[i, axis] = motion.other[i, axis] - 0.5 * h * b.w[i] * f[axis]
            motion.now[i, 3 + axis] = motion.other[i, 3 + axis] - 0.5 * h * entry(turned, axis)
            motion.gained[i, axis] = 0.0
    level_all(b, motion, motion.now, motion.gained, joints, cluster)
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        save(motion, motion.start, motion.bodies[at])
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        k.before[c, 1] = speed_along(k, motion, c, 0)


def meet_joints(b: Any, k: Any, joints: Any, c: Any) -> None:
    """Have the impulses of a contact know of joints."""
    k.braced[c] = 1
    for d in range(3):
        k.rows[c, d, 15] /= max(part_left(b, k, joints, c, d), HELD)


def pressure(k: Any, memory: Any, c: Any) -> Any:
    """The speed that the impulse of the last step would give a contact along its normal."""
    at = address(memory, k.names[0, c], k.names[1, c], k.feature[c])
    return (
        dot(row(memory.impulse, at), row(k.normal, c)) / k.rows[c, 0, 15]
        if memory.keys[0, at] != NOBODY
        else 0.0
    )


@outlined
def strike_in_rounds(
    b: Any, k: Any, motion: Any, joints: Any, hearing: Any, cluster: Any, blow: Any, t: Any, h: Any
) -> bool:
    """Give a cluster the impacts of a blow of a speed; whether others than those that it hits have had some."""
    first, passed, had = motion.contact_from[cluster], False, energy_of(b, motion, cluster)
    for turn in range(MOST_ROUNDS):
        count = find_closing(b, k, motion, joints, cluster, blow, h)
        if count == 0:
            break
        for at in range(first, first + count):
            c = k.order[at]
            u = -speed_along(k, motion, c, 0)
            if is_pressed(b, k, motion, c, blow, h):
                if u > ASIDE * blow:
                    return False
            elif turn > 0 and k.second[c] != WORLD and k.surface[0, c] >= LIVELY:
                passed = passed or not was_hit(k, motion, cluster, c)
            if hearing is not None:
                note(hearing, b, k, motion.now, c, u, t)
        if turn > 1 and not passed:
            return False
        for again in range(MOST_SWEEPS):
            worst = sweep(b, k, motion, joints, first, first + count, again % 2 == 1)
            if not worst > EXACT * blow:
                break
        for at in range(first, first + count):
            c = k.order[at]
            k.bound[c] = 1.0 if turn == 0 else k.bound[c]
            k.impulse[c, 0] = k.impulse[c, 1] = k.impulse[c, 2] = 0.0
    gained = energy_of(b, motion, cluster) - had
    return passed and (is_driven(k, motion, cluster) or not gained > NOISE * had)


def find_closing(b: Any, k: Any, motion: Any, joints: Any, cluster: Any, blow: Any, h: Any) -> int:
    """Put the contacts of a cluster that close in the step, and faster than forces do it, first, with the speeds that they
    are to part with; how many there are."""
    first, count = motion.contact_from[cluster], 0
    for at in range(first, motion.contact_from[cluster + 1]):
        c = k.order[at]
        u, room = speed_along(k, motion, c, 0), max(k.gap[c], 0.0) / h
        slow = max(RESTING * abs(k.before[c, 2]), max(QUIET * kick_of(b, k, motion, c, h), SETTLED * blow))
        if k.turns[c] == 0 and u < -max(slow, room * (1 - TIED)):
            pressed = is_pressed(b, k, motion, c, blow, h)
            k.target[c] = -room if pressed else -restitution_at(k, c, -u) * u
            k.friction[c] = k.surface[2, c]
            k.order[at], k.order[first + count] = k.order[first + count], c
            count += 1
    return count


def is_pressed(b: Any, k: Any, motion: Any, c: Any, blow: Any, h: Any) -> bool:
    """Whether the bodies of a contact are pressed on each other."""
    return bool(k.grip[c] > max(PRESSED * kick_of(b, k, motion, c, h), QUIET * blow))


def was_hit(k: Any, motion: Any, cluster: Any, c: Any) -> bool:
    """Whether the two bodies of a contact had an impact in the first round."""
    found = False
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        o = k.order[at]
        found = found or (k.bound[o] > 0 and k.first[o] == k.first[c] and k.second[o] == k.second[c])
    return found


def energy_of(b: Any, motion: Any, cluster: Any) -> float:
    """The energy of motion of a cluster [J], for what impulses have turned less a constant one."""
    total = 0.0
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        now, was = motion.now[i], motion.start[i]
        for axis in range(3 if b.w[i] > 0 else 0):
            total += 0.5 / b.w[i] * now[axis] * now[axis]
            total += 0.5 * (motion.gained[i, axis] - was[6 + axis]) * (now[3 + axis] + was[3 + axis])
    return total


@outlined
def end(k: Any, motion: Any, cluster: Any, passed: Any) -> None:
    """Give bodies the velocities with the whole kick back, with what they have got by then if blows have been `passed` on,
    and contacts their speeds of approach."""
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        for d in range(3):
            k.rows[c, d, 15], k.impulse[c, d] = k.kept[c, d], 0.0
        k.braced[c] = 0
        k.target[c] = k.before[c, 0]
        if passed and k.turns[c] == 0:
            k.target[c] += speed_along(k, motion, c, 0) - k.before[c, 1]
    for at in range(motion.body_from[cluster], motion.body_from[cluster + 1]):
        i = motion.bodies[at]
        now, was, after = motion.now[i], motion.start[i], motion.other[i]
        for axis in range(6):
            now[axis] = after[axis] + (now[axis] - was[axis] if passed else 0.0)
        for axis in range(3):
            more = motion.gained[i, axis] - was[6 + axis] if passed else 0.0
            motion.gained[i, axis] = after[6 + axis] + more
