"""Laws of pairs at work: the thermostat's temperature, its random numbers, flocks, formulas, and mixing."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np
import pytest
from simulate import Table, points, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.interactions.gravity import MutualGravity
from particlesim.laws.pair import Pair, central
from particlesim.laws.scatter import kick

POINT = {"type": "point", "position": [0, 0, 0]}


def simulation_of(steps: int, dt: float, threads: int = 1, **parts: Any) -> Simulation:
    return Simulation(ps.from_table(table(steps * dt, dt, **parts)), threads=threads)


def fluid(**law: Any) -> dict[str, Any]:
    """150 particles in a harmonic well, all of which feel each other's friction."""
    return {
        "particles": [
            {
                "name": "fluid",
                "mass": 1.0,
                "layout": {"type": "random", "count": 150, "shape": {"type": "ball", "radius": 1}},
            }
        ],
        "forces": [{"type": "point_spring", "stiffness": 2.0}],
        "interactions": [
            {"type": "friction", "coefficient": 1.0, "range": 3.0, "boltzmann": 1.0, **law},
        ],
    }


@pytest.mark.optimised
def test_the_thermostat_brings_every_direction_to_its_temperature() -> None:
    # Equipartition: m ⟨v²⟩ = k_B T in each direction, in the frame of the centre of mass, which pair forces leave alone.
    # Relaxation takes some 1/(γ n w²/m) ≈ 1/20 time units, so that 60 moments 0.2 apart are independent: the mean square of
    # 149 · 60 normal numbers has a relative error of √(2/8940) = 1.5 %; four times that, and 1 % for the step.
    simulation = simulation_of(2600, 0.005, seed=5, **fluid(temperature=0.5))
    simulation.advance_to(200)
    found = []
    for k in range(60):
        simulation.advance_to(200 + 40 * (k + 1))
        v = simulation.states[0].velocity
        found.append(((v - v.mean(axis=0)) ** 2).sum(axis=0) / 149)
    simulation.close()
    np.testing.assert_allclose(np.mean(found, axis=0), 0.5, rtol=0.07)


def test_the_thermostat_keeps_momentum() -> None:
    parts = fluid(temperature=0.5)
    parts.pop("forces")
    simulation = simulation_of(100, 0.005, **parts)
    simulation.advance_to(100)
    v = simulation.states[0].velocity
    assert np.abs(v.sum(axis=0)).max() < 1e-12 * np.abs(v).sum()
    simulation.close()


def test_friction_alone_takes_what_the_ledger_says() -> None:
    parts = fluid()
    parts["forces"] = []
    simulation = simulation_of(50, 0.002, output={"work": True, "ledger": True}, **parts)
    simulation.states[0].v[:] = np.random.default_rng(1).normal(size=(3, 150))
    before = simulation.ledger()
    simulation.advance_to(50)
    after = simulation.ledger()
    lost = after["kinetic"] - before["kinetic"]
    assert lost < -0.1 * before["kinetic"]
    # Simpson's rule along the path of a first-order method: the work is right to that order
    assert after["work.friction"] == pytest.approx(lost, rel=0.02)
    simulation.close()


def test_kicks_are_the_same_for_any_number_of_threads_and_for_a_seed() -> None:
    found = []
    for threads, seed in ((1, 3), (2, 3), (1, 4)):
        parts = fluid(temperature=0.5)
        parts["particles"][0]["layout"]["count"] = 1100
        parts["interactions"][0]["range"] = 0.2
        simulation = simulation_of(3, 0.005, threads, seed=seed, **parts)
        simulation.advance_to(3)
        found.append(simulation.states[0].v.tobytes())
        simulation.close()
    assert found[0] == found[1] != found[2]


def test_random_numbers_of_pairs_are_uniform_and_independent() -> None:
    # 2016 numbers: means and correlations have an error of 1/√2016 = 0.022, variances of √(0.8/2016) = 0.02
    first = np.array([kick(7, 3, i, j) for i in range(64) for j in range(i)])
    later = np.array([kick(7, 4, i, j) for i in range(64) for j in range(i)])
    other = np.array([kick(8, 3, i, j) for i in range(64) for j in range(i)])
    for numbers in (first, later, other):
        assert abs(numbers.mean()) < 0.1
        assert numbers.var() == pytest.approx(1, abs=0.1)
        assert np.abs(numbers).max() <= math.sqrt(3)
    for a, b in ((first, later), (first, other), (first[1:], first[:-1])):
        assert abs((a * b).mean()) < 0.1
    assert kick(7, 3, 5, 9) == kick(7, 3, 9, 5)


