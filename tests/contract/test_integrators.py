"""What the methods promise: tableaus, stability, order, reversibility, symplecticity, through the compiled block kernel.

All runs here share one list of force records, whose parameters switch parts off, so that each method is compiled once.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support import columns, position, program, run, state, velocity

from particlesim.forces import Attractor, Field, Gravity
from particlesim.integrators import (
    METHODS,
    Composition,
    EmbeddedRungeKutta,
    ImplicitMethod,
    Method,
    RungeKutta,
    Verlet,
)
from particlesim.integrators.heun import HEUN
from particlesim.integrators.rk3 import RK3
from particlesim.integrators.rk4 import RK4
from particlesim.integrators.stormer_verlet import STORMER_VERLET
from particlesim.integrators.symplectic_euler import SYMPLECTIC_EULER
from particlesim.integrators.trees import rooted_trees
from particlesim.integrators.velocity_verlet import VELOCITY_VERLET
from particlesim.integrators.yoshida4 import YOSHIDA4

FIXED_STEP = {name: method for name, method in METHODS.items() if method.by_modes}
methods = pytest.mark.parametrize("name", FIXED_STEP)
EPS = np.finfo(float).eps


def forces(
    *,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    pull: float = 0.0,
    pendulum: float = 0.0,
    spring: float = 0.0,
    drag: float = 0.0,
) -> tuple[Any, ...]:
    """Gravity, a softened attractor, and along x a pendulum, a spring and quadratic drag: always the same record types."""
    field = Field(
        force=("-k*sin(x) - s*x - c*vx*abs(vx)", "0", "0"), constants={"k": pendulum, "s": spring, "c": drag}
    )
    return (
        Gravity(acceleration=gravity).record(),
        Attractor(strength=pull, softening=0.1).record(),
        field.record(),
    )


def final(name: str, laws: Any, x: Any, v: Any, duration: float, steps: int) -> NDArray[Any]:
    c = columns(x, v, method=name)
    assert not run(program(name, laws), c, steps, duration / steps).any()
    return state(c)[0]


# Tableaus


def test_wrong_tableaus_are_refused() -> None:
    wrong = [
        (RK4, {"b": (1 / 6, 1 / 3, 1 / 3, 1 / 3)}),
        (RK4, {"a": ((), (1 / 2,), (0.0, 1 / 2), (0.0, 1.0, 0.0)), "b": (1 / 6, 1 / 3, 1 / 3, 1 / 6)}),
        (RK3, {"a": ((), (1 / 2,), (-1.0, 1.0))}),
        (RK3, {"order": 4}),
        (HEUN, {"order": 3}),
        (HEUN, {"c": (0.0, 0.5)}),
        (HEUN, {"b": (0.5, 0.5000000001)}),
        (HEUN, {"a": ((), (1.0,), ())}),
        (HEUN, {"a": ((0.0,), (1.0,))}),
    ]
    for method, change in wrong:
        with pytest.raises(ValueError, match=method.name):
            replace(method, **change)


def test_there_is_an_order_condition_for_every_rooted_tree() -> None:
    # 1, 1, 2, 4, 9, 20, 48, 115 trees of 1 to 8 nodes (OEIS A000081)
    trees = rooted_trees(8)
    assert [sum(tree.nodes == n for tree in trees) for n in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]
    # RK45 holds all of them to order 5 and not to order 6, DOP853 to 8.
    for name, order in (("rk45", 5), ("dop853", 8)):
        method = METHODS[name]
        assert isinstance(method, EmbeddedRungeKutta)
        with pytest.raises(ValueError, match=f"{name}: a condition of order {order + 1}"):
            replace(method, order=order + 1)
        for k in range(len(method.errors)):
            orders = [q + (j == k) for j, q in enumerate(method.error_orders)]
            with pytest.raises(ValueError, match=f"{name}: a condition of order {orders[k]}"):
                replace(method, error_orders=tuple(orders))


def test_wrong_compositions_are_refused() -> None:
    wrong = [
        (VELOCITY_VERLET, {"kicks": (0.5, 0.4)}),
        (VELOCITY_VERLET, {"drifts": (0.5, 0.4)}),
        (VELOCITY_VERLET, {"kicks": (0.5, 0.5000000001)}),
        (VELOCITY_VERLET, {"kicks": (1.0,)}),
        (VELOCITY_VERLET, {"kicks": (0.4, 0.6)}),
        (VELOCITY_VERLET, {"reversible": False}),
        (VELOCITY_VERLET, {"order": 3}),
        (SYMPLECTIC_EULER, {"reversible": True}),
        (SYMPLECTIC_EULER, {"order": 2}),
        (YOSHIDA4, {"kicks": (0.0, 1 / 3, 1 / 3, 1 / 3)}),
        (YOSHIDA4, {"kicks": (), "drifts": ()}),
    ]
    for method, change in wrong:
        with pytest.raises(ValueError, match=method.name):
            replace(method, **change)


def test_methods_without_inertia_keep_their_order() -> None:
    for method in METHODS.values():
        other = METHODS[method.first_order] if method.first_order else method
        assert isinstance(other, RungeKutta | ImplicitMethod)
        # No method for particles without inertia is of a higher order than 8.
        assert other.order == min(method.order, 8)


def test_evaluations() -> None:
    expected = {"explicit_euler": 1, "midpoint": 2, "heun": 2, "rk3": 3, "rk4": 4, "symplectic_euler": 1}
    expected |= {"velocity_verlet": 2, "stormer_verlet": 1, "yoshida4": 3}
    expected |= {"adaptive_euler": 2, "rk45": 6, "dop853": 12, "ias15": 15, "whfast": 1}
    expected |= {"backward_euler": 1, "trapezoidal": 2, "implicit_midpoint": 1, "bdf2": 1}
    assert {name: m.evaluations for name, m in METHODS.items()} == expected


# Stability


def stability_limit(method: RungeKutta, direction: complex) -> float:
    """The largest s with |R(s direction)| ≤ 1 on [0, s], to 10⁻⁶, by a scan and a bisection."""
    # The slack is above the rounding errors of R, and below |R(0.01 i)| − 1 = 1.25e-9 of the midpoint rule.
    stable = lambda s: abs(method.amplification(s * direction)) <= 1 + 1e-10  # noqa: E731
    low = 0.0
    while stable(low + 0.01):
        low += 0.01
    high = low + 0.01
    while high - low > 1e-7:
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


@pytest.mark.parametrize(
    ("name", "imaginary", "real"),
    [
        ("explicit_euler", 0, 2),
        ("midpoint", 0, 2),
        ("heun", 0, 2),
        ("rk3", math.sqrt(3), 2.5127),
        ("rk4", math.sqrt(8), 2.7853),
    ],
)
def test_stability_limits(name: str, imaginary: float, real: float) -> None:
    method = METHODS[name]
    assert isinstance(method, RungeKutta)
    # |R(i s)| = 1 + O(s⁴) for the second-order methods: the slack hides s < (8·10⁻¹⁰)^¼ = 0.0053
    assert stability_limit(method, 1j) == pytest.approx(imaginary, abs=6e-3 if imaginary == 0 else 1e-5)
    assert stability_limit(method, -1) == pytest.approx(real, abs=1e-4)


@pytest.mark.parametrize("name", ["symplectic_euler", "velocity_verlet", "stormer_verlet"])
def test_leapfrog_is_stable_below_two(name: str) -> None:
    # hω < 2
    for h, stable in ((1.99, True), (2.01, False)):
        # |x| ≤ 1/√(1 − h²/4) = 10 below, exp(0.2 n) above
        end = final(name, forces(spring=1.0), (1.0, 0, 0), (0, 0, 0), 200 * h, 200)
        assert (abs(end[0]) < 100) == stable


# Golden values


@pytest.mark.parametrize(
    ("h", "expected"),
    [(1.0, [0, 0, 2, 6, 12]), (0.5, [0, 0, 0.5, 1.5, 3, 5, 7.5, 10.5, 14, 18])],
)
def test_explicit_euler_from_rest(h: float, expected: list[float]) -> None:
    # a = 2
    c = columns((0, 0, 0), (0, 0, 0))
    p = program("explicit_euler", forces(gravity=(2.0, 0, 0)))
    places = [0.0]
    for k in range(len(expected) - 1):
        run(p, c, 1, h, first_step=k)
        places.append(float(c.x[0]))
    assert places == expected


def test_explicit_euler_with_a_constant_force() -> None:
    # f = 10 N, m = 1 kg, ten steps of 1 s: x = h² a (0 + 1 + ... + 9) = 450, v = 100; exact 500
    end = final("explicit_euler", forces(gravity=(10.0, 0, 0)), (0, 0, 0), (0, 0, 0), 10.0, 10)
    assert (end[0], end[3]) == (450, 100)


@pytest.mark.parametrize("name", [n for n, m in FIXED_STEP.items() if m.order >= 2])
def test_projectile_is_exact_for_second_order(name: str) -> None:
    # x = x0 + v0 t + ½ g t², v = v0 + g t
    end = final(name, forces(gravity=(0, -9.80665, 0)), (1, 2, 3), (4, 5, 6), 2.0, 64)
    exact = [1 + 8, 2 + 10 - 2 * 9.80665, 3 + 12, 4, 5 - 2 * 9.80665, 6]
    np.testing.assert_allclose(end, exact, rtol=0, atol=64 * 4 * EPS * 20)


@methods
def test_velocities_are_as_late_as_the_method_says(name: str) -> None:
    # One step of h = 0.5 under g: v = v0 + g h, x = x0 + h (v0 + (1/2 + lag) g h)
    end = final(name, forces(gravity=(0, -8.0, 0)), (1, 2, 3), (4, 5, 6), 0.5, 1)
    assert end[4] == pytest.approx(1, abs=64 * EPS)
    assert end[1] == pytest.approx(2 + 0.5 * (5 - 4 * (0.5 + METHODS[name].lag)), abs=64 * EPS)


# Order of convergence

PROBLEMS: dict[str, tuple[dict[str, float | tuple[float, float, float]], Any, Any, float]] = {
    # e = 0.3 about a nearly point-like attractor, half a turn
    "orbit": ({"pull": 1.0}, (0.7, 0, 0), (0, math.sqrt(1.3 / 0.7), 0), 3.0),
    "pendulum": ({"pendulum": 1.0}, (1.0, 0, 0), (0.5, 0, 0), 3.0),
    "drag": ({"drag": 0.3, "gravity": (0.5, 0, 0)}, (0, 0, 0), (3.0, 0, 0), 2.0),
}


def expected_order(method: Method, problem: str) -> int:
    """A composition kicks with a velocity in the middle of its change: first order with forces that depend on it.

    With v' = a(v): v + ½ h a(v) + ½ h a(v + ½ h a(v)) = v + h a + ¼ h² a a' + ..., but the solution has ½ h² a a'.
    Störmer's rule evaluates at the recorded velocity, itself of second order, and keeps its order.
    """
    return 1 if problem == "drag" and isinstance(method, Composition) else method.order


@methods
@pytest.mark.parametrize("problem", PROBLEMS)
def test_order_of_convergence(name: str, problem: str) -> None:
    parameters, x, v, duration = PROBLEMS[problem]
    laws = forces(**parameters)  # type: ignore[arg-type]
    exact = final("rk4", laws, x, v, duration, 20_000)
    order = expected_order(METHODS[name], problem)
    steps = {1: 4000, 2: 800, 3: 400, 4: 300}[order]
    errors = [np.abs(final(name, laws, x, v, duration, n) - exact) for n in (steps, 2 * steps)]
    for part in (slice(0, 3), slice(3, 6)):
        coarse, fine = (np.linalg.norm(e[part]) for e in errors)
        assert fine > 100 * EPS, "the error is rounding: the test says nothing"
        assert math.log2(coarse / fine) == pytest.approx(order, abs=0.1)


# Geometry


@pytest.mark.parametrize(
    "name", [n for n, m in METHODS.items() if m.reversible and isinstance(m, Composition)]
)
def test_reversible_methods_find_their_way_back(name: str) -> None:
    # Only rounding is lost: about √n ε, times the growth of perturbations, which is linear in time here.
    laws = forces(pull=1.0, pendulum=0.2)
    start = columns((0.7, 0, 0.1), (0, 1.2, 0))
    c = columns((0.7, 0, 0.1), (0, 1.2, 0))
    run(program(name, laws), c, 1000, 0.01)
    for v in (c.vx, c.vy, c.vz):
        v *= -1
    run(program(name, laws), c, 1000, 0.01)
    np.testing.assert_allclose(position(c), position(start), rtol=0, atol=1e-11)
    np.testing.assert_allclose(velocity(c), -velocity(start), rtol=0, atol=1e-11)


def test_stormer_verlet_is_reversible_in_its_positions() -> None:
    # The rule is symmetric in x_{n−1} and x_{n+1}: with the two last positions exchanged it returns. What it remembers is
    # u = (x_n − x_{n−1})/h, and −(x_{n+1} − x_n)/h on the way back.
    laws = program("stormer_verlet", forces(pull=1.0, pendulum=0.2))
    c = columns((0.7, 0, 0.1), (0, 1.2, 0), method="stormer_verlet")
    run(laws, c, 1, 0.01)
    first = position(c)
    run(laws, c, 999, 0.01)
    last = position(c)
    run(laws, c, 1, 0.01)
    for x, there in zip((c.x, c.y, c.z), last[0], strict=True):
        x[0] = there
    for u in c.memory[:3]:
        u *= -1
    run(laws, c, 999, 0.01)
    np.testing.assert_allclose(position(c), first, rtol=0, atol=1e-11)


def one_step(name: str, laws: Any, x: float, v: float, h: float) -> NDArray[Any]:
    """Position and velocity after a step; for Störmer's rule its own variables x_n and u_n = (x_n − x_{n−1})/h."""
    c = columns((x, 0, 0), (v, 0, 0), method=name)
    if isinstance(METHODS[name], Verlet):
        c.memory[0][0], c.memory[3][0] = v, h
        run(program(name, laws), c, 1, h)
        return np.array([c.x[0], c.memory[0][0]])
    run(program(name, laws), c, 1, h)
    return state(c)[0, [0, 3]]


