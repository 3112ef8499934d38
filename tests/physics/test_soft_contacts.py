"""Surfaces that yield: penalty springs with dampers, gradual projection; and sliding without rebound."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, points, simulate, table

import particlesim as ps

OUT = {"output": {"work": True, "ledger": True}}


def thrown(duration: float, dt: float, method: str = "velocity_verlet", **plane: Any) -> ps.Result:
    """A ball of 2 kg, without weight, thrown at a plane at 3 m/s from 0.3 m above it."""
    ball = points((0.0, 0.35, 0.0), velocity=((1.0, -3.0, 0.0),), name="ball", mass=2.0, radius=0.05)
    output = plane.pop("output", {})
    return simulate(duration, dt, method, particles=[ball], planes=[plane], output=output)


@pytest.mark.parametrize(("method", "zeta"), [("velocity_verlet", 0.0), ("rk4", 0.2), ("rk45", 0.2)])
def test_a_penalty_rebounds_as_its_oscillator(method: str, zeta: float) -> None:
    # A spring and a damper that push and never pull (Schwager, Poeschel, Granular Matter 9, 465 (2007)):
    # e = exp(-z (pi - atan(2 z s/(1 - 2 z^2)))/s), s = sqrt(1 - z^2). Where it is first met within a step is of first
    # order in h w = 0.002.
    k, m = 2e4, 2.0
    s = np.sqrt(1 - zeta**2)
    e = np.exp(-zeta / s * (np.pi - np.arctan2(2 * zeta * s, 1 - 2 * zeta**2)))
    found = thrown(0.2, 2e-5, method, contact="penalty", stiffness=k, damping=2 * zeta * np.sqrt(k * m))
    vx, vy, _ = found.final.velocity[0]
    assert vx == 1.0
    assert vy == pytest.approx(3 * e, rel=0.004)


def test_what_a_penalty_gives_and_takes_is_the_work_of_contact() -> None:
    found = thrown(0.2, 1e-3, contact="penalty", stiffness=2e4, damping=100.0, **OUT)
    vy = found.final.velocity[0, 1]
    assert 0.5 < vy < 2.5
    assert found.ledger["balance"][-1] == pytest.approx(0, abs=1e-9)
    assert found.ledger["work.contact"][-1] == pytest.approx(vy**2 - 9, rel=1e-9)


def test_what_lies_on_a_penalty_is_as_deep_as_its_weight_says() -> None:
    ball = points((0.0, 0.05, 0.0), name="ball", mass=2.0, radius=0.05)
    plane = {"contact": "penalty", "stiffness": 1e4, "damping": 200.0}
    found = simulate(2.0, 1e-3, particles=[ball], planes=[plane], forces=[{"type": "gravity"}])
    assert found.final.position[0, 1] == pytest.approx(0.05 - 2 * G / 1e4, abs=1e-9)


def test_a_penalty_pushes_members_of_springs_too() -> None:
    pair = points(
        (0.0, 0.3, 0.0), (1.0, 0.3, 0.0), velocity=((0.0, -3.0, 0.0),) * 2, name="pair", radius=0.05
    )
    spring = {"on": "pair", "pairs": [[0, 1]], "stiffness": 10.0}
    soft = {"type": "box", "size": [4, 1, 4], "center": [0, -0.5, 0], "contact": "penalty", "stiffness": 1e4}
    found = simulate(0.2, 1e-5, particles=[pair], springs=[spring], colliders=[soft])
    assert found.final.velocity[:, 1] == pytest.approx([3, 3], rel=0.004)


@pytest.mark.parametrize("dt", [0.01, 0.02])
def test_gradual_projection_takes_the_same_time_at_any_step(dt: float) -> None:
    # A point at rest 0.2 m deep: depth exp(-t/recovery).
    point = points((0.0, -0.2, 0.0), name="point")
    found = simulate(0.4, dt, particles=[point], planes=[{"detection": "discrete", "recovery": 0.1}])
    assert found.final.position[0, 1] == pytest.approx(-0.2 * np.exp(-4), rel=1e-12)


def test_gradual_projection_bounces_too() -> None:
    found = thrown(0.3, 1e-3, detection="discrete", recovery=0.02, restitution=0.5)
    assert found.final.velocity[0, 1] == pytest.approx(1.5, abs=1e-12)


def test_a_led_penalty_pushes_with_its_own_velocity() -> None:
    # A wall at 2 m/s that meets what rests sends it off at 4 m/s.
    wall = {"name": "wall", "type": "box", "size": [0.2, 2, 2], "center": [-0.5, 0, 0], "contact": "penalty"}
    motion = {"collider": "wall", "path": ["x + 2*t", "y", "z"]}
    found = simulate(
        0.4,
        1e-5,
        particles=[points((0.0, 0.0, 0.0), name="ball", radius=0.1)],
        colliders=[{**wall, "stiffness": 1e5}],
        motions=[motion],
    )
    assert found.final.velocity[0, 0] == pytest.approx(4, rel=0.005)


def test_slide_goes_on_along_the_surface() -> None:
    found = thrown(0.2, 1e-3, contact="slide")
    assert found.final.velocity[0] == pytest.approx([1, 0, 0], abs=1e-12)
    assert found.final.position[0, 1] == pytest.approx(0.05, abs=1e-12)
    # with friction: an impact takes up to mu times its normal impulse, 3 m/s
    rubbed = thrown(0.2, 1e-3, contact="slide", friction=0.2)
    assert rubbed.final.velocity[0] == pytest.approx([1 - 0.2 * 3, 0, 0], abs=1e-12)


@pytest.mark.parametrize(
    ("plane", "words"),
    [
        ({"contact": "penalty"}, "needs a stiffness"),
        ({"contact": "penalty", "stiffness": 1.0, "detection": "continuous"}, "no moment of impact"),
        ({"contact": "penalty", "stiffness": 1.0, "friction": 0.4}, "friction acts only with"),
        ({"stiffness": 1.0}, "stiffness acts only with"),
        ({"contact": "slide", "restitution": 0.4}, "restitution acts only with"),
        ({"recovery": 0.1}, "no depth to recover"),
        ({"contact": "stick", "recovery": 0.1, "detection": "discrete"}, "recovery acts only with"),
    ],
)
def test_what_does_not_go_together_is_refused(plane: dict[str, Any], words: str) -> None:
    with pytest.raises(ps.ScenarioError, match=words):
        ps.from_table(table(1, 0.01, particles=[points((0, 1, 0))], planes=[plane]))


def test_steps_too_long_for_a_penalty_are_told() -> None:
    # omega = 100/s: unstable from h = 2/omega = 0.02 s on, and that is what happens.
    plane = {"contact": "penalty", "stiffness": 1e4}
    ball = points((0.0, -0.01, 0.0), name="ball", mass=1.0)
    told = simulate(1.0, 0.025, particles=[ball], planes=[plane], output={"ledger": True})
    assert any("dt must be below 0.02 s" in text for text in told.warnings)
    assert told.ledger["kinetic"][-1] > 0.5 * 1e4 * 0.01**2 * 1.5
    fine = simulate(1.0, 0.001, particles=[ball], planes=[plane])
    assert not any("dt" in text for text in fine.warnings)
    rough = simulate(1.0, 0.01, particles=[ball], planes=[plane])
    assert any("its spring needs about 20" in text for text in rough.warnings)


def test_a_scenario_with_soft_surfaces_is_what_it_writes_down() -> None:
    from particlesim.scenario.dump import to_table

    plane = {"contact": "penalty", "stiffness": 1.0}
    event = {"name": "sparks", "on_impact": {"of": ["ball"]}, "radius": 0.01}
    parts = {"particles": [points((0, 1, 0), name="ball")], "emitters": [event]}
    made = ps.from_table(table(1, 0.01, planes=[plane, {"on": ["ball"]}], **parts))
    again = ps.from_table(to_table(made))
    assert again.all_colliders == made.all_colliders
    assert again.emitters == made.emitters
