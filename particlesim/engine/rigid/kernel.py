"""The kernel that steps rigid bodies: half a drift, forces and impulses in the middle, half a drift.

    x += h v/2, orientation turns freely;  v += h f/m, L += h τ;  impulses at contacts;  x += h v/2, orientation turns freely

Without contact that is the leapfrog of position, of second order, symplectic and reversible. Forces and contacts are looked
for at the same moment, so a body that rests is exactly at rest: what forces give, contact takes within the same step.

Laws of forces act on six points on the principal axes of a body, a sixth each, at distances d with 2 d_k²/6 = ∫ x_k² dm/m:
they have its mass, its centre and its moments of inertia, so that forces which grow linearly over the body are exact.
Fluids act through its surface.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import kernel, on_stack, outlined
from particlesim.engine.rigid.bodies import orientation, place, row
from particlesim.engine.rigid.fluids import Swept, Wetted, Whole, act, stored
from particlesim.engine.rigid.grains import find_guests, settle_guests
from particlesim.engine.rigid.joints import drift_joined, fit, level
from particlesim.engine.rigid.narrow import entry, plus, touch
from particlesim.engine.rigid.rotation import (
    cross,
    dot,
    matrix,
    normalised,
    turned_by,
    turned_freely,
)
from particlesim.engine.rigid.solver import lay_out, push_apart, solve, velocities
from particlesim.engine.rigid.springs import pull, snap
from particlesim.engine.rigid.stops import find_stops, motor_work
from particlesim.engine.rigid.walls import touch_wall
from particlesim.engine.rigid.work import (
    copy_velocities,
    damped_work,
    kinetic,
    stored_in,
    take_means,
)
from particlesim.laws.registry import Particle, force, potential
from particlesim.model.quaternions import times

POINTS = 6
GOOD, WILD, FULL, UNHELD = 0, 1, 2, 3
"""How a step ended: well, with a number that is not finite, with more contacts than there was room for, with a joint that
could not be held."""


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
    nothing is. Particles that may touch bodies (`guests`), which are the last bodies then, None where there are none."""

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


def point_of(scene: Any, b: Any, i: Any, r: Any, now: Any, point: Any, t: Any) -> Any:
    """One of the six points of a body as laws see it, with the whole body's mass and size; and its arm. `now` are its
    velocity and angular velocity."""
    axis = point // 2
    size = scene.arms[axis, i] if point % 2 == 0 else -scene.arms[axis, i]
    arm = (
        size * (r[0] if axis == 0 else (r[1] if axis == 1 else r[2])),
        size * (r[3] if axis == 0 else (r[4] if axis == 1 else r[5])),
        size * (r[6] if axis == 0 else (r[7] if axis == 1 else r[8])),
    )
    return as_particle(scene, b, i, now, arm, t), arm


def as_particle(scene: Any, b: Any, i: Any, now: Any, arm: Any, t: Any) -> Particle:
    """A place of a body as laws see it, with the whole body's mass and size; `now` are its velocity and angular velocity."""
    x, u = plus(place(b, i), 1.0, arm), cross((now[3], now[4], now[5]), arm)
    m = scene.mass[i]
    return Particle(
        x[0],
        x[1],
        x[2],
        now[0] + u[0],
        now[1] + u[1],
        now[2] + u[2],
        m,
        scene.radius[i],
        0.0,
        t,
        1 / m,
        *[0.0 if column is None else column[i] for column in scene.further],
    )


@outlined
def add_forces(scene: Any, forces: Any, b: Any, motion: Any, i: Any, t: Any) -> None:
    """Add the forces and torques of laws on body i to `pull`."""
    r = matrix(orientation(b, i))
    now = motion.now[i]
    fx, fy, fz, gx, gy, gz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for point in range(POINTS):
        p, arm = point_of(scene, b, i, r, now, point, t)
        f = force(forces, p)
        g = cross(arm, f)
        fx, fy, fz, gx, gy, gz = fx + f[0], fy + f[1], fz + f[2], gx + g[0], gy + g[1], gz + g[2]
    k, out = 1 / POINTS, motion.pull[i]
    out[0], out[1], out[2] = out[0] + k * fx, out[1] + k * fy, out[2] + k * fz
    out[3], out[4], out[5] = out[3] + k * gx, out[4] + k * gy, out[5] + k * gz


