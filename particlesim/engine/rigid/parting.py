"""What overlaps by more than the slop is pushed apart by velocities of its own, which move bodies in this step and are then
forgotten, so that they give no energy.

Source: split impulses, E. Coumans, GDC 2006.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import shared
from particlesim.engine.rigid.bodies import GUEST, WORLD
from particlesim.engine.rigid.braced import level_there
from particlesim.engine.rigid.contact_rows import presses
from particlesim.engine.rigid.energy import parted, taken
from particlesim.engine.rigid.joints import component_of
from particlesim.engine.rigid.support import CARRIED, note_carried
from particlesim.engine.rigid.sweeps import level_all
from particlesim.engine.rigid.timing import kick_along

BOTH, FIRST, SECOND = 0, 1, 2
"""Which of the two of a contact give way; the second one is a particle."""
PUSHES, MOST_PUSHES = 12, 400
"""Sweeps that push apart; where all of an overlap is to be taken away, at most."""
APART = 1e-3
"""Change of a speed that ends them then, as a part of it."""
PART, LIFT, UNNOTICED = 0.2, 0.2, 0.005
"""Part of an overlap that is taken away in a step; part of that, at least, where energy has to pay for it; and what may be
unpaid besides, as a part of what forces give in a step."""
DEEPER = 1.25
"""How deep what goes along a hollow surface is in it in the middle of a step, as it bends in that (`bending`): a quarter of
that on the way from one end of the step to the other, and as much as it has become faster since it came to the surface."""


@shared
def push_apart(b: Any, k: Any, motion: Any, joints: Any, guests: Any, slop: Any, h: Any) -> bool:
    """Velocities, into `apart`, that take away a part of what overlaps, and at once what has come to it in this step;
    whether there are any. What that costs against forces, impulses of the step have to have taken, or a part is done.

    Particles among bodies move apart from each other, and from colliders, in their own step. Those that are carried do not
    give way to a body without joints that presses them: it is put back, by what it has gone on in the step, too, as far as
    that is paid; and they do not move one that does not press them.
    """
    count, lifts = 0, False
    if guests is not None:
        note_carried(guests, k)
    for c in range(k.number[0]):
        if k.names[0, c] != GUEST:
            m = -1 if guests is None else k.second[c] - guests.first
            carried, who = m >= 0 and guests.crowd.rests[m] == CARRIED, BOTH
            over = -k.gap[c] - (slop + DEEPER * k.bend[c] * h if k.gap[c] < 0 else 0.0)
            if carried and (joints is None or component_of(joints, k.first[c]) < 0):
                who = FIRST if presses(k, c) else SECOND
            if who == FIRST:
                over = PART * over if over > 0 else over
                over += way_on(b, k, motion, c, h) if not k.late[0, c] > 0 else 0.0
            elif over > 0 and who == BOTH and presses(k, c) and not is_driven_by(k, c):
                # What it has come in this step goes at once.
                over += min(over, 0.5 * h * max(-parted(b, k, motion, c, h), 0.0)) * (1 / PART - 1)
            if over > 0:
                k.order[count], k.before[c, 0], k.before[c, 1] = c, over, who
                lifts = lifts or who == FIRST
                count += 1
    if count == 0:
        return False
    bodies, turns = b.w.size if guests is None else guests.first, PUSHES
    if lifts:  # far, so that bodies come to what they do not overlap with yet
        turns = MOST_PUSHES
        for c in range(k.number[0]):
            over = -k.gap[c] - (slop if k.gap[c] < 0 else 0.0)
            if k.second[c] < bodies and k.names[0, c] != GUEST and k.turns[c] == 0 and not over > 0:
                k.order[count], k.before[c, 0], k.before[c, 1] = c, over, BOTH
                count += 1
    sweep_apart(b, k, motion, joints, count, turns, 1.0, 1.0, h)
    costs = lifting(motion, bodies, h)
    pays = max(taken(b, k, motion, h), 0.0) + UNNOTICED * falling(b, motion, bodies, h)
    if costs > pays:
        lift, part = pays / costs, max(pays / costs, LIFT)
        if runs(k):  # which pays
            lift, part = part, 1.0
        sweep_apart(b, k, motion, joints, count, turns, lift, part, h)
    return True


def sweep_apart(
    b: Any, k: Any, motion: Any, joints: Any, count: Any, turns: Any, lift: Any, part: Any, h: Any
) -> None:
    """Find velocities that take away the overlap of the first `count` contacts of `k.order`: a part of PART of it, and
    another part, `lift`, where the second one stays where it is."""
    for i in range(b.w.size):
        for axis in range(6):
            motion.apart[i, axis] = 0.0
    for at in range(count):
        k.impulse[k.order[at], 3] = 0.0
    turn, going = 0, True
    while turn < turns and going:
        going = turn < PUSHES
        for place_in in range(count):
            c = k.order[count - 1 - place_in if turn % 2 == 1 else place_in]
            most = k.before[c, 0]
            takes = lift if k.before[c, 1] == FIRST else (part * PART if most > 0 else 1.0)
            changed = nudge(b, k, motion, c, takes * most / h, k.before[c, 1])
            going = going or changed > APART * max(lift, part) * abs(most) / h
            if joints is not None and k.braced[c] > 0:
                level_there(b, k, joints, motion.apart, motion.other, c)
        for cluster in range(motion.clusters[0]):
            level_all(b, motion, motion.apart, motion.other, joints, cluster)
        turn += 1


def lifting(motion: Any, bodies: Any, h: Any) -> float:
    """What it costs to move so many bodies in a step of h as `apart` says, against forces [J]."""
    total = 0.0
    for i in range(bodies):
        for axis in range(6):
            total -= h * motion.pull[i, axis] * motion.apart[i, axis]
    return total


def falling(b: Any, motion: Any, bodies: Any, h: Any) -> float:
    """Twice the energy that forces give so many bodies at rest in a step of h [J]."""
    total = 0.0
    for i in range(bodies):
        for axis in range(3):
            total += b.w[i] * (h * motion.pull[i, axis]) ** 2
    return total


def runs(k: Any) -> bool:
    """Whether some surface runs, and gives energy anyway."""
    found = False
    for c in range(k.number[0]):
        found = found or is_driven_by(k, c)
    return found


def is_driven_by(k: Any, c: Any) -> bool:
    """Whether the surface at a contact runs."""
    return bool(k.belt[0, c] != 0 or k.belt[1, c] != 0 or k.belt[2, c] != 0)


def way_on(b: Any, k: Any, motion: Any, c: Any, h: Any) -> Any:
    """How far a body has gone on towards a particle in the half of a step that is over."""
    e, m, o = k.rows[c, 0], motion.start[k.first[c]], motion.start[k.second[c]]
    u = 0.0
    for axis in range(3):
        u += e[axis] * (m[axis] - o[axis]) + e[3 + axis] * m[3 + axis] - e[6 + axis] * o[3 + axis]
    u += kick_along(b, k, motion, c, True, h) - kick_along(b, k, motion, c, False, h)
    return 0.5 * h * max(-u, 0.0)


def nudge(b: Any, k: Any, motion: Any, c: Any, speed: Any, who: Any) -> Any:
    """Bring the two of a contact to separate at a speed, or one of them. Returns by how much that changes the speed."""
    e, i, j = k.rows[c, 0], k.first[c], k.second[c]
    m = motion.apart[i]
    u = e[0] * m[0] + e[1] * m[1] + e[2] * m[2] + e[3] * m[3] + e[4] * m[4] + e[5] * m[5]
    if j != WORLD:
        o = motion.apart[j]
        u -= e[0] * o[0] + e[1] * o[1] + e[2] * o[2] + e[6] * o[3] + e[7] * o[4] + e[8] * o[5]
    had, mass = k.impulse[c, 3], e[15]
    if who == FIRST:
        mass = 1 / (1 / e[15] - b.w[j])
    elif who == SECOND:
        mass = 1 / b.w[j] if b.w[j] > 0 else 0.0
    press = max(had - mass * (u - speed), 0.0)
    k.impulse[c, 3] = press
    size = press - had
    if who != SECOND:
        for axis in range(3):
            m[axis] += size * b.w[i] * e[axis]
            m[3 + axis] += size * e[9 + axis]
    if j != WORLD and who != FIRST:
        o = motion.apart[j]
        for axis in range(3):
            o[axis] -= size * b.w[j] * e[axis]
            o[3 + axis] -= size * e[12 + axis]
    return abs(size) / mass if mass > 0 else 0.0