def test_a_flock_comes_to_fly_one_way_and_keeps_its_distance() -> None:
    parts = {
        "particles": [
            {
                "name": "birds",
                "mass": 1.0,
                "layout": {
                    "type": "random",
                    "count": 60,
                    "shape": {"type": "ball", "radius": 2},
                    "speed": {"distribution": "uniform", "low": 0, "high": 2},
                },
            }
        ],
        "interactions": [
            {
                "type": "flocking",
                "sight": 5.0,
                "distance": 0.6,
                "separation": 4.0,
                "alignment": 0.5,
                "cohesion": 0.05,
            }
        ],
    }
    parts["particles"][0]["layout"].pop("speed")
    simulation = simulation_of(600, 0.01, **parts)
    simulation.states[0].v[:] = np.random.default_rng(2).normal(1, 1, (3, 60))
    mean = simulation.states[0].velocity.mean(axis=0)
    simulation.advance_to(600)
    v, x = simulation.states[0].velocity, simulation.states[0].position
    np.testing.assert_allclose(
        v.mean(axis=0), mean, rtol=1e-12
    )  # what one does to another, that one does to it
    assert np.abs(v - mean).max() < 0.1
    apart = np.linalg.norm(x[:, None] - x[None], axis=2) + 10 * np.eye(60)
    assert apart.min() > 0.3
    simulation.close()


def test_a_formula_is_the_law_that_it_writes() -> None:
    group = points((0, 0, 0), (1.1, 0.2, 0), (0.3, 1.0, 0.7), name="atoms", mass=1.0)
    written = {
        "type": "formula",
        "potential": "4*e0*((s/r)**12 - (s/r)**6)",
        "constants": {"e0": 0.7, "s": 0.9},
    }
    plain = {"type": "lennard_jones", "epsilon": 0.7, "sigma": 0.9}
    found = []
    for law in (written, plain):
        simulation = simulation_of(1, 0.01, particles=[group], interactions=[law])
        found.append((simulation.islands[0].forces(0.0), simulation.ledger()[f"potential.{law['type']}"]))
        simulation.close()
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12, atol=1e-12)
    assert found[0][1] == pytest.approx(found[1][1], rel=1e-13)


def test_spline_softening_is_smooth_and_that_of_points_from_28_tenths_on() -> None:
    law = MutualGravity(constant=2.0, softening=0.5, softened="spline").record()
    h = 2.8 * 0.5

    def terms(r: float) -> np.ndarray:
        pair = Pair(r, 0, 0, 0, 0, 0, np.float64(3.0), np.float64(0.7))
        return np.array(central(law, pair, np.float64(r * r)), float)

    strength = 2.0 * 3.0 * 0.7
    assert terms(1e-9)[0] == pytest.approx(-strength / 0.5, rel=1e-14)  # as deep as Plummer's
    for joint in (h / 2, h):  # U, k and q are continuous where the pieces meet
        np.testing.assert_allclose(terms(joint * (1 - 1e-12)), terms(joint * (1 + 1e-12)), rtol=1e-10)
    np.testing.assert_allclose(
        terms(1.5), strength * np.array([-1 / 1.5, -1 / 1.5**3, 3 / 1.5**5]), rtol=1e-15
    )


def test_groups_mix_by_lorentz_and_berthelot() -> None:
    # an argon and a krypton atom at their mixed minimum, 2^(1/6) (σ₁ + σ₂)/2, have the energy −√(ε₁ ε₂) and feel no force
    epsilon, sigma = {"argon": 1.0, "krypton": 1.69}, {"argon": 0.8, "krypton": 1.2}
    r = 2 ** (1 / 6) * 1.0
    simulation = simulation_of(
        1,
        0.01,
        particles=[
            points((0, 0, 0), name="argon", mass=1.0),
            points((r, 0, 0), name="krypton", mass=2.0),
        ],
        interactions=[{"type": "lennard_jones", "epsilon": epsilon, "sigma": sigma}],
    )
    assert simulation.ledger()["potential.lennard_jones"] == pytest.approx(-1.3, rel=1e-14)
    assert np.abs(simulation.islands[0].forces(0.0)).max() < 1e-13 * 24 * 1.3
    simulation.close()


