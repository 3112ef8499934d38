"""Swift bodies: what a body meets in a drift that is long for its size, found before it passes it.

A body is swift in a drift of length h if some place of it comes farther than `SWIFT` of its inner radius r. It goes from one
safe time to the next (conservative advancement): with a distance d to all else, which nothing comes nearer to than by the
speed |v| + ω R of any of its places and that of the other, it is safe for d over the sum of the speeds. Near to others it
takes strides of `STRIDE` r, as bodies that are not swift do without a look, or goes to where a contact closes at its speed
along the normal. There it rebounds (`impact`), and goes on with the rest of the drift.

The body whose safe time is the least comes next, so that impacts are met in the order of time; where others are by then
follows from where they began. What has had `MOST_IMPACTS` rests where it is until the end of the drift, and is counted.
Bodies that are not swift, and are not hit, make their drift as if nobody had looked, with the same bits. As the solver
keeps very swift bodies from what is next to them only, one that was so is looked at until the solver has seen it slow.

Source: B. Mirtich, Impulse-based dynamic simulation of rigid body systems, thesis, Berkeley, 1996, chapter 2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.bodies.pieces import CAPSULE
from particlesim.colliders.moving import MovingRecord, frame_at, surface_velocity
from particlesim.compiler import outlined
from particlesim.engine.queue import empty, new_queue, put_in_order
from particlesim.engine.rigid.acting import sum_all_forces
from particlesim.engine.rigid.bending import note_bends
from particlesim.engine.rigid.bodies import NOBODY, WORLD, new_contacts, orientation, place, row
from particlesim.engine.rigid.broad import are_joined
from particlesim.engine.rigid.cells import follow, gather_near, new_body_cells, sort
from particlesim.engine.rigid.contact_rows import direct, speed_along
from particlesim.engine.rigid.free import move, own, velocity_of
from particlesim.engine.rigid.hearing import note_swift
from particlesim.engine.rigid.impact import rebound
from particlesim.engine.rigid.narrow import minus, touch
from particlesim.engine.rigid.oncoming import ELSE, TOUCHING, WATCHED, are_left, inner
from particlesim.engine.rigid.probing import probe
from particlesim.engine.rigid.rotation import dot, turned_freely
from particlesim.engine.rigid.walls import touch_wall
from particlesim.laws.registry import gap

SWIFT, VERY, JOINED = 0.5, 0.5, 1.0
"""Way in a drift from which on a body is swift, and very much so, in units of its inner radius, so that two that come to
each other are not past each other before they are seen; and one in a joint, whose impacts the solver knows better, as it
solves for joints with them. Looks cost: 1000 falling boxes that came a quarter as far took five times as long."""
STRIDE, SHORT = 0.25, 0.05
"""Way that a swift body comes without a look where it is near to others, in the same units; and one left to drifts."""
FINE = 1e-7
"""The gap at which those have their first impact that are left to drifts (`oncoming`), in the same units; each one doubles
it up to `TOUCHING`."""
MOST_IMPACTS, MOST_LOOKS = 256, 100_000
"""Impacts and looks of a body in a drift, after which it rests."""
TURN, MOST_TURNS = 0.1, 100
"""Angle by which a swift body turns at once, and how often it does so at most. Between impacts its energy swings by the
square of this; if it were by that of all its turn, impacts would come to have part of the swings for good."""
ROOM = 4096
"""Contacts of one body with one other for which there is room."""
NOT, ALONE, ALL = 0, 1, 2
"""Whether a body is in the queue: it is not; it meets colliders and others that have been left to drifts (`oncoming`); or
all."""


class Swift(NamedTuple):
    """Room for what swift bodies do. By body: its inner radius, the farthest place from its centre that comes elsewhere when
    it turns [m], 1 where all of its pieces are spheres and capsules; where its way began [n, 7], when [s], and its impacts
    and looks in this drift, and when it has looked last [n]; whether it is in the queue (`ALL`) [n], and the queue of the
    times until when they are safe. Contacts of a pair; the work of impacts in a step [J]. For how many drifts bodies are
    looked at if they are swift no more [n], and how often they had more impacts than are followed, since the start; whether
    they have been left to drifts in this step (`oncoming`) [n]. Where bodies are (`cells`), and room for those near to one
    [n]."""

    inner: Any
    lever: Any
    core: Any
    pose: Any
    begun: Any
    impacts: Any
    looks: Any
    looked: Any
    on: Any
    queue: Any
    contacts: Any
    gain: Any
    watch: Any
    tired: Any
    alone: Any
    cells: Any
    near: Any


def new_swift(shapes: Any, owner: Any, falls: bool) -> Swift:
    """Room for the bodies of groups with these shapes; `owner`: the group of each body; whether some restitution `falls`."""
    inner = np.array([shape.fineness() for shape in shapes])
    reach = np.array([shape.reach() for shape in shapes])
    # A ball that turns stays where it is.
    lever = np.where(inner >= reach, 0.0, reach)
    core = np.array([all(p.kind <= CAPSULE and p.size[2] == 0 for p in s.own_pieces()) for s in shapes])
    n = len(owner)
    begun, impacts, looks, looked = (np.zeros(n) for _ in range(4))
    return Swift(
        *(inner[owner], lever[owner], core.astype(np.int64)[owner], np.zeros((n, 7))),
        *(begun, impacts, looks, looked, np.zeros(n, np.int64), new_queue(n)),
        *(new_contacts(ROOM, falls), np.zeros(1)),
        *(np.zeros(n, np.int64), np.zeros(1, np.int64), np.zeros(n, np.int64)),
        *(new_body_cells(n), np.zeros(n, np.int64)),
    )


# ---- which bodies are swift


def speed_of(scene: Any, motion: Any, i: Any) -> Any:
    """A speed that no place of body i exceeds [m/s]."""
    m = motion.now[i]
    turning = np.sqrt(m[3] * m[3] + m[4] * m[4] + m[5] * m[5])
    return np.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) + turning * scene.swift.lever[i]


def speed_of_wall(wall: Any, b: Any, i: Any, t: Any) -> Any:
    """A speed that the surface of a collider does not exceed at body i [m/s]."""
    if isinstance(wall.shape, MovingRecord):
        w = surface_velocity(wall.shape, frame_at(wall.shape, t, 0.0), b.x[0, i], b.x[1, i], b.x[2, i])
        rate = 0.0 if wall.shape.spin is None else abs(wall.shape.spin.rate)
        return np.sqrt(dot(w, w)) + rate * b.reach[i]
    return 0.0


@outlined
def way_of(scene: Any, b: Any, motion: Any, i: Any, t: Any, h: Any) -> float:
    """How far some place of body i comes in a drift of h, by itself or on a collider that comes to it [m]; not less if that
    makes it swift."""
    s, v, spin = scene.swift, b.v, b.spin
    along = np.sqrt(v[0, i] * v[0, i] + v[1, i] * v[1, i] + v[2, i] * v[2, i])
    least = min(b.inertia[0, i], min(b.inertia[1, i], b.inertia[2, i]))
    turning = np.sqrt(spin[0, i] * spin[0, i] + spin[1, i] * spin[1, i] + spin[2, i] * spin[2, i]) / least
    way = h * (along + turning * s.lever[i])
    if way > SWIFT * s.inner[i]:  # the angular velocity may be less than that
        velocity_of(b, motion, i)
        way = h * speed_of(scene, motion, i)
    most = way
    for wall in scene.walls:
        if isinstance(wall.shape, MovingRecord) and wall.on[b.group[i]] > 0:
            more = way + h * speed_of_wall(wall, b, i, t)
            if more > SWIFT * s.inner[i] and gap(wall.shape, probe(place(b, i), b.reach[i], t)) < more:
                most = max(most, more)
    return float(most)


def enlist(scene: Any, motion: Any, i: Any, t: Any, h: Any) -> None:
    """Put a body in the queue, with no look beyond time t. Its velocity is in `now`."""
    s = scene.swift
    if not (s.alone[i] != ELSE and h * speed_of(scene, motion, i) <= SWIFT * s.inner[i]):
        s.on[i] = ALL
    elif s.on[i] == NOT:
        s.on[i] = ALONE
    wait(s, i, t)


def wait(s: Any, i: Any, t: Any) -> None:
    """Body i is safe until time t."""
    s.queue.due[i] = t
    put_in_order(s.queue, i)


# ---- where bodies are


def keep_place(b: Any, s: Any, i: Any) -> None:
    """The way of body i begins where it is."""
    for axis in range(3):
        s.pose[i, axis] = b.x[axis, i]
    for axis in range(4):
        s.pose[i, 3 + axis] = b.turn[axis, i]


def bring(b: Any, s: Any, i: Any, now: Any) -> None:
    """Body i is where it is after a time `now` of the drift."""
    for axis in range(3):
        b.x[axis, i] = s.pose[i, axis]
    for axis in range(4):
        b.turn[axis, i] = s.pose[i, 3 + axis]
    if now > s.begun[i]:
        go(b, i, now - s.begun[i], s.on[i] > 0)


def go(b: Any, i: Any, h: Any, swift: Any) -> None:
    """Move and turn a body freely; one that is swift by as many turns as it takes for none to be large. There are as many as
    long as nothing acts on it."""
    turns = 1
    if swift:
        spin, least = row(b.spin, i), min(b.inertia[0, i], min(b.inertia[1, i], b.inertia[2, i]))
        parts = h * np.sqrt(dot(spin, spin)) / least / TURN
        turns = 1 + int(parts) if parts < MOST_TURNS else MOST_TURNS
    if turns == 1:
        move(b, i, h)
        return
    for axis in range(3):
        b.x[axis, i] += h * b.v[axis, i]
    for _ in range(turns):
        q = turned_freely(orientation(b, i), row(b.spin, i), row(b.inertia, i), h / turns)
        b.turn[0, i], b.turn[1, i], b.turn[2, i], b.turn[3, i] = q


# ---- looks


def close_to(scene: Any, b: Any, i: Any, j: Any) -> Any:
    """The gap at which an impact of bodies i and j, or of i and a collider, is given [m]."""
    s = scene.swift
    fine = min(FINE * 2.0 ** s.impacts[i], TOUCHING) if are_left(scene, b, i, j) else TOUCHING
    return inner(s, i, j) * fine


@outlined
def outlook(
    scene: Any, b: Any, motion: Any, i: Any, j: Any, fast: Any, known: Any, left: Any, h: Any
) -> float:
    """For how long bodies i and j, or i and a collider, may go on with the contacts that were found; −1 where they hit each
    other now. No place comes nearer to the other faster than `fast`; where it is not `known` that there are no other
    contacts on the way, they take a stride at most. What goes along a hollow collider comes into it in a drift of h, and out
    again in the next one (`bending`)."""
    s, k = scene.swift, scene.swift.contacts
    touching, left_to = close_to(scene, b, i, j), are_left(scene, b, i, j)
    stride = (SHORT if left_to else STRIDE) * inner(s, i, j) / fast
    least, soonest, hits = fast * left, left, False
    for c in range(k.number[0]):
        n, at = (
            (k.normal[0, c], k.normal[1, c], k.normal[2, c]),
            (k.point[0, c], k.point[1, c], k.point[2, c]),
        )
        direct(b, k, motion, c, 0, k.first[c], k.second[c], at, n)
        u, g = speed_along(k, motion, c, 0), k.gap[c]
        least = min(least, g)
        if -u * left > max(g, 0.0) + touching + max(k.bend[c], 0.0) * h:
            if g <= touching:
                hits = True
            else:
                soonest = min(soonest, (g - 0.5 * touching) / -u)
    if hits:
        return -1.0
    free = least / fast if (known or left_to) and k.number[1] == 0 else stride
    return float(min(max(free, stride), soonest))


@outlined
def look_at_wall(scene: Any, wall: Any, b: Any, motion: Any, i: Any, t: Any, left: Any, h: Any) -> float:
    """For how long body i may go on beside a collider; −1 where it hits it now. Their contacts are in `contacts` then."""
    k = scene.swift.contacts
    fast = speed_of(scene, motion, i) + speed_of_wall(wall, b, i, t)
    far = gap(wall.shape, probe(place(b, i), b.reach[i], t))
    if far > fast * left:
        return float(left)
    if far > STRIDE * scene.swift.inner[i]:
        return float(far / fast)
    k.number[0] = k.number[1] = 0
    k.number[2] = 1 if are_left(scene, b, i, WORLD) else 0
    touch_wall(scene, wall, b, k, i, fast * left + close_to(scene, b, i, WORLD), t, 0.0)
    note_bends(scene, wall.shape, b, k, i, 0, t, 2 * h)
    return outlook(scene, b, motion, i, WORLD, fast, True, left, h)


@outlined
def look_at_body(scene: Any, b: Any, motion: Any, i: Any, j: Any, now: Any, left: Any, h: Any) -> float:
    """The same beside body j."""
    s, k = scene.swift, scene.swift.contacts
    if has_seen(scene, j, i, now):
        return float(s.queue.due[j] - now)
    bring(b, s, j, now)
    velocity_of(b, motion, j)
    fast = speed_of(scene, motion, i) + speed_of(scene, motion, j)
    d = minus(place(b, i), place(b, j))
    far = np.sqrt(dot(d, d)) - b.reach[i] - b.reach[j]
    if far > fast * left:
        return float(left)
    if far > STRIDE * inner(s, i, j):
        return float(far / fast)
    k.number[0] = k.number[1] = 0
    k.number[2] = 1 if are_left(scene, b, i, j) else 0
    touch(b, k, scene.surfaces, min(i, j), max(i, j), fast * left + close_to(scene, b, i, j))
    return outlook(scene, b, motion, i, j, fast, s.core[i] > 0 and s.core[j] > 0, left, h)


def has_seen(scene: Any, j: Any, i: Any, now: Any) -> bool:
    """Whether body j is safe from body i beyond a time: it has looked since that goes as it does. When a body in a joint has
    begun to is not known after an impact (`begin_anew`)."""
    s = scene.swift
    follows = s.on[j] != NOT and s.looks[j] > 0 and s.impacts[j] <= MOST_IMPACTS and s.looks[j] <= MOST_LOOKS
    since = (scene.joints is None or scene.joined[i] == 0) and s.looked[j] > s.begun[i]
    return bool(follows and s.queue.due[j] > now and (s.impacts[i] == 0 or since))


@outlined
def look_at_walls(scene: Any, b: Any, motion: Any, i: Any, t: Any, left: Any, late: Any, h: Any) -> float:
    """For how long body i may go on at time t beside all colliders; −1 where it has rebounded from one."""
    s, least = scene.swift, left
    for wall in scene.walls:
        if least >= 0 and wall.on[b.group[i]] > 0:
            least = min(least, look_at_wall(scene, wall, b, motion, i, t, left, h))
            if least < 0:
                close = 2 * close_to(scene, b, i, WORLD)
                if scene.hearing is not None:
                    note_swift(scene.hearing, b, s.contacts, motion, close, t)
                s.gain[0] += rebound(b, s.contacts, motion, i, WORLD, close, late)
    return float(least)


@outlined
def look_at_bodies(
    scene: Any, b: Any, motion: Any, i: Any, t: Any, now: Any, left: Any, late: Any, h: Any
) -> Any:
    """For how long body i may go on at time t beside all others, and the one that it has rebounded from, NOBODY if there
    is none."""
    s, least, hit, speed = scene.swift, left, NOBODY, speed_of(scene, motion, i)
    count = gather_near(s.cells, b, i, left, own(scene, b), s.near)
    for at in range(count):
        j = s.near[at]
        if hit == NOBODY and j != i and may_meet(scene, b, i, j, speed, now, left):
            free = look_at_body(scene, b, motion, i, j, now, left, h)
            least = min(least, free)
            if free < 0:
                close = 2 * close_to(scene, b, i, j)
                if scene.hearing is not None:
                    note_swift(scene.hearing, b, s.contacts, motion, close, t)
                s.gain[0] += rebound(b, s.contacts, motion, i, j, close, late)
                hit = j
    return least, hit


def may_meet(scene: Any, b: Any, i: Any, j: Any, speed: Any, now: Any, left: Any) -> bool:
    """Whether the balls about two bodies that touch each other may come together in the rest of a drift."""
    s = scene.swift
    if not scene.surfaces.touch[b.group[i], b.group[j]] > 0:
        return False
    if not (s.on[i] == ALL or s.on[j] == ALL or are_left(scene, b, i, j)):
        return False
    past = max(now - s.begun[j], 0.0)
    dx = b.x[0, i] - s.pose[j, 0] - past * b.v[0, j]
    dy = b.x[1, i] - s.pose[j, 1] - past * b.v[1, j]
    dz = b.x[2, i] - s.pose[j, 2] - past * b.v[2, j]
    own_speed = np.sqrt(b.v[0, j] * b.v[0, j] + b.v[1, j] * b.v[1, j] + b.v[2, j] * b.v[2, j])
    near = b.reach[i] + b.reach[j] + left * (speed + own_speed)
    return bool(dx * dx + dy * dy + dz * dz < near * near) and not are_joined(scene, i, j)


# ---- a drift


@outlined
def hasten(scene: Any, b: Any, motion: Any, t: Any, h: Any, second: Any) -> bool:
    """Have swift bodies meet what is on their way in a drift of h from time t on, the `second` of a step or the first.
    Whether there are any; those that are in the queue have made their drift then, but for joints."""
    s = scene.swift
    list_swift(scene, b, motion, t, h)
    if s.queue.size[0] == 0:
        return False
    for i in range(b.w.size):
        velocity_of(b, motion, i)
    if not second:  # else they are those of the kick
        sum_all_forces(scene, b, motion, t)
    while s.queue.due[s.queue.order[0]] < h:
        go_on(scene, b, motion, s.queue.order[0], t, h, second)
    for i in range(own(scene, b)):
        free = scene.joints is None or scene.joined[i] == 0
        bring(b, s, i, h if free and s.on[i] > 0 else 0.0)
    return True


def list_swift(scene: Any, b: Any, motion: Any, t: Any, h: Any) -> None:
    """Queue the bodies that are or were swift, or left to drifts, and have a drift begin."""
    s = scene.swift
    empty(s.queue)
    for i in range(own(scene, b)):
        s.on[i] = NOT
        way = way_of(scene, b, motion, i, t, h)
        free = scene.joints is None or scene.joined[i] == 0
        looks = way > (SWIFT if free else JOINED) * s.inner[i] or (free and s.watch[i] > 0)
        if looks and way < np.inf:
            velocity_of(b, motion, i)
            enlist(scene, motion, i, 0.0, h)
        s.watch[i] = WATCHED if way > VERY * s.inner[i] else max(s.watch[i] - 1, 0)
    if s.queue.size[0] > 0:
        sort(s.cells, b, own(scene, b), h)
        for i in range(own(scene, b)):
            keep_place(b, s, i)
            s.begun[i] = s.impacts[i] = s.looks[i] = 0.0


@outlined
def go_on(scene: Any, b: Any, motion: Any, i: Any, t: Any, h: Any, second: Any) -> None:
    """Body i goes to the end of its safe time and looks around."""
    s, hit, now = scene.swift, NOBODY, scene.swift.queue.due[i]
    late = now - h if second else now
    bring(b, s, i, now)
    velocity_of(b, motion, i)
    free = look_at_walls(scene, b, motion, i, t + now, h - now, late, h)
    struck = free < 0
    if not struck:
        beside, hit = look_at_bodies(scene, b, motion, i, t + now, now, h - now, late, h)
        free = min(free, beside)
        struck = hit != NOBODY
    s.looks[i] += 1
    s.looked[i] = now
    if struck:
        begin_anew(scene, b, i, now, h)
        enlist(scene, motion, i, now, h)
    else:
        wait(s, i, min(now + free, h))
    if hit != NOBODY:
        begin_anew(scene, b, hit, now, h)
        enlist(scene, motion, hit, now, h)
        if s.on[hit] == ALL:
            s.watch[hit] = WATCHED
    for each in range(2):
        body = i if each == 0 else hit
        if body != NOBODY and (s.impacts[body] > MOST_IMPACTS or s.looks[body] > MOST_LOOKS):
            stop(b, s, motion, body, now, h)


def begin_anew(scene: Any, b: Any, i: Any, now: Any, h: Any) -> None:
    """After an impact a body goes on from where it is; one in a joint, whose drift is made as a whole, counts as having had
    it at the beginning."""
    s = scene.swift
    s.impacts[i] += 1
    if scene.joints is None or scene.joined[i] == 0:
        keep_place(b, s, i)
        s.begun[i] = now
    follow(s.cells, b, i, h - now)


def stop(b: Any, s: Any, motion: Any, i: Any, now: Any, h: Any) -> None:
    """A body rests until the end of the drift, and pays for what forces would give it on what is left of its way."""
    bring(b, s, i, now)
    keep_place(b, s, i)
    velocity_of(b, motion, i)
    owed, had = 0.0, 0.0
    for axis in range(3):
        v, w = motion.now[i, axis], motion.now[i, 3 + axis]
        owed += (h - now) * (motion.pull[i, axis] * v + motion.pull[i, 3 + axis] * w)
        had += 0.5 * (v * v / b.w[i] + b.spin[axis, i] * w)
    if owed > 0 and had > 0:
        part = np.sqrt(max(1.0 - owed / had, 0.0))
        for axis in range(3):
            b.v[axis, i] *= part
            b.spin[axis, i] *= part
    s.begun[i] = h
    wait(s, i, h)
    s.tired[0] += 1
