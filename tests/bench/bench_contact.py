"""What contact costs: settled particles against flying ones, and a box of six planes against none.

    python tests/bench/bench_contact.py [--particles 1000000] [--rounds 5]

All scenes run in turn, several rounds, and the best of each is compared; ratios are what counts. Gravity, and drag in a wind
for those of the first table; continuous detection, velocity Verlet, one radius.
"""

from __future__ import annotations

import argparse
from typing import Any

import particlesim as ps

FAR = 1e4
BOX = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]


def scene(
    planes: list[dict[str, Any]], n: int, steps: int, settled: bool, pull: float = 0.0
) -> dict[str, Any]:
    """Particles in the air, or at rest on the plane y = 0; gravity with a `pull` along x [m/s²]."""
    top = 1e-300 if settled else 10
    shape = {"type": "box", "min": [0, 0, 0], "max": [10, top, 10]}
    drag = {
        "type": "drag",
        "density": 1.225,
        "coefficient": 1.0,
        "area": 0.01,
        "flow": [{"type": "uniform", "velocity": [2, 0, 0]}],
    }
    return {
        "simulation": {"duration": steps * 1e-3, "dt": 1e-3, "integrator": "velocity_verlet"},
        "output": {"every": steps, "ledger": False},
        "particles": [{"layout": {"type": "random", "count": n, "shape": shape}, "radius": 0.0}],
        "forces": [{"type": "gravity", "acceleration": [pull, -9.80665, 0]}, drag],
        "planes": planes,
    }


def scenes(n: int, steps: int) -> dict[str, dict[str, Any]]:
    """All scenes by name."""
    far = {"point": [0, -FAR, 0]}
    return {
        "no planes": scene([], n, steps, False),
        "flying over a plane": scene([far], n, steps, False),
        "settled on the default plane": scene([{}], n, steps, True),
        "settled, restitution 0.5": scene([{"restitution": 0.5}], n, steps, True),
        "settled, friction 0.5": scene([{"friction": 0.5}], n, steps, True),
        "sliding, friction 0.1": scene([{"restitution": 0.5, "friction": 0.1}], n, steps, True, 3.0),
        "box of six planes": scene(
            [{"normal": k, "point": [-FAR * x for x in k]} for k in BOX], n, steps, False
        ),
    }


def main() -> None:
    """Measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--particles", type=int, default=10**6)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    runs = {name: ps.from_table(table) for name, table in scenes(asked.particles, asked.steps).items()}
    for table in scenes(1000, 2).values():
        ps.run(ps.from_table(table))
    best: dict[str, float] = {}
    for _ in range(asked.rounds):
        for name, scenario in runs.items():
            result = ps.run(scenario)
            best[name] = max(best.get(name, 0.0), result.particle_steps / result.seconds)
    print(f"{asked.particles:,} particles, {asked.steps} steps; M particle-steps/s")
    for name, rate in best.items():
        print(f"  {name:30s} {rate / 1e6:9.1f}")
    flying = best["flying over a plane"]
    print(f"settled over flying: {best['settled on the default plane'] / flying:.2f}")
    print(f"sliding with friction over flying: {best['sliding, friction 0.1'] / flying:.2f}")
    print(f"box over no planes: {best['box of six planes'] / best['no planes']:.2f}")


if __name__ == "__main__":
    main()
