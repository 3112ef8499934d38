"""The largest stable step of a scenario: closed forms, dense eigenvalues, and runs on both sides of it."""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from simulate import points, table

import particlesim as ps
from particlesim.bonds.hinge import Harmonic, angle_forms, angle_gradient, dihedral_gradient, wrapped
from particlesim.engine.interactions.bond_tensors import network
from particlesim.engine.interactions.hinges import Angles, Dihedrals
from particlesim.engine.simulation import Simulation
from particlesim.engine.stability import linearised as linear
from particlesim.engine.stability.extreme_modes import bound
from particlesim.engine.stability.limits import rounded, stability, suspects
from particlesim.integrators import METHODS
from particlesim.laws.registry import hinge_moment

M1, M2, K = 0.5, 1.5, 30.0
OMEGA = math.sqrt(K * (1 / M1 + 1 / M2))


def dumbbell(dt: float, method: str, steps: int = 100, damping: float = 0.0, **more: Any) -> dict[str, Any]:
    return table(
        steps * dt,
        dt,
        method,
        particles=[points((0, 0, 0), mass=M1, name="a"), points((1.001, 0, 0), mass=M2, name="b")],
        springs=[
            {"between": ["a", "b"], "pairs": [[0, 0]], "stiffness": K, "damping": damping, "rest_length": 1.0}
        ],
        **more,
    )


def cloth(
    dt: float, resolution: tuple[int, int] = (5, 4), damping: float = 0.0, **more: Any
) -> dict[str, Any]:
    size = [0.1 * (n - 1) for n in resolution]
    layout = {
        "type": "cloth",
        "origin": [0, 2, 0],
        "size": size,
        "resolution": list(resolution),
        "pinned": "left",
    }
    springs = {"structural": 800.0, "shear": 200.0, "bend": 20.0, "damping": damping}
    group = {"name": "flag", "layout": layout, "mass": 0.2, "springs": springs}
    return table(100 * dt, dt, "symplectic_euler", particles=[group], **more)


def judged(scenario: dict[str, Any]) -> Any:
    return ps.stability(ps.from_table(scenario))


LIMITS = {
    "symplectic_euler": 2.0,
    "velocity_verlet": 2.0,
    "stormer_verlet": 2.0,
    "rk3": math.sqrt(3),
    "rk4": math.sqrt(8),
}


@pytest.mark.parametrize("method", [name for name in METHODS if name != "whfast"])
def test_two_masses_and_a_spring(method: str) -> None:
    # The only mode that moves along the spring has ω² = k (1/m₁ + 1/m₂). Pulled to 1.001 of its length, the spring holds
    # back across, too, with ω⊥² = ω² · 0.001/1.001, which limits nothing.
    found = judged(dumbbell(1e-3, method))
    (island,) = found.islands
    assert island.groups == ("a", "b")
    assert island.forces == {"springs": pytest.approx(island.step)}
    assert found.step == island.step
    if method in LIMITS:
        assert found.step == pytest.approx(LIMITS[method] / OMEGA, rel=1e-6)
    if METHODS[method].order < 3 and method in ("explicit_euler", "midpoint", "heun"):
        assert found.step == 0.0


def test_a_damped_spring() -> None:
    # Symplectic Euler: h² ω² + 2 h d = 4 with d = c (1/m₁ + 1/m₂).
    d = 0.8 * (1 / M1 + 1 / M2)
    h = judged(dumbbell(1e-3, "symplectic_euler", damping=0.8)).step
    assert h * h * OMEGA**2 + 2 * h * d == pytest.approx(4, rel=1e-5)


@pytest.mark.parametrize("method", ["symplectic_euler", "rk4"])
def test_runs_are_bounded_below_the_limit_and_grow_beyond(method: str) -> None:
    # Beyond by 1 %, the factor per step is 1.2 or more for symplectic Euler (μ = −1 ∓ 2√(0.01)) and 1.05 for RK4 (|R|² = 1 −
    # y⁶/72 + y⁸/576); the stretch of 1 mm grows until springs are no longer linear. Below, symplectic Euler at hω = 2 · 0.98
    # swings with at most 1/√(1 − 0.98²) = 5 times the amplitude, and RK4 is damped.
    limit = LIMITS[method] / OMEGA
    stretch = []
    for part, steps in ((0.98, 200), (1.01, 60 if method == "symplectic_euler" else 200)):
        told: list[str] = []
        scenario = ps.from_table(dumbbell(part * limit, method, steps))
        with suppress(ps.DivergenceError):  # of what ends with more energy than it began with
            ps.run(scenario, warn=told.append)
        assert bool(told) == (part > 1)
        simulation = Simulation(scenario)
        simulation.advance_to(steps)
        a, b = (state.x[:, 0] for state in simulation.states)
        stretch.append(abs(np.linalg.norm(a - b) - 1.0))
        simulation.close()
    assert stretch[0] < 0.0051
    assert stretch[1] > 0.1


