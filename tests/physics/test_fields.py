"""Wells, orbits, flotation and turning frames: forces that depend on the place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import EPS, G, points, record, simulate

import particlesim as ps


def test_every_motion_in_a_harmonic_well_has_the_same_period() -> None:
    # x = x0 cos ωt + (v0/ω) sin ωt with ω = √(k/m). Yoshida's method turns the phase by less than (ωh)⁴ a radian
    # (its leading error constant is 0.066 for the oscillator), so N steps err by less than 0.1 (ωh)⁴ ωt of the amplitude.
    k, m, steps = 3.0, 0.7, 400
    omega = math.sqrt(k / m)
    x0 = np.array([[1.0, 0, 0], [0.01, 2, -1], [5, -3, 0.5]])
    v0 = np.array([[0.0, 1, 0], [2, 0, 0.1], [-1, -1, 4]])
    for turns in (0.25, 0.5, 1.0):
        t = turns * 2 * math.pi / omega
        final = simulate(
            t,
            t / steps,
            "yoshida4",
            particles=[points(*x0 + 1.0, velocity=v0, mass=m)],
            forces=[{"type": "point_spring", "stiffness": k, "anchor": [1, 1, 1]}],
        ).final
        exact = 1.0 + x0 * math.cos(omega * t) + v0 / omega * math.sin(omega * t)
        bound = 0.1 * (omega * t / steps) ** 4 * omega * t * 6
        assert final.position == pytest.approx(exact, abs=bound + steps * EPS * 8)


def kepler(a: float, e: float, turns: float, steps: int, mu: float = 1.7) -> ps.Result:
    """A planet from its perihelion on the x axis, for some turns."""
    period = 2 * math.pi * math.sqrt(a**3 / mu)
    speed = math.sqrt(mu / a * (1 + e) / (1 - e))
    return simulate(
        turns * period,
        turns * period / steps,
        "yoshida4",
        particles=[points((a * (1 - e), 0, 0), velocity=[(0, 0, -speed)], mass=2.0)],
        forces=[{"type": "attractor", "strength": mu}],
        output={"ledger": True, "every": 1},
    )


@pytest.mark.parametrize("a", [1.0, 2.5])
def test_kepler_orbit_closes_after_its_period(a: float) -> None:
    # T = 2π √(a³/μ). The position misses its start by C h⁴ (fourth order): half the step, a sixteenth of the miss.
    start = np.array([a * 0.5, 0, 0])
    misses = [float(np.linalg.norm(kepler(a, 0.5, 1.0, n).final.position[0] - start)) for n in (1000, 2000)]
    assert misses[0] / misses[1] == pytest.approx(16, rel=0.05)
    assert misses[1] < 1e-6 * a


def test_kepler_aphelion_lies_opposite() -> None:
    # After half a period at −a (1 + e), with the speed √(μ/a (1 − e)/(1 + e)) across; as exact as the closed orbit above.
    final = kepler(1.0, 0.5, 0.5, 1000).final
    assert final.position[0] == pytest.approx([-1.5, 0, 0], abs=1e-6)
    assert final.velocity[0] == pytest.approx([0, 0, math.sqrt(1.7 / 3)], abs=1e-6)


def test_a_splitting_keeps_the_angular_momentum_to_rounding() -> None:
    # Central kicks and straight drifts keep x × v exactly: what is left is one rounding a step and stage.
    result = kepler(1.0, 0.5, 1.0, 1000)
    moment = result.ledger["angular_momentum.y"]
    assert moment[0] == pytest.approx(2 * 0.5 * math.sqrt(1.7 * 3), rel=1e-15)
    assert np.abs(moment / moment[0] - 1).max() < 3 * math.sqrt(1000) * 10 * EPS


@pytest.mark.parametrize(
    "law", [{"exponent": 1}, {"exponent": 1.5}, {"exponent": 3.5, "softening": 0.6}, {"exponent": -1}]
)
def test_attractors_of_any_power_keep_the_energy(law: dict[str, float]) -> None:
    # Kinetic plus potential energy swings by C h⁴ with a method of fourth order, and by C only if U belonged to another
    # force: the swing must shrink by 16 when the step is halved.
    def swing(steps: int) -> float:
        result = simulate(
            6.0,
            6.0 / steps,
            "yoshida4",
            particles=[points((1.0, 0.2, -0.1), velocity=[(0.1, 0.7, 0.4)])],
            forces=[{"type": "attractor", "strength": 1.0, **law}],
            output={"ledger": True, "every": steps // 300},
        )
        return float(np.ptp(result.energy))

    assert swing(300) / swing(600) == pytest.approx(16, rel=0.15)


def floating(density: float, damping: float, start: float, duration: float, steps: int) -> NDArray[Any]:
    """Position of a ball of 10 cm in water with its surface at y = 0.25, from rest with its center at `start`."""
    final = simulate(
        duration,
        duration / steps,
        particles=[points((0.3, start, -2.0), radius=0.1, density=density)],
        forces=[
            {"type": "gravity"},
            {"type": "buoyancy", "density": 1000.0, "surface": 0.25},
            {"type": "linear_drag", "coefficient": damping},
        ],
    ).final
    return np.asarray(final.position[0])


@pytest.mark.parametrize("density", [120.0, 500.0, 930.0])
def test_a_ball_floats_where_its_cap_displaces_its_mass(density: float) -> None:
    # Immersion h of a sphere: h² (3 r − h) = 4 r³ ρ/ρ_f. Damped near criticality, what is left of the motion after
    # 30 relaxation times 2m/k is e^−30; the fixed point itself does not depend on the step.
    r, mass = 0.1, density * 4 / 3 * math.pi * 0.1**3
    roots = np.roots([-1, 3 * r, 0, -4 * r**3 * density / 1000])
    h = float(next(x.real for x in roots if abs(x.imag) < 1e-9 and 0 < x.real < 2 * r))
    damping = mass * math.sqrt(1000 * G * math.pi * (2 * r * h - h * h) / mass)
    y = floating(density, damping, 0.3, 30 * 2 * mass / damping, 3000)[1]
    assert 0.25 - (y - r) == pytest.approx(h, abs=1e-11)


def test_a_half_immersed_ball_bobs_with_the_frequency_of_its_water_plane() -> None:
    # Small motion: m y'' = −ρ_f g π r² y, ω² = 3 g / 2 r for half the density. At a quarter period the ball passes its
    # equilibrium; velocity Verlet's phase lags by (ωh)²/24 of it, and the next term of the force is (y/r)²/3 of the first.
    omega, amplitude, steps = math.sqrt(1.5 * G / 0.1), 1e-4, 1000
    quarter = math.pi / 2 / omega
    y = floating(500.0, 0.0, 0.25 + amplitude, quarter, steps)[1] - 0.25
    bound = amplitude * (math.pi / 2) * ((math.pi / 2 / steps) ** 2 / 24 + (amplitude / 0.1) ** 2)
    assert y == pytest.approx(0, abs=bound + steps * EPS)


def turned(axis: NDArray[Any], angle: float, x: NDArray[Any]) -> NDArray[Any]:
    """Rodrigues' rotation of x about a unit axis."""
    along = axis * (axis @ x)
    return np.asarray(along + (x - along) * math.cos(angle) + np.cross(axis, x) * math.sin(angle))


