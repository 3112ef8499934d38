"""The kernel of WHFast: bodies follow Kepler's orbits about the central one, and are kicked in between.

The formulas and their sources are those of `particlesim.integrators.whfast`. Every thread follows the orbits of its own
bodies, and sums the forces on them; changes of coordinates are sums over all bodies in their order, which the first thread
makes. The memory of the particles holds the state in the method's coordinates as it is between two half steps of the orbits:
it lacks the last half step, which positions and velocities already have. Where these are not what the last interval left,
they were changed from outside, and the coordinates are computed anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.coupled.forces import evaluate
from particlesim.engine.coupled.gauss_radau import carried
from particlesim.engine.coupled.kepler import kepler_step
from particlesim.engine.coupled.workspace import Share
from particlesim.engine.interactions.pairs import DirectPairs
from particlesim.engine.state.group_state import GroupState
from particlesim.errors import UsageError
from particlesim.integrators import WisdomHolmanMethod
from particlesim.interactions.gravity import MutualGravityRecord

STATE, CARRY, SEEN, KNOWN = 0, 6, 12, 18
"""Rows of the memory: place [m] and velocity [m/s] in the method's coordinates; what rounding took from them; place and
velocity as they were left; whether all this holds."""


PASSAGES = 16
"""Steps in which a body may pass its pericentre."""


class Jacobi(NamedTuple):
    """Jacobi coordinates."""


class Heliocentric(NamedTuple):
    """Democratic heliocentric coordinates."""


class Orbits(NamedTuple):
    """The bodies of an island: `order` [n], their rows from the inside out, the central one first; μ of Kepler's problem of
    every row [m³/s²]; masses of all up to a place in the order [kg]; which of the interactions is gravity; where it acts
    without Kepler's part, as `spans` of pairs; whether something else than gravity may move the centre of mass.

    `elements`: the interactions that kick; `own` [6, n] is room for a state, `flag` [1] says whether memory holds.
    """

    order: Any
    mu: Any
    inside: Any
    gravity: int
    spans: Any
    moved: bool
    elements: tuple[Any, ...]
    own: Any
    flag: Any

    def kicking(self, elements: tuple[Any, ...]) -> Orbits:
        """The same with the interactions of a share, gravity among them without Kepler's part."""
        kicks = list(elements)
        kicks[self.gravity] = kicks[self.gravity]._replace(spans=self.spans, last=None)
        return self._replace(elements=tuple(kicks))


def staged_wisdom_holman(method: WisdomHolmanMethod) -> tuple[Any, ...]:
    """The method for the kernel."""
    return Jacobi() if method.coordinates == "jacobi" else Heliocentric()


def new_orbits(
    method: WisdomHolmanMethod, states: Sequence[GroupState], interactions: tuple[Any, ...], *, moved: bool
) -> Orbits:
    """The bodies of an island where they are now. `moved`: whether forces from outside act.

    Raises UsageError where no body is heavy enough for others to go about it.
    """
    x, v = (
        np.concatenate([getattr(each, name).astype(float) for each in states])
        for name in ("position", "velocity")
    )
    m = np.concatenate([each.mass[: each.count].astype(float) for each in states])
    gravity = gravity_among(interactions)
    g = float(interactions[gravity].law.g)
    if not isinstance(interactions[gravity], DirectPairs):
        raise UsageError(
            f"whfast sums gravity directly, and {len(m):,} bodies are summed by a tree",
            'method = "direct" takes every pair',
        )
    center = _central(method, states, m)
    rest = m.sum() - m[center]
    two = len(m) == 2 and method.coordinates == "jacobi"
    if not two and not m[center] > rest:
        raise UsageError(
            f"whfast needs a body that is heavier than all others together: the central one has {m[center]:.4g} kg, "
            f"the others have {rest:.4g} kg",
            'integrator = "ias15" is for bodies of any masses',
        )
    order = _from_inside(g, m, x, v, center)
    inside = np.cumsum(m[order])
    mu = np.full(len(m), g * m[center])
    if method.coordinates == "jacobi":
        mu[order] = g * inside
    kept = [center, *order[1:2].tolist()] if method.coordinates == "jacobi" else [center]
    spans = _kicks(len(m), center, kept)
    return Orbits(order, mu, inside, gravity, spans, moved, (), np.zeros((6, len(m))), np.zeros(1, np.int64))


