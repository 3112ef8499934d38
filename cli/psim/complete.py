"""Completions for the shell. They look at names only: nothing is validated, nothing slow is imported."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_COMMON = (
    *(
        "simulation.duration",
        "simulation.dt",
        "simulation.integrator",
        "simulation.seed",
        "simulation.precision",
    ),
    *("output.fps", "output.fields", "output.precision", "output.compression", "output.ledger"),
    *("render.look", "render.size", "render.color_by", "render.camera.eye", "render.camera.target"),
)


def scenario_files(incomplete: str) -> list[str]:
    """Scenario files, and folders on the way to them."""
    return _files(incomplete, (".toml",))


def trajectory_files(incomplete: str) -> list[str]:
    """Trajectories, and folders on the way to them."""
    return _files(incomplete, (".vtkhdf",))


def override_keys(incomplete: str) -> list[str]:
    """What --set can change: the values written in the scenario on the command line, and common settings."""
    keys = dict.fromkeys(_COMMON)
    for word in _words():
        if word.endswith(".toml"):
            keys |= dict.fromkeys(_written(Path(word)))
    return [f"{key}=" for key in keys if key.startswith(incomplete)]


def _words() -> list[str]:
    """The command line being completed. Typer's context lacks the scenario while the value of --set is missing."""
    import shlex

    line = os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS", "")
    try:
        return shlex.split(line)
    except ValueError:  # an open quote
        return line.split()


def example_names(incomplete: str) -> list[str]:
    """Names of the shipped scenarios."""
    from particlesim.scenario.examples import examples_folder

    return sorted(path.stem for path in examples_folder().glob(f"{incomplete}*.toml"))


def _files(incomplete: str, endings: tuple[str, ...]) -> list[str]:
    folder, slash, start = incomplete.rpartition("/")
    try:
        found = sorted(Path(folder + slash or ".").iterdir())
    except OSError:
        return []
    names = [
        f"{path.name}/" if path.is_dir() else path.name
        for path in found
        if (path.is_dir() or path.suffix in endings)
        and (start.startswith(".") or not path.name.startswith("."))
    ]
    return [f"{folder}{slash}{name}" for name in names if name.startswith(start)]


def _written(path: Path) -> Iterator[str]:
    """Addresses of the values in a scenario file; none if it cannot be read."""
    import tomllib

    try:
        if not path.is_file():  # reading a pipe would wait
            return
        with path.open("rb") as file:
            yield from _leaves(tomllib.load(file), "")
    except (OSError, ValueError):
        return


def _leaves(value: Any, address: str) -> Iterator[str]:
    if isinstance(value, dict):
        for key, child in value.items():
            yield from _leaves(child, f"{address}.{key}" if address else key)
    elif isinstance(value, list) and value and all(isinstance(child, dict) for child in value):
        for k, child in enumerate(value):
            yield from _leaves(child, f"{address}.{child.get('name', k)}")
    else:
        yield address
