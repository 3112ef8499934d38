"""Soft contacts with colliders: normal force, friction and torque by the law of contacts between particles.

A wall is a second sphere of infinite radius and mass: R = r₁, m = m₁, with the wall's own restitution and friction. Contacts
are computed in the frame of the wall, in which a moving wall is at rest; the lever arm is the distance of the centre.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.moving import MovingRecord, frame_at, into, out_of, ride
from particlesim.colliders.response import belt_along
from particlesim.compiler import outlined
from particlesim.engine.interactions.contact_lists import HOLDS, SLIDES
from particlesim.engine.interactions.interaction import Site
from particlesim.engine.interactions.neighbours.record import FAR, GROUP, MOVED, MOVED_HIGH
from particlesim.engine.interactions.neighbours.search import ROUNDING
from particlesim.engine.interactions.neighbours.sort import over_slices
from particlesim.engine.interactions.pressing import Held, Rolling, Turning, press
from particlesim.engine.state.columns import fetch, presence, type_of
from particlesim.engine.step.records import as_precision
from particlesim.interactions import PairSet
from particlesim.interactions.contact import JkrRecord, stretch
from particlesim.laws.pair import Pair
from particlesim.laws.registry import Particle, gap, gap_and_normal
from particlesim.scenario.reach import held_back


class Marks(NamedTuple):
    """The memory of particles of a wall, by their rows: `state` [n], twice the round (`contact_lists.ROUND`) in which they
    touched it last, and 1 more if they slid; `anchor` and `rolled` [3, n] as in `contact_lists.Memory`."""

    state: Any
    anchor: Any
    rolled: Any

    def moved(self, place: Any) -> Marks:
        """The memory of the same particles in other rows, row i in row `place[i]`."""
        there = Marks(*(None if each is None else np.zeros_like(each) for each in self))
        self.move_to(there, place)
        return there

    def move_to(self, there: Marks, place: Any) -> None:
        """Bring what these know to others, in which row i is row `place[i]`: few particles have ever touched a wall."""
        known = np.flatnonzero(self.state)
        for mine, theirs in zip(self, there, strict=True):
            if mine is not None:
                theirs[..., place[known]] = mine[..., known]


ENDLESS = 1e30
"""The radius of a wall [m], compared with which that of a grain is negligible, also in single precision."""


class Wall(NamedTuple):
    """A shape, the law of contact with it, the velocity of its surface along itself, None if there is none, and which
    particles it holds back [n], None: all."""

    shape: Any
    law: Any
    belt: Any
    members: Any


class Touched(NamedTuple):
    """A particle at a wall, in the world: force [N], torque [N m], elastic push [N], the rate at which the contact opens
    [m/s], and the energy [J]."""

    force: Any
    torque: Any
    push: Any
    rate: Any
    energy: Any


def local(wall: Any, p: Any) -> Any:
    """The shape at rest, and the particle beside it."""
    return (
        (wall.shape.shape, ride(wall.shape, p)) if isinstance(wall.shape, MovingRecord) else (wall.shape, p)
    )


def holds_on(wall: Any, memory: Any, r: Any, row: Any, turn: Any) -> Any:
    """The gap up to which a particle touches a wall [m]: 0, except with adhesion."""
    none = r - r
    if isinstance(wall.law, JkrRecord):
        return stretch(wall.law, r) if memory.state[row] >> 1 == turn else none
    return none


def wall_gap(wall: Any, c: Any, row: Any, t: Any) -> Any:
    """The gap between a particle and a wall [m]."""
    return gap(wall.shape, fetch(c, row, t))


@outlined
def press_wall(
    wall: Any, memory: Any, c: Any, inverse: Any, row: Any, t: Any, ago: Any, turn: Any, settles: Any
) -> Any:
    """A particle that overlaps a wall, in a step that began `ago` [s] after a round; what it remembers is brought up to date
    if it `settles`."""
    p = fetch(c, row, t)
    shape, q = local(wall, p)
    g, axes = gap_and_normal(shape, q)
    zero = type_of(g, 0)
    belt: Any = tuple(zero if u is None else u for u in belt_along(wall, axes))
    n = tuple(zero if axis is None else axis for axis in axes)
    pair = Pair(
        q.x,
        q.y,
        q.z,
        q.vx - belt[0],
        q.vy - belt[1],
        q.vz - belt[2],
        p.m,
        p.m,
        p.r,
        type_of(g, ENDLESS),
        a1=inverse,
        a2=zero,
    )
    rows = frame_at(wall.shape, t, p.x).rows if isinstance(wall.shape, MovingRecord) else None
    turning, rolling, held = None, None, None
    if c.spin is not None:
        w, a = (
            (c.spin.wx[row], c.spin.wy[row], c.spin.wz[row]),
            (c.spin.ax[row], c.spin.ay[row], c.spin.az[row]),
        )
        if rows is not None:
            s = wall.shape.spin
            own = (s.rate * s.x, s.rate * s.y, s.rate * s.z)
            w = tuple(u - type_of(u, v) for u, v in zip(w, own, strict=True))
            a = tuple(u - type_of(u, v * ago) for u, v in zip(a, own, strict=True))
        w, a = into(rows, w), into(rows, a)
        arm = (p.r + g) / p.r
        turning = Turning(arm, tuple(p.r * u for u in w), tuple(p.r * u for u in a))
    if memory is not None:
        # the surface has gone on since the step began, as far as its belt takes it
        k = tuple(memory.anchor[axis, row] - type_of(g, belt[axis] * ago) for axis in range(3))
        slid = type_of(g, SLIDES if (memory.state[row] & 1) != 0 else HOLDS)
        held = Held(slid if memory.state[row] >> 1 == turn else zero, *k)
        if memory.rolled is not None:
            rolling = Rolling(w, a, (memory.rolled[0, row], memory.rolled[1, row], memory.rolled[2, row]))
    found = press(wall.law, pair, n, -g, held, turning, rolling, ago)
    if memory is not None and settles:
        memory.state[row] = 2 * (turn + 1) + (1 if found.held.state == SLIDES else 0)
        memory.anchor[0, row], memory.anchor[1, row], memory.anchor[2, row] = (
            found.held.x,
            found.held.y,
            found.held.z,
        )
        if memory.rolled is not None:
            for axis in range(3):
                memory.rolled[axis, row] = found.rolled[axis]
    torque = tuple(m - p.r * u for m, u in zip(found.moment, found.twist, strict=True))
    return Touched(out_of(rows, found.force), out_of(rows, torque), found.push, found.rate, found.energy)


def is_held_back(wall: Any, c: Any, row: Any) -> Any:
    """Whether a wall holds back a particle, if that is there."""
    there = presence(c.clock, row) > 0
    return there if wall.members is None else there & (wall.members[row] != 0)


def drifted(near: Any) -> Any:
    """The lowest and highest displacements of all members since lists were built [m]."""
    low = tuple(over_slices(near, MOVED + axis)[0] for axis in range(3))
    return low + tuple(over_slices(near, MOVED_HIGH + axis)[1] for axis in range(3))


def surrounding(each: Any, drift: Any, first: Any, last: Any) -> Any:
    """A ball around all members of groups [first, last), as a particle [m]: its centre and radius; the radius is negative
    where there is none. `drift` is how far members may be from where the boxes of groups have them."""
    near, largest = each.near, 0.0
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    for g in range(first, last):
        box = box_of(near, drift, g)
        x0, y0, z0 = min(x0, box[0]), min(y0, box[1]), min(z0, box[2])
        x1, y1, z1 = max(x1, box[3]), max(y1, box[4]), max(z1, box[5])
        largest = max(largest, near.spread[g])
    dx, dy, dz = 0.5 * (x1 - x0), 0.5 * (y1 - y0), 0.5 * (z1 - z0)
    x, y, z = x0 + dx, y0 + dy, z0 + dz
    wide = largest + np.sqrt(dx * dx + dy * dy + dz * dz)
    wide += ROUNDING * (abs(x) + abs(y) + abs(z) + wide)
    kind = near.x[0, 0]
    return tuple(type_of(kind, v) for v in (x, y, z, wide if x0 <= x1 else -1.0))


def box_of(near: Any, drift: Any, g: Any) -> Any:
    """Lowest and highest coordinates of the members of a group [m], where the state has them."""
    if near.wrap is None:
        return tuple(near.boxes[k, g] + drift[k] for k in range(6))
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    for k in range(GROUP * g, GROUP * g + GROUP):
        x, y, z = (float(near.x[axis, k] - near.wrap[axis, k]) for axis in range(3))
        there = near.x[0, k] < FAR
        x0, x1 = x if there & (x < x0) else x0, x if there & (x > x1) else x1
        y0, y1 = y if there & (y < y0) else y0, y if there & (y > y1) else y1
        z0, z1 = z if there & (z < z0) else z0, z if there & (z > z1) else z1
    return x0, y0, z0, x1, y1, z1


def is_clear(wall: Any, ball: Any, reach: Any, t: Any) -> Any:
    """Whether nothing in a ball can touch a wall, or hold on to it within a reach: gaps do not change faster than places.
    Its middle is asked for, as some shapes would search all of the ball for what it touches."""
    x, y, z, radius = ball
    none = x - x
    p = Particle(x, y, z, none, none, none, none + type_of(none, 1), none, none, t, none)
    return (radius < 0) | (gap(wall.shape, p) - radius > reach)


def walls_of(site: Site, pairs: PairSet) -> tuple[tuple[Wall, ...], tuple[Marks | None, ...]]:
    """The colliders that the particles of a contact law meet, and what they remember of each."""
    law: Any = pairs.law
    names = list(pairs.groups)
    walls, memories = [], []
    for each in site.scenario.all_colliders:
        if each.contact != "bounce" or not held_back(each, names):
            continue
        members = np.zeros(site.whole.count, np.int8)
        for name in names:
            if held_back(each, (name,)):
                members[site.offset[name] : site.offset[name] + site.state[name].count] = 1
        record = law.against(each.liveliness, each.coefficients)
        walls.append(
            as_precision(
                Wall(each.body(), record, each.surface_velocity, None if members.all() else members),
                site.dtype,
            )
        )
        memory = None
        if record.friction is not None or isinstance(record, JkrRecord):
            n, rolls = site.whole.count, record.rolling is not None
            rolled = np.zeros((3, n), site.dtype) if rolls else None
            memory = Marks(np.zeros(n, np.int64), np.zeros((3, n), site.dtype), rolled)
        memories.append(memory)
    return tuple(walls), tuple(memories)
