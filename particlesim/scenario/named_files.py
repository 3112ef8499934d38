"""The files that a scenario names: what they hold is part of it."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from particlesim.colliders.content import files_in
from particlesim.errors import UsageError
from particlesim.groups.group import Particles
from particlesim.layouts.file import File
from particlesim.layouts.input_file import check_regular
from particlesim.layouts.surface import SurfaceFile
from particlesim.scenario.dump import to_table
from particlesim.scenario.reach import group_tables
from particlesim.scenario.scenario import Scenario

KeyPath = tuple[str | int, ...]


@dataclass(frozen=True)
class NamedFile:
    """A file by the name that the scenario has for it, where its table has that name, and where the file lies."""

    name: str
    address: KeyPath
    path: Path


def layout_files(scenario: Scenario) -> tuple[NamedFile, ...]:
    """The files that particles and bodies are laid out from: tables, trajectories and meshes."""
    return tuple(
        _named(scenario, group.layout.path, (*where, "layout", "path"))
        for where, group in group_tables(scenario)
        if isinstance(group, Particles) and isinstance(group.layout, File | SurfaceFile)
    )


def shape_files(scenario: Scenario) -> tuple[NamedFile, ...]:
    """The files that colliders and the shapes of bodies are in."""
    shapes: list[tuple[KeyPath, Any]] = [
        *((("colliders", k), collider) for k, collider in enumerate(scenario.colliders)),
        *((("bodies", k, "shape"), body.shape) for k, body in enumerate(scenario.bodies)),
    ]
    return tuple(
        _named(scenario, shape.path, (*where, "path"))
        for first, each in shapes
        for where, shape in files_in(each, first)
    )


def reference_files(scenario: Scenario) -> tuple[NamedFile, ...]:
    """The trajectories that checks compare with."""
    return tuple(
        _named(scenario, check.reference, ("checks", k, "reference"))
        for k, check in enumerate(scenario.checks)
        if check.reference is not None
    )


def _named(scenario: Scenario, name: str, address: KeyPath) -> NamedFile:
    return NamedFile(name, address, (scenario.folder or Path()) / name)


def file_digest(path: Path) -> str:
    """SHA-256 of a file, as 64 hexadecimal digits. Raises UsageError when it cannot be read, or is no regular file."""
    try:
        check_regular(
            path, "a file to read", "a regular file", "a scenario names files relative to its folder"
        )
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UsageError(f"{path} cannot be read: {reason}") from None


def dump_for(scenario: Scenario, folder: Path) -> str:
    """The scenario as TOML for a file in `folder`, from where its relative names lead to the same files as now."""
    table = to_table(scenario)
    for file in (*layout_files(scenario), *shape_files(scenario), *reference_files(scenario)):
        if not Path(file.name).is_absolute():
            _put(table, file.address, _name_from(folder, file.path))
    return tomli_w.dumps(table)


def _put(table: Any, address: KeyPath, value: str) -> None:
    *way, last = address
    for step in way:
        table = table[step]
    table[last] = value


def _name_from(folder: Path, path: Path) -> str:
    """A relative name of a file, seen from a folder; an absolute one where there is none, as on another drive."""
    path = path.parent.resolve() / path.name
    try:
        return Path(os.path.relpath(path, folder.resolve())).as_posix()
    except ValueError:
        return str(path)
