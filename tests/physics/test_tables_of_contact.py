"""Several tables of hard contact: each pair has the law of its own, and what lies is held by all of them together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree
from simulate import G, points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

R = 0.005


def materials(light: dict[str, Any], heavy: dict[str, Any], mixed: dict[str, Any]) -> list[dict[str, Any]]:
    """Tables of contact of glass, of steel, and of both."""
    return [
        {"type": "contact", "on": ["glass"], **light},
        {"type": "contact", "on": ["steel"], **heavy},
        {"type": "contact", "between": ["glass", "steel"], **mixed},
    ]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["double", "single"])
def test_each_pair_rebounds_and_rubs_by_its_own_table(precision: str) -> None:
    # Three pairs of equal spheres, far from each other. Of the approach u the half (1 + e) u goes to the other one, with
    # e = 0.8 (u/v₀)^(−1/4) where restitution falls with speed; and of the sliding v what μ (1 + e) u/2 takes in the third.
    e, u, v, mu = 0.4, 0.6, 1.0, 0.1
    falling = {"value": 0.8, "speed": 0.1, "exponent": 0.25}
    under, above = [(0.5 * k, 0.0, 0.0) for k in range(3)], [(0.5 * k, 2.01 * R, 0.0) for k in range(3)]
    hits, slides, still = (0, -u, 0), (v, -u, 0), (0, 0, 0)
    glass = points(
        under[0], above[0], above[2], velocity=[still, hits, slides], radius=R, mass=1.0, name="glass"
    )
    steel = points(
        under[1], above[1], under[2], velocity=[still, hits, still], radius=R, mass=1.0, name="steel"
    )
    scenario = table(
        2e-3,
        1e-4,
        particles=[glass, steel],
        interactions=materials(
            {"restitution": e}, {"restitution": falling}, {"restitution": 0.9, "friction": mu}
        ),
    )
    scenario["simulation"]["precision"] = precision
    speed = ps.run(ps.from_table(scenario)).final.velocity.astype(float)
    exact = 1e-12 if precision == "double" else 1e-6
    fast = 0.8 * (u / 0.1) ** -0.25
    assert speed[0] == pytest.approx([0, -(1 + e) * u / 2, 0], abs=exact)
    assert speed[1] == pytest.approx([0, -(1 - e) * u / 2, 0], abs=exact)
    assert speed[3] == pytest.approx([0, -(1 + fast) * u / 2, 0], abs=exact)
    assert speed[4] == pytest.approx([0, -(1 - fast) * u / 2, 0], abs=exact)
    # along a normal that turns by v dt/2R in a step
    assert speed[5, 0] == pytest.approx(mu * 1.9 * u / 2, abs=v * v * 1e-4 / (2 * R))
    assert speed[2] + speed[5] == pytest.approx([v, -u, 0], abs=exact)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [5e-4, 1e-3])
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
def test_a_heap_of_two_materials_does_not_sink_into_itself(method: str, dt: float) -> None:
    # Glass under steel, which fall 10 cm into a box. A table at a time they had sunk until they were concentric.
    counts, spacing = (6, 5, 6), 2.05 * R
    half, height = 0.5 * (counts[0] - 1) * spacing, counts[1] * spacing
    layout = {"type": "lattice", "counts": list(counts), "spacing": spacing, "jitter": 1e-4}
    groups = [
        {
            "name": "glass",
            "radius": R,
            "density": 2500.0,
            "layout": {**layout, "origin": [-half, 0.1, -half]},
        },
        {
            "name": "steel",
            "radius": 0.8 * R,
            "density": 8000.0,
            "layout": {**layout, "origin": [-half, 0.1 + height, -half]},
        },
    ]
    wide = 2.6 * (half + R)
    box = {
        "type": "box",
        "center": [0, 0.5, 0],
        "size": [wide, 1, wide],
        "inside": True,
        "restitution": 0.3,
        "friction": 0.3,
    }
    scenario = table(
        0.4,
        dt,
        method,
        particles=groups,
        forces=[{"type": "gravity"}],
        colliders=[box],
        interactions=materials(
            {"restitution": 0.3, "friction": 0.2},
            {"restitution": 0.1, "friction": 0.5},
            {"restitution": 0.6, "friction": 0.1},
        ),
        output={"every": round(0.01 / dt), "ledger": True},
    )
    simulation, deepest = Simulation(ps.from_table(scenario), threads=1), []
    for step in range(0, round(0.4 / dt) + 1, round(0.01 / dt)):
        simulation.advance_to(step)
        deepest.append(deep(simulation))
    speeds = np.concatenate(
        [np.linalg.norm(state.v[:, : state.count], axis=0) for state in simulation.states]
    )
    simulation.close()
    assert max(deepest) < 0.1
    assert deepest[-1] < 10 * G * dt * dt / (0.8 * R)
    assert np.median(speeds) < 0.01  # one or another still rolls


def deep(simulation: Simulation) -> float:
    """The deepest overlap, as a part of the smallest radius."""
    x = np.concatenate([state.position for state in simulation.states])
    r = np.concatenate([state.radius[: state.count] for state in simulation.states])
    pairs = cKDTree(x).query_pairs(2 * r.max(), output_type="ndarray")
    apart = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    return float((r[pairs].sum(axis=1) - apart).max(initial=0.0) / r.min())


def test_a_column_of_two_materials_stands() -> None:
    # Two of glass, two of steel, and so on: each weighs on others by three tables, of which none holds it alone.
    count = 12
    rows = [[k for k in range(count) if k // 2 % 2 == material] for material in range(2)]
    groups = [
        points(*((0, R + 2 * R * k, 0) for k in mine), radius=R, mass=mass, name=name)
        for mine, mass, name in zip(rows, (1.0, 10.0), ("glass", "steel"), strict=True)
    ]
    result = simulate(
        0.4,
        1e-3,
        particles=groups,
        forces=[{"type": "gravity"}],
        colliders=[{"type": "plane", "restitution": 0}],
        interactions=materials({"restitution": 0.2}, {"restitution": 0.5}, {"restitution": 0.0}),
    )
    there = R + 2 * R * np.concatenate(rows)
    # each may lie by a slack of 1e-4 of a radius deeper in the one below, and by two falls of a step
    assert (np.abs(result.final.position[:, 1] - there) <= count * (1e-4 * R + 2 * G * 1e-6)).all()
    assert np.abs(result.final.velocity).max() < 0.01 * G * 1e-3


def test_elastic_tables_keep_energy_and_momentum_beside_others() -> None:
    # A gas of two kinds under three elastic tables, and with it two grains that stick together under a fourth.
    rng = np.random.default_rng(4)
    gas = [
        {
            "name": name,
            "radius": R,
            "mass": mass,
            "layout": {
                "type": "points",
                "position": (4 * R * (np.argwhere(np.ones((4, 8, 8))) + np.array([first, 0, 0]))).tolist(),
                "velocity": rng.normal(0, 0.3, (256, 3)).tolist(),
            },
        }
        for name, mass, first in (("glass", 1.0, 0), ("steel", 3.0, 4))
    ]
    putty = points(
        (9.0, 0, 0), (9.0 + 2.02 * R, 0, 0), velocity=[(1, 0, 0), (0, 0, 0)], radius=R, mass=1.0, name="putty"
    )
    lively = {"restitution": 1.0}
    result = simulate(
        0.3,
        1e-3,
        particles=[*gas, putty],
        interactions=[
            *materials(lively, lively, lively),
            {"type": "contact", "on": ["putty"], "restitution": 0.0},
        ],
        output={"every": 10, "ledger": True},
    )
    kinetic, momentum = result.ledger["kinetic"], result.ledger["momentum.x"]
    assert kinetic[-1] == pytest.approx(kinetic[0] - 0.25, rel=1e-12)
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * np.sqrt(512 * 2 * kinetic[0])
    assert result.final.velocity[-2:, 0] == pytest.approx([0.5, 0.5], abs=1e-12)
