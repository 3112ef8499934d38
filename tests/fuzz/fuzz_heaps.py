"""Hard grains in stacks, bowls, funnels, pyramids, tubes, corners, drums and under presses: none comes above the energy that
it began with, and none misses a collider.

    python tests/fuzz/fuzz_heaps.py [--scenes 240] [--first 0] [--steps 400] [--only stack cone]

Every scene is drawn by its number alone: 2 to 30 grains with masses of 1 to 10⁵, any restitution and friction, steps of 0.1
to 5 ms. Grains that have come into each other are moved apart again, which lifts some: what that gives, after what has been
lost before, has a bound. Prints the scenes that break a rule or gain much, and how many gain how much; exit code 1 if a rule
is broken.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from simulate import G, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

Floats = NDArray[np.float64]
R, L = 0.01, 0.1
"""The radius of usual grains, and the size of what holds them [m]."""
METHODS = ("velocity_verlet", "velocity_verlet", "symplectic_euler", "stormer_verlet", "implicit_midpoint")
ABOVE, LIFTED = 1e-5, 0.1
"""How far the energy may come above that of the start, and above the least since then beyond what is fallen in a step:
parts of the largest kinetic one and that of a lift of everything by the radius of a usual grain."""
STEPS = (1e-5, 1e-4, 1e-3)
"""Gains by which scenes are counted."""


class Grains(NamedTuple):
    """Places [n, 3] and velocities [n, 3], radii and masses."""

    x: Floats
    v: Floats
    r: Floats
    m: Floats


class Found(NamedTuple):
    """How far the energy came above that of the start, and above the least since then; how much of that is a fall of
    everything within a step; crossings that were missed."""

    above: float
    lifted: float
    fall: float
    missed: int


def plane(
    normal: tuple[float, float, float], point: tuple[float, float, float] = (0, 0, 0)
) -> dict[str, Any]:
    return {"type": "plane", "normal": list(normal), "point": list(point)}


def poured(rng: np.random.Generator, width: float, lift: float, flat: float, swift: bool) -> Grains:
    """Grains about a place that do not overlap."""
    count = int(rng.integers(3, 30))
    r = R * (rng.uniform(0.5, 1.0, count) if rng.random() < 0.5 else np.ones(count))
    m = 10 ** rng.uniform(-1, 1, count) if rng.random() < 0.4 else (r / R) ** 3
    places: list[Floats] = []
    for _ in range(20000):
        if len(places) == count:
            break
        place = rng.uniform(-width, width, 3) * (1, 1, flat) + (0, lift, 0)
        if all(np.linalg.norm(place - other) > r[len(places)] + r[k] for k, other in enumerate(places)):
            places.append(place)
    count = len(places)
    v = rng.normal(size=(count, 3)) * 10 ** rng.uniform(-1, 2.5 if swift else 0.5)
    return Grains(np.array(places), v, r[:count], m[:count])


def stack(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    count = int(rng.integers(2, 9))
    r, m = R * rng.uniform(0.4, 1.6, count), 10 ** rng.uniform(-2, 2, count)
    gaps = r * rng.choice([0, 1e-6, 1e-3], count)
    x = np.zeros((count, 3))
    x[:, 1] = 2 * np.cumsum(r) - r + np.cumsum(gaps) - gaps
    x[:, 0] = rng.uniform(-1e-4, 1e-4, count) * rng.integers(0, 2)
    return Grains(x, np.zeros_like(x), r, m), [plane((0, 1, 0))]


def press(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    """A heavy one that falls on light ones."""
    count, small = int(rng.integers(1, 5)), R * float(rng.uniform(0.3, 1.5))
    x = np.array([[2.02 * small * k, small, 0.0] for k in range(count)] + [[0.0, 0.0, 0.0]])
    x[-1] = *rng.uniform(-small, small, 1), 2 * small + 2.0001 * R + rng.uniform(0, 0.05), 0.0
    v = np.zeros_like(x)
    v[-1, 1] = -rng.uniform(0, 3)
    r, m = np.full(count + 1, small), np.ones(count + 1)
    r[-1], m[-1] = 2 * R, 10 ** rng.uniform(0, 5)
    return Grains(x, v, r, m), [plane((0, 1, 0))]


def bowl(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    shape: dict[str, Any] = {"type": "sphere", "radius": L, "inside": True}
    if rng.random() < 0.5:
        block = {"type": "box", "center": [0, -L / 2, 0], "size": [2.5 * L, 1.2 * L, 2.5 * L]}
        shape = {"type": "difference", "of": [block, {"type": "sphere", "radius": L}]}
    return poured(rng, 0.045, -0.01, 1.0, False), [shape]


def cone(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    wide = L * float(rng.uniform(0.9, 1.5))
    shape = {"type": "cone", "start": [0, L, 0], "end": [0, -L, 0], "radius": wide, "inside": True}
    return poured(rng, 0.025, 0.05, 1.0, False), [shape]


def wedge(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    slope = float(rng.uniform(0.3, 1.2))
    sides = [plane((s * math.cos(slope), math.sin(slope), 0), (0, -L / 2, 0)) for s in (-1, 1)]
    ends = [plane((0, 0, s), (0, 0, -0.05 * s)) for s in (-1, 1)]
    return poured(rng, 0.02, 0.08, 1.0, False), sides + ends


def pyramid(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    sides, slope = int(rng.integers(3, 8)), float(rng.uniform(0.3, 1.2))
    around = 2 * np.pi * np.arange(sides) / sides + rng.uniform(0, 1)
    normals = [
        (math.cos(slope) * math.cos(a), math.sin(slope), math.cos(slope) * math.sin(a)) for a in around
    ]
    return poured(rng, 0.02, 0.12, 1.0, False), [plane(n, (0, -L / 2, 0)) for n in normals]


def corner(rng: np.random.Generator, swift: bool = False) -> tuple[Grains, list[dict[str, Any]]]:
    box: dict[str, Any] = {
        "type": "box",
        "size": [2 * L, 2 * L, 2 * L * float(rng.uniform(0.5, 1))],
        "inside": True,
    }
    if rng.random() < 0.5:
        box["orientation"] = {"axis": rng.normal(size=3).tolist(), "angle": float(rng.uniform(0, 90))}
    return poured(rng, 0.035, 0.0, 0.5, swift), [box]


def swift(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    return corner(rng, swift=True)


def drum(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    shape = {"type": "cylinder", "start": [0, 0, -0.05], "end": [0, 0, 0.05], "radius": L, "inside": True}
    return poured(rng, 0.045, 0.0, 0.6, False), [shape]


def tube(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    """A row of them in a tube that is hardly wider."""
    count, wide = int(rng.integers(2, 10)), R * float(1 + 10 ** rng.uniform(-3, -0.5))
    x = np.array([[0.0, R * (1.01 + 2.02 * k), 0.0] for k in range(count)])
    x[:, ::2] += rng.uniform(-0.5, 0.5, (count, 2)) * (wide - R)
    shape = {"type": "cylinder", "start": [0, 0, 0], "end": [0, 1, 0], "radius": wide, "inside": True}
    return Grains(x, np.zeros_like(x), np.full(count, R), 10 ** rng.uniform(-1, 1, count)), [shape]


def hollow(rng: np.random.Generator) -> tuple[Grains, list[dict[str, Any]]]:
    """What a solid leaves of one that is larger by up to 1 cm, down to 1 µm."""
    wall, kind = float(10 ** rng.uniform(-6, -2)), rng.choice(["sphere", "cylinder", "box"])

    def solid(more: float) -> dict[str, Any]:
        if kind == "box":
            return {"type": "box", "size": [2 * (L + more)] * 3}
        if kind == "sphere":
            return {"type": "sphere", "radius": L + more}
        return {"type": "cylinder", "start": [0, -L - more, 0], "end": [0, L + more, 0], "radius": L + more}

    return poured(rng, 0.045, 0.0, 1.0, False), [{"type": "difference", "of": [solid(wall), solid(0)]}]


KINDS = {
    each.__name__: each
    for each in (stack, press, bowl, cone, wedge, pyramid, corner, swift, drum, tube, hollow)
}


def draw(number: int, steps: int = 400) -> tuple[dict[str, Any], str]:
    """A scene by its number, and what it is."""
    rng = np.random.default_rng(number)
    kind = str(rng.choice(list(KINDS)))
    law: dict[str, Any] = {
        "restitution": float(rng.choice([0, 0.3, 0.6, 0.9, 1])),
        "friction": float(rng.choice([0, 0, 0.2, 0.5, 1])),
    }
    wall = {
        "restitution": float(rng.choice([0, 0.3, 0.6, 0.9, 1])),
        "friction": float(rng.choice([0, 0, 0.2, 0.5, 1])),
    }
    h, method = float(10 ** rng.uniform(-4, -2.3)), str(rng.choice(METHODS))
    grains, colliders = KINDS[kind](rng)
    scenario = table(
        steps * h,
        h,
        method,
        particles=[
            {
                "name": "grains",
                "radius": grains.r.tolist(),
                "mass": grains.m.tolist(),
                "layout": {"type": "points", "position": grains.x.tolist(), "velocity": grains.v.tolist()},
            }
        ],
        colliders=[{**each, **wall} for each in colliders],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "model": "impulse", **law}],
    )
    told = f"{len(grains.r)} grains, {law} at {wall}, {method}, {1e3 * h:.3g} ms"
    return scenario, f"{number} {kind}: {told}"


def found_in(scenario: dict[str, Any]) -> Found:
    """Let a scene go, and look at each step. Of the symplectic Euler method the energy is that which it keeps in flight: its
    velocities are those of half a step before."""
    simulation, rows = Simulation(ps.from_table(scenario)), []
    try:
        for step in range(simulation.scenario.grid.steps + 1):
            simulation.advance_to(step)
            row = simulation.ledger()
            rows.append([row["kinetic"], row["potential.gravity"], row["momentum.y"]])
        missed = simulation.missed_crossings()
    finally:
        simulation.close()
    kinetic, potential, momentum = np.array(rows).T
    h, weight = scenario["simulation"]["dt"], G * sum(scenario["particles"][0]["mass"])
    late = 0.5 * G * h if scenario["simulation"]["integrator"] == "symplectic_euler" else 0
    energy, scale = kinetic + potential - late * momentum, kinetic.max() + weight * R
    lifted = (energy - np.minimum.accumulate(energy)).max()
    fall = weight * G * h * h / 2
    return Found((energy.max() - energy[0]) / scale, lifted / scale, fall / scale, missed)


def broken_rules(found: Found) -> list[str]:
    """Which rules are broken."""
    rules = {
        "start": found.above > ABOVE,
        "lifts": found.lifted > LIFTED + found.fall,
        "crossings": found.missed > 0,
    }
    return [rule for rule, broken in rules.items() if broken]


def main() -> int:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--scenes", type=int, default=240)
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--steps", type=int, default=400)
    asked.add_argument("--only", nargs="+", choices=list(KINDS))
    wanted, wrong, all_found = asked.parse_args(), 0, []
    for number in range(wanted.first, wanted.first + wanted.scenes):
        scenario, name = draw(number, wanted.steps)
        if wanted.only and name.split()[1].rstrip(":") not in wanted.only:
            continue
        found = found_in(scenario)
        all_found.append(found)
        rules = broken_rules(found)
        wrong += bool(rules)
        if rules or found.lifted > STEPS[1]:
            print(
                f"{'BROKEN ' if rules else ''}{name}: above {found.above:.2g}, lifted {found.lifted:.2g}",
                flush=True,
            )
    lifts, above = np.array([each.lifted for each in all_found]), max(each.above for each in all_found)
    counts = ", ".join(f"{np.count_nonzero(lifts > most)} more than {most:g}" for most in STEPS)
    print(f"above the start {above:.2g} at most; lifted {lifts.max():.2g} at most, {counts}")
    print(f"{wrong} of {len(all_found)} scenes break a rule")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
