"""`psim export`: convert a trajectory into files that other tools read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.options import Force, Frames, Quiet, TrajectoryFile, parse_frames


def export(
    trajectory: TrajectoryFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="What to write: .csv or .npz.")
    ],
    frames: Frames = None,
    fields: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,...", help="Only these fields, beside position and id; all recorded by default."
        ),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Convert a trajectory to CSV or NPZ.

    CSV has a row per particle and frame, NPZ the arrays for numpy.load. Numbers come back with the same bits.
    """
    from particlesim.trajectory.export import export as convert
    from psim.console import counted, print_path, say

    names = None if fields is None else [name.strip() for name in fields.split(",") if name.strip()]
    rows = convert(trajectory, output, frames=parse_frames(frames), fields=names, overwrite=force)
    if not quiet:
        say(counted(rows, "row"))
        print_path(output)
