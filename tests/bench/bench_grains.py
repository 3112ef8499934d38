"""Settled grains by Hertz–Mindlin contacts with history, against LAMMPS' granular package; growth of time with number.

    python tests/bench/bench_grains.py [--grains 100000] [--rounds 3] [--threads 2] [--lammps /path/to/venv] [--settled FILE]
    python tests/bench/bench_grains.py --growth [--threads 2] [--rounds 3]

Equal spheres that have settled in a box with five walls: LAMMPS lets them fall, and both go on from there, in steps of the
same length, on one thread, or on as many as LAMMPS has processes. By a clock, in turn, several rounds; the best of each is
compared, and the ratios of all rounds are printed. `--lammps` names a virtual environment with the package lammps,
`--settled` a data file of LAMMPS to go on from, which is written if it is not there: to settle takes much longer than to
measure. `--growth` takes 10⁴ grains that psim has let settle, and nine and a hundred times as many, as mirror images side by
side; it needs no peer. Its times, and those of `--newton`, are of the CPU; with more than one thread they are of a clock.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from newton_peer import Newton
from numpy.typing import NDArray

import particlesim as ps
from particlesim.engine.interactions.contact_lists import contacts_in
from particlesim.engine.simulation import Simulation

RADIUS, DENSITY, DT = 0.0015, 2500.0, 1e-5
YOUNG, POISSON, FRICTION, RESTITUTION = 1e7, 0.3, 0.5, 0.5
COLUMN = 40
"""Grains along the height of the box, about."""
PRECISIONS = ("double", "single")
WARM = 200
"""Steps before the clock starts, in which contacts get their history."""
SETTLING = 30_000
GROWS = 200
"""Steps of the largest heap between two looks at the clock: those of an interval, as lists are made anew for each."""
INPUT = """units si
atom_style sphere
boundary f f f
newton off
comm_modify vel yes
read_data {start}
pair_style gran/hertz/history {kn} NULL {gamma} NULL {mu} 1
pair_coeff * *
neighbor {skin} bin
neigh_modify delay 0 every 1 check yes
fix 1 all nve/sphere
fix 2 all gravity 9.81 vector 0 0 -1
fix 3 all wall/gran hertz/history {kn} NULL {gamma} NULL {mu} 1 xplane 0 {edge}
fix 4 all wall/gran hertz/history {kn} NULL {gamma} NULL {mu} 1 yplane 0 {edge}
fix 5 all wall/gran hertz/history {kn} NULL {gamma} NULL {mu} 1 zplane 0 NULL
timestep {dt}
thermo 1000000
{runs}
"""


def loose(number: int) -> tuple[NDArray[np.float64], float]:
    """Places of grains that do not touch [m], and the edge of the box."""
    spacing = 2.1 * RADIUS
    along = max(round((number / COLUMN) ** 0.5), 4)
    edge, k = along * spacing, np.arange(number)
    x = np.stack([k % along, k // along % along, k // along**2], axis=1) * spacing + spacing / 2
    return x + np.random.default_rng(1).uniform(-0.05, 0.05, x.shape) * RADIUS, edge


def write(path: Path, x: NDArray[np.float64], edge: float) -> None:
    """A data file of LAMMPS."""
    lines = [
        f"grains\n\n{len(x)} atoms\n1 atom types\n\n0 {edge} xlo xhi\n0 {edge} ylo yhi\n0 {x[:, 2].max() * 1.1} zlo zhi"
    ]
    lines.append("\nAtoms # sphere\n")
    lines += [f"{k + 1} 1 {2 * RADIUS} {DENSITY} {a:.12g} {b:.12g} {c:.12g}" for k, (a, b, c) in enumerate(x)]
    path.write_text("\n".join(lines) + "\n")


def by_lammps(venv: str, folder: Path, start: Path, edge: float, runs: str, threads: int = 1) -> float:
    """Seconds that LAMMPS tells of the last of its runs."""
    # its coefficient is that of k √(R δ), its damper γ m √(R δ)
    script = folder / "in.grains"
    e_star = YOUNG / (2 * (1 - POISSON**2))
    script.write_text(
        INPUT.format(
            start=start,
            kn=4 / 3 * e_star,
            gamma=20.0,
            mu=FRICTION,
            skin=0.2 * RADIUS,
            edge=edge,
            dt=DT,
            runs=runs,
        )
    )
    command = [f"{venv}/bin/lmp", "-in", str(script), "-log", "log", "-screen", "none"]
    if threads > 1:
        command = [f"{venv}/bin/mpirun", "-np", str(threads), *command]
    subprocess.run(command, check=True, cwd=folder)
    return float(re.findall(r"Loop time of (\S+)", (folder / "log").read_text())[-1])


def settled(path: Path) -> NDArray[np.float64]:
    """Places in a data file of LAMMPS."""
    lines = path.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("Atoms")) + 2
    number = int(next(line for line in lines if line.endswith("atoms")).split()[0])
    return np.array([[float(v) for v in line.split()[4:7]] for line in lines[first : first + number]])


def simulation(
    x: NDArray[np.float64], edge: float, precision: str = "double", threads: int = 1
) -> Simulation:
    """The same grains and walls."""
    with tempfile.TemporaryDirectory() as name:
        np.save(Path(name) / "grains.npy", x[:, [0, 2, 1]])
        return _simulation(Path(name) / "grains.npy", edge, precision, threads)


def _simulation(grains: Path, edge: float, precision: str, threads: int) -> Simulation:
    walls = (
        ((0, 0, 0), (0, 1, 0)),
        ((0, 0, 0), (1, 0, 0)),
        ((edge, 0, 0), (-1, 0, 0)),
        ((0, 0, 0), (0, 0, 1)),
        ((0, 0, edge), (0, 0, -1)),
    )
    scenario = ps.from_table(
        {
            "simulation": {
                "duration": 1.0,
                "dt": DT,
                "integrator": "symplectic_euler",
                "precision": precision,
            },
            "output": {"every": 1000},
            "particles": [
                {
                    "layout": {"type": "file", "path": str(grains)},
                    "radius": RADIUS,
                    "density": DENSITY,
                }
            ],
            "forces": [{"type": "gravity", "acceleration": [0, -9.81, 0]}],
            "planes": [
                {"point": point, "normal": normal, "restitution": RESTITUTION, "friction": FRICTION}
                for point, normal in walls
            ],
            "interactions": [
                {
                    "type": "contact",
                    "model": "hertz",
                    "young_modulus": YOUNG,
                    "poisson_ratio": POISSON,
                    "restitution": RESTITUTION,
                    "friction": FRICTION,
                }
            ],
        }
    )
    return Simulation(scenario, threads=threads)


def timed(one: Simulation, steps: int, clock: Callable[[], float] = time.process_time) -> float:
    """Seconds of some more steps, of the CPU unless another clock is given."""
    start = clock()
    one.advance_to(one.step + steps)
    return clock() - start


def against_lammps(number: int, rounds: int, venv: str, given: Path | None, threads: int) -> None:
    """Time for each grain and step of both."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start = (given or folder / "settled.data").absolute()
        x, edge = loose(number)
        if not start.exists():
            write(folder / "loose.data", x, edge)
            runs = f"run {SETTLING}\nwrite_data {start} nocoeff"
            by_lammps(venv, folder, folder / "loose.data", edge, runs)
        x = settled(start)
        one = simulation(x, edge, threads=threads)
        one.advance_to(WARM)
        steps = max(20_000_000 // number, 100)
        mine, theirs = [], []
        for _ in range(rounds):
            spent = by_lammps(venv, folder, start, edge, f"run {WARM}\nrun {steps}", threads)
            theirs.append(spent / steps / number)
            mine.append(timed(one, steps, time.perf_counter) / steps / number)
            print(
                f"  psim {mine[-1] * 1e9:6.1f} ns, LAMMPS {theirs[-1] * 1e9:6.1f} ns, for each grain and step",
                flush=True,
            )
        found = len(contacts_in(one.islands[0].interactions[0].lists)[0])
        print(f"{number} grains, {2 * found / number:.1f} contacts each (those of two chunks twice)")
        ratios = ", ".join(f"{b / a:.2f}" for a, b in sorted(zip(mine, theirs, strict=True), key=ratio_of))
        print(
            f"LAMMPS takes {min(theirs) / min(mine):.2f} times as long, best over best; in single rounds {ratios}"
        )


def ratio_of(pair: tuple[float, float]) -> float:
    """The second over the first."""
    return pair[1] / pair[0]


def against_newton(rounds: int, python: str, given: Path) -> None:
    """CPU time for each grain and step of psim and of Newton's particles, from the same places. Newton has single precision
    alone; psim has its turn in both."""
    x = settled(given)
    number, e_star = len(x), YOUNG / (2 * (1 - POISSON**2))
    edge = loose(number)[1]
    ours = [simulation(x, edge, precision) for precision in PRECISIONS]
    for one in ours:
        one.advance_to(WARM)
    mass = DENSITY * 4 / 3 * np.pi * RADIUS**3
    stiffness = 4 / 3 * e_star * (RADIUS / 2 * 1e-3 * RADIUS) ** 0.5  # at an overlap of a thousandth
    with tempfile.TemporaryDirectory() as folder:
        start = {"x": x[:, [0, 2, 1]], "mass": mass, "radius": RADIUS, "friction": FRICTION}
        peer = Newton(python, "grains", f"{folder}/start.npz", DT, stiffness=stiffness, **start)
        spent = [(*(timed(one, 100) / 100 for one in ours), peer.spent(30) / 30) for _ in range(rounds)]
        peer.close()
    *mine, theirs = (min(each) / number * 1e9 for each in zip(*spent, strict=True))
    for precision, time_of_one in zip(PRECISIONS, mine, strict=True):
        print(
            f"psim ({precision}) {time_of_one:.0f} ns, Newton (single) {theirs:.0f} ns for each grain and step: "
            f"{theirs / time_of_one:.2f} times as long"
        )


def heap(number: int) -> tuple[NDArray[np.float64], float]:
    """Places of grains that psim has let settle [m], and the edge of the box."""
    x, edge = loose(number)
    one = simulation(x, edge)
    one.advance_to(SETTLING)
    return one.states[0].position[:, [0, 2, 1]].astype(float), edge


def mirrored(x: NDArray[np.float64], edge: float, tiles: int) -> NDArray[np.float64]:
    """A heap side by side with its mirror images, so that what pressed against walls presses against its own kind."""
    found = []
    for i in range(tiles):
        for j in range(tiles):
            tile = x.copy()
            for axis, k in ((0, i), (1, j)):
                tile[:, axis] = k * edge + (edge - x[:, axis] if k % 2 else x[:, axis])
            found.append(tile)
    return np.concatenate(found)


def growth(rounds: int, threads: int) -> None:
    """Time for each grain and step of more and more grains, in heaps that are as high and as dense."""
    x, edge = heap(10_000)
    runs = {}
    for tiles in (1, 3, 10):
        one = simulation(mirrored(x, edge, tiles), tiles * edge, threads=threads)
        one.advance_to(WARM)
        runs[tiles] = one
    clock = time.process_time if threads == 1 else time.perf_counter
    spent: dict[int, list[float]] = {tiles: [] for tiles in runs}
    for _ in range(rounds):
        for tiles, one in runs.items():
            spent[tiles].append(timed(one, GROWS, clock) / GROWS / len(x) / tiles**2 * 1e9)
    for tiles, one in runs.items():
        number, found = len(x) * tiles**2, len(contacts_in(one.islands[0].interactions[0].lists)[0])
        print(
            f"{number:8d} grains, {2 * found / number:.1f} contacts each: {min(spent[tiles]):6.1f} ns for each grain "
            f"and step at least, {np.median(spent[tiles]):6.1f} in the median"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--grains", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--lammps", help="a virtual environment that has the package lammps")
    parser.add_argument("--newton", help="a Python that has newton; with --settled")
    parser.add_argument("--settled", type=Path)
    parser.add_argument("--growth", action="store_true")
    parser.add_argument("--threads", type=int, default=1, help="of --growth and --lammps")
    given = parser.parse_args()
    if given.newton and not given.lammps and not (given.settled and given.settled.is_file()):
        parser.error("--newton goes on from --settled FILE, which --lammps writes if it is not there")
    if given.lammps:
        against_lammps(given.grains, given.rounds, given.lammps, given.settled, given.threads)
    if given.newton:
        against_newton(given.rounds, given.newton, given.settled)
    if given.growth:
        growth(given.rounds, given.threads)


if __name__ == "__main__":
    main()