@outlined
def add_surface_forces(scene: Any, others: Any, b: Any, motion: Any, i: Any, t: Any) -> None:
    """The same of what acts through the surface of body i."""
    r, now, out = matrix(orientation(b, i)), motion.now[i], on_stack(1, 6, np.float64)
    for part in range(6):
        out[0, part] = 0.0
    p = as_particle(scene, b, i, now, (0.0, 0.0, 0.0), t)
    for each in others:
        act(each, p, r, (now[3], now[4], now[5]), out)
    for part in range(6):
        motion.pull[i, part] += out[0, part]


@outlined
def sum_all_forces(scene: Any, b: Any, motion: Any, t: Any) -> None:
    """Forces and torques on all bodies, as they are and move now, into `pull`."""
    for i in range(b.w.size):
        for axis in range(6):
            motion.pull[i, axis] = 0.0
    for stretch in scene.stretches:
        if len(stretch.forces) > 0:
            for i in range(stretch.first, stretch.last):
                add_forces(scene, stretch.forces, b, motion, i, t)
        if len(stretch.others) > 0:
            for i in range(stretch.first, stretch.last):
                add_surface_forces(scene, stretch.others, b, motion, i, t)
    for springs in scene.springs:
        pull(springs, b, motion.now, motion.pull)


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
        lean_guests(scene, motion.now)
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


def lean_guests(scene: Any, velocities: Any) -> None:
    """Let guests have the velocities that they get from what acts on particles alone."""
    if scene.guests is not None:
        for m in range(scene.guests.radius.size):
            for axis in range(3):
                velocities[scene.guests.first + m, axis] += scene.guests.lean[axis, m]


def own(scene: Any, b: Any) -> int:
    """How many bodies there are without guests."""
    return int(b.w.size if scene.guests is None else scene.guests.first)


@outlined
def book_step(scene: Any, b: Any, k: Any, motion: Any, t: Any, h: Any) -> None:
    """Book the work of forces without a potential, of dampers, motors and contact, before bodies go on from the middle of
    a step; `came` are the velocities with which they came there, `stage` those that forces have been summed with."""
    work, totals = scene.work, scene.work.totals
    given = take_means(b, motion, own(scene, b), h)
    lean_guests(scene, motion.other)
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
def power(scene: Any, law: Any, b: Any, motion: Any, i: Any, t: Any) -> float:
    """Power of a law with the velocities `stage` on a body that moves as in `other` [W]."""
    r, total = matrix(orientation(b, i)), 0.0
    if isinstance(law, Whole | Wetted | Swept):
        now, mean, out = motion.stage[i], motion.other[i], on_stack(1, 6, np.float64)
        for part in range(6):
            out[0, part] = 0.0
        p = as_particle(scene, b, i, now, (0.0, 0.0, 0.0), t)
        act(law, p, r, (now[3], now[4], now[5]), out)
        for part in range(6):
            total += out[0, part] * mean[part]
        return total
    for point in range(POINTS):
        p, _ = point_of(scene, b, i, r, motion.stage[i], point, t)
        q, _ = point_of(scene, b, i, r, motion.other[i], point, t)
        f = force((law,), p)
        total += f[0] * q.vx + f[1] * q.vy + f[2] * q.vz
    return total / POINTS


