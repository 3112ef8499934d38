"""The ledger says what NumPy says of the same particles."""

from __future__ import annotations

import numpy as np
import pytest
from simulate import EPS, G, points, simulate

import particlesim as ps

COUNT = 10_000
"""More than two of the chunks that the sums are cut into."""


def test_ledger_sums_are_numpys_sums() -> None:
    # The order of the sums differs: n roundings of EPS add up to about √n EPS of the terms' sizes.
    result = simulate(
        0.2,
        0.01,
        particles=[
            {
                "name": "cloud",
                "layout": {
                    "type": "random",
                    "count": COUNT,
                    "shape": {"type": "ball", "center": [1, 2, 3], "radius": 2},
                    "velocity": [{"type": "normal", "mean": m, "std": 1} for m in (1, -2, 3)],
                },
                "mass": {"type": "uniform", "low": 0.5, "high": 2.0},
            },
            points((0, 5, 0), mass=7.0, name="lone"),
        ],
        forces=[
            {"type": "gravity"},
            {"type": "gravity", "name": "side", "acceleration": [2, 0, 0], "on": ["lone"]},
        ],
        output={"ledger": True},
    )
    final = result.final
    m, x, v = final["mass"], final.position, final.velocity
    last = {name: column[-1] for name, column in result.ledger.items()}
    terms = {
        "kinetic": 0.5 * m * (v**2).sum(axis=1),
        "potential.gravity": m * G * x[:, 1],
        "potential.side": -2 * m[-1:] * x[-1:, 0],
        **{f"momentum.{a}": m * v[:, k] for k, a in enumerate("xyz")},
        **{f"angular_momentum.{a}": (m[:, None] * np.cross(x, v))[:, k] for k, a in enumerate("xyz")},
    }
    assert set(last) == set(terms)
    for name, term in terms.items():
        assert last[name] == pytest.approx(term.sum(), abs=np.sqrt(COUNT) * EPS * np.abs(term).sum())
    assert result.energy[-1] == pytest.approx(
        sum(terms[k].sum() for k in ("kinetic", "potential.gravity", "potential.side")), rel=1e-12
    )


def test_groups_of_an_island_have_their_potentials_together() -> None:
    # A spring between two groups makes them one island: U is the sum of both in gravity, and half k s² in the spring.
    result = simulate(
        0.1,
        0.01,
        particles=[points((0, 2, 0), mass=2.0, name="a"), points((0, 3.5, 0), mass=3.0, name="b")],
        springs=[{"between": ["a", "b"], "pairs": [[0, 0]], "stiffness": 8.0, "rest_length": 1.0}],
        forces=[{"type": "gravity"}, {"type": "point_spring", "stiffness": 5.0, "on": ["a"]}],
        output={"ledger": True},
    )
    first = {name: column[0] for name, column in result.ledger.items()}
    assert first["potential.gravity"] == pytest.approx(G * (2 * 2 + 3 * 3.5), rel=1e-12)
    assert first["potential.springs"] == pytest.approx(8.0 / 2 * 0.5**2, rel=1e-12)
    assert first["potential.point_spring"] == pytest.approx(5.0 / 2 * 4, rel=1e-12)


def test_the_energy_of_a_free_fall_stays_in_the_ledger() -> None:
    # Velocity Verlet in a constant field keeps ½ m v² + m g y exactly, step by step.
    result = simulate(
        2.0,
        0.01,
        particles=[points((0, 5, 0), (1, 2, 3), velocity=[(1, 2, 3), (4, 5, 6)], mass=3.0)],
        forces=[{"type": "gravity"}],
        output={"ledger": True, "every": 1},
    )
    assert np.ptp(result.energy) < 200 * EPS * 2000
    assert result.ledger["momentum.y"] == pytest.approx(3 * 7 - 6 * G * result.times, abs=1e-11)


def test_forces_and_accelerations_are_recorded_as_they_act() -> None:
    result = simulate(
        1.0,
        0.01,
        particles=[points((0, 5, 0), velocity=[(3, 0, 0)], mass=2.0)],
        forces=[{"type": "gravity"}],
    )
    assert result.final["force"][0] == pytest.approx([0, -2 * G, 0], rel=1e-15)
    assert result.final["acceleration"][0] == pytest.approx([0, -G, 0], rel=1e-15)
    assert result.final["speed"][0] == pytest.approx(np.hypot(3, G), rel=1e-12)


def test_energies_beyond_all_numbers_end_a_run() -> None:
    # ½ m v² of 1e200 m/s has no double, nor has y v of 1e200 m times 1e150 m/s.
    table = {
        "simulation": {"duration": 1.0, "dt": 0.1},
        "particles": [points((0, 1, 0), velocity=[(1e200, 0, 0)])],
    }
    with pytest.raises(ps.UsageError, match=r"kinetic is not finite at the start.* velocities up to 1e\+200"):
        ps.run(ps.from_table(table))
    assert ps.run(ps.from_table(table | {"output": {"ledger": False}})).final.position[0, 0] > 9e199
    kick = {"impulse": [1e200, 0, 0], "at": 0.5}
    with pytest.raises(ps.DivergenceError, match=r"kinetic is no longer finite at t = 0\.6 s"):
        ps.run(
            ps.from_table(
                table | {"particles": [points((0, 1, 0))], "impulses": [kick], "output": {"every": 1}}
            )
        )
