"""Hard contacts: particles that overlap at the end of a step and approach get impulses, and are moved apart.

Pairs are taken one after the other, in the order of the lists and then backwards, until none approaches (Gauss–Seidel). With
w = 1/m, n from the second to the first and v_n = (v₁ − v₂)·n < 0 a pair gets

    j = −(1 + e) v_n/(w₁ + w₂),   v₁ += w₁ j n,   v₂ −= w₂ j n,

and across n, by Coulomb, the impulse that stops sliding if that is at most μ_s j, else μ_k j. The surfaces slide over each
other at u = v_t − s (r₁ ω₁ + r₂ ω₂) × n with s = |l|/(r₁ + r₂), and the impulse u/((1 + 5 s²/2) (w₁ + w₂)) stops them, which
is 2/7 u/(w₁ + w₂) where spheres just touch; its torque turns both. So momentum and angular momentum are kept, and energy
never grows, pair by pair. An approach as slow as forces bring about within two steps counts as rest, with e = 0. Colliders
on which particles lie take part in the iteration, so that a particle on the floor holds one on top of it.

Where turns do not settle, clusters with few pairs are solved at once (`at_once`), as at rest, and the friction that goes
with those impulses is given after them.

Then positions: overlaps are halved some times, by displacements in inverse proportion to the masses, which leave velocities
as they are. A step makes an overlap smaller by at most `GENTLY` of the smaller radius, so that particles that overlap at the
start do not fly apart; what the step has added to it goes whole, as turns do not carry the weight of a deep heap.

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988); E. Guendelman, R. Bridson,
R. Fedkiw, ACM Trans. Graph. 22, 871 (2003), for impacts before contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from particlesim.compiler import outlined
from particlesim.compiler.barrier import meet
from particlesim.engine.interactions.contacts import hold_stuck, with_masses
from particlesim.engine.interactions.hard.at_once import (
    FIRST,
    FOUND,
    GIVEN,
    NUMBER,
    RATE,
    SCALE,
    SECOND,
    Desk,
    choose,
    find,
    new_desk,
    rates,
)
from particlesim.engine.interactions.hard.walls import (
    COUNT,
    LOST,
    REST,
    colliders_of,
    push_off_walls,
    put_on_walls,
    rub_walls,
    watch_walls,
)
from particlesim.engine.interactions.interaction import Floats, Site
from particlesim.engine.interactions.lifting import book, lifted, stored
from particlesim.engine.interactions.near_pairs import NearLists, bring_up, near_pairs_of
from particlesim.engine.interactions.neighbours.record import Neighbours, enlarged, forget
from particlesim.engine.interactions.pair_blocks import Block
from particlesim.engine.interactions.pressing import cross
from particlesim.engine.interactions.touching import line_between, overlap_at, touching
from particlesim.engine.state.columns import type_of
from particlesim.interactions import PairSet

PAIRS = 8
"""Pairs per particle to have room for at first; twice what dense packings of equal spheres have."""
MOST_TURNS = 60
"""Turns through all pairs in a step at most; what still approaches then is solved at once, or goes on in the next."""
SETTLED = 1e-3
"""Approaches that turns end with, as a part of the largest that forces have brought about in the step."""
MOST_ROUNDS = 2
"""Rounds of impulses found at once and their friction, each of which changes what the other needs."""
DONE = -1.0
"""In place of what a pair has been given: that it has been moved apart."""
SLACK, ROUGHLY = 1e-4, 1e-3
"""Overlap, as a part of the smaller radius, that contacts at rest keep; how exactly displacements are found at once."""
TURNS_APART, GENTLY, MUCH = (4, 20), 0.02, 0.005
"""Turns in which overlaps are made smaller, at least, and at most; the part of the smaller radius by which a step makes one
smaller; and the part above which turns go on."""


class Bench(NamedTuple):
    """Room to work in: rows of pairs [2, room]; normal, least speed of an impact that rebounds, s, and the overlap down to
    which they are moved apart [6, room]; what to add to the difference of their places for the nearest image [3, room] [m];
    rows of particles at colliders [n]; normals there, such speeds, and how fast the collider moves along the normal [5, n];
    where those at each collider of each group end; which particles are in a pair [n]; a desk for impulses that are found at
    once."""

    rows: Any
    normal: Any
    shift: Any
    wall: Any
    wall_normal: Any
    ends: Any
    mark: Any
    desk: Desk


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
            particles = bench.desk.change.shape[1]
            bench = new_bench(room, bench.wall.size, bench.ends.size, particles, bench.normal.dtype)
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
        if going & (each.law.restitution < 1):
            rest_at_once(each, parts, c, t, calm)
        turn, going = 0, True
        while (turn < TURNS_APART[0]) | (going & (turn < TURNS_APART[1])):
            going = move_apart(each, c)
            put_on_walls(each, parts, c, t)
            turn += 1
        # not what steps take away from overlaps, and forces bring back
        most = max(stored(parts, c, each.bench.mark, t) - low, 0.0)
        book(each.fed, min(lifted(parts, c, before, each.bench.mark, t, h), most))


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
        began = overlap_at(c, (before[0], before[1], before[2]), i, j, bench.shift[:, k])
        least = type_of(most, GENTLY) * min(c.r[i], c.r[j])
        bench.normal[5, k] = max(min(began, c.r[i] + c.r[j] - far) - least, least - least)
        now = (c.vx[i] - c.vx[j]) * x + (c.vy[i] - c.vy[j]) * y + (c.vz[i] - c.vz[j]) * z
        then = (
            (before[3, i] - before[3, j]) * x
            + (before[4, i] - before[4, j]) * y
            + (before[5, i] - before[5, j]) * z
        )
        change = abs(now - then)
        bench.normal[3, k] = type_of(change, REST) * change
        bench.desk.contacts[GIVEN, k] = 0
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
            bench.desk.contacts[GIVEN, k] = 0 if lively else bench.desk.contacts[GIVEN, k] + change
            dx, dy, dz = change * x, change * y, change * z
            if friction is not None:
                slide = (vx + approach * x, vy + approach * y, vz + approach * z)
                part, sx, sy, sz = rub_pair(each, c, k, slide, change)
                dx, dy, dz = dx - part * sx, dy - part * sy, dz - part * sz
            give(c, i, wi / both, dx, dy, dz)
            give(c, j, -wj / both, dx, dy, dz)
    return worst


def rub_pair(each: Any, c: Any, k: Any, slide: Any, change: Any) -> Any:
    """Turn both of pair k by the friction of an impulse that changes their speed along the normal by `change`; `slide` is
    the difference of their velocities across it. Returns the part of sliding that ends, and how they slide."""
    bench, friction = each.bench, each.law.friction
    i, j, (sx, sy, sz), share = bench.rows[0, k], bench.rows[1, k], slide, type_of(change, 1)
    n = (bench.normal[0, k], bench.normal[1, k], bench.normal[2, k])
    if c.spin is not None:
        arm = bench.normal[4, k]
        tx, ty, tz = cross(turning(c, i, j), n)
        sx, sy, sz = sx - arm * tx, sy - arm * ty, sz - arm * tz
        share = type_of(change, 1) / (type_of(change, 1) + type_of(arm, 2.5) * arm * arm)
    slip = np.sqrt(sx * sx + sy * sy + sz * sz)
    holds = share * slip <= friction.static * change
    part = share if holds else min(friction.kinetic * change / slip, share)
    if c.spin is not None:
        both = each.a[i] + each.a[j]
        turn = cross(n, (part / both * sx, part / both * sy, part / both * sz))
        spin_up(c, i, arm * each.a[i], turn)
        spin_up(c, j, arm * each.a[j], turn)
    return part, sx, sy, sz


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


# What turns do not find


@outlined
def rest_at_once(each: Any, parts: Any, c: Any, t: Any, calm: Any) -> None:
    """Impulses of clusters with few pairs at once, as at rest, and the friction that goes with them; then displacements."""
    bench, pairs = each.bench, each.report[COUNT]
    walls = wall_rows(each, parts)
    chosen = choose(bench, each.a, c, pairs, walls, calm)
    if chosen.pairs > 0:
        k = 0
        while k < (1 if each.law.friction is None else MOST_ROUNDS):
            rates(bench, c, chosen, pairs)
            find(bench.desk, each.a, chosen, float(calm))
            push_pairs(each, c, pairs)
            push_from_walls(each, c, pairs, walls)
            rub_walls(each, parts, c, t)
            if each.law.friction is not None:
                rub_pairs(each, c, pairs)
            k += 1
        farthest = begin_apart(each, c, chosen)
        find(bench.desk, each.a, chosen, ROUGHLY * farthest)
        shift_pairs(each, c, pairs)
        shift_from_walls(each, c, pairs, walls)
        put_on_walls(each, parts, c, t)
        for k in range(chosen.pairs):
            bench.desk.contacts[GIVEN, bench.desk.of[NUMBER, k]] = DONE


@outlined
def begin_apart(each: Any, c: Any, chosen: Any) -> Any:
    """Ask for displacements that halve what of overlaps is more than a slack, or as much as may be in a step; returns the
    most that is asked for [m]. The slack lets contacts be found in the next step, too."""
    bench, row, of, r, most = each.bench, each.bench.desk.contacts, each.bench.desk.of, c.r, 0.0
    for k in range(chosen.pairs + chosen.walls):
        row[RATE, k] = row[GIVEN, of[NUMBER, k]] = 0.0
    for k in range(chosen.pairs):
        i, j = of[FIRST, k], of[SECOND, k]
        least = min(r[i], r[j])
        _, _, _, apart = line_between(c, i, j, bench.shift, of[NUMBER, k])
        overlap = r[i] + r[j] - apart - type_of(apart, SLACK) * least
        if overlap > 0:
            by = float(min(type_of(apart, 0.5) * overlap, type_of(apart, GENTLY) * least))
            row[RATE, k] = -row[SCALE, k] * by
            most = max(most, by)
    return most


def wall_rows(each: Any, parts: Any) -> Any:
    """How many particles are at colliders."""
    end, k = each.bench.ends[0] - each.bench.ends[0], 0
    for part in parts:
        for _ in colliders_of(part):
            end = each.bench.ends[k]
            k += 1
    return end


@outlined
def push_pairs(each: Any, c: Any, pairs: Any) -> None:
    """Give all pairs the impulses that have been found."""
    bench = each.bench
    for k in range(pairs):
        i, j = bench.rows[0, k], bench.rows[1, k]
        change = type_of(c.x[0], bench.desk.contacts[FOUND, k])
        if change != 0:
            both = each.a[i] + each.a[j]
            dx, dy, dz = (
                change * bench.normal[0, k],
                change * bench.normal[1, k],
                change * bench.normal[2, k],
            )
            give(c, i, each.a[i] / both, dx, dy, dz)
            give(c, j, -each.a[j] / both, dx, dy, dz)


@outlined
def push_from_walls(each: Any, c: Any, pairs: Any, walls: Any) -> None:
    """Give all particles at walls the impulses that have been found."""
    bench = each.bench
    for q in range(walls):
        change = type_of(c.x[0], bench.desk.contacts[FOUND, pairs + q])
        if change != 0:
            n = bench.wall_normal
            give(c, bench.wall[q], change, n[0, q], n[1, q], n[2, q])


@outlined
def shift_pairs(each: Any, c: Any, pairs: Any) -> None:
    """Displace all pairs as has been found."""
    bench = each.bench
    for k in range(pairs):
        i, j, by = bench.rows[0, k], bench.rows[1, k], type_of(c.x[0], bench.desk.contacts[FOUND, k])
        if by != 0:
            both = each.a[i] + each.a[j]
            shift(c, i, by * each.a[i] / both, bench.normal, k)
            shift(c, j, -by * each.a[j] / both, bench.normal, k)


@outlined
def shift_from_walls(each: Any, c: Any, pairs: Any, walls: Any) -> None:
    """Displace all particles at walls as has been found."""
    bench = each.bench
    for q in range(walls):
        by = type_of(c.x[0], bench.desk.contacts[FOUND, pairs + q])
        if by != 0:
            shift(c, bench.wall[q], by, bench.wall_normal, q)


def shift(c: Any, i: Any, by: Any, normal: Any, k: Any) -> None:
    """Move a particle along a normal."""
    c.x[i] += by * normal[0, k]
    c.y[i] += by * normal[1, k]
    c.z[i] += by * normal[2, k]


@outlined
def rub_pairs(each: Any, c: Any, pairs: Any) -> None:
    """Friction of all pairs that have got impulses."""
    bench = each.bench
    for k in range(pairs):
        i, j = bench.rows[0, k], bench.rows[1, k]
        change = type_of(c.x[0], bench.desk.contacts[FOUND, k])
        if change > 0:
            x, y, z = bench.normal[0, k], bench.normal[1, k], bench.normal[2, k]
            vx, vy, vz = c.vx[i] - c.vx[j], c.vy[i] - c.vy[j], c.vz[i] - c.vz[j]
            rate, both = vx * x + vy * y + vz * z, each.a[i] + each.a[j]
            part, sx, sy, sz = rub_pair(each, c, k, (vx - rate * x, vy - rate * y, vz - rate * z), change)
            give(c, i, -part * each.a[i] / both, sx, sy, sz)
            give(c, j, part * each.a[j] / both, sx, sy, sz)


@outlined
def move_apart(each: Any, c: Any) -> bool:
    """Make overlaps smaller by a half of what is to go of them in the step; returns whether that was much for some."""
    bench, r, much = each.bench, c.r, False
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        wi, wj = each.a[i], each.a[j]
        both = wi + wj
        x, y, z, apart = line_between(c, i, j, bench.shift, k)
        overlap = r[i] + r[j] - apart - bench.normal[5, k]
        if (overlap > 0) & (both > 0) & (bench.desk.contacts[GIVEN, k] != DONE):
            much = much | (overlap > type_of(apart, MUCH) * min(r[i], r[j]))
            by = type_of(apart, 0.5) * overlap / both
            c.x[i] += by * wi * x
            c.y[i] += by * wi * y
            c.z[i] += by * wi * z
            c.x[j] -= by * wj * x
            c.y[j] -= by * wj * y
            c.z[j] -= by * wj * z
    return much


def new_bench(room: int, walls: int, colliders: int, particles: int, dtype: Any) -> Bench:
    """Room for some pairs, for particles at colliders, and for the ends of their lists, among some particles."""
    return Bench(
        np.zeros((2, room), np.int64),
        np.zeros((6, room), dtype),
        np.zeros((3, room), dtype),
        np.zeros(walls, np.int64),
        np.zeros((5, walls), dtype),
        np.zeros(colliders, np.int64),
        np.zeros(particles, np.int8),
        new_desk(room + walls, particles),
    )


def impulses_of(site: Site, pairs: PairSet) -> Impulses:
    """Hard contacts among the particles of an island."""
    found = with_masses(site, near_pairs_of(site, pairs))
    count, colliders = site.whole.count, len(site.scenario.all_colliders)
    walls, ends = min(colliders, 3) * count + 64, colliders * len(site.state) + 1
    bench = new_bench(PAIRS * count + 64, walls, ends, count, site.dtype)
    return Impulses(*found, bench, np.zeros(2, np.int64), np.zeros(1))
