"""Plots of a trajectory: energy, momentum, counts, and any component of its particles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from particlesim.analysis import series
from particlesim.analysis.figure import COLORS, INK, check_image, new_figure, save
from particlesim.analysis.motion import mean_square_displacement, temperatures
from particlesim.analysis.structure import Curve, density_profile, power_spectrum, radial_distribution
from particlesim.errors import UsageError
from particlesim.trajectory.fields import short_name, unknown_name
from particlesim.trajectory.reader import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot(
    trajectory: Trajectory,
    quantity: str,
    out: Path,
    *,
    ids: Sequence[int] | None = None,
    group: str | None = None,
    overwrite: bool = False,
) -> None:
    """Draw `quantity` over time into the image `out` (PNG, SVG or PDF by its ending).

    quantity: "energy" (parts and total), "drift" (relative energy drift), "momentum", "angular_momentum", "count",
    "pressure" (in a periodic box), "displacement" (the mean square of how far particles have moved), "kinetic_temperature"
    (of the motion about the centre of mass), "rdf" (the radial distribution function of the last frame, over the distance),
    "density_profile" (of the last frame, over the distance from the densest place; of numbers where masses are not
    recorded), "power_spectrum" (of density waves of the last frame, in a box that is periodic along all axes), or a
    component such as "x", "vy", "speed", "temperature": a line per particle if there are at most 12, else the median within
    bands that hold 50 % and 90 % of them. ids, group: only these particles.
    Raises UsageError for what the file does not hold, an output that exists (unless `overwrite`), an unknown
    ending, and when matplotlib is missing.
    """
    out = Path(out)
    quantity, known = short_name(quantity), series.quantities(trajectory)
    if quantity not in known and quantity not in series.LEDGER_QUANTITIES:
        raise unknown_name("quantity", quantity, known)
    if quantity in (*series.LEDGER_QUANTITIES, "pressure") and (ids is not None or group is not None):
        raise UsageError(
            f"{quantity!r} is recorded for all particles together", "Leave out the choice of ids or group."
        )
    if quantity in series.TOGETHER and ids is not None:
        raise UsageError(
            f"{quantity!r} is one of many particles", "Leave out the choice of ids; --group is possible."
        )
    if not len(trajectory):
        raise UsageError(f"{trajectory.path} has no frames yet")
    check_image(out, overwrite=overwrite)
    figure, (axes,) = new_figure()
    title = _draw(axes, trajectory, quantity, ids, group)
    _label(axes, trajectory, quantity, title if group is None else f"{title} · {group}")
    save(figure, out)


def _draw(
    axes: Axes, trajectory: Trajectory, quantity: str, ids: Sequence[int] | None, group: str | None
) -> str:
    """Put the lines of `quantity` into `axes`; return what to call it."""
    times = trajectory.times
    if quantity == "energy":
        _lines(axes, times, series.energies(trajectory), strong="total")
        return "Energy"
    if quantity == "drift":
        _lines(axes, times, {"drift": series.relative_energy_drift(trajectory)})
        return "Relative energy drift"
    if quantity in ("momentum", "angular_momentum"):
        _lines(axes, times, series.vector(trajectory, quantity))
        return quantity.replace("_", " ").capitalize()
    if quantity == "count":
        _lines(axes, times, {"count": trajectory.counts})
        axes.set_ylim(bottom=0)
        return "Particles"
    if quantity == "pressure":
        _lines(axes, times, {"pressure": trajectory.ledger["pressure"]})
        return "Pressure"
    if quantity == "displacement":
        _lines(axes, times, {"displacement": mean_square_displacement(trajectory, group=group)})
        return "Mean square displacement"
    if quantity == "kinetic_temperature":
        _lines(axes, times, {quantity: temperatures(trajectory, group=group)})
        return "Kinetic temperature"
    if quantity in series.ARRANGEMENTS:
        shown = arrangement(trajectory, quantity, group)
        _lines(axes, shown.curve.x, {quantity: shown.curve.y})
        if quantity != "rdf":
            axes.set_xscale("log")
            axes.set_yscale("log")
        axes.set_xlabel(shown.across, color=INK)
        axes.set_ylabel(f"{shown.title} [{shown.unit}]" if shown.unit else shown.title, color=INK)
        return shown.title
    drawn = series.of_particles(trajectory, quantity, ids=ids, group=group)
    if isinstance(drawn, series.Tracks):
        _lines(axes, times, {f"id {i}": v for i, v in zip(drawn.ids, drawn.values.T, strict=True)})
    else:
        _bands(axes, times, drawn)
    return quantity if len(quantity) <= 2 else quantity.capitalize()


class Arrangement(NamedTuple):
    """A curve of the last frame, what to call it, its unit, and what it is over."""

    curve: Curve
    title: str
    unit: str
    across: str


def arrangement(trajectory: Trajectory, quantity: str, group: str | None) -> Arrangement:
    """How the particles of the last frame are arranged, those of a group alone if one is given: one of
    `series.ARRANGEMENTS`. Raises UsageError as the functions of `analysis.structure` do."""
    last, box = trajectory[-1], trajectory.box
    rows = slice(None) if group is None else last.of(group)
    x, periods = last.position[rows], (None, None, None) if box is None else box.periods
    mass = last["mass"][rows] if "mass" in last.fields else 1.0
    sizes = [np.inf if each is None else each for each in periods]
    around = None if box is None else sizes
    if quantity == "rdf":
        curve = radial_distribution(x, box=around)
        return Arrangement(curve, "Radial distribution function", "", "distance [m]")
    if quantity == "power_spectrum":
        return Arrangement(power_spectrum(x, mass, box=sizes), "Power spectrum", "m³", "wave number [1/m]")
    what, unit = ("Density", "kg/m³") if "mass" in last.fields else ("Number density", "1/m³")
    return Arrangement(
        density_profile(x, mass, box=around), what, unit, "distance from the densest place [m]"
    )


def _lines(axes: Axes, times: Any, curves: dict[str, Any], strong: str = "") -> None:
    """One line per curve; `strong` is drawn black and thicker; colours repeat dashed after the sixth."""
    marker = "o" if len(times) == 1 else ""
    for k, (name, values) in enumerate(curves.items()):
        style: dict[str, Any] = {"color": COLORS[k % len(COLORS)], "linewidth": 1.6}
        style["linestyle"] = ("-", "--", ":")[k // len(COLORS) % 3]
        if name == strong:
            style = {"color": INK, "linewidth": 2.2}
        axes.plot(times, values, label=name, marker=marker, markersize=4, **style)
    if 1 < len(curves) <= 2 * len(COLORS):
        _legend(axes)


def _bands(axes: Axes, times: Any, spread: series.Spread) -> None:
    """Median and two bands."""
    p5, p25, p50, p75, p95 = spread.values.T
    color = COLORS[0]
    axes.fill_between(times, p5, p95, color=color, alpha=0.14, linewidth=0, label="5 to 95 %")
    axes.fill_between(times, p25, p75, color=color, alpha=0.28, linewidth=0, label="25 to 75 %")
    axes.plot(times, p50, color=color, linewidth=2.0, label="median")
    _legend(axes)


def _legend(axes: Axes) -> None:
    """Beside the axes, where it never hides a line."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=9, labelcolor=INK)


def _label(axes: Axes, trajectory: Trajectory, quantity: str, title: str) -> None:
    unit = series.unit_of(quantity)
    name = title.split(" · ")[0]
    over_time = quantity not in series.ARRANGEMENTS
    if over_time:
        axes.set_xlabel("time [s]", color=INK)
        axes.set_ylabel(f"{name} [{unit}]" if unit else name, color=INK)
    axes.set_title(title, loc="left", fontsize=12, fontweight="bold", color=INK)
    axes.set_title(trajectory.path.name, loc="right", fontsize=9, color="#777777")
    axes.margins(x=0.01)
    # Differences of large numbers are read better as 9.81 than as 1e-3 + 9.8; tiny numbers keep their power.
    if axes.get_yscale() != "log":
        axes.ticklabel_format(axis="y", useOffset=False, scilimits=(-3, 5), useMathText=True)
    if quantity == "rdf":
        axes.ticklabel_format(axis="x", useOffset=False, scilimits=(-3, 5), useMathText=True)
        axes.set_xlim(left=0)
    elif over_time and np.ptp(trajectory.times) > 0:
        axes.set_xlim(float(trajectory.times.min()), float(trajectory.times.max()))
