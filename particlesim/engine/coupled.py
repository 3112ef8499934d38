"""The stage-wise kernel: particles that pull on each other take every stage of every step together.

One call steps a thread's share of an island through a whole interval; the threads meet before and after forces are added
up. Every thread owns whole chunks of particles, and writes to them alone. Forces are added up in a fixed order, first the
one-particle forces, then bond after bond, then those among three and four particles, and every loop runs over a chunk, so
that results do not depend on how many threads there are. The coefficients are those of `particlesim.integrators`, as arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from particlesim.engine.barrier import meet, new_gate
from particlesim.engine.bonding import add_bonds, break_bonds, chunks_of
from particlesim.engine.cache import kernel
from particlesim.engine.columns import block_of, fetch, held, note, span, store, type_of
from particlesim.engine.compile import inline, inlined, outline, spliced, stub
from particlesim.engine.contact import Simple, overlapped, respond, trace
from particlesim.engine.corners import Corners, add_corners, corners_between
from particlesim.engine.driving import Driven, drive
from particlesim.engine.independent import BLOCK
from particlesim.engine.rigging import divided
from particlesim.engine.rods import Rods, after_contact, after_kicks, hold, places, take_aim
from particlesim.engine.runs import chunk_size, shares
from particlesim.engine.steppers import Newtonian, Overdamped
from particlesim.integrators.adaptive import EmbeddedRungeKutta
from particlesim.integrators.base import Composition, CompositionRecord, Method, RungeKutta, Verlet
from particlesim.laws import Particle, Vector, force, law, moved_to, velocity

Impl = Callable[..., Any]


class Part(NamedTuple):
    """A group inside an island: its dynamics, forces and contacts, and its particles [first, last)."""

    dynamics: tuple[Any, ...]
    forces: tuple[Any, ...]
    contacts: tuple[Any, ...]
    first: int
    last: int


class StagedComposition(NamedTuple):
    """Kicks and drifts, 0 where there is none."""

    kicks: Any
    drifts: Any


class StagedRungeKutta(NamedTuple):
    """Tableau as arrays."""

    a: Any
    b: Any
    c: Any


class StagedVerlet(NamedTuple):
    """Störmer's rule."""


class Work(NamedTuple):
    """Scratch arrays: total force [3, n], state at the beginning of the step [6, n] or None if nobody needs it, slopes
    [stages, 6, n], and, for each thread its own, forces of bonds [3, chunk] and error estimates [estimates, 6, chunk].
    `system`: the equations of implicit methods, else None."""

    force: Any
    before: Any
    slopes: Any
    pull: Any
    spread: Any
    system: Any = None


class Share(NamedTuple):
    """What a thread does: particles [first, last), in chunks, with the motions that lead some of them and the forces
    among three and four of them; its number among the threads, and where they meet; the order in which it goes through its
    chunks; the rods that it holds, None where there are none at all."""

    first: int
    last: int
    chunk: int
    number: int
    threads: int
    gate: Any
    wild: Any
    motions: tuple[Any, ...]
    corners: tuple[Any, ...]
    order: Any
    rods: Any = None


class FrozenRecord(NamedTuple):
    """A force that stays the same over a step [N]."""

    x: float
    y: float
    z: float


@law(force, FrozenRecord)
def frozen_force(f: FrozenRecord, p: Particle) -> Vector:
    return f.x, f.y, f.z


class StagedEmbedded(NamedTuple):
    """Tableau with the slope at the end as its last stage, rows of error estimates; the rest as in `EmbeddedRecord`."""

    a: Any
    c: Any
    errors: Any
    tolerance: float
    position: float
    velocity: float
    alpha: float
    beta: float
    shrink: float
    grow: float
    least: float


