"""Limits and motors of joints against closed forms, and what they do to energy and momentum."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, G, simulate, table

import particlesim as ps
from particlesim.errors import ScenarioError

BAR = {
    "name": "bar",
    "shape": {"type": "box", "size": [0.1, 1.0, 0.06]},
    "mass": 2.0,
    "position": [0, -0.5, 0],
}
HINGE = {"type": "hinge", "between": ["bar", "world"], "anchor": [0, 0, 0], "axis": [0, 0, 1]}
INERTIA = 2.0 * ((0.1**2 + 1.0**2) / 12 + 0.25)
"""Of the bar about its end [kg m²]."""
OUTPUT = {"ledger": True, "work": True, "every": 10}


def swing(duration: float, joint: dict[str, Any], **other: Any) -> ps.Result:
    parts = {"bodies": [BAR | other.pop("bar", {})], "joints": [HINGE | joint], "output": OUTPUT} | other
    return simulate(duration, 1e-3, **parts)


def angle(frame: Any, body: int = 0) -> float:
    """How far a body is turned about z [degrees]."""
    w, _, _, z = frame["orientation"][body]
    return math.degrees(2 * math.atan2(z, w))


def test_a_motor_turns_with_its_torque_until_it_has_its_speed() -> None:
    # ω = τ t/I up to ω₀, then what friction and weight leave to do; its work is ½ I ω².
    torque = 3.0
    for speed, time in ((20.0, 0.8), (-2.0, 0.8)):
        result = swing(time, {"motor": {"speed": speed, "torque": torque}})
        omega = math.copysign(min(abs(speed), torque * time / INERTIA), speed)
        assert result.final["angular_velocity"][0] == pytest.approx([0, 0, omega], rel=1e-9, abs=1e-12)
        rows = result.ledger
        assert rows["work.motors"][-1] == pytest.approx(0.5 * INERTIA * omega**2, rel=1e-9)
        assert abs(rows["work.contact"][-1]) < 1e-12
        assert np.abs(rows["balance"]).max() < 1e-12


def test_a_motor_that_is_too_weak_holds_where_its_torque_is_that_of_the_weight() -> None:
    # It brakes what falls: the weight turns the bar with m g d sin θ, and the torque takes τ; at rest sin θ < τ/(m g d).
    # Lifted slowly, with ω₀ → 0, the bar would rise to 30°; from 20° on it does not sink.
    torque = 2.0 * G * 0.5 * math.sin(math.radians(30))
    s, c = math.sin(math.radians(20)), math.cos(math.radians(20))
    leaning = {"position": [0.5 * s, -0.5 * c, 0], "orientation": {"axis": [0, 0, 1], "angle": 20}}
    end = swing(
        0.2, {"motor": {"speed": 0, "torque": torque}}, bar=leaning, forces=[{"type": "gravity"}]
    ).final
    assert np.abs(end["angular_velocity"]).max() < 1e-9
    assert angle(end) == pytest.approx(20, abs=1e-8)


def test_two_bodies_at_a_motor_keep_their_angular_momentum() -> None:
    # ω₁ − ω₂ = ω₀ about the axis through both centres, I₁ ω₁ + I₂ ω₂ = 0.
    wheels = [
        {"name": "bar", "shape": {"type": "cylinder", "radius": 0.2, "length": 0.1}, "mass": 1.0},
        {"name": "other", "shape": {"type": "cylinder", "radius": 0.3, "length": 0.1}, "mass": 2.0},
    ]
    wheels[1]["position"] = [0, 0, 0.2]
    hinge = {"between": ["bar", "other"], "motor": {"speed": 6.0, "torque": 1.0}}
    result = swing(0.3, hinge, bodies=wheels)
    one, other = 0.5 * 1.0 * 0.2**2, 0.5 * 2.0 * 0.3**2
    turning = result.final["angular_velocity"]
    expected = [[0, 0, 6 * other / (one + other)], [0, 0, -6 * one / (one + other)]]
    assert turning == pytest.approx(np.array(expected), abs=1e-9)
    for axis in "xyz":
        assert np.abs(result.ledger[f"angular_momentum.{axis}"]).max() < 300 * EPS


def test_limits_hold_and_give_no_energy() -> None:
    # The bar would swing to 60° and more; it stops at 30° and at −20°, falls back, and comes to rest nowhere beyond.
    moving = {"velocity": [1.5, 0, 0], "angular_velocity": [0, 0, 3.0]}
    scenario = table(
        1.2, 1e-3, bodies=[BAR | moving], joints=[HINGE | {"limits": [-20, 30]}],
        forces=[{"type": "gravity"}], output=OUTPUT | {"every": 1},
    )  # fmt: skip
    rows = ps.run(ps.from_table(scenario)).ledger
    energy = rows["kinetic"] + rows["potential.gravity"]
    # It rises only by the swing of the method, (ω h)² of the kinetic energy, and falls at the impacts by all of that.
    assert np.diff(energy).max() < 1e-5 * rows["kinetic"][0]
    hits = np.flatnonzero(np.diff(energy) < -0.1)
    assert hits.tolist() == [
        hits[0],
        hits[0] + 1,
        hits[2],
        hits[2] + 1,
    ]  # the step that comes there, and the next
    assert rows["kinetic"][hits[1::2] + 1].max() < 1e-3
    assert np.abs(rows["balance"]).max() < 1e-4
    for duration, bound in ((0.001 * (hits[1] + 1), 30.0), (0.001 * (hits[3] + 1), -20.0)):
        turned = angle(swing(duration, {"limits": [-20, 30]}, bar=moving, forces=[{"type": "gravity"}]).final)
        assert turned == pytest.approx(bound, abs=0.01)


def test_a_bar_that_leans_on_its_limit_rests() -> None:
    # 45° from where it hangs, and held there.
    s = math.sqrt(0.5)
    leaning = {"position": [0.5 * s, -0.5 * s, 0], "orientation": {"axis": [0, 0, 1], "angle": 45}}
    end = swing(0.5, {"limits": [0, 60]}, bar=leaning, forces=[{"type": "gravity"}]).final
    assert angle(end) == pytest.approx(45, abs=1e-6)
    assert np.abs(end["angular_velocity"]).max() < 1e-9


def test_a_ball_joint_leans_within_its_cone() -> None:
    # Pushed sideways along a slanted direction the bar leans up to 25°, and may turn about itself as it likes.
    u = np.array([0.6, 0.0, 0.8])
    turning = np.cross([0, -1, 0], u) * 4.0 + np.array([0, 3.0, 0])
    moving = {"velocity": np.cross(turning, [0, -0.5, 0]).tolist(), "angular_velocity": turning.tolist()}
    ball = {"type": "ball", "between": ["bar", "world"], "anchor": [0, 0, 0], "axis": [0, -2, 0], "cone": 25}
    deepest = 0.0
    result = simulate(
        0.4, 1e-3, bodies=[BAR | moving], joints=[ball], forces=[{"type": "gravity"}], output=OUTPUT
    )
    energy = result.ledger["kinetic"] + result.ledger["potential.gravity"]
    assert np.diff(energy).max() < 1e-4 * energy[0] + 1e-4 * result.ledger["kinetic"][0]
    for duration in (0.1, 0.15, 0.2):
        end = simulate(
            duration, 1e-3, bodies=[BAR | moving], joints=[ball], forces=[{"type": "gravity"}]
        ).final
        x, y, z = end.position[0]
        deepest = max(deepest, math.degrees(math.atan2(math.hypot(x, z), -y)))
    assert 24.5 < deepest < 25.001


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        ({"limits": [50, -50]}, "the least angle comes first"),
        ({"limits": [10, 30]}, "must be within its limits"),
        ({"limits": [-200, 30]}, "between -180 and 180"),
        ({"motor": {"speed": 1.0, "torque": 0.0}}, "torque"),
        ({"motor": {"speed": 1.0}}, "missing key 'torque'"),
        ({"type": "ball", "axis": None, "cone": 20}, "cone needs axis"),
        ({"type": "ball"}, "axis needs cone"),
        ({"type": "ball", "cone": 180}, "cone"),
    ],
)
def test_stops_that_cannot_be_are_refused(joint: dict[str, Any], words: str) -> None:
    given = {k: v for k, v in (HINGE | joint).items() if v is not None}
    with pytest.raises(ScenarioError, match=words):
        ps.from_table(table(0.1, 1e-3, bodies=[BAR], joints=[given]))
