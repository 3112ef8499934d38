"""What a check sees of the particles at a frame: one number, or the particle that is farthest from where it should be."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from particlesim.checks import Check, Initial
from particlesim.engine.simulation import Simulation, rows
from particlesim.errors import UsageError
from particlesim.forces.expression import on_arrays, reads
from particlesim.forces.operations import VARIABLES, Node
from particlesim.quantities import AXES, FIELD_QUANTITIES
from particlesim.recording import column
from particlesim.regions import inside
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory import reader
from particlesim.trajectory.fields import FIELDS

Floats = NDArray[np.float64]

SAME_TIME = 1e-9
"""A frame of a reference counts for a time that differs by this fraction of the reference's duration."""

_COLUMNS = {
    **{axis: f"position.{axis}" for axis in AXES},
    **{f"v{axis}": f"velocity.{axis}" for axis in AXES},
    "m": "mass",
    "r": "radius",
    "T": "temperature",
}
_NAMES = {type(node): name for name, node in VARIABLES.items()}


@dataclass(frozen=True)
class Seen:
    """A value, how far it is out of bounds (0 or less: within), what was expected of it, and of which particle it is."""

    value: float
    excess: float
    expected: float | None = None
    particle: int | None = None
    note: str = ""


class Selection:
    """The particles that a check looks at: those of a group, in a region."""

    def __init__(self, check: Check, scenario: Scenario) -> None:
        names = [group.name for group in scenario.groups]
        self._group = None if check.group is None else names.index(check.group)
        self._region = check.region

    def of(self, simulation: Simulation) -> NDArray[np.intp]:
        """Their rows in the columns of the present state."""
        part = slice(0, simulation.count)
        if self._group is not None:
            part = rows(simulation.states)[self._group]
        chosen = np.arange(part.start, part.stop)
        if self._region is None:
            return chosen
        return chosen[inside(self._region, values(simulation, "position")[chosen])]


def values(simulation: Simulation, quantity: str) -> Floats:
    """A field of all particles at the present state, or a component of it: shape [n] or [n, 3]."""
    name, _, axis = quantity.partition(".")
    whole = column(simulation, name, np.empty(FIELDS[name].shape(simulation.count)))
    return np.asarray(whole[:, AXES.index(axis)] if axis else whole)


class Statistic:
    """One number of the chosen particles: how many, or a statistic of a field."""

    def __init__(self, check: Check, scenario: Scenario) -> None:
        self._check = check
        self._chosen = Selection(check, scenario)
        self._node = check.expected() if check.expression is not None else None

    def at(self, simulation: Simulation) -> Seen | None:
        """What is seen at the present state; None when there is no particle to look at."""
        chosen = self._chosen.of(simulation)
        if self._check.quantity == "count":
            value = float(len(chosen))
        elif not len(chosen):
            return None
        else:
            value = _statistic(self._check, values(simulation, self._check.quantity)[chosen])
        return judged(self._check, value, self._node, simulation.time)


def judged(check: Check, value: float, node: Node | None, time: float) -> Seen:
    """One number against its bounds; `node` is an expression of the time that it is expected to follow."""
    if node is None:
        return Seen(value, check.excess(value))
    expected = float(on_arrays(node, lambda _: np.array(time)))
    return Seen(value, check.excess(value, expected), expected)


class Oracle:
    """Every chosen particle against an expression of what it has and had."""

    def __init__(self, check: Check, scenario: Scenario) -> None:
        self._check, self._node = check, check.expected()
        self._chosen = Selection(check, scenario)
        self._start: dict[str, Floats] = {}

    def begin(self, simulation: Simulation) -> None:
        """Remember the state at the start, by id: ids of particles that are there then count from 0."""
        if self._start or not reads(self._node, Initial):
            return
        order = np.argsort(values(simulation, "id"))
        for name in ("x", "y", "z", "vx", "vy", "vz"):
            self._start[name] = values(simulation, _COLUMNS[name])[order]

    def at(self, simulation: Simulation) -> Seen | None:
        """The particle that is farthest out of bounds; None when there is none to look at."""
        chosen = self._chosen.of(simulation)
        if not len(chosen):
            return None
        ids = values(simulation, "id").astype(int)[chosen]

        def variable(node: Node) -> Floats:
            if isinstance(node, Initial):
                return self._start[node.name][ids]
            name = _NAMES[type(node)]
            if name == "t":
                return np.full(len(chosen), simulation.time)
            return values(simulation, _COLUMNS[name])[chosen]

        expected = np.broadcast_to(on_arrays(self._node, variable), len(chosen))
        found = values(simulation, self._check.quantity)[chosen]
        relative = self._check.relative_tolerance or 0.0
        allowed = np.maximum(self._check.tolerance or 0.0, relative * np.abs(expected))
        with np.errstate(invalid="ignore"):
            excess = np.abs(found - expected) - allowed
        excess[np.isnan(excess)] = np.inf
        worst = int(excess.argmax())
        return Seen(
            float(found[worst]), float(excess[worst]), float(expected[worst]), particle=int(ids[worst])
        )


