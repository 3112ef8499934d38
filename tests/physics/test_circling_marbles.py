"""Smooth marbles that circle or swing in round containers, by themselves and against each other: they keep what they have,
also with `symplectic_euler`, whose velocities are half a step late."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import points, table

import particlesim as ps

RADIUS = 0.006
"""Of all marbles [m]."""


def go(
    duration: float,
    dt: float,
    method: str,
    walls: list[dict[str, Any]],
    touch: bool,
    friction: float = 0.0,
    **marbles: Any,
) -> Any:
    rubs = {"friction": friction} if friction else {}
    given = table(
        duration,
        dt,
        method,
        particles=[points(*marbles.pop("at"), **{"radius": RADIUS, "mass": 0.3, **marbles})],
        forces=[{"type": "gravity"}],
        colliders=[{"restitution": 0.3, **rubs, **wall} for wall in walls],
        interactions=[{"type": "contact", "restitution": 0.3, **rubs}] if touch else [],
        output={"every": round(0.02 / dt), "ledger": True},
    )
    return ps.run(ps.from_table(given))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
def test_a_marble_that_others_might_hit_circles_in_a_funnel_as_one_that_none_can(method: str) -> None:
    """With symplectic Euler it lost all of its angular momentum in 2.5 s, as its way was followed with velocities that are
    not those of its places."""
    funnel = {"type": "cone", "start": [0, 0.1, 0], "end": [0, -0.1, 0], "radius": 0.1145, "inside": True}
    marble = {"at": [(0.04, 0.0, 0.0)], "velocity": [[0.0, 0.0, 0.4]]}
    alone, one_of_many = (go(2.0, 2e-3, method, [funnel], touch, **marble) for touch in (False, True))
    assert one_of_many.final.position == pytest.approx(alone.final.position, abs=1e-9)
    assert one_of_many.ledger["angular_momentum.y"] == pytest.approx(-0.3 * 0.04 * 0.4, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [2e-3, 5e-4])
@pytest.mark.parametrize("count", [1, 5])
def test_marbles_circle_on_the_floor_along_a_round_wall(count: int, dt: float) -> None:
    """With symplectic Euler they lost 4 % of their speed in half a second."""
    wall = {"type": "cylinder", "start": [0, -0.1, 0], "end": [0, 0.2, 0], "radius": 0.05, "inside": True}
    around = 0.05 - RADIUS
    angles = 2.05 * RADIUS / around * np.arange(count)
    at = [(around * np.cos(a), RADIUS, around * np.sin(a)) for a in angles]
    velocity = [[-0.4 * np.sin(a), 0.0, 0.4 * np.cos(a)] for a in angles]
    run = go(2.0, dt, "symplectic_euler", [wall, {"type": "plane"}], True, at=at, velocity=velocity)
    assert run.ledger["kinetic"] == pytest.approx(run.ledger["kinetic"][0], rel=1e-3)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
def test_marbles_that_swing_in_a_bowl_on_each_other_gain_nothing(method: str) -> None:
    """Seven that are let go above a bowl swing and circle as one. With symplectic Euler that motion grew by itself, to twice
    the energy that they had been left with."""
    rng = np.random.default_rng(0)
    bowl, at = {"type": "sphere", "center": [0, 0.1, 0], "radius": 0.1, "inside": True}, []
    while len(at) < 7:
        place = rng.uniform([-0.05, 0.05, -0.05], [0.05, 0.09, 0.05])
        if all(np.linalg.norm(place - other) > 4.1 * RADIUS for other in at):
            at.append(place)
    run = go(
        14.0, 5e-3, method, [bowl], True, at=[tuple(map(float, place)) for place in at], radius=2 * RADIUS
    )
    seconds = run.energy[-650:].reshape(13, 50).mean(axis=1)  # from step to step it goes up and down by h u F
    rise = seconds - np.minimum.accumulate(seconds)
    assert rise.max() < 2e-3 * run.ledger["kinetic"].max()


@pytest.mark.parametrize("dt", [5e-3, 1e-3])
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
@pytest.mark.parametrize("kind", ["bowl", "trough"])
def test_a_ball_that_rolls_in_a_bowl_keeps_its_energy(kind: str, method: str, dt: float) -> None:
    """What rolls does not slide, so friction does no work. It swings across the way on which it began, and turns about its
    normal: with friction about the normals of the ends of steps it gained 4 % in four seconds, in steps of 5 ms, and with
    symplectic Euler it lost a quarter, as friction moved it off the bowl by the square of the way that it moves it."""
    bowl = {"type": "sphere", "center": [0, 0.05, 0], "radius": 0.05, "inside": True}
    trough = {"type": "cylinder", "start": [-1, 0.05, 0], "end": [1, 0.05, 0], "radius": 0.05, "inside": True}
    high, aside = 0.05 - 0.044 * np.cos(0.7), 0.044 * np.sin(0.7)
    wall = bowl if kind == "bowl" else trough
    ball = {"at": [(0.0, float(high), float(aside))], "velocity": [[0.2, 0.0, 0.0]]}
    run = go(4.0, dt, method, [wall], True, friction=0.8, **ball)
    seconds = run.energy[50:200].reshape(3, 50).mean(axis=1)  # it slides at first
    kept = 50.0 * dt**2 + 1e-4  # of second order
    assert np.ptp(seconds) < kept * run.ledger["kinetic"].max()


@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
@pytest.mark.parametrize("speed", [4.5, 8.0])
def test_a_fast_marble_in_a_pipe_goes_on_where_others_might_hit_it(speed: float, method: str) -> None:
    """What the pipe turns by more than its weight counted as thrown back: on straight ways it had 64 impacts in each step,
    and stayed where it was for ever."""
    pipe = {"type": "cylinder", "start": [0, 0.5, -2], "end": [0, 0.5, 2], "radius": 0.5, "inside": True}
    given = table(
        0.3,
        1e-3,
        method,
        particles=[points((0.0, 0.03, 0.0), velocity=[[speed, 0.0, 0.3]], radius=0.03)],
        forces=[{"type": "gravity"}],
        colliders=[{"restitution": 0.5, **pipe}],
    )
    alone = ps.run(ps.from_table(given)).final.position
    for restitution in (1.0, 0.5):
        touch = [{"type": "contact", "restitution": restitution}]
        run = ps.run(ps.from_table({**given, "interactions": touch}))
        assert run.final.position == pytest.approx(alone, abs=1e-8)
        assert not run.warnings


@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
@pytest.mark.parametrize("touch", [False, True])
@pytest.mark.parametrize("kind", ["bowl", "trough"])
def test_a_container_that_is_led_evenly_is_as_one_at_rest(kind: str, touch: bool, method: str) -> None:
    """What slid in a bowl that moves lost 8 % of its energy in a second, in steps of 1 ms, and a third in steps of 5 ms."""
    wall = {"type": "sphere", "center": [0, 0.05, 0], "radius": 0.05, "inside": True}
    if kind == "trough":
        wall = {
            "type": "cylinder",
            "start": [-3, 0.05, 0],
            "end": [3, 0.05, 0],
            "radius": 0.05,
            "inside": True,
        }
    found = []
    for led in (0.0, 0.5):
        given = table(
            1.0,
            2e-3,
            method,
            particles=[points((0.0, 0.0163, 0.0283), velocity=[[0.2 + led, 0.3 * led, 0.0]], radius=RADIUS)],
            forces=[{"type": "gravity"}],
            colliders=[{"name": "wall", "restitution": 0.3, **wall}],
            interactions=[{"type": "contact", "restitution": 0.3}] if touch else [],
        )
        if led > 0:
            given["motions"] = [{"collider": "wall", "path": [f"x + {led}*t", f"y + {0.3 * led}*t", "z"]}]
        found.append(ps.run(ps.from_table(given)).final.position[0] - [led, 0.3 * led, 0.0])
    assert found[1] == pytest.approx(found[0], abs=1e-9)


def test_what_slides_in_a_bowl_that_is_shaken_is_right_to_second_order() -> None:
    def end(dt: float) -> Any:
        given = table(
            1.0,
            dt,
            particles=[points((0.0, 0.0163, 0.0283), velocity=[[0.35, 0.0, 0.0]], radius=RADIUS)],
            forces=[{"type": "gravity"}],
            colliders=[
                {"name": "bowl", "type": "sphere", "center": [0, 0.05, 0], "radius": 0.05, "inside": True}
                | {"restitution": 0.3}
            ],
            motions=[{"collider": "bowl", "path": ["x + 0.01*sin(15*t)", "y", "z"]}],
        )
        return ps.run(ps.from_table(given)).final.position[0]

    fine = end(6.25e-5)
    errors = [float(np.abs(end(dt) - fine).max()) for dt in (2e-3, 1e-3, 5e-4)]
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


@pytest.mark.parametrize("stop", [0.05, 0.0501, 0.0505, 0.0509])
def test_what_lies_in_a_bowl_that_stops_flies_on(stop: float) -> None:
    """Whenever in a step that is: a jerk is no force that acts all along it."""
    given = table(
        0.06,
        1e-3,
        particles=[points((0.0, RADIUS, 0.0), velocity=[[1.0, 0.0, 0.0]], radius=RADIUS, mass=1.0)],
        forces=[{"type": "gravity"}],
        colliders=[
            {"name": "bowl", "type": "sphere", "center": [0, 0.05, 0], "radius": 0.05, "inside": True}
            | {"restitution": 0.3}
        ],
        motions=[{"collider": "bowl", "path": [f"x + min(t, {stop})", "y", "z"]}],
        output={"every": 1, "ledger": True},
    )
    run = ps.run(ps.from_table(given))
    rise = float(run.energy[-1]) - 9.80665 * RADIUS
    assert rise == pytest.approx(0.5, abs=2e-3)


@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet"])
@pytest.mark.parametrize("opening", [60.0, 30.0])
def test_a_marble_slides_down_a_narrow_groove_where_others_might_hit_it(opening: float, method: str) -> None:
    """Neither wall gives most of what both do: it counted as moved by nothing that is known, with 64 impacts in a step."""
    half, slope = np.radians(opening / 2), np.radians(15)
    turn = np.array([[np.cos(slope), np.sin(slope), 0], [-np.sin(slope), np.cos(slope), 0], [0, 0, 1]])
    walls = [(turn @ [0, np.sin(half), side * np.cos(half)]).tolist() for side in (1, -1)]
    given = table(
        0.5,
        1e-3,
        method,
        particles=[points(tuple((turn @ [0, 0.05 / np.sin(half), 0]).tolist()), radius=0.05)],
        forces=[{"type": "gravity"}],
        planes=[{"normal": wall, "restitution": 0.0} for wall in walls],
        interactions=[{"type": "contact"}],
    )
    run = ps.run(ps.from_table(given))
    assert run.final.velocity[0] @ turn[:, 0] == pytest.approx(0.5 * 9.80665 * np.sin(slope), rel=1e-6)
    assert not run.warnings


def test_a_fast_marble_in_a_rough_pipe_and_at_the_wall_of_a_cup_goes_on() -> None:
    pipe = {"type": "cylinder", "start": [0, 0.5, -1], "end": [0, 0.5, 1], "radius": 0.5, "friction": 0.3}
    cup = {"type": "cylinder", "start": [0, 0, 0], "end": [0, 1, 0], "radius": 0.5}
    for wall, at, velocity in ((pipe, (0, 0.03, 0), [5, 0, 0.3]), (cup, (0.47, 0.03, 0), [0, 0, 5])):
        ends = []
        for dt in (1e-3, 2.5e-4):
            given = table(
                0.3,
                dt,
                particles=[points(at, velocity=[velocity], radius=0.03)],
                forces=[{"type": "gravity"}],
                colliders=[{"inside": True, "restitution": 0.3, **wall}],
                interactions=[{"type": "contact", "friction": 0.5}],
            )
            run = ps.run(ps.from_table(given))
            assert not run.warnings
            ends.append(run.final.position[0])
        assert ends[0] == pytest.approx(ends[1], abs=1e-3)


def test_marbles_that_fall_fast_into_a_steep_cone_do_not_stay_where_they_are() -> None:
    """Turned by more than a quarter of a radian in a step, they were followed from impact to impact along the wall, which
    are as near to each other as one likes: after 64 they stayed, in 94 % of all steps."""
    cone = {"type": "cone", "start": [0, 1, 0], "end": [0, 0, 0], "radius": 0.268, "inside": True}
    at = [(0.03, 0.25, 0.0), (0.0, 0.2, 0.02), (-0.03, 0.22, 0.0), (0.0, 0.15, -0.015), (0.01, 0.3, 0.01)]
    velocity = [[0, 0, 1], [-1, 0, 0], [0, 0, -1], [1, 0, 0], [0.5, 0, 0.2]]
    run = go(
        2.0, 5e-3, "symplectic_euler", [cone], True, at=at, velocity=velocity, mass=[0.3, 2, 0.5, 1, 0.2]
    )
    stayed = [text for text in run.warnings if "stayed where it was" in text]
    assert all(float(text.split(" (")[1].split(" %")[0]) < 2 for text in stayed)
    energy = run.energy - 0.5 * 9.80665 * 5e-3 * run.ledger["momentum.y"]
    assert energy.max() <= energy[0] * (1 + 1e-9)
