"""Impulses at contacts: no body moves into another, friction holds within its cone, rebounds have their speed.

For every contact with the normal n and relative velocity u of its points the impulse P is such that

    u·n ≥ s,  P·n ≥ 0,  (u·n − s) P·n = 0,   |P_t| ≤ μ P·n,

with s the speed of rebound, or the approach that the gap leaves room for; a friction at its bound is against the sliding.
They are found for all contacts of bodies that touch each other together, beginning with those of the last step (`sweeps`).
What is not found gives no energy (`energy`).

Source: M. Jean, Comput. Methods Appl. Mech. Engrg. 177, 235 (1999); E. Catto, Iterative dynamics with temporal coherence,
GDC 2005.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined, shared
from particlesim.engine.interactions.hard.bench import CLOSES, NEAR, REST
from particlesim.engine.rigid.bending import leaves_with
from particlesim.engine.rigid.bodies import GUEST, WORLD, row
from particlesim.engine.rigid.clusters import gather, root
from particlesim.engine.rigid.contact_rows import direct, speed_along
from particlesim.engine.rigid.energy import (
    against_forces,
    gains,
    hold_back,
    keep,
    let_back,
    let_slide,
    of_time,
    start_anew,
)
from particlesim.engine.rigid.free import velocity_of
from particlesim.engine.rigid.joints import level
from particlesim.engine.rigid.memory import recall, remember
from particlesim.engine.rigid.narrow import clamped
from particlesim.engine.rigid.rotation import cross
from particlesim.engine.rigid.stops import MOTOR, ROLL, lay_turn, tangent, turn_rate
from particlesim.engine.rigid.sweeps import SETTLED, level_all, relax, sweep
from particlesim.engine.rigid.swinging import room_at
from particlesim.engine.rigid.timing import (
    RESTING,
    answered,
    find_carried,
    lean,
    mean_time,
    restitution_at,
    speed_there,
    turned_around,
)

AGAIN = 50
"""Sweeps at most over what guests still lack at the end of a step."""
QUIET = 1e-6
"""Part of what forces give to both bodies in a step: below it, what closes along a direction that forces do not act along is
rounding of rest, and not an impact."""
TIED = 1e-6
"""Part of the way to a contact that may be left at the end of a step, such that corners of a face that come flush within
rounding of one hit together."""


def velocities(b: Any, motion: Any) -> None:
    """Velocity and angular velocity of all bodies as they are."""
    for i in range(b.w.size):
        velocity_of(b, motion, i)


@shared
def lay_out(b: Any, k: Any, motion: Any) -> None:
    """What impulses do at every contact along its normal and two tangents; the speed of approach, into `target`."""
    for c in range(k.number[0]):
        for d in range(4):
            k.impulse[c, d] = 0.0
        if k.turns[c] > 0:
            lay_turn(k, motion, c)
            k.target[c] = speed_along(k, motion, c, 0)
            continue
        i, j = k.first[c], k.second[c]
        n, at = row(k.normal, c), row(k.point, c)
        one = tangent(n)
        direct(b, k, motion, c, 0, i, j, at, n)
        direct(b, k, motion, c, 1, i, j, at, one)
        direct(b, k, motion, c, 2, i, j, at, cross(n, one))
        k.target[c] = speed_along(k, motion, c, 0)


def kick_of(b: Any, k: Any, motion: Any, c: Any, h: Any) -> Any:
    """The speeds that forces give to the bodies of a contact in a step, added up."""
    i, j = k.first[c], k.second[c]
    f = motion.pull[i]
    speed = b.w[i] * np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    if j != WORLD:
        f = motion.pull[j]
        speed += b.w[j] * np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    return h * speed


def room_at_rest(room: Any, approach: Any, kick: Any, h: Any) -> Any:
    """The speed with which guests that rest over a gap, as impulses of hard grains see it, may close it."""
    rests = (room < NEAR * kick) & (approach <= REST * kick)
    return room / CLOSES if rests else room


@outlined
def aim(b: Any, k: Any, motion: Any, cluster: Any, h: Any) -> float:
    """Set the speed that each contact of a cluster is to have along its normal; forces have been added since `lay_out`.
    Returns the largest speed that contact has to deal with."""
    largest = 0.0
    for at in range(motion.contact_from[cluster], motion.contact_from[cluster + 1]):
        c = k.order[at]
        before, now = k.target[c], speed_along(k, motion, c, 0)
        k.struck[c] = 0.0
        if k.turns[c] == MOTOR:
            k.target[c] = k.aim[0, c]
            largest = max(largest, max(abs(now), abs(now - k.target[c])))
            continue
        if k.turns[c] == ROLL:
            largest = max(largest, max(abs(speed_along(k, motion, c, 1)), abs(speed_along(k, motion, c, 2))))
            continue
        bend = k.bend[c] = leaves_with(k.bend[c], -before)
        came = before + bend
        gap, own = max(k.gap[c], 0.0), k.late[1, c]
        lies_under = not k.late[0, c] > 0 and k.late[3, c] != 0
        free = now + k.late[3, c] if lies_under else now
        room = room_at(k, c, before, free, h)
        if k.names[0, c] == GUEST:
            room = room_at_rest(room, -free, kick_of(b, k, motion, c, h), h)
        meets = free - bend < -room * (1 - TIED if k.surface[0, c] > 0 else 1.0)
        quick = came < -max(RESTING * abs(free - before + h * own), QUIET * kick_of(b, k, motion, c, h))
        rebound = bend - restitution_at(k, c, -came) * came
        e = k.surface[0, c]
        if k.falls is not None:
            e = restitution_at(k, c, speed_there(came, free + bend, gap, h))
        struck = came
        if k.late[0, c] > 0:
            # At that time of the step it is as fast as all that acts has made it by then, not as at the beginning.
            lies = k.late[2, c] < 0
            kicked = before if lies else now
            struck = before + k.late[0, c] * own + (0.0 if lies else k.late[2, c] * (now - before) / h)
            e = restitution_at(k, c, -struck)
            rebound = kicked - answered(e, k.late[3, c] * k.rows[c, 0, 15]) * struck
            mean = (
                mean_time(k.late[0, c], struck, now, h)
                if not (quick and k.surface[0, c] > 0)
                else k.late[0, c]
            )
            k.late[2, c] = mean if abs(k.late[2, c]) == k.late[0, c] else abs(k.late[2, c])
            k.late[3, c] = mean
        elif lies_under or (k.second[c] == WORLD and 0 < e < 1):
            rebound = bend + max(turned_around(came, free + bend, gap, e, h), -room)
        hits = meets and quick and k.turns[c] == 0
        k.struck[c] = -struck if hits else 0.0
        k.target[c] = rebound if meets and quick and k.surface[0, c] > 0 else bend - room
        for axis in range(3):
            if meets and quick and k.surface[0, c] > 0:
                k.slip[axis, c] = 0.0
            else:
                # What lies on a surface goes as that does from the middle of this step to that of the next one.
                k.belt[axis, c] += k.lead[axis, c]
        largest = max(largest, max(abs(now), abs(now - before)))
        if meets:
            largest = max(largest, max(abs(speed_along(k, motion, c, 1)), abs(speed_along(k, motion, c, 2))))
    return float(largest)


@shared
def solve(b: Any, k: Any, motion: Any, memory: Any, joints: Any, h: Any) -> None:
    """Find and give the impulses of a step, of contacts and of joints, whose rows are ready (None without); bodies have
    their velocities and angular momenta afterwards."""
    gather(k, motion, joints)
    lean(b, k, motion, h)
    find_carried(b, k, motion, h)
    for cluster in range(motion.clusters[0]):
        level_all(b, motion, motion.now, motion.gained, joints, cluster)
        motion.largest[cluster] = aim(b, k, motion, cluster, h)
        motion.unsettled[cluster] = 0
    keep(motion.now, motion.gained, motion.start)
    recall(b, k, motion, memory)
    start_anew(b, k, motion, h)
    relax_all(b, k, motion, joints, h)
    rebounds = False
    for c in range(k.number[0]):
        rebounds = rebounds or (k.target[c] > k.bend[c] and k.turns[c] == 0)
    yields = rebounds and gains(b, k, motion, joints, h)
    if yields:
        yield_energy(b, k, motion, joints, h)
    hold_back(b, k, motion, h)
    if yields:
        recall_rebounds(k)
    remember(k, memory)
    for i in range(b.w.size):
        for axis in range(3):
            b.v[axis, i] = motion.now[i, axis]
            b.spin[axis, i] += motion.gained[i, axis]


@outlined
def solve_again(b: Any, k: Any, motion: Any, joints: Any, count: Any) -> None:
    """Give what the first `count` contacts of `k.order` lack to their speeds, or have too much, now that velocities have
    changed; each goes on with the impulse that it has."""
    largest = 0.0
    for at in range(count):
        c = k.order[at]
        i, j, n, place = k.first[c], k.second[c], row(k.normal, c), row(k.point, c)
        one = tangent(n)
        direct(b, k, motion, c, 0, i, j, place, n)
        direct(b, k, motion, c, 1, i, j, place, one)
        direct(b, k, motion, c, 2, i, j, place, cross(n, one))
        for d in range(3):
            largest = max(largest, abs(speed_along(k, motion, c, d)))
        # It rebounds once.
        k.target[c] = min(k.target[c], max(speed_along(k, motion, c, 0), 0.0))
    for turn in range(AGAIN):
        worst = sweep(b, k, motion, joints, 0, count, turn % 2 == 1)
        if joints is not None:
            for component in range(joints.next.size):
                level(joints, b, motion.now, motion.gained, component)
        if not worst > SETTLED * largest:
            break
    for i in range(b.w.size):
        for axis in range(3):
            b.v[axis, i] = motion.now[i, axis]
            b.spin[axis, i] += motion.gained[i, axis]


def relax_all(b: Any, k: Any, motion: Any, joints: Any, h: Any) -> None:
    """Find the impulses of all clusters."""
    for cluster in range(motion.clusters[0]):
        level_all(b, motion, motion.now, motion.gained, joints, cluster)
        if motion.contact_from[cluster] < motion.contact_from[cluster + 1]:
            relax(b, k, motion, joints, cluster)
            if let_back(b, k, motion, cluster, h):
                relax(b, k, motion, joints, cluster)
            let_slide(b, k, motion, cluster, h)


# ---- rebounds that would give energy
#
# Several rebounds with friction at once can raise the energy, as Newton's law of restitution sets speeds, not work (T. Kane,
# D. Levinson, Dynamics, 1985). Bodies without rebound never gain any: what a set of bodies that touch each other would gain
# is taken back by going part of the way from that solution towards the one with rebounds, P = P₀ + θ (P₁ − P₀), with the
# largest θ that keeps the energy of the step, with what forces do in it: of a quadratic function of θ.


@outlined
def yield_energy(b: Any, k: Any, motion: Any, joints: Any, h: Any) -> None:
    """Take back what sets of bodies have gained; their velocities are those with rebounds, and `gain` is known."""
    other, gain, parent = motion.other, motion.gain, motion.parent
    keep(motion.now, motion.gained, other)
    for i in range(b.w.size):
        for axis in range(6):
            motion.now[i, axis] = motion.start[i, axis]
        for axis in range(3):
            motion.gained[i, axis] = motion.start[i, 6 + axis]
    for c in range(k.number[0]):
        # What was found is kept where the solution without rebounds leaves room, until `recall_rebounds`.
        k.normal[0, c], k.normal[1, c], k.normal[2, c] = k.impulse[c, 0], k.impulse[c, 1], k.impulse[c, 2]
        if k.turns[c] == 0:
            k.aim[0, c] = k.target[c]
        k.impulse[c, 0] = k.impulse[c, 1] = k.impulse[c, 2] = 0.0
        k.target[c] = min(k.target[c], k.bend[c]) if k.turns[c] != MOTOR else k.target[c]
    relax_all(b, k, motion, joints, h)
    low, bend = motion.low, motion.bend
    for i in range(b.w.size):
        low[i] = bend[i] = 0.0
    for i in range(b.w.size):
        was, now, m, r = motion.start[i], motion.now[i], 1 / b.w[i], root(parent, i)
        for axis in range(3):
            low[r] += 0.5 * m * (now[axis] - was[axis]) * (now[axis] + was[axis])
            low[r] += 0.5 * (motion.gained[i, axis] - was[6 + axis]) * (now[3 + axis] + was[3 + axis])
            d, e = other[i, axis] - now[axis], other[i, 3 + axis] - now[3 + axis]
            bend[r] += 0.5 * m * d * d + 0.5 * e * (other[i, 6 + axis] - motion.gained[i, axis])
        low[r] -= against_forces(motion, i, h)
    for c in range(k.number[0]):
        r = root(parent, k.first[c])
        low[r] -= of_time(b, k, motion, c, h)
        if k.turns[c] == MOTOR:
            had, none, every = (turn_rate(k, each, c) for each in (motion.start, motion.now, other))
            if 0.5 * k.normal[0, c] * (had + every) < k.normal[0, c] * k.aim[0, c]:
                low[r] -= 0.5 * k.impulse[c, 0] * (had + none)
                bend[r] -= 0.5 * (k.normal[0, c] - k.impulse[c, 0]) * (every - none)
            else:
                low[r] -= k.impulse[c, 0] * k.aim[0, c]
    for i in range(b.w.size):
        if parent[i] == i:
            # what is gained = low + slope θ + bend θ², which is `gain` at θ = 1
            slope = gain[i] - low[i] - bend[i]
            part = 1.0
            if gain[i] > 0:
                inside = max(slope * slope - 4 * bend[i] * low[i], 0.0)
                part = clamped((np.sqrt(inside) - slope) / (2 * bend[i]), 0.0, 1.0) if bend[i] > 0 else 0.0
            low[i] = part
    for i in range(b.w.size):
        part, now = low[root(parent, i)], motion.now[i]
        for axis in range(6):
            now[axis] += part * (other[i, axis] - now[axis])
        for axis in range(3):
            motion.gained[i, axis] += part * (other[i, 6 + axis] - motion.gained[i, axis])
    for c in range(k.number[0]):
        part = low[root(parent, k.first[c])]
        for d in range(3):
            k.impulse[c, d] += part * (k.normal[d, c] - k.impulse[c, d])


def recall_rebounds(k: Any) -> None:
    """Give contacts the normals and the speeds to be reached back that they had before `yield_energy`."""
    for c in range(k.number[0]):
        if k.turns[c] == 0:
            k.target[c] = k.aim[0, c]
            for axis in range(3):
                k.normal[axis, c] = k.rows[c, 0, axis]
