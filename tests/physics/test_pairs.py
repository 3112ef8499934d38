"""Interactions of pairs: two bodies against Kepler, three on a figure of eight, momentum, and the same bits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import EPS, points, simulate, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.model.constants import COULOMB_CONSTANT, GRAVITATIONAL_CONSTANT

GRAVITY = {"name": "gravity", "type": "gravity", "constant": 1.0}


def bodies(mass: Any, position: Any, velocity: Any, **group: Any) -> dict[str, Any]:
    return {
        "name": "bodies",
        "layout": {"type": "points", "position": position, "velocity": velocity},
        "mass": mass,
        **group,
    }


def kepler(e: float, mass: tuple[float, float]) -> list[dict[str, Any]]:
    """Two bodies at pericentre, a = 1, G = 1, about their centre of mass at rest."""
    total = sum(mass)
    r, v = 1 - e, math.sqrt(total * (1 + e) / (1 - e))
    parts = [mass[1] / total, -mass[0] / total]
    return [
        points((parts[k] * r, 0, 0), velocity=[(0, parts[k] * v, 0)], name=f"body{k}", mass=mass[k])
        for k in range(2)
    ]


def kepler_place(e: float, total: float, t: float) -> np.ndarray:
    """Relative place on the ellipse with a = 1: M = n t = E − e sin E, x = cos E − e, y = √(1 − e²) sin E."""
    anomaly = mean = math.sqrt(total) * t
    for _ in range(60):
        anomaly -= (anomaly - e * math.sin(anomaly) - mean) / (1 - e * math.cos(anomaly))
    return np.array([math.cos(anomaly) - e, math.sqrt(1 - e * e) * math.sin(anomaly), 0])


@pytest.mark.parametrize("method", ["rk4", "velocity_verlet", "dop853"])
@pytest.mark.parametrize("mass", [(1.0, 1.0), (1.0, 1e-3)])
def test_two_bodies_move_on_kepler_ellipses(method: str, mass: tuple[float, float]) -> None:
    e, duration = 0.3, 4.0
    error = []
    for dt in (0.02, 0.01):
        result = simulate(duration, dt, method, particles=kepler(e, mass), interactions=[GRAVITY])
        first, second = result.final.position
        error.append(np.abs(first - second - kepler_place(e, sum(mass), duration)).max())
    if method == "dop853":
        assert max(error) < 1e-6  # its tolerance
        return
    order = {"rk4": 4, "velocity_verlet": 2}[method]
    assert math.log2(error[0] / error[1]) == pytest.approx(order, abs=0.4)
    assert error[1] < {4: 1e-6, 2: 5e-3}[order]


def test_three_bodies_close_the_figure_of_eight() -> None:
    # A. Chenciner, R. Montgomery, Annals of Mathematics 152, 881 (2000); initial values by C. Simó, T = 6.32591398.
    x1, v3 = (0.97000436, -0.24308753, 0.0), (-0.93240737, -0.86473146, 0.0)
    half = tuple(-0.5 * v for v in v3)
    position = [x1, tuple(-x for x in x1), (0.0, 0.0, 0.0)]
    period = 6.32591398
    result = simulate(
        period,
        period / 2000,
        "rk4",
        particles=[bodies(1.0, position, [half, half, v3])],
        interactions=[GRAVITY],
    )
    # rk4 with 2000 steps errs by some 1e-8; the initial values have nine digits
    np.testing.assert_allclose(result.final.position, position, atol=2e-7)


def test_units_of_gravity_and_of_charges() -> None:
    # Two bodies of 3e10 kg and 1e10 kg at 2 m; ions of ±e at 1 nm in water
    for interaction, group, expected in (
        ({"type": "gravity"}, {"mass": 3e10}, -GRAVITATIONAL_CONSTANT * 9e20 / 4),
        ({"type": "coulomb"}, {"mass": 1.0, "charge": 2e-6}, COULOMB_CONSTANT * 4e-12 / 4),
        (
            {"type": "coulomb", "relative_permittivity": 80},
            {"mass": 1.0, "charge": 2e-6},
            COULOMB_CONSTANT * 4e-12 / 320,
        ),
    ):
        scenario = ps.from_table(
            table(
                1,
                1,
                particles=[bodies(position=[[2, 0, 0], [0, 0, 0]], velocity=[[0, 0, 0]] * 2, **group)],
                interactions=[interaction],
            )
        )
        simulation = Simulation(scenario, threads=1)
        force = simulation.islands[0].forces(0.0)
        np.testing.assert_allclose(force[0], [expected, -expected], rtol=1e-14)
        potential = simulation.ledger()[f"potential.{interaction['type']}"]
        assert potential == pytest.approx(2 * expected, rel=1e-14)
        simulation.close()


def cloud(n: int, precision: str = "double", **simulation: Any) -> dict[str, Any]:
    """A cloud of bodies and two more, gravity among all and charges between both groups."""
    return {
        "simulation": {
            "duration": 0.05,
            "dt": 0.005,
            "integrator": "velocity_verlet",
            "precision": precision,
            **simulation,
        },
        "output": {"every": 5},
        "particles": [
            {
                "name": "cloud",
                "mass": 1.0 / n,
                "charge": 1e-3,
                "layout": {"type": "random", "count": n, "shape": {"type": "ball", "radius": 1}},
            },
            points((2, 0, 0), (0, 3, 0), velocity=[(0, 0, 0.1)] * 2, name="pair", mass=1.0, charge=-1e-3),
        ],
        "interactions": [
            {"type": "gravity", "constant": 1.0, "softening": 0.02},
            {"type": "coulomb", "constant": 1.0, "between": ["cloud", "pair"]},
        ],
    }


def reference(scenario: ps.Scenario) -> np.ndarray:
    """Forces at the start by NumPy, shape [3, n]."""
    simulation = Simulation(scenario, threads=1)
    states = simulation.states
    x = np.concatenate([state.position for state in states])
    m, q = (
        np.concatenate([state.attribute(name) for state in states]).astype(float)
        for name in ("mass", "charge")
    )
    simulation.close()
    n, inside = len(x), np.arange(len(x)) < len(x) - 2
    total = np.zeros((n, 3))
    for i in range(n):
        line = x[i] - x
        s = (line**2).sum(axis=1)
        k = -m[i] * m / (s + 4e-4) ** 1.5
        other = inside != inside[i]
        k[other] += q[i] * q[other] / s[other] ** 1.5
        total[i] = (k[:, None] * line).sum(axis=0)
    return total.T


def test_forces_are_those_of_all_pairs() -> None:
    scenario = ps.from_table(cloud(301))
    simulation = Simulation(scenario, threads=1)
    found, expected = simulation.islands[0].forces(0.0), reference(scenario)
    # a sum of n terms in order errs by at most n ε Σ|f|
    np.testing.assert_allclose(found, expected, atol=300 * EPS * np.abs(expected).max() * 10)
    # Newton's third law holds to rounding
    assert np.abs(found.sum(axis=1)).max() < 300 * EPS * np.abs(found).sum()
    simulation.close()


def test_momentum_and_angular_momentum_are_kept_to_rounding() -> None:
    simulation = Simulation(ps.from_table(cloud(200)), threads=2)
    before = simulation.ledger()
    simulation.advance_to(10)
    after = simulation.ledger()
    for name, scale in (("momentum", 1.0), ("angular_momentum", 3.0)):
        for axis in "xyz":
            assert after[f"{name}.{axis}"] == pytest.approx(before[f"{name}.{axis}"], abs=1e4 * EPS * scale)
    simulation.close()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["double", "single"])
def test_same_bits_for_any_number_of_threads(precision: str) -> None:
    found = set()
    for threads in (1, 2, 3):
        simulation = Simulation(ps.from_table(cloud(3100, precision)), threads=threads)
        simulation.advance_to(3)
        found.add(b"".join(state.x.tobytes() + state.v.tobytes() for state in simulation.states))
        simulation.close()
    assert len(found) == 1


def test_a_sum_that_is_known_is_not_taken_again() -> None:
    # Kick, drift, kick: the forces at the end of a step are those at the beginning of the next. What has changed in
    # between, be it one place by one rounding, is seen; and results are the bits of sums that are taken anew.
    rng = np.random.default_rng(4)
    group = {
        "name": "p",
        "mass": 1.0,
        "layout": {"type": "points", "position": rng.normal(size=(40, 3)).tolist()},
    }
    law = {"type": "gravity", "constant": 1.0, "softening": 0.1, "method": "direct"}
    scenario = table(0.2, 0.01, particles=[group], interactions=[law], output={"every": 1})
    ends = []
    for forgets in (False, True):
        simulation = Simulation(ps.from_table(scenario), threads=1)
        (state,) = simulation.states
        (each,) = simulation.islands[0].interactions
        for step in range(1, 21):
            if forgets:
                each.last.seen[0][:] = np.nan
            if step == 10:
                state.x[1, 7] = np.nextafter(state.x[1, 7], 9.0)
            simulation.advance_to(step)
        ends.append((state.x.copy(), state.v.copy()))
        simulation.close()
    assert all(np.array_equal(a, b) for a, b in zip(*ends, strict=True))


@pytest.mark.parametrize("count", [5, 130, 300])
def test_few_hundred_particles_have_the_same_bits_on_many_threads(count: int) -> None:
    rng = np.random.default_rng(5)
    group = {
        "name": "p",
        "mass": 1.0,
        "layout": {"type": "points", "position": rng.normal(size=(count, 3)).tolist()},
    }
    law = {"type": "gravity", "constant": 1.0, "softening": 0.1, "method": "direct"}
    scenario = table(0.1, 0.001, particles=[group], interactions=[law])
    one, three = (ps.run(ps.from_table(scenario), threads=k).final for k in (1, 3))
    assert np.array_equal(one.position, three.position)
