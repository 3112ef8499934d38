"""Rigid bodies go on over faces of colliders that lie flush, as over one, and still meet what is in their way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import G, simulate

H, R = 1e-3, 0.1
"""Step [s]; radius of the balls, and half the edge of the blocks [m]."""
SLOP = 1e-4 * R
"""Overlap that is left alone [m]."""
FAR = ([100.0, -0.5, 0.0], [1.0, 1.0, 1.0])
"""Centre and size of a box that nothing comes to: all scenes have four, and share kernels."""
TILES = [([0.5 * k - 0.5, -0.5, 0.0], [0.5, 1.0, 8.0]) for k in range(4)]
"""Tops from x = −0.75 to 1.25 m."""


def side_by_side(overlap: float = 0.0, width: float = 80.0) -> list[Any]:
    """Two boxes with their tops at y = 0, with the seam at x = 0."""
    size = width + overlap
    return [([-width / 2, -0.5, 0.0], [size, 1.0, 80.0]), ([width / 2, -0.5, 0.0], [size, 1.0, 80.0])]


def run(
    boxes: list[Any], body: dict[str, Any], duration: float, dt: float = H, e: float = 0.0, mu: float = 0.0
) -> Any:
    """A body between boxes after a time."""
    boxes = [*boxes, *[FAR] * (4 - len(boxes))]
    colliders = [{"type": "box", "center": center, "size": size} for center, size in boxes]
    return run_on(colliders, body, duration, dt, e, mu)


def run_on(
    colliders: list[dict[str, Any]], body: dict[str, Any], duration: float, dt: float, e: float, mu: float
) -> Any:
    """A body between colliders after a time."""
    surface = {"friction": mu, "restitution": e}
    result = simulate(
        duration,
        dt,
        bodies=[{"name": "body", "mass": 1.0, **surface, **body}],
        forces=[{"type": "gravity"}],
        colliders=[{"name": f"wall{k}", **surface, **each} for k, each in enumerate(colliders)],
    )
    return result.final


def block(x: float, speed: float, angle: float = 0.0) -> dict[str, Any]:
    a = math.radians(angle)
    return {
        "shape": {"type": "box", "size": [0.2, 0.2, 0.2]},
        "position": [x * math.cos(a), 0.1, x * math.sin(a)],
        "velocity": [speed * math.cos(a), 0.0, speed * math.sin(a)],
    }


def ball(x: Any, v: Any) -> dict[str, Any]:
    return {"shape": {"type": "sphere", "radius": R}, "position": x, "velocity": v}


@pytest.mark.parametrize("angle", [0.0, 30.0])
@pytest.mark.parametrize("overlap", [0.0, 0.3])
@pytest.mark.parametrize(("x", "speed"), [(-0.15, 0.5), (-0.5, 3.0)])
def test_a_block_slides_over_a_seam(x: float, speed: float, overlap: float, angle: float) -> None:
    """As far as friction lets it, v²/(2 μ g), and without friction for good. It had tumbled, or stopped.

    In the middle of a step it is h²/8 times its deceleration beyond the parabola, and in its last step h v/2 with v < μ g h:
    both far less than a thousandth of the way."""
    mu = 0.1
    way = speed * speed / (2 * mu * G)
    got = run(side_by_side(overlap), block(x, speed, angle), math.ceil(10 * speed / (mu * G)) / 10, mu=mu)
    place, turn = got.position[0], got.orientation[0]
    assert math.hypot(place[0], place[2]) == pytest.approx(abs(x + way), abs=1e-3 * way)
    assert abs(place[1] - 0.1) < SLOP
    assert np.abs(turn[1:]).max() < 1e-9
    got = run(side_by_side(overlap), block(x, speed, angle), 0.6)
    assert math.hypot(got.velocity[0, 0], got.velocity[0, 2]) == pytest.approx(speed, rel=1e-6)


@pytest.mark.parametrize("gap", [0.0, 1e-9])
@pytest.mark.parametrize("shape", ["ball", "block"])
def test_what_goes_over_tiles_keeps_its_speed_and_height(shape: str, gap: float) -> None:
    """A ball had hopped by 3 mm."""
    body = ball([-0.6, R, 0.1], [3.0, 0.0, 0.2]) if shape == "ball" else block(-0.6, 3.0)
    tiles = [(c, [size[0] - gap, *size[1:]]) for c, size in TILES]
    for duration in (0.1, 0.2, 0.33, 0.5):
        got = run(tiles, body, duration)
        assert got.position[0, 0] == pytest.approx(-0.6 + 3 * duration, abs=1e-6)
        assert got.position[0, 1] == pytest.approx(R, abs=1e-6)
        assert got.velocity[0] == pytest.approx(body["velocity"], abs=3e-6)


@pytest.mark.parametrize("shift", [0.0, 2e-6, -2e-6, 0.01])
@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-5, 1e-4])
def test_a_block_whose_corners_are_at_a_seam_rests(gap: float, shift: float) -> None:
    """Its corners lie over neither of the boxes, or over both."""
    tiles = [(c, [size[0] - gap, *size[1:]]) for c, size in TILES]
    falls = block(0.15 + shift, 0.0)
    falls["position"][1] = 0.3
    got = run(tiles, falls, 1.0, mu=0.5)
    assert got.position[0] == pytest.approx([0.15 + shift, 0.1, 0.0], abs=SLOP)
    assert np.abs(got.velocity[0]).max() < 1e-9


def test_a_box_that_is_sunk_flush_into_the_ground_is_no_hindrance() -> None:
    """Its edges are askew to the way."""
    plane = {"type": "plane", "normal": [0, 1, 0]}
    sunk = {"type": "box", "center": [0.0, -0.2, 0.0], "size": [0.5, 0.4, 0.5]}
    turned = sunk | {"orientation": {"axis": [0, 1, 0], "angle": 25.0}}
    for body in (ball([-0.6, R, 0.05], [3.0, 0.0, 0.2]), block(-0.6, 3.0)):
        for duration in (0.13, 0.4):
            got = run_on([plane, turned], body, duration, H, 0.0, 0.0)
            assert got.velocity[0] == pytest.approx(body["velocity"], abs=3e-6)
            assert got.position[0, 1] == pytest.approx(R, abs=1e-6)


def test_thin_sheets_side_by_side_are_one_floor() -> None:
    """Their edges are round, and stand into each other."""
    half = 0.5e-4 * 8.0
    sheets = [
        {"type": "rectangle", "center": [0.5 * k - 0.5, -half, 0], "size": [0.5, 8.0]} for k in range(4)
    ]
    for body in (ball([-0.6, R, 0.05], [3.0, 0.0, 0.2]), block(-0.6, 3.0)):
        got = run_on(sheets, body, 0.5, H, 0.0, 0.0)
        assert got.velocity[0] == pytest.approx(body["velocity"], abs=3e-6)
        assert got.position[0, 1] == pytest.approx(R, abs=1e-6)


@pytest.mark.parametrize("speed", [100.0, 300.0, 3000.0])
def test_swift_bodies_go_on_over_a_seam(speed: float) -> None:
    boxes = side_by_side(width=2000.0)
    duration = 60 / speed
    for body in (ball([-40, R, 0.1], [speed, 0.0, 1.0]), block(-40.0, speed, 1.0)):
        got = run(boxes, body, duration, dt=duration / 20)
        assert got.velocity[0] == pytest.approx(body["velocity"], abs=1e-6 * speed)
        assert got.position[0, 1] == pytest.approx(R, abs=1e-6)


def test_a_ball_meets_a_step_that_is_no_seam() -> None:
    """With the side of the edge at an angle to the floor of cos θ = (R − s)/R its speed along the step is left, of which
    v cos² θ goes on, less what gravity takes of it in the two steps until the end. The normal is that of a step before the
    impact at the latest, v h/(R sin θ) off."""
    speed, step, h = 0.5, 0.02, 1e-4
    boxes = side_by_side()
    boxes[1] = ([40.0, -0.5 + step / 2, 0.0], [80.0, 1.0 + step, 80.0])
    touches = -math.sqrt(R * R - (R - step) ** 2)
    got = run(boxes, ball([touches - 0.05, R, 0.0], [speed, 0.0, 0.0]), 0.1002, dt=h)
    cos = (R - step) / R
    sin = math.sqrt(1 - cos * cos)
    slack = 2 * cos * speed * h / R * speed + 2 * h * G * sin * cos
    assert got.velocity[0, 0] == pytest.approx(speed * cos * cos, abs=slack)


@pytest.mark.parametrize("size", [1.5, 3.0, 10.0, 100.0])
def test_a_block_stops_at_a_step_above_the_overlap_that_is_left_alone(size: float) -> None:
    """Steps of so many times that overlap."""
    step = size * SLOP
    boxes = side_by_side()
    boxes[1] = ([40.0, -0.5 + step / 2, 0.0], [80.0, 1.0 + step, 80.0])
    got = run(boxes, block(-0.2, 0.5), 0.5)
    assert got.velocity[0, 0] < 0.4


def test_walls_on_the_floor_and_free_edges_are_met() -> None:
    """Walls that stand on the floor, or beside it, are no seams; nor is the side of an edge with nothing beside it, where
    v' = v − 2 (v·n) n with the normal n from the edge to the centre."""
    floor = ([0.0, -0.5, 0.0], [80.0, 1.0, 80.0])
    for wall in (([1.5, 2.0, 0.0], [1.0, 4.0, 80.0]), ([41.0, 0.0, 0.0], [2.0, 4.0, 80.0])):
        near = wall[0][0] - wall[1][0] / 2
        got = run([floor, wall], ball([near - 0.3, R, 0.0], [2.0, 0.0, 0.5]), 0.2, e=1.0)
        assert got.velocity[0] == pytest.approx([-2.0, 0.0, 0.5], abs=1e-9)
        got = run([floor, wall], block(0.0, 2.0) | {"position": [near - 0.3, R, 0.0]}, 0.2, e=1.0)
        assert got.velocity[0] == pytest.approx([-2.0, 0.0, 0.0], abs=1e-9)
        assert np.abs(got.orientation[0, 1:]).max() < 1e-9
    # From below against the free side of the right one of two boxes, whose tops are flush, beyond the end of the left one.
    boxes = [([-1.0, -0.5, 0.0], [2.0, 1.0, 1.0]), ([1.0, -0.5, 0.0], [2.0, 1.0, 80.0])]
    got = run(boxes, ball([-0.3, -0.05, 0.7], [4.0, 0.5, 0.0]), 0.08, e=1.0)
    assert got.velocity[0] == pytest.approx([-4.0, 0.5 - 0.08 * G, 0.0], abs=1e-9)


@pytest.mark.parametrize("beside", [False, True])
def test_a_plate_with_its_foot_in_a_corner_stands(beside: bool) -> None:
    """Between two walls on a floor, without friction: both its contacts in the corner hold it."""
    height, wide, thick = 4.0, 0.6, 0.02
    low = -1.0 if beside else 0.0
    angle = math.radians(60.0)
    length = 0.8
    across = length * math.cos(angle) + thick * math.sin(angle)
    up = length * math.sin(angle) + thick * math.cos(angle)
    walls = [
        ([-0.5, (low + height) / 2, 0.0], [1.0, height - low, 4.0]),
        ([across + 0.5, (low + height) / 2, 0.0], [1.0, height - low, 4.0]),
    ]
    floor = ([across / 2, -0.5, 0.0], [across if beside else 4.0, 1.0, 4.0])
    plate = {
        "shape": {"type": "box", "size": [length, thick, wide]},
        "position": [across / 2, up / 2, 0.0],
        "orientation": {"axis": [0, 0, 1], "angle": 60.0},
    }
    got = run([floor, *walls], plate, 1.0)
    assert got.position[0] == pytest.approx([across / 2, up / 2, 0.0], abs=SLOP)
    assert np.abs(got.velocity[0]).max() < 1e-6
