"""The stage-wise kernel: particles that pull on each other take every stage of every step together.

One call steps an island through a whole interval. Forces are added up in a fixed order, first the one-particle forces,
then bond after bond, so that results do not depend on anything but the scenario. The coefficients are those of
`particlesim.integrators`, as arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from particlesim.bonds.spring import Pair
from particlesim.engine.cache import kernel
from particlesim.engine.columns import fetch, held, note, span, store, type_of
from particlesim.engine.compile import inline, stub
from particlesim.engine.contact import overlapped, respond, trace
from particlesim.engine.steppers import Newtonian, Overdamped
from particlesim.integrators.base import Composition, CompositionRecord, Method, RungeKutta
from particlesim.laws import Particle, Vector, bond_force, force, law, moved_to, velocity

Impl = Callable[..., Any]


class Part(NamedTuple):
    """A group inside an island: its dynamics, forces and contacts, and its particles [first, last)."""

    dynamics: tuple[Any, ...]
    forces: tuple[Any, ...]
    contacts: tuple[Any, ...]
    first: int
    last: int


class Bonds(NamedTuple):
    """Bonds of one law: its record, both ends of each bond, rest lengths [m]."""

    law: tuple[Any, ...]
    i: Any
    j: Any
    rest: Any


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
    """Scratch arrays: total force [3, n], state at the beginning of the step [6, n], slopes [stages, 6, n]."""

    force: Any
    before: Any
    slopes: Any


class FrozenRecord(NamedTuple):
    """A force that stays the same over a step [N]."""

    x: float
    y: float
    z: float


@law(force, FrozenRecord)
def frozen_force(f: FrozenRecord, p: Particle) -> Vector:
    return f.x, f.y, f.z


WHOLE_STEP = CompositionRecord((1.0,), (1.0,))


def staged(method: Method) -> tuple[Any, ...]:
    """A method's coefficients for the stage-wise kernel."""
    if isinstance(method, Composition):
        return StagedComposition(np.array(method.kicks), np.array(method.drifts))
    if isinstance(method, RungeKutta):
        s = len(method.b)
        a = np.zeros((s, s))
        for i, row in enumerate(method.a):
            a[i, : len(row)] = row
        return StagedRungeKutta(a, np.array(method.b), np.array(method.c))
    return StagedVerlet()


def scratch(method: Method, count: int, dtype: Any) -> Work:
    """Scratch arrays for an island."""
    stages = method.evaluations if isinstance(method, RungeKutta) else 0
    return Work(np.zeros((3, count), dtype), np.zeros((6, count), dtype), np.zeros((stages, 6, count), dtype))


def add_forces(parts: Any, c: Any, total: Any, t: Any) -> Any:
    """Sum of the one-particle forces of every part; sets `total`."""
    return stub()


