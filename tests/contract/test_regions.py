"""Stability regions of the methods, against closed forms."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from particlesim.engine.stability.limits import unlimited
from particlesim.integrators import METHODS
from particlesim.integrators.regions import Linear, eigenvalues, growth, largest_step

OMEGA = 7.0


def mode(k: float, d: float) -> Linear:
    """x'' = −k x − d v."""
    return Linear(np.array([[[-k]]], complex), np.array([[[-d]]], complex))


def diagonal(*k: float) -> Linear:
    return Linear(np.diag(-np.array(k))[None].astype(complex), np.zeros((1, len(k), len(k)), complex))


# h ω of the undamped oscillator. Symplectic Euler, velocity Verlet and Störmer's rule: the trace of the one-step matrix is
# 2 − (hω)² and must not be below −2. Runge–Kutta: |R(iy)| = 1, with |R|² = 1 + y² (Euler), 1 + y⁴/4 (order 2),
# 1 − y⁴/12 + y⁶/36 (order 3), 1 − y⁶/72 + y⁸/576 (order 4).
OSCILLATOR = {
    "symplectic_euler": 2.0,
    "velocity_verlet": 2.0,
    "stormer_verlet": 2.0,
    "explicit_euler": 0.0,
    "midpoint": 0.0,
    "heun": 0.0,
    "rk3": math.sqrt(3),
    "rk4": 2 * math.sqrt(2),
}

# h k of linear drag v' = −k v. Runge–Kutta: where R(−x) is ±1, for order 3 at the real root of x³ − 3x² + 6x − 12, for
# order 4 at that of x³ − 4x² + 12x − 24. Symplectic Euler: |1 − x| ≤ 1. Velocity Verlet kicks twice with h/2:
# (1 − x/2)² ≤ 1.
# Störmer's rule, u' = u − x v, v' = u' − x v/2: trace 1 − 3x/2, determinant −x/2, and by Jury 1 + trace + determinant =
# 2 − 2x ≥ 0.
DRAG = {
    "symplectic_euler": 2.0,
    "velocity_verlet": 4.0,
    "stormer_verlet": 1.0,
    "explicit_euler": 2.0,
    "midpoint": 2.0,
    "heun": 2.0,
    "rk3": 2.5127453266,
    "rk4": 2.7852935634,
}


@pytest.mark.parametrize("method", list(OSCILLATOR))
def test_the_undamped_oscillator(method: str) -> None:
    limit = largest_step(METHODS[method], mode(OMEGA**2, 0)) * OMEGA
    assert limit == pytest.approx(OSCILLATOR[method], abs=1e-6)


@pytest.mark.parametrize("method", list(DRAG))
def test_drag_without_a_spring(method: str) -> None:
    assert largest_step(METHODS[method], mode(0, OMEGA)) * OMEGA == pytest.approx(DRAG[method], abs=1e-6)


def test_yoshida() -> None:
    # Three leapfrogs of w₁h, w₀h, w₁h: stable while the trace of the product of their matrices is between −2 and 2.
    w1 = 1 / (2 - 2 ** (1 / 3))

    def leapfrog(z: float) -> np.ndarray:
        drift = np.array([[1, z / 2], [0, 1]])
        return drift @ np.array([[1, 0], [-z, 1]]) @ drift

    def trace(z: float) -> float:
        return float(np.trace(leapfrog(w1 * z) @ leapfrog((1 - 2 * w1) * z) @ leapfrog(w1 * z)))

    limit = largest_step(METHODS["yoshida4"], mode(OMEGA**2, 0)) * OMEGA
    assert abs(trace(limit)) == pytest.approx(2, abs=1e-6)
    assert all(abs(trace(z)) < 2 for z in np.linspace(0.01, 0.999 * limit, 200))
    assert abs(trace(1.001 * limit)) > 2


@pytest.mark.parametrize("zeta", [0.05, 0.3, 0.7])
def test_a_damped_oscillator(zeta: float) -> None:
    # Symplectic Euler, v' = v − h (ω² x + d v): 4 − (hω)² − 2hd > 0 by Jury's criterion, with d = 2ζω; |det| = |1 − hd| < 1.
    symplectic = largest_step(METHODS["symplectic_euler"], mode(OMEGA**2, 2 * zeta * OMEGA)) * OMEGA
    assert symplectic == pytest.approx(-2 * zeta + math.sqrt(4 * zeta**2 + 4), rel=1e-6)
    # Explicit Euler: |1 + hλ| = 1 on a circle, h = −2 Re λ/|λ|² = 2ζ/ω.
    euler = largest_step(METHODS["explicit_euler"], mode(OMEGA**2, 2 * zeta * OMEGA)) * OMEGA
    assert euler == pytest.approx(2 * zeta, rel=1e-6)


def test_a_saddle_is_not_the_fault_of_the_method() -> None:
    # x grows as e^(3t), y oscillates with ω = 7: the step is that of y, although position x grows without bound.
    for method, limit in (("symplectic_euler", 2.0), ("rk4", 2 * math.sqrt(2))):
        found = largest_step(METHODS[method], diagonal(OMEGA**2, -9.0))
        assert found * OMEGA == pytest.approx(limit, abs=1e-6)


def test_a_free_particle_has_no_limit() -> None:
    for name, method in METHODS.items():
        assert largest_step(method, diagonal(0.0, 0.0, 0.0)) == math.inf, name
        assert growth(method, diagonal(0.0), 1.0) <= 1, name


@pytest.mark.parametrize("method", ["rk4", "symplectic_euler", "stormer_verlet"])
def test_growth_beyond_the_limit(method: str) -> None:
    limit = largest_step(METHODS[method], mode(OMEGA**2, 0.4))
    assert growth(METHODS[method], mode(OMEGA**2, 0.4), 0.99 * limit) < 1
    assert growth(METHODS[method], mode(OMEGA**2, 0.4), 1.01 * limit) > 1


def test_growth_of_a_runge_kutta_method_is_its_function() -> None:
    h = 0.6
    value = cmath.exp(1j * math.pi / 2) * OMEGA * h
    expected = abs(1 + value + value**2 / 2)
    assert growth(METHODS["heun"], mode(OMEGA**2, 0), h) == pytest.approx(expected, rel=1e-12)


def test_first_order_systems() -> None:
    relaxing = Linear(np.array([[[-OMEGA]]], complex), None)
    assert eigenvalues(relaxing) == pytest.approx(np.array([[-OMEGA]]))
    assert largest_step(METHODS["midpoint"], relaxing) * OMEGA == pytest.approx(2.0, abs=1e-6)


def test_a_turning_frame_is_neutral_for_runge_kutta_and_unstable_for_kicks() -> None:
    # Free motion seen from a frame that turns with ω: λ = ±iω, twice each. A kick that reads the velocity adds
    # |1 + 2ihω|² = 1 + 4 (hω)² to that of circles.
    turning = Linear(
        np.diag([OMEGA**2, 0, OMEGA**2])[None].astype(complex),
        2 * OMEGA * np.array([[[0, 0, -1], [0, 0, 0], [1, 0, 0]]], complex),
    )
    assert largest_step(METHODS["rk4"], turning) * OMEGA == pytest.approx(2 * math.sqrt(2), rel=1e-6)
    assert largest_step(METHODS["symplectic_euler"], turning) == 0.0


@pytest.mark.parametrize("method", ["backward_euler", "trapezoidal", "implicit_midpoint", "bdf2"])
def test_a_stable_methods_have_no_limit(method: str) -> None:
    assert largest_step(METHODS[method], mode(OMEGA**2, 0.4)) == math.inf
    assert largest_step(METHODS[method], mode(OMEGA**2, 0.0)) == math.inf
    assert method in unlimited()
    assert "rk4" not in unlimited()
