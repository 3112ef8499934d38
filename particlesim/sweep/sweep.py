"""A sweep: many runs of one scenario with different values, and one table of what came out."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from particlesim.checks.quantities import is_count
from particlesim.errors import InputOutputError, Interrupted, ScenarioError, UsageError
from particlesim.model.spelling import did_you_mean
from particlesim.process.signals import held_signals
from particlesim.process.threads import available_cores
from particlesim.scenario.ledger_columns import booked, totals
from particlesim.scenario.load import Overrides, parse_overrides, scenario_of
from particlesim.scenario.rules.checks import check_labels
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.migration import migrated
from particlesim.scenario.text.overrides import Override, apply_overrides, resolve_path
from particlesim.scenario.text.source import Source, read_source
from particlesim.sweep.design import Design
from particlesim.sweep.executor import Executor, InProcess, LocalWorkers
from particlesim.sweep.files import PARQUET, TABLE, alone, finished, prepare, run_folder, write_atomically
from particlesim.sweep.outcome import EXIT_CODES, Outcome
from particlesim.sweep.table import Table, write_parquet
from particlesim.sweep.task import Task, present_digest
from particlesim.version import __version__

TABLE_EVERY = 5.0
"""Seconds between writings of the table while runs go on."""
FAILURES_KEPT = 20


@dataclass(frozen=True)
class SweepProgress:
    """How far a sweep is: runs that have ended, in all, of them in an earlier sitting, not as wished; wall time [s]."""

    ended: int
    total: int
    earlier: int
    failures: int
    elapsed: float

    @property
    def rate(self) -> float:
        """Runs per second of this sitting."""
        return (self.ended - self.earlier) / self.elapsed if self.elapsed > 0 else 0.0


@dataclass
class SweepResult:
    """What a sweep leaves: its table, how many runs ended how, and the first that did not end well."""

    folder: Path
    table: Path
    total: int
    earlier: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    failures: list[Outcome] = field(default_factory=list)
    seconds: float = 0.0
    interrupted: bool = False
    parquet: Path | None = None
    """The same table as Parquet, where pyarrow is installed."""

    @property
    def ended(self) -> int:
        """Runs that have ended, well or not."""
        return sum(self.counts.values())

    @property
    def exit_code(self) -> int:
        """130 when it was interrupted, else that of the worst run."""
        if self.interrupted:
            return 130
        return max((code for status, code in EXIT_CODES.items() if self.counts[status]), default=0)

    def add(self, outcome: Outcome) -> None:
        """Count a run."""
        self.counts[outcome.status] += 1
        if outcome.status != "done" and len(self.failures) < FAILURES_KEPT:
            self.failures.append(outcome)


class Sweep:
    """A scenario file, what is set for all runs, and what is varied.

    Everything is checked here, before anything runs. Raises UsageError or ScenarioError for a scenario that is wrong in
    itself, a key that does not exist, a quantity that there is not; a value that only some runs reject is found later,
    by those runs.
    """

    def __init__(
        self,
        scenario: str | Path,
        design: Design,
        *,
        overrides: Overrides | None = None,
        quantities: Sequence[str] = (),
        record: bool = False,
    ) -> None:
        path = Path(scenario)
        settings = parse_overrides(overrides)
        source = read_source(path)
        scenario_of(source, settings, path.resolve().parent)
        self.design = design
        self._task = Task(source, settings, path.resolve().parent, design, Path(), record)
        typical = self._first_valid()
        _check_set(source, settings, design)
        self._columns = _columns(typical, quantities)
        self._checks = check_labels(typical)
        self._definition = {
            "psim": __version__,
            "scenario": source.main.text,
            "set": [setting.text for setting in settings],
            "vary": [{"kind": type(axis).__name__, **asdict(axis)} for axis in design.axes],
            "zip": design.zipped,
            "samples": design.samples,
            "method": design.method,
            "seed": design.seed,
            "record": record,
            "runs": len(design),
        }

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of the table that may hold numbers: what is varied, quantities, checks, seconds."""
        checks = (f"check {name}" for name in self._checks)
        return (*self.design.keys, *self._columns, *checks, "seconds")

    def _first_valid(self) -> Scenario:
        """A scenario of the sweep. If the first, the middle and the last are all wrong, the mistake is in the sweep."""
        first: ScenarioError | None = None
        for number in dict.fromkeys((1, 1 + len(self.design) // 2, len(self.design))):
            try:
                return self._task.scenario(number)
            except ScenarioError as error:
                first = first or error
        assert first is not None
        raise first

    def run(
        self,
        folder: str | Path,
        *,
        workers: int | None = None,
        executor: Executor | None = None,
        fail_fast: bool = False,
        force: bool = False,
        progress: Callable[[SweepProgress], None] | None = None,
    ) -> SweepResult:
        """Do all runs that have not been done yet; their results go to `folder`, the table to its results.csv.

        `workers` bounds the processes (all cores unless given), `executor` takes their place. With `fail_fast` no run
        begins after one that did not end well, in this call or an earlier one. Results depend on neither. Ctrl-C ends the
        sweep: the result says so, and the same call goes on from there.

        Raises UsageError when the folder holds another sweep, or runs with files that have changed since (unless `force`,
        which removes its runs), is one in which another process sweeps, or cannot be written; InputOutputError when the
        table cannot be written.
        """
        folder = Path(folder)
        if workers is not None and workers < 1:
            raise UsageError(
                f"{workers} workers cannot run anything", "Give 1 or more, or none for all cores."
            )
        with alone(folder):
            prepare(folder, self._definition, len(self.design), force=force)
            sitting = _Sitting(self, folder.resolve(), progress)
            todo = sitting.recall(fail_fast=fail_fast)
            if executor is None:
                count = min(workers or available_cores(), max(len(todo), 1))
                executor = LocalWorkers(count) if count > 1 else InProcess()
            return sitting.work(executor, todo, fail_fast)


class _Sitting:
    """One call of `Sweep.run`."""

    def __init__(self, sweep: Sweep, folder: Path, progress: Callable[[SweepProgress], None] | None) -> None:
        self._total = len(sweep.design)
        self._task = replace(sweep._task, output=folder)
        self._table = Table(sweep.design.keys, sweep._columns, sweep._checks)
        self._result = SweepResult(folder, folder / TABLE, self._total)
        self._progress = progress
        self._began = time.perf_counter()
        self._table_due = self._began + TABLE_EVERY

    def recall(self, *, fail_fast: bool) -> Sequence[int]:
        """Take over the runs done earlier; returns those to be done: the others, none if `fail_fast` and one ended badly."""
        todo = []
        there = {child.name for child in self._result.folder.iterdir()}
        for number in range(1, self._total + 1):
            known = run_folder(self._result.folder, number, self._total).name in there
            outcome = finished(self._result.folder, number, self._total) if known else None
            if outcome is None or not self._holds(outcome):
                todo.append(number)
            else:
                self._take(outcome)
        self._result.earlier = self._result.ended
        return [] if fail_fast and self._result.failures else todo

    def _holds(self, outcome: Outcome) -> bool:
        """Whether a run is to be kept; one whose files were wrong, and are others now, is not.

        Raises UsageError for a run that ended with files that have changed since.
        """
        for name, digest in outcome.files.items():
            path = (self._task.home or Path()) / name
            if present_digest(path) == digest:
                continue
            if outcome.status == "bad_scenario":
                return False
            raise UsageError(
                f"{path} has changed since run {outcome.run} was done, which used it",
                "Put it back as it was, choose another folder with --output, or --force to do all runs anew.",
            )
        return True

    def work(self, executor: Executor, todo: Iterable[int], fail_fast: bool) -> SweepResult:
        """Do the runs."""
        self._tell()
        try:
            with held_signals() as signals, closing(executor.each(self._task, todo)) as ends:
                for number, outcome in ends:
                    if outcome is None:
                        outcome = self._task.ended(number, "failed", "the worker process died")
                    self._take(outcome)
                    self._tell()
                    signals.check()
                    if fail_fast and outcome.status != "done":
                        break
                    if time.perf_counter() > self._table_due:
                        self._write()
        except (KeyboardInterrupt, Interrupted):
            self._result.interrupted = True
        except InputOutputError:  # nobody is left to do runs, or the disk is full
            with suppress(InputOutputError):
                self._write()
            raise
        self._result.seconds = time.perf_counter() - self._began
        self._write()
        self._result.parquet = write_parquet(
            self._result.table, self._result.folder / PARQUET, self._task.design
        )
        self._result.failures.sort(key=lambda outcome: outcome.run)
        return self._result

    def _take(self, outcome: Outcome) -> None:
        self._table.add(outcome)
        self._result.add(outcome)

    def _tell(self) -> None:
        if self._progress is not None:
            done, counts = self._result.ended, self._result.counts
            elapsed = time.perf_counter() - self._began
            failures = done - counts["done"]
            self._progress(SweepProgress(done, self._total, self._result.earlier, failures, elapsed))

    def _write(self) -> None:
        began = time.perf_counter()
        try:
            write_atomically(self._result.table, self._table.text())
        except OSError as error:
            raise InputOutputError(
                f"{self._result.table} cannot be written: {error.strerror or error}",
                "The runs are kept; the same command continues.",
            ) from None
        now = time.perf_counter()
        self._table_due = now + max(TABLE_EVERY, 20 * (now - began))


def _check_set(source: Source, settings: Sequence[Override], design: Design) -> None:
    """Raise UsageError for a setting that varied values would replace."""
    raw = apply_overrides(migrated(source), settings).raw
    for key in design.keys:
        for setting in settings:
            try:
                varied, wanted = resolve_path(raw, key), resolve_path(raw, setting.key)
            except ScenarioError:  # an entry that only another varied value brings
                continue
            if wanted[: len(varied)] == varied:
                both = setting.key if key == setting.key else f"{setting.key}, which is in {key},"
                raise UsageError(f"{both} is both set and varied", "Leave out one of them.")


def _columns(scenario: Scenario, chosen: Sequence[str]) -> tuple[str, ...]:
    """Quantities of the table: all that there are, or the chosen ones."""
    there = totals(scenario)
    known = there if scenario.output.ledger else tuple(name for name in there if is_count(name))
    for name in chosen:
        if name in there and name not in known:
            raise UsageError(
                f"{name} comes from the ledger, which is switched off", "--set output.ledger=true"
            )
        if name not in there and name in booked(scenario):
            raise UsageError(
                f"{name} is not in the ledger, as work is not recorded", "--set output.work=true"
            )
        if name not in known:
            hint = did_you_mean(name, known) or "There are: " + ", ".join(known)
            raise UsageError(
                f"there is no quantity {name!r}", f"{hint}; for statistics of fields, add [[checks]]"
            )
    return tuple(dict.fromkeys(chosen)) or known
