"""Colliders and shapes of bodies made ready for a run: the files that they are in are read, and colliders know the motions
that lead them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from particlesim.colliders.content import FromFile, files_in
from particlesim.errors import ResourceError, UsageError
from particlesim.layouts.grid_file import read_grid
from particlesim.layouts.mesh_formats import read_triangles
from particlesim.model.mistakes import Invalid
from particlesim.model.mistakes import Path as Place
from particlesim.model.spelling import did_you_mean

if TYPE_CHECKING:
    from particlesim.scenario.scenario import Scenario

READERS: dict[str, Callable[[Path], Any]] = {
    **dict.fromkeys((".obj", ".ply", ".stl"), read_triangles),
    **dict.fromkeys((".npy", ".png"), read_grid),
}
"""What reads a file, by its ending."""


def open_colliders(scenario: Scenario) -> None:
    """Read the files of colliders and bodies that have not been read, and tell colliders that move what leads them.

    Raises UsageError when that cannot be done: ScenarioError with its place where the text of the scenario is known,
    ResourceError where this machine has too little memory, which is no mistake of the scenario.
    """
    led = {motion.collider: motion for motion in scenario.motions if motion.collider is not None}
    for k, collider in enumerate(scenario.colliders):
        if collider.name in led:
            motion = led[collider.name]
            path = None if motion.path is None and motion.waypoints is None else motion.record()
            collider.lead(path, None if motion.spin is None else motion.spin.record())
        for where, solid in files_in(collider, ("colliders", k)):
            if not solid.is_open:
                _open(scenario, where, solid)
    for k, body in enumerate(scenario.bodies):
        for where, shape in files_in(body.shape, ("bodies", k, "shape")):
            if not shape.is_open:
                _open(scenario, where, shape)


def _open(scenario: Scenario, where: Place, solid: FromFile) -> None:
    path = Path(solid.path)
    if not path.is_absolute() and scenario.folder is not None:
        path = scenario.folder / path
    try:
        ending = path.suffix.lower()
        if ending not in solid.endings:
            raise UsageError(
                f"a {solid.kind} is not read from a file with the ending {path.suffix!r}",
                did_you_mean(ending, solid.endings) or f"known endings: {', '.join(solid.endings)}",
            )
        solid.take(READERS[ending](path))
    except ResourceError:
        raise
    except UsageError as error:
        if scenario.source is None:
            raise
        from particlesim.scenario.text.diagnose import scenario_error

        raise scenario_error(
            scenario.source, [Invalid(error.message, (*where, "path"), hint=error.hint)]
        ) from None
