"""Stability of methods on linear systems: how fast a step of h lets a mode grow, and the largest h that does not.

A second-order system x'' = Kx x + Kv v has the modes e^(λt), λ the eigenvalues of A = [0 1; Kx Kv]; a first-order one
x' = Kx x those of Kx. A Runge–Kutta method, or any other with a stability function R (`amplification`), multiplies a mode
by R(hλ) in every step. Kicks, drifts and Störmer's rule treat position and velocity differently, so that they have no
function of hλ: the eigenvalues of their one-step matrix decide.

Only modes that decay or oscillate are judged. One that grows, Re λ > 0 (a saddle, a pendulum upside down), is right to grow.
Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations II, section IV.2; for compositions, Hairer, Lubich,
Wanner, Geometric Numerical Integration, section I.1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.integrators.base import Composition, Method, RungeKutta, Verlet

Complex = NDArray[Any]

GROWS = 1e-6
"""Re λ/|λ|max beyond which a mode counts as growing, and |λ|/|λ|max below which it does not move at all: double eigenvalues
(a free particle in a turning frame) are found to the square root of the rounding error."""
SLIP = 4e-14
"""Rounding of |R(z)|."""
SLIP_OF_STEPS = 1e-7
"""Rounding of an eigenvalue of a one-step matrix: the square root of the machine's, as free motion is a double one."""
SMALLEST, LARGEST = 1e-3, 1e3
"""Steps h|λ| that are looked at: a method that fails at the smallest has no stable step, one that holds at the largest
has no limit."""


class Linear(NamedTuple):
    """Linear systems of q coordinates each: kx [n, q, q], and kv [n, q, q], None for first-order systems."""

    kx: Complex
    kv: Complex | None


def eigenvalues(system: Linear) -> Complex:
    """Eigenvalues λ of every system [1/s], shape [n, 2q], or [n, q] for first-order ones."""
    kx, kv = system
    if kv is None:
        return np.asarray(np.linalg.eigvals(kx), complex)
    n, q, _ = kx.shape
    a = np.zeros((n, 2 * q, 2 * q), np.result_type(kx, kv))
    a[:, :q, q:] = np.eye(q)
    a[:, q:, :q], a[:, q:, q:] = kx, kv
    return np.asarray(np.linalg.eigvals(a), complex)


def judged(values: Complex) -> Complex:
    """The modes of all systems that a method must not let grow, with Re λ ≤ 0, shape [m]."""
    values = values.ravel()
    scale = np.abs(values).max(initial=0.0)
    kept = values[(values.real <= GROWS * scale) & (np.abs(values) > GROWS * scale)]
    return np.asarray(np.minimum(kept.real, 0.0) + 1j * kept.imag)


def growth(method: Method, system: Linear, h: float) -> float:
    """The largest factor by which one step of h [s] multiplies a mode that does not grow by itself.

    Above 1 the method is unstable at this step; 0: there is no such mode.
    """
    values = eigenvalues(system)
    if not values.any():
        return 0.0
    if has_function(method):
        return float(np.abs(amplification(method, h * judged(values))).max(initial=0.0))
    return float(_spurious(method, system, values, h).max(initial=0.0))


def largest_step(method: Method, system: Linear) -> float:
    """The largest h [s] up to which no mode that decays or oscillates grows; 0: there is none, infinite: no limit."""
    values = eigenvalues(system)
    modes = judged(values)
    scale = np.abs(values).max(initial=0.0)
    if scale == 0 or not np.isfinite(scale):
        return float("inf") if scale == 0 else 0.0
    if has_function(method):
        return float((reach(method, np.angle(modes)) / np.abs(modes)).min(initial=float("inf")))

    def unstable(z: float) -> bool:
        return bool(_spurious(method, system, values, z / scale).max(initial=0.0) > 1 + SLIP_OF_STEPS)

    grid = np.geomspace(SMALLEST, LARGEST, 121)
    first = next((k for k, z in enumerate(grid) if unstable(float(z))), None)
    if first is None:
        return float("inf")
    if first == 0:
        return 0.0
    low, high = float(grid[first - 1]), float(grid[first])
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return low / float(scale)


def has_function(method: Method) -> bool:
    """Whether the method multiplies modes by a function R(hλ)."""
    return hasattr(method, "amplification")


