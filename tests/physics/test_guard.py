"""No conservative scenario gains a tenth of its energy and ends well, and none that is right is stopped."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import G, Table, energies, points, simulate, table

import particlesim as ps
from particlesim.engine.shadow import swing
from particlesim.engine.simulation import Simulation

LEDGER = {"ledger": True, "every": 1}
WELL = {"type": "point_spring", "stiffness": 100.0}
OMEGA = 10.0  # of 1 kg in the well


def swinging(per_period: float, method: str, periods: float = 10, **output: Any) -> Table:
    """A particle that swings in the well, thrown at its bottom: its energy is ½ J."""
    dt = 2 * math.pi / OMEGA / per_period
    return table(
        round(periods * per_period) * dt,
        dt,
        method,
        particles=[points((0, 0, 0), velocity=[(1, 0, 0)])],
        forces=[WELL],
        output=output or LEDGER,
    )


def balls(dt: float, **more: Any) -> Table:
    """Four balls between two walls that push each other away where they touch, ω = √(2k/m) = 3430/s; K = ½ m v²."""
    start = [(-0.5, 0.0286, 0.003), (0.5, 0.0286, 0), (0.56, 0.0286, 0.03), (0.56, 0.0286, -0.03)]
    group = points(*start, velocity=[(3, 0, 0), *[(0, 0, 0)] * 3], name="balls", radius=0.0286, mass=0.17)
    contact = {
        "on": "balls",
        "pairs": [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]],
        "rest_length": 0.0572,
        "compression_only": True,
        "stiffness": 1e6,
    }
    walls = [{"point": [x, 0, 0], "normal": [-x, 0, 0]} for x in (1, -1)]
    steps = round(2 / dt)
    output = {"ledger": True, "every": max(steps // 300, 1)}
    steps -= steps % output["every"]
    return table(steps * dt, dt, particles=[group], springs=[contact], planes=walls, output=output | more)


def diverged(scenario: Table) -> ps.DivergenceError:
    with pytest.raises(ps.DivergenceError) as caught:
        ps.run(ps.from_table(scenario))
    assert caught.value.exit_code == 3
    assert caught.value.post_mortem is not None
    assert caught.value.post_mortem.cause == "energy"
    return caught.value


def test_a_run_whose_particles_have_all_died_is_not_judged() -> None:
    # 180 J of a contact for which the step is far too long; then all of its particles are gone
    scenario = table(
        0.5,
        0.1,
        "symplectic_euler",
        emitters=[{"rate": 10, "radius": 0.1, "shape": {"type": "point", "position": [0, 1, 0]}}],
        colliders=[{"type": "sphere", "radius": 1, "contact": "kill"}],
        interactions=[{"type": "contact", "model": "linear", "stiffness": 1000}],
        output={"every": 1, "work": True, "ledger": True},
    )
    result = ps.run(ps.from_table(scenario))
    assert len(result.final.position) == 0


def test_springs_that_push_only() -> None:
    # Beyond the limit of 2/ω = 0.58 ms every touch gives energy: 0.765 J had become 16 J, or 647 J, and all was well.
    error = diverged(balls(1e-3))
    assert "with nothing to feed it" in str(error)
    assert "simulation.dt = 0.00" in error.hint
    result = ps.run(ps.from_table(balls(1e-4)))
    assert np.abs(result.energy / 0.765 - 1).max() < 0.02
    assert not [text for text in result.warnings if "swings" in text]


def test_without_a_ledger_energies_are_looked_at_now_and_then() -> None:
    error = diverged(balls(1e-3, ledger=False))
    assert error.post_mortem.noticed <= 2
    ps.run(ps.from_table(balls(1e-4, ledger=False)))


def test_a_method_that_lets_every_oscillation_grow() -> None:
    # Explicit Euler: E grows by 1 + (hω)² a step; 50 steps per period double it within 44 steps, 10 % are there after 6.
    error = diverged(swinging(50, "explicit_euler"))
    assert error.post_mortem.noticed == pytest.approx(7 * 2 * math.pi / OMEGA / 50)
    # 10 000 steps per period gain 2.5 % in ten periods.
    result = ps.run(ps.from_table(swinging(1e4, "explicit_euler", 6.25, ledger=True, every=100)))
    assert result.energy[-1] / 0.5 == pytest.approx((1 + (2 * math.pi / 1e4) ** 2) ** 62500, rel=1e-6)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("method", "per_period"), [("symplectic_euler", 4.0), ("velocity_verlet", 4.0), ("stormer_verlet", 4.0)]
)
def test_a_swing_that_is_given_back_is_told_and_no_gain(method: str, per_period: float) -> None:
    # At hω = π/2 the energy of a stable oscillation swings by a multiple of itself, for ever. Where the run ends decides.
    energy = energies(swinging(per_period, method, 18)) / 0.5
    assert energy.max() > 1.5
    ends = [k for k in range(60, 70) if abs(energy[k] - 1.1) > 0.01]
    assert any(energy[k] > 1.1 for k in ends)
    assert all(energy[k] > 1.1 for k in ends) == (
        method == "stormer_verlet"
    )  # its first speed is the slowest
    for k in ends:
        scenario = swinging(per_period, method, k / per_period)
        if energy[k] > 1.1:
            error = diverged(scenario)
            assert error.post_mortem.noticed == pytest.approx(k * scenario["simulation"]["dt"])
            assert f"stable for {method}, but too long" in error.hint
        else:
            result = ps.run(ps.from_table(scenario))
            (warning,) = [text for text in result.warnings if "swings by" in text]
            assert "stable" in warning
    assert not [text for text in ps.run(ps.from_table(swinging(200, method, 3))).warnings if "swings" in text]


@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet", "stormer_verlet"])
@pytest.mark.parametrize("per_period", [3.3, 5.0, 40.0])
def test_without_its_swing_the_energy_is_constant(method: str, per_period: float) -> None:
    # On linear forces the shadow energy is kept to rounding, at any stable step, while the energy swings by up to 17 times.
    simulation = Simulation(ps.from_table(swinging(per_period, method, 10)))
    kept = []
    for step in range(1, 30):
        simulation.advance_to(step)
        row = simulation.ledger()
        energy = row["kinetic"] + row["potential.point_spring"]
        parts = simulation.islands[0], simulation.graph.islands[0]
        kept.append(energy - swing(*parts, simulation.time, simulation.scenario.grid.dt))
    assert np.ptp(kept) < 1e-12 * max(kept)
    simulation.close()


@pytest.mark.parametrize("start", [(0.0, 1.0), (1.0, -7.0), (1.0, 7.0)])
def test_a_swing_beside_a_gain_hides_nothing(start: tuple[float, float]) -> None:
    # What symplectic Euler keeps is known to rounding, wherever the swing begins: three steps per period more than the limit
    # allows (π) are judged as what they are.
    def scenario(per_period: float, steps: int) -> Table:
        dt = 2 * math.pi / OMEGA / per_period
        group = points((start[0], 0, 0), velocity=[(start[1], 0, 0)])
        return table(steps * dt, dt, "symplectic_euler", particles=[group], forces=[WELL], output=LEDGER)

    energy = energies(scenario(3.2, 60))
    ps.run(ps.from_table(scenario(3.2, int(np.flatnonzero(energy <= energy[0])[-1]))))
    diverged(scenario(3.1, 40))


@pytest.mark.parametrize("every", [1, 2, 5, 10])
def test_a_fall_from_rest_is_no_gain(every: int) -> None:
    # Explicit Euler is n/2 (g h)² ahead after n steps, as much as all that has been turned over in the first of them.
    for method in ("explicit_euler", "symplectic_euler"):
        result = simulate(
            1.0,
            0.01,
            method,
            particles=[points((0, 1000, 0))],
            forces=[{"type": "gravity"}],
            output={"ledger": True, "every": every},
        )
        ahead = result.energy[-1] - result.energy[0]
        sign = 1 if method == "explicit_euler" else -1
        assert ahead == pytest.approx(sign * 50 * (G * 0.01) ** 2, rel=1e-6)


def test_rounding_in_single_precision_is_no_gain() -> None:
    scenario = table(
        1.0,
        0.01,
        particles=[points((3e4, 1e4, 0))],
        forces=[{"type": "gravity"}],
        output=LEDGER,
    )
    scenario["simulation"]["precision"] = "single"
    ps.run(ps.from_table(scenario))


def test_close_to_the_sun() -> None:
    # An orbit with e = 0.9, from its far end: with 40 steps in a year the passage throws the planet out.
    def orbit(steps: int) -> Table:
        a, far = 1.0, 1.9
        planet = points((far, 0, 0), velocity=[(0, math.sqrt(0.1 / far), 0)])
        sun = {"type": "attractor", "strength": 1.0}
        dt = 2 * math.pi * a**1.5 / steps
        return table(2 * steps * dt, dt, particles=[planet], forces=[sun], output=LEDGER)

    diverged(orbit(40))
    result = ps.run(ps.from_table(orbit(4000)))
    assert result.energy[-1] == pytest.approx(-0.5, rel=1e-3)


@pytest.mark.parametrize(("method", "per_year"), [("velocity_verlet", 200), ("symplectic_euler", 500)])
def test_a_comet_close_to_the_sun_is_held_against_what_it_has_there(method: str, per_year: int) -> None:
    # With e = 0.9 the comet has K = ½ (1 + e)/(1 − e) = 9.5 J/kg where it passes the sun, and E = −½ J/kg. An error of a
    # tenth of E there is 5 ‰ of what moves, and has gone when it is far out again; no run ends for it, wherever it stops.
    def orbit(steps: int) -> Table:
        comet = points((1.9, 0, 0), velocity=[(0, math.sqrt(0.1 / 1.9), 0)])
        dt, sun = 2 * math.pi / per_year, {"type": "attractor", "strength": 1.0}
        return table(steps * dt, dt, method, particles=[comet], forces=[sun], output=LEDGER)

    gain = energies(orbit(per_year)) + 0.5
    assert gain.max() > 0.05
    assert gain[-1] < 0.01
    for steps in (int(gain.argmax()), per_year):
        ps.run(ps.from_table(orbit(steps)))


def test_a_short_run_without_a_ledger_is_looked_at_twice() -> None:
    # Ten steps of explicit Euler at hω = π/25: E grows by 1 + (hω)² in each.
    scenario = swinging(50, "explicit_euler", 0.2, ledger=False, every=10)
    assert (1 + (2 * math.pi / 50) ** 2) ** 10 > 1.1
    diverged(scenario)
    ps.run(ps.from_table(swinging(50, "velocity_verlet", 0.2, ledger=False, every=10)))


def test_a_written_potential_that_stands_still() -> None:
    def scenario(potential: str) -> Table:
        field = {"type": "field", "potential": potential}
        group = points((1.0, 0, 0), velocity=[(3, 0, 0)])
        return table(10, 0.02, "explicit_euler", particles=[group], forces=[field], output=LEDGER)

    diverged(scenario("5*x**2"))
    ps.run(ps.from_table(scenario("5*x**2 + 0*t")))  # may do work for all that is known


def test_a_start_inside_a_plane_is_mended_first() -> None:
    # The first step lifts the ball by half a metre, which gives it m g/2; then it is judged as any other.
    def scenario(detection: str, dt: float) -> Table:
        return table(
            2.0,
            dt,
            particles=[points((0, -0.5, 0), velocity=[(0, 1, 0)])],
            forces=[{"type": "gravity"}],
            planes=[{"detection": detection}],
            output=LEDGER,
        )

    ps.run(ps.from_table(scenario("continuous", 0.002)))
    error = diverged(scenario("discrete", 0.04))
    assert "continuous" in error.hint


def test_booked_work_tells_what_is_fed() -> None:
    # A pin that shakes feeds the chain, which is no gain while its springs are stable; beyond that it is.
    def scenario(dt: float) -> Table:
        return table(
            400 * dt,
            dt,
            "velocity_verlet",
            particles=[points((0, 0, 0), (1, 0, 0), (2, 0, 0), name="chain", pinned=[0])],
            springs=[{"on": "chain", "pairs": [[0, 1], [1, 2]], "stiffness": 100.0}],
            motions=[{"on": "chain", "particles": [0], "path": ["x + 0.1*sin(5*t)", "y", "z"]}],
            output={"ledger": True, "work": True, "every": 10},
        )

    limit = 2 / math.sqrt(50 * (3 + math.sqrt(5)))  # ω² = k/m (3 + √5)/2
    result = ps.run(ps.from_table(scenario(0.2 * limit)))
    assert result.energy.max() > 1
    assert "beyond all work" in str(diverged(scenario(1.05 * limit)))


def test_a_kick_is_no_gain() -> None:
    simulation = Simulation(
        ps.from_table(swinging(50, "velocity_verlet") | {"impulses": [{"impulse": [9, 0, 0], "at": 0.5}]})
    )
    for step in (0, 20, 60, 100):
        simulation.advance_to(step)
        simulation.ledger()
        simulation.check()
    assert simulation.warnings() == ()
    simulation.close()


def test_rounding_of_what_lies_on_a_slope_is_no_gain() -> None:
    # tan 29.9° = 0.575 < μ: it stays in the origin, where all energies are rounding errors of kicks m (g h)² = 0.01 J.
    slope = {
        "simulation": {"duration": 2.0, "dt": 0.01, "integrator": "velocity_verlet"},
        "output": {"fps": 0.5, "work": True},
        "particles": [{"mass": 1.0, "layout": {"type": "points", "position": [[0, 0, 0]]}}],
        "forces": [{"type": "gravity", "acceleration": [0, -10, 0]}],
        "planes": [{"normal": [0.49848, 0.8669, 0.0], "restitution": 0.3, "friction": 0.6}],
    }
    assert abs(ps.run(ps.from_table(slope)).energy[-1]) < 1e-14
