"""Waves on the mesh: what each density wave adds to the potential, and the error that the mesh makes.

The far part of 1/R has the Fourier transform

    R(k) = (4π/k²) e^(−x²) S(x),  x = k/2α,   S(x) = ∫₀^∞ e^(−v) exp(−(εα)² x²/(x² + v)) dv,

and S = 1 without softening: the integral of Ewald's splitting over t, with v = k²/4t² − x². The wave k = 0 is left out: the
mean density does not act, as a uniform background of the opposite sign takes it away.

Particles spread by a window U and read by its gradient feel the waves k_m = k + 2π m/h as well, which nodes do not tell from
k. The influence function whose mean square error of forces is least, over all places of two particles in their cells, is

    G = Σ k_m² U_m² R_m/(Σ U_m² Σ k_m² U_m²),

and that error, of a pair whose weights are 1 in the volume V, is

    σ² = 1/V² Σ_k [Σ k_m² R_m² − (Σ k_m² U_m² R_m)²/(Σ U_m² Σ k_m² U_m²)].

Sources: P. P. Ewald, Ann. Phys. 369, 253 (1921); R. W. Hockney, J. W. Eastwood, Computer Simulation Using Particles (1988),
section 8-3; V. Ballenegger, J. J. Cerdà, C. Holm, J. Chem. Theory Comput. 8, 936 (2012), for gradients of the window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.interactions.mesh.fourier import half_of
from particlesim.engine.interactions.mesh.splines import window

Floats = NDArray[np.float64]

ALIASES = 6
"""Waves on either side that a window is summed over; those of triangular clouds fall off as the sixth power."""
DAMPED = 36.0
"""x² from which a wave counts for nothing."""


class Transform(NamedTuple):
    """R(k) for a splitting α [1/m]: ln S by ln x as a spline between values of a table, and where that begins; None without
    softening."""

    alpha: float
    shape: Any
    least: float

    def values(self, square: Floats) -> Floats:
        """R at squares of wave numbers [1/m²]; 0 for k = 0."""
        x2 = square / (4 * self.alpha**2)
        some = square > 0
        found = np.where(some, 4 * np.pi / np.where(some, square, 1.0) * np.exp(-x2), 0.0)
        if self.shape is not None:
            found *= np.exp(self._at(x2, 0))
        return found

    def slopes(self, square: Floats) -> Floats:
        """R'(k)/(k R(k)) [m²]; 0 for k = 0."""
        some = square > 0
        safe = np.where(some, square, 1.0)
        found = -2 / safe - 1 / (2 * self.alpha**2)
        if self.shape is not None:
            found += self._at(square / (4 * self.alpha**2), 1) / safe
        return np.where(some, found, 0.0)

    def _at(self, x2: Floats, derivative: int) -> Floats:
        lowest, highest = math.exp(2 * self.least), DAMPED
        return np.asarray(self.shape(0.5 * np.log(np.clip(x2, lowest, highest)), derivative))


def transform(alpha: float, softening: float) -> Transform:
    """R(k) of points, or of Plummer spheres."""
    if softening == 0:
        return Transform(alpha, None, 0.0)
    from scipy.interpolate import CubicSpline

    a = (softening * alpha) ** 2
    y = np.linspace(math.log(1e-5), 0.5 * math.log(DAMPED), 1200)
    x2 = np.exp(2 * y)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    # v = x² u, u over pieces that double, up to where e^(−v) has ended
    edges = np.concatenate([[0.0, 0.125, 0.25, 0.5], 2.0 ** np.arange(0, 40)])
    total = np.zeros_like(y)
    for low, high in pairwise(edges.tolist()):
        u = (low + (high - low) * (nodes + 1) / 2)[:, None]
        some = x2 * low < 50
        v = u * x2[some]
        part = np.exp(-v - a / (1 + u)) * ((high - low) / 2 * weights)[:, None]
        total[some] += part.sum(axis=0) * x2[some]
    return Transform(alpha, CubicSpline(y, np.log(total)), float(y[0]))


class Influence(NamedTuple):
    """G over V for waves up to the Nyquist ones, shape [n₀/2 + 1, n₁/2 + 1, half], and by how much the energy of a particle
    of weight 1 with itself is more on the mesh than it is between its images, in the mean [1/m]."""

    function: Floats
    excess: float


