"""Paths of particles and colliders that become undefined during a run, as sqrt(1 - t) does after 1 s."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.prescribed import drive_to
from particlesim.engine.world import World
from particlesim.errors import DivergenceError, PostMortem
from particlesim.scenario.open_colliders import UNDEFINED, undefined


def astray(world: World, last: int) -> DivergenceError | None:
    """The error to raise when a path is not finite at the beginning of step `last`, None if all are."""
    dt = world.grid.dt
    for state in world.states:
        if not state.driven or not _lost(state, last * dt)[0].size:
            continue
        low, high = 0, last  # all paths are finite at the start
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if _lost(state, middle * dt)[0].size else (middle, high)
        return _told(world, state, high * dt, last * dt)
    return None


def lost_collider(world: World, step: int) -> DivergenceError | None:
    """The error to raise when a collider has no place or no velocity at the beginning of a step, None if all have.

    Nothing touches such a collider, so no particle would tell.
    """
    time = step * world.grid.dt
    for motion in world.scenario.motions:
        if motion.collider is None:
            continue
        collider = next(each for each in world.scenario.all_colliders if each.name == motion.collider)
        if (wrong := undefined(motion, collider.body(), time)) is not None:
            return DivergenceError(wrong, UNDEFINED)
    return None


def left_by_collider(world: World, last: int) -> DivergenceError | None:
    """The error to raise when a collider has lost its place by the beginning of step `last`: of the first step for which
    that is so, None if all have one."""
    if (found := lost_collider(world, last)) is None:
        return None
    low = 0  # all paths are finite at the start
    while last - low > 1:
        middle = (low + last) // 2
        if (earlier := lost_collider(world, middle)) is None:
            low = middle
        else:
            last, found = middle, earlier
    return found


def led_are_finite(state: GroupState) -> bool:
    """Whether all led particles of a group are somewhere, at some speed."""
    return all(
        bool(np.isfinite(column[:, each.rows]).all())
        for each in state.driven
        for column in (state.x, state.v)
    )


def _lost(
    state: GroupState, time: float
) -> tuple[NDArray[np.int64], NDArray[np.floating], NDArray[np.floating]]:
    """Rows of the led particles whose path is not finite at a time [s]; places [m] and velocities [m/s] of all, [3, n]."""
    x, v = (np.array(column[:, : state.count]) for column in (state.x, state.v))
    drive_to(state.driven, x, v, time)
    rows = np.sort(np.concatenate([each.rows for each in state.driven]))
    wild = ~(np.isfinite(x[:, rows]).all(axis=0) & np.isfinite(v[:, rows]).all(axis=0))
    return rows[wild], x, v


def _told(world: World, state: GroupState, time: float, noticed: float) -> DivergenceError:
    rows, x, v = _lost(state, time)
    row = int(rows[0])
    motions = [motion for motion in world.scenario.motions if motion.on == state.name]
    label = next(motion.label for motion, each in zip(motions, state.driven, strict=True) if row in each.rows)
    place, speed = ((float(a), float(b), float(c)) for a, b, c in (x[:, row], v[:, row]))
    who = int(state.id[row])
    found = PostMortem(
        "path",
        noticed,
        who,
        state.name,
        time,
        place,
        speed,
        None,
        math.nan,
        world.grid.dt,
        None,
    )
    many = f", nor are those of {rows.size - 1:,} others" if rows.size > 1 else ""
    return DivergenceError(
        f"the path that {label} gives particle {who} of {state.name!r} is not finite at t = {time:.9g} s{many}: place "
        f"({place[0]:.6g}, {place[1]:.6g}, {place[2]:.6g}) m, velocity ({speed[0]:.6g}, {speed[1]:.6g}, {speed[2]:.6g}) m/s",
        UNDEFINED,
        found,
    )
