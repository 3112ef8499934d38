"""Rigid bodies that come far in a step meet what is on their way: walls, walls that are led, and each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import EPS, G, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

SHAPES: dict[str, dict[str, Any]] = {
    "sphere": {"type": "sphere", "radius": 0.1},
    "box": {"type": "box", "size": [0.2, 0.1, 0.3]},
    "cylinder": {"type": "cylinder", "radius": 0.1, "length": 0.05},
}
SHEETS: dict[str, dict[str, Any]] = {
    "rectangle": {"type": "rectangle", "size": [4, 4]},
    "block": {"type": "box", "size": [4, 0.01, 4]},
    "rod": {"type": "capsule", "start": [-2, 0, 0], "end": [2, 0, 0], "radius": 0.05},
    "formula": {"type": "formula", "distance": "abs(y)-0.05", "size": [4, 1, 4]},
}
TOUCHING = 1e-5
"""Gap at which a ball of 0.1 m counts as touching [m]."""
H = 1e-3


def ball(x: Any, v: Any, name: str = "ball", **other: Any) -> dict[str, Any]:
    return {"name": name, "shape": SHAPES["sphere"], "position": x, "velocity": v, "friction": 0.0, **other}


def slot(width: float, e: float = 1.0) -> list[dict[str, Any]]:
    """Two sheets with so much room between their surfaces."""
    half, size = 0.5e-4 * 4, [4, 4]
    return [
        {"name": "low", "type": "rectangle", "size": size, "center": [0, -half, 0], "restitution": e},
        {"name": "high", "type": "rectangle", "size": size, "center": [0, width + half, 0], "restitution": e},
    ]


@pytest.mark.sampled(12)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("sheet", SHEETS)
def test_nothing_passes_a_thin_wall_at_any_speed(sheet: str, shape: str) -> None:
    """All of them went through where the first half of a step led beyond the wall."""
    for speed in (50.0, 300.0, 1e4):
        bodies = [
            {
                "name": f"body{k}",
                "shape": SHAPES[shape],
                "position": [x, 0.35 + 0.1 * k, 0.0],
                "velocity": [0, -speed, 0],
                "orientation": {"axis": [1, 2, 3], "angle": 40.0 * k},
                "angular_velocity": [1.0, k, -2.0],
            }
            for k, x in enumerate((-1.5, -0.5, 0.5, 1.5))
        ]
        walls = [SHEETS[sheet] | {"name": "wall", "restitution": 0.5}]
        result = simulate(5 * H, H, bodies=bodies, colliders=walls)
        assert (result.final.position[:, 1] > 0).all()


@pytest.mark.parametrize("way", [0.3, 0.5, 2.0, 20.0])
def test_an_elastic_ball_goes_to_and_fro_in_a_slot(way: float) -> None:
    """Where it is without the walls, folded. It went through them from 0.3 m in a step on."""
    steps, y, room = 40, 0.17, 0.3
    result = simulate(steps * H, H, bodies=[ball([0, y, 0], [0, -way / H, 0])], colliders=slot(0.5))
    turns = abs(y - 0.1 - way * steps) / room
    left = turns % 2
    expected = 0.1 + room * (left if left < 1 else 2 - left)
    # The gap at which an impact is given shortens the way, and rounding adds up.
    slack = (turns + 1) * 2 * TOUCHING
    got = result.final
    assert abs(abs(got.velocity[0, 1]) / (way / H) - 1) < (100 + turns) * EPS
    if slack < 0.05:
        assert abs(got.position[0, 1] - expected) < slack
    assert 0.1 - 1e-12 < got.position[0, 1] < 0.4 + 1e-12


@pytest.mark.parametrize("phase", [0.1, 0.35, 0.45, 0.5, 0.55, 0.8, 0.97])
def test_a_swift_impact_keeps_the_energy_of_a_fall_whenever_it_is(phase: float) -> None:
    """Kinetic and potential energy, to rounding: the speed at the impact is that of its time in the step, not of the
    step's beginning or end, which would give up to g times the way."""
    speed, h = 300.0, H
    y = 0.1 + phase * h * speed
    falls = [{"type": "gravity", "acceleration": [0, -1e3, 0]}]
    result = simulate(h, h, bodies=[ball([0, y, 0], [0, -speed, 0])], colliders=slot(5.0)[:1], forces=falls)
    got = result.final
    energy = 0.5 * got.velocity[0, 1] ** 2 + 1e3 * got.position[0, 1]
    before = 0.5 * speed**2 + 1e3 * y
    assert got.velocity[0, 1] > 0
    assert abs(energy - before) < 1e-12 * before


def test_balls_that_meet_in_a_drift_exchange_their_velocities() -> None:
    for speed in (100.0, 1000.0, 5000.0):
        bodies = [ball([-0.3, 0, 0], [speed, 0, 0], "one", restitution=1.0)]
        bodies += [ball([0.3, 0, 0], [-0.5 * speed, 0, 0], "two", restitution=1.0)]
        got = simulate(4 * H, H, bodies=bodies).final
        assert np.allclose(got.velocity[:, 0] / speed, [-0.5, 1.0], rtol=0, atol=1e-12)
        assert got.position[0, 0] < got.position[1, 0]