@pytest.mark.parametrize("method", ["direct", "tree"])
def test_a_softening_whose_powers_no_number_holds_softens_nothing(method: str) -> None:
    """A particle met itself in the sum: 0 times 1/ε³, which is infinite."""
    pull = {"type": "gravity", "constant": 1.0, "method": method}
    speeds = []
    for precision, softening in (("double", 0.0), ("double", 1e-150), ("single", 1e-13)):
        parts = table(
            0.01,
            1e-3,
            particles=[points((0, 0, 0), (1, 0, 0), mass=1.0)],
            interactions=[{**pull, "softening": softening}],
        )
        parts["simulation"]["precision"] = precision
        simulation = Simulation(ps.from_table(parts))
        simulation.advance_to(10)
        speeds.append(float(simulation.states[0].velocity[0, 0]))
        simulation.close()
    assert speeds[1] == pytest.approx(speeds[0], rel=1e-7)  # a tree's pairs are as exact as that
    assert speeds[2] == pytest.approx(speeds[0], rel=1e-5)


def test_masses_whose_products_single_precision_does_not_hold_are_refused() -> None:
    """Two grains of dust had stood still."""
    dust = [points((0, 0, 0), (1e-5, 0, 0), mass=1e-18)]
    for precision, method, goes in (
        ("single", "direct", False),
        ("double", "direct", True),
        ("single", "tree", True),
    ):
        told = table(10.0, 1.0, particles=dust, interactions=[{"type": "gravity", "method": method}])
        told["simulation"]["precision"] = precision
        if goes:
            simulation = Simulation(ps.from_table(told))
            simulation.advance_to(10)
            assert simulation.states[0].velocity[0, 0] == pytest.approx(
                6.674e-11 * 1e-18 / 1e-10 * 10, rel=1e-3
            )
            simulation.close()
        else:
            with pytest.raises(ps.UsageError, match="less than single precision holds"):
                Simulation(ps.from_table(told))


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("method", ["direct", "neighbours"])
@pytest.mark.parametrize("law", ["gravity", "coulomb", "power_law"])
def test_a_shift_of_the_force_has_no_direction_at_one_place(law: str, method: str, precision: str) -> None:
    """A softened law has a value there, and sums meet the particle itself; what the shift takes off has none."""
    given = {"type": law, "cutoff": 2.0, "softening": 0.1, "shift": "force", "method": method}
    given |= {"strength": 1.0, "exponent": 2.0} if law == "power_law" else {"constant": 1.0}
    groups = [points((0, 0, 0), (0.5, 0, 0), name="a", mass=1.0, charge=1.0)]
    told = table(0.01, 0.001, particles=groups, interactions=[given])
    told["simulation"]["precision"] = precision
    told["output"] = {"every": 1, "ledger": True}
    ended = ps.run(ps.from_table(told))
    assert np.isfinite(ended.final.position).all()
    assert np.isfinite(ended.energy).all()


@pytest.mark.parametrize(
    ("law", "energy"),
    [
        ({"type": "soft_sphere", "epsilon": 100.0, "sigma": 1.0}, 50.0),
        ({"type": "morse", "depth": 1.0, "width": 1.0, "distance": 1.0}, (1 - math.e) ** 2 - 1),
        ({"type": "formula", "potential": "exp(-r**2)", "cutoff": 3.0}, 1.0),
        ({"type": "gravity", "constant": 1.0, "softening": 0.5}, -2.0),
    ],
)
def test_the_energy_at_one_place_is_that_very_near(law: dict[str, Any], energy: float) -> None:
    """There is no force there, as it has no direction; energies that began at 0 were told to come from nothing."""
    groups = [points((0, 0, 0), (0, 0, 0), velocity=[[1, 0, 0], [-1, 0, 0]], name="a", mass=1.0)]
    output = {"every": 1, "ledger": True, "precision": "double"}
    ended = ps.run(ps.from_table(table(0.01, 0.001, particles=groups, interactions=[law], output=output)))
    assert ended.ledger[f"potential.{law['type']}"][0] == pytest.approx(energy, rel=1e-9)
    assert np.ptp(ended.energy) < 1e-2 * abs(energy)  # the first step has half of its force


