"""Quantities of a trajectory over time: ledger sums and components of particles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.trajectory.fields import FIELDS, component, component_names, ledger_unit, unknown_name
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.reader import Trajectory

Series = npt.NDArray[np.float64]

LEDGER_QUANTITIES = ("energy", "momentum", "angular_momentum", "count", "drift")
ARRANGEMENTS = ("rdf", "density_profile", "power_spectrum")
"""How the particles of the last frame are arranged: radial distribution, density around the densest place, density waves."""
TOGETHER = ("displacement", "kinetic_temperature", *ARRANGEMENTS)
"""Quantities of all particles, or of a group, together; the first is the mean square displacement."""
FEW = 12
PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)


@dataclass(frozen=True)
class Tracks:
    """One quantity of single particles: `values` [frames, particles], NaN where a particle does not exist."""

    ids: tuple[int, ...]
    values: Series


@dataclass(frozen=True)
class Spread:
    """One quantity of many particles: `values` [frames, percentiles], NaN in frames without particles."""

    values: Series
    percentiles: tuple[float, ...] = PERCENTILES


def quantities(trajectory: Trajectory) -> tuple[str, ...]:
    """Every name that can be plotted from this file."""
    particles = [name for field in trajectory.fields for name in component_names(field)]
    if "velocity" in trajectory.fields:
        particles.append("speed")
    known = [name for name in LEDGER_QUANTITIES if name == "count" or trajectory.ledger]
    known += ["pressure"] if "pressure" in trajectory.ledger else []
    return tuple(dict.fromkeys((*known, *TOGETHER, *particles)))


def energies(trajectory: Trajectory) -> dict[str, Series]:
    """Kinetic energy, every potential energy, and their sum "total" [J], each [frames].

    Raises UsageError when the file has no energies.
    """
    parts = {
        name: values
        for name, values in trajectory.ledger.items()
        if name == "kinetic" or name.split(".")[0] == "potential"
    }
    if not parts:
        raise _not_in_ledger("energy")
    # A sum over no frames is still an array, hence the start.
    return {**parts, "total": sum(parts.values(), np.zeros(len(trajectory)))}


def relative_energy_drift(trajectory: Trajectory) -> Series:
    """(E − E₀) / max |Eₖ|, where E is the total energy, E₀ its first value, Eₖ it and its parts, [frames].

    Divided by the largest energy seen, kinetic, potential or total, and not by E₀, which is zero in many a
    system (a free fall from rest at height zero, say). Raises UsageError when the file has no energies.
    """
    parts = energies(trajectory)
    total = parts["total"]
    largest = max((float(np.max(np.abs(values), initial=0.0)) for values in parts.values()), default=0.0)
    return (total - total[:1]) / largest if largest else np.zeros_like(total)


def vector(trajectory: Trajectory, name: str) -> dict[str, Series]:
    """The components of "momentum" or "angular_momentum" by axis, each [frames].

    Raises UsageError when the ledger lacks them.
    """
    parts = {
        column.split(".", 1)[1]: values
        for column, values in trajectory.ledger.items()
        if column.startswith(f"{name}.")
    }
    if not parts:
        raise _not_in_ledger(name)
    return parts


def of_particles(
    trajectory: Trajectory, quantity: str, *, ids: Sequence[int] | None = None, group: str | None = None
) -> Tracks | Spread:
    """A component of particles over time: single ones when `ids` names them or there are few, else
    percentiles.

    quantity: a short name such as "x", "vy", "speed", "temperature". group: only particles of that group.
    Raises UsageError for an unknown quantity, group or id.
    """
    if quantity not in quantities(trajectory) or (component(quantity) is None):
        raise unknown_name("quantity", quantity, quantities(trajectory))
    if group is not None and group not in trajectory.groups:
        raise unknown_name("group", group, trajectory.groups)
    chosen = tuple(dict.fromkeys(ids)) if ids is not None else _few_ids(trajectory, group)
    if chosen is None:
        return Spread(np.array([_percentiles(frame, quantity, group) for frame in trajectory]))
    tracks = np.full((len(trajectory), len(chosen)), np.nan)
    for frame, row in zip(trajectory, tracks, strict=True):
        order = np.argsort(frame.id, kind="stable")
        place = np.searchsorted(frame.id, chosen, sorter=order)
        inside = place < len(frame)
        rows = order[place[inside]]
        found = frame.id[rows] == np.array(chosen, np.int64)[inside]
        if group is not None:
            found &= frame.of(group)[rows]
        row[np.flatnonzero(inside)[found]] = component_of(frame, quantity)[rows[found]]
    if ids is not None and (lost := [i for i, v in zip(chosen, tracks.T, strict=True) if np.isnan(v).all()]):
        raise UsageError(f"no particle has the id {', '.join(map(str, lost))}", "Ids count from 0.")
    return Tracks(chosen, tracks)


def component_of(frame: Frame, quantity: str) -> npt.NDArray[Any]:
    """A short-named quantity ("x", "vy", "speed") of all particles of a frame, [n]."""
    if quantity == "speed" and "speed" not in frame.fields:
        speed: npt.NDArray[Any] = np.sqrt(np.sum(np.square(frame["velocity"], dtype=np.float64), axis=1))
        return speed
    found = component(quantity)
    if found is None:
        raise unknown_name("quantity", quantity, frame.fields)
    field, axis = found
    return frame[field] if axis is None else frame[field][:, axis]


def unit_of(quantity: str) -> str:
    """SI unit of anything that `quantities` names; "" for pure numbers."""
    if quantity == "displacement":
        return "m²"
    if quantity == "kinetic_temperature":
        return "K"
    if (found := component(quantity)) is not None:
        return FIELDS[found[0]].unit
    return ledger_unit(quantity)


def _few_ids(trajectory: Trajectory, group: str | None) -> tuple[int, ...] | None:
    """The ids of all particles that ever lived, or None when they are more than FEW."""
    seen: set[int] = set()
    for frame in trajectory:
        if group is None and len(frame) > FEW:
            return None
        seen.update((frame.id if group is None else frame.id[frame.of(group)]).tolist())
        if len(seen) > FEW:
            return None
    return tuple(sorted(seen))


def _percentiles(frame: Frame, quantity: str, group: str | None) -> Series:
    values = component_of(frame, quantity)
    if group is not None:
        values = values[frame.of(group)]
    if not len(values):
        return np.full(len(PERCENTILES), np.nan)
    result: Series = np.percentile(values, PERCENTILES)
    return result


def _not_in_ledger(name: str) -> UsageError:
    return UsageError(
        f"the trajectory has no {name.replace('_', ' ')}", "Record it: ledger = true under [output]."
    )
