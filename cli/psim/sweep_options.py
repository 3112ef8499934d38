"""Arguments and options of `psim sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.complete import override_keys, scenario_files

MANY = 10**6
"""Runs beyond which a sweep is taken for a slip of the hand."""

ScenarioOrSweep = Annotated[
    Path,
    typer.Argument(
        help="The scenario, or a sweep.toml that names it, what is varied, and how.",
        autocompletion=scenario_files,
    ),
]
Vary = Annotated[
    list[str] | None,
    typer.Option(
        "--vary",
        metavar="KEY=VALUES",
        help="Values of a key: 1,2,5 or linspace(first, last, count), logspace(exponent, exponent, count), "
        "uniform(low, high), loguniform(low, high). Repeatable.",
        autocompletion=override_keys,
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="DIR", help="Folder; outputs/SCENARIO-sweep by default."),
]
Zip = Annotated[
    bool,
    typer.Option("--zip", help="Take the k-th values of all lists together, instead of every combination."),
]
Samples = Annotated[
    int | None,
    typer.Option("--samples", metavar="N", help="Number of values that uniform and loguniform draw."),
]
Method = Annotated[
    str | None,
    typer.Option("--method", metavar="NAME", help="How they are drawn: sobol (the default), lhs or random."),
]
Seed = Annotated[
    int | None, typer.Option("--seed", metavar="N", help="Seed of the drawn values; 0 by default.")
]
Quantities = Annotated[
    list[str] | None,
    typer.Option(
        "--quantity",
        metavar="NAME",
        help="A column of the table, such as energy; all by default. Repeatable.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", "-j", metavar="N", min=1, help="Worker processes; one per core by default."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Runs go to the workers of this Dask scheduler: tcp://node7:8786.",
    ),
]
ClusterName = Annotated[
    str | None,
    typer.Option(
        "--cluster", metavar="NAME", help="Runs go to jobs of a batch system, --workers of them: slurm."
    ),
]
FailFast = Annotated[bool, typer.Option("--fail-fast", help="Start no further run after one that failed.")]
Record = Annotated[bool, typer.Option("--record", help="Keep the trajectory of every run.")]
Plot = Annotated[
    tuple[str, str] | None,
    typer.Option(
        "--plot",
        metavar="x=COLUMN y=COLUMN",
        help="Plot one column of the table against another, as plot.png in the folder. Needs matplotlib.",
    ),
]
Force = Annotated[
    bool, typer.Option("--force", "-f", help="Remove what an earlier sweep left in the folder.")
]
Yes = Annotated[bool, typer.Option("--yes", help=f"Allow more than {MANY:,} runs.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the outcome, or the error, as JSON; nothing else.")
]
