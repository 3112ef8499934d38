"""Short ways to state a scenario in a test, and to run it through the public interface."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import particlesim as ps
from particlesim.engine.simulation import Simulation

Table = dict[str, Any]
EPS = float(np.finfo(float).eps)
G = 9.80665


def points(*position: tuple[float, float, float], velocity: Any = ((0.0, 0.0, 0.0),), **group: Any) -> Table:
    """A group of particles at the given places."""
    layout = {
        "type": "points",
        "position": [list(x) for x in position],
        "velocity": [list(v) for v in velocity],
    }
    return {"layout": layout, **group}


def table(duration: float, dt: float, method: str = "velocity_verlet", **parts: Any) -> Table:
    """A scenario as TOML would give it; a frame at the start and at the end unless `output` says otherwise."""
    seed = parts.pop("seed", 0)
    steps = max(round(duration / dt), 1)
    output = {"every": steps, "ledger": False, "precision": "double", "compression": "none"} | parts.pop(
        "output", {}
    )
    return {
        "simulation": {"duration": duration, "dt": dt, "integrator": method, "seed": seed},
        "output": output,
        **parts,
    }


def simulate(duration: float, dt: float, method: str = "velocity_verlet", **parts: Any) -> ps.Result:
    """Run such a scenario in memory."""
    return ps.run(ps.from_table(table(duration, dt, method, **parts)))


def energies(scenario: Table) -> NDArray[np.float64]:
    """The energy at every frame of a scenario [J], whatever a run would say to it."""
    simulation, found = Simulation(ps.from_table(scenario)), []
    for step in (0, *simulation.scenario.grid.frame_steps()):
        simulation.advance_to(step)
        row = simulation.ledger()
        found.append(row["kinetic"] + sum(row[name] for name in row if name.startswith("potential.")))
    simulation.close()
    return np.array(found)


def way(every: int, duration: float, h: float, method: str, **parts: Any) -> tuple[NDArray[np.float64], ...]:
    """Places and velocities of all particles every so many steps, shapes [times, n, 3]."""
    simulation = Simulation(ps.from_table(table(duration, h, method, **parts)))
    places, speeds = [], []
    for step in range(0, round(duration / h) + 1, every):
        simulation.advance_to(step)
        for found, name in ((places, "x"), (speeds, "v")):
            found.append(
                np.concatenate([getattr(state, name)[:, : state.count].T for state in simulation.states])
            )
    simulation.close()
    return np.array(places), np.array(speeds)


def record(
    path: Path, duration: float, dt: float, method: str = "velocity_verlet", **parts: Any
) -> ps.Trajectory:
    """Run such a scenario into a file, and open it."""
    ps.run(ps.from_table(table(duration, dt, method, **parts)), path)
    return ps.open(path)


def rows(*vectors: Any) -> NDArray[np.float64]:
    """Vectors as the rows of an array."""
    return np.array(vectors, dtype=float)