def amplification(method: Any, z: Complex) -> Complex:
    """R(z) for an array of z, infinite at its poles."""

    def one(z: complex) -> complex:
        try:
            return complex(method.amplification(complex(z)))
        except ZeroDivisionError:
            return complex(np.inf)

    if isinstance(method, RungeKutta):  # a polynomial, which takes arrays
        with np.errstate(all="ignore"):
            response: Any = method.amplification(z)  # type: ignore[arg-type]
            value = np.array(response, complex)
    else:
        value = np.array([one(element) for element in np.ravel(z)], complex).reshape(np.shape(z))
    return np.where(np.isnan(value), np.inf, value)


def reach(method: Method, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far the stability region reaches from the origin along rays r e^(iθ), shape of θ; 0: not at all."""
    angles, back = np.unique(np.round(angles, 9), return_inverse=True)
    # cos(π/2) is 6e-17, which is to the right of the imaginary axis or not by chance.
    rays = np.where(np.abs(np.abs(angles) - np.pi / 2) < 1e-8, 1j * np.sign(angles), np.exp(1j * angles))
    grid = np.geomspace(SMALLEST, LARGEST, 601)
    outside = np.abs(amplification(method, grid[:, None] * rays)) > 1 + SLIP
    first = outside.argmax(axis=0)
    low, high = grid[np.maximum(first - 1, 0)], grid[first]
    for _ in range(50):
        middle = 0.5 * (low + high)
        out = np.abs(amplification(method, middle * rays)) > 1 + SLIP
        low, high = np.where(out, low, middle), np.where(out, middle, high)
    low = np.where(first == 0, 0.0, low)
    return np.asarray(np.where(outside.any(axis=0), low, np.inf)[back])


def one_step(method: Method, system: Linear, h: float) -> Complex:
    """The matrix that takes position and velocity (and what the method remembers) through a step of h, for each system."""
    kx, kv = system
    assert kv is not None, "methods without a stability function step second-order systems"
    n, q, _ = kx.shape
    one, nil = np.broadcast_to(np.eye(q), (n, q, q)), np.zeros((n, q, q))
    if isinstance(method, Verlet):
        # u' = u + h a, x' = x + h u', v' = u' + h a/2 with a = Kx x + Kv v, in the order x, u, v.
        return np.block(
            [
                [one + h * h * kx, h * one, h * h * kv],
                [h * kx, one, h * kv],
                [1.5 * h * kx, one, 1.5 * h * kv],
            ]
        )
    assert isinstance(method, Composition), f"{method.name}: no linear analysis"
    step: Complex = np.broadcast_to(np.eye(2 * q, dtype=complex), (n, 2 * q, 2 * q))
    for push, glide in zip(method.kicks, method.drifts, strict=True):
        if push:
            step = np.block([[one, nil], [push * h * kx, one + push * h * kv]]) @ step
        if glide:
            step = np.block([[one, glide * h * one], [nil, one]]) @ step
    return step


def _spurious(method: Method, system: Linear, values: Complex, h: float) -> NDArray[np.float64]:
    """Sizes of the eigenvalues of one-step matrices that belong to no growing mode, shape [n, p]; others as 0.

    A mode that grows without turning keeps a positive real factor, e^(hλ) or near it; one that grows and turns may take
    as much as e^(h Re λ).
    """
    scale = np.abs(values).max()
    if h * scale > 1e60:  # where no explicit method is stable, and powers of it overflow
        return np.full(1, np.inf)
    kx, kv = system
    assert kv is not None
    # In units of 1/|λ|max the entries of position and velocity are of one size.
    factors = np.linalg.eigvals(one_step(method, Linear(kx / scale / scale, kv / scale), h * scale))
    grows = values.real > GROWS * scale
    turns = np.abs(values.imag) > GROWS * scale
    straight = (grows & ~turns).any(axis=1)[:, None]
    swirl = np.exp(np.minimum(h * np.where(grows & turns, values.real, 0.0).max(axis=1), 700.0))[:, None]
    size = np.abs(factors)
    excused = straight & (factors.real > 0) & (np.abs(factors.imag) <= SLIP_OF_STEPS * size)
    excused |= (swirl > 1) & (size <= swirl)
    return np.where(excused, 0.0, size)