@outlined
def potential_of(scene: Any, law: Any, b: Any, motion: Any, i: Any, t: Any) -> float:
    """Potential energy of body i in a law [J]."""
    r, m, total = matrix(orientation(b, i)), motion.now[i], 0.0
    if isinstance(law, Whole | Wetted):
        return float(stored(law, as_particle(scene, b, i, m, (0.0, 0.0, 0.0), t), r))
    for point in range(POINTS):
        p, _ = point_of(scene, b, i, r, m, point, t)
        total += potential(law, p)
    return total / POINTS


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
def drift(scene: Any, b: Any, motion: Any, h: Any) -> bool:
    """Move and turn all bodies, freely but for their joints; whether joints could be held."""
    for i in range(b.w.size):
        if scene.joints is None or scene.joined[i] == 0:
            for axis in range(3):
                b.x[axis, i] += h * b.v[axis, i]
            q = turned_freely(orientation(b, i), row(b.spin, i), row(b.inertia, i), h)
            b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q
    held = True
    if scene.joints is not None:
        for component in range(scene.joints.next.size):
            held = drift_joined(scene.joints, b, motion, component, h) and held
    return held


def are_joined(scene: Any, i: Any, j: Any) -> bool:
    """Whether a joint holds two bodies together that do not touch each other."""
    found = False
    if scene.joints is not None:
        for at in range(scene.partner_from[i], scene.partner_from[i + 1]):
            found = found or scene.partners[at] == j
    return found


@outlined
def find_contacts(scene: Any, b: Any, k: Any, motion: Any, memory: Any, t: Any, h: Any) -> None:
    """All contacts of bodies and colliders that a step may meet.

    Bodies are sorted along x by where they begin, which changes little from step to step, and into strips across z that
    are as wide as the largest of them: those of one strip or of neighbours whose balls overlap are looked at.
    """
    n = b.w.size if scene.guests is None else scene.guests.first
    order, margin = memory.order, motion.margin
    k.number[0] = k.number[1] = 0
    for i in range(n):
        m = motion.now[i]
        speed = np.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
        turning = np.sqrt(m[3] * m[3] + m[4] * m[4] + m[5] * m[5])
        margin[i] = h * (speed + turning * b.reach[i]) + 2 * scene.slop
    for wall in scene.walls:
        for i in range(n):
            if wall.on[b.group[i]] > 0:
                touch_wall(wall, b, k, i, margin[i], t, h)
    for s in range(1, n):
        i, at = order[s], s
        begin = b.x[0, i] - b.reach[i] - margin[i]
        while at > 0 and starts_after(b, margin, order[at - 1], begin, i):
            order[at] = order[at - 1]
            at -= 1
        order[at] = i
    find_pairs(scene, b, k, motion, order, n)
    if scene.joints is not None:
        find_stops(scene.stops, scene.joints, b, k, motion, h)
    if scene.guests is not None:
        find_guests(scene.guests, b, k, motion, scene.slop, h)


def begins(b: Any, margin: Any, i: Any) -> Any:
    """Where a body begins along x."""
    return b.x[0, i] - b.reach[i] - margin[i]


def ends(b: Any, margin: Any, i: Any) -> Any:
    """Where it ends."""
    return b.x[0, i] + b.reach[i] + margin[i]


def meet(scene: Any, b: Any, k: Any, margin: Any, i: Any, j: Any) -> None:
    """Look for contacts of two bodies if their balls overlap."""
    if scene.surfaces.touch[b.group[i], b.group[j]] > 0:
        dx, dy, dz = b.x[0, i] - b.x[0, j], b.x[1, i] - b.x[1, j], b.x[2, i] - b.x[2, j]
        near = b.reach[i] + b.reach[j] + margin[i] + margin[j]
        if dx * dx + dy * dy + dz * dz < near * near and not are_joined(scene, i, j):
            touch(b, k, scene.surfaces, min(i, j), max(i, j), margin[i] + margin[j])