def test_a_warning_names_the_number_to_change() -> None:
    told: list[str] = []
    scenario = ps.from_table(dumbbell(2.5 / OMEGA, "symplectic_euler", 3))
    with pytest.raises(ps.DivergenceError):
        ps.run(scenario, warn=told.append)
    assert len(told) == 1
    assert f"simulation.dt = {rounded(0.9 * 2 / OMEGA):g}" in told[0]
    assert "'a' and 'b'" in told[0]


def test_a_method_that_lets_everything_grow_is_told_of_when_it_matters() -> None:
    # Explicit Euler multiplies by √(1 + (hω)²) in a step: 1.000005 for hω = 0.00316, e^(0.5) in 10⁵ steps, e^(50) in 10⁷.
    short, long = (judged(dumbbell(0.00316 / OMEGA, "explicit_euler", n)) for n in (100_000, 10_000_000))
    assert short.step == long.step == 0.0
    assert not short.warnings
    assert "symplectic_euler" in long.warnings[0]
    for found, steps in ((short, 1e5), (long, 1e7)):  # log10 of the growth over the run
        assert found.islands[0].growth == pytest.approx(steps / 2 * math.log10(1 + 0.00316**2), rel=1e-4)


def test_growth_beyond_the_limit_is_that_of_the_run() -> None:
    # Symplectic Euler at hω = 2.1: μ + 1/μ = 2 − (hω)², so that |μ| = 1.205 + √(1.205² − 1) = 1.877 in each of 40 steps.
    half = 2.1**2 / 2 - 1
    factor = half + math.sqrt(half**2 - 1)
    found = judged(dumbbell(2.1 / OMEGA, "symplectic_euler", 40))
    assert found.islands[0].growth == pytest.approx(40 * math.log10(factor), rel=1e-5)