def test_places_that_numbers_round_to_parts_of_a_law_are_told() -> None:
    law = {"type": "lennard_jones", "epsilon": 1.0, "sigma": 1.0, "cutoff": 3.0}

    def told(x: float, speed: float, precision: str) -> tuple[str, ...]:
        groups = [points((x, 0, 0), (x + 1.25, 0, 0), velocity=[[0, speed, 0]] * 2, name="a", mass=1.0)]
        made = table(0.02, 0.01, particles=groups, interactions=[law])
        made["simulation"]["precision"] = precision
        return tuple(each for each in ps.run(ps.from_table(made)).warnings if "rounded by" in each)

    assert told(1e3, 0.0, "single") == ()
    assert told(1e5, 0.0, "double") == ()
    assert "at the start" in told(1e5, 0.0, "single")[0]
    assert "from t = 0.02 s on" in told(0.0, 1e6, "single")[0]


@pytest.mark.parametrize("method", ["direct", "tree"])
def test_births_in_one_place_are_told(method: str) -> None:
    """The force between them is taken as 0 there, and a tree's energy was -1e27 J."""
    emitter = {"name": "source", "burst": {"count": 2, "at": 0.5}, "speed": 0.0, "lifetime": 5, "mass": 1.0}
    law = {"type": "gravity", "constant": 1e-3, "method": method}
    apart = {"type": "sphere", "center": [0, 0, 0], "radius": 1.0}
    for shape, softening in ((apart, 0.0), (POINT, 0.1), (POINT, 0.0)):
        simulation = simulation_of(
            100, 0.01, emitters=[{**emitter, "shape": shape}], interactions=[{**law, "softening": softening}]
        )
        simulation.advance_to(50)
        if shape is POINT and softening == 0:
            with pytest.raises(
                ps.DivergenceError, match="particles 0 and 1 of 'source' are at the same"
            ) as caught:
                simulation.advance_to(60)
            found = caught.value.post_mortem
            assert found is not None
            assert (found.cause, found.particle, found.group) == ("birth", 1, "source")
            assert found.position == (0, 0, 0)
        else:
            simulation.advance_to(60)
        simulation.close()


@pytest.mark.parametrize(
    ("law", "said"),
    [
        ({"type": "coulomb"}, "needs a charge, and the particles of 'b' have none"),
        ({"type": "gravity", "between": ["a", "c"]}, "unknown group 'c'"),
        ({"type": "gravity", "between": ["a", "a"]}, "names one group twice"),
        ({"type": "gravity", "on": ["a"], "between": ["a", "b"]}, "contradict each other"),
        ({"type": "gravity"}, "particle 1 of 'a' and particle 0 of 'b' are at the same place"),
        ({"type": "gravity", "shift": "force"}, "a shift needs a cutoff"),
        ({"type": "lennard_jones", "epsilon": 1, "sigma": 3e-10, "shift": "force"}, "cutoff = 7.5e-10 (m)"),
        ({"type": "lennard_jones", "epsilon": {"a": 1}, "sigma": 1}, "epsilon of 'b' is missing"),
        ({"type": "lennard_jones", "epsilon": {"a": 1, "b": 1, "c": 2}, "sigma": 1}, "'c' is not a group"),
        ({"type": "formula", "potential": "m1/r"}, "which of the two is the first"),
        ({"type": "formula", "potential": "x + r"}, "x"),
        ({"type": "flocking", "sight": 1, "distance": 2}, "beyond their sight"),
    ],
)
def test_what_cannot_be_is_told_before_the_run(law: dict[str, Any], said: str) -> None:
    groups = [
        points((0, 0, 0), (1, 0, 0), name="a", mass=1.0, charge=1.0),
        points((1, 0, 0), name="b", mass=1.0),
    ]
    with pytest.raises(ps.UsageError) as caught:
        simulation_of(1, 0.01, particles=groups, interactions=[law])
    assert said in str(caught.value)


