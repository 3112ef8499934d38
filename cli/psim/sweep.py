"""`psim sweep`: many runs of one scenario with different values, and one table."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from psim.annotations import annotate
from psim.console import duration, facts, paint, plain, print_json, print_path, say
from psim.junit import reported
from psim.options import JUnit, Overrides, Quiet
from psim.progress import sweep_progress
from psim.sweep_options import (
    MANY,
    AsJson,
    ClusterName,
    FailFast,
    Folder,
    Force,
    Method,
    Plot,
    Quantities,
    Record,
    Samples,
    ScenarioOrSweep,
    Scheduler,
    Seed,
    Vary,
    Workers,
    Yes,
    Zip,
)

if TYPE_CHECKING:
    from particlesim.sweep import Executor, SweepResult
    from particlesim.sweep.definition import SweepFile

PLOT = "plot.png"

_WORDS = {
    "done": "done",
    "check_failed": "failed a check",
    "bad_scenario": "have a wrong scenario",
    "diverged": "diverged",
    "failed": "could not be done",
}


def sweep(
    scenario: ScenarioOrSweep,
    vary: Vary = None,
    output: Folder = None,
    overrides: Overrides = None,
    zipped: Zip = False,
    samples: Samples = None,
    method: Method = None,
    seed: Seed = None,
    quantities: Quantities = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    cluster: ClusterName = None,
    fail_fast: FailFast = False,
    record: Record = False,
    plot: Plot = None,
    force: Force = False,
    yes: Yes = False,
    junit: JUnit = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Run a scenario with many different values.

    Every run has a folder of its own; results.csv has a row for each, also for those that fail. The same command in the
    same folder continues where it was stopped. Options add to those of a sweep.toml or replace them. The exit code is that
    of the worst run.
    """
    from particlesim.errors import UsageError
    from particlesim.sweep import Design, Sweep
    from particlesim.sweep.plotting import check_plot, plot_table

    quiet = quiet or as_json
    with reported(junit, scenario.stem, "sweep") as report:
        told, axes = _definition(scenario, vary or [])
        varied = scenario.parent / told.scenario
        design = Design(
            axes,
            zipped or told.zip,
            told.samples if samples is None else samples,
            method or told.method,  # type: ignore[arg-type]  # it refuses other methods
            told.seed if seed is None else seed,
        )
        if len(design) > MANY and not yes:
            raise UsageError(f"these are {len(design):,} runs", "If that is meant: --yes")
        planned = Sweep(
            varied,
            design,
            overrides=(*told.settings(), *(overrides or ())),
            quantities=quantities or told.quantities,
            record=record or told.record,
        )
        folder = Path("outputs") / f"{varied.stem}-sweep" if output is None else output
        report.keep_out_of(folder)
        columns = None if plot is None else _plotted(plot)
        if columns is not None:
            check_plot(*columns, planned.columns, folder / PLOT)
        workers = workers or told.workers
        with (
            _executor(scheduler, cluster, workers) as executor,
            sweep_progress(scenario.stem, quiet=quiet) as progress,
        ):
            result = planned.run(
                folder,
                workers=workers,
                executor=executor,
                fail_fast=fail_fast or told.fail_fast,
                force=force,
                progress=progress,
            )
        report.of_sweep(result, len(design.keys))
    picture = None
    if columns is not None and not result.interrupted:
        picture = folder / PLOT
        plot_table(result.table, design, *columns, picture)
    _tell(result, scenario, folder, picture, quiet=quiet, as_json=as_json)
    if result.exit_code:
        raise typer.Exit(result.exit_code)


def _tell(
    result: SweepResult, scenario: Path, folder: Path, picture: Path | None, *, quiet: bool, as_json: bool
) -> None:
    """How a sweep ended, for people or as JSON; failures as annotations, too."""
    for failure in result.failures:
        values = ", ".join(f"{key}={value}" for key, value in failure.parameters.items())
        annotate("error", f"{failure.status}: run {failure.run} ({values}): {failure.cause}", scenario)
    if as_json:
        print_json(_as_data(result) | {"plot": None if picture is None else str(picture)})
        return
    if not quiet or result.exit_code:
        _show(result, scenario.stem)
    if not quiet:
        print_path(folder / result.table.name)
        if picture is not None:
            print_path(picture)


