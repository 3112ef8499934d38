"""`psim examples`: list the shipped scenarios, show or copy them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from psim.complete import example_names
from psim.options import Force


def examples(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="The one to print or copy.", autocompletion=example_names),
    ] = None,
    copy: Annotated[
        Path | None, typer.Option("--copy", metavar="DIR", help="Copy it, or all of them, into this folder.")
    ] = None,
    force: Force = False,
) -> None:
    """List the shipped scenarios, print one, or copy them.

    Each is a documented scene to start from.
    """
    from particlesim.scenario.examples import examples_folder

    folder = examples_folder()
    shipped = sorted(folder.glob("*.toml"))
    chosen = shipped if name is None else [_find(name, shipped)]
    if copy is not None:
        schema = folder / "psim.schema.json"
        named = dict.fromkeys(file for path in chosen for file in _named_by(path))
        _copy([*chosen, *named, *([schema] if schema.exists() else [])], copy, force)
    elif name is not None:
        print(chosen[0].read_text(encoding="utf-8"), end="")
    else:
        _list(shipped)


def _find(name: str, shipped: list[Path]) -> Path:
    from particlesim.errors import UsageError
    from particlesim.model.spelling import did_you_mean

    for path in shipped:
        if path.stem == name.removesuffix(".toml"):
            return path
    names = [path.stem for path in shipped]
    hint = did_you_mean(name, names) or f"There are {', '.join(names)}."
    raise UsageError(f"there is no example {name!r}", hint)


def _list(shipped: list[Path]) -> None:
    import tomllib

    from psim.console import facts

    tables: list[dict[str, Any]] = [tomllib.loads(path.read_text(encoding="utf-8")) for path in shipped]
    facts(
        [
            (path.stem, table.get("description") or table.get("title", ""))
            for path, table in zip(shipped, tables, strict=True)
        ],
        sys.stdout,
    )


def _named_by(path: Path) -> list[Path]:
    """The files beside a scenario that it names, such as meshes."""
    from particlesim.scenario.load import load
    from particlesim.scenario.named_files import layout_files, shape_files

    scenario = load(path)
    return [file.path for file in (*layout_files(scenario), *shape_files(scenario))]


def _copy(files: list[Path], target: Path, force: bool) -> None:
    """Copy files into a folder. The schema, which editors need beside them, and files that scenarios share may be there
    already."""
    import filecmp
    import shutil

    from particlesim.trajectory.target import check_target, replacing
    from psim.console import print_path

    for file in files:
        there = target / file.name
        shared = file.suffix != ".toml" and there.is_file() and filecmp.cmp(file, there, shallow=False)
        check_target(there, overwrite=force or shared or file.suffix == ".json")
    for file in files:
        with replacing(target / file.name) as temporary:
            shutil.copyfile(file, temporary)
        if file.suffix == ".toml":
            print_path(target / file.name)