class Reference:
    """Every chosen particle against the one with its id in a recorded trajectory; the value is their distance."""

    def __init__(self, check: Check, scenario: Scenario) -> None:
        self._check = check
        self._chosen = Selection(check, scenario)
        self._field, _, self._axis = check.quantity.partition(".")
        path = reference_path(scenario, check)
        if not path.exists():
            raise UsageError(
                f"there is no reference {path}",
                "psim run --bless writes it, once its results are known to be right.",
            )
        self._trajectory = reader.open(path)
        if self._field not in self._trajectory.fields:
            self._trajectory.close()
            raise UsageError(
                f"the reference {path} does not hold {self._field}", "psim run --bless writes another one."
            )

    def close(self) -> None:
        """Close the file."""
        self._trajectory.close()

    def at(self, simulation: Simulation) -> Seen | None:
        """The particle that is farthest from its reference; None when there is none to look at, here or there."""
        chosen = self._chosen.of(simulation)
        there = self._trajectory
        near = SAME_TIME * (float(there.times[-1]) if len(there) else 0.0)
        if not len(there) or abs((frame := there.frame_at(simulation.time)).time - simulation.time) > near:
            return Seen(float("nan"), float("inf"), note="the reference has no frame at that time")
        ids = values(simulation, "id").astype(int)[chosen]
        if not len(ids):
            return None
        order = np.argsort(frame.id)
        place = np.searchsorted(frame.id, ids, sorter=order).clip(max=max(len(frame) - 1, 0))
        if not len(frame) or (lost := frame.id[order[place]] != ids).any():
            particle = int(ids[0] if not len(frame) else ids[lost.argmax()])
            return Seen(
                float("nan"),
                float("inf"),
                particle=particle,
                note="the reference does not have this particle",
            )
        stored = frame[self._field]
        here = values(simulation, self._field)[chosen].astype(stored.dtype).astype(float)
        expected = stored[order[place]].astype(float)
        if self._axis:
            here, expected = (v[:, AXES.index(self._axis)] for v in (here, expected))
        apart = np.abs(here - expected) if here.ndim == 1 else np.linalg.norm(here - expected, axis=1)
        apart[np.isnan(apart)] = np.inf
        worst = int(apart.argmax())
        allowed = self._check.allowance(float(np.abs(stored).max(initial=0.0)))
        return Seen(float(apart[worst]), float(apart[worst]) - allowed, particle=int(ids[worst]))


def reference_path(scenario: Scenario, check: Check) -> Path:
    """Where the reference of a check lies."""
    assert check.reference is not None
    return (scenario.folder or Path()) / check.reference


def of_particles(check: Check) -> bool:
    """Whether a check looks at single particles, not at totals."""
    return check.quantity == "count" or check.quantity in FIELD_QUANTITIES or check.of_each


def _statistic(check: Check, field: Floats) -> float:
    """One number of a field; NaN if any value is."""
    if check.statistic == "percentile":
        assert check.percentile is not None
        return float(np.percentile(field, check.percentile))
    if check.statistic == "min":
        return float(field.min())
    return float(field.max() if check.statistic == "max" else field.mean())


Observer = Statistic | Oracle | Reference


def observer(check: Check, scenario: Scenario) -> Observer | None:
    """What looks at the particles for a check; None when it looks at totals. Raises UsageError without a reference."""
    if not of_particles(check):
        return None
    if not check.of_each:
        return Statistic(check, scenario)
    return Oracle(check, scenario) if check.expression is not None else Reference(check, scenario)