def influence(shape: Sequence[int], size: Sequence[float], order: int, far: Transform) -> Influence:
    """The best influence function for splines of an order on a mesh of `shape` over a box of `size` [m]."""
    axes = [_axis(n, length, order) for n, length in zip(shape, size, strict=True)]
    own, steep = _sums(axes)
    above, single = np.zeros(()), np.zeros(())
    for part in product((0, 1), repeat=3):
        k2 = _spread([axis.square[m] for axis, m in zip(axes, part, strict=True)], np.add)
        u2 = _spread([axis.power[m] for axis, m in zip(axes, part, strict=True)], np.multiply)
        r = far.values(k2)
        above = above + k2 * u2 * r
        single = single + r
    with np.errstate(divide="ignore", invalid="ignore"):
        g = np.where(own * steep > 0, above / (own * steep), 0.0)
    g[0, 0, 0] = 0.0
    volume = float(np.prod(size))
    # every wave of an octant stands for those with other signs, but a Nyquist wave is its own opposite
    twice = [np.where((np.arange(n // 2 + 1) % (n // 2)) == 0, 1.0, 2.0) for n in shape]
    excess = float((_spread(twice, np.multiply) * (g * own - single)).sum()) / volume
    half = half_of(shape[2])
    function = np.zeros((*g.shape[:2], half))
    function[..., : g.shape[2]] = g / volume
    return Influence(function, excess)


class _Axis(NamedTuple):
    """Waves of an axis, from 0 to the Nyquist one: k² and U² of the wave and of its nearest alias; sums of U² and of k² U²
    over all aliases, and over all others than the wave itself."""

    square: tuple[Floats, Floats]
    power: tuple[Floats, Floats]
    own: Floats
    steep: Floats
    own_rest: Floats
    steep_rest: Floats


def _axis(count: int, length: float, order: int, index: Any = None) -> _Axis:
    n = np.arange(count // 2 + 1) if index is None else index
    aliases = np.arange(-ALIASES, ALIASES + 1)[:, None] * count + n
    u2, k2 = window(order, 2 * np.pi * aliases / count) ** 2, (2 * np.pi / length * aliases) ** 2
    first, second = ALIASES, ALIASES - 1
    others = np.arange(len(aliases)) != first
    return _Axis(
        (k2[first], k2[second]),
        (u2[first], u2[second]),
        u2.sum(axis=0),
        (k2 * u2).sum(axis=0),
        u2[others].sum(axis=0),
        (k2 * u2)[others].sum(axis=0),
    )


def _spread(rows: Sequence[Floats], combine: Any) -> Floats:
    x, y, z = rows
    return np.asarray(combine(combine(x[:, None, None], y[:, None]), z))


def _sums(axes: Sequence[_Axis]) -> tuple[Floats, Floats]:
    """Σ U_m² and Σ k_m² U_m² over aliases in space."""
    own = _spread([axis.own for axis in axes], np.multiply)
    steep = np.zeros(())
    for k in range(3):
        rows = [axis.steep if j == k else axis.own for j, axis in enumerate(axes)]
        steep = steep + _spread(rows, np.multiply)
    return own, steep


def _sums_of_others(axes: Sequence[_Axis]) -> tuple[Floats, Floats]:
    """The same without the wave itself; no difference of nearly equal numbers."""
    own, steep = np.zeros(()), np.zeros(())
    for others in product((0, 1), repeat=3):
        rows = [axis.own_rest if other else axis.power[0] for axis, other in zip(axes, others, strict=True)]
        if any(others):
            own = own + _spread(rows, np.multiply)
        for k, axis in enumerate(axes):
            if others[k]:  # the factor of this axis is that of k² U²
                mine = [axis.steep_rest if j == k else row for j, row in enumerate(rows)]
            elif any(others):
                mine = [axis.square[0] * axis.power[0] if j == k else row for j, row in enumerate(rows)]
            else:
                continue
            steep = steep + _spread(mine, np.multiply)
    return own, steep


FINEST, COARSEST, STEPS, SAMPLES = 0.03, 3.0, 28, 12


@lru_cache
def mesh_errors(order: int) -> tuple[Floats, Floats]:
    """ln(α h) and ln(σ² V h): the mean square error of the field of a unit weight on a mesh of cells h, at places in all
    directions."""
    alphas = np.geomspace(FINEST, COARSEST, STEPS)
    found = []
    for alpha in alphas:
        far = Transform(alpha, None, 0.0)
        reach = min(0.5, math.sqrt(DAMPED) * alpha / np.pi)  # waves that count, in periods of a cell
        index = (np.arange(SAMPLES) + 0.5) * (reach / SAMPLES)
        axes = [_axis(1, 1.0, order, index) for _ in range(3)]
        own, steep = _sums(axes)
        u2 = _spread([axis.power[0] for axis in axes], np.multiply)
        k2 = _spread([axis.square[0] for axis in axes], np.add)
        r = far.values(k2)
        rest, others = np.zeros(()), np.zeros(())
        for part in product((0, 1), repeat=3):
            if any(part):
                square = _spread([axis.square[m] for axis, m in zip(axes, part, strict=True)], np.add)
                power = _spread([axis.power[m] for axis, m in zip(axes, part, strict=True)], np.multiply)
                value = far.values(square)
                rest = rest + square * power * value
                others = others + square * value**2
        a, b = _sums_of_others(axes)
        missed = k2 * r * r * (u2 * b + a * k2 * u2 + a * b)
        error = others + (missed - 2 * k2 * u2 * r * rest - rest * rest) / (own * steep)
        found.append(
            float(np.maximum(error, 0.0).mean()) * (2 * reach) ** 3
        )  # ∫ d³k/(2π)³ over all waves of a cell
    return np.log(alphas), np.log(np.maximum(found, 1e-300))
