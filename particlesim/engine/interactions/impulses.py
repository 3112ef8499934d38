"""Hard contacts: particles that overlap at the end of a step and approach get impulses, and are moved apart.

Pairs are taken one after the other, in the order of the lists and then backwards, until none approaches (Gauss–Seidel). With
w = 1/m, n from the second to the first and v_n = (v₁ − v₂)·n < 0 a pair gets

    j = −(1 + e) v_n/(w₁ + w₂),   v₁ += w₁ j n,   v₂ −= w₂ j n,

and across n, by Coulomb, the impulse that stops sliding if that is at most μ_s j, else μ_k j. The surfaces slide over each
other at u = v_t − s (r₁ ω₁ + r₂ ω₂) × n with s = |l|/(r₁ + r₂), and the impulse u/((1 + 5 s²/2) (w₁ + w₂)) stops them, which
is 2/7 u/(w₁ + w₂) where spheres just touch; its torque turns both. So momentum and angular momentum are kept, and energy
never grows, pair by pair. An approach as slow as forces bring about within two steps counts as rest, with e = 0. Colliders
on which particles lie take part in the iteration, so that a particle on the floor holds one on top of it.

Then positions: overlaps are halved some times, by displacements in inverse proportion to the masses, which leave velocities
as they are. A pair is moved apart by at most `GENTLY` of its smaller radius in a step, so that particles that overlap at the
start do not fly apart.

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988); E. Guendelman, R. Bridson,
R. Fedkiw, ACM Trans. Graph. 22, 871 (2003), for impacts before contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.moving import MovingRecord, carried, frame_at, surface_velocity
from particlesim.colliders.response import ResponseRecord, put_back, rebound
from particlesim.compiler import outlined
from particlesim.compiler.barrier import meet
from particlesim.engine.interactions.contacts import hold_stuck, with_masses
from particlesim.engine.interactions.interaction import Floats, Site
from particlesim.engine.interactions.lifting import book, lifted, stored
from particlesim.engine.interactions.near_pairs import NearLists, bring_up, near_pairs_of
from particlesim.engine.interactions.neighbours.record import Neighbours, enlarged, forget
from particlesim.engine.interactions.pair_blocks import Block
from particlesim.engine.interactions.pressing import cross
from particlesim.engine.interactions.touching import touching
from particlesim.engine.state.columns import fetch, held, type_of
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.rubbing import rub
from particlesim.interactions import PairSet
from particlesim.laws.registry import PASS, gap_and_normal, moved_to

PAIRS = 8
"""Pairs per particle to have room for at first; twice what dense packings of equal spheres have."""
MOST_TURNS = 60
"""Turns through all pairs in a step at most; what still approaches then goes on in the next."""
SETTLED = 1e-3
"""Approaches that turns end with, as a part of the largest that forces have brought about in the step."""
REST = 2.0
"""Steps in which forces bring about an approach that counts as rest."""
TURNS_APART = 4
"""Turns in which overlaps are made smaller."""
GENTLY = 0.02
"""Part of the smaller radius by which a pair is moved apart in a step at most."""
NEAR_WALL, ON_WALL = 0.1, 1e-4
"""Gaps to a collider, as parts of the radius, below which a particle is watched, and below which it lies on it."""
COUNT, LOST = range(2)
"""In `report`: how many pairs there are, and whether some found no room."""


class Bench(NamedTuple):
    """Room to work in: rows of pairs [2, room]; normal, least speed of an impact that rebounds, and s [5, room]; what to add
    to the difference of their places for the nearest image [3, room] [m]; rows of particles at colliders [n], normals there
    and such speeds [4, n], and where those at each collider of each group end; which particles are in a pair [n]."""

    rows: Any
    normal: Any
    shift: Any
    wall: Any
    wall_normal: Any
    ends: Any
    mark: Any


class ImpulseColumns(NamedTuple):
    """Hard contacts of one law: the first ten as in `NearColumns`; then room to work in, a report, and the energy that
    moving particles apart has given them so far [1] [J]."""

    law: Any
    least: Any
    most: Any
    a: Any
    b: Any
    ids: Any
    near: Neighbours
    seen: Block
    pull: Any
    box: Any
    bench: Bench
    report: Any
    fed: Any


class Impulses(NearLists, ImpulseColumns):
    """Hard contacts, which act between steps. One thread gives the impulses, after all have found the pairs."""

    __slots__ = ()
    prepares: ClassVar[bool] = False
    concludes: ClassVar[bool] = True
    looks_back: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(ImpulseColumns._fields) - {"report", "fed"}

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        pass

    def conclude(self, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
        hold_stuck(self, c, share)
        bring_up(self, c, share, t)
        if share.number == 0:
            resolve(self, parts, c, before, t, h)
        meet(share.gate, share.threads)

    def renewed(self) -> Self:
        forget(self.near)
        near, bench = enlarged(self.near), self.bench
        if self.report[LOST]:
            self.report[LOST] = 0
            room = 2 * bench.rows.shape[1]
            bench = new_bench(room, bench.wall.size, bench.ends.size, bench.mark.size, bench.normal.dtype)
        if near is self.near and bench is self.bench:
            return self
        return self._replace(near=near, bench=bench)

    @property
    def given(self) -> float:
        return float(self.fed[0])

    def changing(self) -> tuple[Floats, ...]:
        return (self.fed,)

    def with_changed(self, arrays: Sequence[Floats]) -> Self:
        return self._replace(fed=arrays[0])

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        return np.zeros(3)


class Listed(NamedTuple):
    """Pairs that touch go to a list, each once."""

    bench: Any
    report: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Append a pair, if its first row is the smaller one."""
        if row < other:
            k = self.report[COUNT]
            if k < self.bench.rows.shape[1]:
                self.bench.rows[0, k] = row
                self.bench.rows[1, k] = other
                self.bench.shift[0, k], self.bench.shift[1, k], self.bench.shift[2, k] = p.x, p.y, p.z
                self.report[COUNT] = k + 1
            else:
                self.report[LOST] = 1


