"""Rigid bodies that fall on a few layers of hard grains between walls: none sinks into them, nothing gains energy.

    python tests/fuzz/fuzz_bodies_on_grains.py [--scenes 40] [--first 0] [--duration 0.4] [--only grains]

Every scene is drawn by its number alone: 1 to 3 bodies of one shape and of 30 to 30 000 kg/m³, 16 to 48 grains in 1 to 3
layers, restitution, friction, steps of 0.2 to 3 ms; with `--only` the grains, or the bodies, of the same scenes. Prints the
scenes that break a rule, and at the end the worst of each rule; exit code 1 if one is broken.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from simulate import table

import particlesim as ps
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.rigid.grains import depths_in
from particlesim.engine.simulation import Simulation

R, SPACING, WALL = 0.01, 0.023, 0.06
"""Radius of the grains, their distance, and half of the width between the walls [m]."""
SHAPES = (
    {"type": "box", "size": [0.06, 0.04, 0.08]},
    {"type": "sphere", "radius": 0.03},
    {"type": "capsule", "radius": 0.02, "length": 0.06},
    {"type": "cylinder", "radius": 0.03, "length": 0.06},
    {
        "type": "clump",
        "parts": [
            {"type": "box", "size": [0.08, 0.02, 0.02]},
            {"type": "sphere", "radius": 0.02, "offset": [0.04, 0, 0]},
        ],
    },
)
GAIN, DEEP = 5e-5, 0.1
"""What a step may add to the energy, as a part of the largest: bodies that have gone too far are put back; how deep a grain
may be in a body at the end, in radii."""

CALM = 1e-5
"""What most scenes gain at most in a step."""


class Worst(NamedTuple):
    """The greatest gain of energy in a step, how deep a grain is in a body at the end, and crossings that were missed."""

    gain: float = 0.0
    depth: float = 0.0
    missed: int = 0


def draw(number: int, duration: float = 0.4) -> tuple[dict[str, Any], str]:
    """A scene by its number, and what it is."""
    rng = np.random.default_rng(number)
    e, friction = float(rng.choice([0.0, 0.3, 0.8])), float(rng.choice([0.0, 0.4]))
    h, shape = float(rng.choice([2e-4, 1e-3, 1e-3, 3e-3])), SHAPES[rng.integers(len(SHAPES))]
    layers, bodies, density = (
        int(rng.integers(1, 4)),
        int(rng.integers(1, 4)),
        float(10 ** rng.uniform(1.5, 4.5)),
    )
    speed = float(rng.choice([0.0, 0.5, 3.0]))
    level = [[(i - 1.5) * SPACING, R + 1e-3, (k - 1.5) * SPACING] for i in range(4) for k in range(4)]
    grains = np.concatenate([np.add(level, (0, j * SPACING, 0)) for j in range(layers)])
    grains += rng.uniform(-1e-3, 1e-3, grains.shape)
    places = [[*rng.uniform(-0.01, 0.01, 2), grains[:, 1].max() + 0.07 + 0.1 * k] for k in range(bodies)]
    law = {"restitution": e, "friction": friction}
    body = {
        "name": "body",
        "shape": shape,
        "density": density,
        "orientation": "random" if rng.random() < 0.7 else {"axis": [0, 0, 1], "angle": 0},
        "layout": {
            "type": "points",
            "position": [[float(x), float(y), float(z)] for x, z, y in places],
            "velocity": [[0.0, -speed, 0.0]] * bodies,
        },
        **law,
    }
    sides = [
        {"point": [-x * WALL, 0, -z * WALL], "normal": [x, 0, z], **law}
        for x, z in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    sand = {
        "name": "sand",
        "radius": R,
        "density": 2600.0,
        "layout": {"type": "points", "position": grains.tolist()},
    }
    scenario = table(
        round(duration / h) * h,
        h,
        seed=number,
        particles=[sand],
        bodies=[body],
        planes=[law, *sides],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "on": ["sand", "body"], "model": "impulse", **law}],
    )
    told = f"{bodies} of {shape['type']}, {density:.0f} kg/m³, {speed:g} m/s, {layers} layers"
    return scenario, f"{number}: {told}, e = {e:g}, mu = {friction:g}, {1e3 * h:g} ms"


def alone(scenario: dict[str, Any], only: str | None) -> dict[str, Any]:
    """A scene with its grains only, or its bodies only."""
    if only == "grains":
        (contact,) = scenario["interactions"]
        kept = {key: value for key, value in scenario.items() if key != "bodies"}
        return {**kept, "interactions": [{**contact, "on": ["sand"]}]}
    if only == "bodies":
        return {key: value for key, value in scenario.items() if key not in ("particles", "interactions")}
    return scenario


def worst_of(scenario: dict[str, Any]) -> Worst:
    """Let a scene go, and look at each step."""
    simulation, gain, most = Simulation(ps.from_table(scenario)), 0.0, 0.0
    try:
        had = energy_of(simulation)
        for step in range(1, simulation.scenario.grid.steps + 1):
            simulation.advance_to(step)
            energy = energy_of(simulation)
            gain, most, had = max(gain, energy - had), max(most, energy), energy
        depth = deepest(simulation)
        return Worst(gain / most, depth, missed_by(scenario))
    finally:
        simulation.close()


def energy_of(simulation: Simulation) -> float:
    """The energy, but for what moving grains apart has given, which is booked [J]."""
    row = simulation.ledger()
    booked = sum(
        each.given
        for island in simulation.islands
        for each in getattr(island, "interactions", ())
        if hasattr(each, "given")
    )
    return float(row["kinetic"] + row["potential.gravity"] - booked)


def deepest(simulation: Simulation) -> float:
    """How deep grains are in bodies, in radii."""
    islands = [each for each in simulation.islands if isinstance(each, RigidIsland)]
    states = [each for each in simulation.states if each.name == "sand"]
    if not (islands and states):
        return 0.0
    (island,), (state,) = islands, states
    depth, which = np.zeros(state.count), np.zeros(state.count, np.int64)
    x, radius = state.x[:, : state.count].astype(float), state.radius[: state.count].astype(float)
    depths_in(island.bodies(), 0, np.ascontiguousarray(x), radius, depth, which)
    return float(depth.max() / R)


def missed_by(scenario: dict[str, Any]) -> int:
    """Missed crossings of a run of the same scene, at a hundred frames."""
    steps = round(scenario["simulation"]["duration"] / scenario["simulation"]["dt"])
    every = max(steps // 100, 1)
    return ps.run(
        ps.from_table(scenario | {"output": scenario["output"] | {"every": every}})
    ).missed_crossings


def broken_rules(found: Worst) -> list[str]:
    """Which rules are broken."""
    rules = {"energy": found.gain > GAIN, "depth": found.depth > DEEP, "crossings": found.missed > 0}
    return [rule for rule, broken in rules.items() if broken]


def main() -> int:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--scenes", type=int, default=40)
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--duration", type=float, default=0.4)
    asked.add_argument("--only", choices=["grains", "bodies"])
    wanted, wrong, calm, worst = asked.parse_args(), 0, 0, Worst()
    for number in range(wanted.first, wanted.first + wanted.scenes):
        scenario, name = draw(number, wanted.duration)
        found = worst_of(alone(scenario, wanted.only))
        worst = Worst(*(max(a, b) for a, b in zip(worst, found, strict=True)))
        if broken_rules(found):
            wrong += 1
            print(f"{name}: {told(found)}", flush=True)
        calm += found.gain <= CALM
    print(f"worst: {told(worst)}; {calm} gain {CALM:g} at most")
    print(f"{wrong} of {wanted.scenes} scenes break a rule")
    return int(wrong > 0)


def told(found: Worst) -> str:
    return f"gain {found.gain:.2g}, depth {found.depth:.2g}, missed {found.missed}"


if __name__ == "__main__":
    raise SystemExit(main())