def gravity_among(interactions: Sequence[Any]) -> int:
    """Which of the interactions is gravity."""
    return next(
        k
        for k, each in enumerate(interactions)
        if isinstance(getattr(each, "law", None), MutualGravityRecord)
    )


def longest_step(orbits: Orbits, c: Any) -> float:
    """The longest step that is safe [s]: a sixteenth of the time in which the fastest body passes its pericentre, as where
    it goes on a circle, 2π √(q³/(μ (1 + e))); infinite for two bodies alone, which are exact.

    Sources: K. P. Rauch, M. Holman, Astron. J. 117, 1087 (1999); J. Wisdom, Astron. J. 150, 127 (2015).
    """
    if not orbits.moved and not len(orbits.spans):
        return np.inf
    center = orbits.order[0]
    x, v = (np.stack([column - column[center] for column in part]) for part in (motion(c)[:3], motion(c)[3:]))
    others = orbits.order[1:]
    x, v, mu = x[:, others], v[:, others], orbits.mu[others]
    r, spin = np.linalg.norm(x, axis=0), np.square(np.cross(x, v, axis=0)).sum(axis=0)
    e = np.sqrt(np.maximum(1 + spin * (np.square(v).sum(axis=0) - 2 * mu / r) / mu**2, 0.0))
    q = spin / (mu * (1 + e))
    return float((2 * np.pi * np.sqrt(q**3 / (mu * (1 + e)))).min(initial=np.inf)) / PASSAGES


def _central(method: WisdomHolmanMethod, states: Sequence[GroupState], m: NDArray[np.float64]) -> int:
    """The row of the central body."""
    if method.central is None:
        return int(m.argmax())
    first = 0
    for state in states:
        if state.name == method.central:
            if state.count != 1:
                raise UsageError(
                    f"the central body of whfast is one: {state.name!r} has {state.count:,} particles"
                )
            return first
        first += state.count
    raise UsageError(
        f"the central body of whfast, {method.central!r}, is not a group that gravity joins to the others"
    )


def _from_inside(
    g: float, m: NDArray[np.float64], x: NDArray[np.float64], v: NDArray[np.float64], center: int
) -> NDArray[np.int64]:
    """Rows from the inside out, by the semi-major axis about the central body; those that are not bound come last."""
    r = np.linalg.norm(x - x[center], axis=1)
    speed2 = np.square(v - v[center]).sum(axis=1)
    r[center] = 1.0
    axis = 2 / r - speed2 / (g * (m + m[center]))  # 1/a
    axis[center] = np.inf
    return np.asarray(np.lexsort((np.arange(len(m)), r, -np.maximum(axis, 0.0))), np.int64)


def _kicks(count: int, center: int, kept: Sequence[int]) -> NDArray[np.int64]:
    """Spans of all pairs but those that Kepler's problems are: of the central body with all, or with one other."""

    def solved(a: int, b: int) -> bool:
        return center in (a, b) if len(kept) == 1 else {a, b} <= set(kept)

    cuts = sorted({0, count, *kept, *(row + 1 for row in kept)})
    pieces = [(a, b) for a, b in pairwise(cuts) if a < b]
    spans: list[tuple[int, int, int, int]] = []
    for a, b in pieces:
        for c, d in pieces:
            if solved(a, c):
                continue
            if spans and spans[-1][:2] == (a, b) and spans[-1][3] == c:
                spans[-1] = (a, b, spans[-1][2], d)  # one stretch of sources
            else:
                spans.append((a, b, c, d))
    return np.array(spans, np.int64).reshape(-1, 4)


def state_of(memory: Any, i: Any) -> Any:
    """Place and velocity of particle i in the method's coordinates."""
    return tuple([row[i] for row in memory[STATE : STATE + 6]])


def add(memory: Any, i: Any, change: Any) -> None:
    """Add to place and velocity of particle i, with carried sums."""
    for row, carry, part in zip(memory[STATE : STATE + 6], memory[CARRY : CARRY + 6], change, strict=True):
        row[i], carry[i] = carried(row[i], part, carry[i])


def add_velocity(memory: Any, i: Any, change: Any) -> None:
    """Add to the velocity of particle i, with a carried sum."""
    for row, carry, part in zip(
        memory[STATE + 3 : STATE + 6], memory[CARRY + 3 : CARRY + 6], change, strict=True
    ):
        row[i], carry[i] = carried(row[i], part, carry[i])


