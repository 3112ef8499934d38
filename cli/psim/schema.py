"""`psim schema`: the JSON Schema of scenario files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.options import Force


def schema(
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write it there instead of printing it."),
    ] = None,
    force: Force = False,
) -> None:
    """Print the JSON Schema of scenario files.

    With it, editors complete and check scenarios as you type: put '#:schema ./psim.schema.json' in the first line
    (VS Code: Even Better TOML; Neovim and others: taplo). Types that installed packages add are in it.
    """
    import json

    from particlesim.scenario.extensions import find_all
    from particlesim.scenario.scenario import Scenario
    from particlesim.scenario.schema import json_schema
    from psim.console import warn

    for problem in find_all():
        warn(problem)
    text = json.dumps(json_schema(Scenario), indent=2, ensure_ascii=False)
    if output is None:
        print(text)
        return
    from particlesim.trajectory.target import check_target, replacing
    from psim.console import print_path

    check_target(output, overwrite=force)
    with replacing(output) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    print_path(output)