def _executor(
    scheduler: str | None, cluster: str | None, workers: int | None
) -> AbstractContextManager[Executor | None]:
    """Who does the runs; None for processes on this machine. Raises UsageError."""
    from particlesim.errors import UsageError

    if scheduler is None and cluster is None:
        return nullcontext()
    from particlesim.sweep import cluster as clusters

    if scheduler is not None and cluster is not None:
        raise UsageError(
            "--scheduler and --cluster contradict each other", "Slurm starts a scheduler of its own."
        )
    if scheduler is not None:
        return clusters.scheduler(scheduler)
    if cluster != "slurm":
        raise UsageError(f"there is no cluster {cluster!r}", "There is: slurm. For others: --scheduler.")
    return clusters.slurm(workers or 1)


def _definition(path: Path, vary: list[str]) -> tuple[SweepFile, tuple[Any, ...]]:
    """What a sweep file says, or a scenario with nothing else said; and the axes of both the file and --vary."""
    from particlesim.errors import UsageError
    from particlesim.scenario.text.source import read_source
    from particlesim.sweep import parse_axis
    from particlesim.sweep.definition import SweepFile, is_sweep, load_sweep

    axes = {axis.key: axis for axis in (parse_axis(argument) for argument in vary)}
    if len(axes) < len(vary):
        raise UsageError("a key is varied twice", "Give all its values in one --vary.")
    if is_sweep(read_source(path)):
        file = load_sweep(path)
        return file, tuple(({axis.key: axis for axis in file.axes()} | axes).values())
    if not axes:
        raise UsageError("there is nothing to vary", "Name a key: --vary simulation.dt=1e-3,2e-3")
    return SweepFile.model_construct(scenario=path.name, vary={}), tuple(axes.values())


def _plotted(words: tuple[str, str]) -> tuple[str, str]:
    """The columns of 'x=COLUMN' and 'y=COLUMN', in either order. Raises UsageError."""
    from particlesim.errors import UsageError

    named = dict(word.split("=", 1) for word in words if "=" in word)
    if set(named) != {"x", "y"}:
        raise UsageError(
            f"--plot {' '.join(words)} names no columns", "--plot x=forces.air.coefficient y=energy"
        )
    return named["x"], named["y"]


def _as_data(result: SweepResult) -> dict[str, Any]:
    return {
        "folder": str(result.folder),
        "table": str(result.table),
        "parquet": None if result.parquet is None else str(result.parquet),
        "runs": result.total,
        "ended": result.ended,
        "earlier": result.earlier,
        "counts": {status: result.counts[status] for status in _WORDS},
        "failures": [failure.as_data() for failure in result.failures],
        "seconds": result.seconds,
        "interrupted": result.interrupted,
        "exit_code": result.exit_code,
    }


def _show(result: SweepResult, name: str) -> None:
    """The outcome, and the first runs that did not end well, on stderr."""
    say(paint(name, "bold"))
    runs = f"{result.ended:,} of {result.total:,}"
    if result.earlier:
        runs += f" ({result.earlier:,} of them earlier)"
    fresh = result.ended - result.earlier
    speed = f", {fresh / result.seconds:.3g} runs/s" if fresh and result.seconds > 0 else ""
    rows = [
        ("runs", runs),
        *((_WORDS[status], f"{result.counts[status]:,}") for status in _WORDS if result.counts[status]),
        ("took", duration(result.seconds) + speed),
    ]
    facts(rows, sys.stderr)
    for failure in result.failures:
        values = ", ".join(f"{key}={value}" for key, value in failure.parameters.items())
        say(
            f"{paint(failure.status.replace('_', ' '), 'red')}: run {failure.run} ({plain(values)}): {plain(failure.cause)}"
        )
    more = result.ended - result.counts["done"] - len(result.failures)
    if more:
        say(f"and {more:,} more")
    if result.interrupted:
        say(f"{paint('interrupted', 'yellow')}: the same command continues from here")
