"""The residuals of a fit over time: what the model does not explain."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from particlesim.analysis.figure import COLORS, INK, check_image, new_figure, save
from particlesim.fit.fit import Fit
from particlesim.fit.measurements import COMPONENTS, Measurements


def plot_residuals(found: Fit, data: Measurements, out: Path, *, overwrite: bool = False) -> None:
    """Draw prediction − measurement over time: positions, and below them velocities, where they were measured.

    Raises UsageError for an unknown ending, an output that exists (unless `overwrite`), and when matplotlib is missing.
    """
    check_image(out, overwrite=overwrite)
    kinds = ((slice(0, 3), "position [m]"), (slice(3, 6), "velocity [m/s]"))
    shown = [(part, label) for part, label in kinds if np.isfinite(data.values[:, part]).any()]
    figure, all_axes = new_figure(len(shown), height=1.5 + 3.0 * len(shown))
    for axes, (part, label) in zip(all_axes, shown, strict=True):
        axes.axhline(0, color=INK, linewidth=0.8)
        for column in range(6)[part]:
            measured = np.isfinite(data.values[:, column])
            if measured.any():
                error = None if data.sigma is None else data.sigma[measured, column]
                axes.errorbar(
                    data.times[measured],
                    found.residuals[measured, column],
                    error,
                    fmt="o",
                    markersize=3,
                    color=COLORS[column % 3],
                    elinewidth=0.8,
                    label=COMPONENTS[column],
                )
        axes.set_ylabel(label, color=INK)
        axes.legend(frameon=False, fontsize=9, labelcolor=INK)
    all_axes[-1].set_xlabel("time [s]", color=INK)
    all_axes[0].set_title("Prediction − measurement", loc="left", fontsize=12, fontweight="bold", color=INK)
    save(figure, out)
