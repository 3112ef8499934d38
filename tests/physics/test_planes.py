"""Bounces, and planes that catch or kill."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from simulate import EPS, G, points, record, simulate, way

GRAVITY = [{"type": "gravity"}]


@pytest.mark.parametrize("bounces", [1, 2, 4])
def test_bounce_heights_shrink_by_the_square_of_the_restitution(bounces: int) -> None:
    # Dropped from H: the first fall takes t0 = √(2H/g), bounce k flies 2 eᵏ t0 and rises to e²ᵏ H. Velocity Verlet is
    # exact between impacts and the moment of impact is found to rounding; it shifts by EPS·T, the ball by v times that.
    height, e, r = 2.0, 0.8, 0.1
    t0 = math.sqrt(2 * height / G)
    apex = t0 * (1 + 2 * sum(e**k for k in range(1, bounces)) + e**bounces)
    final = simulate(
        apex,
        apex / 700,
        particles=[points((0.5, height + r, 0), radius=r)],
        forces=GRAVITY,
        planes=[{"restitution": e}],
    ).final
    assert final.position[0] == pytest.approx([0.5, r + e ** (2 * bounces) * height, 0], abs=1e-11)
    assert final.velocity[0] == pytest.approx([0, 0, 0], abs=1e-9)


def test_an_impact_takes_its_part_of_the_sliding_speed() -> None:
    # v' = (1 − k) v_t − e v_n at the first impact, after t0 = √(2H/g); then a parabola.
    height, e, loss = 1.0, 0.5, 0.3
    t0 = math.sqrt(2 * height / G)
    t = 1.5 * t0
    final = simulate(
        t,
        t / 500,
        particles=[points((0, height, 0), velocity=[(2.0, 0, -1.0)], radius=0.0)],
        forces=GRAVITY,
        planes=[{"restitution": e, "tangential_loss": loss}],
    ).final
    s = 0.5 * t0
    up = e * G * t0
    slid = t0 + (1 - loss) * s
    assert final.position[0] == pytest.approx([2 * slid, up * s - G * s * s / 2, -slid], abs=1e-12)
    assert final.velocity[0] == pytest.approx([2 * (1 - loss), up - G * s, -(1 - loss)], abs=1e-12)


def test_an_inclined_plane_mirrors_the_velocity() -> None:
    # Straight down on a plane at 45°: an elastic impact sends the ball off level, with the speed of the fall.
    t0, s = math.sqrt(2 / G), 0.2
    final = simulate(
        t0 + s,
        (t0 + s) / 333,
        particles=[points((0, 1, 0))],
        forces=GRAVITY,
        planes=[{"normal": [3, 3, 0]}],
    ).final
    assert final.position[0] == pytest.approx([G * t0 * s, -G * s * s / 2, 0], abs=1e-12)


def free(
    duration: float, dt: float, contact: str, path: Path
) -> tuple[np.ndarray, dict[str, np.ndarray], list[int]]:
    """Three particles that fly down at 1, 2 and 3 m/s from 1 m: last positions, deaths, number of each left."""
    plane = {"contact": contact}
    if contact == "bounce":
        plane |= {"restitution": 0.5}
    with record(
        path,
        duration,
        dt,
        "symplectic_euler",
        emitters=[
            {
                "name": f"e{v}",
                "burst": {"count": 1, "at": 0.0},
                "shape": {"type": "point", "position": [0, 1, 0]},
                "direction": [0, -1, 0],
                "speed": float(v),
            }
            for v in (1, 2, 3)
        ],
        planes=[plane],
    ) as trajectory:
        return trajectory[-1].position, trajectory.events("death"), trajectory[-1].id.tolist()


def test_a_plane_kills_at_the_moment_of_impact(tmp_path: Path) -> None:
    # No force: the impact is at 1 m / v, found inside the step; the slowest is still on its way.
    position, deaths, left = free(0.9, 0.09, "kill", tmp_path / "k.vtkhdf")
    assert left == [0]
    assert position[0] == pytest.approx([0, 0.1, 0], abs=10 * EPS)
    assert deaths["id"].tolist() == [1, 2]
    assert deaths["cause"].tolist() == ["plane", "plane"]
    assert deaths["time"] == pytest.approx([1 / 2, 1 / 3], abs=10 * EPS)


def test_a_plane_that_catches_keeps_particles_where_they_touched(tmp_path: Path) -> None:
    position, deaths, left = free(0.9, 0.09, "stick", tmp_path / "s.vtkhdf")
    assert left == [0, 1, 2]
    assert len(deaths["id"]) == 0
    assert position[1:] == pytest.approx(np.zeros((2, 3)), abs=4 * EPS)


def test_a_particle_reflects_inside_the_step(tmp_path: Path) -> None:
    # At 2 and 3 m/s with e = ½: up at 1 and 1.5 m/s since 1/2 s and 1/3 s, whatever the step.
    position, _, _ = free(0.9, 0.3, "bounce", tmp_path / "b.vtkhdf")
    assert position[:, 1] == pytest.approx([0.1, 1.0 * (0.9 - 1 / 2), 1.5 * (0.9 - 1 / 3)], abs=20 * EPS)


def test_planes_act_on_the_groups_they_name() -> None:
    final = simulate(
        1.0,
        0.01,
        particles=[
            points((0, 0.5, 0), name="held", radius=0.0),
            points((0, 0.5, 0), name="passes", radius=0.0),
        ],
        forces=GRAVITY,
        planes=[{"on": ["held"], "restitution": 0.0}],
    ).final
    assert final.position[0, 1] == pytest.approx(0, abs=1e-12)
    assert final.position[1, 1] == pytest.approx(0.5 - G / 2, abs=1e-12)


def test_what_lands_without_a_rebound_lies_still_with_symplectic_euler() -> None:
    """Its velocity along the floor is a rounding error; what the method owes to that, as its velocities are late by half a
    step, had been given to it, up to g dt/2 (16 mm/s here)."""
    rng = np.random.default_rng(4)
    n, h = 200, 0.01
    up = np.array([0.37, 0.81, -0.45]) / np.linalg.norm([0.37, 0.81, -0.45])
    heights, speeds = rng.uniform(0.01, 1, n), 10 ** rng.uniform(-1, 4, n)
    x = rng.uniform(-1, 1, (n, 3))
    x += np.outer(heights - x @ up, up)
    _, v = way(
        60,
        60 * h,
        h,
        "symplectic_euler",
        particles=[points(*x.tolist(), velocity=np.outer(-speeds, up).tolist(), radius=0.0, mass=1.0)],
        forces=[{"type": "gravity", "acceleration": (-G * up).tolist()}],
        planes=[{"normal": up.tolist(), "restitution": 0.0}],
    )
    assert np.abs(v[-1]).max() < 1e-10


@pytest.mark.sampled(24)
@pytest.mark.parametrize("degrees", [50.0, 54.7356103172, 80.0])  # 54.7: at right angles
@pytest.mark.parametrize("radius", [0.0, 0.01])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("e", [0.0, 0.3])
def test_what_lies_in_a_corner_of_three_slopes_rests(
    e: float, friction: float, radius: float, degrees: float
) -> None:
    """Pushed off one after the other it had hopped out of the corner by 0.6 µm with a tenth of g h, in every third step, or
    met them 1024 times."""
    a = math.radians(degrees)
    slopes = [
        {"normal": [math.sin(a) * math.cos(q), math.cos(a), math.sin(a) * math.sin(q)], "restitution": e}
        for q in (0.0, 2 * math.pi / 3, 4 * math.pi / 3)
    ]
    result = simulate(
        1.0,
        1e-3,
        particles=[points((0.003, 0.2, 0.002), radius=radius)],
        forces=GRAVITY,
        planes=[{**each, "friction": friction} for each in slopes],
        output={"every": 1, "ledger": True},
    )
    assert result.warnings == ()
    if friction == 0:
        assert result.final.position[0] == pytest.approx([0, radius / math.cos(a), 0], abs=1e-12)
        assert np.abs(result.final.velocity).max() < 1e-12
    rise = result.energy - np.minimum.accumulate(result.energy)
    assert rise.max() < 1e-13  # of 1 J
