"""Restitution of rigid bodies that falls with the speed of the impact: on colliders, on each other, with grains, of swift
bodies, and without a gain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, Table, points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

SHAPES = {"ball": {"type": "sphere", "radius": 0.1}, "box": {"type": "box", "size": [0.2, 0.2, 0.2]}}
SOFT = {"value": 0.8, "speed": 0.5}
HARD = {"value": 0.9, "speed": 2.0, "exponent": 0.5}
SPEEDS = (0.4, 0.5, 1.3, 7.0)
DT = 1e-3


def law(falls: dict[str, float], speed: float) -> float:
    """e = value up to `speed`, value (v/speed)^(−exponent) above."""
    return float(falls["value"] * max(speed / falls["speed"], 1) ** -falls.get("exponent", 0.25))


def body(name: str, x: float, shape: str = "ball", **more: Any) -> Table:
    return {"name": name, "shape": SHAPES[shape], "mass": 2.0, "friction": 0.0, "position": [x, 0, 0], **more}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("way", [1.0, 400.0], ids=["slow", "swift"])
def test_bodies_rebound_from_colliders_by_the_law_of_these(shape: str, way: float) -> None:
    # the own restitution counts between bodies only; swift ones come 0.4 m and more in a step
    falls = SOFT | {"speed": way * SOFT["speed"]}
    for speed in SPEEDS:
        v = way * speed
        (u,) = simulate(
            round(0.2 / v / DT + 40) * DT,
            DT,
            bodies=[body("it", 0, shape, velocity=[-v, 0, 0], restitution=HARD)],
            planes=[{"point": [-0.3, 0, 0], "normal": [1, 0, 0], "restitution": falls}],
        ).final.velocity[:, 0]
        assert u == pytest.approx(law(falls, v) * v, rel=1e-9)


@pytest.mark.parametrize("way", [1.0, 400.0], ids=["slow", "swift"])
def test_of_two_bodies_the_smaller_restitution_counts_at_the_speed_of_their_impact(way: float) -> None:
    # at 0.4 m/s that is SOFT with 0.8, from 26.2 m/s on HARD, whose exponent is larger; a number is one for all speeds
    soft, hard = (each | {"speed": way * each["speed"]} for each in (SOFT, HARD))
    for other in (hard, 0.6):
        for speed in (*SPEEDS, 40.0):
            v = way * speed
            mine = law(soft, v), other if isinstance(other, float) else law(other, v)
            found = simulate(
                round(0.1 / v / DT + 40) * DT,
                DT,
                bodies=[
                    body("one", -0.15, velocity=[v / 2, 0, 0], restitution=soft),
                    body("two", 0.15, velocity=[-v / 2, 0, 0], restitution=other),
                ],
            ).final
            u = found.velocity[1, 0] - found.velocity[0, 0]
            assert u == pytest.approx(min(mine) * v, rel=1e-9)
            assert found.velocity[:, 0].sum() == pytest.approx(0, abs=1e-12 * v)


def test_particles_rebound_from_bodies_by_the_law_of_their_contact() -> None:
    for speed in SPEEDS:
        grain, own = simulate(
            round((0.2 / speed + 0.1) / DT) * DT,
            DT,
            bodies=[body("it", 0, mass=1.0, restitution=0.3)],
            particles=[points((0.3, 0, 0), velocity=[(-speed, 0.0, 0.0)], mass=0.5, radius=0.05)],
            interactions=[{"type": "contact", "restitution": SOFT}],
        ).final.velocity[:, 0]
        assert grain - own == pytest.approx(law(SOFT, speed) * speed, rel=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_hops_have_the_heights_of_their_restitution(shape: str) -> None:
    # As of one number: known to half a kick, g h²/8 of height, where a body turns around. e at v = √(2 g s).
    drop, falls = 0.9, SOFT | {"speed": 1.0, "exponent": 0.5}
    scenario = table(
        1.5,
        DT,
        forces=[{"type": "gravity"}],
        bodies=[body("it", 0, shape) | {"position": [0, 0.1 + drop, 0]}],
        planes=[{"restitution": falls}],
    )
    simulation = Simulation(ps.from_table(scenario))
    reach, up = [], []
    for step in range(1, 1501):
        simulation.advance_to(step)
        state = simulation.states[0]
        up.append(float(state.v[1, 0]))
        reach.append(float(state.x[1, 0]) - 0.1 + up[-1] ** 2 / (2 * G))
    simulation.close()
    v = np.array(up)
    met = np.flatnonzero((v[1:] > 0) & (v[:-1] < 0)) + 1
    assert len(met) >= 2
    height = drop
    for at in met[:2]:
        fast = np.sqrt(2 * G * height)
        height *= law(falls, fast) ** 2
        assert reach[at] == pytest.approx(height, abs=2 * G * DT**2)


def test_no_impact_gains_energy() -> None:
    # twelve boxes and balls in a room without gravity, elastic below 0.3 m/s, with friction
    rng = np.random.default_rng(4)
    falls = {"value": 1.0, "speed": 0.3, "exponent": 0.2}
    bodies = [
        {
            "name": name,
            "shape": shape,
            "mass": 1.0,
            "friction": 0.3,
            "restitution": falls,
            "orientation": "random",
            "angular_velocity": rng.normal(size=3).tolist(),
            "layout": {
                "type": "points",
                "position": [[0.35 * k - 0.5, 0.35 * j - 0.2, z] for k in range(3) for j in range(2)],
                "velocity": rng.normal(size=(6, 3)).tolist(),
            },
        }
        for z, (name, shape) in zip((-0.2, 0.2), SHAPES.items(), strict=True)
    ]
    room = {"type": "box", "inside": True, "size": [1.6, 1.2, 1.2], "restitution": falls, "friction": 0.3}
    simulation = Simulation(ps.from_table(table(2.0, DT, bodies=bodies, colliders=[room])))
    energy = []
    for step in range(0, 2001, 20):
        simulation.advance_to(step)
        energy.append(simulation.ledger()["kinetic"])
    simulation.close()
    assert np.diff(energy).max() <= 1e-11 * energy[0]
    assert 0.02 * energy[0] < energy[-1] < 0.8 * energy[0]