@pytest.mark.sampled(2)
@pytest.mark.optimised
@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_a_cloth_by_bound_and_by_extreme_modes_is_that_of_dense_matrices(
    damping: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = Simulation(ps.from_table(cloth(1e-4, (8, 5), damping)), threads=1)
    dense = stability(simulation).islands[0]
    assert dense.how == "all particles"
    monkeypatch.setattr(linear, "DENSE", 0)
    extreme = stability(simulation).islands[0]
    assert extreme.how == "extreme modes"
    assert extreme.step == pytest.approx(dense.step, rel=2e-3)
    for name, step in dense.forces.items():
        assert extreme.forces[name] == pytest.approx(step, rel=0.02), name
    monkeypatch.setattr(linear, "MOST_SPRINGS", 0)
    monkeypatch.setattr(linear, "FEW_SPRINGS", 0)
    bounded = stability(simulation).islands[0]
    assert bounded.how == "bounds"
    assert 0.6 * dense.step < bounded.step <= dense.step
    simulation.close()


def test_the_bound_is_above_the_largest_eigenvalue_and_near_it() -> None:
    rng = np.random.default_rng(1)
    pairs = np.array([[i, j] for i in range(20) for j in range(i) if rng.random() < 0.2])
    scenario = table(
        1.0,
        1e-3,
        particles=[
            points(
                *rng.random((20, 3)).tolist(), name="net", mass={"type": "uniform", "low": 0.1, "high": 2.0}
            )
        ],
        springs=[{"on": "net", "pairs": pairs.tolist(), "stiffness": 7.0, "rest_length": 0.1}],
    )
    simulation = Simulation(ps.from_table(scenario), threads=1)
    model = linear.IslandModel(simulation.scenario, simulation.graph.islands[0], simulation.islands[0], 0.0)
    w = model._mobility()
    springs = dict(model._couplings(simulation.islands[0]))["springs"]
    blocks = springs.along[:, None, None] * np.einsum("an,bn->nab", springs.e, springs.e)
    blocks = blocks + springs.across[:, None, None] * (
        np.eye(3) - np.einsum("an,bn->nab", springs.e, springs.e)
    )
    root = np.sqrt(np.repeat(w, 3))
    largest = np.linalg.eigvalsh(root[:, None] * network(springs, blocks, 20).toarray() * root).max()
    assert largest <= bound([springs], w, damping=False) < 2.5 * largest
    simulation.close()


@pytest.mark.parametrize("direction", list(itertools.permutations((0.0, 0.5, math.sqrt(0.75)))))
def test_the_bound_of_one_spring_is_its_own_whichever_way_it_points(direction: tuple[float, ...]) -> None:
    # Row sums alone are above it, or, with a part of the tensor left out, below.
    simulation = Simulation(
        ps.from_table(
            table(
                1.0,
                1e-3,
                particles=[points((0, 0, 0), direction, name="two", mass=M1)],  # type: ignore[arg-type]
                springs=[{"on": "two", "pairs": [[0, 1]], "stiffness": K, "rest_length": 1.0}],
            )
        )
    )
    model = linear.IslandModel(simulation.scenario, simulation.graph.islands[0], simulation.islands[0], 0.0)
    springs = dict(model._couplings(simulation.islands[0]))["springs"]
    assert bound([springs], model._mobility(), damping=False) == pytest.approx(2 * K / M1, rel=1e-9)
    simulation.close()


def test_quick_looks_have_no_doubts_where_there_are_none() -> None:
    stable = Simulation(ps.from_table(cloth(1e-4, (30, 20))), threads=1)
    assert suspects(stable).islands == ()
    stable.close()
    wild = Simulation(ps.from_table(cloth(1e-2, (30, 20))), threads=1)
    assert len(suspects(wild).warnings) == 1
    wild.close()


def test_single_particles() -> None:
    # A point spring and drag: ω² = k/m, d = c/m; alone, RK4 allows 2√2/ω and 2.785/d.
    scenario = table(
        1.0,
        1e-3,
        "rk4",
        particles=[points((0.1, 0, 0), mass=0.5)],
        forces=[
            {"type": "point_spring", "stiffness": 8.0, "anchor": [0, 0, 0]},
            {"type": "linear_drag", "coefficient": 0.5},
            {"type": "gravity"},
        ],
    )
    (island,) = judged(scenario).islands
    assert island.forces == {
        "point_spring": pytest.approx(math.sqrt(8) / 4, rel=1e-6),
        "linear_drag": pytest.approx(2.7852935634 / 1.0, rel=1e-6),
    }


def test_emitted_particles_are_judged_as_they_are_born() -> None:
    # Quadratic drag f = −½ρc_dA|v|v: along the motion ∂f/∂v = −2 f/v, here −ρ c_d π r² v = −0.0148 kg/s at 50 m/s.
    emitter = {
        "rate": 10.0,
        "shape": {"type": "point", "position": [0, 0, 0]},
        "speed": 50.0,
        "mass": 0.002,
        "radius": 0.02,
    }
    drag = {"type": "drag", "density": 1.2, "coefficient": 0.2}
    (island,) = judged(table(1.0, 1e-3, "rk4", emitters=[emitter], forces=[drag])).islands
    rate = 1.2 * 0.2 * math.pi * 0.02**2 * 50 / 0.002
    assert island.step == pytest.approx(2.7852935634 / rate, rel=1e-6)


def test_steps_are_cut_never_rounded_up() -> None:
    assert rounded(0.0123456) == 0.012
    assert rounded(0.999) == 0.99
    assert rounded(2.0) == 2.0
    assert rounded(math.inf) == math.inf


def test_without_inertia_a_spring_relaxes() -> None:
    # x' = −(k/γ) (l − L₀) on both ends: l relaxes with 2k/γ; the method is explicit Euler, whose limit is 2.
    scenario = table(
        1.0,
        1e-3,
        "explicit_euler",
        particles=[
            points((0, 0, 0), (1, 0, 0), name="grains", dynamics={"type": "first_order", "drag": 3.0})
        ],
        springs=[{"on": "grains", "pairs": [[0, 1]], "stiffness": 6.0}],
    )
    assert judged(scenario).step == pytest.approx(2 / (2 * 6 / 3), rel=1e-6)


def test_a_pinned_end_is_heavy() -> None:
    scenario = table(
        1.0,
        1e-3,
        "symplectic_euler",
        particles=[points((0, 0, 0), (1, 0, 0), name="bob", mass=0.5, pinned=[0])],
        springs=[{"on": "bob", "pairs": [[0, 1]], "stiffness": 8.0}],
    )
    assert judged(scenario).step == pytest.approx(2 / 4, rel=1e-6)


def arm(dt: float, method: str) -> dict[str, Any]:
    """An arm of 0.5 m that an angle of 3 J holds straight, bent by 10⁻⁵ rad."""
    end = (0.5 * math.cos(1e-5), 0.5 * math.sin(1e-5), 0.0)
    return table(
        25 * dt,
        dt,
        method,
        particles=[points((-1, 0, 0), (0, 0, 0), end, mass=0.4, pinned=[0, 1], name="arm")],
        angles=[{"on": "arm", "triples": [[0, 1, 2]], "stiffness": 3.0, "rest_angle": 180}],
        output={"ledger": True},
    )


def test_an_angle_limits_the_step_as_runs_show() -> None:
    # ω = √(k/m)/L, and velocity Verlet allows 2/ω. 1 % beyond, the swing grows 1.33-fold in a step, 10³-fold in 25, which
    # nothing feeds; below it is at most 1/√(1 − 0.98²) = 5 times the first.
    limit = 2 * 0.5 / math.sqrt(3.0 / 0.4)
    found = judged(arm(1e-3, "velocity_verlet"))
    assert found.islands[0].forces == {"angles": pytest.approx(limit, rel=1e-6)}
    bounded = ps.run(ps.from_table(arm(0.98 * limit, "velocity_verlet")))
    assert not bounded.warnings
    assert math.hypot(*bounded.final.position[2, 1:]) < 5.1 * 0.5e-5
    told: list[str] = []
    with pytest.raises(ps.DivergenceError, match="particle 2 of 'arm'"):
        ps.run(ps.from_table(arm(1.01 * limit, "velocity_verlet")), warn=told.append)
    assert len(told) == 1
    assert "beyond the largest stable step" in told[0]


def test_wind_on_a_sail_limits_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    # A sail that moves as a whole: M dv/dt = −½ ρ A c |u| u, whose derivative is ρ A c |u|/M across it. Of uneven motions
    # none is damped more than twice as much.
    size, mass, speed = 0.8, 0.3, 6.0
    cloth = {"type": "cloth", "origin": [0, 0, 0], "size": [size, size], "resolution": [5, 5]}
    scenario = table(
        1.0,
        1e-3,
        "rk4",
        particles=[
            {"name": "sail", "layout": cloth, "mass": mass, "springs": {"structural": 1.0, "dihedral": 1e-3}}
        ],
        forces=[
            {
                "type": "sheet_drag",
                "density": 1.3,
                "normal_coefficient": 1.1,
                "flow": [{"type": "uniform", "velocity": [0, 0, speed]}],
            }
        ],
    )
    whole = 2.7852935634 / (1.3 * size**2 * 1.1 * speed / mass)
    (island,) = judged(scenario).islands
    assert set(island.forces) == {"sail.structural", "sail.dihedral", "sheet_drag"}
    assert whole / 2 < island.forces["sheet_drag"] <= whole
    exact = dict(island.forces)
    monkeypatch.setattr(linear, "DENSE", 0)
    (extreme,) = judged(scenario).islands
    assert extreme.forces == pytest.approx(exact, rel=0.02)
    monkeypatch.setattr(linear, "MOST_SPRINGS", 0)
    monkeypatch.setattr(linear, "FEW_SPRINGS", 0)
    (bounded,) = judged(scenario).islands
    for name, step in exact.items():
        assert 0.4 * step < bounded.forces[name] <= step * (1 + 1e-9), name


def test_hinges_all_at_once_are_those_one_by_one() -> None:
    rng = np.random.default_rng(3)
    x = rng.normal(size=(3, 24))
    x[:, 12:18] = np.outer([0.6, -0.64, 0.48], rng.normal(size=6)) + 1e-12 * rng.normal(
        size=(3, 6)
    )  # nearly on a line
    columns = SimpleNamespace(
        **dict(zip("xyz", x, strict=True)), **dict.fromkeys(("vx", "vy", "vz"), 0 * x[0])
    )
    law, rest = Harmonic(2.0), rng.uniform(0, 3, 6)
    angles, folds = (rng.permutation(24)[: 6 * k].reshape(k, 6) for k in (3, 4))
    angles[:, 3:] = [[12, 13, 14], [15, 16, 17], [16, 14, 15]]
    for each in (Angles(law, angles, rest), Dihedrals(law, folds, rest)):
        forms = []
        for q, rows in enumerate(each.rows.T):
            p = x[:, rows].T
            if len(rows) == 3:
                a, b = p[0] - p[1], p[2] - p[1]
                moment = hinge_moment(law, wrapped(angle_gradient(*a, *b)[0] - rest[q]))
                found = np.reshape(angle_forms(2.0, moment, *a, *b), (2, 2, 3))
                forms.append([[u, -u - v, v] for u, v in found])
            else:
                g = np.reshape(dihedral_gradient(*(p[0] - p[1]), *(p[1] - p[2]), *(p[3] - p[2]))[1:], (3, 3))
                forms.append([math.sqrt(2.0) * np.stack([g[0], g[1], -g.sum(axis=0), g[2]])])
        expected = np.array(forms).transpose(1, 0, 2, 3)
        made = each.linearise(columns, 0.0).forms
        np.testing.assert_allclose(made, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("stiffness", "mass"), [(1e308, 1.0), (100.0, 1e-300)])
def test_rates_beyond_numbers_are_refused(stiffness: float, mass: float) -> None:
    cloth = {"layout": {"type": "cloth", "size": [1, 1], "resolution": [3, 3]}, "name": "flag", "mass": mass}
    scenario = ps.from_table(table(1.0, 0.1, particles=[{**cloth, "springs": {"structural": stiffness}}]))
    for act in (ps.stability, ps.run):
        with pytest.raises(
            ps.UsageError, match=r"the rates at which forces move 'flag'.* beyond what numbers"
        ):
            act(scenario)
