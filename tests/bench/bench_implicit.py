"""A stiff cloth by backward Euler against the best explicit run of the same simulated time, and against real time.

    python tests/bench/bench_implicit.py [--threads 2] [--width 100] [--seconds 1] [--rounds 3]

The cloth hangs by two corners and swings. Its stiffness is chosen so that steps of 1/60 s are 100 times as long as the
longest that symplectic Euler can take, which the same run measures by trying. Both runs are timed in turn; the best of
each counts.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

import particlesim as ps
from particlesim.engine.islands.coupled import CoupledIsland
from particlesim.engine.simulation import Simulation

STEP = 1 / 60
BEYOND = 100
SMALL = 24


def cloth(width: int, stiffness: float, dt: float, method: Any) -> ps.Scenario:
    """A cloth of width² particles, 0.2 kg, lying in the plane, held at two corners."""
    return ps.from_table(
        {
            "simulation": {"duration": 1000.0, "dt": dt, "integrator": method},
            "output": {"interval": 1000.0, "ledger": False},
            "particles": [
                {
                    "name": "cloth",
                    "layout": {
                        "type": "cloth",
                        "size": [1, 1],
                        "resolution": [width, width],
                        "up": [0, 0, 1],
                        "pinned": ["bottom_left", "bottom_right"],
                    },
                    "mass": 0.2,
                    "springs": {"structural": stiffness, "shear": stiffness, "bend": stiffness},
                }
            ],
            "forces": [{"type": "gravity"}],
        }
    )


def holds(width: int, stiffness: float, dt: float) -> bool:
    """Whether symplectic Euler stays bounded for some thousand steps."""
    simulation = Simulation(cloth(width, stiffness, dt, "symplectic_euler"), threads=1)
    try:
        simulation.advance_to(3000)
        return bool(np.abs(simulation.states[0].velocity).max() < 1e3)
    except ps.DivergenceError:
        return False
    finally:
        simulation.close()


def longest_step(width: int, stiffness: float) -> float:
    """The longest step that symplectic Euler can take, to 1 %, tried on a smaller cloth."""
    # The stiffest mode is that of neighbours that swing against each other: the limit goes as √(m/k), 1/m as the particles.
    unit = (0.2 / SMALL**2 / stiffness) ** 0.5
    low, high = 0.2 * unit, 2 * unit
    while high / low > 1.01:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if holds(SMALL, stiffness, middle) else (low, middle)
    return low * SMALL / width


def timed(simulation: Simulation, steps: int) -> tuple[float, list[int]]:
    """Wall time of some steps, and linear iterations of each."""
    island = simulation.islands[0]
    assert isinstance(island, CoupledIsland)
    spent, began = [], time.perf_counter()
    for _ in range(steps):
        simulation.advance_to(simulation.step + 1)
        system = island.layout.work.system
        spent.append(int(system.report[3]) if system is not None else 0)
    return time.perf_counter() - began, spent


def compare(width: int, threads: int, seconds: float, rounds: int) -> None:
    """Both methods in turn; the best of each."""
    unit = longest_step(width, 1.0)
    stiffness = (unit * BEYOND / STEP) ** 2
    limit = unit / stiffness**0.5
    print(
        f"cloth {width}², k = {stiffness:.4g} N/m; limit {limit * 1e6:.1f} µs, 1/60 s is {STEP / limit:.0f} × that"
    )
    steps = round(seconds / STEP)
    best: dict[str, float] = {}
    for _ in range(rounds):
        explicit = Simulation(cloth(width, stiffness, 0.98 * limit, "symplectic_euler"), threads=threads)
        explicit.advance_to(10)
        began = time.perf_counter()
        explicit.advance_to(10 + round(seconds / (0.98 * limit)))
        best["symplectic_euler"] = min(best.get("symplectic_euler", np.inf), time.perf_counter() - began)
        explicit.close()
        for tolerance in (1e-2, 1e-3, 1e-4, 1e-6):
            method = {"method": "backward_euler", "tolerance": tolerance}
            implicit = Simulation(cloth(width, stiffness, STEP, method), threads=threads)
            implicit.advance_to(1)
            taken, spent = timed(implicit, steps)
            name = f"backward_euler, tolerance {tolerance:g}"
            best[name] = min(best.get(name, np.inf), taken)
            lowest = implicit.states[0].position[:, 1].min()
            print(
                f"  {name}: {np.mean(spent):.0f} iterations a step, {max(spent)} at most; lowest point {lowest:.4f} m"
            )
            implicit.close()
    for name, taken in best.items():
        ratio = best["symplectic_euler"] / taken
        print(f"  {name:36s} {taken / seconds:8.3f} s per simulated second, {ratio:6.2f} × the explicit rate")


def main() -> None:
    """Parse arguments, measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--width", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    compare(asked.width, asked.threads, asked.seconds, asked.rounds)


if __name__ == "__main__":
    main()
