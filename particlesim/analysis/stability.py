"""The largest stable step of a scenario, before it runs, and its eigenvalues drawn on the stability region of the method."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from particlesim.analysis.figure import COLORS, INK, blank_figure, check_image, dress, save
from particlesim.engine.stability.limits import IslandStability, Stability
from particlesim.engine.stability.limits import stability as of_world
from particlesim.engine.world import World
from particlesim.integrators.base import Method
from particlesim.integrators.regions import Linear, amplification, has_function, one_step
from particlesim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT, LEGEND = 4.6, 1.8
"""Height of a panel, and the width beside it for the legend [inch]."""
GRID = 301
"""Points of the complex plane across a region."""
FARTHEST = 40.0
"""h|λ| beyond which eigenvalues are not drawn."""


@dataclass(frozen=True)
class Cloud:
    """Values h λ that are drawn in one way: rings or dots."""

    label: str
    points: NDArray[np.complex128]
    ring: bool

    @property
    def near(self) -> NDArray[np.complex128]:
        """Those that are not too far out."""
        return np.asarray(self.points[np.abs(self.points) <= FARTHEST])


def stability(scenario: Scenario) -> Stability:
    """The largest stable steps of a scenario at its initial state: of every island, by force and with all together.

    Emitters are judged by the particles that they will emit first. Raises UsageError when a file that the scenario names
    cannot be read.
    """
    return of_world(World(scenario))


def plot_stability(found: Stability, out: Path, *, overwrite: bool = False) -> None:
    """Draw h λ of modes on the stability region of their method, for h = dt, into an image (PNG, SVG or PDF).

    A method has a panel of its own, with the modes under all forces together as dots, and those under each force alone as
    rings; of a large island some that are spread over the spectrum. Raises UsageError for an output that exists (unless
    `overwrite`), an unknown ending, and when matplotlib is missing.
    """
    check_image(out, overwrite=overwrite)
    methods = list(dict.fromkeys(island.method for island in found.islands))
    groups = [
        _clouds([each for each in found.islands if each.method == method], found.dt) for method in methods
    ]
    frames = [_frame(clouds) for clouds in groups]
    widths = [max((right - left) / (2 * up), 0.5) for left, right, up in frames]
    figure = blank_figure(1.0 + sum(HEIGHT * width + LEGEND for width in widths), HEIGHT + 0.6)
    grid = figure.add_gridspec(1, len(methods), width_ratios=[HEIGHT * width + LEGEND for width in widths])
    for number, (method, clouds, frame) in enumerate(zip(methods, groups, frames, strict=True)):
        axes = figure.add_subplot(grid[0, number])
        dress(axes)
        _panel(axes, method, clouds, frame, found.dt)
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


def _clouds(islands: list[IslandStability], dt: float) -> list[Cloud]:
    """What is drawn of some islands, rings first: dots are on top of them."""
    rings, dots = [], []
    for island in islands:
        name = ", ".join(island.groups)
        alone = {label: values for label, values in island.spectra.items() if len(_drawn(values))}
        if len(alone) > 1:
            rings += [Cloud(f"{label} alone", dt * _drawn(values), True) for label, values in alone.items()]
        dots.append(Cloud(name, dt * _drawn(island.eigenvalues), False))
    return [*rings, *dots]


def _frame(clouds: list[Cloud]) -> tuple[float, float, float]:
    """Left and right end of a panel, and its half height: the heart of a region and all that is near."""
    known = np.concatenate([cloud.near for cloud in clouds]) if clouds else np.empty(0, complex)
    up = 1.1 * max(3.2, float(np.abs(known.imag).max(initial=0.0)))
    left = -1.1 * max(3.2, -float(known.real.min(initial=0.0)))
    return left, max(0.25 * up, 1.1 * float(known.real.max(initial=0.0))), max(up, 0.4 * -left)


def _panel(
    axes: Axes, method: Method, clouds: list[Cloud], frame: tuple[float, float, float], dt: float
) -> None:
    left, right, up = frame
    x, y = np.meshgrid(np.linspace(left, right, GRID), np.linspace(-up, up, GRID))
    # Marginal methods are stable on a line that rounding must not break.
    factor = region(method, x + 1j * y) - 1e-6
    axes.contourf(x, y, factor, levels=[-1.0, 1.0], colors=["#E8F1E4"])
    axes.contour(x, y, factor, levels=[1.0], colors=["#5B8C4A"], linewidths=1.2)
    axes.axhline(0, color=INK, linewidth=0.6)
    axes.axvline(0, color=INK, linewidth=0.6)
    for number, cloud in enumerate(clouds):
        label = cloud.label
        if far := len(cloud.points) - len(cloud.near):
            label += f" ({far} farther out)"
        color = COLORS[number % len(COLORS)]
        looks = (
            {"markersize": 5.5, "fillstyle": "none", "markeredgewidth": 0.8}
            if cloud.ring
            else {"markersize": 3.5}
        )
        z = cloud.near
        axes.plot(z.real, z.imag, linestyle="", marker="o", color=color, label=label, **looks)
    axes.set_aspect("equal")
    axes.set_xlabel("Re h λ", color=INK)
    axes.set_ylabel("Im h λ", color=INK)
    title = f"{method.name}\nh = {dt:.4g} s"
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", color=INK)
    if len(clouds) <= 2 * len(COLORS):
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8, labelcolor=INK)


def _drawn(values: Any) -> NDArray[np.complex128]:
    """Eigenvalues that are not 0, each once."""
    scale = float(np.abs(values).max(initial=0.0))
    kept = values[np.abs(values) > 1e-9 * scale] if scale else values[:0]
    return np.asarray(np.unique(np.round(kept / scale, 6)) * scale if len(kept) else kept)
