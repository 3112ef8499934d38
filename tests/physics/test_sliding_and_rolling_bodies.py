"""Rigid bodies that slide and roll on the inside of round colliders, and on their rims: they turn with the surface, and keep
what they have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import record, table

import particlesim as ps

INNER, SIZE, SLOPE = 0.05, 0.006, 0.7
"""Radius of the containers, that of bodies [m], and how far up they begin [rad]."""
BOWL = {"type": "sphere", "center": [0, INNER, 0], "radius": INNER, "inside": True}
TROUGH = {"type": "cylinder", "start": [-1, INNER, 0], "end": [1, INNER, 0], "radius": INNER, "inside": True}
ALONG = {"axis": [0, 1, 0], "angle": 90}
"""Has the axis of a shape along x."""
BALL = {"shape": {"type": "sphere", "radius": SIZE}}


def go(
    wall: dict[str, Any], body: dict[str, Any], dt: float, duration: float, gravity: bool = True, **more: Any
) -> Any:
    given = table(
        duration,
        dt,
        bodies=[{"name": "body", "density": 2500, **body}],
        colliders=[wall],
        forces=[{"type": "gravity"}] if gravity else [],
        output={"every": 1, "ledger": True},
        **more,
    )
    return ps.run(ps.from_table(given))


def energy_of(run: Any) -> Any:
    return run.ledger["kinetic"] + run.ledger.get("potential.gravity", 0.0)


def up_the_side(center: float) -> list[float]:
    """Where the centre of a body is that is as far from that of its container, on the slope."""
    return [0.0, INNER - center * np.cos(SLOPE), center * np.sin(SLOPE)]


SHAPES = {
    "ball": ({}, BALL["shape"], INNER - SIZE),
    "box": (
        {"orientation": {"axis": [1, 0, 0], "angle": -np.degrees(SLOPE)}},
        {"type": "box", "size": [2 * SIZE, SIZE, 2 * SIZE]},
        np.sqrt(INNER**2 - SIZE**2) - 0.5 * SIZE,
    ),
    "capsule": ({"orientation": ALONG}, {"type": "capsule", "radius": SIZE, "length": 0.02}, INNER - SIZE),
    "cylinder": ({"orientation": ALONG}, {"type": "cylinder", "radius": SIZE, "length": 0.02}, INNER - SIZE),
}


@pytest.mark.parametrize(("dt", "loss"), [(1e-3, 1e-4), (5e-3, 2e-3)])
@pytest.mark.parametrize(
    ("shape", "friction"), [*((shape, 0.0) for shape in SHAPES), ("ball", 0.8), ("capsule", 0.8)]
)
def test_what_swings_in_a_trough_keeps_its_energy(
    shape: str, friction: float, dt: float, loss: float
) -> None:
    """In two seconds, four swings. They lost 9 % in steps of 1 ms, and a quarter in those of 5 ms, as a body on a bent
    surface left each step along the tangent in its middle."""
    where, what, center = SHAPES[shape]
    rubs = {"friction": friction} if friction else {}
    body = {"shape": what, "position": up_the_side(center), **where, **rubs}
    run = go({**TROUGH, **rubs}, body, dt, 2.0)
    energy = energy_of(run) - energy_of(run)[0]
    most = run.ledger["kinetic"].max()
    assert energy.max() <= 1e-9 * most
    assert energy.min() > -loss * most
    assert run.ledger["kinetic"][-int(0.6 / dt) :].max() == pytest.approx(most, rel=5 * loss)


@pytest.mark.slow
def test_a_ball_that_rolls_around_a_funnel_keeps_its_energy() -> None:
    """The axis about which it turns goes around, by friction alone, which took 1 % of it in two seconds."""
    funnel = {"type": "cone", "start": [0, 0.1, 0], "end": [0, -0.1, 0], "radius": 0.3, "inside": True}
    touches = np.array([0.09, 0.09 / 1.5 - 0.1, 0.0]) + SIZE / np.hypot(1.5, 1.0) * np.array([-1.0, 1.5, 0.0])
    body = {**BALL, "position": touches.tolist(), "velocity": [0, 0, 0.6], "friction": 0.8}
    run = go({**funnel, "friction": 0.8, "restitution": 0}, body, 1e-3, 2.5)
    energy, most = energy_of(run), run.ledger["kinetic"].max()
    rolls = 500  # steps, in which it slips
    assert energy[rolls:].max() <= energy[rolls] + 1e-9 * most
    assert energy[-1] > energy[rolls] - 1e-4 * most


@pytest.mark.sampled(2)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_small_swings_have_the_period_of_a_pendulum(friction: float) -> None:
    """T = 2π √(l (1 + I/(m r²))/g), l = R − r, with I/(m r²) = 2/5 where the ball rolls."""
    dt, slope = 1e-3, 0.05
    lever = INNER - SIZE
    rubs = {"friction": friction} if friction else {}
    start = [0.0, INNER - lever * np.cos(slope), lever * np.sin(slope)]
    run = go({**TROUGH, **rubs}, {**BALL, "position": start, **rubs}, dt, 4.0)
    along = run.ledger["momentum.z"]
    turns = np.flatnonzero((along[1:] < 0) & (along[:-1] >= 0))
    at = run.times[turns] + dt * along[turns] / (along[turns] - along[turns + 1])
    period = 2 * np.pi * np.sqrt(lever * (1.4 if friction else 1.0) / 9.80665) * (1 + slope**2 / 16)
    assert np.diff(at).mean() == pytest.approx(period, rel=1e-4)


@pytest.mark.parametrize("shape", ["ball", "capsule"])
@pytest.mark.parametrize("gravity", [False, True])
def test_what_circles_in_a_tube_goes_on(shape: str, gravity: bool) -> None:
    """Without gravity at the same speed, whatever its restitution: it does not hit what it slides along."""
    where, what, center = SHAPES[shape]
    body = {"shape": what, "position": up_the_side(center), "restitution": 0.5, **where}
    speed = 2.0
    body["velocity"] = [0.0, speed * np.sin(SLOPE), speed * np.cos(SLOPE)]
    run = go({**TROUGH, "restitution": 0.5}, body, 1e-3, 1.0, gravity)
    energy = energy_of(run)
    assert energy.max() <= energy[0] * (1 + 1e-9)
    assert energy[-1] == pytest.approx(energy[0], rel=2e-4 if gravity else 1e-9)


def test_a_ball_leaves_a_loop_where_it_has_to(tmp_path: Path) -> None:
    """Thrown around the inside of a pipe from its lowest place, with g l · 2 < v² < g l · 5, it leaves at an angle θ from
    the highest one with cos θ = (v²/(g l) − 2)/3."""
    lever, dt = INNER - SIZE, 2e-4
    speed = np.sqrt(3.5 * 9.80665 * lever)
    frames = record(
        tmp_path / "loop.vtkhdf",
        0.16,
        dt,
        bodies=[{"name": "body", **BALL, "position": [0.0, SIZE, 0.0], "velocity": [0.0, 0.0, speed]}],
        colliders=[TROUGH],
        forces=[{"type": "gravity"}],
        output={"every": 1},
    )
    place = np.array([frame.position[0] for frame in frames]) - [0.0, INNER, 0.0]
    first = int(np.flatnonzero(np.hypot(place[:, 1], place[:, 2]) < lever - 1e-5)[0])
    # It is 10⁻⁵ m off after the angle δ with l δ³ sin θ/2 · g l/v² of about that: 0.1 later.
    left = np.arctan2(place[first, 2], place[first, 1])
    assert left == pytest.approx(np.arccos(0.5), abs=0.1)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("motion", ["led", "turning"])
def test_a_smooth_pipe_that_moves_does_the_same(motion: str) -> None:
    """Led along with the body it looks as at rest; one that turns about its own axis takes no part in what is smooth."""
    body = {**BALL, "position": up_the_side(INNER - SIZE)}
    at_rest = go(TROUGH, body, 1e-3, 1.0)
    wall = {**TROUGH, "name": "pipe"}
    if motion == "led":
        body["velocity"] = [0.0, 0.0, 0.3]
        led = {"collider": "pipe", "path": ["x", "y", "z + 0.3*t"]}
    else:
        led = {"collider": "pipe", "spin": {"axis": [1, 0, 0], "rate": 20}}
    moving = go(wall, body, 1e-3, 1.0, motions=[led])
    assert moving.ledger["momentum.y"] == pytest.approx(at_rest.ledger["momentum.y"], abs=1e-6)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("restitution", [0.0, 0.3])
@pytest.mark.parametrize("lean", [0.0, 0.04, -0.04])
def test_a_wall_that_is_met_from_a_floor_is_no_bend(lean: float, restitution: float) -> None:
    """The places before and behind are next to the floor, and tell nothing of the wall: it had thrown balls back with up to
    0.97 of their speed."""
    cup = {"type": "cone", "start": [0, 0, 0], "end": [0, 0.5, 0], "radius": 0.2, "end_radius": 0.2 + lean}
    cup |= {"inside": True, "restitution": restitution}
    for start in (0.0, 3e-4, 1.7e-3):
        body = {**BALL, "position": [start, SIZE, 0.0], "velocity": [1.0, 0.0, 0.0]}
        along = go(cup, body, 1e-3, 0.3).ledger["momentum.x"]
        assert along.min() / along[0] == pytest.approx(-restitution, abs=0.02)


@pytest.mark.parametrize("dt", [1e-3, 2.5e-4])
@pytest.mark.parametrize("turned", [False, True])
def test_a_can_that_is_flush_with_the_end_of_a_drum_rolls_on_its_side(turned: bool, dt: float) -> None:
    """It had fallen into the side, as it is next to the end everywhere, and been put out again: with energy from nothing."""
    side = np.array([np.sin(1.0), -np.cos(1.0)]) * (0.2 - 0.02)
    place = [0.295, *side[::-1]] if turned else [*side, 0.295]
    ends = [[-0.3, 0, 0], [0.3, 0, 0]] if turned else [[0, 0, -0.3], [0, 0, 0.3]]
    can = {"shape": {"type": "cylinder", "radius": 0.02, "length": 0.01}, "position": place, "friction": 0.3}
    drum = {"type": "cylinder", "start": ends[0], "end": ends[1], "radius": 0.2, "inside": True}
    can |= {"orientation": ALONG} if turned else {}
    run = go({**drum, "restitution": 0, "friction": 0.3}, can, dt, 1.0)
    energy = energy_of(run)
    assert (energy - np.minimum.accumulate(energy)).max() < 1e-5 * run.ledger["kinetic"].max()


@pytest.mark.parametrize("kind", ["disc", "ring"])
@pytest.mark.parametrize("dt", [1e-3, 2.5e-4])
def test_a_coin_that_rolls_about_its_centre_keeps_its_energy(kind: str, dt: float) -> None:
    """Euler's disc: at the angle α it goes around with Ω² = m g a/(I₁ sin α), and the place that touches is at rest. Its rim
    had held on where it touched in the middle of each step: it lost 52 % in a second in steps of 0.5 ms, 7 % in 0.06 ms."""
    a, thin, angle, g = 0.0375, 0.001, np.radians(30), 9.80665
    rate = np.sqrt((4 if kind == "disc" else 2) * g / (a * np.sin(angle)))
    high = a * np.sin(angle) + (0.5 * thin * np.cos(angle) if kind == "disc" else thin)
    shapes = {
        "disc": {"type": "cylinder", "radius": a, "length": thin},
        "ring": {"type": "torus", "radius": a, "tube": thin},
    }
    coin = {
        "shape": shapes[kind],
        "position": [0.0, float(high), 0.0],
        "orientation": {"axis": [1, 0, 0], "angle": -60},
        "angular_velocity": (rate * np.sin(angle) * np.array([0, np.sin(angle), -np.cos(angle)])).tolist(),
    }
    run = go({"type": "plane", "friction": 1.0, "restitution": 0}, coin, dt, 1.0)
    energy, kinetic = energy_of(run), run.ledger["kinetic"][0]
    assert energy.max() <= energy[0] + 1e-6 * kinetic
    assert energy[-1] > energy[0] - 2e-3 * kinetic  # it is not quite thin


@pytest.mark.slow
def test_a_coin_that_leans_rolls_around_a_circle_to_second_order() -> None:
    """It had gained energy, in proportion to the step."""
    a, thin, lean = 0.03, 0.004, np.radians(10)
    axis = np.array([0, np.sin(lean), np.cos(lean)])
    coin = {
        "shape": {"type": "cylinder", "radius": a, "length": thin},
        "position": [0.0, float(a * np.cos(lean) + 0.5 * thin * np.sin(lean)), 0.0],
        "orientation": {"axis": [1, 0, 0], "angle": -10},
        "velocity": [1.0, 0.0, 0.0],
        "angular_velocity": (-axis / a).tolist(),
    }
    ends = []
    for dt in (1e-3, 5e-4, 6.25e-5):
        run = go({"type": "plane", "friction": 0.8, "restitution": 0}, coin, dt, 0.5)
        energy = energy_of(run)
        assert np.ptp(energy) < 1e-5 * run.ledger["kinetic"][0]
        ends.append(np.array([run.ledger[f"momentum.{axis}"][-1] for axis in "xz"]))
    coarse, fine = (np.abs(end - ends[-1]).max() for end in ends[:-1])
    assert fine < 0.3 * coarse


def test_what_tips_over_its_edge_keeps_its_energy_to_second_order() -> None:
    """A domino: held where its edge is in the middle of each step, it gained energy in proportion to the step."""
    high, thick = 0.05, 0.01
    domino = {
        "shape": {"type": "box", "size": [thick, high, 0.03]},
        "position": [0.0, 0.5 * high, 0.0],
        "velocity": [1.5 * high, 1.5 * thick, 0.0],
        "angular_velocity": [0.0, 0.0, -3.0],
    }
    swings = []
    for dt in (2e-3, 5e-4):
        run = go({"type": "plane", "friction": 1.0, "restitution": 0}, domino, dt, 0.1)
        energy = (energy_of(run) - energy_of(run)[0]) / run.ledger["kinetic"].max()
        assert energy.max() < 1e-12
        swings.append(-energy.min())
    assert swings[0] < 1e-3
    assert swings[1] < swings[0] / 12


@pytest.mark.sampled(2)
@pytest.mark.parametrize("apart", [0.0, 0.05])
def test_two_in_a_joint_slide_in_a_trough(apart: float) -> None:
    """Beside each other, or one behind the other, so that the joint pulls: they lost as much as single bodies had."""
    lever = INNER - SIZE
    lag = 2 * np.arcsin(0.5 * 0.3 * apart / lever)
    places = [
        [z, float(INNER - lever * np.cos(slope)), float(lever * np.sin(slope))]
        for z, slope in ((0.0, SLOPE), (0.03 if apart == 0 else 0.0, SLOPE - lag))
    ]
    body = {**BALL, "layout": {"type": "points", "position": places}}
    run = go(TROUGH, body, 1e-3, 2.0, joints=[{"type": "ball", "on": "body", "pairs": [[0, 1]]}])
    energy = (energy_of(run) - energy_of(run)[0]) / run.ledger["kinetic"].max()
    assert energy.max() < 1e-9
    assert energy.min() > -(5e-4 if apart == 0 else 5e-3)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("shape", ["cone", "coin", "box"])
@pytest.mark.parametrize("speed", [0.0, -1.0])
def test_what_falls_on_a_corner_or_a_rim_gains_nothing(shape: str, speed: float) -> None:
    """What parts had been looked at as if it came, in drifts, by how the place that touches would go on freely."""
    shapes = {
        "cone": {"type": "cone", "radius": 0.03, "length": 0.06},
        "coin": {"type": "cylinder", "radius": 0.03, "length": 0.003},
        "box": {"type": "box", "size": [0.04, 0.06, 0.1]},
    }
    body = {
        "shape": shapes[shape],
        "position": [0.0, 0.15, 0.0],
        "velocity": [0.0, speed, 0.0],
        "orientation": {"axis": [1, 0.4, 0.3], "angle": 50},
    }
    for dt in (1e-3, 2e-4):
        run = go({"type": "plane", "restitution": 0, "friction": 0.3}, body, dt, 0.4)
        energy = energy_of(run)
        assert (energy - np.minimum.accumulate(energy)).max() < 2e-4 * run.ledger["kinetic"].max()


@pytest.mark.parametrize("dt", [1e-3, 2.5e-4])
def test_an_impact_of_a_turning_corner_takes_all_of_its_slip(dt: float) -> None:
    """A box that turns at 40/s hits a plane with one of its edges, which sticks, and rebounds with e = 0.3: the impulse is
    that which gives its corner u_t = 0 and −e u_n, wherever in a step it is."""
    size, spin, speed, e = np.array([0.1, 0.06]), 40.0, -1.0, 0.3
    mass = 1000 * size.prod() * 0.04
    inertia = mass / 12 * (size**2).sum()
    corners = 0.5 * size * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])

    def arms(angle: float) -> Any:
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return corners @ turn.T

    times = np.linspace(0, 0.05, 100001)
    angles = np.radians(-20) + spin * times
    lowest = np.array([arms(angle)[:, 1].min() for angle in angles[::10]])
    first = 10 * int(np.argmax(0.06 + speed * times[::10] + lowest < 0))
    arm = min(arms(angles[first]), key=lambda place: place[1])
    comes = np.array([-spin * arm[1], speed + spin * arm[0]])
    gives = np.eye(2) / mass + np.outer([-arm[1], arm[0]], [-arm[1], arm[0]]) / inertia
    impulse = np.linalg.solve(gives, np.array([0, -e * comes[1]]) - comes)
    body = {
        "shape": {"type": "box", "size": [*size.tolist(), 0.04]},
        "density": 1000,
        "position": [0.0, 0.06, 0.0],
        "velocity": [0.0, speed, 0.0],
        "angular_velocity": [0.0, 0.0, spin],
        "orientation": {"axis": [0, 0, 1], "angle": -20},
    }
    run = go({"type": "plane", "restitution": e, "friction": 10.0}, body, dt, 0.025, gravity=False)
    up = run.ledger["momentum.y"]
    struck = int(np.argmax(np.abs(np.diff(up)) > 1e-6 * abs(up[0]))) + 1
    assert run.ledger["momentum.x"][struck] == pytest.approx(impulse[0], rel=1e-3)
    assert up[struck] == pytest.approx(mass * speed + impulse[1], rel=1e-3)
