"""Arguments and options that several subcommands have."""

from __future__ import annotations

import re
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
        help="Number of threads at most; all cores by default. Results are the same for any number.",
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
Resume = Annotated[
    bool,
    typer.Option("--resume", help="Continue a run that was stopped or killed; start it if there is none."),
]
JUnit = Annotated[
    Path | None,
    typer.Option("--junit", metavar="FILE", help="Write the results of checks and runs as JUnit XML."),
]
CheckpointEvery = Annotated[
    str | None,
    typer.Option("--checkpoint-every", metavar="TIME", help="Simulated time between checkpoints: 0.5, 20ms."),
]
CheckpointWall = Annotated[
    str | None,
    typer.Option(
        "--checkpoint-wall",
        metavar="TIME",
        help="Wall-clock time between checkpoints: 90, 10m; by default 1 s, 2 s, 4 s ... 60 s, at 2 % of the run at most.",
    ),
]
MaxWall = Annotated[
    str | None,
    typer.Option(
        "--max-wall",
        metavar="TIME",
        help="Stop cleanly after this wall-clock time: 90, 10m, 2h. --resume continues; exit code 130.",
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


_SECONDS = {"ms": 1e-3, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


def parse_seconds(option: str, text: str | None) -> float | None:
    """Seconds from '90', '90s', '10m' (or min), '2h', '1d'. Raises UsageError."""
    from particlesim.errors import UsageError

    if text is None:
        return None
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([a-z]*)\s*", text)
    try:
        seconds = float(found[1]) * _SECONDS[found[2] or "s"] if found else 0.0
    except (ValueError, KeyError):
        seconds = 0.0
    if not 0 < seconds < float("inf"):
        raise UsageError(
            f"{option} {text!r} is not a time", "Write seconds, or a unit: 90, 90s, 10m, 2h, 1d."
        )
    return seconds


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
