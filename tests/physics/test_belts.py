"""Surfaces that move: belts, also on colliders that turn, and lifts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import points, simulate

import particlesim as ps

R, M, G, MU = 0.05, 0.1, 9.81, 0.5
STEP, TIME = 1e-4, 0.2
BELT = (1.0, 0.0, 0.3)
LINEAR = {"type": "contact", "model": "linear", "stiffness": 1e5}
HERTZ = {"type": "contact", "model": "hertz", "young_modulus": "100 MPa"}
SOFT = pytest.mark.parametrize("law", [LINEAR, HERTZ], ids=["linear", "hertz"])


def on_floor(
    law: dict[str, Any], velocity: Any, belt: Any, time: float = TIME, step: float = STEP, **more: Any
) -> ps.Result:
    """A grain that is put on a floor, which runs with the velocity of a belt."""
    floor = {"restitution": 0.3, "friction": MU, **({"surface_velocity": list(belt)} if any(belt) else {})}
    return simulate(
        time,
        step,
        particles=[points((0, R, 0), mass=M, radius=R, velocity=[velocity])],
        interactions=[{**law, "restitution": 0.3, "friction": MU}],
        forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
        planes=[floor],
        **more,
    )


def motion(result: ps.Result) -> np.ndarray:
    """Velocity, and R times the angular velocity [m/s]."""
    return np.array([result.final.velocity[0], R * np.asarray(result.final["angular_velocity"])[0]])


ROUNDING = 1e5 * np.finfo(float).eps * TIME * TIME / M
"""What roundings of places, in springs of 1e5 N/m, do to a velocity meanwhile [m/s]; a spring of Hertz is softer."""


@pytest.mark.sampled(2)
@SOFT
def test_a_soft_grain_that_goes_with_a_belt_goes_on(law: dict[str, Any]) -> None:
    velocity, turn = motion(on_floor(law, BELT, BELT))
    assert velocity[[0, 2]] == pytest.approx(np.array(BELT)[[0, 2]], abs=10 * ROUNDING)
    assert np.abs(turn).max() < 10 * ROUNDING


@pytest.mark.sampled(2)
@SOFT
def test_a_belt_is_a_floor_at_rest_seen_from_another_frame(law: dict[str, Any]) -> None:
    there = motion(on_floor(law, (0, 0, 0), BELT))
    here = motion(on_floor(law, tuple(-u for u in BELT), (0, 0, 0)))
    here[0] += BELT
    assert there == pytest.approx(here, abs=10 * ROUNDING)


@SOFT
def test_a_soft_grain_on_a_belt_ends_rolling_with_two_sevenths_of_its_speed(law: dict[str, Any]) -> None:
    # The friction f acts at the arm a = R - δ: m v' = f, 2/5 m R² ω' = a f, until v + a ω = u: v = u/(1 + 5/2 (a/R)²). As
    # it is put down it springs between δ = 0 and twice that of its weight.
    result = on_floor(law, (0, 0, 0), BELT)
    velocity, turn = motion(result)
    deep = R - result.final.position[0, 1]
    least, most = (1 / (1 + 2.5 * ((R - d) / R) ** 2) for d in (0.0, 2 * deep))
    share = velocity[[0, 2]] / np.array(BELT)[[0, 2]]
    assert (share > least).all()
    assert (share < most).all()
    slip = velocity + np.cross(turn, (0, deep / R - 1, 0)) - BELT
    assert np.abs(slip[[0, 2]]).max() < 1e-6 * BELT[0]


@pytest.mark.parametrize(
    "law", [pytest.param(LINEAR, marks=pytest.mark.slow), HERTZ], ids=["linear", "hertz"]
)
def test_the_work_of_a_belt_is_booked(law: dict[str, Any]) -> None:
    # What begins within a step, as its contact and its rolling, may be off by the work of a step. It rolls after 0.06 s
    step, output = 2 * STEP, {"ledger": True, "work": True, "every": 50}
    books = on_floor(law, (0, 0, 0), BELT, TIME / 2, step, output=output).ledger
    assert books["work.contact"][-1] == pytest.approx(books["kinetic"][-1], rel=1e-2)
    assert np.abs(books["balance"]).max() < step * MU * M * G * math.hypot(*BELT)


@pytest.mark.parametrize("lift", [(0.0, -5.0, 0.0), (1.3, -2.1, 0.7), (0.0, 2.0, 0.0)])
@pytest.mark.parametrize("friction", [{}, {"friction": 0.4}], ids=["smooth", "rough"])
@pytest.mark.parametrize("rebound", [0.0, 0.6])
def test_hard_grains_on_a_lift_move_as_on_a_floor_at_rest(
    lift: tuple[float, ...], friction: dict[str, float], rebound: float
) -> None:
    # one falls on another one that lies on the floor, and both slide along it

    def moves(floor: tuple[float, ...]) -> np.ndarray:
        start = [tuple(np.add(floor, (0.5, 0, 0)))] * 2
        final = simulate(
            0.3,
            1e-3,
            particles=[points((0, R, 0), (0, 3.2 * R, 0), mass=M, radius=R, velocity=start)],
            interactions=[{"type": "contact", "restitution": rebound, **friction}],
            forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
            colliders=[
                {"name": "lift", "type": "box", "center": [0, -0.5, 0], "size": [9, 1, 9]}
                | {"restitution": rebound, **friction}
            ],
            motions=[
                {"collider": "lift", "path": [f"{x} + {u}*t" for x, u in zip("xyz", floor, strict=True)]}
            ],
        ).final
        return np.array([final.position - 0.3 * np.array(floor), final.velocity - floor])

    # Places of up to two metres are rounded in 300 steps, and velocities come from differences of theirs in a step. What
    # rests may do so over a gap that it closes by its fall in each step, until rounding lets it touch.
    there, here, rounded = moves(lift), moves((0.0, 0.0, 0.0)), 600 * np.finfo(float).eps / 1e-3
    over = G * 1e-3**2 / 2 if rebound > 0 and not friction else 0.0
    assert there[0] == pytest.approx(here[0], abs=over + rounded)
    assert there[1] == pytest.approx(here[1], abs=rounded)


RATE, RUNS = 15.0, 3.0
SHARP = 2e-4


def by_hand(load: float, rolls: float, time: float) -> np.ndarray:
    """The velocity of what begins at rest on the axis of a turntable, with a belt along x at the start [m/s].

    Friction is along the slip u = belt(t) + ω × x − v − s, v' = load μ g u/|u|, with s' = `rolls` v' of the surface that
    turns: 5/2 for a sphere that slides, 0 for what does not turn.
    """
    steps = 20_000
    h, x, v, s = time / steps, np.zeros(2), np.zeros(2), np.zeros(2)
    for k in range(steps):
        angle = RATE * (k + 0.5) * h
        slip = RUNS * np.array([math.cos(angle), -math.sin(angle)]) + RATE * np.array([x[1], -x[0]]) - v - s
        pull = load * MU * G * slip / np.linalg.norm(slip)
        v, s = v + h * pull, s + rolls * h * pull
        x = x + h * v
    return v


TURNTABLE: dict[str, Any] = {
    "forces": [{"type": "gravity", "acceleration": [0, -G, 0]}],
    "colliders": [
        {"name": "table", "type": "box", "center": [0, -0.5, 0], "size": [40, 1, 40]}
        | {"restitution": 0, "friction": MU, "surface_velocity": [RUNS, 0, 0]}
    ],
    "motions": [{"collider": "table", "spin": {"axis": [0, 1, 0], "rate": RATE}}],
}
HARD = {"type": "contact", "restitution": 0, "friction": MU}
CUBE = {"name": "b", "shape": {"type": "box", "size": [0.002, 0.002, 0.002]}, "position": [0, 0.001, 0]}
GRAIN = points((0, R, 0), mass=M, radius=R)
SUNK = points((0, R - M * G / 1e5, 0), mass=M, radius=R)


@pytest.mark.parametrize(
    ("rolls", "parts"),
    [
        (0.0, {"particles": [GRAIN]}),
        (0.0, {"bodies": [CUBE]}),
        (2.5, {"particles": [GRAIN], "interactions": [HARD]}),
        (2.5, {"particles": [SUNK], "interactions": [{**LINEAR, "restitution": 0.3, "friction": MU}]}),
    ],
    ids=["point", "body", "hard grain", "soft grain"],
)
def test_a_belt_turns_with_its_collider(rolls: float, parts: dict[str, Any]) -> None:
    time = 0.1  # in which it turns by 1.5 rad, and nothing comes to roll: 7/2 μ g t is less than the belt's velocity
    final = simulate(time, SHARP, **TURNTABLE, **parts).final
    # the direction of friction is that of a time in the step
    off = MU * G * time * RATE * SHARP
    assert final.velocity[0, [0, 2]] == pytest.approx(by_hand(1.0, rolls, time), abs=off)


def test_a_belt_turns_with_its_collider_under_grains_that_lie_on_others() -> None:
    # Smooth grains, one on the other: the floor presses the lower one with the weight of both. It slides from below the
    # other one by less than 2 μ g t²/2 = 2 mm meanwhile, which leans on it with at most 2 mm/2R = 2 % of its weight.
    time = 0.02
    table = {**TURNTABLE, "motions": [{"collider": "table", "spin": {"axis": [0, 1, 0], "rate": 5 * RATE}}]}
    two = points((0, R, 0), (0, 3 * R, 0), mass=M, radius=R)
    smooth = {"type": "contact", "restitution": 0}
    final = simulate(time, SHARP / 5, **table, particles=[two], interactions=[smooth]).final
    angle = np.linspace(0, 5 * RATE * time, 1001)
    way = 2 * MU * G * time * np.array([np.cos(angle).mean(), -np.sin(angle).mean()])
    assert final.velocity[0, [0, 2]] == pytest.approx(way, abs=0.04 * 2 * MU * G * time)


def test_a_belt_turns_with_its_collider_under_cloth() -> None:
    # Two cloths, one on the other, so that contact of surfaces takes part: friction has the weight of both to pull both.
    time = 0.02
    layout = {
        "type": "cloth",
        "size": [0.03, 0.03],
        "resolution": [4, 4],
        "up": [0, 0, 1],
        "right": [1, 0, 0],
    }
    cloth = {"mass": 0.1, "radius": 0.002, "springs": {"structural": 1e3, "shear": 1e3}}
    table = {**TURNTABLE, "motions": [{"collider": "table", "spin": {"axis": [0, 1, 0], "rate": 5 * RATE}}]}
    sheets = [
        {**cloth, "name": name, "layout": {**layout, "origin": [-0.015, height, -0.015]}}
        for name, height in (("low", 0.002), ("high", 0.006))
    ]
    final = simulate(
        time, SHARP, **table, particles=sheets, interactions=[{"type": "contact", "restitution": 0}]
    ).final
    angle = np.linspace(0, 5 * RATE * time, 1001)
    way = MU * G * time * np.array([np.cos(angle).mean(), -np.sin(angle).mean()])
    assert final.velocity.mean(axis=0)[[0, 2]] == pytest.approx(way, abs=0.1 * MU * G * time)
