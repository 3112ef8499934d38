"""One run of a sweep, as a worker does it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from particlesim.checks.quantities import is_count
from particlesim.errors import (
    DivergenceError,
    InputOutputError,
    Interrupted,
    PsimError,
    ResourceError,
    UsageError,
)
from particlesim.runs.checks import count, total
from particlesim.runs.runner import Result, run
from particlesim.scenario.ledger_columns import totals
from particlesim.scenario.load import scenario_of
from particlesim.scenario.named_files import (
    dump_for,
    file_digest,
    layout_files,
    reference_files,
    shape_files,
)
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.overrides import Override, overrides_from_mapping
from particlesim.scenario.text.source import Source
from particlesim.sweep.design import Design
from particlesim.sweep.files import RESULT, SCENARIO, TRAJECTORY, run_folder, write_atomically, write_json
from particlesim.sweep.outcome import Outcome, Status


@dataclass(frozen=True)
class Task:
    """Everything that the runs of a sweep have in common; called with the number of a run, from 1, it does that run.

    `source` is the scenario, `settings` what is set for all runs, `home` the folder that its relative paths start from.
    Every run is done by one thread, and leaves its scenario and its result in a folder of its own below `output`.
    """

    source: Source
    settings: tuple[Override, ...]
    home: Path | None
    design: Design
    output: Path
    record: bool = False

    def scenario(self, number: int) -> Scenario:
        """The scenario of a run. Raises ScenarioError."""
        varied = overrides_from_mapping(self.design.settings(number - 1))
        return scenario_of(self.source, (*self.settings, *varied), self.home)

    def __call__(self, number: int) -> Outcome:
        folder = run_folder(self.output, number, len(self.design))
        began = time.perf_counter()
        files: dict[str, str] = {}
        try:
            folder.mkdir(exist_ok=True)
            scenario = self.scenario(number)
            files |= named_digests(scenario)
            outcome = self._run(number, scenario, folder, began)
        except Interrupted:
            raise
        except (PsimError, MemoryError, OSError) as error:
            outcome = self.ended(number, _status(error), _cause(error), time.perf_counter() - began)
        outcome = replace(outcome, files=files)
        try:
            write_json(folder / RESULT, outcome.as_data())
        except OSError as error:
            cause = f"the result cannot be written: {error.strerror or error}"
            return self.ended(number, "failed", cause, outcome.seconds)
        return outcome

    def ended(self, number: int, status: Status, cause: str, seconds: float = 0.0) -> Outcome:
        """The outcome of a run without a result."""
        return Outcome(number, self.design.settings(number - 1), status, cause, seconds)

    def _run(self, number: int, scenario: Scenario, folder: Path, began: float) -> Outcome:
        write_atomically(folder / SCENARIO, dump_for(scenario, folder))
        trajectory = folder / TRAJECTORY if self.record else None
        result = run(scenario, trajectory, overwrite=True, threads=1)
        failed = [check.message for check in result.checks if not check.passed]
        return Outcome(
            number,
            self.design.settings(number - 1),
            "check_failed" if failed else "done",
            "; ".join(failed),
            time.perf_counter() - began,
            final_quantities(result),
            {check.name: _finite(check.value) for check in result.checks},
            result.state,
        )


def named_digests(scenario: Scenario) -> dict[str, str]:
    """Digests of the files that a scenario names, by those names; empty for what cannot be read."""
    return {
        file.name: present_digest(file.path)
        for file in (
            *layout_files(scenario),
            *shape_files(scenario),
            *reference_files(scenario),
        )
    }


def present_digest(path: Path) -> str:
    """The digest of a file as it is, empty if it cannot be read; one that looks unchanged is not read again."""
    try:
        state = path.stat()
        return _digest(path, (state.st_mtime_ns, state.st_size, state.st_ino))
    except (UsageError, OSError, ValueError):
        return ""


@lru_cache(maxsize=256)
def _digest(path: Path, state: tuple[int, ...]) -> str:
    return file_digest(path)


def final_quantities(result: Result) -> dict[str, float | None]:
    """Totals at the end of a run, by name; without a ledger only counts."""
    known = totals(result.scenario)
    found: dict[str, float | None] = {"count": len(result.final)}
    for name in known:
        if name != "count" and is_count(name):
            found[name] = int(count(name, result.born, result.died, result.broken, result.missed_crossings))
    if result.ledger:
        last = {name: float(values[-1]) for name, values in result.ledger.items()}
        start = float(result.energy[0])
        for name in known:
            if name not in found:
                found[name] = _finite(total(name, last, start))
    return found


def _status(error: BaseException) -> Status:
    if isinstance(error, DivergenceError):
        return "diverged"
    if isinstance(error, UsageError) and not isinstance(error, ResourceError):
        return "bad_scenario"
    return "failed"


def _cause(error: Any) -> str:
    if isinstance(error, MemoryError):
        return "out of memory"
    if isinstance(error, OSError) and not isinstance(error, InputOutputError):
        return str(error.strerror or error)
    return str(error.message).splitlines()[0]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
