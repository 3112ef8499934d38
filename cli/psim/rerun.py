"""`psim rerun`: repeat a run from its own trajectory, and compare."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.diff import tell
from psim.options import Force, Quiet, Threads, Tolerance, TrajectoryFile
from psim.progress import run_progress


def rerun(
    trajectory: TrajectoryFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Keep the new trajectory; it is deleted by default."
        ),
    ] = None,
    tolerance: Tolerance = 0.0,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as one JSON object.")] = False,
) -> None:
    """Repeat a run from what its trajectory holds, and compare the two.

    The same version of psim on the same kind of machine gives the same bits. Exit code 1 when something differs, which is
    shown as by psim diff.
    """
    from particlesim.verification.rerun import rerun as repeat

    with run_progress(trajectory.stem, quiet=quiet or as_json) as progress:
        compared = repeat(
            trajectory,
            output,
            tolerance=tolerance,
            overwrite=force,
            threads=threads,
            progress=progress,
        )
    tell(compared, str(trajectory), "its repetition" if output is None else str(output), as_json=as_json)
