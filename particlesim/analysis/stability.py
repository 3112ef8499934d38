"""The largest stable step of a scenario, before it runs, and its eigenvalues drawn on the stability region of the method."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from particlesim.analysis.figure import COLORS, INK, blank_figure, check_image, dress, save
from particlesim.engine.simulation import Simulation
from particlesim.engine.stability import IslandStability, Stability
from particlesim.engine.stability import stability as of_simulation
from particlesim.integrators.base import Method
from particlesim.integrators.regions import Linear, amplification, has_function, one_step
from particlesim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GRID = 301
"""Points of the complex plane across a region."""
FARTHEST = 40.0
"""h|λ| beyond which eigenvalues are not drawn."""


def stability(scenario: Scenario) -> Stability:
    """The largest stable steps of a scenario at its initial state: of every island, by force and with all together.

    Emitters are judged by the particles that they will emit first. Raises UsageError when a file that the scenario names
    cannot be read.
    """
    simulation = Simulation(scenario, threads=1)
    try:
        return of_simulation(simulation)
    finally:
        simulation.close()


def plot_stability(found: Stability, out: Path, *, overwrite: bool = False) -> None:
    """Draw h λ of every mode on the stability region of its method, for h = dt, into an image (PNG, SVG or PDF).

    A method has a panel of its own. Raises UsageError for an output that exists (unless `overwrite`), an unknown ending,
    and when matplotlib is missing.
    """
    check_image(out, overwrite=overwrite)
    methods = list(dict.fromkeys(island.method for island in found.islands))
    figure = blank_figure(1.0 + 5.0 * len(methods), 5.0)
    for number, method in enumerate(methods):
        axes = figure.add_subplot(1, len(methods), number + 1)
        dress(axes)
        _panel(axes, method, [island for island in found.islands if island.method == method], found.dt)
    save(figure, out)


def region(method: Method, z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """How much a step multiplies the mode with h λ = z; the region of stability is where this is at most 1.

    Methods that treat position and velocity differently have no function of z alone. For them it is the factor of the
    oscillator with the eigenvalues z and z̄.
    """
    if has_function(method):
        return np.abs(amplification(method, z))
    k, d = (np.abs(z) ** 2).reshape(-1, 1, 1), (-2 * z.real).reshape(-1, 1, 1)
    factors = np.linalg.eigvals(one_step(method, Linear(-k.astype(complex), -d.astype(complex)), 1.0))
    return np.asarray(np.abs(factors).max(axis=1).reshape(z.shape))


def _panel(axes: Axes, method: Method, islands: list[IslandStability], dt: float) -> None:
    points = [(island, dt * _drawn(island.eigenvalues)) for island in islands]
    known = np.concatenate([z[np.abs(z) <= FARTHEST] for _, z in points])
    size = 1.1 * max(3.5, float(np.abs(known).max(initial=0.0)))
    right = max(1.5, 1.1 * float(known.real.max(initial=0.0)))
    x, y = np.meshgrid(np.linspace(-size, right, GRID), np.linspace(-size, size, GRID))
    # Marginal methods are stable on a line that rounding must not break.
    factor = region(method, x + 1j * y) - 1e-6
    axes.contourf(x, y, factor, levels=[-1.0, 1.0], colors=["#E8F1E4"])
    axes.contour(x, y, factor, levels=[1.0], colors=["#5B8C4A"], linewidths=1.2)
    axes.axhline(0, color=INK, linewidth=0.6)
    axes.axvline(0, color=INK, linewidth=0.6)
    for number, (island, z) in enumerate(points):
        near = z[np.abs(z) <= FARTHEST]
        label = ", ".join(island.groups)
        if len(near) < len(z):
            label += f" ({len(z) - len(near)} farther out)"
        color = COLORS[number % len(COLORS)]
        axes.plot(near.real, near.imag, linestyle="", marker="o", markersize=3.5, color=color, label=label)
    axes.set_aspect("equal")
    axes.set_xlabel("Re h λ", color=INK)
    axes.set_ylabel("Im h λ", color=INK)
    axes.set_title(f"{method.name}, h = {dt:.4g} s", loc="left", fontsize=11, fontweight="bold", color=INK)
    if len(points) <= 2 * len(COLORS):
        axes.legend(loc="upper left", frameon=False, fontsize=8, labelcolor=INK)


def _drawn(values: Any) -> NDArray[np.complex128]:
    """Eigenvalues that are not 0, each once."""
    scale = float(np.abs(values).max(initial=0.0))
    kept = values[np.abs(values) > 1e-9 * scale] if scale else values[:0]
    return np.asarray(np.unique(np.round(kept / scale, 6)) * scale if len(kept) else kept)
