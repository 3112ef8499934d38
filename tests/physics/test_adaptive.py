"""Adaptive methods: errors follow the tolerance, orbits close, steps do not depend on frames, and where they end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import G, points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

ECCENTRICITY = 0.9
PERIHELION, SPEED = 1 - ECCENTRICITY, math.sqrt((1 + ECCENTRICITY) / (1 - ECCENTRICITY))
PERIOD = 2 * math.pi


def integrator(method: str, tolerance: float, **options: float) -> dict[str, Any]:
    return {"method": method, "tolerance": tolerance, **options}


def kepler(method: str, tolerance: float, orbits: float, frames: int = 1) -> ps.Result:
    """An orbit of eccentricity 0.9 and semi-major axis 1 m about μ = 1 m³/s², from the perihelion, in whole frames."""
    return simulate(
        orbits * PERIOD,
        orbits * PERIOD / frames,
        integrator(method, tolerance),  # type: ignore[arg-type]
        particles=[points((PERIHELION, 0, 0), velocity=[(0, SPEED, 0)])],
        forces=[{"type": "attractor", "strength": 1.0}],
        output={"every": 1},
    )


def misses(result: ps.Result) -> tuple[float, float]:
    """How far from the perihelion [m], where an orbit ends, and the relative error of the energy −½ J."""
    x, v = result.final.position[0], result.final.velocity[0]
    return float(np.linalg.norm(x - (PERIHELION, 0, 0))), abs(v @ v - 2 / np.linalg.norm(x) + 1)


@pytest.mark.parametrize(("method", "tolerances"), [("rk45", (1e-7, 1e-10)), ("dop853", (1e-8, 1e-11))])
def test_errors_are_proportional_to_the_tolerance(method: str, tolerances: tuple[float, float]) -> None:
    # The estimate and the error of a step are both C h^q with q = 5 and 8, so that h ~ tol^(1/q), and the error of the whole
    # is (1/h) h^(q+1) ~ tol for RK45, whose fifth order result is kept. DOP853 keeps the eighth, of which the estimate
    # of order 8 is the sharper bound: again h⁸ ~ tol.
    coarse, fine = (misses(kepler(method, tolerance, 2)) for tolerance in tolerances)
    for rough, good in zip(coarse, fine, strict=True):
        slope = math.log(rough / good) / math.log(tolerances[0] / tolerances[1])
        assert slope == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("method", "tolerance"), [("rk45", 1e-11), ("dop853", 1e-12)])
def test_ten_orbits_of_high_eccentricity_close(method: str, tolerance: float) -> None:
    # Each step may err by the tolerance; an error of the energy δ shifts the phase by 3πδ a turn, so n turns miss by
    # v · 3π δ n²/2 at the perihelion, where v = 4.4 m/s, and the other elements add as much again. With some 100 steps
    # a turn δ < 100 · 2 · tol a turn.
    place, energy = misses(kepler(method, tolerance, 10))
    assert energy < 10 * 200 * tolerance
    assert place < 2 * SPEED * 1.5 * math.pi * 10 * energy + 1e-12


def test_frames_neither_stop_nor_shorten_the_steps() -> None:
    # Frames cut the last step short, and the step that was meant goes on after them; both runs keep the tolerance.
    whole, cut = (kepler("dop853", 1e-10, 2, frames) for frames in (1, 37))
    assert cut.times[-1] == whole.times[-1] == 2 * PERIOD
    assert misses(cut)[0] < 2 * misses(whole)[0] + 1e-9
    simulation = Simulation(ps.from_table(circle(frames=40)))
    steps = []
    for frame in range(1, 41):
        simulation.advance_to(frame)
        steps.append(float(simulation.states[0].memory[0][0]))
    simulation.close()
    # On a circle the error of a step is always the same, and so is the step: 1.6 times that between two frames.
    assert max(steps[5:]) < 1.1 * min(steps[5:])


def circle(frames: int) -> dict[str, Any]:
    """A circular orbit, seen at a time between frames that is no multiple of the step."""
    return table(
        PERIOD,
        PERIOD / frames,
        integrator("dop853", 1e-14 * 2),  # type: ignore[arg-type]
        particles=[points((1, 0, 0), velocity=[(0, 1, 0)])],
        forces=[{"type": "attractor", "strength": 1.0}],
        output={"every": 1},
    )


def crowd(threads: int, block: int) -> NDArray[np.float64]:
    """Orbits of all eccentricities, each with its own steps."""
    spread = {"type": "uniform", "low": 0.3, "high": 1.3}
    layout = {
        "type": "random",
        "count": 700,
        "shape": {"type": "point", "position": [1, 0, 0]},
        "velocity": [0, spread, 0.1],
    }
    scenario = ps.from_table(
        table(
            4.0,
            2.0,
            integrator("rk45", 1e-7),  # type: ignore[arg-type]
            particles=[{"layout": layout}],
            forces=[{"type": "attractor", "strength": 1.0}],
        )
    )
    simulation = Simulation(scenario, threads=threads, block=block)
    simulation.advance_to(2)
    (state,) = simulation.states
    simulation.close()
    return np.hstack([state.position, state.velocity, np.array(state.memory).T])


def test_steps_of_a_particle_do_not_depend_on_threads_blocks_or_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("particlesim.engine.islands.independent.WORTH_THREADS", 1)
    reference = crowd(1, 256)
    assert np.unique(reference[:, 6]).size > 600, "particles have steps of their own"
    for threads, block in [(3, 7), (2, 512), (1, 1)]:
        assert crowd(threads, block).tobytes() == reference.tobytes()


def test_a_fall_into_the_center_ends_with_an_error_that_says_why() -> None:
    # From rest at 1 m the center is reached at t = π/(2√2) s.
    with pytest.raises(ps.DivergenceError) as caught:
        simulate(
            4.0,
            1.0,
            "rk45",
            particles=[points((5, 0, 0), (1, 0, 0), name="stones")],
            forces=[{"type": "attractor", "strength": 1.0, "name": "sun"}],
        )
    message = str(caught.value)
    assert "particle 1 of 'stones' needs steps below" in message
    assert f"at t = {math.pi / math.sqrt(8):.5f}" in message
    assert "the strongest force on it was sun with" in message
    assert "minimum_step" in message


def test_euler_by_step_doubling_keeps_the_two_halves() -> None:
    # a = 2 m/s² from rest: two Euler steps of h/2 give v = 2 h, x = h²/2, the one of h gives 0. The error ½ h² meets the
    # tolerance of 10⁻² (1 + x) for h between 0.14 and 0.2, and x lags behind t² by t h/2: by 0.1 at most, and by more than
    # half of 0.07, as steps keep a margin of 0.9 and begin shorter.
    final = simulate(
        1.0,
        1.0,
        integrator("adaptive_euler", 1e-2),  # type: ignore[arg-type]
        particles=[points((0, 0, 0))],
        forces=[{"type": "gravity", "acceleration": [2, 0, 0]}],
    ).final
    assert final.velocity[0] == pytest.approx([2, 0, 0], abs=1e-14)
    assert 0.035 < 1 - final.position[0, 0] < 0.1


def test_bounces_births_and_deaths_fall_inside_long_steps() -> None:
    # Drops are born every 0.1 s in steps of 0.5 s, fall from H, bounce with e = 0.5, and live for 1 s: 9 are left.
    height, e = 2.0, 0.5
    fall = math.sqrt(2 * height / G)
    result = simulate(
        4.0,
        0.5,
        integrator("rk45", 1e-9),  # type: ignore[arg-type]
        emitters=[
            {
                "name": "drops",
                "rate": 10.0,
                "shape": {"type": "point", "position": [0, height, 0]},
                "speed": 0.0,
                "lifetime": 1.0,
            }
        ],
        forces=[{"type": "gravity"}],
        planes=[{"restitution": e}],
        output={"fields": ["velocity", "age"]},
    )
    age = result.final["age"]
    assert len(age) == 9
    assert fall < 1 < fall + 2 * e * fall, "the oldest are on their way up or down after the first bounce"
    before, after = height - G * age**2 / 2, e * G * fall * (age - fall) - G * (age - fall) ** 2 / 2
    assert result.final.position[:, 1] == pytest.approx(np.where(age < fall, before, after), abs=1e-7)


# Springs


K, M, REST, STRETCH = 40.0, 0.5, 1.0, 0.3
OMEGA = math.sqrt(2 * K / M)


def pair(method: str, tolerance: float, dt: float = 1.2, **options: float) -> ps.Result:
    """Two equal masses, stretched and let go."""
    return simulate(
        1.2,
        dt,
        integrator(method, tolerance, **options),  # type: ignore[arg-type]
        particles=[points((0, 0, 0), (REST + STRETCH, 0, 0), mass=M, name="pair")],
        springs=[{"on": "pair", "pairs": [[0, 1]], "stiffness": K, "rest_length": REST, "name": "coil"}],
    )


@pytest.mark.parametrize(
    ("method", "tolerances", "slope"),
    [("rk45", (1e-5, 1e-9), 1.0), ("dop853", (1e-6, 1e-10), 1.0), ("adaptive_euler", (1e-5, 1e-7), 0.5)],
)
def test_two_masses_swing_as_exactly_as_the_tolerance_asks(
    method: str, tolerances: tuple[float, float], slope: float
) -> None:
    # l = L₀ + A cos ωt, ω² = 2k/m. Euler's error is (1/h) h² where the estimate is h², hence the root of the tolerance.
    exact = REST + STRETCH * math.cos(OMEGA * 1.2)
    errors = []
    for tolerance in tolerances:
        x = pair(method, tolerance).final.position
        errors.append(abs(x[1, 0] - x[0, 0] - exact))
        assert x[0, 0] + x[1, 0] == pytest.approx(REST + STRETCH, abs=1e-13), "momentum is kept to rounding"
    observed = math.log(errors[0] / errors[1]) / math.log(tolerances[0] / tolerances[1])
    assert observed == pytest.approx(slope, abs=0.2)


def test_an_island_that_needs_too_short_steps_names_the_spring() -> None:
    with pytest.raises(ps.DivergenceError, match=r"of 'pair' needs steps below 0\.05 s .* was coil with"):
        pair("rk45", 1e-9, minimum_step=0.05)
