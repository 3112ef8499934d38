"""The Solar System with `whfast`, against REBOUND's WHFast of the same step, in one run.

    python tests/bench/bench_orbits.py [--rebound python] [--steps 100000] [--rounds 3]

`--rebound` is a Python that has REBOUND: it need not be this one. Both follow the bodies of the scenario `solar_system` in
Jacobi coordinates, without correctors, and combine the half steps between frames. Processor time of one thread, the best of
some rounds in turn; errors of the energy at the end, and how far the bodies of both are apart there.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.model.constants import GRAVITATIONAL_CONSTANT

SCENARIO = Path(__file__).parents[2] / "scenarios" / "solar_system.toml"
DAY = 86_400.0
THEIRS = """
import json, rebound, sys, time
g, dt, steps, bodies = json.load(sys.stdin)
sim = rebound.Simulation()
sim.G = g
for m, x, v in bodies:
    sim.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
sim.integrator = "whfast"
sim.integrator.safe_mode = 0
sim.dt = dt
begin = time.process_time()
sim.steps(steps)
sim.synchronize()
took = time.process_time() - begin
print(json.dumps([took, [[p.x, p.y, p.z] for p in sim.particles], [[p.vx, p.vy, p.vz] for p in sim.particles]]))
"""
Motion = tuple[float, NDArray[np.float64], NDArray[np.float64]]


def energy(m: NDArray[np.float64], x: NDArray[np.float64], v: NDArray[np.float64]) -> float:
    """Kinetic and potential energy [J]."""
    i, j = np.triu_indices(len(m), 1)
    potential = (m[i] * m[j] / np.linalg.norm(x[i] - x[j], axis=1)).sum()
    return float((m * np.square(v).sum(axis=1)).sum() / 2 - GRAVITATIONAL_CONSTANT * potential)


def ours(scenario: ps.Scenario) -> Motion:
    """Processor time [s], places and velocities at the end."""
    simulation = Simulation(scenario, threads=1)
    begin = time.process_time()
    simulation.advance_to(scenario.grid.steps)
    took = time.process_time() - begin
    x, v = (
        np.concatenate([getattr(each, name) for each in simulation.states])
        for name in ("position", "velocity")
    )
    simulation.close()
    return took, x, v


def theirs(python: str, given: Any) -> Motion:
    """The same of REBOUND."""
    ran = subprocess.run(
        [python, "-c", THEIRS], input=json.dumps(given), capture_output=True, text=True, check=True
    )
    took, x, v = json.loads(ran.stdout)
    return took, np.array(x), np.array(v)


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description="WHFast against REBOUND.")
    parser.add_argument("--rebound", default=sys.executable)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--days", type=float, default=4.0)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    table = tomllib.loads(SCENARIO.read_text())
    duration = f"{given.steps * given.days} day"
    table["simulation"] = {"duration": duration, "dt": f"{given.days} day", "integrator": "whfast"}
    table["output"] = {"every": given.steps, "ledger": False}
    table.pop("checks")
    scenario = ps.from_table(table)
    m = np.array([each["mass"] for each in table["particles"]])
    x, v = (
        np.array([each["layout"][key][0] for each in table["particles"]]) for key in ("position", "velocity")
    )
    bodies = list(zip(m.tolist(), x.tolist(), v.tolist(), strict=True))
    ours(scenario)  # compiles
    rounds = [
        (
            ours(scenario),
            theirs(given.rebound, (GRAVITATIONAL_CONSTANT, given.days * DAY, given.steps, bodies)),
        )
        for _ in range(given.rounds)
    ]
    start = energy(m, x, v)
    best = [min((each[k] for each in rounds), key=lambda run: run[0]) for k in (0, 1)]
    for name, (took, place, speed) in zip(("psim", "REBOUND"), best, strict=True):
        error = energy(m, place, speed) / start - 1
        print(f"{name:<8} {took / given.steps * 1e6:7.3f} us a step, energy {error:+.2e}")
    apart = np.linalg.norm(best[0][1] - best[1][1], axis=1).max()
    print(f"ratio {best[1][0] / best[0][0]:.2f}; at the end at most {apart:.1f} m apart")


if __name__ == "__main__":
    main()