@inline(add_forces)
def _add_forces(parts: Any, c: Any, total: Any, t: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, total, t: None

    def impl(parts: Any, c: Any, total: Any, t: Any) -> None:
        part = parts[0]
        for i in range(part.first, part.last):
            fx, fy, fz = force(part.forces, fetch(c, i, t))
            total[0, i] = fx
            total[1, i] = fy
            total[2, i] = fz
        add_forces(parts[1:], c, total, t)

    return impl


def add_bonds(bonds: Any, c: Any, total: Any) -> Any:
    """Add the forces of all bonds to `total`."""
    return stub()


@inline(add_bonds)
def _add_bonds(bonds: Any, c: Any, total: Any) -> Impl:
    if len(bonds) == 0:
        return lambda bonds, c, total: None

    def impl(bonds: Any, c: Any, total: Any) -> None:
        bond = bonds[0]
        for k in range(bond.i.size):
            i, j = bond.i[k], bond.j[k]
            pair = Pair(
                c.x[i] - c.x[j],
                c.y[i] - c.y[j],
                c.z[i] - c.z[j],
                c.vx[i] - c.vx[j],
                c.vy[i] - c.vy[j],
                c.vz[i] - c.vz[j],
                bond.rest[k],
            )
            fx, fy, fz = bond_force(bond.law, pair)
            total[0, i] += fx
            total[1, i] += fy
            total[2, i] += fz
            total[0, j] -= fx
            total[1, j] -= fy
            total[2, j] -= fz
        add_bonds(bonds[1:], c, total)

    return impl


def part_rates(parts: Any, c: Any, total: Any, slope: Any, t: Any) -> Any:
    """Time derivative of every particle's position and velocity, into slope [6, n]."""
    return stub()


@inline(part_rates)
def _part_rates(parts: Any, c: Any, total: Any, slope: Any, t: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, total, slope, t: None
    dynamics = parts[0].types[0].instance_class

    if dynamics is Newtonian:

        def newtonian(parts: Any, c: Any, total: Any, slope: Any, t: Any) -> None:
            for i in range(parts[0].first, parts[0].last):
                slope[0, i], slope[1, i], slope[2, i] = c.vx[i], c.vy[i], c.vz[i]
                for k in range(3):
                    slope[3 + k, i] = total[k, i] / c.m[i]
            part_rates(parts[1:], c, total, slope, t)

        return newtonian
    assert dynamics is Overdamped, "tracers are never coupled"

    def overdamped(parts: Any, c: Any, total: Any, slope: Any, t: Any) -> None:
        g = parts[0].dynamics.gamma
        for i in range(parts[0].first, parts[0].last):
            wx, wy, wz = velocity(parts[0].dynamics.flow, fetch(c, i, t))
            slope[0, i] = wx + total[0, i] / g
            slope[1, i] = wy + total[1, i] / g
            slope[2, i] = wz + total[2, i] / g
            for k in range(3):
                slope[3 + k, i] = 0
        part_rates(parts[1:], c, total, slope, t)

    return overdamped


def evolve(method: Any, parts: Any, bonds: Any, c: Any, work: Any, t: Any, end: Any, h: Any) -> Any:
    """One step of a method, without contacts."""
    return stub()


@inline(evolve)
def _evolve(method: Any, parts: Any, bonds: Any, c: Any, work: Any, t: Any, end: Any, h: Any) -> Impl:
    kind = method.instance_class
    if kind is StagedComposition:

        def composition(
            method: Any, parts: Any, bonds: Any, c: Any, work: Any, t: Any, end: Any, h: Any
        ) -> None:
            now = t
            for stage in range(method.kicks.size):
                kick, drift = type_of(h, method.kicks[stage]), type_of(h, method.drifts[stage])
                if kick != 0:
                    add_forces(parts, c, work.force, now)
                    add_bonds(bonds, c, work.force)
                    for i in range(c.x.size):
                        _, hi = span(c.clock, i, t, end, h)
                        k = kick * hi / c.m[i]
                        c.vx[i] += k * work.force[0, i]
                        c.vy[i] += k * work.force[1, i]
                        c.vz[i] += k * work.force[2, i]
                for i in range(c.x.size):
                    _, hi = span(c.clock, i, t, end, h)
                    s = drift * hi
                    c.x[i] += s * c.vx[i]
                    c.y[i] += s * c.vy[i]
                    c.z[i] += s * c.vz[i]
                now += method.drifts[stage] * (end - t)

        return composition
    if kind is StagedRungeKutta:

        def runge_kutta(
            method: Any, parts: Any, bonds: Any, c: Any, work: Any, t: Any, end: Any, h: Any
        ) -> None:
            stages = method.b.size
            for stage in range(stages + 1):
                # Place of the stage; after the last one, the end of the step.
                for i in range(c.x.size):
                    _, hi = span(c.clock, i, t, end, h)
                    for k in range(6):
                        change = work.before[k, i] - work.before[k, i]
                        for j in range(stage):
                            weight = method.a[stage, j] if stage < stages else method.b[j]
                            change += type_of(h, weight) * work.slopes[j, k, i]
                        place = work.before[k, i] + hi * change
                        if k == 0:
                            c.x[i] = place
                        elif k == 1:
                            c.y[i] = place
                        elif k == 2:
                            c.z[i] = place
                        elif k == 3:
                            c.vx[i] = place
                        elif k == 4:
                            c.vy[i] = place
                        else:
                            c.vz[i] = place
                if stage < stages:
                    now = t + method.c[stage] * (end - t)
                    add_forces(parts, c, work.force, now)
                    add_bonds(bonds, c, work.force)
                    part_rates(parts, c, work.force, work.slopes[stage], now)

        return runge_kutta
    assert kind is StagedVerlet

    def verlet(method: Any, parts: Any, bonds: Any, c: Any, work: Any, t: Any, end: Any, h: Any) -> None:
        add_forces(parts, c, work.force, t)
        add_bonds(bonds, c, work.force)
        ux, uy, uz, known = c.memory
        half = type_of(h, 0.5)
        for i in range(c.x.size):
            _, hi = span(c.clock, i, t, end, h)
            if hi > 0:
                k = hi / c.m[i]
                ax, ay, az = k * work.force[0, i], k * work.force[1, i], k * work.force[2, i]
                again = known[i] == hi
                ux[i] = (ux[i] if again else c.vx[i] - half * ax) + ax
                uy[i] = (uy[i] if again else c.vy[i] - half * ay) + ay
                uz[i] = (uz[i] if again else c.vz[i] - half * az) + az
                c.x[i] += hi * ux[i]
                c.y[i] += hi * uy[i]
                c.z[i] += hi * uz[i]
                c.vx[i] = ux[i] + half * ax
                c.vy[i] = uy[i] + half * ay
                c.vz[i] = uz[i] + half * az
                known[i] = hi

    return verlet


def forget(memory: Any, i: Any) -> Any:
    """What the method remembers of particle i no longer holds."""
    return stub()


@inline(forget)
def _forget(memory: Any, i: Any) -> Impl:
    if len(memory) == 0:
        return lambda memory, i: None

    def impl(memory: Any, i: Any) -> None:
        memory[3][i] = 0

    return impl


def collide(parts: Any, c: Any, before: Any, t: Any, end: Any, h: Any) -> Any:
    """Contacts at the end of a step.

    A particle that ends inside a collider is followed from impact to impact under the mean force of the step.
    """
    return stub()


@inline(collide)
def _collide(parts: Any, c: Any, before: Any, t: Any, end: Any, h: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, before, t, end, h: None

    def impl(parts: Any, c: Any, before: Any, t: Any, end: Any, h: Any) -> None:
        part = parts[0]
        for i in range(part.first, part.last):
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
                    r, _, outcome = trace(WHOLE_STEP, Newtonian(), (mean,), part.contacts, p, hi, ())
                    forget(c.memory, i)
                else:
                    r, outcome = respond(part.contacts, q)
                    if r.vx != q.vx or r.vy != q.vy or r.vz != q.vz:
                        forget(c.memory, i)
                store(c, i, r)
                note(c.clock, i, outcome, r.t)
        collide(parts[1:], c, before, t, end, h)

    return impl


def settle(parts: Any, c: Any, total: Any, t: Any) -> Any:
    """Give particles without inertia the velocity of their place, for the record."""
    return stub()


@inline(settle)
def _settle(parts: Any, c: Any, total: Any, t: Any) -> Impl:
    if len(parts) == 0:
        return lambda parts, c, total, t: None
    if parts[0].types[0].instance_class is Newtonian:
        return lambda parts, c, total, t: settle(parts[1:], c, total, t)

    def impl(parts: Any, c: Any, total: Any, t: Any) -> None:
        g = parts[0].dynamics.gamma
        for i in range(parts[0].first, parts[0].last):
            wx, wy, wz = velocity(parts[0].dynamics.flow, fetch(c, i, t))
            fixed = held(c.clock, i)
            c.vx[i] = type_of(c.x[i], 0 if fixed else wx + total[0, i] / g)
            c.vy[i] = type_of(c.x[i], 0 if fixed else wy + total[1, i] / g)
            c.vz[i] = type_of(c.x[i], 0 if fixed else wz + total[2, i] / g)
        settle(parts[1:], c, total, t)

    return impl


@kernel
def step_island(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, first_step: Any, steps: Any, dt: Any
) -> int:
    """Advance an island by `steps` steps of dt, the first of which begins at first_step · dt.

    Returns the number of steps done: fewer when a number stopped being finite in the next one, whose beginning is then
    restored.
    """
    n = c.x.size
    h = type_of(c.x[0], dt)
    for s in range(steps):
        t, end = (first_step + s) * dt, (first_step + s + 1) * dt
        for i in range(n):
            work.before[0, i], work.before[1, i], work.before[2, i] = c.x[i], c.y[i], c.z[i]
            work.before[3, i], work.before[4, i], work.before[5, i] = c.vx[i], c.vy[i], c.vz[i]
        evolve(method, parts, bonds, c, work, t, end, h)
        collide(parts, c, work.before, t, end, h)
        broken = False
        for i in range(n):
            drop = (c.x[i] - c.x[i]) + (c.y[i] - c.y[i]) + (c.z[i] - c.z[i])
            drop += (c.vx[i] - c.vx[i]) + (c.vy[i] - c.vy[i]) + (c.vz[i] - c.vz[i])
            broken |= drop != 0
        if broken:
            for i in range(n):
                c.x[i], c.y[i], c.z[i] = work.before[0, i], work.before[1, i], work.before[2, i]
                c.vx[i], c.vy[i], c.vz[i] = work.before[3, i], work.before[4, i], work.before[5, i]
            return s
    end = (first_step + steps) * dt
    add_forces(parts, c, work.force, end)
    add_bonds(bonds, c, work.force)
    settle(parts, c, work.force, end)
    return steps


@kernel
def island_forces(parts: Any, bonds: Any, c: Any, total: Any, t: Any) -> None:
    """Total force on every particle of an island, into total [3, n]."""
    add_forces(parts, c, total, t)
    add_bonds(bonds, c, total)
