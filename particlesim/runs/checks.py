"""Checks during a run: evaluated for the state at every frame, whether it is recorded or not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from particlesim.checks.check import Check
from particlesim.checks.quantities import AXES, VECTORS, is_count
from particlesim.engine.ledger.work import total_energy
from particlesim.engine.simulation import Simulation
from particlesim.errors import PsimError
from particlesim.runs.observers import Oracle, Reference, Seen, judged, observer
from particlesim.scenario.rules.checks import check_labels, check_step
from particlesim.scenario.scenario import Scenario


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


def total(name: str, row: Mapping[str, float], energy_at_start: float) -> float:
    """A quantity of the ledger: a column, a sum of columns, the length of a vector, or the drift of the energy.

    The drift is |E − E₀| / |E₀|, infinite where an energy of 0 changes.
    """
    if name == "energy":
        return total_energy(row)
    if name in ("potential", "work"):
        return float(sum(value for key, value in row.items() if key.startswith(f"{name}.")))
    if name == "energy.drift":
        change = abs(total_energy(row) - energy_at_start)
        if energy_at_start == 0:
            return change if change != change else (float("inf") if change else 0.0)
        return change / abs(energy_at_start)
    if name in VECTORS:
        return float(np.sqrt(sum(row[f"{name}.{axis}"] ** 2 for axis in AXES)))
    return float(row.get(name, 0.0))  # a force that acts on no group stores no energy


def count(
    name: str, born: int, died: Mapping[str, int], broken: Mapping[str, tuple[int, int]], missed: int
) -> float:
    """A number of births, deaths by cause, broken springs by set, or crossings that were missed, since the beginning."""
    head, _, part = name.partition(".")
    if head == "born":
        return float(born)
    if head == "died":
        return float(died.get(part, 0) if part else sum(died.values()))
    if head == "missed_crossings":
        return float(missed)
    return float(sum(number for label, (number, _) in broken.items() if part in ("", label)))


class Checks:
    """The checks of a scenario in the course of its run; those against references are left out when `bless` writes them.

    Raises UsageError for a reference that is not there or does not hold what is compared.
    """

    def __init__(self, scenario: Scenario, *, bless: bool = False) -> None:
        self._items: list[_Item] = []
        try:
            for check, label in zip(scenario.checks, check_labels(scenario), strict=True):
                if not (bless and check.reference is not None):
                    self._items.append(_Item(check, label, scenario))
        except PsimError:
            self.close()
            raise
        self._energy: float | None = None
        """Of the first frame with particles [J]: what a burst brings later than that counts as drift."""
        self._drifts = any(check.quantity == "energy.drift" for check in scenario.checks)

    def look(
        self, simulation: Simulation, row: Mapping[str, float], born: int, died: Mapping[str, int]
    ) -> None:
        """Look at the frame of the present state; `row` is the ledger's, empty when none is kept."""
        if not self._items:
            return
        if self._energy is None and self._drifts and simulation.count:
            row = row or simulation.ledger()
            self._energy = total_energy(row)
        for item in self._items:
            if simulation.step == 0 and isinstance(item.observer, Oracle):
                item.observer.begin(simulation)
            if not item.due(simulation):
                continue
            if item.observer is not None:
                item.take(item.observer.at(simulation), simulation.time)
                continue
            name = item.check.quantity
            if is_count(name):
                value = count(name, born, died, simulation.broken(), simulation.missed_crossings())
            else:
                row = row or simulation.ledger()
                value = total(name, row, self._energy or 0.0)
            item.take(judged(item.check, value, item.node, simulation.time), simulation.time)

    def state(self) -> dict[str, Any]:
        """What they have seen so far, as plain data."""
        return {"energy": self._energy, "worst": [item.state() for item in self._items]}

    def restore(self, simulation: Simulation, state: Mapping[str, Any]) -> None:
        """Go on from a `state`; `simulation` is at its start."""
        self._energy = state["energy"]
        for item, worst in zip(self._items, state["worst"], strict=True):
            if isinstance(item.observer, Oracle):
                item.observer.begin(simulation)
            item.restore(worst)

    def results(self) -> tuple[CheckResult, ...]:
        """How the checks ended, in the order of the scenario."""
        return tuple(item.result() for item in self._items)

    def close(self) -> None:
        """Close the files of references."""
        for item in self._items:
            if isinstance(item.observer, Reference):
                item.observer.close()


class _Item:
    """One check, and the worst that it has seen so far."""

    def __init__(self, check: Check, label: str, scenario: Scenario) -> None:
        self.check, self.label = check, label
        self.observer = observer(check, scenario)
        self.node = check.expected() if check.expression is not None and self.observer is None else None
        self._step: int | None = None  # None: every frame
        if check.at == "end":
            self._step = scenario.grid.steps
        elif not isinstance(check.at, str):
            self._step = check_step(scenario.grid, check.at)
        self._worst: tuple[Seen, float] | None = None
        if isinstance(self.observer, Reference) and self.observer.lacking is not None:
            note = "the run has no frame, the reference has one"
            self.take(Seen(float("nan"), float("inf"), note=note), self.observer.lacking)

    def due(self, simulation: Simulation) -> bool:
        """Whether the present frame counts."""
        return self._step is None or simulation.step == self._step

    def take(self, seen: Seen | None, time: float) -> None:
        """Keep the worst. A moment without particles breaks no bound that is asked for always."""
        if seen is None:
            if self._step is None:
                return
            seen = Seen(float("nan"), float("inf"))
        if self._worst is None or seen.excess > self._worst[0].excess:
            self._worst = (seen, time)

    def state(self) -> list[Any] | None:
        """The worst so far, as plain data."""
        return None if self._worst is None else [asdict(self._worst[0]), self._worst[1]]

    def restore(self, state: list[Any] | None) -> None:
        """Go on from a `state`."""
        self._worst = None if state is None else (Seen(**state[0]), float(state[1]))

    def result(self) -> CheckResult:
        """How it ended."""
        check = self.check
        message = f"{self.label}: there was no particle at any time"
        missing = CheckResult(self.label, check.quantity, False, float("nan"), check.bound(), None, message)
        if self._worst is None:
            return missing
        seen, time = self._worst
        passed = seen.excess <= 0
        message = f"{self.label} {'is' if passed else 'is not'} {check.bound()}: {_shown(seen, check)}"
        message += f" at t = {time:.9g} s"
        if seen.value != seen.value and self.observer is not None and not seen.note:
            message += " (no particle, or not a number)"
        if check.quantity == "energy.drift" and math.isinf(seen.value):
            message += (
                " (there was no energy at the start, of which a drift is a part: check energy, in joules)"
            )
        return replace(missing, passed=passed, value=seen.value, time=time, message=message)


def _shown(seen: Seen, check: Check) -> str:
    """What was seen, in words: '0.3 off for particle 2', '4 instead of 5 for particle 2'."""
    if seen.note:
        return seen.note
    value = f"{seen.value:.9g}" + (" off" if check.reference is not None else "")
    value += f" instead of {seen.expected:.9g}" if seen.expected is not None else ""
    return value + (f" for particle {seen.particle}" if seen.particle is not None else "")
