"""Hard grains that colliders throw back: columns come to rest on floors that rebound, and elastic blows keep all energy, in
the step of another impact, against forces, and under several laws, too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, Table, points, table

import particlesim as ps
from particlesim.engine.interactions.hard.turns import SETTLED
from particlesim.engine.simulation import Simulation

R, M, DT = 0.005, 1.0, 1e-3


def column(n: int, e: float, floor: float, gap: float, method: str = "velocity_verlet") -> Table:
    """Grains above each other, with gaps between them, that fall on a floor."""
    places = [(0.0, R + (2 * R + gap) * k + gap, 0.0) for k in range(n)]
    scenario = table(
        3.0,
        DT,
        particles=[points(*places, velocity=[(0.0, 0.0, 0.0)] * n, mass=M, radius=R)],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": e}],
        planes=[{"restitution": floor}],
    )
    scenario["simulation"]["integrator"] = method
    return scenario


@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler"])
@pytest.mark.parametrize(
    ("n", "e", "floor"),
    [(2, 0.7, 0.7), (3, 0.5, 0.5), (5, 0.5, 0.5), (2, 0.0, 0.7), (20, 0.9, 0.9), (20, 0.0, 0.9)],
)
def test_columns_come_to_rest_on_floors_that_rebound(n: int, e: float, floor: float, method: str) -> None:
    # They stay above each other: a fall of at most 0.6 mm a step is far less than a grain. At rest, forces bring about g dt
    # in a step, of which each pair may leave a part.
    simulation = Simulation(ps.from_table(column(n, e, floor, 0.0008, method)), threads=1)
    nearest = np.inf
    for step in range(100, 3001, 100):
        simulation.advance_to(step)
        nearest = min(nearest, float(np.diff(simulation.states[0].x[1]).min()))
    v = simulation.states[0].v
    simulation.close()
    assert nearest > R
    assert np.abs(v).max() < n * SETTLED * G * DT


def energies(scenario: Table, steps: int, every: int) -> np.ndarray:
    """Kinetic and potential energy at times [J]."""
    simulation = Simulation(ps.from_table(scenario), threads=1)
    found = []
    for step in range(0, steps + 1, every):
        simulation.advance_to(step)
        row = simulation.ledger()
        found.append(
            row["kinetic"] + sum(value for name, value in row.items() if name.startswith("potential."))
        )
    simulation.close()
    return np.array(found)


def test_a_grain_that_a_floor_throws_against_another_passes_all_on() -> None:
    # In one step it hits the floor at 1 m/s, comes back by 0.15 of a radius, and hits the other one.
    low, high = (0.0, R + 2e-4, 0.0), (0.0, 3 * R + 5e-4, 0.0)
    scenario = table(
        5 * DT,
        DT,
        particles=[points(low, high, velocity=[(0.0, -1.0, 0.0), (0.0, 0.0, 0.0)], mass=M, radius=R)],
        interactions=[{"type": "contact", "restitution": 1}],
        planes=[{"restitution": 1}],
    )
    v = ps.run(ps.from_table(scenario)).final.velocity[:, 1]
    assert np.abs(v - [0, 1]).max() < 1e-12


@pytest.mark.parametrize("e", [1.0, 0.5])
def test_grains_under_two_laws_hit_as_under_one(e: float) -> None:
    # (1 ± e)/2 of the speed each time; the impulse of one law is no doing of forces for the other.
    groups: list[dict[str, Any]] = []
    for k, name in enumerate("abc"):
        speed = 1.0 if k == 0 else 0.0
        groups.append(points((2 * R * k, 0, 0), velocity=[(speed, 0.0, 0.0)], name=name, mass=M, radius=R))
    laws = [
        {"type": "contact", "restitution": e, "between": [one, other]}
        for one, other in (("a", "b"), ("b", "c"))
    ]
    v = ps.run(ps.from_table(table(20 * DT, DT, particles=groups, interactions=laws))).final.velocity[:, 0]
    first = 0.5 * (1 + e)
    assert v.sum() == pytest.approx(1)
    assert v[2] == pytest.approx(first * first)
    if e == 1:
        assert np.abs(v[:2]).max() < 1e-12
    else:
        # a may have hit b a second time
        assert v[:2].sum() == pytest.approx(1 - first * first)


@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler"])
def test_elastic_grains_below_a_pinned_one_keep_their_energy(method: str) -> None:
    # Against gravity: in the middle of its step it is faster than at its end.
    pinned = points((0, 0.4, 0), name="pin", mass=M, radius=0.05, pinned=True)
    ball = points((0, 0.1, 0), name="ball", velocity=[(0.0, 3.0, 0.0)], mass=M, radius=0.05)
    scenario = table(
        4.0,
        DT,
        particles=[pinned, ball],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": 1}],
        planes=[{"restitution": 1}],
    )
    scenario["simulation"]["integrator"] = method
    energy = energies(scenario, 4000, 500)
    if method == "velocity_verlet":
        assert np.ptp(energy) < 1e-11 * energy[0]
    else:
        assert energy.max() < energy[0] + 0.5 * M * G * 3.0 * DT


def test_two_that_walls_throw_back_and_that_meet_in_one_step_keep_their_energy() -> None:
    # Where impacts were all at the end of the step, what the first wall had thrown back was pushed into the second one,
    # which took 4 % of all.
    places = [(-0.0916, 0.0545, -0.0919), (-0.0915, 0.0692, -0.0839)]
    velocity = [(0.487, -0.275, -2.108), (-1.274, 0.296, -2.158)]
    scenario = table(
        0.01,
        DT,
        particles=[points(*places, velocity=velocity, mass=M, radius=0.008)],
        interactions=[{"type": "contact", "restitution": 1}],
        colliders=[{"type": "box", "inside": True, "size": [0.2, 0.2, 0.2], "restitution": 1}],
    )
    energy = energies(scenario, 10, 1)
    assert np.ptp(energy) < 1e-13 * energy[0]


def test_what_two_walls_throw_back_in_a_step_and_what_hits_it_keep_their_energy() -> None:
    # A step later it has about its first velocity again, at places that are not on its way: that was taken for rest, and the
    # one that it hit met it with a mean velocity. A third of all energy was lost.
    places = [(-0.098, 0.02, 0.271), (0.028, 0.024, -0.152)]
    velocity = [(-0.597, 72.589, 72.463), (-13.291, -22.764, 7.129)]
    scenario = table(
        0.01,
        0.01,
        particles=[
            points(*places, velocity=velocity, mass=[0.051, 0.977], radius=[0.018466528979451512, 0.0165946])
        ],
        forces=[{"type": "gravity"}],
        interactions=[{"type": "contact", "restitution": 1}],
        colliders=[{"type": "box", "inside": True, "size": [0.4, 0.5, 0.6], "restitution": 1}],
    )
    energy = energies(scenario, 1, 1)
    assert np.ptp(energy) < 1e-13 * energy[0]


def test_an_elastic_gas_between_walls_keeps_its_energy() -> None:
    # Walls throw grains back by more than a tenth of their radius in a step, and many hit another one in it.
    rng = np.random.default_rng(2)
    cells = np.stack(np.meshgrid(*[np.arange(6)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    places, velocity = (cells - 2.5) * 0.03, rng.uniform(-2, 2, (216, 3))
    gas = points(*places.tolist(), velocity=velocity.tolist(), mass=M, radius=0.008)
    scenario = table(
        0.5,
        DT,
        particles=[gas],
        interactions=[{"type": "contact", "restitution": 1}],
        colliders=[{"type": "box", "inside": True, "size": [0.2, 0.2, 0.2], "restitution": 1}],
    )
    energy = energies(scenario, 500, 50)
    assert np.ptp(energy) < 1e-11 * energy[0]
