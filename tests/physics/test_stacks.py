"""Heavy bodies on light ones: what presses is found whatever the masses, and no energy comes from nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, energies, table

import particlesim as ps
from particlesim.engine.islands.rigid import RigidIsland
from particlesim.engine.rigid.bodies import WORLD
from particlesim.engine.rigid.sweeps import ROUNDING, SETTLED
from particlesim.engine.simulation import Simulation
from particlesim.preflight.advice import advice

SIDE = 0.2
GRAVITY = [{"type": "gravity"}]
STEP = 2e-3


def box(
    name: str, mass: float, at: tuple[float, float, float], size: Any = (SIDE,) * 3, **other: Any
) -> dict[str, Any]:
    shape = {"type": "box", "size": list(size)}
    return {"name": name, "mass": mass, "shape": shape, "position": list(at), **other}


def floor(friction: float = 0.5, restitution: float = 0.0) -> dict[str, Any]:
    return {"normal": [0, 1, 0], "friction": friction, "restitution": restitution}


def scene(bodies: list[dict[str, Any]], duration: float, **other: Any) -> dict[str, Any]:
    output = {"every": 1, "ledger": True}
    parts = {"forces": GRAVITY, "planes": [floor()], "output": output} | other
    return table(duration, STEP, bodies=bodies, **parts)


def stack(masses: list[float]) -> list[dict[str, Any]]:
    """Boxes on each other, from below."""
    return [box(f"b{k}", mass, (0, SIDE * (k + 0.5), 0)) for k, mass in enumerate(masses)]


STACKS = [
    [1, 1e3],
    [1, 1e6],
    [1e6, 1],
    [1, 1e4, 1, 1e4],
    [1e-3, 1, 1e3],
    [1e3, 1, 1e-3],
    [2.0**k for k in range(10)],
]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("mass", [1e3, 1e4])
def test_a_heavy_block_on_a_hinge_rests_on_a_light_one(mass: float) -> None:
    # what the hinge holds friction may hold, too: the direct method circled about that, and the block gained energy
    bodies = [box("light", 1, (0, 0.1, 0), friction=0.3), box("heavy", mass, (0, 0.3, 0), friction=0.3)]
    hinge = {"type": "hinge", "between": ["heavy", "world"], "axis": [0, 0, 1], "anchor": [0.3, 0.3, 0]}
    scenario = scene(bodies, 0.1, joints=[hinge], planes=[floor(0.3)])
    scenario["simulation"]["dt"] = 5e-4
    total, result = energies(scenario), ps.run(ps.from_table(scenario))
    assert (total - total[0]).max() <= 1e-12 * mass * G * 0.3
    assert np.abs(result.final.velocity).max() < 1e-9


@pytest.mark.parametrize("masses", STACKS, ids=lambda masses: "-".join(f"{mass:g}" for mass in masses))
def test_stacks_stand_whatever_the_masses(masses: list[float]) -> None:
    duration = 0.4
    world = Simulation(ps.from_table(scene(stack(masses), duration)), threads=1)
    steps = round(duration / STEP)
    for step in range(steps):
        world.advance_to(step + 1)
        # Speeds are found up to this part of what gravity gives in a step; so a body moves by less than that in all.
        part = max(SETTLED, ROUNDING * max(masses) / min(masses))
        moved = [
            abs(state.position - body["position"]).max()
            for state, body in zip(world.states, stack(masses), strict=True)
        ]
        assert max(moved) < (step + 1) * STEP * part * G * STEP
    # The impulses at every height are the weight above it, to as many digits.
    island = world.islands[0]
    assert isinstance(island, RigidIsland)
    k = island._contacts
    n = k.number[0]
    for height in range(len(masses)):
        below = WORLD if height == 0 else height - 1
        pairs = np.sort(np.array([k.first[:n], k.second[:n]]), axis=0)
        here = (pairs[0] == below) & (pairs[1] == height)
        weight = sum(masses[height:]) * G * STEP
        assert k.impulse[:n, 0][here].sum() == pytest.approx(weight, rel=1e-8)


@pytest.mark.slow
def test_a_heavy_box_stands_on_a_pyramid() -> None:
    light = [
        box(f"a{row}_{k}", 1.0, (0.2 * k + 0.1 * row, 0.1 + 0.2 * row, 0))
        for row in range(3)
        for k in range(3 - row)
    ]
    bodies = [*light, box("heavy", 1e6, (0.2, 0.7, 0))]
    world = Simulation(ps.from_table(scene(bodies, 0.4)), threads=1)
    world.advance_to(200)
    moved = [abs(s.position - body["position"]).max() for s, body in zip(world.states, bodies, strict=True)]
    # A step in which impulses are not found, as there are some, lets it sink by up to g h² = 4e-5 m. It falls through all
    # of them, and is 1.6 m away, by sweeps alone.
    assert max(moved) < 25 * G * STEP**2


FALLS: dict[str, list[dict[str, Any]]] = {
    "balls": [
        {"name": "a", "mass": 1.0, "shape": {"type": "sphere", "radius": 0.1}, "position": [0, 0.15, 0]},
        {"name": "b", "mass": 1e6, "shape": {"type": "sphere", "radius": 0.1}, "position": [0, 0.36, 0]},
    ],
    "flat": [box("a", 1.0, (0, 0.1, 0)), box("b", 1e6, (0, 0.4, 0))],
    "on an edge": [
        box("a", 1.0, (0, 0.1, 0)),
        box("b", 1e6, (0.03, 0.4, 0.02), orientation={"axis": [0.3, 0.1, 1], "angle": 20}),
    ],
    "off the side": [box("a", 1.0, (0, 0.1, 0)), box("b", 1e6, (0.12, 0.3, 0))],
    "sliding": [
        *(box(f"a{k}", 1.0, (0.3 * k, 0.1, 0), friction=0.3) for k in range(3)),
        box("b", 1e6, (0.2, 0.25, 0), (1.2, 0.1, 0.2), velocity=[0.5, 0, 0], friction=0.3),
    ],
}


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("name", FALLS)
def test_heavy_bodies_on_light_ones_gain_no_energy(name: str, restitution: float) -> None:
    bodies = [body | {"restitution": restitution} for body in FALLS[name]]
    energy = energies(scene(bodies, 0.5, planes=[floor(restitution=restitution)]))
    # What turns on an edge leaves its circle by (ω h)²/8 of the arm in a step, and is put back: 3 rad/s, 0.1 m, 4e-6 of
    # a height of 0.4 m. What overlaps is lifted by less than the slop, 2e-5 m. Sweeps alone gain 5 per cent in a step.
    assert np.diff(energy).max() < 1e-4 * energy[0]
    assert energy.max() < (1 + 1e-5) * energy[0]


@pytest.mark.slow
def test_a_tower_that_is_too_high_gains_no_energy_either() -> None:
    # More bodies than are solved for together: what sweeps have come to gives nothing.
    bodies = stack([1.0] * 35 + [1e6])
    energy = energies(scene(bodies, 0.3))
    assert np.diff(energy).max() < 1e-8 * energy[0]  # 2e-6 by sweeps alone


def test_a_heavy_slab_slides_on_light_boxes_as_far_as_friction_lets_it() -> None:
    # v²/(2 μ g), while the boxes, which the ground holds better, stay where they are.
    mu, v, mass = 0.3, 0.5, 1e3
    bodies = [box(f"a{k}", 1.0, (0.3 * k, 0.1, 0), friction=mu) for k in range(3)]
    bodies.append(box("slab", mass, (0.2, 0.25, 0), (1.2, 0.1, 0.2), velocity=[v, 0, 0], friction=mu))
    world = Simulation(ps.from_table(scene(bodies, 0.4, planes=[floor(0.8)])), threads=1)
    world.advance_to(200)
    slid = [(s.position - body["position"])[0, 0] for s, body in zip(world.states, bodies, strict=True)]
    # The step in which it stops: within v h, and of its last step only.
    assert slid[3] == pytest.approx(v * v / (2 * mu * G), abs=mu * G * STEP**2)
    assert np.abs(slid[:3]).max() < 1e-5


def test_too_many_bodies_under_a_heavy_one_are_told() -> None:
    light = {
        "name": "light",
        "mass": 1.0,
        "shape": {"type": "box", "size": [SIDE] * 3},
        "layout": {"type": "lattice", "spacing": SIDE, "counts": [1, 40, 1], "origin": [0, SIDE / 2, 0]},
    }
    parts = {"duration": 1.0, "dt": STEP, "forces": GRAVITY}
    heavy = box("heavy", 1e6, (0, 41 * SIDE, 0))
    told = advice(ps.from_table(table(**parts, bodies=[light, heavy])))
    assert any("'heavy' have 1e+06 times the mass of 'light' (1e+06 kg, 1 kg)" in text for text in told)
    for others in ([light, heavy | {"mass": 100.0}], stack([1, 1e6])):
        assert not advice(ps.from_table(table(**parts, bodies=others)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "floor",
    [
        {"type": "plane"},
        pytest.param({"type": "box", "size": [10, 1, 10], "center": [0, -0.5, 0]}, marks=pytest.mark.slow),
    ],
)
def test_ten_cylinders_on_end_come_to_rest(floor: dict[str, Any]) -> None:
    # A face of a floor that is far larger than they are stays the one that contacts lie on, however little they lean.
    law = {"restitution": 0.0, "friction": 0.5}
    stack = {
        "name": "stack",
        "shape": {"type": "cylinder", "radius": 0.05, "length": 0.1},
        "orientation": {"axis": [1, 0, 0], "angle": 90},
        "layout": {"type": "points", "position": [[0, 0.05 + 0.1 * k, 0] for k in range(10)]},
        **law,
    }
    parts = {"bodies": [stack], "colliders": [{**floor, **law}], "forces": [{"type": "gravity"}]}
    world = Simulation(ps.from_table(table(2.5, 2e-3, **parts)), threads=1)
    start = world.states[0].position.copy()
    world.advance_to(1_250)
    assert np.abs(world.states[0].position - start).max() < 2e-3
    assert np.abs(world.states[0].velocity).max() < 1e-6
    world.close()
