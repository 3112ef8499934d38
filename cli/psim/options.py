"""Arguments and options that several subcommands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.complete import override_keys, scenario_files, trajectory_files

ScenarioFile = Annotated[
    Path, typer.Argument(help="The scenario, a TOML file.", autocompletion=scenario_files)
]
TrajectoryFile = Annotated[
    Path,
    typer.Argument(help="The trajectory, a .vtkhdf file.", autocompletion=trajectory_files),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set a value of the scenario, such as simulation.dt=1e-3 or forces.air.coefficient=0.3. Repeatable.",
        autocompletion=override_keys,
    ),
]
Force = Annotated[bool, typer.Option("--force", "-f", help="Overwrite output that exists.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Threads = Annotated[
    int | None,
    typer.Option(
        "--threads",
        "-j",
        metavar="N",
        min=1,
        help="Threads at most; all cores by default. Results do not depend on it.",
    ),
]
Tolerance = Annotated[
    float,
    typer.Option(
        "--tolerance",
        metavar="X",
        help="Largest difference allowed, as a fraction of the largest value of the field in the frame. "
        "0 by default: every bit counts.",
    ),
]
Frames = Annotated[
    str | None,
    typer.Option(
        "--frames",
        metavar="A:B",
        help="Only these frames, as Python counts: 10:20, 100:, ::2, or --frames=-1: for the last.",
    ),
]


def parse_frames(text: str | None) -> slice | None:
    """A slice from 'A:B', 'A:B:STEP' or one number. Raises UsageError."""
    from particlesim.errors import UsageError

    if text is None:
        return None
    try:
        parts = [int(part) if part.strip() else None for part in text.split(":")]
    except ValueError:
        parts = []
    if len(parts) == 1 and parts[0] is not None:
        return slice(parts[0], parts[0] + 1 if parts[0] != -1 else None)
    if len(parts) not in (2, 3) or (len(parts) == 3 and parts[2] == 0):
        raise UsageError(
            f"--frames {text!r} names no frames",
            "Write A:B, counted from 0 and without B: 10:20, 100:, ::2, -1: or 7.",
        )
    return slice(*parts)
