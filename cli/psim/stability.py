"""`psim stability`: the largest stable step of a scenario, and its eigenvalues on the stability region."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from psim.console import facts, paint, places, print_json, print_path, warn
from psim.options import Force, Overrides, ScenarioFile
from psim.progress import told_when_long


def stability(
    scenario: ScenarioFile,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            "-o",
            metavar="FILE",
            help="Draw the eigenvalues h λ on the stability region of the method: .png, .svg or .pdf.",
        ),
    ] = None,
    overrides: Overrides = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Print the largest stable step of a scenario, for every force alone and for all together.

    The scenario is linearised at its initial state; where forces change much during the run, other steps are stable. The
    exit code is 0 whether or not dt is stable. --plot needs matplotlib: pip install 'particlesim\\[plot]'.
    """
    import particlesim as ps
    from psim.plan import stability_rows

    loaded = ps.load(scenario, overrides or ())
    with told_when_long(scenario.stem, quiet=as_json):
        found = ps.stability(loaded)
    if plot is not None:
        from particlesim.analysis.stability import plot_stability

        plot_stability(found, plot, overwrite=force)
    data = {
        "scenario": str(scenario),
        **found.as_data(),
        "warnings": list(found.warnings),
        "warning_places": places(found.warnings, loaded),
        "plot": plot and str(plot),
    }
    if as_json:
        print_json({**data, "exit_code": 0})
        return
    print(paint(str(scenario), "bold", sys.stdout))
    facts(
        (
            ("dt", f"{found.dt:.6g} s"),
            ("stable dt", "\n".join(stability_rows(data))),
            ("from", ", ".join(dict.fromkeys(island.how for island in found.islands))),
        ),
        sys.stdout,
    )
    for text in found.warnings:
        warn(text, loaded)
    if plot is not None:
        print_path(plot)