def add_place(memory: Any, i: Any, change: Any) -> None:
    """Add to the place of particle i, with a carried sum."""
    for row, carry, part in zip(memory[STATE : STATE + 3], memory[CARRY : CARRY + 3], change, strict=True):
        row[i], carry[i] = carried(row[i], part, carry[i])


def motion(c: Any) -> Any:
    """Columns of place and velocity."""
    return c.x, c.y, c.z, c.vx, c.vy, c.vz


def is_untouched(c: Any) -> bool:
    """Whether all particles are as the last interval left them."""
    same = True
    for i in range(c.x.size):
        same &= c.memory[KNOWN][i] > 0
        for column, seen in zip(motion(c), c.memory[SEEN : SEEN + 6], strict=True):
            same &= column[i] == seen[i]
    return same


@outlined
def enter(method: Any, c: Any, orbits: Any) -> None:
    """Make the coordinates of all particles from their places and velocities."""
    order, inside = orbits.order, orbits.inside
    center = order[0]
    for i in range(c.x.size):
        for carry in c.memory[CARRY : CARRY + 6]:
            carry[i] = 0.0
    for k, (column, row) in enumerate(zip(motion(c), c.memory[STATE : STATE + 6], strict=True)):
        mean = column[center]
        for q in range(1, order.size):
            i = order[q]
            apart = column[i] - mean
            row[i] = apart
            mean += c.m[i] / inside[q] * apart
        row[center] = mean
        if isinstance(method, Heliocentric):
            origin = column[center] if k < 3 else mean
            for q in range(1, order.size):
                row[order[q]] = column[order[q]] - origin


def leave(method: Any, rows: Any, columns: Any, c: Any, orbits: Any, by_velocity: bool) -> None:
    """Put the places or velocities that belong to coordinates into columns."""
    order, inside = orbits.order, orbits.inside
    center, count = order[0], order.size
    for row, column in zip(rows, columns, strict=True):
        mean = row[center]
        if isinstance(method, Jacobi):
            for k in range(count - 1):
                q = count - 1 - k
                i = order[q]
                part = c.m[i] / inside[q]
                column[i] = mean + (1.0 - part) * row[i]
                mean -= part * row[i]
            column[center] = mean
        else:
            total = 0.0
            for q in range(1, count):
                total += c.m[order[q]] * row[order[q]]
            column[center] = mean - total / (c.m[center] if by_velocity else inside[count - 1])
            for q in range(1, count):
                column[order[q]] = row[order[q]] + (mean if by_velocity else column[center])


@outlined
def follow(orbits: Any, memory: Any, first: Any, last: Any, h: Any) -> None:
    """Orbits of particles [first, last) for a time h; the central body's coordinates move straight on."""
    for i in range(first, last):
        x, y, z, vx, vy, vz = state_of(memory, i)
        if i == orbits.order[0]:
            add_place(memory, i, (h * vx, h * vy, h * vz))
        else:
            add(memory, i, kepler_step(orbits.mu[i], x, y, z, vx, vy, vz, h))


def shift(method: Any, c: Any, orbits: Any, h: Any) -> None:
    """The part of the central body's momentum in democratic heliocentric coordinates."""
    if isinstance(method, Heliocentric):
        order = orbits.order
        weight = h / c.m[order[0]]
        for row, velocity, carry in zip(
            c.memory[STATE : STATE + 3],
            c.memory[STATE + 3 : STATE + 6],
            c.memory[CARRY : CARRY + 3],
            strict=True,
        ):
            total = 0.0
            for q in range(1, order.size):
                total += c.m[order[q]] * velocity[order[q]]
            for q in range(1, order.size):
                i = order[q]
                row[i], carry[i] = carried(row[i], weight * total, carry[i])


