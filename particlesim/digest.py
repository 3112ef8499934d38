"""Digests: two runs with the same physics have one name, and so have two equal states."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from particlesim.errors import UsageError
from particlesim.layouts.file import File
from particlesim.scenario.dump import to_table
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.frame import Frame

NOT_PHYSICS = ("format", "title", "description", "output", "render", "checks")
"""Sections of a scenario that do not change how particles move. (`output` may shorten the step; the step counts.)"""


def physics_of(table: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a scenario's table that decides how particles move."""
    return {key: value for key, value in table.items() if key not in NOT_PHYSICS}


def physics_digest(scenario: Scenario) -> str:
    """SHA-256 of what decides how particles move, as 64 hexadecimal digits.

    That is what the scenario says, defaults left out, units and names resolved; without titles, output, checks and render
    settings, with the step in use, and with the content of the files that it names in place of their names. The version of
    psim is not part of it: equal digests with different results tell of a change in psim. Raises UsageError when a file
    cannot be read.
    """
    physics = physics_of(to_table(scenario))
    grid = scenario.grid
    physics["simulation"] = {**physics["simulation"], "dt": grid.dt, "substeps": None, "steps": grid.steps}
    for group, table in zip(scenario.particles, physics.get("particles", ()), strict=True):
        if isinstance(group.layout, File):
            table["layout"]["path"] = _file_digest(scenario.folder, group.layout.path)
    text = json.dumps(physics, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _file_digest(folder: Path | None, name: str) -> str:
    path = Path(name) if folder is None else folder / name
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from None


def state_digest(final: Frame) -> str:
    """SHA-256 of ids, positions and velocities: equal for equal bits."""
    digest = hashlib.sha256()
    for field in ("id", "position", "velocity"):
        digest.update(final[field].tobytes())
    return digest.hexdigest()
