"""Digests: two runs with the same physics have one name, and so have two equal states."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.scenario.dump import to_table
from particlesim.scenario.named_files import file_digest, layout_files, shape_files
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.frame import Frame

NOT_PHYSICS = ("format", "title", "description", "output", "render", "checks")
"""Sections of a scenario that do not change how particles move. (`output` may shorten the step; the step counts.)"""

MOVES = {
    "id": None,
    "position": None,
    "velocity": None,
    "orientation": (1.0, 0.0, 0.0, 0.0),
    "angular_velocity": (0.0, 0.0, 0.0),
}
"""Fields of a state, and the value of those that say nothing where everything has it."""


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
    for file in (*layout_files(scenario), *shape_files(scenario)):
        part: Any = physics
        for step in file.address[:-1]:
            part = part[step]
        part["path"] = file_digest(file.path)
    text = json.dumps(physics, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def state_digest(final: Frame) -> str:
    """SHA-256 of ids, positions and velocities, and of orientations and angular velocities where something is turned or
    turns: equal for equal bits."""
    return columns_digest(final.__getitem__)


def columns_digest(column: Callable[[str], NDArray[Any]], *, turns: bool = True) -> str:
    """The same of `column(field)`, of which one is in memory at a time; `turns`: whether anything can be turned or turn."""
    digest = hashlib.sha256()
    for field, idle in MOVES.items():
        if idle is None or turns:
            _add(digest, np.ascontiguousarray(column(field)), idle)
    return digest.hexdigest()


def _add(digest: Any, values: NDArray[Any], idle: tuple[float, ...] | None) -> None:
    if idle is None or not (values == idle).all():
        digest.update(values.reshape(-1).view(np.uint8).data)
