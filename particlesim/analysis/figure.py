"""Figures in the house style, written as images."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from particlesim.errors import UsageError
from particlesim.trajectory.target import check_target, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ENDINGS = (".png", ".svg", ".pdf")

# Okabe and Ito's palette, told apart with every common colour blindness (jfly.uni-koeln.de/color, 2008), less
# its yellow, which is too pale for a line on white.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
INK = "#222222"
GRID = "#E4E4E4"


def check_image(out: Path, *, overwrite: bool) -> None:
    """Refuse an image that could not be written. Raises UsageError."""
    if out.suffix.lower() not in ENDINGS:
        raise UsageError(f"cannot draw {out.name!r}: unknown ending", f"Known endings: {', '.join(ENDINGS)}.")
    check_target(out, overwrite=overwrite)


def blank_figure(width: float = 8.0, height: float = 4.5) -> Figure:
    """An empty figure [inch]; without pyplot nothing global changes and no display is needed.

    Raises UsageError when matplotlib is missing.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise UsageError(
            "plots need matplotlib, which is not installed", "pip install 'particlesim[plot]'"
        ) from None
    figure = Figure(figsize=(width, height), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def dress(axes: Axes) -> None:
    """Lines and ticks of axes in the house style."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GRID)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=INK, length=0, labelsize=9)


def new_figure(rows: int = 1, height: float = 4.5) -> tuple[Figure, list[Axes]]:
    """A figure with `rows` axes below each other, which share the lowest one's abscissa. Raises as `blank_figure`."""
    figure = blank_figure(height=height)
    all_axes = list(figure.subplots(rows, 1, sharex=True, squeeze=False).flat)
    for axes in all_axes:
        dress(axes)
    return figure, all_axes


def save(figure: Figure, out: Path) -> None:
    """Write a figure. Raises InputOutputError when that fails."""
    with replacing(out) as temporary:
        figure.savefig(temporary, dpi=160, format=out.suffix[1:].lower())