def staged(method: Method, *, apart: bool = False) -> tuple[Any, ...]:
    """A method's coefficients for the stage-wise kernel; with `apart`, the leapfrogs of a composition stay apart."""
    if isinstance(method, EmbeddedRungeKutta):
        rows = (*method.a, method.b)
        a = np.zeros((len(rows), len(rows)))
        for i, row in enumerate(rows):
            a[i, : len(row)] = row
        return StagedEmbedded(a, np.array((*method.c, 1.0)), np.array(method.errors), *method.record()[4:])
    if isinstance(method, Composition):
        kicks, drifts = method.apart() if apart else (method.kicks, method.drifts)
        return StagedComposition(np.array(kicks), np.array(drifts))
    if isinstance(method, RungeKutta):
        s = len(method.b)
        a = np.zeros((s, s))
        for i, row in enumerate(method.a):
            a[i, : len(row)] = row
        return StagedRungeKutta(a, np.array(method.b), np.array(method.c))
    return StagedVerlet()


def scratch(method: Method, count: int, dtype: Any, *, looks_back: bool) -> Work:
    """Scratch arrays for an island; without `looks_back`, contacts and rods do not need the beginning of a step."""
    stages = method.evaluations + method.adaptive if isinstance(method, RungeKutta) else 0
    estimates = len(method.errors) if isinstance(method, EmbeddedRungeKutta) else 0
    return Work(
        np.zeros((3, count), dtype),
        np.zeros((6, count), dtype) if looks_back or not isinstance(method, Composition | Verlet) else None,
        np.zeros((stages, 6, count), dtype),
        np.zeros((3, chunk_size(count)), dtype),
        np.zeros((estimates, 6, chunk_size(count)), dtype),
    )


def share_out(
    count: int, threads: int, driven: tuple[Driven, ...], corners: tuple[Corners, ...], rods: Rods | None
) -> list[Share]:
    """Shares of an island for some threads, at most one for every chunk; without an order."""
    ranges = shares(count, threads)
    mine = [None] * len(ranges) if rods is None else divided(rods, len(ranges))
    gate, wild = new_gate(), np.zeros(8 * len(ranges), np.int64)
    return [
        Share(
            first,
            last,
            chunk_size(count),
            number,
            len(ranges),
            gate,
            wild,
            led_between(driven, first, last),
            corners_between(corners, first, last),
            None,
            mine[number],
        )
        for number, (first, last) in enumerate(ranges)
    ]


def led_between(driven: tuple[Driven, ...], first: int, last: int) -> tuple[Driven, ...]:
    """The motions of particles [first, last); their rows are sorted."""
    parts = []
    for each in driven:
        a, b = np.searchsorted(each.rows, (first, last))
        parts.append(Driven(each.law, *(column[a:b] for column in each[1:])))
    return tuple(parts)


def bring(motions: Any, c: Any, share: Any, t: Any) -> Any:
    """Bring the driven particles of a share to time t; returns when those of all shares are there."""
    return stub()


@inline(bring)
def _bring(motions: Any, c: Any, share: Any, t: Any) -> Impl:
    if len(motions) == 0:
        return lambda motions, c, share, t: None

    def impl(motions: Any, c: Any, share: Any, t: Any) -> None:
        drive(motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, t)
        meet(share.gate, share.threads)

    return impl


def add_forces(parts: Any, c: Any, total: Any, t: Any, lo: Any, hi: Any) -> Any:
    """Sum of the one-particle forces on particles [lo, hi); sets `total`."""
    return stub()


