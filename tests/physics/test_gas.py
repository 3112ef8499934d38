"""A gas of hard spheres: its speeds by a test of fit, and its pressure against the ideal law."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats
from simulate import table

import particlesim as ps
from particlesim.engine.simulation import Simulation

N, R, V, EDGE, M = 400, 0.02, 2.0, 1.0, 1e-3


def gas(duration: float) -> ps.Scenario:
    rng = np.random.default_rng(11)
    cells = np.stack(np.meshgrid(*[np.arange(8)] * 3), axis=-1).reshape(-1, 3)[:N]
    x = (cells + 0.5) / 8 * (EDGE - 2 * R) - EDGE / 2 + R
    v = rng.normal(size=(N, 3))
    v *= V / np.linalg.norm(v, axis=1, keepdims=True)
    return ps.from_table(
        table(
            duration,
            1e-3,
            particles=[
                {
                    "layout": {"type": "points", "position": x.tolist(), "velocity": v.tolist()},
                    "radius": R,
                    "mass": M,
                }
            ],
            interactions=[{"type": "contact"}],
            colliders=[{"type": "box", "size": [EDGE, EDGE, EDGE], "inside": True}],
        )
    )


def test_speeds_become_those_of_maxwell_and_the_pressure_is_that_of_the_ideal_law() -> None:
    simulation = Simulation(gas(4.0))
    steps, given = 3000, 0.0
    simulation.advance_to(1000)  # some impacts for each
    state = simulation.states[0]
    for step in range(1001, 1001 + steps):
        before = state.v[:, :N].copy()
        simulation.advance_to(step)
        change = state.v[:, :N] - before
        # an impact on a wall turns one component around, and leaves the others to the last bit
        flipped = (np.abs(state.v[:, :N] + before) < 1e-12) & (np.abs(before) > 1e-9)
        alone = flipped & (np.abs(change).sum(axis=0) - np.abs(change) < 1e-12)
        given += float((M * np.abs(change))[alone].sum())
    speed = np.linalg.norm(state.v[:, :N], axis=0)
    # speeds of one moment against Maxwell's, whose only number is the energy
    fit = stats.kstest(speed, "maxwell", args=(0, V / math.sqrt(3)))
    assert fit.pvalue > 0.01
    assert (
        stats.kstest(np.full(N, V) + 1e-9 * np.arange(N), "maxwell", args=(0, V / math.sqrt(3))).pvalue < 1e-9
    )
    # p V = N m <v²>/3 Z in the volume of centres; Z of Carnahan and Starling
    pressure = given / (steps * 1e-3) / (6 * EDGE**2)
    part = N * 4 / 3 * math.pi * R**3 / EDGE**3
    z = (1 + part + part**2 - part**3) / (1 - part) ** 3
    ideal = N * M * V**2 / 3 / EDGE**3
    # some thousand impacts, and those that hit a wall and each other in one step are not counted
    assert abs(pressure / (ideal * z) - 1) < 0.1
    assert math.isclose((0.5 * M * speed**2).sum(), 0.5 * N * M * V**2, rel_tol=1e-10)
