"""What the stage-wise kernels work on: methods as arrays, groups of an island, scratch arrays, every thread's share."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.engine.barrier import new_gate
from particlesim.engine.constraints.constraint import Constraint
from particlesim.engine.interactions.bond_layout import shares
from particlesim.engine.interactions.interaction import Interaction
from particlesim.engine.state.prescribed import Driven
from particlesim.engine.step.rebounds import LEAPFROG
from particlesim.integrators.adaptive import EmbeddedRungeKutta
from particlesim.integrators.base import Composition, Method, RungeKutta, Verlet
from particlesim.integrators.implicit import ImplicitMethod
from particlesim.integrators.whfast import WisdomHolmanMethod


class Part(NamedTuple):
    """A group inside an island: its dynamics, forces and contacts, and its particles [first, last). `cores`: contacts that
    particles of half the radius have, where a softer law acts before; None where there are none. `rubbing`: colliders with
    the friction that those in `contacts` lack, as particles spin; `rolling`: its rolling friction there, None without."""

    dynamics: tuple[Any, ...]
    forces: tuple[Any, ...]
    contacts: tuple[Any, ...]
    first: int
    last: int
    cores: Any = None
    rubbing: tuple[Any, ...] = ()
    rolling: Any = None


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


class Rebounds(NamedTuple):
    """Room for particles that bounce in a step, one column for each: in the columns of a thread's share, those of its own.
    Their `rows`, and which particles lie on something; the state in which the step would have ended without impacts, and
    with them [6, n]; the acceleration on their way, and what velocities lack on it [6, n]; forces [15, n]. For all
    particles: accelerations without and with impacts [6, n], and places [3, n]. By what parts of a step velocities are
    older than places: those at the end of a step, and those with which one begins after contact. `slow`: up to what speed
    particles rest, in those that forces give in a step; or None. `between`: an empty tuple where the method remembers
    velocities between places, `behind`: one where they are half a step behind places, and nothing lies on other particles;
    else None. `series`, `aside` and `beyond`: α, −½ β/α and γ α/β of what the method keeps (`step.rebounds`), 0 and without
    `home` where that is the energy."""

    rows: Any
    lies: Any
    free: Any
    hit: Any
    way: Any
    forces: Any
    around: Any
    home: Any
    old: Any
    begun: Any
    slow: Any
    between: Any
    behind: Any
    series: Any
    aside: Any
    beyond: Any


class Work(NamedTuple):
    """Scratch arrays: total force [3, n], state at the beginning of the step [6, n] or None if it is not needed, slopes
    [stages, 6, n], and, for each thread its own, forces of bonds [3, chunk] and error estimates [estimates, 6, chunk]. Where
    particles spin there are as many rows again of the first three: torques, angles and angular velocities. `system`: the
    equations of implicit methods; `radau`: the polynomials of IAS15; `orbits`: those of WHFast; None for other methods.
    `rebounds`: where what bounces is known to give no energy (`rebounds`), else None; `again`: what the last step of hard
    grains has led to (`again`) [n, 20], else None."""

    force: Any
    before: Any
    slopes: Any
    pull: Any
    spread: Any
    system: Any = None
    radau: Any = None
    orbits: Any = None
    rebounds: Any = None
    again: Any = None


class Share(NamedTuple):
    """What a thread does: particles [first, last), in chunks, with the motions that lead some of them, and the
    interactions that are not laid out by chunks; its number among the threads, and where they meet; the order in which it
    goes through its chunks; the rods that it holds, None where there are none at all. `wild` and `struck` count, for every
    thread, whether a number is not finite and how many particles have bounced in the step."""

    first: int
    last: int
    chunk: int
    number: int
    threads: int
    gate: Any
    wild: Any
    motions: tuple[Any, ...]
    elements: tuple[Any, ...]
    order: Any
    rods: Any = None
    struck: Any = None


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


NO_LOOK_BACK = Composition | Verlet | WisdomHolmanMethod
"""Methods that do not need the state at the beginning of a step."""


def scratch(
    method: Method,
    count: int,
    chunk: int,
    dtype: Any,
    *,
    looks_back: bool,
    cores: bool = False,
    spins: bool = False,
) -> Work:
    """Scratch arrays for an island in chunks of some size; without `looks_back`, contacts and rods do not need the beginning
    of a step, and `cores` its places and velocities alone."""
    stages = method.evaluations + method.adaptive if isinstance(method, RungeKutta) else 0
    estimates = len(method.errors) if isinstance(method, EmbeddedRungeKutta) else 0
    rows, whole = 12 if spins else 6, looks_back or not isinstance(method, NO_LOOK_BACK)
    return Work(
        np.zeros((rows // 2, count), dtype),
        np.zeros((rows if whole else 6, count), dtype) if whole or cores else None,
        np.zeros((stages, rows, count), dtype),
        np.zeros((3, chunk), dtype),
        np.zeros((estimates, 6, chunk), dtype),
    )


SLOW = 4.0
"""In units of what forces give in a step, the speed of an impact of hard grains that is one for certain: slower than 2 they
lie on each other (`hard.turns`)."""


def new_rebounds(method: Method, count: int, dtype: Any, *, heaps: bool) -> Rebounds | None:
    """Room for the particles of an island that bounce; None for a method that damps by itself, or follows orbits. With
    `heaps` particles may lie on each other, so that what is slow is at rest."""
    if isinstance(method, WisdomHolmanMethod) or (
        isinstance(method, ImplicitMethod) and not method.reversible
    ):
        return None
    begun, leaps = 0.0, isinstance(method, Verlet)
    if isinstance(method, Composition):
        begun = 0.5 - float(np.dot(method.kicks, np.cumsum([0.0, *method.drifts[:-1]])))
        leaps = len(method.kicks) <= 2
    series, aside, beyond = LEAPFROG if leaps else (0.0, 0.0, 0.0)
    if isinstance(method, ImplicitMethod):
        series, aside, beyond = (-1 / 24 if method.ahead else 1 / 12), -1 / 2, 0.0
    old = 0.5 if isinstance(method, Verlet) else begun
    slow, between = SLOW if heaps else None, () if isinstance(method, Verlet) else None
    behind = () if begun else None
    free, hit, way, forces = (np.zeros((rows, count), dtype) for rows in (6, 6, 6, 15))
    around = np.zeros((6, count), dtype) if series or begun else None
    home = np.zeros((3, count), dtype) if series else None
    rows, lies = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    room = rows, lies, free, hit, way, forces, around, home
    return Rebounds(*room, old, begun, slow, between, behind, series, aside, beyond)


def share_out(
    count: int,
    threads: int,
    chunk: int,
    driven: tuple[Driven, ...],
    elements: tuple[Interaction, ...],
    constraint: Constraint | None,
) -> list[Share]:
    """Shares of an island for some threads, at most one for every chunk; without an order."""
    ranges = shares(count, threads, chunk)
    held = [None] * len(ranges) if constraint is None else constraint.records(len(ranges))
    gate, wild, struck = new_gate(), *np.zeros((2, 8 * len(ranges)), np.int64)
    return [
        Share(
            first,
            last,
            chunk,
            number,
            len(ranges),
            gate,
            wild,
            led_between(driven, first, last),
            tuple(each.between(first, last) for each in elements),
            None,
            held[number],
            struck,
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
