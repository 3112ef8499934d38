"""Springs of a cloth through `Simulation`, whole steps, against C that knows the grid, C with a list, Warp and Newton.

    python tests/bench/bench_springs.py [--threads 2] [--rounds 3] [--peers /path/to/python] [--growth]

All contenders run in turn, several rounds; the best of each is compared, and ratios are what counts. Beside whole steps
stands the rate of psim's force evaluation alone. `--peers` names a Python that has warp-lang and newton; both have one
thread, so psim with one thread is what to compare them with first.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import particlesim as ps
from particlesim.engine.coupled.forces import island_forces
from particlesim.engine.simulation import Simulation

HERE = Path(__file__).resolve().parent
FLAGS = [
    "-O3",
    "-march=native",
    "-fopenmp",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-mprefer-vector-width=512",
]
DT = {100: 5e-5, 500: 1e-5}


def cloth(width: int, dt: float) -> ps.Scenario:
    """A lying cloth of width² particles held at two corners, as in the C programs."""
    return ps.from_table(
        {
            "simulation": {"duration": 1.0, "dt": dt},
            "output": {"interval": 1.0, "ledger": False},
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
                    "springs": {"structural": 50.0, "shear": 50.0, "bend": 50.0, "damping": 1e-3},
                }
            ],
            "forces": [{"type": "gravity"}],
        }
    )


def psim_rate(width: int, steps: int, threads: int, repeats: int = 3) -> float:
    """Springs per second in whole steps, the best of some runs."""
    simulation = Simulation(cloth(width, DT.get(width, 1e-6)), threads=threads)
    simulation.advance_to(2)
    springs = simulation.islands[0].layout.effort  # type: ignore[union-attr]
    best = 0.0
    for _ in range(repeats):
        begin = time.perf_counter()
        simulation.advance_to(simulation.step + steps)
        best = max(best, springs * steps / (time.perf_counter() - begin))
    simulation.close()
    return best


def force_rate(width: int, evaluations: int, repeats: int = 3) -> float:
    """Springs per second of the force evaluation alone, on one thread, the best of some runs."""
    simulation = Simulation(cloth(width, DT.get(width, 1e-6)), threads=1)
    simulation.advance_to(2)
    island = simulation.islands[0]
    ((bonds, work, share),) = island.layout.shares(1)  # type: ignore[union-attr]
    columns = island.island_columns()  # type: ignore[union-attr]
    best = 0.0
    for _ in range(repeats + 1):  # the first one may compile
        begin = time.perf_counter()
        for _ in range(evaluations):
            island_forces(island.layout.parts, bonds, columns, work, share, 0.0)  # type: ignore[union-attr]
        best = max(best, island.layout.effort * evaluations / (time.perf_counter() - begin))  # type: ignore[union-attr]
    simulation.close()
    return best


def peer_rate(python: str, peer: str, width: int, steps: int) -> float:
    """Springs per second of another tool."""
    command = [python, str(HERE / "w2_peers.py"), peer, str(width), str(steps), str(DT[width])]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def c_rate(program: Path, width: int, steps: int, threads: int, form: str) -> float:
    """Springs per second of the C program."""
    command = [str(program), str(width), str(steps), "3", str(DT[width]), form]
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return float(done.stdout)


def compare(threads: int, rounds: int, peers: str | None) -> None:
    """All contenders in turn; the best of each, and ratios."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "w2_cloth"
        subprocess.run(["gcc", *FLAGS, str(HERE / "c" / "w2_cloth.c"), "-o", str(program), "-lm"], check=True)
        for width, steps in ((100, 2000), (500, 60)):
            contenders: dict[str, Callable[[], float]] = {
                f"psim, {threads} threads": partial(psim_rate, width, steps, threads),
                f"C that knows the grid, {threads} threads": partial(
                    c_rate, program, width, steps, threads, "grid"
                ),
                "psim, one thread": partial(psim_rate, width, steps // 2, 1),
                "psim's forces alone, one thread": partial(force_rate, width, steps // 2),
                "C, index list, one thread": partial(c_rate, program, width, steps // 2, 1, "scatter"),
            }
            for peer in ("warp", "newton") if peers else ():
                contenders[f"{peer}, one thread"] = partial(peer_rate, peers, peer, width, steps // 2)
            best = dict.fromkeys(contenders, 0.0)
            for _ in range(rounds):
                for name, rate in contenders.items():
                    best[name] = max(best[name], rate())
            two, one = best[f"psim, {threads} threads"], best["psim, one thread"]
            print(
                f"cloth {width}², whole steps; M springs/s, and psim with {threads} threads and with one over it"
            )
            for name, rate in best.items():
                print(f"  {name:36s} {rate / 1e6:9.1f} {two / rate:7.2f} {one / rate:7.2f}", flush=True)


def growth(threads: int) -> None:
    """Time per spring from 10⁴ to 10⁷ springs."""
    print(f"growth, {threads} threads: springs, M springs/s")
    for width in (42, 130, 410, 1300):
        springs = 6 * width * width
        print(f"  {springs:>12,} {psim_rate(width, max(4, 60_000_000 // springs), threads, 2) / 1e6:9.1f}")


def main() -> None:
    """Parse arguments, measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--peers", help="a Python with warp-lang and newton")
    parser.add_argument("--growth", action="store_true")
    asked = parser.parse_args()
    if asked.growth:
        growth(asked.threads)
    else:
        compare(asked.threads, asked.rounds, asked.peers)
    sys.stdout.flush()


if __name__ == "__main__":
    main()
