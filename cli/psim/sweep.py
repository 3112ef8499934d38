"""`psim sweep`: many runs of one scenario with different values, and one table."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psim.complete import override_keys
from psim.options import Overrides, Quiet, ScenarioFile
from psim.progress import sweep_progress
from psim.talk import duration, facts, paint, plain, print_json, print_path, say

if TYPE_CHECKING:
    from particlesim.sweep import SweepResult

MANY = 10**6
"""Runs beyond which a sweep is taken for a slip of the hand."""

_WORDS = {
    "done": "done",
    "check_failed": "failed a check",
    "bad_scenario": "have a wrong scenario",
    "diverged": "diverged",
    "failed": "could not be done",
}


def sweep(
    scenario: ScenarioFile,
    vary: Annotated[
        list[str],
        typer.Option(
            "--vary",
            metavar="KEY=VALUES",
            help="Values of a key: 1,2,5 or linspace(first, last, count), logspace(exponent, exponent, count), "
            "uniform(low, high), loguniform(low, high). Repeatable.",
            autocompletion=override_keys,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder; outputs/SCENARIO-sweep by default."),
    ] = None,
    overrides: Overrides = None,
    zipped: Annotated[
        bool, typer.Option("--zip", help="Take lists side by side, not every combination.")
    ] = False,
    samples: Annotated[
        int | None,
        typer.Option("--samples", metavar="N", help="How many values uniform and loguniform draw."),
    ] = None,
    method: Annotated[
        str, typer.Option("--method", metavar="NAME", help="How they are drawn: sobol, lhs or random.")
    ] = "sobol",
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of what is drawn.")] = 0,
    quantities: Annotated[
        list[str] | None,
        typer.Option(
            "--quantity",
            metavar="NAME",
            help="A column of the table, such as energy; all by default. Repeatable.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", "-j", metavar="N", min=1, help="Worker processes; one per core by default."
        ),
    ] = None,
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="Begin no run after one that did not end well.")
    ] = False,
    record: Annotated[bool, typer.Option("--record", help="Keep the trajectory of every run.")] = False,
    force: Annotated[
        bool, typer.Option("--force", "-f", help="Remove what an earlier sweep left in the folder.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help=f"Really do more than {MANY:,} runs.")] = False,
    quiet: Quiet = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the outcome, or the error, as JSON; nothing else.")
    ] = False,
) -> None:
    """Run a scenario with many different values.

    Every run has a folder of its own; results.csv has a row for each, also for those that fail. The same command in the
    same folder goes on where it was stopped. Exit code of the worst run.
    """
    from particlesim.errors import UsageError
    from particlesim.sweep import Design, Sweep, parse_axis

    axes = tuple(parse_axis(argument) for argument in vary)
    design = Design(axes, zipped, samples, method, seed)  # type: ignore[arg-type]  # it refuses other methods
    if len(design) > MANY and not yes:
        raise UsageError(f"these are {len(design):,} runs", "If that is meant: --yes")
    planned = Sweep(scenario, design, overrides=overrides or (), quantities=quantities or (), record=record)
    folder = Path("outputs") / f"{scenario.stem}-sweep" if output is None else output
    quiet = quiet or as_json
    with sweep_progress(scenario.stem, quiet=quiet) as progress:
        result = planned.run(folder, workers=workers, fail_fast=fail_fast, force=force, progress=progress)
    if as_json:
        print_json(_as_data(result))
    else:
        if not quiet or result.exit_code:
            _show(result, scenario.stem)
        if not quiet:
            print_path(folder / result.table.name)
    if result.exit_code:
        raise typer.Exit(result.exit_code)


def _as_data(result: SweepResult) -> dict[str, Any]:
    return {
        "folder": str(result.folder),
        "table": str(result.table),
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
        say(f"{paint('interrupted', 'yellow')}: the same command goes on from here")
