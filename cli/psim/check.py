"""`psim check`: validate scenarios without running them, and tell what would run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.complete import scenario_files
from psim.console import print_json
from psim.options import Overrides, Quiet
from psim.progress import told_when_long
from psim.report import as_data, report


def check(
    scenarios: Annotated[
        list[Path],
        typer.Argument(metavar="SCENARIO...", help="Scenarios, TOML files.", autocompletion=scenario_files),
    ],
    overrides: Overrides = None,
    stability: Annotated[
        bool,
        typer.Option(
            "--stability/--no-stability",
            help="Also place the particles and find the largest stable step, the slowest part of the check.",
        ),
    ] = True,
    quiet: Quiet = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON list, an object per scenario.")
    ] = False,
) -> None:
    """Validate scenarios and print what would run.

    Nothing is computed or written. Prints particles, steps, memory and disk of every scenario; every mistake is shown
    with its place. Exit code 2 if any scenario cannot be run.
    """
    import particlesim as ps
    from psim.plan import default_output, plan, show_plan

    worst = 0
    results = []
    for number, path in enumerate(scenarios):
        try:
            with told_when_long(path.stem, quiet=quiet or as_json):
                loaded = ps.load(path, overrides or ())
                planned = plan(loaded, default_output(path), look=stability)
        except ps.PsimError as error:
            worst = max(worst, error.exit_code)
            if not as_json:
                report(error)
            results.append({"scenario": str(path), **as_data(error)})
            continue
        results.append({"scenario": str(path), **planned, "exit_code": 0})
        if not as_json and not quiet:
            if number:
                print()
            show_plan(str(path), planned, loaded)
    if as_json:
        print_json(results)
    if worst:
        raise typer.Exit(worst)
