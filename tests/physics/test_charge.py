"""The charge of particles: given in every way, read by formulas, kept through births, deaths and joints, and counted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import points, simulate, table

import particlesim as ps
from particlesim.errors import ScenarioError

ELECTRIC = {"type": "field", "force": ["q*E", "0", "0"], "constants": {"E": 3.0}}
X = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "method", ["velocity_verlet", "rk4", "stormer_verlet", "rk45", "implicit_midpoint", "bdf2"]
)
def test_a_uniform_electric_field_accelerates_by_q_e_over_m(method: str) -> None:
    # x = x0 + q E t²/(2 m): a parabola, which methods of second order follow to rounding; BDF2 errs by O(h²).
    m, q, t = np.array([1.0, 2.0, 0.5]), np.array([1e-1, -0.3, 0.0]), 1.0
    ions = points(*X, mass=m.tolist(), charge=q.tolist())
    final = simulate(t, 1e-2, method, particles=[ions], forces=[ELECTRIC]).final
    assert final["velocity"][:, 0] == pytest.approx(q * 3.0 / m * t, abs=1e-12)
    assert final.position[:, 0] == pytest.approx(
        np.array(X)[:, 0] + q * 3.0 / m * t**2 / 2, abs=1e-4 if method == "bdf2" else 1e-12
    )


def test_a_charge_circles_in_a_magnetic_field() -> None:
    # f = q v × B with B along z: a circle of radius m v/(q B), run through in 2π m/(q B).
    q, b = 2.0, 1.5
    period = 2 * np.pi / (q * b)
    magnetic = {"type": "field", "force": ["q*B*vy", "-q*B*vx", "0"], "constants": {"B": b}}
    ion = points((0, 0, 0), velocity=[(1.0, 0, 0)], charge=q)
    half, whole = (
        simulate(turns * period, period / 400, "rk4", particles=[ion], forces=[magnetic]).final.position[0]
        for turns in (0.5, 1.0)
    )
    assert half == pytest.approx((0, -2 / (q * b), 0), abs=1e-6)
    assert whole == pytest.approx((0, 0, 0), abs=1e-6)


def test_energy_in_an_electric_potential_is_conserved() -> None:
    well = {"type": "field", "potential": "q*x**2", "name": "trap"}
    ions = points(*X, charge=[0.5, 1.0, 2.0])
    output = {"ledger": True, "every": 1}
    result = simulate(2.0, 1e-3, "yoshida4", particles=[ions], forces=[well], output=output)
    energy = result.ledger["kinetic"] + result.ledger["potential.trap"]
    assert energy[0] == 1.0 + 2.0 * 4
    assert energy == pytest.approx(energy[0], rel=1e-9)
    assert result.ledger["charge.total"].tolist() == [3.5] * len(energy)


def test_charges_stay_with_their_particles_when_others_die() -> None:
    # Every particle that a plane kills takes its charge out of the sum; those that stay still have their own.
    ions = points(
        (0, 0.55, 0), (0, 3, 0), (0, 0.6, 0), (0, 4, 0), velocity=[(0, -1, 0)], charge=[1.0, 2.0, 4.0, 8.0]
    )
    floor = {"normal": [0, 1, 0], "contact": "kill"}
    result = simulate(
        1.0,
        0.01,
        particles=[ions],
        planes=[floor],
        output={"ledger": True, "every": 50, "fields": ["charge"]},
    )
    assert result.final["charge"].tolist() == [2.0, 8.0]
    assert result.ledger["charge.total"].tolist() == [15.0, 15.0, 10.0]


@pytest.mark.parametrize("method", ["symplectic_euler", "rk45"])
def test_emitted_charges_follow_their_distribution(method: str) -> None:
    # From rest at x = 0, v = q E/m · age.
    spread = {"type": "uniform", "low": -1.0, "high": 2.0}
    emitter = {
        "rate": 200,
        "shape": {"type": "point", "position": [0, 0, 0]},
        "charge": spread,
        "lifetime": 0.7,
    }
    output = {"ledger": True, "fields": ["velocity", "charge", "age"]}
    result = simulate(1.0, 0.01, method, emitters=[emitter], forces=[ELECTRIC], output=output)
    q, age = result.final["charge"], result.final["age"]
    assert len(q) > 100
    assert -1 <= q.min() < -0.8
    assert 1.8 < q.max() <= 2
    assert result.final["velocity"][:, 0] == pytest.approx(q * 3.0 * age, abs=1e-12)
    assert result.ledger["charge.total"][-1] == pytest.approx(q.sum(), rel=1e-14)


@pytest.mark.parametrize("method", ["velocity_verlet", "rk45", "implicit_midpoint"])
def test_charged_particles_on_springs(method: str) -> None:
    # The centre of mass feels the whole charge: a = (q₁ + q₂) E/(m₁ + m₂). A group without charges joins one with them.
    neutral = points((0, 0, 0), mass=1.0, name="neutral")
    ion = points((1, 0, 0), mass=3.0, charge=0.8, name="ion")
    spring = {"between": ["neutral", "ion"], "pairs": [[0, 0]], "stiffness": 40.0}
    final = simulate(
        1.0, 1e-2, method, particles=[neutral, ion], springs=[spring], forces=[{**ELECTRIC, "on": ["ion"]}]
    ).final
    centre = (final.position[0, 0] + 3 * final.position[1, 0]) / 4
    assert centre == pytest.approx(3 / 4 + 0.8 * 3.0 / 4 / 2, abs=1e-9)
    assert final["charge"].tolist() == [0.0, 0.8]


@pytest.mark.parametrize("suffix", [".csv", ".npy", ".vtkhdf"])
def test_charges_from_a_file(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"ions{suffix}"
    if suffix == ".csv":
        path.write_text("x,y,z,charge\n0,0,0,0.25\n1,0,0,-0.5\n")
    elif suffix == ".npy":
        rows = [(0, 0, 0, 0.25), (1, 0, 0, -0.5)]
        np.save(path, np.array(rows, [(name, float) for name in ("x", "y", "z", "charge")]))
    else:
        ions = points(*X[:2], charge=[0.25, -0.5])
        ps.run(ps.from_table(table(0.1, 0.1, particles=[ions], output={"precision": "double"})), path)
    ions = {"layout": {"type": "file", "path": str(path)}}
    output = {"ledger": True, "fields": ["charge", "velocity"]}
    result = simulate(1.0, 0.1, particles=[ions], forces=[ELECTRIC], output=output)
    assert result.final["charge"].tolist() == [0.25, -0.5]
    assert result.final["velocity"][:, 0] == pytest.approx([0.75, -1.5], abs=1e-14)
    assert result.ledger["charge.total"].tolist() == [-0.25, -0.25]


def test_temperatures_from_a_file_are_used(tmp_path: Path) -> None:
    path = tmp_path / "warm.csv"
    path.write_text("x,y,z,temperature\n0,0,0,300\n1,0,0,400\n")
    heated = {"type": "field", "force": ["T", "0", "0"]}
    final = simulate(
        1.0, 0.1, particles=[{"layout": {"type": "file", "path": str(path)}}], forces=[heated]
    ).final
    assert final["velocity"][:, 0] == pytest.approx([300, 400])
    assert final["temperature"].tolist() == [300, 400]


def test_a_constant_named_q_takes_the_place_of_the_charge() -> None:
    # Formulas from before particles had charges mean what they did.
    force = {"type": "field", "force": ["q", "0", "0"], "constants": {"q": 2.0}}
    final = simulate(1.0, 0.1, particles=[points(X[0])], forces=[force]).final
    assert final["velocity"][0, 0] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({"forces": [ELECTRIC]}, "field needs a charge, and the particles of 'particles' have none"),
        ({"output": {"fields": ["charge"]}}, "no particle has a charge"),
        (
            {"checks": [{"quantity": "charge", "statistic": "max", "max": 1}]},
            "no particle here has a charge",
        ),
    ],
)
def test_what_reads_a_charge_finds_one(parts: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        ps.from_table(table(1.0, 0.1, particles=[points(X[0])], **parts))


def test_checks_see_charges_and_their_sum() -> None:
    checks = [
        {"quantity": "charge", "statistic": "max", "equals": "3 mC", "tolerance": "1 nC", "at": "end"},
        {"quantity": "charge.total", "equals": 4e-3, "tolerance": 1e-12, "at": "end"},
        {"quantity": "velocity.x", "expression": "3*q*t/m", "tolerance": 1e-12, "at": "end"},
    ]
    ions = points(*X[:2], charge=["1 mC", "3 mC"])
    output = {"ledger": True}
    result = simulate(1.0, 0.1, particles=[ions], forces=[ELECTRIC], checks=checks, output=output)
    assert [each.passed for each in result.checks] == [True] * 3
