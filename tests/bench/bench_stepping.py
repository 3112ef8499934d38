"""Stepping speed through `ps.run`, against C, NumPy and, if they are installed somewhere, Taichi, JAX and Warp.

    python tests/bench/bench_stepping.py [--peers /path/to/python] [--rounds 3] [--growth] [--recording]

All contenders run in turn, several rounds, each in a process of its own; the best of each is compared, and ratios are
what counts. `--peers` names a Python that has taichi, jax and warp-lang.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent


def scenario(n: int, steps: int, plane: str, **simulation: Any) -> dict[str, Any]:
    """The workload: 10 m box of particles, gravity, drag in a wind, a plane."""
    normal = {"axis": [0, 1, 0], "any": [1e-9, 1, 0]}[plane]
    spread = {"type": "normal", "mean": 0, "std": 5}
    return {
        "simulation": {"duration": steps * 1e-3, "dt": 1e-3, **simulation},
        "output": {"every": steps, "ledger": False},
        "particles": [
            {
                "name": "dust",
                "layout": {
                    "type": "random",
                    "count": n,
                    "shape": {"type": "box", "min": [0, 0, 0], "max": [10, 10, 10]},
                    "velocity": [spread, spread, spread],
                },
                "mass": {"type": "uniform", "low": 0.5, "high": 2.0},
            }
        ],
        "forces": [
            {"type": "gravity"},
            {
                "type": "drag",
                "density": 1.225,
                "coefficient": 1.0,
                "area": 0.01,
                "flow": [{"type": "uniform", "velocity": [2, 0, 0]}],
            },
        ],
        "planes": [{"normal": normal, "restitution": 0.6, "tangential_loss": 0.1, "detection": "discrete"}],
    }


def psim_worker(request: dict[str, Any]) -> dict[str, float]:
    """Runs in a process of its own: the best stepping rate of some runs, and the memory per particle."""
    import resource

    import particlesim as ps

    table = scenario(request["n"], request["steps"], request["plane"], **request["simulation"])
    for change in request.get("planes", ()):
        table["planes"][0].update(change)
    run = ps.from_table(table)
    warm = dict(
        table, simulation={**table["simulation"], "duration": 1e-3}, output={"every": 1, "ledger": False}
    )
    ps.run(ps.from_table(warm))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    best = 0.0
    for _ in range(request["repeats"]):
        result = ps.run(run)
        best = max(best, result.particle_steps / result.seconds)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {"rate": best, "bytes": (peak - before) * 1024 / request["n"] + 0.0}


def psim_rate(n: int, steps: int, plane: str = "any", repeats: int = 3, **more: Any) -> dict[str, float]:
    """Measure psim in a fresh process."""
    simulation = {k: v for k, v in more.items() if k in ("integrator", "precision")}
    request = {"n": n, "steps": steps, "plane": plane, "repeats": repeats, "simulation": simulation}
    if "detection" in more:
        request["planes"] = [{"detection": more["detection"]}]
    done = subprocess.run(
        [sys.executable, __file__, "--worker", json.dumps(request)],
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def c_program(folder: Path) -> Path | None:
    """Compile the C reference; None without a compiler."""
    program = folder / "w1_general"
    flags = [
        "-O3",
        "-march=native",
        "-fopenmp",
        "-fno-math-errno",
        "-fno-trapping-math",
        "-mprefer-vector-width=512",
    ]
    try:
        subprocess.run(
            ["gcc", *flags, str(HERE / "c" / "w1_general.c"), "-o", str(program), "-lm"],
            check=True,
            capture_output=True,
        )
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"no C reference: {error}", file=sys.stderr)
        return None
    return program


def number_from(command: list[str]) -> float | None:
    """The rate that a program prints, None if it cannot run."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        return float(done.stdout.strip().splitlines()[-1])
    except (ValueError, IndexError):
        return None


def compare(n: int, steps: int, rounds: int, peers: str | None) -> None:
    """All contenders in turn; the best of each, and ratios."""
    best: dict[str, float] = {}

    def note(name: str, rate: float | None) -> None:
        if rate is not None:
            best[name] = max(best.get(name, 0.0), rate)

    with tempfile.TemporaryDirectory() as folder:
        program = c_program(Path(folder))
        for _ in range(rounds):
            if program is not None:
                note(
                    "C, blocked, any plane",
                    number_from([str(program), str(n), str(steps), "512", "3", "2.0"]),
                )
            note("psim, any plane", psim_rate(n, steps, "any")["rate"])
            note("psim, axis plane", psim_rate(n, steps, "axis")["rate"])
            note("psim, axis plane, continuous", psim_rate(n, steps, "axis", detection="continuous")["rate"])
            note("psim, axis plane, RK4", psim_rate(n, steps, "axis", integrator="rk4")["rate"])
            note("psim, axis plane, float32", psim_rate(n, steps, "axis", precision="single")["rate"])
            for name in ("taichi", "jax", "warp"):
                if peers is not None:
                    note(name, number_from([peers, str(HERE / "w1_peers.py"), name, str(n), str(steps)]))
        note("numpy", number_from([sys.executable, str(HERE / "w1_peers.py"), "numpy", str(n), "10"]))
    ours = best["psim, any plane"]
    print(f"{n:,} particles, {steps} steps, float64; M particle-steps/s, and psim (any plane) over it")
    for name, rate in best.items():
        print(f"  {name:32s} {rate / 1e6:9.1f}   {ours / rate:7.2f}")
    print(f"  RK4 over symplectic Euler: {best['psim, axis plane, RK4'] / best['psim, axis plane']:.3f}")


def growth() -> None:
    """Time per particle-step and memory from 10⁴ to 10⁷ particles."""
    print("growth: particles, M particle-steps/s, resident bytes a particle")
    for n in (10**4, 10**5, 10**6, 10**7):
        # The same two seconds for all: later on most particles lie on the plane, which is other work.
        got = psim_rate(n, 2000 if n < 10**7 else 200, "axis", repeats=5)
        print(f"  {n:>10,} {got['rate'] / 1e6:9.1f} {got['bytes']:9.0f}")


def recording(n: int = 10**6) -> None:
    """How much recording slows stepping: frames of 10⁶ particles, float32, uncompressed."""
    import particlesim as ps

    table = scenario(n, 2000, "axis")
    table["output"] = {"every": 500, "ledger": False, "compression": "none"}
    run = ps.from_table(table)
    with tempfile.TemporaryDirectory() as folder:
        ps.run(run)
        for _ in range(3):
            alone = ps.run(run).seconds
            recorded = ps.run(run, Path(folder) / "r.vtkhdf", overwrite=True).seconds
            print(f"recording: {alone:.2f} s alone, {recorded:.2f} s recorded, ratio {recorded / alone:.3f}")


def main() -> None:
    """Parse arguments, measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    parser.add_argument("--particles", type=int, default=10**6)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--peers", help="a Python with taichi, jax and warp-lang")
    parser.add_argument("--growth", action="store_true")
    parser.add_argument("--recording", action="store_true")
    asked = parser.parse_args()
    if asked.worker:
        print(json.dumps(psim_worker(json.loads(asked.worker))))
        return
    if asked.growth:
        growth()
    elif asked.recording:
        recording()
    else:
        compare(asked.particles, asked.steps, asked.rounds, asked.peers)


if __name__ == "__main__":
    main()
