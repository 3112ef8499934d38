"""What is put together with half-spaces, and of what is put together itself: where balls come to rest on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import G, points, table, way

import particlesim as ps

BALL = {"type": "sphere", "radius": 1.0}
GROUND = {"type": "plane"}
R = 0.05
"""Radius of what falls [m]."""
PIT = {"type": "difference", "of": [GROUND, {"type": "sphere", "radius": 0.5}]}
HILL = {"type": "union", "of": [GROUND, {"type": "sphere", "radius": 0.5}]}
DISH = {"type": "intersection", "of": [BALL, {"type": "plane", "normal": [1, 2, 0]}]}
LOW = {"type": "difference", "of": [{"type": "box", "size": [2, 2, 2]}, GROUND]}
KNOB = {"type": "sphere", "center": [0, 0.5, 0], "radius": 0.4}
PIERCED = {
    "type": "difference",
    "of": [
        {"type": "union", "of": [{"type": "box", "size": [2, 1, 2]}, KNOB]},
        {"type": "cylinder", "start": [0, -2, 0], "end": [0, 2, 0], "radius": 0.2},
    ],
}
BOWL = {"type": "union", "of": [DISH, {"type": "sphere", "center": [0, -3, 0], "radius": 0.5}]}


@pytest.mark.sampled(7)
@pytest.mark.parametrize(
    ("shape", "x", "height"),
    [
        pytest.param(PIT, (2.0, 0.3, 0.0), R, id="beside a pit in the ground"),
        pytest.param(PIT, (0.0, 0.3, 0.0), -0.5 + R, id="in a pit in the ground"),
        pytest.param(HILL, (0.0, 0.9, 0.0), 0.5 + R, id="on a hill on the ground"),
        pytest.param(HILL, (2.0, 0.3, 0.0), R, id="beside a hill on the ground"),
        pytest.param(LOW, (0.3, 0.9, 0.2), 1.0 + R, id="on half of a box"),
        pytest.param(PIERCED, (0.7, 0.9, 0.0), 0.5 + R, id="on a box with a knob and a hole"),
        pytest.param(BOWL, (0.0, -2.2, 0.0), -2.5 + R, id="on a ball beside half of one"),
    ],
)
def test_balls_rest_on_what_is_put_together(
    shape: dict[str, Any], x: tuple[float, float, float], height: float
) -> None:
    h = 0.01
    places, speeds = way(
        150,
        150 * h,
        h,
        "velocity_verlet",
        particles=[points(list(x), radius=R, mass=1.0)],
        forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
        colliders=[{**shape, "restitution": 0.0}],
    )
    np.testing.assert_allclose(places[-1], [[x[0], height, x[2]]], atol=1e-9)
    np.testing.assert_allclose(speeds[-1], 0, atol=1e-9)


def test_balls_slide_down_half_of_a_ball_cut_at_an_angle() -> None:
    # without friction, with g sin θ along a plane with the normal (1, 2, 0)
    h, steps, c, s = 0.01, 20, 2 / np.sqrt(5), 1 / np.sqrt(5)
    up, down = np.array([s, c, 0]), np.array([c, -s, 0])
    places, _ = way(
        steps,
        steps * h,
        h,
        "velocity_verlet",
        particles=[points((R * up).tolist(), radius=R, mass=1.0)],
        forces=[{"type": "gravity", "acceleration": [0, -G, 0]}],
        colliders=[{**DISH, "restitution": 0.0}],
    )
    np.testing.assert_allclose(places[-1][0], R * up + 0.5 * G * s * (steps * h) ** 2 * down, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "of", "why"),
    [
        ("union", [GROUND, GROUND], "where planes alone end is not known"),
        ("difference", [GROUND, {**GROUND, "normal": [1, 0, 0]}], "where planes alone end is not known"),
        ("intersection", [BALL, {**GROUND, "point": [0, -3, 0]}], "have nothing in common"),
        ("difference", [BALL, {**GROUND, "point": [0, 3, 0]}], "nothing is left of a sphere without a plane"),
        ("union", [BALL, {"type": "rectangle", "size": [1, 1]}], 'unknown type "rectangle"'),
        ("union", [BALL, {"type": "union", "of": [BALL, DISH]}], 'unknown type "intersection"'),
    ],
)
def test_what_cannot_be_put_together_is_refused(kind: str, of: list[dict[str, Any]], why: str) -> None:
    with pytest.raises(ps.ScenarioError, match=why):
        ps.from_table(
            table(
                1.0,
                0.01,
                "velocity_verlet",
                particles=[points([0, 9, 0])],
                colliders=[{"type": kind, "of": of}],
            )
        )


@pytest.mark.parametrize("thick", [1e-3, 1e-6, 1e-9])
def test_no_point_passes_what_convex_solids_have_in_common_however_thin_it_is(thick: float) -> None:
    """Points had passed what is thinner than 10⁻⁴ of the least length of the parts."""
    over = [0, -thick, 0]
    places, _ = way(
        40,
        0.04,
        1e-3,
        "velocity_verlet",
        particles=[
            points(
                *((0.013 + 0.11 * k, 0.5 + 0.013 * k, 0.007 * k) for k in range(8)), velocity=[[0, -1000, 0]]
            )
        ],
        forces=[{"type": "gravity"}],
        colliders=[
            {
                "type": "intersection",
                "of": [
                    {"type": "box", "size": [2, 0.2, 2], "center": [0, -0.1, 0]},
                    {"type": "cylinder", "start": over, "end": [0, 1, 0], "radius": 3.0},
                ],
                "restitution": 0.3,
            }
        ],
    )
    assert (places[:, :, 1] > -1e-9).all()
    assert (places[-1, :, 1] > 1).all()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["union", "difference"])
def test_what_begins_with_a_plane_can_be_led(kind: str) -> None:
    """By the point of that plane. It had ended with a mistake of psim, also without a motion where a point might pass it."""
    places, speeds = way(
        50,
        0.5,
        1e-2,
        "velocity_verlet",
        particles=[points((3.0, 0.0, 0.0), mass=1.0)],
        forces=[{"type": "gravity"}],
        colliders=[{"type": kind, "name": "ground", "of": [GROUND, KNOB], "restitution": 0.0}],
        motions=[{"collider": "ground", "path": ["x", "y + 0.5 * t", "z"]}],
    )
    np.testing.assert_allclose(places[-1], [[3.0, 0.25, 0.0]], atol=1e-9)
    np.testing.assert_allclose(speeds[-1], [[0.0, 0.5, 0.0]], atol=1e-9)


ROOMS = {
    "wall": [{"type": "box", "center": [x, 0, 0], "size": [1, 2, 2]} for x in (-0.5, 0.5)],
    "box": {"type": "box", "size": [2.002, 2.002, 2.002]},
}


def apart(solids: list[dict[str, Any]], thick: float) -> list[dict[str, Any]]:
    """Two rooms that a wall of some thickness parts."""
    sides = (-0.5 - 0.5 * thick, 0.5 + 0.5 * thick)
    return [{**solid, "center": [x, 0, 0]} for solid, x in zip(solids, sides, strict=True)]


@pytest.mark.parametrize("thick", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize(
    "kind", ["rooms in a box", "rooms put together", "a blade in a room", "a pipe", "a shell"]
)
def test_no_point_passes_what_is_left_of_convex_solids_however_thin_it_is(kind: str, thick: float) -> None:
    """Points had passed what is thinner than 10⁻⁴ of the least length of the parts."""
    two, rng, n = apart(ROOMS["wall"], thick), np.random.default_rng(3), 60
    pipe = [{"type": "cylinder", "start": [0, -s, 0], "end": [0, s, 0]} for s in (1, 2)]
    solid: dict[str, Any] = {
        "rooms in a box": {"type": "difference", "of": [ROOMS["box"], {"type": "union", "of": two}]},
        "rooms put together": {"type": "union", "of": two, "inside": True},
        "a blade in a room": {
            "type": "difference",
            "inside": True,
            "of": [{"type": "box", "size": [2, 2, 2]}, {"type": "box", "size": [thick, 3, 3]}],
        },
        "a pipe": {
            "type": "difference",
            "of": [pipe[0] | {"radius": 1.0}, pipe[1] | {"radius": 1 - thick}],
        },
        "a shell": {"type": "difference", "of": [BALL, {**BALL, "radius": 1 - thick}]},
    }[kind]
    side, a = np.where(np.arange(n) % 2, 1.0, -1.0), rng.uniform(0, 2 * np.pi, n)
    x = np.stack([side * rng.uniform(0.1, 0.5, n), *rng.uniform(-0.5, 0.5, (2, n))], axis=1)
    v = 10 ** rng.uniform(0, 3, (n, 1)) * np.stack([np.cos(a), 0 * a, np.sin(a)], axis=1)
    layout = {"type": "points", "position": x.tolist(), "velocity": v.tolist()}
    given = table(0.1, 0.01, particles=[{"layout": layout}], colliders=[{**solid, "restitution": 0.9}])
    end = np.array(ps.run(ps.from_table(given)).final["position"])
    if kind in ("a pipe", "a shell"):
        assert np.hypot(end[:, 0], end[:, 2]).max() < 1
    else:
        assert (end[:, 0] * side).min() > 0
        assert np.abs(end).max() < 1.001


@pytest.mark.parametrize("thick", [1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("c", [0.5000005, 0.61368046549952, 0.7])
def test_points_that_come_to_an_edge_of_a_room_stay_in_it(c: float, thick: float) -> None:
    """The second of two walls is met at once after the first, where rounding decides on which side of it one is."""
    room = {"type": "box", "center": [c] * 3, "size": [1, 1, 1]}
    walls = {"type": "box", "size": [2 * (c + 0.5 + thick)] * 3}
    rng, n = np.random.default_rng(0), 200
    x, to = rng.uniform(c - 0.4, c + 0.4, (n, 3)), rng.uniform(c - 0.5, c + 0.5, (n, 3))
    to[:, [0, 2]] = c + 0.5
    v = (to - x) * (10 ** rng.uniform(-1, 2, n) / np.linalg.norm(to - x, axis=1))[:, None]
    layout = {"type": "points", "position": x.tolist(), "velocity": v.tolist()}
    given = table(
        0.2,
        0.01,
        particles=[{"layout": layout}],
        colliders=[{"type": "difference", "of": [walls, room], "restitution": 1.0}],
    )
    end = np.array(ps.run(ps.from_table(given)).final["position"])
    assert np.abs(end - c).max() < 0.5 + 1e-9
