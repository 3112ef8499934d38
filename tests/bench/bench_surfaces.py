"""What contacts of surfaces cost beside a plain step, in CPU time per particle and step.

    python tests/bench/bench_surfaces.py [--resolution 60] [--steps 400] [--rounds 3]

Two sheets step with and without an interaction of type contact, by turns, on one thread: far from each other, and one lying
on the other. Prints both times, and their ratio. Compiles first.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import particlesim as ps
from particlesim.engine.simulation import Simulation

THIN = 0.1
"""Radius, as a part of the distance of neighbours."""


def scene(n: int, apart: float, *, touches: bool, method: str) -> ps.Scenario:
    """Two sheets of n × n particles, some thicknesses apart, the lower one held at its edges."""
    radius = THIN / (n - 1)

    def sheet(name: str, y: float, **more: Any) -> dict[str, Any]:
        place = {"origin": [-0.5, y, 0.5], "size": [1, 1], "up": [0, 0, -1]}
        return {
            "name": name,
            "mass": 1e-4 * n * n,
            "radius": radius,
            "layout": {"type": "cloth", "resolution": [n, n], **place, **more},
            "springs": {"structural": 200.0, "shear": 50.0, "damping_ratio": 0.2},
        }

    edges = ["left", "right", "top", "bottom"]
    return ps.from_table(
        {
            "simulation": {"duration": 10.0, "dt": 2e-4, "integrator": method},
            "output": {"every": 100},
            "particles": [sheet("low", 0, pinned=edges), sheet("high", 2.05 * radius * apart, pinned=edges)],
            "forces": [{"type": "gravity"}],
            "interactions": [{"type": "contact", "restitution": 0, "friction": 0.3}] if touches else [],
        }
    )


def cost(simulation: Simulation, first: int, steps: int, particles: int) -> float:
    """CPU time per particle and step [µs]."""
    begin = time.process_time()
    simulation.advance_to(first + steps)
    return (time.process_time() - begin) / steps / particles * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resolution", type=int, default=60)
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    n, steps = options.resolution, options.steps
    for method in ("symplectic_euler", "backward_euler"):
        count = steps if method == "symplectic_euler" else max(steps // 20, 1)
        for name, apart in (("far", 50.0), ("lying on each other", 1.0)):
            both = [
                Simulation(scene(n, apart, touches=each, method=method), threads=1) for each in (True, False)
            ]
            for each in both:
                each.advance_to(count)
            times = [
                [cost(each, count * (turn + 1), count, 2 * n * n) for each in both]
                for turn in range(options.rounds)
            ]
            touching, plain = (min(column) for column in zip(*times, strict=True))
            print(
                f"{method}, {name}: {touching:.3f} µs with contact, {plain:.3f} µs without: {touching / plain:.2f} ×"
            )


if __name__ == "__main__":
    main()
