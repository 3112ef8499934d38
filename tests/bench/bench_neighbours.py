"""Neighbour lists and a Lennard-Jones melt, against SciPy's k-d tree, C over the same lists, and LAMMPS.

    python tests/bench/bench_neighbours.py [--edge 30] [--threads 2] [--rounds 3] [--lammps /path/to/venv]

All contenders run in turn, several rounds, in CPU time, which busy machines disturb least; the best of each is compared, and
ratios are what counts. `--lammps` names a virtual environment with the packages lammps and mpich. The melt is the one of
LAMMPS' examples: 4 edge³ atoms, density 0.8442, temperature 3, cutoff 2.5, skin 0.3. LAMMPS builds its lists every 20 steps
without a look, as in its example, or when an atom has moved by half of the skin, as psim does.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import resource
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import particlesim as ps
from particlesim.compiler import kernel
from particlesim.engine.barrier import new_gate
from particlesim.engine.interactions.near_sums import pull_on
from particlesim.engine.interactions.neighbours.record import BUILDS, enlarged, forget, new_neighbours
from particlesim.engine.interactions.neighbours.refresh import Crew, Where, refresh
from particlesim.engine.interactions.neighbours.sort import sort_members
from particlesim.engine.simulation import Simulation

HERE = Path(__file__).resolve().parent
FLAGS = ["-O3", "-march=native", "-ffast-math", "-mprefer-vector-width=512", "-shared", "-fPIC"]
CUTOFF, SKIN, DENSITY, TEMPERATURE, DT = 2.5, 0.3, 0.8442, 3.0, 0.005
INPUT = """units lj
atom_style atomic
lattice fcc {density}
region box block 0 {edge} 0 {edge} 0 {edge}
create_box 1 box
create_atoms 1 box
mass 1 1.0
velocity all create {temperature} 87287 loop geom
pair_style lj/cut {cutoff}
pair_coeff 1 1 1.0 1.0 {cutoff}
neighbor {skin} bin
neigh_modify {modify}
fix 1 all nve
thermo 1000000
run {warm}
run {steps}
"""


@kernel
def bring_up(near: Any, c: Any, crew: Any) -> None:
    """Places and lists."""
    refresh(near, c, crew, 0.0)


@kernel
def sort_only(near: Any, c: Any, crew: Any) -> None:
    """The order of members alone."""
    sort_members(near, c, crew, 0.0)


@kernel
def sum_forces(each: Any, first: Any, last: Any) -> None:
    """Forces on the members of some groups, over lists that are there."""
    for g in range(first, last):
        pull_on(each, g, 0.0)


def together(function: Any, threads: int, *given: Any) -> None:
    """Run a kernel by some threads, the last argument of which is a thread's place in the crew."""
    gate = new_gate()
    team = [
        threading.Thread(target=function, args=(*given, Crew(k, threads, gate))) for k in range(1, threads)
    ]
    for each in team:
        each.start()
    function(*given, Crew(0, threads, gate))
    for each in team:
        each.join()


def cpu_of(work: Any) -> float:
    """CPU seconds of some work, of all threads."""
    start = time.process_time()
    work()
    return time.process_time() - start


def melt(edge: int, threads: int) -> tuple[Simulation, float]:
    """The melt in a periodic box, after its first steps, and the length of the box."""
    spacing = (4 / DENSITY) ** (1 / 3)
    cells = np.stack(np.meshgrid(*[np.arange(edge)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    basis = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    x = spacing * (cells + basis).reshape(-1, 3)
    v = np.random.default_rng(1).normal(0, np.sqrt(TEMPERATURE), x.shape)
    v -= v.mean(axis=0)
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1000.0, "dt": DT, "integrator": "velocity_verlet"},
            "output": {"interval": 1000.0, "ledger": False},
            "particles": [
                {
                    "name": "atoms",
                    "mass": 1.0,
                    "layout": {"type": "points", "position": x.tolist(), "velocity": v.tolist()},
                }
            ],
            "interactions": [
                {
                    "type": "lennard_jones",
                    "epsilon": 1.0,
                    "sigma": 1.0,
                    "cutoff": CUTOFF,
                    "method": "neighbours",
                }
            ],
        }
    )
    simulation = Simulation(scenario, threads=threads)
    island = simulation.islands[0]
    (each,) = island.interactions
    near = new_neighbours(each.near.members, len(x), CUTOFF, SKIN, box=(edge * spacing,) * 3)
    island._lay_out((each._replace(near=near),), None)
    simulation.advance_to(100)
    return simulation, edge * spacing


def lists(simulation: Simulation, length: float, threads: int, rounds: int) -> None:
    """Sort and lists against a k-d tree."""
    island = simulation.islands[0]
    (each,) = island.interactions
    c, n = island.island_columns(), island.island_columns().x.size
    where, near = Where(c.x, c.y, c.z, None, None), enlarged(each.near)
    x = np.mod(np.stack([c.x, c.y, c.z], axis=1), length)
    best = {"sort": np.inf, "lists": np.inf, "tree": np.inf}

    def build() -> None:
        forget(near)
        together(bring_up, threads, near, where)

    def by_tree() -> None:
        cKDTree(x, boxsize=length).query_pairs(CUTOFF + SKIN, output_type="ndarray")

    build()
    together(sort_only, threads, near, where)  # compiled by now
    for _ in range(rounds):
        for name, work in (
            ("sort", lambda: together(sort_only, threads, near, where)),
            ("lists", build),
            ("tree", by_tree),
        ):
            best[name] = min(best[name], cpu_of(work))
    print(f"neighbours, {n} atoms, million particles per second and CPU, and on {threads} of them")
    for name in ("sort", "lists"):
        print(f"  {name:24} {n / best[name] / 1e6:6.1f} {threads * n / best[name] / 1e6:6.1f}")
    print(
        f"  cKDTree.query_pairs     {n / best['tree'] / 1e6:6.2f}   lists {best['tree'] / best['lists']:.0f} x"
    )