def test_what_a_swift_ball_sets_in_motion_meets_the_next_one() -> None:
    """A row of balls at rest, hit at 1 m in a step: the last one goes, and the wall behind it sends it back."""
    row = [ball([0.5 * k, 0, 0], [1000.0 if k == 0 else 0, 0, 0], f"b{k}", restitution=1.0) for k in range(4)]
    wall = {
        "name": "wall",
        "type": "rectangle",
        "size": [1, 1],
        "center": [2.5, 0, 0],
        "orientation": {"axis": [0, 0, 1], "angle": 90},
        "restitution": 0.5,
    }
    got = simulate(2 * H, H, bodies=row, colliders=[wall]).final
    assert (np.diff(got.position[:, 0]) > 0.19).all()
    assert (got.position[:, 0] < 2.4).all()
    assert abs(got.velocity[:, 0].sum() + 500.0) < 1e-6


@pytest.mark.parametrize("shape", ["sphere", "box"])
def test_a_wall_that_is_led_takes_bodies_along(shape: str) -> None:
    """A body at rest gets (1 + e) of the speed of the wall, which comes 0.5 m in a step."""
    wall = {"name": "wall", "type": "rectangle", "size": [4, 4], "restitution": 0.5}
    path = {"collider": "wall", "path": ["x", "500*t", "z"]}
    rest = {"name": "body", "shape": SHAPES[shape], "position": [0, 0.17, 0]}
    got = simulate(5 * H, H, bodies=[rest], colliders=[wall], motions=[path]).final
    assert abs(got.velocity[0, 1] - 750.0) < 1e-6
    assert got.position[0, 1] > 500 * 5 * H


def crowd(e: float, friction: float) -> dict[str, Any]:
    """Eight boxes that fly and turn in a box of sheets."""
    rng = np.random.default_rng(3)
    places = [[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)]
    surface = {"restitution": e, "friction": friction}
    bodies = [
        surface
        | {
            "name": f"body{k}",
            "shape": SHAPES["box"],
            "position": place,
            "velocity": rng.normal(0, 60, 3).tolist(),
            "angular_velocity": rng.normal(0, 50, 3).tolist(),
        }
        for k, place in enumerate(places)
    ]
    sheet = surface | {"type": "rectangle", "size": [1.2, 1.2]}
    walls = []
    for k, side in enumerate((-0.5, 0.5)):
        walls += [sheet | {"name": f"y{k}", "center": [0, side, 0]}]
        walls += [
            sheet | {"name": f"x{k}", "center": [side, 0, 0], "orientation": {"axis": [0, 0, 1], "angle": 90}}
        ]
        walls += [
            sheet | {"name": f"z{k}", "center": [0, 0, side], "orientation": {"axis": [1, 0, 0], "angle": 90}}
        ]
    return {"bodies": bodies, "colliders": walls}


@pytest.mark.slow
@pytest.mark.parametrize(("e", "friction"), [(1.0, 0.0), (1.0, 0.4), (0.5, 0.4)])
def test_a_box_of_sheets_holds_swift_boxes_and_gives_them_nothing(e: float, friction: float) -> None:
    scenario = table(0.1, H, output={"every": 1, "ledger": True}, **crowd(e, friction))
    result = ps.run(ps.from_table(scenario))
    assert (abs(result.final.position) < 0.5).all()
    energy: NDArray[np.float64] = np.asarray(result.ledger["kinetic"])
    # Energies of turning swing by (ω h)², with 0.1 rad at a time.
    assert energy.max() < (1 + 1e-3) * energy[0]


def test_the_work_of_swift_impacts_is_in_the_ledger() -> None:
    parts = crowd(0.5, 0.4)
    falls = [{"type": "gravity", "acceleration": [0, -G, 0]}]
    output = {"every": 1, "ledger": True, "work": True}
    result = ps.run(ps.from_table(table(0.02, H, output=output, forces=falls, **parts)))
    residual = np.asarray(result.ledger["balance"])
    assert abs(residual).max() < 1e-5 * result.ledger["kinetic"][0]


def test_a_body_without_room_to_rebound_rests_and_is_told() -> None:
    """500 impacts would be in half a step."""
    scenario = table(H, H, bodies=[ball([0, 0.1005, 0], [0, 1000.0, 0])], colliders=slot(0.201))
    result = ps.run(ps.from_table(scenario))
    assert 0.0999 < result.final.position[0, 1] < 0.1011
    assert any("a rigid body had more than 256 impacts in half a step" in each for each in result.warnings)


def test_swift_bodies_go_on_with_the_same_bits_wherever_an_interval_ends() -> None:
    scenario, ends = ps.from_table(table(0.05, H, **crowd(0.9, 0.2))), []
    for every in (1, 50):
        simulation = Simulation(scenario)
        for step in range(every, 51, every):
            simulation.advance_to(step)
        ends.append(np.concatenate([state.x[:, :1].copy() for state in simulation.states], axis=1))
        simulation.close()
    assert (ends[0] == ends[1]).all()
