"""IAS15: order 15, errors at rounding, forces that depend on the velocity, and what it does not take."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import legendre
from simulate import points, simulate, table

import particlesim as ps
from particlesim.engine.interactions.methods import chosen_in
from particlesim.integrators.ias15 import NODES, monomial_to_newton, newton_to_monomial
from particlesim.preflight.advice import long_sums
from particlesim.preflight.jumps import jumps
from particlesim.scenario.reach import pair_sets

PERIOD = 2 * math.pi
SHAPE = {"type": "point", "position": [0, 0, 0]}


def kepler(
    e: float, duration: float, dt: float, integrator: Any = "ias15", threads: int | None = None
) -> ps.Result:
    """An orbit of eccentricity e and semi-major axis 1 m about μ = 1 m³/s², from the perihelion."""
    scenario = table(
        duration,
        dt,
        integrator,
        particles=[points((1 - e, 0, 0), velocity=[(0, math.sqrt((1 + e) / (1 - e)), 0)])],
        forces=[{"type": "attractor", "strength": 1.0}],
        output={"every": 1},
    )
    return ps.run(ps.from_table(scenario), threads=threads)


def test_nodes_are_those_of_gauss_and_radau() -> None:
    roots = np.sort(legendre.legroots([0] * 7 + [1, 1]))
    assert np.abs((roots + 1) / 2 - NODES).max() < 4e-15
    c, d = np.array(newton_to_monomial()), np.array(monomial_to_newton())
    assert np.abs(c.T @ d.T - np.eye(7)).max() < 2e-15
    assert c[2] @ 0.3 ** np.arange(7) == pytest.approx((0.3 - NODES[1]) * (0.3 - NODES[2]))


def test_errors_fall_by_the_order() -> None:
    # A tolerance near 1 allows steps longer than dt. The order 15 is that of short steps, whose errors are below rounding
    # here; where they can be seen, the order between two steps is less by the next terms of the series, 12 or more.
    errors = []
    for steps in (5, 10):
        r = kepler(0.3, PERIOD, PERIOD / steps, {"method": "ias15", "tolerance": 0.9})
        errors.append(float(np.linalg.norm(r.final.position[0] - (0.7, 0, 0))))
    assert errors[1] > 1e-13
    assert 12 < math.log2(errors[0] / errors[1]) < 16


def test_a_hundred_orbits_of_high_eccentricity_close() -> None:
    # The energy loses some roundings, in 10⁴ steps at random: 10² · 1e-16 at 10 J of kinetic energy. The start itself is
    # rounded: v by 4e-16 of 4.4 m/s is 4e-15 of the period, 2e-12 s at the end, 1e-11 m.
    r = kepler(0.9, 100 * PERIOD, 10 * PERIOD)
    x, v = r.final.position[0], r.final.velocity[0]
    assert abs(v @ v / 2 - 1 / np.linalg.norm(x) + 0.5) < 1e-13
    assert np.linalg.norm(x - (0.1, 0, 0)) < 5e-11


def test_frames_do_not_matter() -> None:
    few, many = kepler(0.6, 3 * PERIOD, PERIOD), kepler(0.6, 3 * PERIOD, PERIOD / 50)
    assert np.abs(few.final.position - many.final.position).max() < 1e-13


def test_forces_may_depend_on_the_velocity() -> None:
    r = simulate(
        3.0,
        1.0,
        "ias15",  # type: ignore[arg-type]
        particles=[points((1, 2, 0), velocity=[(1, 0, -2)], mass=2.0)],
        forces=[{"type": "linear_drag", "coefficient": 1.5}],
    )
    left = math.exp(-1.5 / 2.0 * 3.0)
    assert r.final.velocity[0] == pytest.approx([left, 0, -2 * left], rel=4e-15)
    went = (1 - left) * 2.0 / 1.5
    assert r.final.position[0] == pytest.approx([1 + went, 2, -2 * went], rel=4e-15)


def test_nothing_to_do_is_done() -> None:
    r = simulate(2.0, 1.0, "ias15", particles=[points((1, 2, 3), velocity=[(1, 0, 0)])])  # type: ignore[arg-type]
    assert r.final.position[0].tolist() == [3, 2, 3]


def test_balls_bounce() -> None:
    # Contact ends a polynomial. Within the step of an impact particles that step together are followed under its mean
    # force, in one kick and one drift: the place is off by g dt²/2 at most.
    r = simulate(
        1.0,
        0.01,
        "ias15",  # type: ignore[arg-type]
        particles=[points((0, 1, 0))],
        forces=[{"type": "gravity"}],
        planes=[{"normal": [0, 1, 0], "restitution": 1.0}],
    )
    fall = math.sqrt(2 / 9.80665)
    t = 1.0 - fall
    assert r.final.position[0, 1] == pytest.approx(
        9.80665 * fall * t - 9.80665 * t * t / 2, abs=9.80665 * 0.01**2
    )
    assert r.final.velocity[0, 1] == pytest.approx(9.80665 * (2 * fall - 1.0), abs=9.80665 * 0.01**2)


def test_a_fall_into_a_centre_is_told() -> None:
    with pytest.raises(ps.DivergenceError, match="p"):
        simulate(
            2.0,
            0.5,
            "ias15",  # type: ignore[arg-type]
            particles=[points((1, 0, 0))],
            forces=[{"type": "attractor", "strength": 1.0}],
        )


def test_an_acceleration_may_pass_through_zero() -> None:
    # A spring about the origin, passed at full speed from the start: x = sin t.
    r = simulate(
        10.0,
        10.0,
        "ias15",  # type: ignore[arg-type]
        particles=[points((0, 0, 0), velocity=[(1, 0, 0)])],
        forces=[{"type": "point_spring", "anchor": [0, 0, 0], "stiffness": 1.0}],
    )
    assert r.final.position[0, 0] == pytest.approx(math.sin(10.0), abs=2e-14)


@pytest.mark.slow
def test_same_bits_for_any_number_of_threads() -> None:
    rng = np.random.default_rng(1)
    n = 9000
    scenario = table(
        0.5,
        0.25,
        "ias15",
        particles=[
            {
                "name": "p",
                "mass": 1.0,
                "layout": {"type": "points", "position": rng.normal(size=(n, 3)).tolist()},
            }
        ],
        springs=[{"on": "p", "pairs": [[i, i + 1] for i in range(n - 1)], "stiffness": 5.0}],
        forces=[{"type": "attractor", "strength": 1.0, "softening": 0.5}],
    )
    one, two = (ps.run(ps.from_table(scenario), threads=k).final for k in (1, 2))
    assert np.array_equal(one.position, two.position)
    assert np.array_equal(one.velocity, two.velocity)


@pytest.mark.parametrize(
    ("more", "where"),
    [
        ({"simulation": {"precision": "single"}}, "simulation.precision"),
        ({"output": {"work": True, "ledger": True}}, "output.work"),
    ],
)
def test_what_it_does_not_take_is_told(more: dict[str, Any], where: str) -> None:
    scenario = table(
        1.0,
        0.1,
        "ias15",
        particles=[points((1, 0, 0))],
        **{k: v for k, v in more.items() if k != "simulation"},
    )
    scenario["simulation"] |= more.get("simulation", {})
    with pytest.raises(ps.ScenarioError, match="ias15") as caught:
        ps.from_table(scenario)
    assert where in str(caught.value)


def bodies(integrator: Any, law: dict[str, Any], count: int = 5000, **simulation: Any) -> ps.Scenario:
    """As many bodies as a tree is faster for."""
    layout = {"type": "plummer", "count": count, "mass": 1.0, "radius": 1.0, "constant": 1.0}
    law = {"type": "gravity", "constant": 1.0, "softening": 0.1} | law
    scenario = table(0.1, 0.01, integrator, particles=[{"name": "p", "layout": layout}], interactions=[law])
    scenario["simulation"] |= simulation
    return ps.from_table(scenario)


def test_no_tree_is_taken_whose_forces_jump() -> None:
    for integrator, way in (("ias15", "direct"), ("velocity_verlet", "tree")):
        scenario = bodies(integrator, {})
        assert chosen_in(scenario, pair_sets(scenario)[0], 5000) == way
    (told,) = long_sums(bodies("ias15", {}, count=1_000_000))
    assert "ias15 takes no tree, whose forces jump" in told
    with pytest.raises(ps.ScenarioError, match="forces by a tree jump") as caught:
        bodies("ias15", {"method": "tree"})
    (mistake,) = caught.value.diagnostics
    assert (mistake.path, mistake.allowed) == ("interactions.gravity.method", '"auto", "direct"')
    with pytest.raises(ps.ScenarioError, match="forces by a mesh jump"):
        bodies("ias15", {}, box={"size": [20.0, 20.0, 20.0]})


@pytest.mark.parametrize(
    ("integrator", "told"),
    [
        ({"method": "dop853", "tolerance": 1e-10}, ["a tolerance of 1e-06 or more, or accuracy = 1e-07"]),
        ({"method": "rk45", "tolerance": 1e-7}, ["a tolerance of 1e-06 or more, or accuracy = 0.0001"]),
        ("dop853", []),  # 1e-6
        ("velocity_verlet", []),
        ("ias15", []),
    ],
)
def test_a_tolerance_below_what_a_tree_carries_is_told(integrator: Any, told: list[str]) -> None:
    found = jumps(bodies(integrator, {}))
    assert len(found) == len(told)
    assert all(words in sentence for words, sentence in zip(told, found, strict=True))


SPHERES = {"type": "soft_sphere", "epsilon": 1.0}
ATOMS = {"type": "lennard_jones", "epsilon": 1.0, "sigma": 1.0}


@pytest.mark.parametrize(
    ("law", "where"),
    [
        (ATOMS | {"cutoff": 2.5}, "jumps at the cutoff of 2.5 m"),
        (ATOMS | {"cutoff": 2.5, "shift": "energy"}, "jumps at the cutoff of 2.5 m"),
        (SPHERES | {"sigma": 0.5}, "begins at r = 0.5 m"),
        (SPHERES, "begins where two particles touch"),
        (ATOMS | {"cutoff": 2.5, "shift": "force"}, None),
        (ATOMS, None),
    ],
)
def test_forces_that_jump_are_told_before_a_run(law: dict[str, Any], where: str | None) -> None:
    group = points((0, 0, 0), (1.2, 0, 0), name="p", radius=0.1, mass=1.0)
    for integrator in ("ias15", "velocity_verlet"):
        scenario = ps.from_table(table(1.0, 0.1, integrator, particles=[group], interactions=[law]))
        found = jumps(scenario)
        if where is None or integrator != "ias15":
            assert found == ()
        else:
            (told,) = found
            assert where in told
