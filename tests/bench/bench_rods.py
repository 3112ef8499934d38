"""A swinging chain of rods against the same chain of springs that give a ten-thousandth under its weight.

    python tests/bench/bench_rods.py [--rounds 3]

Both chains are 1 m long, 1 kg, hang from a pin and begin a little aside. Each steps with half of the largest stable step
that psim finds for it; what counts is the processor time for a simulated second.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

import particlesim as ps
from particlesim.engine.simulation import Simulation

GIVES = 1e-4
"""Strain of the uppermost spring under the weight of the chain."""


def chain(number: int, dt: float, links: dict[str, Any]) -> ps.Scenario:
    """A chain of so many links."""
    length, angle = 1.0 / number, 0.3
    place = [[math.sin(angle) * length * k, -math.cos(angle) * length * k, 0.0] for k in range(number + 1)]
    return ps.from_table(
        {
            "simulation": {"duration": 1e4 * dt, "dt": dt, "integrator": "velocity_verlet"},
            "output": {"interval": 1e4 * dt, "ledger": False},
            "particles": [
                {
                    "name": "chain",
                    "layout": {"type": "points", "position": place},
                    "mass": 1.0 / number,
                    "pinned": [0],
                }
            ],
            "forces": [{"type": "gravity"}],
            **links,
        }
    )


def cost(scenario: ps.Scenario, steps: int, rounds: int) -> float:
    """Processor time of a step [s], the best of some rounds."""
    simulation = Simulation(scenario, threads=1)
    simulation.advance_to(1)
    best = math.inf
    for _ in range(rounds):
        begin = time.process_time()
        simulation.advance_to(simulation.step + steps)
        best = min(best, (time.process_time() - begin) / steps)
    simulation.close()
    return best


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--rounds", type=int, default=3)
    rounds = parser.parse_args().rounds
    for number, steps in ((10, 2000), (100, 1000), (1000, 300)):
        pairs = [[k, k + 1] for k in range(number)]
        stiffness = 9.80665 * number / GIVES
        kinds = {
            "rods": {"rods": [{"on": "chain", "pairs": pairs}]},
            "springs": {"springs": [{"on": "chain", "pairs": pairs, "stiffness": stiffness}]},
        }
        found = {}
        for kind, links in kinds.items():
            dt = 0.5 * ps.stability(chain(number, 1e-6, links)).step
            seconds = cost(chain(number, dt, links), steps, rounds)
            found[kind] = seconds / dt
            print(
                f"{number:5} {kind:8} dt = {dt:9.3g} s   {1e9 * seconds / number:8.1f} ns per link and step   "
                f"{1e3 * found[kind]:9.3f} ms per simulated second"
            )
        print(f"{'':6}rods take {found['rods'] / found['springs']:.3f} of the time")


if __name__ == "__main__":
    main()