@inline(add_forces)
def _add_forces(parts: Any, c: Any, total: Any, t: Any, lo: Any, hi: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, total, t, lo, hi: None

    def impl(parts: Any, c: Any, total: Any, t: Any, lo: Any, hi: Any) -> None:
        part = parts[0]
        first, last = max(lo, part.first), min(hi, part.last)
        if first < last:
            q = block_of(c, first, last)
            gx, gy, gz = total[0, first:last], total[1, first:last], total[2, first:last]
            for i in range(gx.size):
                fx, fy, fz = force(part.forces, fetch(q, i, t))
                gx[i] = fx
                gy[i] = fy
                gz[i] = fz
        add_forces(parts[1:], c, total, t, lo, hi)

    return impl


@inlined
def begin_forces(parts: Any, c: Any, total: Any, t: Any, lo: Any, hi: Any, chunk: Any) -> int:
    """Set the total force on particles [lo, hi), chunk after chunk, to the one-particle forces; returns where that ended."""
    while lo < hi:
        add_forces(parts, c, total, t, lo, min(lo + chunk, hi))
        lo = min(lo + chunk, hi)
    return int(lo)


def evaluate(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, move: Any) -> Any:
    """Total force on the particles of a share; returns when those of all shares are known.

    All positions and velocities must be in place, but for those of driven particles, which are brought to time t. With a
    `Move` particles make it as soon as the forces on them are known and nobody needs them in their old place: then they are
    still in the cache. It is None otherwise.
    """
    return stub()


@outline(evaluate)
def _evaluate(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, move: Any) -> Impl:
    def impl(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, move: Any) -> None:
        bring(share.motions, c, share, t)
        order, begun, done = share.order, share.first, 0
        for chunk in range(chunks_of(bonds)):
            begun = begin_forces(parts, c, work.force, t, begun, order.front[chunk], share.chunk)
            add_bonds(bonds, c, work.force, work.pull, chunk)
            done = move_on(move, c, work, share, done, order.after[chunk])
        begin_forces(parts, c, work.force, t, begun, share.last, share.chunk)
        add_corners(share.corners, c, work.force, share.first, share.last, t)
        meet(share.gate, share.threads)
        move_on(move, c, work, share, done, order.ready.size)

    return impl


def rates(parts: Any, c: Any, total: Any, slope: Any, t: Any, lo: Any, hi: Any) -> Any:
    """Time derivative of position and velocity of particles [lo, hi), into slope [6, n]."""
    return stub()


@inline(rates)
def _rates(parts: Any, c: Any, total: Any, slope: Any, t: Any, lo: Any, hi: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, total, slope, t, lo, hi: None
    dynamics = parts[0].types[0].instance_class

    if dynamics is Newtonian:

        def newtonian(parts: Any, c: Any, total: Any, slope: Any, t: Any, lo: Any, hi: Any) -> None:
            first, last = max(lo, parts[0].first), min(hi, parts[0].last)
            if first < last:
                m = c.m[first:last]
                for k, v in enumerate((c.vx, c.vy, c.vz)):
                    own, glide = v[first:last], slope[k, first:last]
                    f, out = total[k, first:last], slope[3 + k, first:last]
                    for i in range(m.size):
                        glide[i] = own[i]
                        out[i] = f[i] / m[i]
            rates(parts[1:], c, total, slope, t, lo, hi)

        return newtonian
    assert dynamics is Overdamped, "tracers are never coupled"

    def overdamped(parts: Any, c: Any, total: Any, slope: Any, t: Any, lo: Any, hi: Any) -> None:
        g = parts[0].dynamics.gamma
        for i in range(max(lo, parts[0].first), min(hi, parts[0].last)):
            wx, wy, wz = velocity(parts[0].dynamics.flow, fetch(c, i, t))
            slope[0, i] = wx + total[0, i] / g
            slope[1, i] = wy + total[1, i] / g
            slope[2, i] = wz + total[2, i] / g
            for k in range(3):
                slope[3 + k, i] = 0
        rates(parts[1:], c, total, slope, t, lo, hi)

    return overdamped


@inlined
def kick(q: Any, gx: Any, gy: Any, gz: Any, weight: Any, t: Any, end: Any, h: Any) -> None:
    """v += weight · h f/m for all particles of a block with total forces g."""
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        k = weight * hi / q.m[i]
        q.vx[i] += k * gx[i]
        q.vy[i] += k * gy[i]
        q.vz[i] += k * gz[i]


@inlined
def drift(q: Any, weight: Any, t: Any, end: Any, h: Any) -> None:
    """x += weight · h v for all particles of a block."""
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        s = weight * hi
        q.x[i] += s * q.vx[i]
        q.y[i] += s * q.vy[i]
        q.z[i] += s * q.vz[i]


@inlined
def combine(
    target: Any, before: Any, slopes: Any, weights: Any, clock: Any, t: Any, end: Any, h: Any
) -> None:
    """target = before + h Σ weights[j] slopes[j] for one column of a block; as many slopes as weights."""
    target[:] = 0
    for j in range(weights.size):
        if weights[j] != 0:
            weight, slope = type_of(h, weights[j]), slopes[j]
            for i in range(target.size):
                target[i] += weight * slope[i]
    for i in range(target.size):
        _, hi = span(clock, i, t, end, h)
        target[i] = before[i] + hi * target[i]


@inlined
def stormer(q: Any, gx: Any, gy: Any, gz: Any, t: Any, end: Any, h: Any) -> None:
    """Störmer's rule for all particles of a block with total forces g; remembers the velocity between the steps."""
    ux, uy, uz, known = q.memory
    half = type_of(h, 0.5)
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        if hi > 0:
            k = hi / q.m[i]
            ax, ay, az = k * gx[i], k * gy[i], k * gz[i]
            again = known[i] == hi
            ux[i] = (ux[i] if again else q.vx[i] - half * ax) + ax
            uy[i] = (uy[i] if again else q.vy[i] - half * ay) + ay
            uz[i] = (uz[i] if again else q.vz[i] - half * az) + az
            q.x[i] += hi * ux[i]
            q.y[i] += hi * uy[i]
            q.z[i] += hi * uz[i]
            q.vx[i] = ux[i] + half * ax
            q.vy[i] = uy[i] + half * ay
            q.vz[i] = uz[i] + half * az
            known[i] = hi


def evolve(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> Any:
    """One step of a method for a share of particles, without contacts."""
    return stub()


@inline(evolve)
def _evolve(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> Impl | None:
    free = isinstance(share.types[-1], types.NoneType)
    families: dict[type, Impl] = {
        StagedComposition: _composition if free else _held_composition,
        StagedRungeKutta: _runge_kutta,
        StagedVerlet: _verlet,
    }
    return families.get(method.instance_class)


def look(before: Any, c: Any, lo: Any, hi: Any, share: Any) -> Any:
    """Whether particles [lo, hi) are where they can be, while they are in the cache, after their last move in a step; where
    a step's beginning is kept, `end_step` looks when contacts are done."""
    return stub()


@inline(look)
def _look(before: Any, c: Any, lo: Any, hi: Any, share: Any) -> Impl:
    if not isinstance(before, types.NoneType):
        return lambda before, c, lo, hi, share: None

    def impl(before: Any, c: Any, lo: Any, hi: Any, share: Any) -> None:
        if not all_finite(block_of(c, lo, hi)):
            share.wild[8 * share.number] = 1

    return impl


class Move(NamedTuple):
    """A stage, maybe the last one, of a composition in the step from t to `end` of length h: weights of its kick and of its
    drift, 0 where there is none."""

    push: Any
    glide: Any
    last: Any
    t: Any
    end: Any
    h: Any


@inlined
def kick_and_drift(move: Any, c: Any, work: Any, share: Any, first: Any, last: Any) -> None:
    """A stage of a composition for particles [first, last) of a share."""
    t, end, h = move.t, move.end, move.h
    for lo in range(first, last, BLOCK):
        hi = min(lo + BLOCK, last)
        q = block_of(c, lo, hi)
        if move.push != 0:
            kick(q, work.force[0, lo:hi], work.force[1, lo:hi], work.force[2, lo:hi], move.push, t, end, h)
        if move.glide != 0:
            drift(q, move.glide, t, end, h)
        if move.last:
            look(work.before, c, lo, hi, share)


def move_on(move: Any, c: Any, work: Any, share: Any, done: Any, ready: Any) -> Any:
    """Chunks of a share, from number `done` to `ready` in its order, make a move. Returns how many have made it."""
    return stub()


@inline(move_on)
def _move_on(move: Any, c: Any, work: Any, share: Any, done: Any, ready: Any) -> Impl:
    if isinstance(move, types.NoneType):
        return lambda move, c, work, share, done, ready: done

    def impl(move: Any, c: Any, work: Any, share: Any, done: Any, ready: Any) -> int:
        for k in range(done, ready):
            lo = share.order.ready[k]
            kick_and_drift(move, c, work, share, lo, min(lo + share.chunk, share.last))
        return int(max(done, ready))

    return impl


def _composition(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    now = t
    for stage in range(method.kicks.size):
        push, glide = type_of(h, method.kicks[stage]), type_of(h, method.drifts[stage])
        move = Move(push, glide, stage == method.kicks.size - 1, t, end, h)
        if push != 0:
            if stage > 0:
                meet(share.gate, share.threads)
            evaluate(parts, bonds, c, work, share, now, move)
        else:
            kick_and_drift(move, c, work, share, share.first, share.last)
        now += method.drifts[stage] * (end - t)


def _held_composition(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    # A component of rods has particles of several threads: all must have drifted before it is held, and be held before
    # anybody reads them.
    now, here = t, places(c)
    take_aim(share.rods, here)
    for stage in range(method.kicks.size):
        push, glide = type_of(h, method.kicks[stage]), type_of(h, method.drifts[stage])
        if push != 0:
            evaluate(parts, bonds, c, work, share, now, None)
        elif stage == 0:
            meet(share.gate, share.threads)
        kick_and_drift(Move(push, glide, False, t, end, h), c, work, share, share.first, share.last)
        now += method.drifts[stage] * (end - t)
        if glide != 0:
            drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, now)
            meet(share.gate, share.threads)
            if not hold(share.rods, here, method.drifts[stage] * (end - t), share.rods.eager):
                share.wild[8 * share.number] = 1
        meet(share.gate, share.threads)
    after_kicks(share.rods, here)
    meet(share.gate, share.threads)


@inlined
def displace(c: Any, work: Any, weights: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """All particles of a share go from the beginning of the step by h Σ weights[j] slopes[j]."""
    for lo in range(share.first, share.last, share.chunk):
        hi = min(lo + share.chunk, share.last)
        q = block_of(c, lo, hi)
        for k, target in enumerate((q.x, q.y, q.z, q.vx, q.vy, q.vz)):
            before, slopes = work.before[k, lo:hi], work.slopes[:, k, lo:hi]
            combine(target, before, slopes, weights, q.clock, t, end, h)


@inlined
def find_slopes(parts: Any, bonds: Any, c: Any, work: Any, share: Any, stage: Any, t: Any) -> None:
    """Slopes of all particles of a share where they are; positions and velocities of all shares must be in place."""
    evaluate(parts, bonds, c, work, share, t, None)
    for lo in range(share.first, share.last, share.chunk):
        rates(parts, c, work.force, work.slopes[stage], t, lo, min(lo + share.chunk, share.last))


def _runge_kutta(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    for stage in range(method.b.size):
        if stage > 0:
            displace(c, work, method.a[stage, :stage], share, t, end, h)
            meet(share.gate, share.threads)
        find_slopes(parts, bonds, c, work, share, stage, t + method.c[stage] * (end - t))
    displace(c, work, method.b, share, t, end, h)


def _verlet(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    evaluate(parts, bonds, c, work, share, t, None)
    for lo in range(share.first, share.last, BLOCK):
        hi = min(lo + BLOCK, share.last)
        force = work.force
        stormer(block_of(c, lo, hi), force[0, lo:hi], force[1, lo:hi], force[2, lo:hi], t, end, h)
        look(work.before, c, lo, hi, share)


def forget(memory: Any, i: Any) -> Any:
    """What the method remembers of particle i no longer holds."""
    return stub()


@inline(forget)
def _forget(memory: Any, i: Any) -> Impl:
    if len(memory) == 0:
        return lambda memory, i: None

    def impl(memory: Any, i: Any) -> None:
        memory[-1][i] = 0

    return impl


def collide(parts: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> Any:
    """Contacts at the end of a step.

    A particle that ends inside a collider is followed from impact to impact under the mean force of the step.
    """
    return stub()


@inline(collide)
def _collide(parts: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, before, share, t, end, h: None
    contacts = parts[0].types[2]
    if contacts.instance_class is Simple and len(contacts.types[0]) == 0:
        return lambda parts, c, before, share, t, end, h: collide(parts[1:], c, before, share, t, end, h)

    def impl(parts: Any, c: Any, before: Any, share: Any, t: Any, end: Any, h: Any) -> None:
        part = parts[0]
        for i in range(max(share.first, part.first), min(share.last, part.last)):
            begin, hi = span(c.clock, i, t, end, h)
            if hi > 0:
                q = fetch(c, i, end)
                if overlapped(part.contacts, q):
                    k = q.m / hi
                    mean = FrozenRecord(
                        k * (q.vx - before[3, i]), k * (q.vy - before[4, i]), k * (q.vz - before[5, i])
                    )
                    p = moved_to(
                        q,
                        before[0, i],
                        before[1, i],
                        before[2, i],
                        before[3, i],
                        before[4, i],
                        before[5, i],
                        begin,
                    )
                    whole = CompositionRecord((type_of(h, 1),), (type_of(h, 1),))
                    r, _, outcome = trace(whole, Newtonian(), (mean,), part.contacts, p, hi, ())
                    forget(c.memory, i)
                else:
                    r, outcome = respond(part.contacts, q)
                    if r.vx != q.vx or r.vy != q.vy or r.vz != q.vz:
                        forget(c.memory, i)
                store(c, i, r)
                note(c.clock, i, outcome, r.t)
        collide(parts[1:], c, before, share, t, end, h)

    return impl


def settle(parts: Any, c: Any, total: Any, share: Any, t: Any) -> Any:
    """Give particles without inertia the velocity of their place, for the record."""
    return stub()


@inline(settle)
def _settle(parts: Any, c: Any, total: Any, share: Any, t: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, total, share, t: None
    if parts[0].types[0].instance_class is Newtonian:
        return lambda parts, c, total, share, t: settle(parts[1:], c, total, share, t)

    def impl(parts: Any, c: Any, total: Any, share: Any, t: Any) -> None:
        g = parts[0].dynamics.gamma
        for i in range(max(share.first, parts[0].first), min(share.last, parts[0].last)):
            wx, wy, wz = velocity(parts[0].dynamics.flow, fetch(c, i, t))
            fixed = held(c.clock, i)
            c.vx[i] = type_of(c.x[i], 0 if fixed else wx + total[0, i] / g)
            c.vy[i] = type_of(c.x[i], 0 if fixed else wy + total[1, i] / g)
            c.vz[i] = type_of(c.x[i], 0 if fixed else wz + total[2, i] / g)
        settle(parts[1:], c, total, share, t)

    return impl


def settle_all(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any) -> Any:
    """`settle` with the forces at time t; without them where all have inertia."""
    return stub()


@inline(settle_all)
def _settle_all(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any) -> Impl:
    if all(part.types[0].instance_class is Newtonian for part in parts):
        return lambda parts, bonds, c, work, share, t: None

    def impl(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any) -> None:
        evaluate(parts, bonds, c, work, share, t, None)
        settle(parts, c, work.force, share, t)

    return impl


@inlined
def save(q: Any, before: Any) -> None:
    """Copy position and velocity of a block to before [6, block]."""
    for k, column in enumerate((q.x, q.y, q.z, q.vx, q.vy, q.vz)):
        for i in range(column.size):
            before[k, i] = column[i]


@inlined
def restore(q: Any, before: Any) -> None:
    """Undo `save`."""
    for k, column in enumerate((q.x, q.y, q.z, q.vx, q.vy, q.vz)):
        for i in range(column.size):
            column[i] = before[k, i]


@inlined
def all_finite(q: Any) -> bool:
    """Whether all positions and velocities of a block are finite."""
    wild = False
    for i in range(q.x.size):
        drop = (q.x[i] - q.x[i]) + (q.y[i] - q.y[i]) + (q.z[i] - q.z[i])
        drop += (q.vx[i] - q.vx[i]) + (q.vy[i] - q.vy[i]) + (q.vz[i] - q.vz[i])
        wild |= drop != 0
    return not wild


def keep_beginning(before: Any, c: Any, share: Any) -> Any:
    """Keep the state of a share at the beginning of a step, where somebody needs it."""
    return stub()


@inline(keep_beginning)
def _keep_beginning(before: Any, c: Any, share: Any) -> Impl:
    if isinstance(before, types.NoneType):
        return lambda before, c, share: None

    def impl(before: Any, c: Any, share: Any) -> None:
        for lo in range(share.first, share.last, share.chunk):
            hi = min(lo + share.chunk, share.last)
            save(block_of(c, lo, hi), before[:, lo:hi])

    return impl


def look_at_all(before: Any, c: Any, share: Any) -> Any:
    """Whether all particles of a share are where they can be, unless that is known already."""
    return stub()


@inline(look_at_all)
def _look_at_all(before: Any, c: Any, share: Any) -> Impl:
    if isinstance(before, types.NoneType):
        return lambda before, c, share: None

    def impl(before: Any, c: Any, share: Any) -> None:
        for lo in range(share.first, share.last, share.chunk):
            if not all_finite(block_of(c, lo, min(lo + share.chunk, share.last))):
                share.wild[8 * share.number] = 1

    return impl


def back_to_beginning(before: Any, c: Any, share: Any) -> Any:
    """Return a share to the beginning of the step, if that has been kept."""
    return stub()


@inline(back_to_beginning)
def _back_to_beginning(before: Any, c: Any, share: Any) -> Impl:
    if isinstance(before, types.NoneType):
        return lambda before, c, share: None
    return lambda before, c, share: restore(
        block_of(c, share.first, share.last), before[:, share.first : share.last]
    )


@spliced
def begin_step(c: Any, work: Any, share: Any) -> None:
    """Keep the state at the beginning of a step."""
    keep_beginning(work.before, c, share)
    share.wild[8 * share.number] = 0


@spliced
def end_step(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> bool:
    """Contacts and breaking after a step; returns whether it was a good one in all shares, else restores its beginning if
    that has been kept."""
    drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, end)
    collide(parts, c, work.before, share, t, end, h)
    after_contact(share.rods, c, share)
    look_at_all(work.before, c, share)
    meet(share.gate, share.threads)
    good = share.wild.sum() == 0
    if good:
        break_bonds(bonds, c, share, end)
    else:
        back_to_beginning(work.before, c, share)
    return good


@spliced
def end_interval(parts: Any, bonds: Any, c: Any, work: Any, share: Any, end: Any) -> None:
    """Velocities at the end of an interval of those that are led or have no inertia."""
    settle_all(parts, bonds, c, work, share, end)
    drive(share.motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, end)


@kernel
def step_island(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, first_step: Any, steps: Any, dt: Any
) -> int:
    """Advance a share of an island by `steps` steps of dt, the first of which begins at first_step · dt.

    As many threads as there are shares must call this at the same time. Returns the number of steps done: fewer when in the
    next one a number stopped being finite; its beginning is then restored if it has been kept.
    """
    h = type_of(c.x[0], dt)
    for step in range(steps):
        t, end = (first_step + step) * dt, (first_step + step + 1) * dt
        begin_step(c, work, share)
        evolve(method, parts, bonds, c, work, share, t, end, h)
        if not end_step(parts, bonds, c, work, share, t, end, h):
            return step
    end_interval(parts, bonds, c, work, share, (first_step + steps) * dt)
    return steps


@kernel
def island_forces(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any) -> None:
    """Total force on every particle of an island, into work.force; `share` is the whole island."""
    evaluate(parts, bonds, c, work, share, t, None)
