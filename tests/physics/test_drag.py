"""Drag of every kind, against closed forms."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from simulate import EPS, G, points, rows, simulate

import particlesim as ps
from particlesim.flows.fluids import FLUIDS
from particlesim.laws.registry import Particle, force


@pytest.mark.parametrize("wind", [(0.0, 0.0, 0.0), (3.0, -1.0, 2.0)])
def test_linear_drag_relaxes_exponentially_towards_the_wind(wind: tuple[float, float, float]) -> None:
    # v = w + (v0 − w) e^(−λt), x = x0 + w t + (v0 − w)(1 − e^(−λt))/λ with λ = k/m. The error of RK4 in one step is
    # (λh)⁵/120 of the velocity, and decays like it: N steps make at most N (λh)⁵/120, in x that over λ.
    k, m, t, steps = 0.4, 0.2, 1.5, 300
    rate, w, v0 = k / m, np.array(wind), np.array([12.0, 20.0, -5.0])
    final = simulate(
        t,
        t / steps,
        "rk4",
        particles=[points((1, 2, 3), velocity=[v0], mass=m)],
        forces=[
            {"type": "linear_drag", "coefficient": k, "flow": [{"type": "uniform", "velocity": list(wind)}]}
        ],
    ).final
    fade = math.exp(-rate * t)
    bound = 25 * steps * (rate * t / steps) ** 5 / 120 + steps * EPS * 30
    assert final.velocity[0] == pytest.approx(w + (v0 - w) * fade, abs=bound)
    assert final.position[0] == pytest.approx(
        [1, 2, 3] + w * t + (v0 - w) * (1 - fade) / rate, abs=bound / rate
    )


def ball_in_wind(
    duration: float, steps: int, velocity: tuple[float, float, float], wind: float, g: float
) -> ps.Frame:
    """A ball of 145 g and 36.6 mm in air that moves along x."""
    return simulate(
        duration,
        duration / steps,
        "rk4",
        particles=[points((0, 0, 0), velocity=[velocity], mass=0.145, radius=0.0366)],
        forces=[
            {"type": "gravity", "acceleration": [0, -g, 0]},
            {"type": "drag", "fluid": "air", "flow": [{"type": "uniform", "velocity": [wind, 0, 0]}]},
        ],
    ).final


DRAG_PER_MASS = 0.5 * 1.225 * 0.47 * math.pi * 0.0366**2 / 0.145
"""½ ρ c_d π r² / m of that ball [1/m]."""


def test_fall_with_quadratic_drag_follows_the_hyperbolic_tangent() -> None:
    # v = v_t tanh(g t / v_t), y = −(v_t²/g) ln cosh(g t / v_t), v_t = √(g / κ). In units of v_t and v_t/g the equation is
    # u' = 1 − u²; with steps of τ RK4 errs by less than τ⁵ a step (its constant, |tanh⁽⁵⁾|/120 and mixed terms, is below
    # 1), and falling damps what was before.
    v_t = math.sqrt(G / DRAG_PER_MASS)
    steps, tau = 400, 0.005
    t = steps * tau * v_t / G
    final = ball_in_wind(t, steps, (0, 0, 0), 0.0, G)
    bound = steps * tau**5
    assert final.velocity[0] == pytest.approx([0, -v_t * math.tanh(G * t / v_t), 0], abs=bound * v_t)
    assert final.position[0, 1] == pytest.approx(
        -(v_t**2) / G * math.log(math.cosh(G * t / v_t)), abs=bound * v_t**2 / G * 2
    )


def test_quadratic_drag_carries_a_ball_along_with_the_wind() -> None:
    # Relative to the wind, u' = −κ u²: u = u0 / (1 + κ u0 t), hence x = w t − ln(1 + κ |u0| t)/κ for a ball at rest.
    # In units of 1/κ|u0|, RK4 errs by less than 2 τ⁵ a step: the fifth derivative of 1/(1+s) is at most 120, over 120,
    # and as much for mixed terms.
    wind, t, steps = 20.0, 30.0, 400
    final = ball_in_wind(t, steps, (0, 0, 0), wind, 0.0)
    grown = 1 + DRAG_PER_MASS * wind * t
    bound = 2 * steps * (DRAG_PER_MASS * wind * t / steps) ** 5
    assert final.velocity[0] == pytest.approx([wind - wind / grown, 0, 0], abs=bound * wind)
    assert final.position[0, 0] == pytest.approx(
        wind * t - math.log(grown) / DRAG_PER_MASS, abs=bound * wind * t
    )


def sinking_sand(radius: float, relaxations: float, steps: int) -> tuple[ps.Result, float, float]:
    """Quartz in water from rest: the result, its relaxation time, its settling velocity by Stokes."""
    rho, eta, water = 2650.0, FLUIDS["water"].viscosity, 997.0
    relaxation = 2 * radius**2 * rho / (9 * eta)
    settling = 2 * radius**2 * (rho - water) * G / (9 * eta)
    t = relaxations * relaxation
    result = simulate(
        t,
        t / steps,
        "rk4",
        particles=[points((0, 0, 0), radius=radius, density=rho)],
        forces=[
            {"type": "gravity"},
            {"type": "buoyancy", "fluid": "water"},
            {"type": "stokes_drag", "fluid": "water"},
        ],
    )
    return result, relaxation, settling


def test_a_grain_settles_by_stokes() -> None:
    # m v' = (m − m_f) g − 6πηr v: v = v_s (1 − e^(−t/τ)), τ = 2 r² ρ_s / 9η, v_s = 2 r² (ρ_s − ρ_f) g / 9η.
    result, _, settling = sinking_sand(30e-6, 3.0, 150)
    bound = settling * 150 * (3.0 / 150) ** 5 / 120
    assert result.final.velocity[0, 1] == pytest.approx(-settling * (1 - math.exp(-3)), abs=bound)
    assert result.warnings == ()


def test_a_grain_too_fast_for_stokes_is_told() -> None:
    # Re = 2 r ρ_f v / η is 0.28 for 30 µm, and grows with r³: more than 8 at 100 µm.
    result, _, settling = sinking_sand(100e-6, 3.0, 150)
    reynolds = 2 * 100e-6 * 997 * settling / FLUIDS["water"].viscosity
    assert reynolds > 8
    (warning,) = result.warnings
    told = re.search(r"Reynolds numbers below 1, and (\S+) was reached", warning)
    assert told is not None
    assert float(told[1]) == pytest.approx(reynolds * (1 - math.exp(-3)), rel=5e-3)
    assert "schiller_naumann" in warning


def drag_on(law: dict[str, object], velocity: float, radius: float, height: float = 0.0) -> float:
    """Size of the force of a law on a sphere that moves along x [N]."""
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1, "dt": 1},
            "particles": [points((0, 0, 0), radius=radius)],
            "forces": [{"type": "drag", **law}],
        }
    )
    particle = Particle(0.0, height, 0.0, velocity, 0.0, 0.0, 1.0, radius, 0.0, 0.0)
    fx, fy, fz = force(scenario.forces[0].record(), particle)
    assert (fy, fz) == (0, 0)
    assert fx < 0
    return -float(fx)


@pytest.mark.parametrize(
    ("altitude", "density"), [(0, 1.2250), (5000, 0.7361), (11000, 0.3639), (15000, 0.1937)]
)
def test_the_standard_atmosphere_has_its_published_densities(altitude: float, density: float) -> None:
    # ISO 2533; published to four digits, so half a unit of the last one.
    law = {"density": {"type": "standard_atmosphere", "sea_level": -100.0}, "coefficient": 1.0}
    found = drag_on(law, 10.0, 0.1, altitude - 100.0) / (0.5 * math.pi * 0.1**2 * 10.0**2)
    assert found == pytest.approx(density, abs=5e-5)


def test_warm_and_humid_air_is_thinner() -> None:
    # Ideal gas at the standard pressure: ρ = p / (R T) at T0 + 20 K; vapour is lighter than the air it replaces, by
    # 0.378 p_v / (R T) with p_v = 4.25 kPa at 30 °C (Tetens).
    def density(**air: float) -> float:
        law = {"density": {"type": "standard_atmosphere", **air}, "coefficient": 1.0}
        return drag_on(law, 1.0, 1.0) / (0.5 * math.pi)

    assert density(temperature_offset=20.0) == pytest.approx(101325 / (287.05287 * 308.15), rel=1e-12)
    warm = density(temperature_offset=15.0)
    assert warm - density(temperature_offset=15.0, humidity=1.0) == pytest.approx(
        0.378 * 4246 / (287.05 * 303.15), rel=5e-3
    )


def schiller_naumann(reynolds: float) -> float:
    """Drag coefficient that the law gives in water at a Reynolds number."""
    radius, fluid = 1e-3, FLUIDS["water"]
    assert fluid.density is not None
    velocity = reynolds * fluid.viscosity / (2 * radius * fluid.density)
    size = drag_on({"fluid": "water", "coefficient": "schiller_naumann"}, velocity, radius)
    return size / (0.5 * fluid.density * math.pi * radius**2 * velocity**2)


def test_schiller_naumann_joins_stokes_to_a_constant_coefficient() -> None:
    # 24/Re up to its correction of 0.15 Re^0.687; 0.44 above 1000, where the two branches meet within one per cent.
    for reynolds in (1e-6, 1e-3, 0.1):
        assert schiller_naumann(reynolds) * reynolds / 24 == pytest.approx(
            1 + 0.15 * reynolds**0.687, rel=1e-12
        )
    assert schiller_naumann(1e-9) * 1e-9 / 24 == pytest.approx(1, rel=1e-6)
    for reynolds in (1001.0, 1e4, 1e6):
        assert schiller_naumann(reynolds) == pytest.approx(0.44, rel=1e-12)
    assert schiller_naumann(999.9) == pytest.approx(schiller_naumann(1000.1), rel=0.01)


def test_measured_coefficients_of_spheres_are_met() -> None:
    # Standard drag curve of a sphere (Clift, Grace, Weber, Bubbles, Drops and Particles, 1978): the correlation stays
    # within 5 % of it.
    curve = rows((1, 27.1), (10, 4.26), (100, 1.09), (500, 0.555))
    for reynolds, coefficient in curve:
        assert schiller_naumann(reynolds) == pytest.approx(coefficient, rel=0.05)