def test_random_kicks_are_not_told_to_take_another_method() -> None:
    assert "first order" not in doubts(0.1, 0.01, **fluid(temperature=1.0))
    assert "first order" in doubts(0.1, 0.01, **fluid())


def test_random_kicks_need_a_method_that_takes_one_a_step() -> None:
    with pytest.raises(ps.ScenarioError, match="random kicks, one for each step, which rk4 cannot take"):
        ps.from_table(table(1, 0.01, "rk4", **fluid(temperature=1.0)))


def doubts(duration: float, dt: float, method: str = "velocity_verlet", **parts: Any) -> str:
    """What is said before and after a run."""
    return "\n".join(ps.run(ps.from_table(table(duration, dt, method, **parts))).warnings)


def binary(distance: float) -> dict[str, Any]:
    """Two bodies of 1 kg on a circle, with G = 1: ω² = 2/d³."""
    v = math.sqrt(0.5 / distance)
    return {
        "particles": [
            points(
                (distance / 2, 0, 0),
                (-distance / 2, 0, 0),
                velocity=[(0, v, 0), (0, -v, 0)],
                name="a",
                mass=1.0,
            )
        ],
        "interactions": [{"type": "gravity", "constant": 1.0}],
    }


def test_a_step_too_long_for_the_steepest_pair_is_told_before_the_run() -> None:
    # the limit of velocity Verlet is h ω = 2: h = √2 d^(3/2) = 0.0447 s for d = 0.1 m
    from particlesim.engine.stability.limits import suspects

    for dt, told in ((0.04, 0), (0.05, 1)):
        simulation = simulation_of(50, dt, **binary(0.1))
        warnings = suspects(simulation).warnings
        assert len(warnings) == told
        assert "the largest stable step of velocity_verlet for 'a', 0.0447 s" in "".join(warnings) or not told
        simulation.close()


def test_the_steepest_pair_counts_among_many() -> None:
    # beyond 447 particles bounds stand for modes: a pair d = 0.01 m apart in a wide cloud decides, ω² = 2 G m/d³
    cloud = {"type": "random", "count": 600, "shape": {"type": "ball", "radius": 100}}
    simulation = simulation_of(
        2,
        0.01,
        particles=[
            {"name": "cloud", "mass": 1e-3, "layout": cloud},
            points((500, 0, 0), (500.01, 0, 0), name="pair", mass=1.0),
        ],
        interactions=[{"type": "gravity", "constant": 1.0, "method": "direct"}],
    )
    from particlesim.engine.stability.limits import stability

    assert stability(simulation).step == pytest.approx(2 / math.sqrt(2 / 0.01**3), rel=1e-3)
    simulation.close()


def test_many_pairs_are_told_with_what_they_cost() -> None:
    from particlesim.preflight.advice import long_sums

    group = {
        "name": "stars",
        "mass": 1.0,
        "layout": {"type": "random", "count": 10**6, "shape": {"type": "ball", "radius": 1}},
    }
    law = {"type": "gravity", "softening": 0.01, "method": "direct"}
    (said,) = long_sums(ps.from_table(table(1.0, 0.01, particles=[group], interactions=[law])))
    # 10¹² pairs at 10⁹ a second, twice a step: 33 minutes, and 100 steps
    assert said == (
        "gravity sums 1e+12 pairs one by one in every sum of forces, about 33 minutes a step on one core and 2.3 days "
        'in all; method = "tree" sums far particles by multipoles'
    )
    law["method"] = "tree"
    assert long_sums(ps.from_table(table(1.0, 0.01, particles=[group], interactions=[law]))) == ()