@outlined
def list_touching(each: Any, t: Any) -> None:
    """List all pairs that touch, in the order of the lists."""
    each.report[COUNT] = 0
    for g in range(each.near.begin.size):
        touching(each, g, Listed(each.bench, each.report), t)


def resolve(each: Any, parts: Any, c: Any, before: Any, t: Any, h: Any) -> None:
    """Impulses and displacements of all pairs that touch."""
    list_touching(each, t)
    if each.report[COUNT] > 0:
        calm = look_at(each, c, before)
        watch_walls(each, parts, c, before, t)
        turn, going = 0, True
        while going & (turn < MOST_TURNS):
            worst = give_impulses(each, c, turn % 2)
            push_off_walls(each, parts, c, t)
            going = worst > calm
            turn += 1
        low = stored(parts, c, each.bench.mark, t)
        for _ in range(TURNS_APART):
            move_apart(each, c)
            put_on_walls(each, parts, c, t)
        # not what steps take away from overlaps, and forces bring back
        most = max(stored(parts, c, each.bench.mark, t) - low, 0.0)
        book(each.fed, min(lifted(parts, c, before, each.bench.mark, t, h), most))


def line_between(c: Any, i: Any, j: Any, shift: Any, k: Any) -> Any:
    """From particle j to particle i of pair k: the unit vector, along x for coincident centres, and the distance."""
    x = c.x[i] - c.x[j] + shift[0, k]
    y = c.y[i] - c.y[j] + shift[1, k]
    z = c.z[i] - c.z[j] + shift[2, k]
    r = np.sqrt(x * x + y * y + z * z)
    one, apart = type_of(r, 1), r > 0
    by = one / (r if apart else one)
    return by * x if apart else -one, by * y, by * z, r


@outlined
def look_at(each: Any, c: Any, before: Any) -> Any:
    """Normals of all pairs, and from which speed on each rebounds; returns the approach that turns end with."""
    bench, most = each.bench, type_of(c.x[0], 0)
    for i in range(bench.mark.size):
        bench.mark[i] = 0
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        bench.mark[i] = bench.mark[j] = 1
        bench.shift[0, k] -= c.x[i] - c.x[j]
        bench.shift[1, k] -= c.y[i] - c.y[j]
        bench.shift[2, k] -= c.z[i] - c.z[j]
        x, y, z, far = line_between(c, i, j, bench.shift, k)
        if c.spin is not None:
            bench.normal[4, k] = far / (c.r[i] + c.r[j])
        bench.normal[0, k], bench.normal[1, k], bench.normal[2, k] = x, y, z
        now = (c.vx[i] - c.vx[j]) * x + (c.vy[i] - c.vy[j]) * y + (c.vz[i] - c.vz[j]) * z
        then = (
            (before[3, i] - before[3, j]) * x
            + (before[4, i] - before[4, j]) * y
            + (before[5, i] - before[5, j]) * z
        )
        change = abs(now - then)
        bench.normal[3, k] = type_of(change, REST) * change
        most = max(most, change)
    return type_of(most, SETTLED) * most


