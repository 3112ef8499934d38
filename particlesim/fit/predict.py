"""What a scenario predicts for the particles and times of measurements."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.simulation import Simulation
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats
from particlesim.scenario.scenario import Scenario

Ids = NDArray[np.int64]


def predict(scenario: Scenario, times: Floats, ids: Ids | None) -> Floats:
    """Position [m] and velocity [m/s] of particle ids[k] at times[k] [s], shape [n, 6].

    Times between steps are interpolated by the cubic that has the positions and velocities of both steps (Hermite), whose
    error is of fourth order in dt. Without ids, the scenario must hold one particle. Raises UsageError for a time after the
    scenario's end, and for a particle that is not there at its time; DivergenceError as a run does.
    """
    grid = scenario.grid
    if times.max() > grid.duration * (1 + 1e-12):
        raise UsageError(
            f"the last measurement is at t = {times.max():.6g} s, the scenario ends at {grid.duration:.6g} s",
            f"--set simulation.duration={np.ceil(times.max() * 1000) / 1000:g}",
        )
    steps = np.minimum(np.floor(times / grid.dt + 1e-9).astype(int), grid.steps)
    part = times / grid.dt - steps
    between = (np.abs(part) > 1e-9) & (steps < grid.steps)
    needed = np.unique(np.concatenate([steps, steps[between] + 1]))
    simulation = Simulation(scenario, threads=1)
    out = np.empty((len(times), 6))
    ends = np.empty((len(times), 6))
    try:
        for step in needed:
            simulation.advance_to(int(step))
            for target, rows in ((out, steps == step), (ends, between & (steps + 1 == step))):
                if rows.any():
                    target[rows] = _states(simulation, None if ids is None else ids[rows])
    finally:
        simulation.close()
    out[between] = hermite(out[between], ends[between], part[between], grid.dt)
    return out


def _states(simulation: Simulation, ids: Ids | None) -> Floats:
    """Position and velocity of particles now, shape [n, 6]; of the only one when `ids` is None."""
    states = simulation.states
    known = np.concatenate([state.id[: state.count] for state in states])
    table = np.concatenate([np.hstack([state.position, state.velocity]).astype(float) for state in states])
    if ids is None:
        if len(known) != 1:
            raise UsageError(
                f"the scenario has {len(known)} particles at t = {simulation.time:.6g} s",
                "A column 'id' in the data says which of them was measured.",
            )
        return table
    order = np.argsort(known)
    at = np.minimum(np.searchsorted(known, ids, sorter=order), max(len(known) - 1, 0))
    rows = order[at] if len(known) else at
    if not len(known) or (known[rows] != ids).any():
        lost = ids[0] if not len(known) else ids[known[rows] != ids][0]
        raise UsageError(f"there is no particle {lost} at t = {simulation.time:.6g} s")
    return table[rows]


def hermite(first: Floats, last: Floats, part: Floats | Sequence[float], h: float) -> Floats:
    """Position and velocity a `part` of the way between two states [n, 6] that are `h` seconds apart."""
    s = np.asarray(part, dtype=float)[:, None]
    x0, v0, x1, v1 = first[:, :3], h * first[:, 3:], last[:, :3], h * last[:, 3:]
    position = (
        (1 + 2 * s) * (1 - s) ** 2 * x0
        + s * (1 - s) ** 2 * v0
        + s**2 * (3 - 2 * s) * x1
        + s**2 * (s - 1) * v1
    )
    velocity = (6 * s * (1 - s) * (x1 - x0) + (1 - s) * (1 - 3 * s) * v0 + s * (3 * s - 2) * v1) / h
    return np.hstack([position, velocity])
