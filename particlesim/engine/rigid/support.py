"""What particles among bodies lie on: colliders, and each other.

A body on grains on a floor rests on all of these at once. So what touches a body, what touches that, and so on, is among the
bodies for a step (`gather`), and all of their contacts take part in the impulses of the step: those that touch, and those
over a gap which a body that comes to a particle, or both, may close in the step. What bodies hit on their way, and what is
farther from each other, meets in its own step, in the order of time. Particles that rods hold at bodies, too, meet colliders
with these: what hits a floor is all that hangs together (`held_walls`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.moving import MovingRecord, spin_of
from particlesim.compiler import kernel, outlined
from particlesim.engine.rigid.bodies import (
    GRAINS,
    GUEST,
    WORLD,
    add_contact,
    name_contact,
    place,
    row,
    set_fall,
    set_surface,
)
from particlesim.engine.rigid.contact_rows import presses
from particlesim.engine.rigid.held_walls import SWIFT, TOUCH, meet_wall
from particlesim.engine.rigid.narrow import entry, minus, plus
from particlesim.engine.rigid.probing import away, probe
from particlesim.engine.rigid.rolling import roll_on
from particlesim.engine.rigid.rotation import dot
from particlesim.engine.rigid.touching import Touching
from particlesim.engine.rigid.walls import Wall, set_wall
from particlesim.laws.registry import gap
from particlesim.model.arrays import Floats, Ints

SLOW = 0.1
"""Way in a step up to which a particle lies on what it touches, as a part of its radius."""
NEAR = 1e-9
"""Gap that counts as none, as a part of the radius."""
LIES, CARRIED, BESIDE = 1, 2, 3
"""What `rests` is of a particle that may lie on something, is carried by that in this step, and touches a body."""
AROUND = 27
"""A cube of the grid and those beside it."""
MIDDLE = AROUND // 2
"""The number of that cube."""


class Support(NamedTuple):
    """Colliders, with the kinds of particles that each holds back (`walls`); contact of particles with each other
    [kinds, kinds] (`pairs`), and their rolling friction on colliders [kinds]; under which number emitters hear of impacts on
    colliders, −1 where none does [colliders, kinds] (not for kernels)."""

    walls: tuple[Wall, ...]
    pairs: Touching
    rolling: Any
    heard: Any


class Crowd(NamedTuple):
    """Particles that may lie on something below bodies: which of them touch a body, or others that do, at the beginning of
    the step, or are held by rods (`stands`), how they take part in it (`rests`), and which touch anything but bodies
    (`linked`) [n]; how fast bodies that touch them come to them, and those on rods move [m/s] (`press` [n]); what of the
    kick of the step colliders take back in their own step [m/s] (`borne` [3, n]); where they began the step
    (`began` [3, n]), and `cells` to find them in; the contact of those that a body hits within the step, −1 of others
    (`hit` [n]), and what accelerates them there (`pull` [3, n])."""

    stands: Any
    rests: Any
    linked: Any
    press: Any
    borne: Any
    began: Any
    cells: Any
    hit: Any
    pull: Any


class Cells(NamedTuple):
    """Particles in cubes of a grid, whose width is that of the largest contact [m]: the first one in each bucket of cubes,
    the next one of each, −1 at the end [n], and the cube of each [3, n]."""

    width: float
    first: Any
    next: Any
    cube: Any


def new_cells(radius: Floats) -> Cells:
    """Cells for particles of such radii."""
    n = len(radius)
    width = 2 * (1 + TOUCH) * float(radius.max(initial=0.0)) or 1.0
    return Cells(
        width,
        np.full(1 << max(4, (2 * n - 1).bit_length()), -1, np.int64),
        np.full(n, -1, np.int64),
        np.zeros((3, n), np.int64),
    )


def new_crowd(stands: Ints, radius: Floats) -> Crowd:
    """Particles at the beginning of a step."""
    n = len(radius)
    rests, linked = np.zeros((2, n), np.int64)
    borne, began, pull = np.zeros((3, 3, n))
    return Crowd(
        stands.copy(), rests, linked, np.zeros(n), borne, began, new_cells(radius), np.full(n, -1), pull
    )


def bucket(cells: Any, i: Any, number: Any) -> int:
    """Where the particles are of a cube beside that of particle i, and maybe others."""
    a, b, c = beside(cells, i, number)
    return int((a * 73856093 + b * 19349663 + c * 83492791) & (cells.first.size - 1))


def beside(cells: Any, i: Any, number: Any) -> Any:
    """A cube beside that of particle i."""
    x, y, z = cells.cube[0, i], cells.cube[1, i], cells.cube[2, i]
    return x + number % 3 - 1, y + number // 3 % 3 - 1, z + number // 9 - 1


def is_in(cells: Any, o: Any, i: Any, number: Any) -> bool:
    """Whether particle o is in a cube beside that of particle i."""
    a, b, c = beside(cells, i, number)
    return bool((cells.cube[0, o] == a) & (cells.cube[1, o] == b) & (cells.cube[2, o] == c))


@outlined
def sort_in(cells: Any, x: Any, may: Any) -> None:
    """Put the particles at x [3, n] that `may` be met [n] into cells."""
    for at in range(cells.first.size):
        cells.first[at] = -1
    for back in range(cells.next.size):
        i = cells.next.size - 1 - back
        if may[i] > 0:
            for axis in range(3):
                cells.cube[axis, i] = int(np.floor(x[axis, i] / cells.width))
            at = bucket(cells, i, MIDDLE)
            cells.next[i] = cells.first[at]
            cells.first[at] = i


@kernel
def gather(
    cells: Any, touch: Any, x: Any, radius: Any, kind: Any, may: Any, found: Any, queue: Any, enough: Any
) -> int:
    """All particles that touch those which are `found` (1) already [n], what touches these, and so on, into found and, in
    turn, into the queue [n], until there are so many, or a few more; `touch` [kinds, kinds]. Those that `may` not be moved
    (2) pass nothing on [n]. Returns how many there are."""
    sort_in(cells, x, may)
    count, at = 0, 0
    for i in range(found.size):
        if found[i] > 0:
            queue[count] = i
            count += 1
    while at < count and count < enough:
        i = queue[at]
        at += 1
        for number in range(AROUND if may[i] == 1 else 0):
            o = cells.first[bucket(cells, i, number)]
            while o >= 0:
                if found[o] == 0 and touch[kind[i], kind[o]] > 0:
                    d = (x[0, i] - x[0, o], x[1, i] - x[1, o], x[2, i] - x[2, o])
                    reach = radius[i] + radius[o] + TOUCH * min(radius[i], radius[o])
                    if dot(d, d) < reach * reach:
                        found[o] = 1
                        queue[count] = o
                        count += 1
                o = cells.next[o]
    return count


@outlined
def find_support(guests: Any, b: Any, k: Any, t: Any, h: Any, joints: Any) -> None:
    """Note what guests lie on in a step of length h, whose middle is at t; their own contacts with bodies are known. What a
    body hits on its way is between it and colliders, too. What does not await anything gets no force of its own. `joints`
    are those that may hold guests, None where there are none."""
    s, crowd, count = guests.support, guests.crowd, 0
    for m in range(guests.radius.size):
        lies = crowd.stands[m] > 0 and guests.alone[m] == 0 and crowd.hit[m] < 0
        # What rods hold, and is swift, meets others for itself.
        lies = lies and (m >= guests.held or h * crowd.press[m] < SWIFT * guests.radius[m])
        crowd.rests[m], crowd.linked[m] = LIES if lies else 0, 0
        if lies:
            guests.awaits[m] = 1
            count += 1
        for axis in range(3):
            crowd.pull[axis, m], crowd.borne[axis, m] = guests.pull[axis, m], 0.0
            if guests.awaits[m] == 0:
                guests.other[axis, m] = 0.0
    for wall in s.walls:
        for m in range(guests.radius.size):
            here = crowd.rests[m] > 0 or crowd.hit[m] >= 0
            on_rod = m < guests.held and crowd.hit[m] < 0 and guests.alone[m] == 0
            if wall.on[guests.kind[m]] > 0 and b.w[guests.first + m] > 0:
                if here and not on_rod:
                    on_wall(wall, guests, b, k, m, t, h)
                # Without joints nothing is held, and there is less to compile.
                if joints is not None and on_rod:
                    meet_wall(wall, guests, b, k, m, t, h)
    if count == 0:
        return
    sort_in(crowd.cells, crowd.began, crowd.rests)
    for m in range(guests.radius.size):
        for number in range(AROUND if crowd.rests[m] > 0 else 0):
            o = crowd.cells.first[bucket(crowd.cells, m, number)]
            while o >= 0:
                touch = s.pairs.touch[guests.kind[m], guests.kind[o]] > 0
                if touch and guests.id[m] < guests.id[o] and is_in(crowd.cells, o, m, number):
                    on_each_other(guests, b, k, m, o, h)
                o = crowd.cells.next[o]


@outlined
def on_wall(wall: Any, guests: Any, b: Any, k: Any, m: Any, t: Any, h: Any) -> None:
    """Note the contact of a guest with a collider."""
    i, radius, crowd = guests.first + m, guests.radius[m], guests.crowd
    p = probe(row(crowd.began, m), radius, t - 0.5 * h)
    distance = gap(wall.shape, p)
    if distance < TOUCH * radius + h * crowd.press[m]:
        n, friction = away(wall.shape, p), guests.support.rolling[guests.kind[m]]
        at = plus(place(b, i), -radius, n)
        number = add_contact(k, i, WORLD, GRAINS + guests.id[m], at, n, distance)
        if number >= 0:
            set_wall(wall, k, number, t)
            name_contact(k, number, GUEST, GUEST - 1 - wall.number)
            crowd.linked[m] = 1
            if crowd.hit[m] >= 0 and is_pressed(wall, guests, b, k, m, t, h):
                hold_back(crowd, k, m, n)
            if friction > 0:
                roll_on(b, k, number, friction, radius, spin_of(wall.shape))


def is_pressed(wall: Any, guests: Any, b: Any, k: Any, m: Any, t: Any, h: Any) -> bool:
    """Whether a guest would be in a collider at the time at which a body hits it."""
    crowd, when, i = guests.crowd, k.late[0, guests.crowd.hit[m]], guests.first + m
    at = plus(plus(row(crowd.began, m), when, row(b.v, i)), 0.5 * when * when, row(crowd.pull, m))
    radius = guests.radius[m]
    return bool(gap(wall.shape, probe(at, radius, t - 0.5 * h + when)) < NEAR * radius)


def hold_back(crowd: Any, k: Any, m: Any, n: Any) -> None:
    """Until a body hits a guest, a collider with the normal n takes back what presses it on this."""
    press = min(dot(row(crowd.pull, m), n), 0.0)
    for axis in range(3):
        crowd.pull[axis, m] -= press * entry(n, axis)
    k.late[1, crowd.hit[m]] = -dot(row(crowd.pull, m), row(k.normal, crowd.hit[m]))


@outlined
def lies_on_collider(guests: Any, motion: Any, m: Any, t: Any, h: Any) -> bool:
    """Whether a guest lies on a collider at the beginning of a step of length h, whose middle is at t."""
    now, r, lies = motion.now[guests.first + m], guests.radius[m], False
    if h * np.sqrt(now[0] ** 2 + now[1] ** 2 + now[2] ** 2) < SLOW * r:
        for wall in guests.support.walls:
            if not lies and wall.on[guests.kind[m]] > 0:
                lies = gap(wall.shape, probe(row(guests.crowd.began, m), r, t - 0.5 * h)) < TOUCH * r
    return bool(lies)


@outlined
def on_each_other(guests: Any, b: Any, k: Any, m: Any, o: Any, h: Any) -> None:
    """Note the contact of two guests, if they touch."""
    one, two, crowd, s = guests.radius[m], guests.radius[o], guests.crowd, guests.support.pairs
    d, i, j = minus(row(crowd.began, m), row(crowd.began, o)), guests.first + m, guests.first + o
    distance = np.sqrt(dot(d, d)) - one - two
    near = TOUCH * min(one, two) + h * max(crowd.press[m], crowd.press[o])
    d = minus(place(b, i), place(b, j))  # where impulses act, so that they turn nothing
    length = np.sqrt(dot(d, d))
    if distance < near and length > 0 and b.w[i] + b.w[j] > 0:
        n = (d[0] / length, d[1] / length, d[2] / length)
        at = plus(place(b, j), two + 0.5 * distance, n)
        number = add_contact(k, i, j, GRAINS + guests.id[m], at, n, distance)
        a, c = guests.kind[m], guests.kind[o]
        set_surface(k, number, s.restitution[a, c], s.static[a, c], s.kinetic[a, c])
        if number >= 0:
            if k.falls is not None:
                set_fall(k, number, 0, s.restitution[a, c], s.speed[a, c], s.exponent[a, c])
            name_contact(k, number, GUEST, guests.id[o])
            crowd.linked[m] = crowd.linked[o] = 1
            if s.rolling[a, c] > 0:
                roll_on(b, k, number, s.rolling[a, c], one * two / (one + two), (0.0, 0.0, 0.0))


@kernel
def lift_out(guests: Any, x: Any, v: Any, shift: Any, t: Any) -> None:
    """Guests that would begin their own step, from x + shift [3, n] with v [3, n] at a time t, inside a collider at rest
    which they leave, begin it on its surface: slower, as the work of that way takes against what accelerates them."""
    for wall in guests.support.walls:
        lift_out_of(wall, guests, x, v, shift, t)


@outlined
def lift_out_of(wall: Any, guests: Any, x: Any, v: Any, shift: Any, t: Any) -> None:
    """`lift_out` of one collider."""
    if isinstance(wall.shape, MovingRecord):
        return
    for m in range(guests.radius.size):
        if wall.on[guests.kind[m]] > 0 and guests.tied[m] == 0:
            radius = guests.radius[m]
            p = probe(plus(row(x, m), 1.0, row(shift, m)), radius, t)
            distance = gap(wall.shape, p)
            if distance < -NEAR * radius:
                n = away(wall.shape, p)
                up, press = dot(row(v, m), n), dot(row(guests.pull, m), n)
                if up > 0 and press < 0:
                    less = up - np.sqrt(max(up * up - 2 * press * distance, 0.0))
                    for axis in range(3):
                        shift[axis, m] -= distance * entry(n, axis)
                        v[axis, m] -= less * entry(n, axis)


def note_carried(guests: Any, k: Any) -> None:
    """Note which guests others, or colliders, carry in this step."""
    for c in range(k.number[0]):
        if k.names[0, c] == GUEST and presses(k, c):
            for i in (k.first[c], k.second[c]):
                if i >= 0:
                    guests.crowd.rests[i - guests.first] = CARRIED


@outlined
def note_weights(guests: Any, b: Any, k: Any, h: Any) -> None:
    """Note what of the kick of a step of h presses guests onto colliders that carry them, which will take it back in their
    own step: there it would first take them into the collider."""
    borne = guests.crowd.borne
    for c in range(k.number[0]):
        m = k.first[c] - guests.first
        if m >= 0 and k.second[c] == WORLD and presses(k, c):
            n, w, along = row(k.normal, c), b.w[k.first[c]], 0.0
            for axis in range(3):
                along += n[axis] * (h * w * guests.other[axis, m] - borne[axis, m])
            for axis in range(3):
                borne[axis, m] += min(along, 0.0) * n[axis]
