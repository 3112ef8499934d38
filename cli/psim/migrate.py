"""`psim migrate`: bring scenarios of an older format up to date."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.complete import scenario_files
from psim.console import print_json, print_path, say


def migrate(
    scenarios: Annotated[
        list[Path],
        typer.Argument(metavar="SCENARIO...", help="Scenarios, TOML files.", autocompletion=scenario_files),
    ],
    check: Annotated[
        bool, typer.Option("--check", help="Write nothing; exit code 1 if a file is in an older format.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON list, an object per file.")] = False,
) -> None:
    """Rewrite scenarios of an older format in the current one.

    Comments and order are kept. All other commands read older formats, too, and say so; this one rewrites the files. Those
    in the current format are left alone. Nothing is written if any of them cannot be run.
    """
    import particlesim as ps
    from particlesim.scenario.load import scenario_of
    from particlesim.scenario.text.migration import CURRENT, format_of, migrated
    from particlesim.scenario.text.source import read_source
    from particlesim.trajectory.target import replacing

    found = []
    for path in scenarios:
        source = read_source(path)
        version, new = format_of(source), migrated(source)
        scenario_of(new, (), path.resolve().parent)
        found.append((path, version, new.main.text))
    old = [entry for entry in found if entry[1] < CURRENT]
    for path, version, text in old:
        if check:
            say(f"{path} is in format {version}, the current one is {CURRENT}")
            continue
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        ps.load(path)
        if not as_json:
            say(f"{path}: format {version} is now {CURRENT}")
            print_path(path)
    code = 1 if check and old else 0
    if as_json:
        print_json(
            [{"scenario": str(p), "format": v, "current": CURRENT, "exit_code": code} for p, v, _ in found]
        )
    elif not old:
        say(f"nothing to do: {len(found)} in format {CURRENT}")
    if code:
        raise typer.Exit(code)
