"""`psim new`: start a scenario from a commented template."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.options import Force

_FOLDER = Path(__file__).parent / "templates"


def _templates(incomplete: str = "") -> list[str]:
    return sorted(path.stem for path in _FOLDER.glob(f"{incomplete}*.toml"))


def new(
    name: Annotated[Path, typer.Argument(help="Name of the scenario; NAME.toml is written.")],
    template: Annotated[
        str,
        typer.Option(
            "--template",
            "-t",
            help="What to start from: throw (one group, gravity, drag, ground), emitter, or springs.",
            autocompletion=_templates,
        ),
    ] = "throw",
    force: Force = False,
) -> None:
    """Start a scenario from a commented template."""
    import shlex

    from particlesim.errors import UsageError
    from particlesim.model.spelling import did_you_mean
    from particlesim.trajectory.target import check_target, replacing
    from psim.console import plain, print_path, say

    if template not in _templates():
        raise UsageError(
            f"there is no template {template!r}",
            did_you_mean(template, _templates()) or f"There are {', '.join(_templates())}.",
        )
    path = name if name.suffix == ".toml" else name.with_name(f"{name.name}.toml")
    check_target(path, overwrite=force)
    title = path.stem.replace("_", " ").replace("-", " ").capitalize().replace("\\", "").replace('"', "")
    text = (_FOLDER / f"{template}.toml").read_text(encoding="utf-8").replace("TITLE", title)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    say(f"next: psim run {shlex.quote(plain(path))} --video")
    print_path(path)
