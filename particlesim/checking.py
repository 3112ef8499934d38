"""Checks, looked at while a run goes on: at every frame the present state, whether it is recorded or not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.checks import AXES, FIELD_QUANTITIES, VECTORS, Check
from particlesim.engine.simulation import Simulation, rows
from particlesim.recording import column
from particlesim.scenario.agreement import check_labels, check_step
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.fields import FIELDS


@dataclass(frozen=True)
class CheckResult:
    """How a check ended: the worst value, what was allowed, and the time of that value [s] (None: never looked at)."""

    name: str
    quantity: str
    passed: bool
    value: float
    bound: str
    time: float | None
    message: str

    def as_data(self) -> dict[str, Any]:
        """As plain data, for JSON; a value that is not finite, which JSON cannot say, is None."""
        return {**asdict(self), "value": self.value if math.isfinite(self.value) else None}


def total_energy(row: Mapping[str, float]) -> float:
    """Kinetic plus all potential energy of a row of the ledger [J]."""
    return float(sum(value for key, value in row.items() if key == "kinetic" or key.startswith("potential.")))


def total(name: str, row: Mapping[str, float], energy_at_start: float) -> float:
    """A quantity of the ledger: a column, a sum of columns, the length of a vector, or the drift of the energy.

    The drift is |E − E₀| / |E₀|, infinite where an energy of 0 changes.
    """
    if name == "energy":
        return total_energy(row)
    if name == "potential":
        return float(sum(value for key, value in row.items() if key.startswith("potential.")))
    if name == "energy.drift":
        change = abs(total_energy(row) - energy_at_start)
        if energy_at_start == 0:
            return change if change != change else (float("inf") if change else 0.0)
        return change / abs(energy_at_start)
    if name in VECTORS:
        return float(np.sqrt(sum(row[f"{name}.{axis}"] ** 2 for axis in AXES)))
    return float(row.get(name, 0.0))  # a force that acts on no group stores no energy


class Checks:
    """The checks of a scenario in the course of its run."""

    def __init__(self, scenario: Scenario) -> None:
        self._items = [
            _Item(check, label, scenario)
            for check, label in zip(scenario.checks, check_labels(scenario), strict=True)
        ]
        self._energy: float | None = None
        self._drifts = any(check.quantity == "energy.drift" for check in scenario.checks)

    def look(self, simulation: Simulation, row: Mapping[str, float], born: int, died: int) -> None:
        """Look at the frame of the present state; `row` is the ledger's, empty when none is kept."""
        if not self._items:
            return
        if self._energy is None and self._drifts:
            row = row or simulation.ledger()
            self._energy = total_energy(row)
        counts = {"born": float(born), "died": float(died)}
        for item in self._items:
            if item.due(simulation):
                if item.check.quantity in counts:
                    value: float | None = counts[item.check.quantity]
                elif item.of_particles:
                    value = item.statistic(simulation)
                else:
                    row = row or simulation.ledger()
                    value = total(item.check.quantity, row, self._energy or 0.0)
                item.judge(value, simulation.time)

    def results(self) -> tuple[CheckResult, ...]:
        """How the checks ended, in the order of the scenario."""
        return tuple(item.result() for item in self._items)


class _Item:
    """One check, and the worst value so far."""

    def __init__(self, check: Check, label: str, scenario: Scenario) -> None:
        self.check, self.label = check, label
        self.of_particles = check.quantity == "count" or check.quantity in FIELD_QUANTITIES
        self._step: int | None = None  # None: every frame
        if check.at == "end":
            self._step = scenario.grid.steps
        elif not isinstance(check.at, str):
            self._step = check_step(scenario.grid, check.at)
        names = [group.name for group in scenario.groups]
        self._group = None if check.group is None else names.index(check.group)
        self._worst: tuple[float, float, float] | None = None

    def due(self, simulation: Simulation) -> bool:
        """Whether the present frame counts."""
        return self._step is None or simulation.step == self._step

    def statistic(self, simulation: Simulation) -> float | None:
        """The value at the present frame; None when there is no particle to look at."""
        parts = rows(simulation.states)
        part = slice(0, simulation.count) if self._group is None else parts[self._group]
        if self.check.quantity == "count":
            return float(part.stop - part.start)
        name, _, axis = self.check.quantity.partition(".")
        values = column(simulation, name, np.empty(FIELDS[name].shape(simulation.count)))[part]
        if axis:
            values = values[:, AXES.index(axis)]
        return None if not len(values) else _statistic(self.check, values)

    def judge(self, value: float | None, time: float) -> None:
        """Keep the worst value. A moment without particles breaks no bound that is asked for always."""
        if value is None:
            if self._step is None:
                return
            value = float("nan")
        excess = self.check.excess(value)
        if self._worst is None or excess > self._worst[0]:
            self._worst = (excess, value, time)

    def result(self) -> CheckResult:
        """How it ended."""
        check = self.check
        message = f"{self.label}: there was no particle at any time"
        missing = CheckResult(self.label, check.quantity, False, float("nan"), check.bound(), None, message)
        if self._worst is None:
            return missing
        excess, value, time = self._worst
        passed = excess <= 0
        relation = "is" if passed else "is not"
        message = f"{self.label} {relation} {check.bound()}: {value:.9g} at t = {time:.9g} s"
        if value != value and self.of_particles:
            message += " (no particle, or not a number)"
        return replace(missing, passed=passed, value=value, time=time, message=message)


def _statistic(check: Check, values: NDArray[np.float64]) -> float:
    """One number of a field; NaN if any value is."""
    if check.statistic == "percentile":
        assert check.percentile is not None
        return float(np.percentile(values, check.percentile))
    if check.statistic == "min":
        return float(values.min())
    return float(values.max() if check.statistic == "max" else values.mean())
