"""Gravity of a Plummer sphere by multipoles: against pytreegrav and FMM3D at equal errors, and as the number of bodies
grows.

    python tests/bench/bench_tree.py [--bodies 1000000] [--threads 2] [--rounds 3] [--peers /path/to/python] [--growth]

psim's times are those of all that a sum of forces takes: sorting, the tree, moments, the walk. Its tolerance is set
beforehand, once, so that the error is that of the peer, or a little less. Rounds of psim go before and after the peer; the
best counts. `--peers` names a Python that has pytreegrav and fmm3dpy. FMM3D has no softening:
there psim has none either; its package runs on one thread, so compare processor times. `--growth`: time of a body for 10⁴,
10⁵ and 10⁶ bodies, at equal errors of 1e-3 and 5e-5. Few bodies are summed many times in one call, as a run makes its steps:
waking threads takes as long as a thirtieth of a sum of 10⁴.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from particlesim.compiler import kernel
from particlesim.engine.barrier import new_gate
from particlesim.engine.interactions.tree import calibration
from particlesim.engine.interactions.tree.field import Hand, new_tree, sum_field
from particlesim.engine.interactions.tree.form import Form, Gradient, OneSign, Plummer
from particlesim.layouts import Plummer as Sphere
from particlesim.preflight.pair_memory import held
from particlesim.process.threads import Team
from particlesim.sampling.random_streams import Streams

COUNTS = (1_000, 2_000, 4_000, 10_000, 100_000, 1_000_000)
HERE = Path(__file__).resolve().parent


@kernel
def sum_fields(
    tree: Any, limits: Any, size: Any, x: Any, y: Any, z: Any, w: Any, share: Any, sums: Any
) -> None:
    """So many sums of forces, one after the other."""
    for _ in range(sums):
        sum_field(tree, limits, size, x, y, z, w, share)


class Bodies:
    """A Plummer sphere of scale 1, and room for the field of its bodies."""

    def __init__(self, count: int, softening: float, accuracy: float, team: Team) -> None:
        sphere = Sphere(count=count, mass=1.0, radius=1.0, extent=10.0, constant=1.0)
        self.x = np.ascontiguousarray(sphere.place(Streams(1, "bench"), 0, count).position)
        self.mass = np.full(count, 1 / count)
        self.team, self.softening = team, softening
        order = calibration.order_for(accuracy)
        form = Form((None,) * order, OneSign(), Plummer(softening**2), Gradient())
        self.tree = calibration.for_threads(new_tree(form, count, 1), team.threads)
        self.limits = np.array([*calibration.first_limits(accuracy), accuracy, 0.0])
        self.size = np.zeros(count)
        calibration.calibrate(self.tree, self.limits, self.size, tuple(self.x), self.mass, team)

    @property
    def error(self) -> float:
        return float(self.limits[calibration.ERROR])

    def time(self, rounds: int, sums: int = 1) -> tuple[float, float]:
        """Wall and processor time of a sum of forces [s]: the best of some calls, which make so many each."""
        best, gate, threads = (np.inf, np.inf), new_gate(), self.team.threads
        given = (self.tree, self.limits, self.size, *self.x, self.mass)
        for _ in range(rounds):
            wall, cpu = time.perf_counter(), time.process_time()
            self.team.each(lambda k: sum_fields(*given, Hand(k, threads, gate), sums), threads)
            best = (
                min(best[0], (time.perf_counter() - wall) / sums),
                min(best[1], (time.process_time() - cpu) / sums),
            )
        return best

    def bytes_each(self) -> float:
        """Memory of the tree, all of it, per body."""

        return (held(self.tree) + self.size.nbytes + self.mass.nbytes) / len(self.mass)


def against(peer: str, number: float, options: argparse.Namespace, softening: float) -> None:
    """psim and a peer in turn."""
    with Team(options.threads) as team, tempfile.TemporaryDirectory() as folder:
        bodies = Bodies(options.bodies, softening, 1e-3, team)
        rows = np.linspace(0, options.bodies - 1, 500).astype(int)
        path = Path(folder) / "bodies.npz"
        np.savez(path, x=bodies.x.T, mass=bodies.mass, softening=softening, rows=rows)
        command = [options.peers, str(HERE / "tree_peers.py"), peer, str(path), str(number)]
        found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
        mine = Bodies(options.bodies, softening, found["error"], team)
        wall, cpu = mine.time(options.rounds)
    print(
        f"{peer} {number:g}: rms {found['error']:.1e}, {found['wall']:.2f} s wall, {found['cpu']:.2f} s of processors; "
        f"psim rms {mine.error:.1e}, {wall:.2f} s, {cpu:.2f} s: "
        f"{found['wall'] / wall:.1f} and {found['cpu'] / cpu:.1f} times as fast",
        flush=True,
    )


def growth(options: argparse.Namespace) -> None:
    """Time of a body as their number grows: all numbers in turn, round by round, since machines change their speed."""
    with Team(options.threads) as team:
        for accuracy in (1e-3, 5e-5):
            counts = [count for count in COUNTS if count <= options.bodies]
            sets = [Bodies(count, 0.01, accuracy, team) for count in counts]
            best = [(np.inf, np.inf)] * len(counts)
            for _ in range(options.rounds):
                for k, bodies in enumerate(sets):
                    wall, cpu = bodies.time(5, max(1, 200_000 // counts[k]))
                    best[k] = (min(best[k][0], wall / counts[k]), min(best[k][1], cpu / counts[k]))
            for count, bodies, (wall, cpu) in zip(counts, sets, best, strict=True):
                print(
                    f"{count:9,} bodies, rms {bodies.error:.1e}, order {len(bodies.tree.form.order)}: "
                    f"{cpu * 1e6:5.2f} us of processors a body, {wall * 1e6:5.2f} us wall, "
                    f"{bodies.bytes_each():.0f} bytes"
                )
            many = [times for count, times in zip(counts, best, strict=True) if count >= 10_000]
            wall, cpu = (max(each) / min(each) for each in zip(*many, strict=True))
            print(f"most over least from 10,000 on: {cpu:.2f} of processors, {wall:.2f} wall", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bodies", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--peers", default=sys.executable)
    parser.add_argument("--growth", action="store_true")
    options = parser.parse_args()
    calibration.LEAST, calibration.AIM, calibration.MOST = 0.9, 0.95, 1.0  # errors as equal as can be
    if options.growth:
        growth(options)
    else:
        against("pytreegrav", 0.7, options, 0.01)
        against("fmm3d", 1e-3, options, 0.0)


if __name__ == "__main__":
    main()