@outlined
def give_impulses(each: Any, c: Any, backwards: Any) -> Any:
    """A turn through all pairs; returns the fastest approach that it met."""
    bench, friction, worst = each.bench, each.law.friction, type_of(c.x[0], 0)
    number, one = each.report[COUNT], type_of(c.x[0], 1)
    for q in range(number):
        k = number - 1 - q if backwards else q
        i, j = bench.rows[0, k], bench.rows[1, k]
        wi, wj = each.a[i], each.a[j]
        x, y, z, least = bench.normal[0, k], bench.normal[1, k], bench.normal[2, k], bench.normal[3, k]
        vx, vy, vz = c.vx[i] - c.vx[j], c.vy[i] - c.vy[j], c.vz[i] - c.vz[j]
        approach = -(vx * x + vy * y + vz * z)
        both = wi + wj
        if (approach > 0) & (both > 0):
            worst = max(worst, approach)
            # what is elastic has no rest: its hops do not end
            lively = (approach > least) | (each.law.restitution >= 1)
            bounce = one + each.law.restitution if lively else one
            change = bounce * approach
            dx, dy, dz = change * x, change * y, change * z
            if friction is not None:
                sx, sy, sz = vx + approach * x, vy + approach * y, vz + approach * z
                share = one
                if c.spin is not None:
                    arm = bench.normal[4, k]
                    tx, ty, tz = cross(turning(c, i, j), (x, y, z))
                    sx, sy, sz = sx - arm * tx, sy - arm * ty, sz - arm * tz
                    share = one / (one + type_of(arm, 2.5) * arm * arm)
                slip = np.sqrt(sx * sx + sy * sy + sz * sz)
                holds = share * slip <= friction.static * change
                part = share if holds else min(friction.kinetic * change / slip, share)
                dx, dy, dz = dx - part * sx, dy - part * sy, dz - part * sz
                if c.spin is not None:
                    turn = cross((x, y, z), (part / both * sx, part / both * sy, part / both * sz))
                    spin_up(c, i, arm * wi, turn)
                    spin_up(c, j, arm * wj, turn)
            give(c, i, wi / both, dx, dy, dz)
            give(c, j, -wj / both, dx, dy, dz)
    return worst


def turning(c: Any, i: Any, j: Any) -> Any:
    """r₁ ω₁ + r₂ ω₂ [m/s]."""
    s, a, b = c.spin, c.r[i], c.r[j]
    return a * s.wx[i] + b * s.wx[j], a * s.wy[i] + b * s.wy[j], a * s.wz[i] + b * s.wz[j]


def spin_up(c: Any, i: Any, inverse: Any, turn: Any) -> None:
    """Change the angular velocity of a sphere by r times `turn` [N s] over I = 2/5 r²/w, for an inverse mass w."""
    k = type_of(inverse, 2.5) * inverse / c.r[i]
    c.spin.wx[i] += k * turn[0]
    c.spin.wy[i] += k * turn[1]
    c.spin.wz[i] += k * turn[2]


def give(c: Any, i: Any, part: Any, x: Any, y: Any, z: Any) -> None:
    """Change the velocity of a particle by a part of something; what its method remembers no longer holds."""
    c.vx[i] += part * x
    c.vy[i] += part * y
    c.vz[i] += part * z
    if len(c.memory) > 0:
        c.memory[-1][i] = 0


@outlined
def move_apart(each: Any, c: Any) -> None:
    """Make overlaps smaller by a half, or as much as may be in a step."""
    bench, r = each.bench, c.r
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        wi, wj = each.a[i], each.a[j]
        both = wi + wj
        x, y, z, apart = line_between(c, i, j, bench.shift, k)
        overlap = r[i] + r[j] - apart
        if (overlap > 0) & (both > 0):
            by = (
                min(type_of(apart, 0.5) * overlap, type_of(apart, GENTLY / TURNS_APART) * min(r[i], r[j]))
                / both
            )
            c.x[i] += by * wi * x
            c.y[i] += by * wi * y
            c.z[i] += by * wi * z
            c.x[j] -= by * wj * x
            c.y[j] -= by * wj * y
            c.z[j] -= by * wj * z


# Colliders that particles lie on


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


def watch_walls(each: Any, parts: Any, c: Any, before: Any, t: Any) -> None:
    """List particles that are near a collider, collider after collider."""
    end, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            end = watch_wall(each, collider, c, before, t, part.first, part.last, end)
            each.bench.ends[k] = end
            k += 1


@outlined
def watch_wall(each: Any, collider: Any, c: Any, before: Any, t: Any, first: Any, last: Any, end: Any) -> Any:
    """List those of particles [first, last) that are near a collider; returns the end of the list."""
    bench = each.bench
    for i in range(first, last):
        if (each.near.place[i] >= 0) & (each.a[i] > 0) & (end < bench.wall.size):  # noqa: SIM102
            if (not held(c.clock, i)) & (collider.response.outcome == PASS):
                p = fetch(c, i, t)
                g, n = gap_and_normal(collider.shape, p)
                if g < type_of(g, NEAR_WALL) * p.r:
                    x, y, z = whole(n, g)
                    dx, dy, dz = p.vx - before[3, i], p.vy - before[4, i], p.vz - before[5, i]
                    bench.wall[end] = i
                    bench.wall_normal[0, end] = x
                    bench.wall_normal[1, end] = y
                    bench.wall_normal[2, end] = z
                    lies = g < type_of(g, ON_WALL) * p.r
                    least = type_of(g, REST) * np.sqrt(dx * dx + dy * dy + dz * dz)
                    bench.wall_normal[3, end] = least if lies else type_of(g, -1)
                    end += 1
    return end