@outlined
def find_pairs(scene: Any, b: Any, k: Any, motion: Any, order: Any, n: Any) -> None:
    """Look at all pairs of bodies that may touch; `order` is that along x. Arrays of clusters serve for strips."""
    margin, strip, listed, begin = motion.margin, motion.cluster, motion.bodies, motion.body_from
    low, high, widest = np.inf, -np.inf, 0.0
    for i in range(n):
        low, high = min(low, b.x[2, i]), max(high, b.x[2, i])
        widest = max(widest, b.reach[i] + margin[i])
    width = max(
        2.000001 * widest, (high - low) / n
    )  # neighbours are in strips side by side, also after rounding
    parts = (high - low) / width
    number = int(parts) + 1 if parts < n - 1 else n
    for s in range(number + 1):
        begin[s] = 0
    for i in range(n):
        part = (b.x[2, i] - low) / width
        strip[i] = min(int(part), number - 1) if part >= 0 and part < n else 0
        begin[strip[i]] += 1
    for s in range(1, number):
        begin[s] += begin[s - 1]
    begin[number] = n
    for back in range(n):
        i = order[n - 1 - back]
        begin[strip[i]] -= 1
        listed[begin[strip[i]]] = i
    for s in range(number):
        for at in range(begin[s], begin[s + 1]):
            i, other = listed[at], at + 1
            while other < begin[s + 1] and begins(b, margin, listed[other]) <= ends(b, margin, i):
                meet(scene, b, k, margin, i, listed[other])
                other += 1
        if s + 1 < number:
            across(scene, b, k, motion, s, s + 1, True)
            across(scene, b, k, motion, s + 1, s, False)


@outlined
def across(scene: Any, b: Any, k: Any, motion: Any, s: Any, o: Any, together: Any) -> None:
    """Look at bodies of strip s and those of strip o that begin while they last, or `together` with them."""
    margin, listed, begin = motion.margin, motion.bodies, motion.body_from
    near = begin[o]
    for at in range(begin[s], begin[s + 1]):
        i = listed[at]
        mine = begins(b, margin, i)
        while near < begin[o + 1] and (
            begins(b, margin, listed[near]) < mine
            or (not together and begins(b, margin, listed[near]) == mine)
        ):
            near += 1
        other = near
        while other < begin[o + 1] and begins(b, margin, listed[other]) <= ends(b, margin, i):
            meet(scene, b, k, margin, i, listed[other])
            other += 1


def starts_after(b: Any, margin: Any, j: Any, begin: Any, i: Any) -> bool:
    """Whether body j begins, along x, after a place; of equal ones the one with the higher number."""
    mine = b.x[0, j] - b.reach[j] - margin[j]
    return mine > begin or (mine == begin and j > i)


@outlined
def part_overlaps(scene: Any, b: Any, k: Any, motion: Any, h: Any) -> bool:
    """Move bodies that overlap apart; whether joints could be held."""
    held = True
    if push_apart(b, k, motion, scene.joints, scene.slop, h):
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
        if report[0] != FULL and not drift(scene, b, motion, 0.5 * dt):
            report[0] = UNHELD
            return step
        report[0] = GOOD
        velocities(b, motion)
        find_contacts(scene, b, k, motion, memory, middle, dt)
        if k.number[1] > 0:
            report[0], report[1] = FULL, k.number[0] + k.number[1]
            return step
        lay_out(b, k, motion)
        kick(scene, b, motion, middle, dt)
        held = True
        if k.number[0] > 0 or scene.joints is not None:
            solve(b, k, motion, memory, scene.joints, dt)
        if scene.work is not None:
            book_step(scene, b, k, motion, middle, dt)
        if k.number[0] > 0:
            before = 0.0 if scene.work is None else energy_of(scene, b, motion, middle)
            held = part_overlaps(scene, b, k, motion, dt)
            if scene.guests is not None:
                settle_guests(scene, b, k)
            if scene.work is not None:
                velocities(b, motion)
                scene.work.totals[scene.work.contact] += energy_of(scene, b, motion, middle) - before
        if not (held and drift(scene, b, motion, 0.5 * dt)):
            report[0] = UNHELD
            return step
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
