"""Constant acceleration, and kicks."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from simulate import EPS, G, points, record, simulate

SPEED = 25.0
GRAVITY = [{"type": "gravity"}]


@pytest.mark.parametrize("angle", [15.0, 45.0, 75.0])
def test_projectile_has_the_apex_range_and_time_of_flight_of_the_parabola(angle: float) -> None:
    # From the ground: apex v_y²/2g at v_y/g, back at 2 v_y/g, range s² sin 2θ / g. Velocity Verlet is exact for a
    # constant force; what is left is rounding, one half EPS of 65 m in each of 1000 steps.
    vx, vy = SPEED * math.cos(math.radians(angle)), SPEED * math.sin(math.radians(angle))
    ball = points((0, 0, 0), velocity=[(vx, vy, 0)])
    flight = 2 * vy / G
    apex = simulate(flight / 2, flight / 1000, particles=[ball], forces=GRAVITY).final
    landing = simulate(flight, flight / 1000, particles=[ball], forces=GRAVITY).final
    rounding = 1000 * EPS * 65
    assert apex.position[0, 1] == pytest.approx(vy**2 / (2 * G), abs=rounding)
    assert apex.velocity[0, 1] == pytest.approx(0, abs=rounding)
    assert landing.position[0] == pytest.approx(
        [SPEED**2 * math.sin(math.radians(2 * angle)) / G, 0, 0], abs=rounding
    )
    assert landing.velocity[0] == pytest.approx([vx, -vy, 0], abs=rounding)


def test_symplectic_euler_misses_the_parabola_by_half_a_step_of_the_velocity() -> None:
    # v_n = v0 + a t, x_n = x0 + v0 t + ½ a t² + ½ a t h: the error of this first-order method is known exactly.
    h, t = 0.01, 2.0
    final = simulate(
        t, h, "symplectic_euler", particles=[points((0, 0, 0), velocity=[(3, 4, 0)])], forces=GRAVITY
    ).final
    assert final.position[0] == pytest.approx(
        [3 * t, 4 * t - G * t**2 / 2 - G * t * h / 2, 0], abs=200 * EPS * 12
    )


def test_kicks_change_velocities_by_j_over_m_at_their_step(tmp_path: Path) -> None:
    # No force: x(t) = Σ (j/m) max(t − t_k, 0) over the kicks at t_k, each at the step nearest to the time asked for.
    dt, mass, j = 0.1, 0.5, (0.2, -0.1, 0.4)
    asked, at = (0.0, 0.32, 0.68), (0.0, 0.3, 0.7)
    with record(
        tmp_path / "kicks.vtkhdf",
        1.0,
        dt,
        particles=[points((0, 0, 0), mass=mass, name="kicked"), points((1, 2, 3), name="spared")],
        forces=[{"type": "gravity", "acceleration": [0, 0, 0]}],
        impulses=[{"on": ["kicked"], "at": list(asked), "impulse": list(j)}],
        output={"every": 1},
    ) as trajectory:
        for frame in trajectory:
            moved = sum(max(frame.time - t, 0.0) for t in at)
            assert frame.position[0] == pytest.approx(np.array(j) / mass * moved, abs=1e-14)
            assert frame.position[1].tolist() == [1, 2, 3]
        kicks_before = [sum(t < frame.time - 1e-9 for t in at) for frame in trajectory]
        speeds = [frame["velocity"][0] for frame in trajectory]
        assert np.array(speeds) == pytest.approx(np.outer(kicks_before, np.array(j) / mass), abs=1e-14)


def test_a_kick_without_groups_kicks_every_group_by_its_own_mass() -> None:
    final = simulate(
        0.2,
        0.1,
        particles=[points((0, 0, 0), mass=m, name=f"m{m}") for m in (1, 2, 4)],
        forces=[{"type": "gravity", "acceleration": [0, 0, 0]}],
        impulses=[{"at": 0.1, "impulse": [8, 0, 0]}],
    ).final
    assert final.velocity[:, 0].tolist() == [8, 4, 2]
