"""Colliders and shapes of bodies made ready for a run: the files that they are in are read, and colliders know the motions
that lead them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from particlesim.bodies import Bodies
from particlesim.colliders.content import FromFile, files_in
from particlesim.colliders.moving import led_to
from particlesim.errors import ResourceError, UsageError
from particlesim.groups.motion import Motion
from particlesim.layouts.grid_file import read_grid
from particlesim.layouts.mesh_formats import read_triangles
from particlesim.model.mistakes import Invalid
from particlesim.model.mistakes import Path as Place
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.reach import collider_tables
from particlesim.scenario.rules.walls import common_place

if TYPE_CHECKING:
    from particlesim.scenario.scenario import Scenario

READERS: dict[str, Callable[[Path], Any]] = {
    **dict.fromkeys((".obj", ".ply", ".stl"), read_triangles),
    **dict.fromkeys((".npy", ".png"), read_grid),
}
"""What reads a file, by its ending."""
SMALLEST = 1e-307
"""Masses [kg] and moments of inertia [kg m²] below which no number holds one over them; they are below one over it, too."""
UNDEFINED = "roots, logarithms and quotients do not have a value everywhere: give a path that lasts until the end of the run"
"""What helps where a path is not finite."""


def open_colliders(scenario: Scenario) -> None:
    """Read the files of colliders and bodies that have not been read, tell colliders that move what leads them, and see that
    paths begin somewhere, and that numbers hold the sizes of bodies.

    Raises UsageError when that cannot be done: ScenarioError with its place where the text of the scenario is known,
    ResourceError where this machine has too little memory, which is no mistake of the scenario.
    """
    led = {motion.collider: k for k, motion in enumerate(scenario.motions) if motion.collider is not None}
    for stated, collider in collider_tables(scenario):
        by = led.get(collider.name or "")
        if by is not None:
            motion = scenario.motions[by]
            path = None if motion.path is None and motion.waypoints is None else motion.record()
            collider.lead(path, None if motion.spin is None else motion.spin.record())
        for where, solid in files_in(collider, stated):
            if not solid.is_open:
                _open(scenario, where, solid)
        if by is not None and (wrong := undefined(motion, collider.body(), 0.0)) is not None:
            with _at(scenario, ("motions", by, "path")):
                raise UsageError(wrong, UNDEFINED)
    for k, body in enumerate(scenario.bodies):
        for where, shape in files_in(body.shape, ("bodies", k, "shape")):
            if not shape.is_open:
                _open(scenario, where, shape)
        with _at(scenario, ("bodies", k, "shape")):
            body.shape.frame()
        with _at(scenario, ("bodies", k, "density" if body.mass is None else "mass")):
            _require_mass(body)
    if any(True for collider in scenario.colliders for _ in files_in(collider)):
        _leave_room(scenario)


def _require_mass(body: Bodies) -> None:
    """Raises UsageError where no numbers hold the mass of a body and its moments of inertia, and one over them."""
    moments = body.inertia()
    if not all(SMALLEST < each < 1 / SMALLEST for each in (body.weight, *moments.tolist())):
        raise UsageError(
            f"a mass of {body.weight:.3g} kg, with moments of inertia from {min(moments):.3g} to {max(moments):.3g} kg m²",
            f"masses and moments of inertia are from {SMALLEST:g} to {1 / SMALLEST:g}",
        )


def undefined(motion: Motion, body: Any, time: float) -> str | None:
    """That the path that a motion gives a collider, as kernels take that, is not finite at a time [s]; None if it is."""
    place, speed = led_to(body, time)
    if all(map(math.isfinite, (*place, *speed))):
        return None
    return (
        f"the path that {motion.label} gives the collider {motion.collider!r} is not finite at t = {time:.9g} s: "
        f"place ({place[0]:.6g}, {place[1]:.6g}, {place[2]:.6g}) m, "
        f"velocity ({speed[0]:.6g}, {speed[1]:.6g}, {speed[2]:.6g}) m/s"
    )


def _open(scenario: Scenario, where: Place, solid: FromFile) -> None:
    path = Path(solid.path)
    if not path.is_absolute() and scenario.folder is not None:
        path = scenario.folder / path
    with _at(scenario, (*where, "path")):
        ending = path.suffix.lower()
        if ending not in solid.endings:
            raise UsageError(
                f"a {solid.kind} is not read from a file with the ending {path.suffix!r}",
                did_you_mean(ending, solid.endings) or f"known endings: {', '.join(solid.endings)}",
            )
        solid.take(READERS[ending](path))


def _leave_room(scenario: Scenario) -> None:
    """Refuse walls that leave no place for what they hold, now that it is known where those in files are."""
    mistakes = list(common_place(scenario))
    if not mistakes:
        return
    if scenario.source is None:
        raise UsageError(mistakes[0].message, mistakes[0].hint)
    from particlesim.scenario.text.diagnose import scenario_error

    raise scenario_error(scenario.source, mistakes) from None


@contextmanager
def _at(scenario: Scenario, place: Place) -> Iterator[None]:
    """Give mistakes a place in the text of the scenario, where that is known."""
    try:
        yield
    except ResourceError:
        raise
    except UsageError as error:
        if scenario.source is None:
            raise
        from particlesim.scenario.text.diagnose import scenario_error

        raise scenario_error(scenario.source, [Invalid(error.message, place, hint=error.hint)]) from None
