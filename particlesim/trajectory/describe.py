"""What is inside a trajectory file, as plain data: the content of `psim inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.trajectory.fields import FIELDS, ledger_unit
from particlesim.trajectory.reader import Trajectory
from particlesim.trajectory.summary import recorded_checks


def describe(path: Path) -> dict[str, Any]:
    """A summary of the trajectory `path` made of dicts, lists, numbers and text (it can be written as JSON).

    Keys: path, status, size [bytes], bytes_per_particle_frame, precision, frames, time (first, last, [s]),
    steps (first, last), particles (first, last, min, max), fields (unit, components, min and max of the last
    frame), groups (particles in the last frame; None if not recorded), ledger (unit, first, last, drift =
    last − first, relative drift), events (births, deaths), summary (with results of
    checks), provenance. Minimum, maximum and the like
    are None where there is nothing or not a finite number. Raises UsageError as `reader.open` does.
    """
    path = Path(path)
    with Trajectory(path) as trajectory:
        size = path.stat().st_size
        rows = int(trajectory.counts.sum())
        return {
            "path": str(path),
            "status": trajectory.status,
            "size": size,
            "bytes_per_particle_frame": size / rows if rows else None,
            "precision": trajectory.precision,
            "frames": len(trajectory),
            "time": _ends(trajectory.times),
            "steps": _ends(trajectory.steps),
            "particles": {**_ends(trajectory.counts), **_range(trajectory.counts)},
            "fields": _fields(trajectory),
            "groups": _groups(trajectory),
            "ledger": {name: _ledger(name, values) for name, values in trajectory.ledger.items()},
            "events": {f"{kind}s": len(trajectory.events(kind)["id"]) for kind in ("birth", "death")},
            "summary": _summary(trajectory),
            "provenance": dict(trajectory.provenance),
        }


def _summary(trajectory: Trajectory) -> dict[str, Any]:
    """What the file tells of the run; results of checks, which are stored as JSON, as data."""
    told = dict(trajectory.summary)
    if "checks" in told:
        told["checks"] = recorded_checks(told, trajectory.path)
    return told


def _ends(values: npt.NDArray[Any]) -> dict[str, int | float | None]:
    if not len(values):
        return {"first": None, "last": None}
    return {"first": _number(values[0]), "last": _number(values[-1])}


def _range(values: npt.NDArray[Any]) -> dict[str, Any]:
    """Smallest and largest value; per component for vectors."""
    if not len(values):
        return {"min": None, "max": None}
    low, high = values.min(axis=0), values.max(axis=0)
    if values.ndim == 1:
        return {"min": _number(low), "max": _number(high)}
    return {"min": [_number(v) for v in low], "max": [_number(v) for v in high]}


def _number(value: np.generic) -> int | float | None:
    """As Python's own number; None for NaN and infinities, which JSON cannot say."""
    number: int | float = value.item()
    return number if np.isfinite(number) else None


def _fields(trajectory: Trajectory) -> dict[str, dict[str, Any]]:
    last = trajectory[-1] if len(trajectory) else None
    return {
        name: {
            "unit": FIELDS[name].unit,
            "components": FIELDS[name].components,
            **_range(np.empty(0) if last is None else last[name]),
        }
        for name in trajectory.fields
    }


def _groups(trajectory: Trajectory) -> dict[str, int | None]:
    if not len(trajectory) or ("group" not in trajectory.fields and len(trajectory.groups) != 1):
        return dict.fromkeys(trajectory.groups)
    last = trajectory[-1]
    return {group: int(last.of(group).sum()) for group in trajectory.groups}


def _ledger(name: str, values: npt.NDArray[np.float64]) -> dict[str, Any]:
    ends = _ends(values)
    first, last = ends["first"], ends["last"]
    drift = None if first is None or last is None else last - first
    relative = None if drift is None or not first else drift / abs(first)
    return {"unit": ledger_unit(name), **ends, "drift": drift, "relative_drift": relative}
