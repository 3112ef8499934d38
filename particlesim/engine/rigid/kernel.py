"""The kernel that steps rigid bodies: half a drift, forces and impulses in the middle, half a drift.

    x += h v/2, orientation turns freely;  v += h f/m, L += h τ;  impulses at contacts;  x += h v/2, orientation turns freely

Without contact that is the leapfrog of position, of second order, symplectic and reversible. Forces and contacts act at the
same time, so a body that rests is exactly at rest: contacts cancel the impulse of forces within the same step.

Forces on bodies are in `acting`, the search for pairs that may touch in `broad`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.compiler import kernel, outlined
from particlesim.engine.rigid.acting import potential_of, power, sum_all_forces
from particlesim.engine.rigid.bodies import GUEST, orientation, place, row
from particlesim.engine.rigid.broad import find_contacts, look_around
from particlesim.engine.rigid.free import move, own
from particlesim.engine.rigid.grains import asks, settle_guests
from particlesim.engine.rigid.hearing import note_impacts, silence
from particlesim.engine.rigid.held_walls import put_in_time
from particlesim.engine.rigid.joints import drift_joined, fit, level
from particlesim.engine.rigid.memory import forget
from particlesim.engine.rigid.narrow import entry, plus
from particlesim.engine.rigid.parting import push_apart
from particlesim.engine.rigid.passing import pass_on
from particlesim.engine.rigid.rotation import (
    dot,
    normalised,
    turned_by,
)
from particlesim.engine.rigid.solver import lay_out, solve, solve_again, velocities
from particlesim.engine.rigid.springs import snap
from particlesim.engine.rigid.stops import motor_work
from particlesim.engine.rigid.support import BESIDE, note_weights
from particlesim.engine.rigid.swift import hasten
from particlesim.engine.rigid.swinging import watch_swings
from particlesim.engine.rigid.work import (
    copy_velocities,
    damped_work,
    kinetic,
    stored_in,
    take_means,
)
from particlesim.model.quaternions import times

GOOD, WILD, FULL, UNHELD, ASKS = 0, 1, 2, 3, 4
"""How a step ended: well, with a number that is not finite, with more contacts than there was room for, with a joint that
could not be held, or not, as a guest hits a body and it is not known what else acts on it."""


class Stretch(NamedTuple):
    """Bodies [first, last) of a group, and the forces on them; `others` act through the surface (`fluids`)."""

    first: int
    last: int
    forces: tuple[Any, ...]
    others: tuple[Any, ...] = ()


class Scene(NamedTuple):
    """What acts on bodies: forces, springs, colliders, contact between groups; `arms` of the six points [3, n], mass, radius
    of the ball of the same volume and further attributes of each [n]; the overlap that is left alone [m]; 2 where forces
    depend on velocities, else 1. Joints, None without, and their limits and motors (`stops`); which bodies have one [n], and
    the bodies that each is joined to and does not touch (`partners`, from `partner_from` on). What is booked, None where
    nothing is. Particles that may touch bodies (`guests`), which are the last bodies then, None where there are none.
    Room for what swift bodies meet (`swift`). Impacts that emitters hear (`hearing`), None where none does."""

    stretches: tuple[Stretch, ...]
    springs: tuple[Any, ...]
    walls: tuple[Any, ...]
    surfaces: Any
    arms: Any
    mass: Any
    radius: Any
    further: tuple[Any, ...]
    slop: float
    stages: int
    joints: Any
    stops: Any
    joined: Any
    partners: Any
    partner_from: Any
    work: Any
    guests: Any = None
    swift: Any = None
    hearing: Any = None


@outlined
def kick(scene: Any, b: Any, motion: Any, t: Any, h: Any) -> None:
    """Forces and torques of a step on all bodies, once springs that cannot hold are broken. Where forces depend on
    velocities, those are taken that bodies have after half of the kick (the midpoint rule)."""
    for number, springs in enumerate(scene.springs):
        lost = snap(springs, b, motion.now, t, h)
        if scene.work is not None and lost > 0:
            scene.work.totals[scene.work.breaking[number]] -= lost
    sum_all_forces(scene, b, motion, t)
    if scene.work is not None:
        copy_velocities(motion.now, motion.came)
        copy_velocities(motion.now, motion.stage)
    if scene.stages == 2:
        for i in range(b.w.size):
            f, now = motion.pull[i], motion.now[i]
            turned = turned_by(motion.inverse[i], (f[3], f[4], f[5]))
            for axis in range(6):
                motion.before[i, axis] = now[axis]
            for axis in range(3):
                now[axis] += 0.5 * h * b.w[i] * f[axis]
                now[3 + axis] += 0.5 * h * entry(turned, axis)
        if scene.joints is not None:
            for component in range(scene.joints.next.size):
                level(scene.joints, b, motion.now, motion.other, component)
        sum_all_forces(scene, b, motion, t)
        if scene.work is not None:
            copy_velocities(motion.now, motion.stage)
        for i in range(b.w.size):
            for axis in range(6):
                motion.now[i, axis] = motion.before[i, axis]
    for i in range(b.w.size):
        f = motion.pull[i]
        give(b, motion, i, (h * f[0], h * f[1], h * f[2]), (h * f[3], h * f[4], h * f[5]))


@outlined
def book_step(scene: Any, b: Any, k: Any, motion: Any, t: Any, h: Any) -> None:
    """Book the work of forces without a potential, of dampers, motors and contact, before bodies go on from the middle of
    a step; `came` are the velocities with which they came there, `stage` those that forces have been summed with."""
    work, totals = scene.work, scene.work.totals
    count = own(scene, b) + (0 if scene.guests is None else scene.guests.held)
    given = take_means(b, motion, count, h)
    for stretch, laws, cause in zip(scene.stretches, work.spent, work.cause, strict=True):
        for number, each in enumerate(laws):
            for i in range(stretch.first, stretch.last):
                totals[cause[number]] += h * power(scene, each, b, motion, i, t)
    for number, springs in enumerate(scene.springs):
        if work.damper[number] >= 0:
            totals[work.damper[number]] += h * damped_work(springs, b, motion.stage, motion.other)
    if k.number[0] > 0:
        driven = motor_work(k, motion.other) if work.motors >= 0 else 0.0
        totals[work.contact] += given - driven
        totals[max(work.motors, 0)] += driven


@outlined
def energy_of(scene: Any, b: Any, motion: Any, t: Any) -> float:
    """Kinetic energy with the velocities `now`, and potential energy of all bodies [J]."""
    total = kinetic(b, motion, own(scene, b))
    for stretch, laws in zip(scene.stretches, scene.work.stored, strict=True):
        for each in laws:
            for i in range(stretch.first, stretch.last):
                total += potential_of(scene, each, b, motion, i, t)
    for springs in scene.springs:
        total += stored_in(springs, b, motion.now)
    return total


def give(b: Any, motion: Any, i: Any, impulse: Any, twist: Any) -> None:
    """Add an impulse in the centre, and an angular momentum, to body i."""
    inverse = motion.inverse[i]
    for axis in range(3):
        spent = impulse[0] if axis == 0 else (impulse[1] if axis == 1 else impulse[2])
        turned = twist[0] if axis == 0 else (twist[1] if axis == 1 else twist[2])
        b.v[axis, i] += b.w[i] * spent
        b.spin[axis, i] += turned
        motion.now[i, axis] = b.v[axis, i]
    motion.now[i, 3] += inverse[0] * twist[0] + inverse[3] * twist[1] + inverse[4] * twist[2]
    motion.now[i, 4] += inverse[3] * twist[0] + inverse[1] * twist[1] + inverse[5] * twist[2]
    motion.now[i, 5] += inverse[4] * twist[0] + inverse[5] * twist[1] + inverse[2] * twist[2]


@outlined
def drift(scene: Any, b: Any, motion: Any, t: Any, h: Any, second: Any) -> bool:
    """Move and turn all bodies in half a step of length h, from time t on, freely but for their joints and for what swift
    ones meet; whether joints could be held. The second half of those that hold particles by rods has its end with these
    (`hold_ends`)."""
    swift, n = hasten(scene, b, motion, t, h, second), own(scene, b)
    for i in range(b.w.size):
        gone = swift and i < n and scene.swift.on[i] > 0
        if (scene.joints is None or scene.joined[i] == 0) and not gone:
            move(b, i, h)
    held = True
    if scene.joints is not None:
        for component in range(scene.joints.next.size):
            ends = (
                not second or scene.guests is None or not hangs(scene.joints, component, scene.guests.first)
            )
            held = drift_joined(scene.joints, b, motion, component, h, ends) and held
    return held


def hangs(joints: Any, component: Any, bodies: Any) -> bool:
    """Whether particles are in a component: they come after so many bodies."""
    return bool(joints.members[joints.member_from[component + 1] - 1] >= bodies)


@outlined
def part_overlaps(scene: Any, b: Any, k: Any, motion: Any, h: Any) -> bool:
    """Move bodies that overlap apart; whether joints could be held."""
    held = True
    if push_apart(b, k, motion, scene.joints, scene.guests, scene.slop, h):
        for i in range(b.w.size):
            m = motion.apart[i]
            for axis in range(3):
                b.x[axis, i] += h * m[axis]
            q = orientation(b, i)
            turn = times((0.0, 0.5 * h * m[3], 0.5 * h * m[4], 0.5 * h * m[5]), q)
            q = normalised((q[0] + turn[0], q[1] + turn[1], q[2] + turn[2], q[3] + turn[3]))
            b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q
        if scene.joints is not None:
            for component in range(scene.joints.next.size):
                held = fit(scene.joints, b, motion, component) and held
    return held


@outlined
def finite(b: Any) -> bool:
    """Whether all numbers are finite."""
    drop = 0.0
    for i in range(b.w.size):
        for axis in range(3):
            drop += (
                (b.x[axis, i] - b.x[axis, i])
                + (b.v[axis, i] - b.v[axis, i])
                + (b.spin[axis, i] - b.spin[axis, i])
            )
        for axis in range(4):
            drop += b.turn[axis, i] - b.turn[axis, i]
    return drop == 0


@kernel
def step_bodies(
    scene: Any, b: Any, k: Any, motion: Any, memory: Any, first: Any, steps: Any, dt: Any, report: Any
) -> int:
    """Advance bodies by `steps` steps of dt, the first of which begins at first · dt.

    Returns the number of steps done; fewer when one could not be made, and then report[0] says why (WILD, FULL, or UNHELD)
    and report[1] how many contacts there were. A step that found no room for its contacts has come half of its way; it is
    gone on with where report[0] still says so.
    """
    for step in range(steps):
        middle = (first + step + 0.5) * dt
        if report[0] != FULL:
            scene.swift.gain[0] = 0.0
            if scene.hearing is not None:
                silence(scene.hearing)
            if first + step == 0:  # no step before has looked for what this drift meets
                velocities(b, motion)
                look_around(scene, b, k, motion, memory, 0.0, dt)
            if not drift(scene, b, motion, (first + step) * dt, 0.5 * dt, False):
                report[0] = UNHELD
                return step
        report[0] = GOOD
        velocities(b, motion)
        find_contacts(scene, b, k, motion, memory, middle, dt)
        if k.number[1] > 0:
            report[0], report[1] = FULL, k.number[0] + k.number[1]
            return step
        if scene.guests is not None and asks(scene.guests, k):
            report[0] = ASKS
            return step
        lay_out(b, k, motion)
        if scene.joints is not None:
            watch_swings(b, k, motion, scene.joints, dt)
        kick(scene, b, motion, middle, dt)
        held = True
        if k.number[0] == 0 and scene.joints is None:
            forget(memory)
        else:
            pass_on(b, k, motion, memory, scene.joints, scene.hearing, middle, dt)
            solve(b, k, motion, memory, scene.joints, dt)
            if scene.hearing is not None:
                note_impacts(scene.hearing, b, k, motion, middle, dt)
        if scene.work is not None:
            book_step(scene, b, k, motion, middle, dt)
        if k.number[0] > 0:
            before = 0.0 if scene.work is None else energy_of(scene, b, motion, middle)
            held = part_overlaps(scene, b, k, motion, dt)
            if scene.guests is not None:
                if scene.joints is not None:
                    held = put_in_time(scene.joints, scene.guests, b, k, motion, dt) and held
                settle_guests(scene, b, k, dt)
                note_weights(scene.guests, b, k, dt)
            if scene.work is not None:
                velocities(b, motion)
                scene.work.totals[scene.work.contact] += energy_of(scene, b, motion, middle) - before
        if not (held and drift(scene, b, motion, middle, 0.5 * dt, True)):
            report[0] = UNHELD
            return step
        if scene.work is not None:
            scene.work.totals[scene.work.contact] += scene.swift.gain[0]
        if not finite(b):
            report[0] = WILD
            return step
    return steps


@kernel
def look_for_contacts(scene: Any, b: Any, k: Any, motion: Any, memory: Any, t: Any) -> None:
    """All contacts there are at a time."""
    velocities(b, motion)
    find_contacts(scene, b, k, motion, memory, t, 0.0)


@kernel
def velocities_of(b: Any, motion: Any) -> None:
    """Velocities and angular velocities of all bodies, into motion.now."""
    velocities(b, motion)


@kernel
def sum_forces_on(scene: Any, b: Any, motion: Any, t: Any) -> None:
    """Total force and torque on every body, into motion.pull."""
    velocities(b, motion)
    sum_all_forces(scene, b, motion, t)


@kernel
def close_joints(scene: Any, b: Any, motion: Any) -> bool:
    """Bring bodies to where their joints are closed, and take away velocities that open them; whether that could be done."""
    held = True
    for component in range(scene.joints.next.size):
        held = fit(scene.joints, b, motion, component) and held
    return held


@kernel
def hold_guests(scene: Any, b: Any, k: Any, motion: Any) -> bool:
    """Have guests that lie on bodies end a step, after all have made their own, with the velocities that contact has aimed
    at: they and the bodies get more of its impulses, or give some of them back, as does what these particles touch besides.
    Whether there are any."""
    velocities(b, motion)
    count, guests = 0, scene.guests
    for c in range(k.number[0]):
        m = k.second[c] - guests.first
        if m >= 0 and k.names[0, c] != GUEST and guests.awaits[m] > 0:
            guests.crowd.rests[m] = BESIDE
    for c in range(k.number[0]):
        i, m = k.first[c] - guests.first, k.second[c] - guests.first
        here = (i < 0 or guests.awaits[i] > 0) and (m < 0 or guests.awaits[m] > 0)
        beside = (i >= 0 and guests.crowd.rests[i] == BESIDE) or (m >= 0 and guests.crowd.rests[m] == BESIDE)
        if k.turns[c] == 0 and not k.late[0, c] > 0 and here and beside:
            k.order[count] = c
            count += 1
            if k.names[0, c] == GUEST:  # it has had its own impulses since
                for d in range(3):
                    k.impulse[c, d] = 0.0
            n = row(k.normal, c)
            if m >= 0:
                at = plus(place(b, guests.first + m), guests.radius[m], n)
            else:
                at = plus(place(b, guests.first + i), -guests.radius[i], n)
            k.point[0, c], k.point[1, c], k.point[2, c] = at
    if count > 0:
        solve_again(b, k, motion, scene.joints, count)
    return count > 0


@kernel
def hold_ends(scene: Any, b: Any, motion: Any, bodies: Any, h: Any) -> bool:
    """Have bodies and the particles that rods hold at them, which come after so many bodies, end a drift of length h where
    rods and joints fit: they go back freely to its beginning, and come forth with impulses along rods and joints. Whether
    that could be done."""
    held, joints = True, scene.joints
    for component in range(joints.next.size):
        if hangs(joints, component, bodies):
            for at in range(joints.member_from[component], joints.member_from[component + 1]):
                i = joints.members[at]
                move(b, i, -h)
            held = drift_joined(joints, b, motion, component, h, True) and held
    return held


@kernel
def sum_energies(scene: Any, laws: Any, b: Any, motion: Any, first: Any, last: Any, t: Any, out: Any) -> None:
    """For bodies [first, last): kinetic energy of rotation [J], angular momentum of rotation [kg m²/s], and the
    potential energy of each law [J], into out [4 + laws]."""
    velocities(b, motion)
    for i in range(first, last):
        m = motion.now[i]
        out[0] += 0.5 * dot(row(b.spin, i), (m[3], m[4], m[5]))
        for axis in range(3):
            out[1 + axis] += b.spin[axis, i]
        for number, each in enumerate(laws):
            out[4 + number] += potential_of(scene, each, b, motion, i, t)
