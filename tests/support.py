"""Builders that tests share: columns from arrays, programs from records, and a run through the block kernel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from particlesim.engine.independent.kernel import new_room, step_range
from particlesim.engine.state.columns import Clock, Columns
from particlesim.engine.step.contacts import Careful, Simple
from particlesim.engine.step.particle_step import Newtonian
from particlesim.engine.step.program import BLOCK, Program
from particlesim.engine.step.records import without_rebound
from particlesim.integrators import METHODS

NO_CONTACTS = Simple(())


def columns(
    position: ArrayLike,
    velocity: ArrayLike,
    *,
    mass: ArrayLike = 1.0,
    radius: ArrayLike | None = None,
    thermal: Any = None,
    clock: Clock | None = None,
    method: str = "symplectic_euler",
    dtype: Any = np.float64,
) -> Columns:
    """Columns of n particles: position [m] and velocity [m/s] of shape [n, 3], mass [kg] and radius [m] of shape [n] or one.

    `method` decides what is remembered between steps.
    """
    x = np.atleast_2d(np.asarray(position, dtype))
    v = np.atleast_2d(np.asarray(velocity, dtype))
    n = len(x)

    def filled(value: ArrayLike) -> NDArray[Any]:
        return np.array(np.broadcast_to(np.asarray(value, dtype), n))

    memory = tuple(np.zeros(n, dtype) for _ in range(METHODS[method].memory))
    return Columns(
        *(np.ascontiguousarray(x[:, k]) for k in range(3)),
        *(np.ascontiguousarray(v[:, k]) for k in range(3)),
        filled(mass),
        None if radius is None else filled(radius),
        thermal,
        clock,
        memory,
    )


def clock(n: int, start: float = -np.inf, stop: float = np.inf) -> Clock:
    """A clock for n particles that all move from `start` to `stop` [s]."""
    return Clock(np.full(n, start), np.full(n, stop), np.zeros(n, np.int8))


def program(
    method: str,
    forces: Sequence[Any] = (),
    contacts: Any = NO_CONTACTS,
    dynamics: Any = None,
    dtype: Any = np.float64,
) -> Program:
    """A program of records, in the precision of the run."""
    return Program(
        *(
            cast(part, dtype)
            for part in (METHODS[method].record(), dynamics or Newtonian(), tuple(forces), contacts)
        )
    )


def cast(record: Any, dtype: Any) -> Any:
    """A record with all its floats in another precision."""
    if isinstance(record, tuple):
        parts = [cast(part, dtype) for part in record]
        return type(record)(*parts) if hasattr(record, "_fields") else tuple(parts)
    return dtype(record) if isinstance(record, float) and dtype is not np.float64 else record


def careful(
    continuous: Sequence[Any] = (),
    discrete: Sequence[Any] = (),
    *,
    tolerance: float = 4 * np.finfo(float).eps,
    reach: float = 0.0,
) -> Careful:
    """Careful contacts; the resting colliders are the continuous ones without rebound."""
    return Careful(
        tuple(continuous), tuple(without_rebound(c) for c in continuous), tuple(discrete), tolerance, reach
    )


def run(
    program: Program,
    c: Columns,
    steps: int,
    dt: float,
    *,
    first_step: int = 0,
    first: int = 0,
    last: int | None = None,
    block: int = BLOCK,
) -> NDArray[np.bool_]:
    """Advance the columns in place; returns the fault flags."""
    faults, last = np.zeros(len(c.x), np.bool_), len(c.x) if last is None else last
    step_range(program, c, first_step, steps, dt, first, last, block, faults, new_room(c, block))
    return faults


def position(c: Columns) -> NDArray[Any]:
    """Positions [m], shape [n, 3]."""
    return np.stack([c.x, c.y, c.z], axis=1)


def velocity(c: Columns) -> NDArray[Any]:
    """Velocities [m/s], shape [n, 3]."""
    return np.stack([c.vx, c.vy, c.vz], axis=1)


def state(c: Columns) -> NDArray[Any]:
    """Position and velocity, shape [n, 6]."""
    return np.hstack([position(c), velocity(c)])
