"""The table of integrators: order, cost, and how large a step may be, computed from the methods themselves.

Two test problems: the undamped oscillator x'' = −ω² x, whose limit is a value of h ω, and pure damping v' = −d v, whose
limit is a value of h d. A method is stable up to the first step at which some state grows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from particlesim.integrators import METHODS, Composition, ImplicitMethod, Method, RungeKutta

Matrix = NDArray[np.complex128]
SCAN = 0.02
FURTHEST = 20.0
# Beyond rounding and the square root that a double eigenvalue makes of it, but below the growth of any unstable step.
GROWTH = 1e-9


def integrators_table() -> str:
    """One row per method; those that choose their steps or follow orbits have no such limit."""
    rows = [
        "| name | order | force evaluations | symplectic | reversible | oscillator: h ω up to | damping: h d up to | "
        "without inertia |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, method in METHODS.items():
        marks = " | ".join("yes" if flag else "no" for flag in (method.symplectic, method.reversible))
        oscillator, damping = "–", "–"
        if method.by_modes:
            oscillator, damping = (shown(limit(step, method)) for step in (oscillate, damp))
        other = f"`{method.first_order}`" if method.first_order else f"`{name}`"
        rows.append(
            f"| `{name}` | {method.order} | {method.evaluations} | {marks} | {oscillator} | {damping} | {other} |"
        )
    return "\n".join(rows)


def shown(z: float) -> str:
    """A limit in words."""
    return f"{z:.3f}" if z < FURTHEST else "any"


def limit(step: Callable[[Method, float], Matrix], method: Method) -> float:
    """The largest z up to which no state of a test problem grows."""

    def stable(z: float) -> bool:
        return bool(np.abs(np.linalg.eigvals(step(method, z))).max() <= 1 + GROWTH)

    z = SCAN
    while z < FURTHEST and stable(z):
        z += SCAN
    if z == SCAN:
        return 0.0
    if z >= FURTHEST:
        return FURTHEST
    low, high = z - SCAN, z
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def oscillate(method: Method, z: float) -> Matrix:
    """One step of x'' = −ω² x with h ω = z."""
    if isinstance(method, RungeKutta | ImplicitMethod):
        return np.array([[method.amplification(1j * z)]])
    if isinstance(method, Composition):
        return composed(method, np.array([[1, 0], [-z * z, 1]]), np.array([[1, 1], [0, 1]]))
    # Störmer's rule visits the places of velocity Verlet: x'' = 2 x' − x − z² x'
    return np.array([[2 - z * z, -1], [1, 0]], complex)


def damp(method: Method, z: float) -> Matrix:
    """One step of v' = −d v with h d = z."""
    if isinstance(method, RungeKutta | ImplicitMethod):
        return np.array([[method.amplification(complex(-z))]])
    if isinstance(method, Composition):
        return composed(method, np.array([[1 - z]]), np.array([[1]]))
    # Störmer's rule with u = (x_n − x_{n−1})/h: u' = u − z v, and the recorded velocity v' = u' − z v / 2
    return np.array([[1, -z], [1, -1.5 * z]], complex)


def composed(method: Composition, kick: NDArray[np.floating], drift: NDArray[np.floating]) -> Matrix:
    """Kick, drift, kick, drift ... on a linear problem; a fraction of a kick or drift scales its change."""
    unit = np.eye(len(kick))
    total = unit.astype(complex)
    for k, d in zip(method.kicks, method.drifts, strict=True):
        total = (unit + d * (drift - unit)) @ (unit + k * (kick - unit)) @ total
    return total