@outlined
def kick(method: Any, c: Any, orbits: Any, force: Any, h: Any) -> None:
    """The kick of velocities by forces without Kepler's part in a time h."""
    order, inside, memory = orbits.order, orbits.inside, c.memory
    center, count = order[0], order.size
    sx, sy, sz = force[0, center], force[1, center], force[2, center]
    if isinstance(method, Heliocentric):
        for q in range(1, count):
            i = order[q]
            sx, sy, sz = sx + force[0, i], sy + force[1, i], sz + force[2, i]
        if not orbits.moved:
            sx, sy, sz = 0.0, 0.0, 0.0  # but for rounding
    for q in range(1, count):
        i = order[q]
        fx, fy, fz = force[0, i], force[1, i], force[2, i]
        mass = inside[count - 1] if isinstance(method, Heliocentric) else inside[q - 1]
        ax, ay, az = fx / c.m[i] - sx / mass, fy / c.m[i] - sy / mass, fz / c.m[i] - sz / mass
        if isinstance(method, Jacobi):
            sx, sy, sz = sx + fx, sy + fy, sz + fz
            if q > 1:
                x, y, z, _, _, _ = state_of(memory, i)
                r2 = x * x + y * y + z * z
                pull = orbits.mu[i] / (r2 * np.sqrt(r2))
                ax, ay, az = ax + pull * x, ay + pull * y, az + pull * z
        add_velocity(memory, i, (h * ax, h * ay, h * az))
    if orbits.moved:
        each = h / inside[count - 1]
        add_velocity(memory, center, (each * sx, each * sy, each * sz))


def is_finite(memory: Any, count: Any) -> bool:
    """Whether all coordinates are numbers."""
    drop = 0.0
    for i in range(count):
        for number in state_of(memory, i):
            drop += number - number
    return drop == 0


@outlined
def show(method: Any, c: Any, orbits: Any) -> None:
    """Places and velocities at the end of an interval, from the coordinates in `orbits.own`."""
    own = orbits.own
    leave(method, (own[0], own[1], own[2]), (c.x, c.y, c.z), c, orbits, False)
    leave(method, (own[3], own[4], own[5]), (c.vx, c.vy, c.vz), c, orbits, True)
    for i in range(c.x.size):
        c.memory[KNOWN][i] = 1.0
        for column, seen in zip(motion(c), c.memory[SEEN : SEEN + 6], strict=True):
            seen[i] = column[i]


@outlined
def look_ahead(orbits: Any, memory: Any, first: Any, last: Any, h: Any) -> None:
    """Coordinates of particles [first, last) a time h later, into `orbits.own`; those in memory stay."""
    for i in range(first, last):
        here = state_of(memory, i)
        x, y, z, vx, vy, vz = here
        step = (h * vx, h * vy, h * vz, 0.0, 0.0, 0.0)
        if i != orbits.order[0]:
            step = kepler_step(orbits.mu[i], x, y, z, vx, vy, vz, h)
        for k, (number, change) in enumerate(zip(here, step, strict=True)):
            orbits.own[k, i] = number + change


@kernel
def step_island_wisdom_holman(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, first_step: Any, steps: Any, dt: Any
) -> int:
    """Advance a share of an island by `steps` steps of dt, the first of which begins at first_step · dt.

    As many threads as there are shares must call this at the same time. Returns the number of steps done: fewer when in the
    next one a number stopped being finite.
    """
    orbits, memory, first, last = work.orbits, c.memory, share.first, share.last
    kicks = Share(
        first,
        last,
        share.chunk,
        share.number,
        share.threads,
        share.gate,
        share.wild,
        share.motions,
        orbits.elements,
        share.order,
        share.rods,
    )
    if steps == 0:
        return 0
    if share.number == 0:
        orbits.flag[0] = is_untouched(c)
        if orbits.flag[0] == 0:
            enter(method, c, orbits)
        share.wild[0] = 0
    meet(share.gate, share.threads)
    h = dt if orbits.flag[0] != 0 else 0.5 * dt
    for step in range(steps):
        t = (first_step + step) * dt
        follow(orbits, memory, first, last, h)
        meet(share.gate, share.threads)
        if share.number == 0:
            shift(method, c, orbits, 0.5 * dt)
            leave(method, memory[STATE : STATE + 3], (c.x, c.y, c.z), c, orbits, False)
        meet(share.gate, share.threads)
        evaluate(parts, bonds, c, work, kicks, t + 0.5 * dt, None)
        if share.number == 0:
            kick(method, c, orbits, work.force, dt)
            shift(method, c, orbits, 0.5 * dt)
            share.wild[0] = 0 if is_finite(memory, c.x.size) else 1
        meet(share.gate, share.threads)
        if share.wild[0] != 0:
            return step
        h = dt
    look_ahead(orbits, memory, first, last, 0.5 * dt)
    meet(share.gate, share.threads)
    if share.number == 0:
        show(method, c, orbits)
    meet(share.gate, share.threads)
    return steps
