"""The desk of adaptive methods: the particles of a block that have not reached the end of the grid step, packed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import on_stack
from particlesim.engine.state.columns import Thermal, changing, store, temperature
from particlesim.engine.step.particle_step import RATES, Rate, derivative
from particlesim.laws.registry import Particle, further
from particlesim.model.attributes import FURTHER

DESK = 264
"""Particles on a desk: a block and a cache line more, so that the same column of all rows does not fall into two sets of the
first-level cache."""

# Rows of a desk in the precision of the run: state and slope at the present, both at the end of the step that is tried
# (x, y, z, vx, vy, vz each), mass, its inverse, radius, further attributes.
STATE, SLOPE, AHEAD, BEYOND, MASS, INVERSE, RADIUS, MORE = 0, 6, 12, 18, 24, 25, 26, 27
BODY = MORE + len(FURTHER)
# Rows in double precision: where the particle is in time and has to be [s]; the step that is proposed and the one that is
# tried [s]; the error of this try and of the last accepted one (0: unknown); tries so far, and whether the last was
# rejected; temperature at birth, and birth.
NOW, STOP, STEP, TAKEN, ERROR, PREVIOUS, TRIES, AGAIN, HEAT, BIRTH, CLOCK = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10


class Desk(NamedTuple):
    """Particles under way, packed: `row` in the block [DESK], `body` [BODY, DESK], `clock` [CLOCK, DESK], and rows of it as
    `thermal`, None when no law reads the temperature. `kept`: the block as `keep` saw it at the beginning."""

    row: Any
    body: Any
    clock: Any
    thermal: Any
    kept: Any


class Heated(NamedTuple):
    """Dynamics of particle k of a desk whose temperature changes within the step."""

    dynamics: Any
    thermal: Any
    k: int


def heated(dynamics: Any, forces: Any, p: Any) -> Rate:
    """The rate of change of a particle at the temperature that it has at the time of p."""
    warmth = temperature(dynamics.thermal, dynamics.k, p.t, p.x)
    q = Particle(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.m, p.r, warmth, p.t, p.w, *further(p))
    return derivative(dynamics.dynamics, forces, q)


RATES[Heated] = heated


def response(dynamics: Any, d: Any, k: Any) -> Any:
    """How particle k of a desk responds to force; with its temperature if a law reads it."""
    return dynamics if d.thermal is None else Heated(dynamics, d.thermal, k)


def new_desk(c: Any) -> Any:
    """An empty desk for particles of some columns, on the stack."""
    clock = on_stack(CLOCK, DESK, np.float64)
    return Desk(
        on_stack(1, DESK, np.int64)[0],
        on_stack(BODY, DESK, c.x.dtype),
        clock,
        warmth_of(c.thermal, clock),
        on_stack(len(changing(c)), DESK, np.float64),
    )


def warmth_of(thermal: Any, clock: Any) -> Any:
    """The rows of a desk that hold temperatures at birth, with the law of cooling; None without."""
    if thermal is None:
        return None
    return Thermal(clock[HEAT], clock[BIRTH], thermal.rate, thermal.ambient)


def bring_heat(thermal: Any, i: Any, clock: Any, k: Any) -> None:
    """Temperature at birth and birth of particle i of a block to column k of a desk."""
    if thermal is None:
        return
    clock[HEAT, k], clock[BIRTH, k] = thermal.start[i], thermal.birth[i]


def at(d: Any, k: Any, s: Any, t: Any) -> Any:
    """Particle k of a desk with one of its states, as the laws see it at time t."""
    b = d.body
    x = b[s, k]
    return Particle(
        x,
        b[s + 1, k],
        b[s + 2, k],
        b[s + 3, k],
        b[s + 4, k],
        b[s + 5, k],
        b[MASS, k],
        b[RADIUS, k],
        temperature(d.thermal, k, t, x),
        t,
        b[INVERSE, k],
        *[b[MORE + n, k] for n in range(len(FURTHER))],
    )


def bring_attributes(d: Any, k: Any, p: Any) -> None:
    """Mass, radius and further attributes of a particle to column k of a desk."""
    d.body[MASS, k], d.body[INVERSE, k], d.body[RADIUS, k] = p.m, p.w, p.r
    for n, number in enumerate(further(p)):
        d.body[MORE + n, k] = number


def rate_at(d: Any, k: Any, s: Any) -> Any:
    """A slope of particle k of a desk."""
    b = d.body
    return Rate(b[s, k], b[s + 1, k], b[s + 2, k], b[s + 3, k], b[s + 4, k], b[s + 5, k])


def put(d: Any, k: Any, s: Any, r: Any) -> None:
    """A state or slope of particle k of a desk."""
    b = d.body
    b[s, k], b[s + 1, k], b[s + 2, k] = r.x, r.y, r.z
    b[s + 3, k], b[s + 4, k], b[s + 5, k] = r.vx, r.vy, r.vz


def slope_here(program: Any, d: Any, k: Any) -> None:
    """Set the slope of particle k of a desk at its present state."""
    p = at(d, k, STATE, d.clock[NOW, k])
    put(d, k, SLOPE, derivative(response(program.dynamics, d, k), program.forces, p))


def leave(c: Any, d: Any, k: Any) -> None:
    """Write particle k of a desk back to the block."""
    i = d.row[k]
    store(c, i, rate_at(d, k, STATE))
    c.memory[0][i], c.memory[1][i] = d.clock[STEP, k], d.clock[PREVIOUS, k]


def move(d: Any, k: Any, n: Any) -> None:
    """Column n of a desk to column k."""
    d.row[k] = d.row[n]
    for s in range(BODY):
        d.body[s, k] = d.body[s, n]
    for s in range(CLOCK):
        d.clock[s, k] = d.clock[s, n]