@pytest.mark.parametrize("method", ["backward_euler", "implicit_midpoint", "rk45", "dop853"])
def test_implicit_and_adaptive_methods_take_pairs(method: str) -> None:
    # a circle of radius ½ at ω = √2; implicit_midpoint errs by h² ω³ t/24 · ½ of its angle, backward Euler by h ω² t/2
    simulation = simulation_of(100, 0.01, method=method, **binary(1.0))
    simulation.advance_to(100)
    angle = math.sqrt(2)
    error = np.abs(
        simulation.states[0].position[0] - 0.5 * np.array([math.cos(angle), math.sin(angle), 0])
    ).max()
    assert error < {"backward_euler": 0.02, "implicit_midpoint": 1e-4}.get(method, 1e-6)
    simulation.close()


def test_it_is_said_that_far_pairs_are_explicit_in_implicit_methods() -> None:
    parts = binary(1.0)
    assert "not in the matrix" not in doubts(0.02, 0.01, "backward_euler", **parts)
    parts["interactions"][0] |= {"method": "tree", "softening": 0.1}
    assert "gravity is not in the matrix of backward_euler" in doubts(0.02, 0.01, "backward_euler", **parts)


def test_impulses_are_no_forces_that_a_matrix_could_lack() -> None:
    grains = {"particles": [points((0, 0, 0), (0.1, 0, 0), radius=0.02)]}
    for model, says in (("impulse", False), ("linear", True)):
        law = {"type": "contact", "model": model} | ({"stiffness": 1e3} if says else {})
        told = doubts(0.02, 0.01, "backward_euler", interactions=[law], **grains)
        assert ("not in the matrix" in told) == says


def test_charges_of_zero_do_nothing() -> None:
    group = points((0, 0, 0), (1, 0, 0), name="a", mass=1.0, charge=0.0)
    simulation = simulation_of(3, 0.01, particles=[group], interactions=[{"type": "coulomb"}])
    simulation.advance_to(3)
    assert np.array_equal(simulation.states[0].position, [[0, 0, 0], [1, 0, 0]])
    assert simulation.ledger()["potential.coulomb"] == 0
    simulation.close()


@pytest.mark.parametrize(
    "law",
    [
        {"type": "gravity", "softening": 1e200},
        {"type": "coulomb", "softening": 1e200},
        {"type": "power_law", "strength": 1.0, "exponent": 2.0, "softening": 1e200},
    ],
    ids=lambda law: law["type"],
)
def test_a_softening_whose_square_no_number_holds_leaves_no_force(law: dict[str, Any]) -> None:
    group = points((0, 0, 0), (1, 0, 0), name="a", mass=1.0, charge=1e-6)
    simulation = simulation_of(3, 0.01, particles=[group], interactions=[law])
    simulation.advance_to(3)
    assert np.array_equal(simulation.states[0].position, [[0, 0, 0], [1, 0, 0]])
    simulation.close()


@pytest.mark.parametrize("method", ["direct", "neighbours"])
def test_a_cutoff_whose_square_no_number_holds_cuts_nothing(method: str) -> None:
    places = []
    for cut in ({}, {"cutoff": 1e200, "method": method}):
        parts = binary(1.0)
        parts["interactions"][0] |= cut
        simulation = simulation_of(50, 0.01, **parts)
        simulation.advance_to(50)
        places.append(simulation.states[0].position)
        simulation.close()
    assert places[0] == pytest.approx(places[1], rel=1e-12)


def test_a_length_beyond_all_numbers_is_told() -> None:
    group = points((0, 0, 0), (1, 0, 0), name="a")
    for sigma, told in (
        (1e300, "holds no squares of lengths above 1.3e[+]154 m"),
        (1e100, "no finite number"),
    ):
        law = {"type": "lennard_jones", "epsilon": 1.0, "sigma": sigma}
        with pytest.raises(ps.UsageError, match=told):
            ps.run(ps.from_table(table(0.1, 0.01, particles=[group], interactions=[law])))


def test_a_tree_takes_bodies_in_one_place() -> None:
    # softened, so they feel nothing of each other; no error can be measured there, and the first tolerance stays
    group = points(*[(0, 0, 0)] * 100, name="a", mass=1.0)
    law = {"type": "gravity", "constant": 1.0, "softening": 0.1, "method": "tree"}
    simulation = simulation_of(3, 0.01, particles=[group], interactions=[law])
    simulation.advance_to(3)
    assert not simulation.states[0].position.any()
    simulation.close()