def forces(simulation: Simulation, rounds: int, folder: str) -> None:
    """Sums over lists against C."""
    island = simulation.islands[0]
    (each,) = island.interactions
    near, n = each.near, island.island_columns().x.size
    library = Path(folder) / "neighbours.so"
    subprocess.run(["gcc", *FLAGS, str(HERE / "c" / "neighbours.c"), "-o", str(library), "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))
    pull = np.zeros_like(each.pull)
    pointers = [
        ctypes.c_void_p(a.ctypes.data)
        for a in (near.x, near.images, near.begin, near.count, near.candidates, pull)
    ]
    x, images, begin, count, candidates, out = pointers

    def in_c(name: str) -> Any:
        function = getattr(loaded, name)
        numbers = [ctypes.c_double(v) for v in (4.0, 1.0, CUTOFF**2)]
        groups = ctypes.c_long(near.begin.size)
        return lambda: function(
            x, ctypes.c_long(near.x.shape[1]), images, begin, count, candidates, groups, *numbers, out
        )

    contenders = {
        "psim": lambda: sum_forces(each, 0, near.begin.size),
        "C, targets in lanes": in_c("lanes"),
        "C, candidates packed": in_c("packed"),
    }
    best = dict.fromkeys(contenders, np.inf)
    for k in range(rounds + 1):
        for name, work in contenders.items():
            spent = cpu_of(work)
            if name != "psim":
                assert np.abs(pull - each.pull).max() < 1e-9 * np.abs(each.pull).max()
            best[name] = min(best[name], spent) if k else np.inf
    pairs = 8 * near.count.sum()
    print(f"forces over the same lists, {near.count.mean():.0f} candidates, on one CPU")
    for name, spent in best.items():
        print(
            f"  {name:24} {1e9 * spent / n:6.1f} ns, {pairs / spent / 1e9:.2f} G pairs/s, psim {spent / best['psim']:.2f} x"
        )


def by_lammps(
    venv: str, edge: int, steps: int, modify: str, processes: int, folder: str
) -> tuple[float, float]:
    """CPU seconds and wall-clock seconds of steps, all processes together."""
    path = Path(folder) / "in.melt"
    found = []
    for last in (0, steps):
        path.write_text(
            INPUT.format(
                edge=edge,
                density=DENSITY,
                temperature=TEMPERATURE,
                cutoff=CUTOFF,
                skin=SKIN,
                modify=modify,
                warm=100,
                steps=last,
            )
        )
        command = [f"{venv}/bin/lmp", "-sf", "opt", "-in", str(path), "-log", "none", "-screen", "none"]
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([f"{venv}/bin/mpiexec", "-n", str(processes), *command], check=True, cwd=folder)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        found.append((spent, time.perf_counter() - start))
    return found[1][0] - found[0][0], found[1][1] - found[0][1]


def steps(
    simulation: Simulation, edge: int, rounds: int, lammps: str | None, threads: int, folder: str
) -> None:
    """Whole steps against LAMMPS."""
    near, n, number = simulation.islands[0].interactions[0].near, 4 * edge**3, 100
    rates: dict[str, list[tuple[float, float]]] = {}

    def take(name: str, cpu: float, wall: float) -> None:
        rates.setdefault(name, []).append((n * number / cpu / 1e6, n * number / wall / 1e6))

    before = near.report[BUILDS]
    for _ in range(rounds):
        start, wall = time.process_time(), time.perf_counter()
        simulation.advance_to(simulation.step + number)
        take("psim", time.process_time() - start, time.perf_counter() - wall)
        if lammps:
            for name, modify in (
                ("every 20", "every 20 delay 0 check no"),
                ("checked", "every 1 delay 0 check yes"),
            ):
                take(f"LAMMPS, {name}", *by_lammps(lammps, edge, number, modify, threads, folder))
    built = (near.report[BUILDS] - before) / rounds
    print(
        f"whole steps, {n} atoms, {threads} threads or processes; psim built lists {built:.0f} times in {number} steps"
    )
    best = {name: np.max(found, axis=0) for name, found in rates.items()}
    for name, (cpu, wall) in best.items():
        ratios = (
            f"psim {best['psim'][0] / cpu:.2f} x by CPU time, {best['psim'][1] / wall:.2f} x by the clock"
        )
        print(f"  {name:24} {cpu:6.2f} M particle-steps per CPU second, {wall:6.2f} by the clock; {ratios}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--edge", type=int, default=30)
    parser.add_argument("--threads", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--lammps")
    given = parser.parse_args()
    simulation, length = melt(given.edge, given.threads)
    with tempfile.TemporaryDirectory() as folder:
        lists(simulation, length, given.threads, given.rounds)
        forces(simulation, given.rounds, folder)
        steps(simulation, given.edge, given.rounds, given.lammps, given.threads, folder)
    simulation.close()


if __name__ == "__main__":
    main()
