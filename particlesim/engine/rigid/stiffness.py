"""The largest stable step under springs between points of bodies, in the present state.

With J the Jacobian of the stretches s of all springs (a row has the direction of a spring and its moments at both ends),
s̈ = −J M⁻¹ Jᵀ (k s + c ṡ). The largest ω² and γ are the largest eigenvalues of J M⁻¹ Jᵀ with entries times √(k_i k_j) and
times √(c_i c_j). The leapfrog with kicks by the midpoint rule stays bounded while h² ω²/4 + h γ/2 ≤ 1: ω h ≤ 2 without
damping, γ h ≤ 2 without stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from particlesim.engine.rigid.bodies import WORLD, Bodies
from particlesim.engine.rigid.rotation import matrix
from particlesim.engine.rigid.springs import BodySprings
from particlesim.model.arrays import Floats, Ints

TURNS = 200
"""Turns of the power iteration, far more than the last two digits need."""


def longest_step(springs: Sequence[BodySprings], b: Bodies) -> float:
    """The largest stable step [s]; infinite without springs."""
    body, row = _rows(springs, b)
    k, c = (np.concatenate([np.zeros(0), *(getattr(each, key) for each in springs)]) for key in "kc")
    count = b.x.shape[1]
    omega, root = (_largest(body, row, np.sqrt(weights), count) for weights in (k, c))
    with np.errstate(over="ignore"):  # infinitely stiff: a step of 0
        rate = 0.5 * np.square(root)
    return float(2 / (np.hypot(rate, omega) + rate)) if omega > 0 or rate > 0 else np.inf


def _rows(springs: Sequence[BodySprings], b: Bodies) -> tuple[Ints, Floats]:
    """Of both ends of every spring, its body (WORLD: none), shape [2, m], and the row times the root of the inverse
    inertias, shape [2, m, 6]."""
    bodies: list[tuple[int, int]] = []
    rows = []
    for each in springs:
        for s, pair in enumerate(zip(each.first.tolist(), each.second.tolist(), strict=True)):
            turns = [np.eye(3) if i == WORLD else np.reshape(matrix(b.turn[:, i]), (3, 3)) for i in pair]
            arms = [r @ point[:, s] for r, point in zip(turns, (each.point, each.other), strict=True)]
            ends = [a if i == WORLD else a + b.x[:, i] for i, a in zip(pair, arms, strict=True)]
            along = ends[0] - ends[1]
            size = np.abs(along).max()  # whose square may be infinite
            along = along / size if size > 0 else np.array([1.0, 0.0, 0.0])
            along = along / np.linalg.norm(along)
            row = np.zeros((2, 6))
            for end, (i, r, arm) in enumerate(zip(pair, turns, arms, strict=True)):
                if i != WORLD:
                    sign = 1.0 if end == 0 else -1.0
                    row[end, :3] = sign * np.sqrt(b.w[i]) * along
                    row[end, 3:] = sign * (r.T @ np.cross(arm, along)) / np.sqrt(b.inertia[:, i])
            bodies.append(pair)
            rows.append(row)
    return np.array(bodies, np.int64).reshape(-1, 2).T, np.array(rows).reshape(-1, 2, 6).transpose(1, 0, 2)


def _largest(body: Ints, row: Floats, weight: Floats, count: int) -> float:
    """The root of the largest eigenvalue of W J M⁻¹ Jᵀ W, by power iteration."""
    if not weight.any():
        return 0.0
    stiff, long = weight.max(), np.abs(row).max()  # products of both may be infinite
    weight, row = weight / stiff, row / (long or 1.0)
    x, size = weight * (1 + np.arange(len(weight)) % 7), 0.0
    for _ in range(TURNS):
        x = x / np.linalg.norm(x)
        given = np.zeros((count + 1, 6))  # the last one stands for the world
        for end in range(2):
            np.add.at(given, body[end], row[end] * (weight * x)[:, None])
        y = weight * sum((row[end] * given[body[end]]).sum(axis=1) for end in range(2))
        size = float(x @ y)
        if not np.linalg.norm(y) > 0:
            break
        x = y
    with np.errstate(over="ignore"):
        return float(np.sqrt(size) * stiff * long)