@pytest.mark.parametrize(("far", "softening"), [(1e160, 0.0), (1.0, 1e200)])
def test_a_tree_tells_that_forces_are_beyond_numbers(far: float, softening: float) -> None:
    group = points((far, 0, 0), (0, 0, 0), name="a", mass=1.0)
    law = {"type": "gravity", "method": "tree", "softening": softening}
    with pytest.raises(ps.UsageError, match="by a tree are not finite"):
        ps.run(ps.from_table(table(0.03, 0.01, particles=[group], interactions=[law])))


@pytest.mark.parametrize(
    ("law", "proposed"),
    [
        ({"type": "lennard_jones", "epsilon": 1.0, "sigma": 1.0}, True),
        ({"type": "contact", "model": "linear", "stiffness": 400.0}, False),
    ],
)
def test_an_implicit_method_is_proposed_where_pairs_are_in_its_matrix(law: Table, proposed: bool) -> None:
    # ω² = 2 · 72 ε/(2^(1/3) σ² m): steps of 0.5 s are six times too long; contacts limit implicit methods as well
    group = points((0, 0, 0), (2 ** (1 / 6) + 1e-9, 0, 0), name="a", mass=1.0, radius=0.6)
    scenario = ps.from_table(table(5.0, 0.5, "velocity_verlet", particles=[group], interactions=[law]))
    said: list[str] = []
    with contextlib.suppress(ps.DivergenceError):
        ps.run(scenario, warn=said.append)
    assert "beyond the largest stable step" in said[0]
    assert "try simulation.dt = " in said[0]
    assert ("backward_euler" in said[0]) == proposed


@pytest.mark.parametrize(
    ("law", "apart"),
    [
        ({"type": "lennard_jones", "epsilon": 1.0, "sigma": 1.0, "cutoff": 2.5}, 1e-60),
        ({"type": "morse", "depth": 1.0, "width": 1e3, "distance": 1.0}, 0.1),
        ({"type": "formula", "potential": "log(r - 1)"}, 0.5),
    ],
)
@pytest.mark.parametrize("method", ["direct", "neighbours"])
def test_pairs_without_a_number_at_the_start_are_named(law: Table, apart: float, method: str) -> None:
    groups = [points((5, 0, 0), (0, 0, 0), name="a"), points((0, apart, 0), name="b")]
    laws = [{"cutoff": 3.0} | law | {"method": method}]
    scenario = table(0.02, 0.01, particles=groups, interactions=laws, output={"ledger": True})
    with pytest.raises(
        ps.UsageError, match=f"particle 1 of 'a' and particle 0 of 'b' are {apart:.4g} m apart"
    ):
        ps.run(ps.from_table(scenario))


def test_formulas_that_jump_are_told() -> None:
    def law(text: str) -> Table:
        return {"type": "formula", "potential": text, "cutoff": 5.0}

    parts: dict[str, Any] = {"particles": [points((0, 0, 0), (1, 0, 0), name="a")]}
    for text, words in (
        ("1.0 if r < 1.5 else 2.0", "energy of formula jumps at r = 1.5 m, by 1 J"),
        ("abs(r - 2)", "force of formula jumps at r = 2 m, by 2 N"),
        ("max(1 - r, 0)**2 + sin(r)", None),
    ):
        said = doubts(0.02, 0.01, "rk4", **parts, interactions=[law(text)])
        assert (words in said) if words else ("jumps" not in said)
        if words:
            with pytest.raises(ps.ScenarioError, match=r"needs the derivatives .* has none at r ="):
                ps.from_table(table(0.02, 0.01, "bdf2", **parts, interactions=[law(text)]))


def test_a_law_that_changes_with_time_is_summed_anew() -> None:
    # At rest and without a force at the start: only the time makes one, U = t r, a = t/m on each.
    for method in ("direct", "neighbours"):
        law = {"type": "formula", "potential": "t*r", "cutoff": 5.0, "method": method}
        end = simulation_of(
            100, 0.01, particles=[points((0, 0, 0), (1, 0, 0), name="a", mass=1.0)], interactions=[law]
        )
        end.advance_to(100)
        assert end.states[0].velocity[0, 0] == pytest.approx(0.5, rel=0.02)
        end.close()