@pytest.mark.parametrize("alpha", [0.0, 0.35])
def test_a_free_particle_goes_straight_outside_of_the_turning_frame(alpha: float) -> None:
    # In the inertial frame x = x0 + (v0 + ω0 × x0) t; the frame has turned by θ = ω0 t + ½ α t² since they agreed.
    # RK4 with ωh = 0.005 … 0.01 errs by less than (ωh)⁵ a step of the inertial velocity over ω.
    omega, t, steps = 1.1, 2.0, 400
    axis, center = np.array([2.0, -3.0, 6.0]) / 7, np.array([0.4, -1.0, 2.0])
    x0, v0 = np.array([1.5, 0.5, -0.5]), np.array([-0.3, 0.8, 0.6])
    final = simulate(
        t,
        t / steps,
        "rk4",
        particles=[points(x0, velocity=[v0], mass=3.0)],
        forces=[
            {
                "type": "rotating_frame",
                "angular_velocity": list(omega * axis),
                "angular_acceleration": list(alpha * axis),
                "center": list(center),
            }
        ],
    ).final
    r0 = x0 - center
    straight = r0 + (v0 + np.cross(omega * axis, r0)) * t
    exact = center + turned(axis, -(omega * t + alpha * t * t / 2), straight)
    fastest = omega + alpha * t
    bound = steps * (fastest * t / steps) ** 5 * float(np.linalg.norm(straight))
    assert final.position[0] == pytest.approx(exact, abs=bound)


def test_a_field_from_a_file_of_formulas_is_the_force_it_says() -> None:
    # F = (−k x, 0, c t): x = x0 cos ωt, z = c t³ / 6 m. RK4 errs by (ωh)⁵/120 a step in x, and is exact for a cubic.
    k, c, m, t, steps = 2.0, 0.6, 0.5, 3.0, 600
    omega = math.sqrt(k / m)
    final = simulate(
        t,
        t / steps,
        "rk4",
        particles=[points((1.0, 2.0, 3.0), mass=m)],
        forces=[{"type": "field", "force": ["-k*x", "0", "c*t"], "constants": {"k": k, "c": c}}],
    ).final
    bound = steps * (omega * t / steps) ** 5 / 60 + steps * EPS * 10
    assert final.position[0] == pytest.approx([math.cos(omega * t), 2.0, 3 + c * t**3 / (6 * m)], abs=bound)


def test_the_orbit_in_a_file_is_the_orbit_in_memory(tmp_path: Path) -> None:
    # What the recorder writes in double precision is the state, bit for bit.
    parts: dict[str, Any] = {
        "particles": [points((1, 0, 0), velocity=[(0, 0, -1)], mass=2.0)],
        "forces": [{"type": "attractor", "strength": 1.7}],
    }
    memory = simulate(1.0, 0.01, "yoshida4", **parts).final
    with record(tmp_path / "orbit.vtkhdf", 1.0, 0.01, "yoshida4", **parts) as trajectory:
        assert trajectory[-1].position.tobytes() == memory.position.tobytes()
        assert trajectory[-1]["velocity"].tobytes() == memory.velocity.tobytes()
