"""Clouds of swift hard grains between colliders: none ends a step in another one or in a wall, none gains energy.

    python tests/fuzz/fuzz_swift_grains.py [--clouds 100] [--first 0] [--only box] [--restitution 0] [--steps 6]

Every cloud is drawn by its number alone: grains of mixed radii in a scene (a box of planes, the inside of a sphere, a box
with a pillar, a box about a rigid body), speeds of 0.1 to 10⁴ m/s, restitution, friction,
gravity. Prints the clouds that break a rule, and at the end the worst of each rule by scene; exit code 1 if one is broken.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from simulate import points, table

import particlesim as ps
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.rigid.rotation import matrix
from particlesim.engine.simulation import Simulation

Floats = NDArray[np.float64]
RESTITUTIONS = (0.0, 0.3, 0.8, 1.0)
SCENES = ("box", "sphere", "floor", "body")
G = 9.81
DEEP = 0.51
"""Overlap at the end of a step, as a part of the sum of radii, up to which two are slow: what moves by less than half of
the sum of their radii relative to each other is left to the end of the step."""

TURN = 0.3
"""Angle by which the rigid body turns in a step from which on its sides are not where chords of its way have them."""
SUNK = 0.5
"""How deep a centre may be in the body, over its radius: where a method ends after one rebound off a wall is its own."""
GAIN = 1e-5
"""What a step may add to the energy, as a part of it: what slow contacts book is not exact."""


class Cloud(NamedTuple):
    """A scenario, its scene, radii and masses of the grains, whether there is gravity and they turn, and how it is named."""

    scenario: dict[str, Any]
    scene: str
    r: Floats
    m: Floats
    falls: bool
    turns: bool
    name: str


def draw(
    number: int, only: str | None = None, e: float | None = None, n: int = 40, method: str = "velocity_verlet"
) -> Cloud:
    """A cloud by its number."""
    rng = np.random.default_rng(number)
    scene = only or SCENES[rng.integers(len(SCENES))]
    some = RESTITUTIONS[rng.integers(len(RESTITUTIONS))]
    e = some if e is None else e
    r, x = rng.uniform(0.02, 0.06, n), np.empty((0, 3))
    while len(x) < n:
        y, own = rng.uniform(-0.5, 0.5, 3), 1.01 * r[len(x)]
        free = (np.linalg.norm(x - y, axis=1) > 1.001 * (r[: len(x)] + r[len(x)])).all()
        if free and np.abs(y).max() < 0.5 - own and inside(scene, y) > own:
            x = np.vstack([x, y])
    speed, dt = 10.0 ** rng.uniform(-1, 4), 10.0 ** rng.uniform(-3, -1.3)
    v = speed * rng.normal(size=(n, 3))
    if rng.integers(2):  # some are slow
        v *= 10.0 ** rng.uniform(-3, 0, (n, 1))
    falls, turns = bool(rng.integers(2)), bool(rng.integers(2))
    m = 2500 * 4 / 3 * np.pi * r**3
    balls = points(*map(tuple, x), velocity=v.tolist(), mass=m.tolist(), radius=r.tolist(), name="balls")
    rubs = {"friction": 0.4} if turns else {}
    law = {"type": "contact", "model": "impulse", "restitution": e, **rubs}
    parts: dict[str, Any] = {
        "particles": [balls],
        "colliders": [{**each, "restitution": e, **rubs} for each in walls_of(scene)],
        "interactions": [law],
    }
    if falls:
        parts["forces"] = [{"type": "gravity", "acceleration": [0.0, -G, 0.0], "on": ["balls"]}]
    if scene == "body":
        box, density = {"type": "box", "size": [0.2, 0.2, 0.2]}, 2500 * 10.0 ** rng.uniform(0, 3)
        parts["bodies"] = [
            {"name": "block", "shape": box, "density": density, "position": [0.0, 0.0, 0.0], "restitution": e}
        ]
        law["between"] = ["balls", "block"]
        parts["interactions"].append(
            {"type": "contact", "model": "impulse", "restitution": e, "on": ["balls"], **rubs}
        )
    name = f"{number} {scene} e={e} {speed:.3g} m/s, {dt:.3g} s{' g' * falls}{' friction' * turns}"
    return Cloud(table(100 * dt, dt, method, **parts), scene, r, m, falls, turns, name)


def walls_of(scene: str) -> list[dict[str, Any]]:
    if scene == "sphere":
        return [{"type": "sphere", "center": [0, 0, 0], "radius": 0.8, "inside": True}]
    found = [
        {
            "type": "plane",
            "normal": np.roll([-2.0 * s, 0, 0], k).tolist(),
            "point": np.roll([s, 0, 0], k).tolist(),
        }
        for k in range(3)
        for s in (-0.5, 0.5)
    ]
    if scene == "floor":
        found.append({"type": "cylinder", "start": [0, -0.6, 0], "end": [0, 0.1, 0], "radius": 0.1})
    return found


def inside(scene: str, x: Floats) -> Any:
    """How far places are from the nearest collider [m]."""
    if scene == "sphere":
        return 0.8 - np.linalg.norm(x, axis=-1)
    gap = 0.5 - np.abs(x).max(axis=-1)
    if scene == "floor":
        out, over = np.hypot(x[..., 0], x[..., 2]) - 0.1, x[..., 1] - 0.1
        away = np.where((out > 0) & (over > 0), np.hypot(out, over), np.maximum(out, over))
        gap = np.minimum(gap, away)
    if scene == "body":
        gap = np.minimum(gap, np.abs(x).max(axis=-1) - 0.1)  # at the start
    return gap


def away_from_block(simulation: Simulation, x: Floats) -> Floats:
    """How far places are from the rigid body [m]."""
    block = simulation.states[1]
    r = np.array(matrix(tuple(block.turn[:, 0]))).reshape(3, 3)
    own = np.abs((x - block.x[:, 0]) @ r) - 0.1
    outside = np.linalg.norm(np.maximum(own, 0), axis=1)
    return np.asarray(np.where(outside > 0, outside, own.max(axis=1)))


def turn_of(simulation: Simulation) -> float:
    """How far the rigid body turns in a step, 0 where there is none."""
    turning = [each.turning() for each in simulation.islands if isinstance(each, RigidIsland)]
    return float(np.linalg.norm(turning[0])) * simulation.grid.dt if turning else 0.0


class Worst(NamedTuple):
    """Overlap over the sum of radii, depth in a collider over the radius, what energy a step has added beyond what is
    booked, as a part of the energy, how deep a centre was in the body over its radius, and how often one stayed."""

    overlap: float = 0.0
    depth: float = 0.0
    gain: float = 0.0
    sunk: float = 0.0
    stayed: int = 0


def worst_of(cloud: Cloud, steps: int) -> Worst:
    """Let a cloud go some steps, and look at the end of each."""
    simulation, found = Simulation(ps.from_table(cloud.scenario)), Worst()
    try:
        had, booked = energy_of(cloud, simulation)
        spun = turn_of(simulation)
        for step in range(1, steps + 1):
            simulation.advance_to(step)
            state = simulation.states[0]
            x = state.x[:, : state.count].T.astype(float)
            apart = np.linalg.norm(x[:, None] - x, axis=2) + 1e3 * np.eye(len(x))
            overlap = (1 - apart / (cloud.r[:, None] + cloud.r)).max()
            depth = ((cloud.r - inside(cloud.scene, x)) / cloud.r).max() if cloud.scene != "body" else 0.0
            sunk, turned, spun = 0.0, spun, turn_of(simulation)
            if cloud.scene == "body" and max(turned, spun) < TURN:
                sunk = float((-away_from_block(simulation, x) / cloud.r).max())
            energy, fed = energy_of(cloud, simulation)
            gain = (energy - had - (fed - booked)) / max(abs(energy), abs(had))
            had, booked = energy, fed
            found = Worst(
                max(found.overlap, overlap),
                max(found.depth, depth),
                max(found.gain, gain),
                max(found.sunk, sunk),
                sum(island.stopped_grains() for island in simulation.islands),
            )
    finally:
        simulation.close()
    return found


def broken_rules(found: Worst) -> list[str]:
    """Which rules are broken."""
    rules = {
        "overlap": found.overlap > DEEP,
        "depth": found.depth > 1e-6,
        "energy": found.gain > GAIN,
        "sunk": found.sunk > SUNK,
    }
    return [rule for rule, broken in rules.items() if broken]


def energy_of(cloud: Cloud, simulation: Simulation) -> tuple[float, float]:
    """The energy of a cloud over the lowest place, and what has been booked so far [J]."""
    row = simulation.ledger()
    total = row["kinetic"] + sum(value for name, value in row.items() if name.startswith("potential."))
    if cloud.falls:
        total += 0.6 * G * cloud.m.sum()
    booked = sum(
        each.given
        for island in simulation.islands
        for each in getattr(island, "interactions", ())
        if hasattr(each, "given")
    )
    return float(total), float(booked)


def main() -> int:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--clouds", type=int, default=100)
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--steps", type=int, default=6)
    asked.add_argument("--only", choices=SCENES)
    asked.add_argument("--restitution", type=float)
    asked.add_argument("--method", default="velocity_verlet")
    asked.add_argument("--grains", type=int, default=40)
    wanted, wrong = asked.parse_args(), 0
    total: dict[str, Worst] = {}
    for number in range(wanted.first, wanted.first + wanted.clouds):
        cloud = draw(number, wanted.only, wanted.restitution, wanted.grains, wanted.method)
        found = worst_of(cloud, wanted.steps)
        known = total.get(cloud.scene, Worst())
        total[cloud.scene] = Worst(*(max(a, b) for a, b in zip(known, found, strict=True)))
        if broken_rules(found):
            wrong += 1
            print(f"{cloud.name}: {told(found)}", flush=True)
    for scene, found in total.items():
        print(f"worst of {scene}: {told(found)}")
    print(f"{wrong} of {wanted.clouds} clouds break a rule")
    return int(wrong > 0)


def told(found: Worst) -> str:
    return (
        f"overlap {found.overlap:.3g}, depth {found.depth:.3g}, sunk {found.sunk:.3g}, gain {found.gain:.3g}, "
        f"stayed {found.stayed}"
    )


if __name__ == "__main__":
    raise SystemExit(main())
