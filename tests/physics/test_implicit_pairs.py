"""Interactions of pairs in the matrix of implicit methods: steps far beyond the explicit limit, orders, same bits."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import Table, table

import particlesim as ps

METHODS = ("direct", "neighbours")
CONVERGED = {"method": "backward_euler", "converged": True}


def cluster(side: int, spacing: float, speed: float = 0.05, noise: float = 0.01) -> Table:
    """A cube of particles, off their places and moving."""
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3), -1).reshape(-1, 3) * spacing
    x = grid + rng.normal(0, noise, grid.shape)
    v = rng.normal(0, speed, grid.shape)
    layout = {"type": "points", "position": x.tolist(), "velocity": (v - v.mean(axis=0)).tolist()}
    return {"name": "p", "mass": 1.0, "layout": layout}


def ran(method: Any, dt: float, duration: float, law: Table, group: Table, **parts: Any) -> ps.Result:
    threads = parts.pop("threads", 1)
    simulation = parts.pop("simulation", {})
    output = {"every": max(round(duration / dt), 1), "ledger": True}
    scenario = table(duration, dt, method, particles=[group], interactions=[law], output=output, **parts)
    scenario["simulation"] |= simulation
    return ps.run(ps.from_table(scenario), threads=threads)


def lennard_jones(method: str) -> Table:
    return {
        "type": "lennard_jones",
        "epsilon": 1.0,
        "sigma": 1.0,
        "cutoff": 2.5,
        "shift": "force",
        "method": method,
    }


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("integrator", "order"), [("implicit_midpoint", 2), ("trapezoidal", 2), (CONVERGED, 1)]
)
def test_the_solution_is_that_of_explicit_methods(method: str, integrator: Any, order: int) -> None:
    group = cluster(3, 1.12)
    exact = ran("yoshida4", 0.0005, 0.2, lennard_jones(method), group).final.position
    misses = [
        np.abs(ran(integrator, dt, 0.2, lennard_jones(method), group).final.position - exact).max()
        for dt in (0.01, 0.005)
    ]
    assert misses[1] < (1e-4 if order == 2 else 5e-3)
    assert math.log2(misses[0] / misses[1]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("method", METHODS)
def test_a_harmonic_crystal_keeps_its_energy_at_any_step(method: str) -> None:
    # Every pair a spring of no length, ω² = n k/m: implicit midpoint keeps a quadratic energy whatever h ω, here 51.
    law = {
        "type": "formula",
        "potential": "k*r**2/2",
        "constants": {"k": 1e4},
        "cutoff": 40.0,
        "method": method,
    }
    group = cluster(2, 1.0, speed=1.0)
    energies = ran({"method": "implicit_midpoint", "tolerance": 1e-12}, 2.0 / 11, 2.0, law, group).ledger
    total = energies["kinetic"] + energies["potential.formula"]
    assert total[-1] == pytest.approx(total[0], rel=1e-9)


@pytest.mark.slow
@pytest.mark.optimised
@pytest.mark.parametrize("method", METHODS)
def test_a_stiff_cluster_comes_to_rest_where_small_steps_take_it(method: str) -> None:
    # Drag takes the motion; the place of rest does not depend on the step. ω² of eight atoms is some 57 · 10⁴ · 4, the
    # explicit limit 1.3 ms.
    law = lennard_jones(method) | {"epsilon": 1e4, "cutoff": 1.7}
    group = cluster(2, 1.12, speed=0.0, noise=0.002)
    drag = [{"type": "linear_drag", "coefficient": 50.0}]
    slow = ran(CONVERGED, 0.02, 4.0, law, group, forces=drag).final.position
    exact = ran("velocity_verlet", 0.0005, 1.0, law, group, forces=drag).final.position
    assert np.abs(apart(slow) - apart(exact)).max() < 1e-4


def test_images_are_in_the_matrix() -> None:
    # A crystal that fills a periodic box: without what its images do it would not come to rest in such steps.
    law = lennard_jones("neighbours") | {"epsilon": 1e4, "cutoff": 1.6}
    group, box = cluster(3, 1.15, speed=0.0, noise=0.005), {"box": {"size": [3.45, 3.45, 3.45]}}
    drag = [{"type": "linear_drag", "coefficient": 50.0}]
    found = ran(CONVERGED, 0.02, 1.0, law, group, forces=drag, simulation=box)
    assert found.ledger["kinetic"].max() < 1e-6 * abs(found.ledger["potential.lennard_jones"][0])


def apart(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """All distances, which know no turns."""
    return np.linalg.norm(x[:, None] - x[None], axis=2)


def test_same_bits_for_any_number_of_threads() -> None:
    group, law = cluster(8, 1.12), lennard_jones("neighbours")
    one, three = (ran("implicit_midpoint", 0.02, 0.1, law, group, threads=k).final for k in (1, 3))
    assert np.array_equal(one.position, three.position)
    assert np.array_equal(one.velocity, three.velocity)


def test_friction_is_damped_at_any_step() -> None:
    # Two particles that rub with c = 10⁶ kg/s, h c/m = 2·10⁵: with (1 − r/R)² = ¼ a step leaves
    # 1/(1 + 2 h c/4 m) of their speed.
    law = {"type": "friction", "coefficient": 1e6, "range": 2.0}
    layout = {"type": "points", "position": [[0, 0, 0], [1, 0, 0]], "velocity": [[1, 0, 0], [-1, 0, 0]]}
    v = ran(CONVERGED, 0.1, 0.1, law, {"name": "p", "mass": 1.0, "layout": layout}).final.velocity
    assert v[:, 0] == pytest.approx([1 / 50001, -1 / 50001], rel=1e-3)


def test_momentum_is_kept_to_rounding() -> None:
    found = ran("implicit_midpoint", 0.02, 0.4, lennard_jones("neighbours"), cluster(3, 1.12)).ledger
    for axis in "xyz":
        assert np.abs(found[f"momentum.{axis}"]).max() < 1e-14


def test_what_is_explicit_has_a_limit_and_says_so() -> None:
    # A tree is not in the matrix. Of two bodies of 1 kg a metre apart the bound takes the steepest tensor, 2 G (m₁ + m₂)/d³
    # = 4/s². Iterations of the middle converge up to h ω/2 = 1; a single solve is stable up to h ω = 2.
    layout = {"type": "points", "position": [[0, 0, 0], [1, 0, 0]]}
    group = {"name": "p", "mass": 1.0, "layout": layout}
    for method, integrator, limited in (
        ("tree", "implicit_midpoint", True),
        ("tree", "backward_euler", True),
        ("direct", "implicit_midpoint", False),
    ):
        law = {"type": "gravity", "constant": 1.0, "softening": 0.01, "method": method}
        scenario = ps.from_table(table(1.0, 0.1, integrator, particles=[group], interactions=[law]))
        step = ps.stability(scenario).step
        assert step == (pytest.approx(1, rel=1e-2) if limited else math.inf)


def sphere(count: int) -> Table:
    """Bodies of a sphere of mass 1 about whose middle they orbit in some seconds."""
    rng = np.random.default_rng(2)
    way = rng.normal(size=(count, 3))
    x = way / np.linalg.norm(way, axis=1)[:, None] * rng.random(count)[:, None] ** (2 / 3)
    v = 0.5 * np.cross([0, 0, 1], x)
    layout = {"type": "points", "position": x.tolist(), "velocity": v.tolist()}
    return {"name": "p", "mass": 1 / count, "layout": layout}


def pull(method: str) -> Table:
    law = {"name": "pull", "type": "gravity", "constant": 1.0, "softening": 0.2, "method": method}
    return law | ({"accuracy": 1e-2} if method == "tree" else {})


@cache
def in_small_steps(method: str) -> NDArray[np.float64]:
    """Where 1500 particles are after 0.8 s."""
    return np.asarray(ran("yoshida4", 0.025, 0.8, pull(method), sphere(1500)).final.position)


@pytest.mark.slow
@pytest.mark.optimised
@pytest.mark.parametrize(
    ("integrator", "order"),
    [
        pytest.param("implicit_midpoint", 2, marks=pytest.mark.slow),
        pytest.param("trapezoidal", 2, marks=pytest.mark.slow),
        pytest.param("bdf2", 2, marks=pytest.mark.slow),
        (CONVERGED, 1),
    ],
)
def test_a_tree_whose_forces_jump_is_solved_to_its_accuracy(integrator: Any, order: int) -> None:
    # Forces are off by δ = 1e-2 of g ≈ 1 in no particular direction: after T = 0.8 s places are by less than δ g T²/2 = 3e-3
    # in the mean square. Beside the tree's own solution in small steps the error of the method keeps its order.
    group, steps = sphere(1500), (0.1, 0.05)
    exact, own = (in_small_steps(method) for method in ("direct", "tree"))
    found = [ran(integrator, dt, 0.8, pull("tree"), group).final.position for dt in (*steps, 0.025)]
    assert rms(own - exact) < 3e-3
    assert rms(found[2] - exact) < 3e-3 + (0 if order == 2 else 0.05)
    misses = [rms(each - own) for each in found[:2]]
    assert math.log2(misses[0] / misses[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.slow
@pytest.mark.optimised
def test_what_a_tree_leaves_of_equations_costs_no_energy() -> None:
    # As by direct sums, but for what forces of an accuracy of 1e-2 do themselves, which a leapfrog shows, too.
    drifts = []
    for integrator in ("velocity_verlet", "implicit_midpoint"):
        energies = ran(integrator, 0.02, 2.0, pull("tree"), sphere(1500)).ledger
        total = energies["kinetic"] + energies["potential.pull"]
        drifts.append(abs(total[-1] / total[0] - 1))
    assert drifts[1] < 2 * drifts[0] + 1e-4


@pytest.mark.slow
@pytest.mark.optimised
def test_same_bits_for_any_number_of_threads_with_a_tree() -> None:
    one, three = (
        ran("implicit_midpoint", 0.05, 0.2, pull("tree"), sphere(1500), threads=k).final for k in (1, 3)
    )
    assert np.array_equal(one.position, three.position)
    assert np.array_equal(one.velocity, three.velocity)


def rms(x: NDArray[np.float64]) -> float:
    """Root of the mean square distance."""
    return float(np.sqrt((x * x).sum(axis=1).mean()))
