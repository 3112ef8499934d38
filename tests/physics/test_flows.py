"""Motion without inertia: tracers in vortices, and first-order dynamics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simulate import EPS, G, points, simulate

GAMMA, CORE = 3.0, 0.4


def angular_speed(profile: str, distance: float) -> float:
    """Rate at which the fluid turns: v_θ/ρ by Rankine and by Lamb and Oseen [rad/s]."""
    outside = GAMMA / (2 * math.pi * distance**2)
    if profile == "rankine":
        return min(outside, GAMMA / (2 * math.pi * CORE**2))
    return outside * (1 - math.exp(-((distance / CORE) ** 2)))


@pytest.mark.parametrize("profile", ["rankine", "lamb_oseen"])
def test_tracers_circle_with_the_fluid(profile: str) -> None:
    # A tracer goes round at ω(ρ): after t it has turned by ωt about +z, counter-clockwise for positive circulation. RK4
    # errs by (ωh)⁵/120 a step in phase and by less in distance.
    t, steps = 1.5, 600
    distances = np.array([0.1, 0.39, 0.41, 1.0, 2.5])
    final = simulate(
        t,
        t / steps,
        "rk4",
        particles=[
            points(
                *[(1 + d, 2.0, 0.5) for d in distances],
                dynamics={
                    "type": "tracer",
                    "flow": [
                        {
                            "type": "vortex",
                            "center": [1, 2, -7],
                            "axis": [0, 0, 2],
                            "circulation": GAMMA,
                            "core_radius": CORE,
                            "profile": profile,
                        }
                    ],
                },
            )
        ],
    ).final
    rates = np.array([angular_speed(profile, d) for d in distances])
    exact = np.stack(
        [1 + distances * np.cos(rates * t), 2 + distances * np.sin(rates * t), np.full(5, 0.5)], axis=1
    )
    bound = steps * (rates.max() * t / steps) ** 5 / 60 * distances.max()
    assert final.position == pytest.approx(exact, abs=bound + steps * EPS * 4)
    speeds = np.linalg.norm(final.velocity, axis=1)
    assert speeds == pytest.approx(rates * distances, rel=1e-9)


def overdamped(
    gravity: float, stiffness: float, position: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """A particle of 2 kg and γ = 4 kg/s after 3 s in steps of 10 ms: position and velocity."""
    final = simulate(
        3.0,
        0.01,
        "rk4",
        particles=[points(position, mass=2.0, dynamics={"type": "first_order", "drag": 4.0})],
        forces=[
            {"type": "gravity", "acceleration": [0, -gravity, 0]},
            {"type": "point_spring", "stiffness": stiffness},
        ],
    ).final
    return final.position[0], final.velocity[0]


def test_without_inertia_a_constant_force_gives_a_constant_velocity() -> None:
    # v = f/γ from the first moment on: x = x0 + f t/γ.
    x, v = overdamped(G, 0.0, (1, 2, 3))
    assert v == pytest.approx([0, -2 * G / 4, 0], rel=1e-15)
    assert x == pytest.approx([1, 2 - 2 * G / 4 * 3, 3], abs=300 * EPS * 15)


def test_without_inertia_a_spring_decays_and_never_swings() -> None:
    # γ x' = −k x: x = x0 e^(−kt/γ). RK4 errs by (kh/γ)⁵/120 a step, and that decays, too.
    rate, x0 = 5.0 / 4.0, np.array([1.0, -2.0, 0.5])
    x, v = overdamped(0.0, 5.0, tuple(x0))
    bound = 2 * 300 * (rate * 0.01) ** 5 / 120 + 300 * EPS
    assert x == pytest.approx(x0 * math.exp(-rate * 3), abs=bound)
    assert v == pytest.approx(-rate * x, rel=1e-14)


def test_overdamped_particles_come_to_rest_where_forces_balance() -> None:
    # k y = −m g; from there nothing moves.
    x, v = overdamped(G, 5.0, (0.0, -2 * G / 5, 0.0))
    assert x == pytest.approx([0, -2 * G / 5, 0], abs=300 * EPS)
    assert v == pytest.approx([0, 0, 0], abs=300 * EPS)
