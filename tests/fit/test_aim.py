"""Aiming finds every direction that hits."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from particlesim.errors import UsageError
from particlesim.fit import aim

SPEED = 15.0


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.toml"
    path.write_text(
        f"""
        [simulation]
        duration = 4.0
        dt = 0.04
        integrator = "rk4"
        [[particles]]
        name = "ball"
        layout = {{ type = "points", position = [[0, 0, 0]], velocity = [[{SPEED}, 0, 0]] }}
        mass = 0.5
        [[forces]]
        type = "gravity"
        acceleration = [0, -10, 0]
        [[forces]]
        name = "wind"
        type = "linear_drag"
        coefficient = 0
        """
    )
    return path


@pytest.mark.parametrize(
    "target",
    [
        (8.0, 3.0, 6.0),
        pytest.param((20.0, 0.0, 0.0), marks=pytest.mark.slow),
        pytest.param((10.0, -5.0, 0.0), marks=pytest.mark.slow),
    ],
)
def test_without_air_both_angles_are_those_of_the_parabola(ball, target):
    """tan θ = (v² ± √(v⁴ − g (g d² + 2 h v²)))/(g d)."""
    distance, height, g = math.hypot(target[0], target[2]), target[1], 10.0
    found = aim(ball, "ball", target)
    root = math.sqrt(SPEED**4 - g * (g * distance**2 + 2 * height * SPEED**2))
    expected = [math.degrees(math.atan((SPEED**2 + sign * root) / (g * distance))) for sign in (-1, 1)]
    # RK4 is exact for a parabola
    assert [shot.elevation for shot in found.shots] == pytest.approx(expected, abs=1e-6)
    assert [shot.azimuth for shot in found.shots] == pytest.approx([0, 0], abs=1e-6)
    for shot in found.shots:
        assert math.hypot(*shot.velocity) == pytest.approx(SPEED)
        assert shot.time == pytest.approx(distance / (SPEED * math.cos(math.radians(shot.elevation))))


def test_wind_from_the_side_is_allowed_for(ball):
    wind = {"forces.wind.coefficient": 0.05, "forces.wind.flow": [{"type": "uniform", "velocity": [0, 0, 4]}]}
    found = aim(ball, "ball", (12.0, 0.0, 0.0), overrides=wind)
    assert len(found.shots) == 2
    for shot in found.shots:
        assert shot.miss < 1e-7
        assert shot.velocity[2] < 0  # against the wind


STEEP = {"simulation.duration": 3.2, "particles.ball.layout.velocity": [[0, 5, 0]]}


@pytest.mark.sampled(5)
@pytest.mark.parametrize(
    ("target", "elevations"),
    [
        # tan θ = (v² ± √(v⁴ − g (g d² + 2 h v²)))/(g d) with v = 5 m/s
        ((0.1, 1.0, 0.0), [85.556, 88.418]),
        pytest.param((0.0, 1.0, 0.01), [89.5563, 89.842], marks=pytest.mark.slow),
        pytest.param((0.1, -1.0, 0.0), [-83.315, 89.037], marks=pytest.mark.slow),
        ((0.0, 1.0, 0.0), [90.0]),
        ((0.0, -3.0, 0.0), [-90.0, 90.0]),
    ],
)
def test_steep_shots(ball, target, elevations):
    distance, height, speed, g = math.hypot(target[0], target[2]), target[1], 5.0, 10.0
    found = aim(ball, "ball", target, overrides=STEEP)
    if distance:
        root = math.sqrt(speed**4 - g * (g * distance**2 + 2 * height * speed**2))
        elevations = [math.degrees(math.atan2(speed**2 + sign * root, g * distance)) for sign in (-1, 1)]
    assert [shot.elevation for shot in found.shots] == pytest.approx(elevations, abs=1e-6)
    assert [shot.azimuth for shot in found.shots] == pytest.approx([0] * len(elevations), abs=1e-5)


@pytest.mark.slow
def test_a_shot_that_the_wind_turns_round(ball):
    """Against a storm a ball launched away from the target is blown back over it."""
    storm = {
        "forces.wind.coefficient": 1.0,
        "forces.wind.flow": [{"type": "uniform", "velocity": [30, 0, 0]}],
    }
    found = aim(ball, "ball", (20.0, 1.0, 0.0), overrides=storm)
    assert sorted(round(abs(shot.azimuth)) for shot in found.shots) == [0, 180]
    assert all(shot.miss < 1e-8 for shot in found.shots)


@pytest.mark.slow
def test_a_target_that_a_plane_keeps_away(ball):
    floor = {"planes": [{"point": [0, -1, 0], "restitution": 0.5}], "particles.ball.radius": 0.05}
    floor |= {
        "simulation.dt": 0.02,
        "simulation.duration": 3.2,
    }  # short steps: between two there is no bounce
    with pytest.raises(
        UsageError, match=r"is 0\.04 m from a plane, which keeps the centre of 'ball' 0\.05 m off"
    ) as caught:
        aim(ball, "ball", (10.0, -0.96, 0.0), overrides=floor)
    point = tuple(float(part) for part in str(caught.value.hint).split("--target ")[1].split(","))
    assert len(aim(ball, "ball", point, overrides=floor).shots) >= 2


def test_a_target_at_the_start(ball):
    with pytest.raises(UsageError, match="where 'ball' starts"):
        aim(ball, "ball", (0.0, 0.0, 0.0))


def test_out_of_range(ball):
    with pytest.raises(UsageError, match="out of range: the nearest"):
        aim(ball, "ball", (60.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("group", "target", "overrides", "words"),
    [
        ("bal", (1, 0, 0), {}, "no group 'bal'"),
        ("ball", (1, 0), {}, "three finite numbers"),
        ("ball", (1, math.nan, 0), {}, "three finite numbers"),
        ("ball", (1, 0, 0), {"particles.ball.layout.velocity": [[0, 0, 0]]}, "without speed"),
        ("ball", (1, 0, 0), {"particles.ball.pinned": True}, "does not fly"),
        (
            "ball",
            (1, 0, 0),
            {
                "particles.ball.layout.position": [[0, 0, 0], [1, 1, 1]],
                "particles.ball.layout.velocity": [[1, 0, 0]],
            },
            "not one particle",
        ),
    ],
)
def test_what_cannot_be_aimed(ball, group, target, overrides, words):
    with pytest.raises(UsageError, match=words):
        aim(ball, group, target, overrides=overrides)


@pytest.mark.slow
@pytest.mark.parametrize(
    "place",
    [
        "position = [0, 0, 0]\nvelocity = [15, 0, 0]",
        pytest.param(
            'layout = { type = "points", position = [[0, 0, 0]], velocity = [[15, 0, 0]] }',
            marks=pytest.mark.slow,
        ),
    ],
    ids=["position", "layout"],
)
def test_a_body_is_aimed_as_a_particle(ball, place):
    # tan θ = (v² ± √(v⁴ − g (g d² + 2 v² y)))/(g d), d the distance over ground
    text = ball.read_text()
    begin, end = text.index("[[particles]]"), text.index("[[forces]]")
    shape = '[[bodies]]\nname = "ball"\nshape = { type = "box", size = [0.1, 0.2, 0.3] }\n'
    ball.write_text(text[:begin] + shape + place + "\n" + text[end:])
    found = aim(ball, "ball", (8.0, 3.0, 6.0))
    root = math.sqrt(SPEED**4 - 10 * (10 * 100 + 2 * SPEED**2 * 3))
    angles = [math.degrees(math.atan((SPEED**2 + sign * root) / 100)) for sign in (-1, 1)]
    assert [shot.elevation for shot in found.shots] == pytest.approx(angles, abs=1e-6)
    for shot in found.shots:
        assert shot.scenario.bodies[0].layout.velocity[0] == pytest.approx(shot.velocity)


def test_bodies_are_not_aimed_together(ball):
    text = ball.read_text()
    begin, end = text.index("[[particles]]"), text.index("[[forces]]")
    two = """
        [[bodies]]
        name = "ball"
        shape = { type = "sphere", radius = 0.1 }
        layout = { type = "points", position = [[0, 0, 0], [1, 0, 0]], velocity = [[15, 0, 0]] }
    """
    ball.write_text(text[:begin] + two + text[end:])
    with pytest.raises(UsageError, match="not one body"):
        aim(ball, "ball", (8.0, 3.0, 6.0))


@pytest.mark.slow
def test_a_target_that_a_plane_keeps_a_body_away_from(ball):
    # the corners of a cube are √3/2 of its side away from its centre
    text = ball.read_text()
    begin, end = text.index("[[particles]]"), text.index("[[forces]]")
    cube = """
        [[planes]]
        point = [0, -1, 0]
        [[bodies]]
        name = "ball"
        shape = { type = "box", size = [0.2, 0.2, 0.2] }
        velocity = [15, 0, 0]
    """
    ball.write_text(text[:begin] + cube + text[end:])
    with pytest.raises(UsageError, match=r"'ball' 0\.173205 m off, or less, as it is turned"):
        aim(ball, "ball", (8.0, -0.96, 0.0))
