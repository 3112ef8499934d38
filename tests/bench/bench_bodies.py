"""A heap of falling boxes, in psim, MuJoCo and Newton: CPU time for a simulated second, and how deep boxes sink in.

    python tests/bench/bench_bodies.py [--side 10] [--duration 1.5] [--rounds 2] [--dt 2e-3] [--peer-dt 2e-3 4e-3]
        [--solvers CG] [--newton /path/to/python] [--iterations 2 10]

Boxes of 10 × 20 × 40 cm, turned at random, fall from a lattice with `side`³ places onto a plane and on each other. MuJoCo
(pip install mujoco) and Newton's XPBD (by a Python that has it) have the same boxes, masses, frictions and orientations. The
depth is measured by psim's own search for contacts in all, as the mean over moments of the deepest and of the mean of all
contacts that overlap. Each runs in turn, on one thread, several rounds; the best of each counts.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from typing import Any

import numpy as np
from newton_peer import Newton

import particlesim as ps
from particlesim.engine.simulation import Simulation

SIZE = (0.1, 0.2, 0.4)
SPACING = 0.46
DENSITY = 1000.0
FRICTION = 0.5
LOOKS = 20
"""Moments at which depths are measured, over the second half."""


def scene(side: int, dt: float, duration: float) -> ps.Scenario:
    """The heap."""
    counts = [side, side, side]
    table: dict[str, Any] = {
        "simulation": {"duration": duration, "dt": dt, "seed": 1},
        "output": {"interval": duration / (2 * LOOKS), "ledger": False},
        "bodies": [
            {
                "name": "boxes",
                "shape": {"type": "box", "size": list(SIZE)},
                "density": DENSITY,
                "friction": FRICTION,
                "orientation": "random",
                "layout": {
                    "type": "lattice",
                    "spacing": SPACING,
                    "counts": counts,
                    "origin": [0, 0.3, 0],
                },
            }
        ],
        "forces": [{"type": "gravity"}],
        "planes": [{"restitution": 0.0, "friction": FRICTION}],
    }
    return ps.from_table(table)


def depths(island: Any) -> tuple[float, float, int]:
    """The deepest overlap, the mean overlap of what overlaps [m], and how many contacts there are."""
    from particlesim.engine.rigid.kernel import look_for_contacts

    k = island._contacts
    look_for_contacts(island._scene, island.bodies(), k, island._motion, island.memory, 0.0)
    gaps = k.gap[: k.number[0]]
    deep = -gaps[gaps < 0]
    return (float(deep.max()), float(deep.mean()), len(deep)) if len(deep) else (0.0, 0.0, 0)


class Ours:
    """psim."""

    def __init__(self, side: int, dt: float, duration: float, threads: int) -> None:
        self.name = f"psim, dt = {dt * 1e3:g} ms" + (f", {threads} threads" if threads > 1 else "")
        self.world = Simulation(scene(side, dt, duration), threads=threads)
        self.island: Any = self.world.islands[0]
        self.frames = 2 * LOOKS
        self.per_frame = duration / self.frames
        self.done, self.steps = 0, round(self.per_frame / dt)

    def frame(self) -> None:
        """Advance to the next frame."""
        self.done += self.steps
        self.world.advance_to(self.done)


class MuJoCo:
    """The same boxes in MuJoCo, with a given solver."""

    def __init__(self, island: Any, dt: float, frames: int, per_frame: float, solver: str) -> None:
        import mujoco

        self.mujoco = mujoco
        b = island.bodies()
        half = " ".join(str(s / 2) for s in SIZE)
        bodies = "".join(
            f'<body pos="{x[0]} {x[1]} {x[2]}" quat="{q[0]} {q[1]} {q[2]} {q[3]}"><freejoint/>'
            f'<geom type="box" size="{half}" density="{DENSITY}" friction="{FRICTION} 0 0"/></body>'
            for x, q in zip(b.x.T, b.turn.T, strict=True)
        )
        xml = f"""<mujoco><option timestep="{dt}" gravity="0 -9.80665 0" solver="{solver}" cone="elliptic"/>
        <size memory="2G"/>
        <worldbody><geom type="plane" size="0 0 1" zaxis="0 1 0" friction="{FRICTION} 0 0"/>{bodies}</worldbody>
        </mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        self.name = f"MuJoCo {mujoco.__version__}, {solver}, dt = {dt * 1e3:g} ms"
        self.steps = round(per_frame / dt)
        self.island = island
        self.count = b.x.shape[1]

    def frame(self) -> None:
        """Advance to the next frame."""
        for _ in range(self.steps):
            self.mujoco.mj_step(self.model, self.data)

    def place(self) -> None:
        """Put the bodies of the island where those of MuJoCo are."""
        b = self.island.bodies()
        q = self.data.qpos.reshape(self.count, 7).T
        b.x[:], b.turn[:] = q[:3], q[3:]