def push_off_walls(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Velocities of particles that lie on colliders and are pressed into them."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            push_off_wall(each, collider, c, begin, each.bench.ends[k], t)
            begin = each.bench.ends[k]
            k += 1


def beside(collider: Any, p: Any) -> Any:
    """A particle with its velocity relative to a collider where it is, along the axes of the world."""
    if not isinstance(collider.shape, MovingRecord):
        return p
    x, y, z = surface_velocity(collider.shape, frame_at(collider.shape, p.t, p.x), p.x, p.y, p.z)
    return moved_to(p, p.x, p.y, p.z, p.vx - x, p.vy - y, p.vz - z, p.t)


@outlined
def push_off_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any, t: Any) -> None:
    """`push_off_walls` for particles [begin, end) of the list."""
    bench, response = each.bench, collider.response
    for k in range(begin, end):
        i, least = bench.wall[k], bench.wall_normal[3, k]
        n = (bench.wall_normal[0, k], bench.wall_normal[1, k], bench.wall_normal[2, k])
        p = fetch(c, i, t)
        q = beside(collider, p)
        rate = q.vx * n[0] + q.vy * n[1] + q.vz * n[2]
        if (least >= 0) & (rate < 0):
            one, none = type_of(rate, 1), type_of(rate, 0)
            bounce = response.bounce if (-rate > least) | (response.bounce >= 2) else one
            friction = None if c.spin is not None else response.friction
            belt = None if c.spin is not None else carried(collider.shape, response.belt, p.t, p.x)
            once = ResponseRecord(bounce, none, one, PASS, friction, response.falling, belt)
            vx, vy, vz = rebound(once, n, rate, q)
            if isinstance(collider.shape, MovingRecord):
                vx, vy, vz = vx + (p.vx - q.vx), vy + (p.vy - q.vy), vz + (p.vz - q.vz)
            if c.spin is not None and response.friction is not None:
                push = (vx - p.vx) * n[0] + (vy - p.vy) * n[1] + (vz - p.vz) * n[2]
                dx, dy, dz = rub(collider, c, i, moved_to(p, p.x, p.y, p.z, vx, vy, vz, p.t), n, push)
                vx, vy, vz = vx + dx, vy + dy, vz + dz
            c.vx[i], c.vy[i], c.vz[i] = vx, vy, vz
            if len(c.memory) > 0:
                c.memory[-1][i] = 0


def put_on_walls(each: Any, parts: Any, c: Any, t: Any) -> None:
    """Particles that have been moved into colliders go back to their surface."""
    begin, k = 0, 0
    for part in parts:
        for collider in colliders_of(part):
            put_on_wall(each, collider, c, begin, each.bench.ends[k], t)
            begin = each.bench.ends[k]
            k += 1


@outlined
def put_on_wall(each: Any, collider: Any, c: Any, begin: Any, end: Any, t: Any) -> None:
    """`put_on_walls` for particles [begin, end) of the list."""
    bench = each.bench
    for k in range(begin, end):
        i = bench.wall[k]
        p = fetch(c, i, t)
        g, n = gap_and_normal(collider.shape, p)
        if g < 0:
            x, y, z = put_back(collider.shape, p, g, whole(n, g))
            c.x[i], c.y[i], c.z[i] = x, y, z


def new_bench(room: int, walls: int, colliders: int, count: int, dtype: Any) -> Bench:
    """Room for some pairs, for particles at colliders, for the ends of their lists, and for marks of all particles."""
    return Bench(
        np.zeros((2, room), np.int64),
        np.zeros((5, room), dtype),
        np.zeros((3, room), dtype),
        np.zeros(walls, np.int64),
        np.zeros((4, walls), dtype),
        np.zeros(colliders, np.int64),
        np.zeros(count, np.int8),
    )


def impulses_of(site: Site, pairs: PairSet) -> Impulses:
    """Hard contacts among the particles of an island."""
    found = with_masses(site, near_pairs_of(site, pairs))
    count, colliders = site.whole.count, len(site.scenario.all_colliders)
    bench = new_bench(
        PAIRS * count + 64,
        min(colliders, 3) * count + 64,
        colliders * len(site.state) + 1,
        count,
        site.dtype,
    )
    return Impulses(*found, bench, np.zeros(2, np.int64), np.zeros(1))
