"""The observed order is that of the method, on closed forms and on every shipped scenario with a smooth solution."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import particlesim as ps
from particlesim.integrators import METHODS
from particlesim.verification.convergence import Verification, verify

SHIPPED = Path(__file__).parents[2] / "scenarios"

WELL = """
[simulation]
duration = 1.0
dt = 0.0625
[output]
every = 4
[[particles]]
name = "ball"
layout = { type = "points", position = [[1, 0, 0]], velocity = [[3, 0, 0]] }
[[forces]]
type = "point_spring"
stiffness = 40.0
"""


def rows(found: Verification) -> dict[tuple[str, str], tuple[str, float | None]]:
    return {(row.group, row.field): (row.verdict, row.order) for row in found.rows}


def test_the_error_is_the_error(tmp_path) -> None:
    """Harmonic oscillator of unit mass. Richardson's estimate has an error of higher order, (ω dt)² ≈ 0.02."""
    scenario = ps.loads(
        WELL,
        {
            "simulation.integrator": "velocity_verlet",
            "simulation.dt": 0.02,
            "output.every": 1,
            "output.precision": "double",
        },
    )
    found = verify(scenario)
    assert found.passed
    assert found.steps == (0.02, 0.01, 0.005)
    omega, frames = math.sqrt(40), 51
    exact = {
        "position": lambda t: math.cos(omega * t) + 3 / omega * math.sin(omega * t),
        "velocity": lambda t: -omega * math.sin(omega * t) + 3 * math.cos(omega * t),
    }
    squares, largest = dict.fromkeys(exact, 0.0), dict.fromkeys(exact, 0.0)
    ps.run(scenario, tmp_path / "run.vtkhdf")
    with ps.open(tmp_path / "run.vtkhdf") as trajectory:
        assert len(trajectory) == frames
        for frame in trajectory:
            for field, truth in exact.items():
                squares[field] += (frame[field][0, 0] - truth(frame.time)) ** 2
                largest[field] = max(largest[field], abs(frame[field][0, 0]))
    for row in found.rows:
        assert row.order == pytest.approx(2, abs=0.05)
        assert row.error == pytest.approx(math.sqrt(squares[row.field] / frames), rel=0.05)
        assert row.error is not None
        assert row.finest_error == pytest.approx(row.error / 16, rel=0.1)
        assert row.relative == pytest.approx(row.error / largest[row.field])


@pytest.mark.parametrize("name", ["symplectic_euler", "heun", "rk3", "yoshida4"])
def test_methods_have_their_order(name: str) -> None:
    found = verify(
        ps.loads(
            WELL,
            {"simulation.integrator": name, "simulation.dt": 0.0125 if METHODS[name].order > 2 else 0.005},
        )
    )
    for row in found.rows:
        assert row.verdict == "ok", row
        assert row.order == pytest.approx(METHODS[name].order, abs=0.35), row


@pytest.mark.sampled(9)
@pytest.mark.parametrize(
    ("name", "smooth", "simulation"),
    [
        ("orbit", {"mercury": 4, "venus": 4, "earth": 4}, {"duration": "120 d"}),
        ("harmonic_well", {"cube": 4}, {"duration": 2.0}),
        pytest.param("vortex", {"tracers": 4, "grains": 4}, {"duration": 2.0}, marks=pytest.mark.slow),
        pytest.param(
            "projectile_drag", {"table_tennis": 4}, {"duration": 1.0, "dt": 0.05}, marks=pytest.mark.slow
        ),
        pytest.param("terminal_velocity", {"r4mm": 4}, {"duration": 1.0, "dt": 0.1}, marks=pytest.mark.slow),
        ("buoyant_ball", {"ice": 4}, {"duration": 0.5, "dt": 0.05}),
        pytest.param("rotating_habitat", {"crew": 4}, {"duration": 4.0, "dt": 0.25}, marks=pytest.mark.slow),
        ("pendulum_chain", {"chain": 4, "twin": 4}, {"duration": 0.48, "dt": 8e-3}),
        ("hanging_cloth", {"cloth": 1}, {"duration": 0.1}),
    ],
)
def test_shipped_scenarios_with_a_smooth_solution(
    name: str, smooth: dict[str, int], simulation: dict[str, object]
) -> None:
    overrides = {f"simulation.{key}": value for key, value in simulation.items()}
    if name == "rotating_habitat":  # frames at 60 Hz make steps too short to see an error
        overrides["output"] = {"interval": 0.5}
    if name == "pendulum_chain":
        overrides["output"] = {"interval": 0.08}
    if name == "hanging_cloth":  # a coarser one, of the same order
        overrides["particles.cloth.layout.resolution"] = [26, 15]
    found = rows(verify(ps.load(SHIPPED / f"{name}.toml", overrides)))
    for group, order in smooth.items():
        verdict, observed = found[group, "position"]
        assert verdict == "ok"
        assert observed == pytest.approx(order, abs=0.4)


def test_exact_methods_are_exact() -> None:
    found = verify(ps.load(SHIPPED / "projectile.toml", {"simulation.duration": 1.0}))
    assert found.passed
    assert {row.verdict for row in found.rows} == {"exact"}
    assert all(row.order is row.error is None for row in found.rows)


def test_lost_order_is_told_with_its_reason() -> None:
    damped = WELL + '[[forces]]\nname = "air"\ntype = "linear_drag"\ncoefficient = 0.8\n'
    found = verify(ps.loads(damped, {"simulation.integrator": "velocity_verlet", "simulation.dt": 0.01}))
    assert not found.passed
    assert {row.verdict for row in found.rows} == {"below"}
    assert found.rows[0].order == pytest.approx(
        1, abs=0.2
    )  # dt ω ≈ 0.06, halved: a second order of some per cent
    assert found.reasons == (
        "velocity_verlet is only first order for 'ball', because air depends on the velocity; rk4, heun and stormer_verlet "
        "keep their order",
    )


def test_kinks_are_named() -> None:
    more = """
    [[planes]]
    point = [-0.5, 0, 0]
    normal = [1, 0, 0]
    name = 'wall'
    [[forces]]
    type = "field"
    force = ["-30 if x < 0 else 30", "0", "0"]
    [[impulses]]
    at = 0.513
    impulse = [3, 0, 0]
    """
    found = verify(ps.loads(WELL + more, {"simulation.integrator": "rk4", "simulation.dt": 0.0025}))
    assert not found.passed
    told = "\n".join(found.reasons)
    for reason in ("plane wall", "has a condition", "an impulse kicks 'ball'"):
        assert reason in told


THERMOSTAT = """
format = 1
[simulation]
duration = 0.5
dt = 0.05
integrator = "velocity_verlet"
[[particles]]
name = "fluid"
layout = { type = "points", position = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]] }
mass = 1.0
[[interactions]]
type = "friction"
coefficient = 2.0
range = 2.0
temperature = 1.0
boltzmann = 1.0
on = ["fluid"]
"""


def test_random_kicks_have_no_order() -> None:
    with pytest.raises(ps.UsageError, match="friction gives random kicks"):
        verify(ps.loads(THERMOSTAT))
    stone = '[[particles]]\nname = "stone"\nlayout = { type = "points", position = [[9, 0, 0]] }\n'
    found = verify(
        ps.loads(THERMOSTAT + stone + '[[forces]]\ntype = "point_spring"\nstiffness = 1.0\non = ["stone"]\n')
    )
    assert {(row.group, row.verdict) for row in found.rows} == {("fluid", "random"), ("stone", "ok")}
    assert found.passed
    assert any("'fluid' random kicks" in note for note in found.notes)
