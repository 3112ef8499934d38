"""Sweeps: runs per second, beside a shell loop of `psim run`, and what a second worker brings.

python tests/bench/bench_sweep.py [--runs 1000] [--loop 5]

A run has 100 particles and 1 000 steps. Kernels are compiled before anything is measured.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from particlesim.sweep import Design, InProcess, Sweep, parse_axis

SCENARIO = """
[simulation]
duration = 1.0
dt = 0.001
integrator = "velocity_verlet"
[output]
every = 1000
[[particles]]
name = "balls"
layout = { type = "random", count = 100, shape = { type = "ball", radius = 1.0 } }
radius = 0.01
[[forces]]
type = "gravity"
[[planes]]
point = [0, -5, 0]
restitution = 0.5
"""


def seconds(file: Path, folder: Path, runs: int, workers: int) -> float:
    """Wall time of a sweep, from nothing to the table; with no workers in this process."""
    design = Design((parse_axis(f"simulation.seed=linspace(1, {runs}, {runs})"),))
    began = time.perf_counter()
    executor = InProcess() if not workers else None
    result = Sweep(file, design).run(folder, workers=workers or None, executor=executor)
    assert result.exit_code == 0
    return time.perf_counter() - began


def loop(file: Path, folder: Path, runs: int) -> float:
    """Wall time of one `psim run` after the other, each a process of its own."""
    began = time.perf_counter()
    for seed in range(runs):
        command = [sys.executable, "-m", "psim", "run", str(file), "-q", "--set", f"simulation.seed={seed}"]
        subprocess.run([*command, "-o", str(folder / f"{seed}.vtkhdf")], check=True)
    return time.perf_counter() - began


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--loop", type=int, default=5)
    told = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "balls.toml"
        file.write_text(SCENARIO)
        seconds(file, folder / "warm", 2, 0)
        loop(file, folder, 1)
        here = seconds(file, folder / "here", told.runs, 0) / told.runs
        two = seconds(file, folder / "two", told.runs, 2) / told.runs
        four = seconds(file, folder / "four", 4 * told.runs, 2) / told.runs / 4
        for path in folder.glob("*.vtkhdf"):
            path.unlink()
        shell = loop(file, folder, told.loop) / told.loop
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, {told.runs:,} runs")
    for label, each in (
        ("shell loop of psim run", shell),
        ("psim sweep in one process", here),
        ("psim sweep, two workers", two),
        (f"psim sweep, two workers, {4 * told.runs:,} runs", four),
    ):
        print(f"{label:45} {1 / each:8.1f} runs/s   {shell / each:6.1f} × the loop")
    print(
        f"efficiency of two workers: {here / two / 2:.2f}, of {4 * told.runs:,} runs: {here / four / 2:.2f}"
    )


if __name__ == "__main__":
    main()
