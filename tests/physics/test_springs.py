"""Two bodies and a spring: the one problem with pair forces that has a closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, points, simulate

import particlesim as ps
from particlesim.integrators import METHODS

M1, M2, K, REST, STRETCH = 0.5, 1.5, 30.0, 0.8, 0.2
MU = M1 * M2 / (M1 + M2)
OMEGA = math.sqrt(K / MU)
ALONG = np.array([2.0, -1.0, 2.0]) / 3
DRIFT = np.array([0.3, 0.1, -0.2])


def dumbbell(t: float, steps: int, method: str, damping: float = 0.0, **spring: Any) -> ps.Result:
    """Two masses, stretched and let go while both drift; the spring lies across the axes."""
    reach = (REST + STRETCH) * ALONG
    return simulate(
        t,
        t / steps,
        method,
        particles=[
            points((0, 0, 0), velocity=[DRIFT], mass=M1, name="a"),
            points(reach, velocity=[DRIFT], mass=M2, name="b"),
        ],
        springs=[
            {
                "between": ["a", "b"],
                "pairs": [[0, 0]],
                "stiffness": K,
                "damping": damping,
                "rest_length": REST,
            }
        ],
        output={"ledger": True},
    )


def length(result: ps.Result) -> float:
    return float(np.linalg.norm(result.final.position[0] - result.final.position[1]))


@pytest.mark.parametrize("method", list(METHODS))
def test_two_masses_swing_with_the_frequency_of_their_reduced_mass(method: str) -> None:
    # l = L₀ + A cos ωt, ω = √(k/μ), μ = m₁ m₂/(m₁ + m₂). At 1.1 periods phase and amplitude both count; a method of order
    # p misses l by C hᵖ, so that half the step leaves 2⁻ᵖ of the miss; C is less than ωt of the amplitude for h in 1/ω.
    order = METHODS[method].order
    t = 1.1 * 2 * math.pi / OMEGA
    exact = REST + STRETCH * math.cos(OMEGA * t)
    steps = {1: 4000, 2: 400, 3: 300, 4: 150}[order]
    coarse, fine = (dumbbell(t, n, method) for n in (steps, 2 * steps))
    misses = abs(length(coarse) - exact), abs(length(fine) - exact)
    assert math.log2(misses[0] / misses[1]) == pytest.approx(order, abs=0.1)
    assert misses[1] < STRETCH * OMEGA * t * (OMEGA * t / (2 * steps)) ** order
    # The forces on both ends are the same number with opposite signs: momentum is kept to rounding.
    center = (M1 * coarse.final.position[0] + M2 * coarse.final.position[1]) / (M1 + M2)
    start = M2 * (REST + STRETCH) * ALONG / (M1 + M2)
    assert center == pytest.approx(start + DRIFT * t, abs=steps * EPS)
    momentum = M1 * coarse.final.velocity[0] + M2 * coarse.final.velocity[1]
    assert momentum == pytest.approx((M1 + M2) * DRIFT, abs=steps * EPS * OMEGA)


def test_a_damper_takes_energy_at_its_rate() -> None:
    # l = L₀ + A e^(−δt) (cos ω't + δ/ω' sin ω't), δ = c/2μ, ω'² = ω² − δ². RK4 errs by less than (ωh)⁵/60 a step.
    damping, t, steps = 0.6, 2.0, 2000
    delta = damping / (2 * MU)
    swing = math.sqrt(OMEGA**2 - delta**2)
    exact = REST + STRETCH * math.exp(-delta * t) * (
        math.cos(swing * t) + delta / swing * math.sin(swing * t)
    )
    result = dumbbell(t, steps, "rk4", damping)
    assert length(result) == pytest.approx(
        exact, abs=STRETCH * steps * (OMEGA * t / steps) ** 5 / 60 + steps * EPS
    )


def test_a_damper_with_its_sign_right_ends_with_a_millijoule() -> None:
    # Two masses of 1 kg, k = 10 N/m, c = 0.5 kg/s, 0.2 J at the start, 5 s: the amplitude falls as e^(−ct/m), the energy,
    # taken at a moment when the envelope is touched, as its square: 0.2 e⁻⁵ J = 1.35 mJ within the swing of
    # (1 ± δ/ω)². With the sign of the relative velocity turned it would be 40 J.
    result = simulate(
        5.0,
        0.001,
        "rk4",
        particles=[points((0, 0, 0), mass=1.0, name="a"), points((1.2, 0, 0), mass=1.0, name="b")],
        springs=[
            {"between": ["a", "b"], "pairs": [[0, 0]], "stiffness": 10.0, "damping": 0.5, "rest_length": 1.0}
        ],
        output={"ledger": True},
    )
    ratio = 0.5 / math.sqrt(20.0)
    assert result.energy[0] == pytest.approx(0.2, rel=1e-12)
    assert 0.2 * math.exp(-5) * (1 - ratio) ** 2 < result.energy[-1] < 0.2 * math.exp(-5) * (1 + ratio) ** 2


def test_a_spring_takes_its_rest_length_from_the_start() -> None:
    # Without rest_length the spring is slack at the start: nothing ever moves.
    result = simulate(
        1.0,
        0.01,
        "rk4",
        particles=[points((0, 0, 0), mass=1.0, name="a"), points((0.3, 0.4, 0), mass=2.0, name="b")],
        springs=[{"between": ["a", "b"], "pairs": [[0, 0]], "stiffness": 50.0}],
    )
    assert result.final.position.tolist() == [[0, 0, 0], [0.3, 0.4, 0]]


def test_a_pinned_end_stays_and_still_pulls() -> None:
    # One end fixed: ω = √(k/m). Velocity Verlet's phase lags by (ωh)²/24 of itself.
    k, m, t, steps = 20.0, 0.8, 1.3, 2000
    final = simulate(
        t,
        t / steps,
        particles=[points((0, 0, 0), (1.5, 0, 0), mass=m, pinned=[0], name="chain")],
        springs=[{"on": "chain", "pairs": [[0, 1]], "stiffness": k, "rest_length": 1.0}],
    ).final
    omega = math.sqrt(k / m)
    phase = omega * t
    bound = 0.5 * phase * (phase / steps) ** 2 / 20
    assert final.position[0].tolist() == [0, 0, 0]
    assert final.position[1] == pytest.approx([1 + 0.5 * math.cos(phase), 0, 0], abs=bound)


def test_pinned_particles_ignore_forces_and_kicks() -> None:
    final = simulate(
        0.5,
        0.01,
        particles=[points((0, 1, 0), (0, 2, 0), velocity=[(1, 1, 1)], pinned=[1])],
        forces=[{"type": "gravity"}],
        impulses=[{"at": 0.2, "impulse": [5, 0, 0]}],
    ).final
    assert final.position[1].tolist() == [0, 2, 0]
    assert final.velocity[1].tolist() == [0, 0, 0]
    assert final.position[0, 0] == pytest.approx(0.5 + 5 * 0.3, abs=1e-14)
