"""A column of a sweep's table over another."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from particlesim.analysis.figure import COLORS, INK, blank_figure, check_image, new_figure, save
from particlesim.errors import UsageError
from particlesim.sweep.axes import Listed
from particlesim.sweep.design import Design
from particlesim.trajectory.fields import unknown_name

MOST_LINES = 12

Points = list[tuple[float, float]]


def check_plot(x: str, y: str, columns: Sequence[str], target: Path) -> None:
    """Refuse a plot that could not be drawn at the end. Raises UsageError."""
    for name in (x, y):
        if name not in columns:
            raise unknown_name("column", name, columns)
    check_image(target, overwrite=True)
    blank_figure()


def plot_table(table: Path, design: Design, x: str, y: str, target: Path) -> None:
    """Draw column `y` of results.csv over column `x`; a line for each combination of the other listed keys, if they are few.

    Rows without a number in either column are left out. Raises UsageError as `check_plot`, and when no row has numbers.
    """
    others = [axis.key for axis in design.axes if isinstance(axis, Listed) and axis.key not in (x, y)]
    curves = _curves(table, x, y, () if design.zipped else others)
    if not curves:
        raise UsageError(f"no run has a number for both {x} and {y}", f"See {table}.")
    figure, (axes,) = new_figure()
    joined = len(curves) <= MOST_LINES and isinstance(
        next((axis for axis in design.axes if axis.key == x), None), Listed
    )
    if len(curves) > MOST_LINES:
        curves = {"": sorted(point for points in curves.values() for point in points)}
    for k, (name, points) in enumerate(curves.items()):
        style = "o-" if joined else "o"
        axes.plot(
            *zip(*sorted(points), strict=True), style, color=COLORS[k % len(COLORS)], markersize=4, label=name
        )
    if len(curves) > 1:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=9, labelcolor=INK)
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    axes.set_title(table.parent.name, loc="left", fontsize=12, fontweight="bold", color=INK)
    save(figure, target)


def _curves(table: Path, x: str, y: str, others: Sequence[str]) -> dict[str, Points]:
    """Points by the values of the other keys, 'b=1, c=2'."""
    curves: dict[str, Points] = {}
    with table.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            point = _number(row[x]), _number(row[y])
            if point[0] is not None and point[1] is not None:
                name = ", ".join(f"{key.split('.')[-1]} = {row[key]}" for key in others)
                curves.setdefault(name, []).append((point[0], point[1]))
    return curves


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