@methods
@pytest.mark.parametrize("law", ["spring", "pendulum"])
def test_symplectic_methods_keep_areas(name: str, law: str) -> None:
    # det ∂(x', v')/∂(x, v) = 1 for symplectic maps; 1 + ω²h² or 1 + O(h⁴) for the others. For a linear force
    # the trapezoidal rule, by which bdf2 begins, is the midpoint rule.
    if name in ("trapezoidal", "bdf2") and law == "spring":
        return
    laws = forces(spring=1.0) if law == "spring" else forces(pendulum=1.0)
    d, h = 1e-4, 0.4
    dx = (one_step(name, laws, 0.5 + d, 0.3, h) - one_step(name, laws, 0.5 - d, 0.3, h)) / (2 * d)
    dv = (one_step(name, laws, 0.5, 0.3 + d, h) - one_step(name, laws, 0.5, 0.3 - d, h)) / (2 * d)
    determinant = dx[0] * dv[1] - dx[1] * dv[0]
    # central differences: error d² f'''/6 + ε/d
    assert (abs(determinant - 1) < 1e-8) == METHODS[name].symplectic


@pytest.mark.parametrize(
    "name", [n for n, m in FIXED_STEP.items() if m.symplectic or not isinstance(m, ImplicitMethod)]
)
def test_energy_over_many_steps(name: str) -> None:
    # A pendulum, 10⁵ steps of 0.05, energy on both halves of the run.
    c = columns((1.0, 0, 0), (0, 0, 0), method=name)
    p = program(name, forces(pendulum=1.0))
    start = -math.cos(1.0)
    errors = []
    for k in range(1000):
        run(p, c, 100, 0.05, first_step=100 * k)
        errors.append(abs(0.5 * c.vx[0] ** 2 - math.cos(c.x[0]) - start))
    early, late = max(errors[:500]), max(errors[500:])
    method = METHODS[name]
    if method.symplectic:
        # bounded by C h^p; v² and x'' are of order 1
        assert late < 0.05**method.order
        assert late < 1.1 * early
    elif method.order <= 2:
        assert late > 0.5 or late > 1.5 * early
    else:
        # dissipation of order h^(p+1) a unit of time: it goes on
        assert late == pytest.approx(2 * early, rel=0.25)


def test_the_velocity_of_stormer_verlet_is_of_second_order() -> None:
    # v_n + ⅜ h² x‴ at most: measured against the exact oscillator
    errors = []
    for steps in (200, 400):
        end = final("stormer_verlet", forces(spring=1.0), (1.0, 0, 0), (0, 0, 0), 1.0, steps)
        errors.append(abs(end[3] + math.sin(1.0)))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(STORMER_VERLET.order, abs=0.05)