class XPBD:
    """The same boxes in Newton."""

    def __init__(self, python: str, spare: Ours, dt: float, iterations: int, folder: str) -> None:
        b = spare.island.bodies()
        given = {"x": b.x.T, "q": b.turn[[1, 2, 3, 0]].T, "size": SIZE, "density": DENSITY}
        start = f"{folder}/{iterations}-{dt:g}.npz"
        self.peer = Newton(python, "boxes", start, dt, iterations, friction=FRICTION, **given)
        self.name = f"Newton XPBD, {iterations} iterations, dt = {dt * 1e3:g} ms"
        self.steps, self.island, self.spent = round(spare.per_frame / dt), spare.island, 0.0

    def frame(self) -> None:
        """Advance to the next frame."""
        self.spent = self.peer.spent(self.steps)

    def place(self) -> None:
        """Put the bodies of the island where those of Newton are."""
        q, b = self.peer.now(), self.island.bodies()
        b.x[:], b.turn[:] = q[:3], q[[6, 3, 4, 5]]


def main() -> None:
    """Measure, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--side", type=int, default=10)
    parser.add_argument("--duration", type=float, default=1.6)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--dt", type=float, nargs="*", default=[2e-3])
    parser.add_argument("--peer-dt", type=float, nargs="*", default=[2e-3])
    parser.add_argument("--solvers", nargs="*", default=["Newton"])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--newton")
    parser.add_argument("--iterations", type=int, nargs="*", default=[2])
    asked = parser.parse_args()
    best: dict[str, float] = {}
    deep: dict[str, tuple[float, float, float]] = {}
    ps.run(scene(2, 1e-2, 0.1), threads=1)
    for _ in range(asked.rounds):
        folder = tempfile.mkdtemp()
        made: list[Any] = [Ours(asked.side, dt, asked.duration, asked.threads) for dt in asked.dt]
        spare = Ours(asked.side, asked.peer_dt[0] if asked.peer_dt else 1e-3, asked.duration, 1)
        for dt in asked.peer_dt:
            given = (spare.island, dt, spare.frames, spare.per_frame)
            made.extend(MuJoCo(*given, solver) for solver in asked.solvers)
            iterations = asked.iterations if asked.newton else ()
            made.extend(XPBD(asked.newton, spare, dt, number, folder) for number in iterations)
        spent = dict.fromkeys((each.name for each in made), 0.0)
        seen: dict[str, list[tuple[float, float, int]]] = {each.name: [] for each in made}
        for k in range(spare.frames):
            for each in made:
                begin = time.process_time()
                each.frame()
                took = time.process_time() - begin
                spent[each.name] += each.spent if isinstance(each, XPBD) else took
                if 2 * k >= spare.frames:
                    if not isinstance(each, Ours):
                        each.place()
                    seen[each.name].append(depths(each.island))
        for each in made:
            if isinstance(each, XPBD):
                each.peer.close()
        for name, seconds in spent.items():
            best[name] = min(best.get(name, np.inf), seconds / asked.duration)
            deep[name] = tuple(np.mean(seen[name], axis=0))  # type: ignore[assignment]
    print(f"{asked.side**3} boxes, {asked.duration} s; CPU seconds for a simulated second, depths in mm")
    for name, seconds in best.items():
        deepest, mean, number = deep[name]
        depth = f"deepest {1e3 * deepest:7.4f}  mean {1e3 * mean:7.4f}  of {number:.0f}"
        print(f"  {name:40s} {seconds:8.3f}   {depth}")


if __name__ == "__main__":
    main()
