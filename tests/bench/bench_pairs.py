"""Gravity of all pairs: psim's sum of forces against C with vectors of 512 bits, pytreegrav's brute force, and REBOUND.

    python tests/bench/bench_pairs.py [--bodies 16384] [--rounds 3] [--threads 2] [--peers /path/to/python]

Pairs per second of CPU time, the best of several rounds in turn; ratios are what counts. With threads, wall time of psim
and C is compared as well. `--peers` names a Python that has pytreegrav and rebound; these run on one thread.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import particlesim as ps
from particlesim.engine.coupled.forces import island_forces
from particlesim.engine.simulation import Simulation

HERE = Path(__file__).resolve().parent
FLAGS = ["-O3", "-march=native", "-mprefer-vector-width=512", "-ffast-math", "-fopenmp", "-shared", "-fPIC"]
SOFTENING = 0.01


def bodies(n: int) -> ps.Scenario:
    """Bodies in a ball that attract each other."""
    return ps.from_table(
        {
            "simulation": {"duration": 1.0, "dt": 0.001, "integrator": "velocity_verlet"},
            "output": {"interval": 1.0, "ledger": False},
            "particles": [
                {
                    "name": "bodies",
                    "mass": 1.0 / n,
                    "layout": {"type": "random", "count": n, "shape": {"type": "ball", "radius": 1.0}},
                }
            ],
            "interactions": [
                {"type": "gravity", "constant": 1.0, "softening": SOFTENING, "method": "direct"}
            ],
        }
    )


def compiled(folder: str) -> ctypes.CDLL:
    """The C program."""
    path = Path(folder) / "pairs.so"
    subprocess.run(["gcc", *FLAGS, str(HERE / "c" / "pairs.c"), "-o", str(path), "-lm"], check=True)
    library = ctypes.CDLL(str(path))
    array = np.ctypeslib.ndpointer(float)
    library.direct.argtypes = [ctypes.c_long, *[array] * 4, ctypes.c_double, array, ctypes.c_int]
    return library


def contenders(simulation: Simulation, library: ctypes.CDLL) -> dict[str, Callable[[int], None]]:
    """A sum of forces on a number of threads, by psim and by C."""
    island = simulation.islands[0]
    columns = island.island_columns()  # type: ignore[union-attr]
    x, y, z, m = (np.ascontiguousarray(part) for part in (columns.x, columns.y, columns.z, columns.m))
    out = np.zeros((3, x.size))

    def psim(threads: int) -> None:
        shares = island.layout.shares(threads)  # type: ignore[union-attr]
        columns.x[0] = np.nextafter(columns.x[0], 1)  # a sum for the same places would be remembered

        def work(k: int) -> None:
            bonds, scratch, share = shares[k]
            island_forces(island.layout.parts, bonds, columns, scratch, share, 0.0)  # type: ignore[union-attr]

        simulation.team.each(work, len(shares))

    def by_c(threads: int) -> None:
        library.direct(x.size, x, y, z, m, SOFTENING**2, out, threads)

    psim(1)
    by_c(1)
    found = shares_force(island)
    worst = np.abs(found / m - out).max() / np.abs(out).max()
    print(f"largest difference between the two, of the largest acceleration: {worst:.1e}")
    return {"psim": psim, "C": by_c}


def shares_force(island: object) -> np.ndarray:
    """The total forces that the last sum has left [3, n]."""
    return np.array(island.layout.shares(1)[0][1].force)  # type: ignore[attr-defined]


def peer_rate(python: str, peer: str, n: int) -> float:
    """Pairs per second of another tool."""
    command = [python, str(HERE / "pairs_peers.py"), peer, str(n)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main() -> None:
    """Parse arguments, measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bodies", type=int, default=16_384)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--peers", help="a Python with pytreegrav and rebound")
    asked = parser.parse_args()
    n = asked.bodies
    simulation = Simulation(bodies(n), threads=asked.threads)
    with tempfile.TemporaryDirectory() as folder:
        both = contenders(simulation, compiled(folder))
        cpu = dict.fromkeys(both, 0.0)
        wall = dict.fromkeys(both, 0.0)
        for _ in range(asked.rounds * 3):
            for name, run in both.items():
                begin = time.process_time()
                run(1)
                cpu[name] = max(cpu[name], n * n / (time.process_time() - begin))
                begin = time.perf_counter()
                run(asked.threads)
                wall[name] = max(wall[name], n * n / (time.perf_counter() - begin))
    simulation.close()
    for peer in ("pytreegrav", "rebound") if asked.peers else ():
        cpu[peer] = max(peer_rate(asked.peers, peer, n) for _ in range(asked.rounds))
    print(f"{n:,} bodies, G pairs/s of CPU time on one thread, and psim over it")
    for name, rate in cpu.items():
        print(f"  {name:12s} {rate / 1e9:8.3f} {cpu['psim'] / rate:8.2f}")
    print(f"wall time on {asked.threads} threads: psim over C {wall['psim'] / wall['C']:.2f}")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
