"""What a check measures at a frame: one number, or the particle that is farthest from where it should be."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.checks.check import Check, Initial
from particlesim.checks.quantities import AXES, FIELD_QUANTITIES, axes_of
from particlesim.engine.simulation import Simulation
from particlesim.engine.world import rows
from particlesim.errors import UsageError
from particlesim.expressions.operations import VARIABLES, Node
from particlesim.expressions.parser import on_arrays, reads
from particlesim.model.arrays import Floats
from particlesim.model.attributes import ATTRIBUTES
from particlesim.runs.frames import column
from particlesim.sampling.regions import inside
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.timegrid import TimeGrid
from particlesim.trajectory.fields import FIELDS
from particlesim.trajectory.frame import Frame

MOST_NAMED = 3
"""Lost particles that a message names."""
SAME_TIME = 1e-9
"""A frame of a reference counts for a time that differs by this fraction of the reference's duration."""

_COLUMNS = {
    **{axis: f"position.{axis}" for axis in AXES},
    **{f"v{axis}": f"velocity.{axis}" for axis in AXES},
    **{each.symbol: each.name for each in ATTRIBUTES.values()},
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
        chosen = self.of_group(simulation)
        if self._region is None:
            return chosen
        places = column(simulation, "position", np.empty((simulation.count, 3)))
        return chosen[inside(self._region, places[chosen])]

    def of_group(self, simulation: Simulation) -> NDArray[np.intp]:
        """Rows of the particles of the group, in the region or not."""
        part = slice(0, simulation.count)
        if self._group is not None:
            part = rows(simulation.states)[self._group]
        return np.arange(part.start, part.stop)


def values(simulation: Simulation, quantity: str) -> Floats:
    """A field of all particles at the present state, or a component of it: shape [n] or [n, 3]; positions along the path."""
    name, _, axis = quantity.partition(".")
    if name == "position" and simulation.scenario.simulation.box is not None:
        whole = np.concatenate([state.position.astype(float) for state in simulation.states])
    else:
        whole = column(simulation, name, np.empty(FIELDS[name].shape(simulation.count)))
    return np.asarray(whole[:, axes_of(name).index(axis)] if axis else whole)


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
        with np.errstate(invalid="ignore"):  # what is not finite fails below
            allowed = np.maximum(self._check.tolerance or 0.0, relative * np.abs(expected))
            excess = np.abs(found - expected) - allowed
        excess[np.isnan(excess)] = np.inf
        worst = int(excess.argmax())
        return Seen(
            float(found[worst]), float(excess[worst]), float(expected[worst]), particle=int(ids[worst])
        )


class Reference:
    """Every chosen particle against the one with its id in a recorded trajectory; the value is their distance.

    Particles and frames that only one of both has are as far off as can be.
    """

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
        # Not before: it brings h5py, which a run without references and outputs does without.
        from particlesim.trajectory import reader

        self._trajectory = reader.open(path)
        if self._field not in self._trajectory.fields:
            raise self._unfit(path, self._field)
        if check.group is not None and check.group not in self._trajectory.groups:
            raise self._unfit(path, f"the group {check.group}")
        times = self._trajectory.times
        self._near = SAME_TIME * (float(times[-1]) if len(times) else 0.0)
        self.lacking = self._lacking(scenario.grid)
        """Time of the first frame to be compared [s] that the reference has, and the run will not have."""

    def _unfit(self, path: Path, what: str) -> UsageError:
        self._trajectory.close()
        return UsageError(
            f"the reference {path} does not hold {what}", "psim run --bless writes another one."
        )

    def _lacking(self, grid: TimeGrid) -> float | None:
        times = self._trajectory.times
        if self._check.at == "end":
            times = times[-1:]
        elif self._check.at != "always":
            return None
        steps = np.minimum(np.rint(times / (grid.every * grid.dt)) * grid.every, grid.steps)
        apart = np.minimum(np.abs(times - steps * grid.dt), np.abs(times - grid.duration))
        lost = times[apart > self._near]
        return float(lost[0]) if len(lost) else None

    def close(self) -> None:
        """Close the file."""
        self._trajectory.close()

    def at(self, simulation: Simulation) -> Seen | None:
        """The particle that is farthest from its reference; None when there is none to look at, neither here nor there."""
        there = self._trajectory
        if (
            not len(there)
            or abs((frame := there.frame_at(simulation.time)).time - simulation.time) > self._near
        ):
            return _nowhere("the reference has no frame")
        group = self._chosen.of_group(simulation)
        ids = values(simulation, "id").astype(int)
        known = frame.id if self._check.group is None else frame.id[frame.of(self._check.group)]
        wanted = np.union1d(ids[self._chosen.of(simulation)], known[self._inside(frame, known)])
        if (lost := np.setdiff1d(wanted, known)).size:
            return _nowhere(f"the reference does not have {_particles(lost)}")
        if (lost := np.setdiff1d(wanted, ids[group])).size:
            return _nowhere(f"the run does not have {_particles(lost)} of the reference")
        return self._farthest(simulation, frame, wanted, ids) if len(wanted) else None

    def _inside(self, frame: Frame, known: NDArray[Any]) -> NDArray[np.bool_]:
        """Which of these particles of a frame lie in the region of the check."""
        if self._check.region is None:
            return np.ones(len(known), np.bool_)
        return inside(self._check.region, frame.position[_places(frame.id, known)].astype(float))

    def _farthest(
        self, simulation: Simulation, frame: Frame, wanted: NDArray[Any], ids: NDArray[Any]
    ) -> Seen:
        stored = frame.unwrapped if self._field == "position" else frame[self._field]
        here = values(simulation, self._field)[_places(ids, wanted)].astype(stored.dtype).astype(float)
        expected = stored[_places(frame.id, wanted)].astype(float)
        if self._axis:
            here, expected = (v[:, axes_of(self._field).index(self._axis)] for v in (here, expected))
        apart = np.abs(here - expected) if here.ndim == 1 else np.linalg.norm(here - expected, axis=1)
        apart[np.isnan(apart)] = np.inf
        worst = int(apart.argmax())
        allowed = self._check.allowance(float(np.abs(stored).max(initial=0.0)))
        return Seen(float(apart[worst]), float(apart[worst]) - allowed, particle=int(wanted[worst]))


def _nowhere(note: str) -> Seen:
    return Seen(float("nan"), float("inf"), note=note)


def _particles(ids: NDArray[Any]) -> str:
    """'particle 3', or 'particles 3, 5, 8 and 97 more'."""
    shown = ", ".join(str(i) for i in ids[:MOST_NAMED].tolist())
    more = f" and {len(ids) - MOST_NAMED:,} more" if len(ids) > MOST_NAMED else ""
    return f"particle{'s' if len(ids) > 1 else ''} {shown}{more}"


def _places(ids: NDArray[Any], wanted: NDArray[Any]) -> NDArray[np.intp]:
    """Where the wanted ids, all of which are there, stand among `ids`."""
    order = np.argsort(ids)
    return np.asarray(order[np.searchsorted(ids, wanted, sorter=order)])


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
