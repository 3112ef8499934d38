"""A gas of hard spheres: its speeds by a test of fit, and its pressure, which is well above that of the ideal law."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats
from simulate import table

import particlesim as ps
from particlesim.engine.simulation import Simulation

N, R, V, EDGE, M = 400, 0.03, 2.0, 1.0, 1e-3
FREE = EDGE - 2 * R
"""Edge of the box in which centres are."""


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


def test_speeds_become_those_of_maxwell_and_the_pressure_is_that_of_hard_spheres() -> None:
    simulation, dt = Simulation(gas(2.5)), 1e-3
    steps, given, impacts = 2000, 0.0, 0
    simulation.advance_to(500)  # some impacts for each
    state = simulation.states[0]
    for step in range(501, 501 + steps):
        before = state.v[:, :N].copy()
        ahead = state.x[:, :N] + dt * before
        simulation.advance_to(step)
        # what would have passed a wall, and goes back: its impulse is what it came with and what it goes with
        hit = (np.abs(ahead) > FREE / 2) & (state.v[:, :N] * before < 0)
        given += float(M * np.abs(state.v[:, :N] - before)[hit].sum())
        impacts += int(hit.sum())
    speed = np.linalg.norm(state.v[:, :N], axis=0)
    # speeds of one moment against Maxwell's, whose only number is the energy
    fit = stats.kstest(speed, "maxwell", args=(0, V / math.sqrt(3)))
    assert fit.pvalue > 0.01
    assert (
        stats.kstest(np.full(N, V) + 1e-9 * np.arange(N), "maxwell", args=(0, V / math.sqrt(3))).pvalue < 1e-9
    )
    # p V = N m <v²>/3 Z in the volume of centres, V = L³, with Z of Carnahan and Starling. Beside a wall less of the sphere
    # of σ = 2 R around a centre is shut to others: the integral of overlaps over pairs of places, V 4 π σ³/3, lacks π σ⁴/4
    # for each m² of walls, and p L³ = −∂F/∂ln L/3 lacks N π σ⁴/L⁴ of Z, to second order in the density.
    part = N * 4 / 3 * math.pi * R**3 / FREE**3
    z = (1 + part + part**2 - part**3) / (1 - part) ** 3 - N * math.pi * (2 * R) ** 4 / FREE**4
    ideal = N * M * V**2 / 3 / FREE**3
    pressure = given / (steps * dt) / (6 * FREE**2)
    # Impacts are a Poisson process; their impulses m v, with v exp(−v²/2 s²) dv, have a mean square of 4/π times the square
    # of their mean: the relative error of the sum is √(4/π/impacts). The next order at walls is some part² of it.
    error = math.sqrt(4 / math.pi / impacts)
    assert abs(pressure / (ideal * z) - 1) < 3 * error + part**2
    assert abs(pressure / ideal - 1) > 6 * error  # it tells them apart
    assert math.isclose((0.5 * M * speed**2).sum(), 0.5 * N * M * V**2, rel_tol=1e-10)
