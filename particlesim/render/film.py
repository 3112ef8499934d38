"""From a trajectory file to a video with the look that its scenario asks for."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders import Collider, Plane
from particlesim.colliders.moving import frame_at
from particlesim.colliders.solid import Solid
from particlesim.colliders.sphere import SphereCollider
from particlesim.errors import UsageError
from particlesim.forces.buoyancy import Buoyancy
from particlesim.model.vectors import perpendicular, unit
from particlesim.render.scene.source import BallShape, FrameSource, MeshShape, PlaneShape, Pose
from particlesim.render.timeline import video_step
from particlesim.render.writers import find_ffmpeg
from particlesim.scenario.load import Overrides, loads
from particlesim.scenario.open_colliders import open_colliders
from particlesim.scenario.rendering import RenderSettings
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.reader import Trajectory
from particlesim.trajectory.target import check_target

if TYPE_CHECKING:
    from particlesim.render.video import RenderReport

CLEAR = 0.45
"""How much of what is behind it the surface of a fluid hides."""


def film(
    path: str | Path,
    out: str | Path | None = None,
    overrides: Overrides | None = None,
    *,
    frames: slice | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    follow: Callable[[], bool] | None = None,
) -> RenderReport:
    """Render the trajectory `path` as `out` (.mp4, .webp or .png; the trajectory's name with .mp4 unless given).

    The look is that of the scenario in the trajectory, with `overrides` such as {"render.look": "dots"}.
    `progress(done, total)` is called after each picture. With `follow`, a run may still be writing the trajectory: what is
    not there yet is waited for, and `follow` is called meanwhile (see `Following`). Pictures are the same.
    Raises UsageError for a file that is no usable trajectory or an output that cannot be written, ScenarioError for
    overrides that do not fit; InputOutputError when writing fails; LostError when a run that is followed ends early. A
    partial file is never left.
    """
    from particlesim.render.following import Following
    from particlesim.render.video import render_frame, render_video

    path = Path(path)
    out = path.with_suffix(".mp4") if out is None else Path(out)
    with Trajectory(path) as trajectory:
        if not trajectory.scenario:
            raise UsageError(f"{path} does not say which scenario made it", "Was it written by `psim run`?")
        scenario = loads(trajectory.scenario, overrides)
        look = look_of(scenario)
        if scenario.render.ground:  # from where the run found the files of its colliders
            folder = Path(str(trajectory.provenance.get("folder", "")))
            open_colliders(scenario.loaded_from(folder, scenario.overrides))
        stage: Any = {
            "planes": plane_shapes(scenario),
            "balls": ball_shapes(scenario),
            "meshes": mesh_shapes(scenario) if scenario.render.ground else (),
            "title": scenario.title,
        }
        source: FrameSource = trajectory
        if follow is not None:
            source = Following(trajectory, scenario.grid, follow)
            if (
                look.bounds is None and len(trajectory) and not source.ended
            ):  # waits until the end, with all compiled
                render_frame(trajectory, 0, look, **stage, threads=1)
        return render_video(
            source, out, look, **stage, frames=frames, overwrite=overwrite, threads=threads, progress=progress
        )


def check_film(scenario: Scenario, out: Path, *, overwrite: bool) -> None:
    """Refuse a video of a scenario that could not be made after its run. Raises UsageError; writes nothing."""
    check_target(out, overwrite=overwrite)
    find_ffmpeg()
    grid = scenario.grid
    video_step(grid.duration, grid.frames, scenario.render)


def look_of(scenario: Scenario) -> RenderSettings:
    """The settings of a scenario's pictures: springs that only push are contact, and drawn only where it says so."""
    contact = {bonds.name: "hidden" for bonds in scenario.bonds if bonds.law.compression_only}
    return scenario.render.model_copy(update={"styles": {**contact, **scenario.render.styles}})


def plane_shapes(scenario: Scenario) -> tuple[PlaneShape, ...]:
    """The planes at rest of a scenario as the renderer takes them."""
    planes = (each for each in scenario.all_colliders if isinstance(each, Plane) and each.motion is None)
    return tuple(PlaneShape(plane.point, unit(plane.normal)) for plane in planes)


def ball_shapes(scenario: Scenario) -> tuple[BallShape, ...]:
    """The solid spheres among the colliders of a scenario, but for those that show what is behind them."""
    spheres = (each for each in scenario.colliders if _is_ball(each, scenario))
    return tuple(BallShape(sphere.center, sphere.radius) for sphere in spheres)


def mesh_shapes(scenario: Scenario) -> tuple[MeshShape, ...]:
    """All other shapes among the colliders: containers and all but balls; planes that move, as squares of two metres;
    surfaces of fluids; and rigid bodies."""
    opacity = scenario.render.opacity
    shapes = []
    for each in scenario.all_colliders:
        if isinstance(each, Plane) and each.motion is not None:
            corners, faces = _square(unit(each.normal))
            shapes.append(MeshShape(corners, faces, False, functools.partial(_pose, each)))
    for each in scenario.colliders:
        hollow = bool(getattr(each, "inside", False))
        if isinstance(each, Solid) and not _is_ball(each, scenario):
            surface = each.triangles()
            pose = None if each.motion is None else functools.partial(_pose, each)
            pivot = np.zeros(3) if pose is None else np.array(each.pivot())
            hides = opacity.get(each.name or "", 1.0)
            shapes.append(MeshShape(surface.corners - pivot, surface.faces, hollow, pose, opacity=hides))
    shapes += [
        _water(force)
        for force in scenario.forces
        if isinstance(force, Buoyancy) and force.surface is not None
    ]
    groups = [group.name for group in scenario.groups]
    for body in scenario.bodies:
        surface = body.shape.triangles()
        shapes.append(MeshShape(surface.corners, surface.faces, group=groups.index(body.name)))
    return tuple(shapes)


def _water(buoyancy: Buoyancy) -> MeshShape:
    """The surface of a fluid, a square of two metres."""
    x, y, z = buoyancy.acceleration
    up = unit((-x, -y, -z))
    corners, faces = _square(up)
    return MeshShape(corners + (buoyancy.surface or 0.0) * np.array(up), faces, fluid=True, opacity=CLEAR)


def _square(up: tuple[float, float, float]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners and triangles of a square of two metres about the origin, with its front along a unit vector."""
    u, v = (np.array(each) for each in perpendicular(up))
    return np.array([u - v, u + v, v - u, -u - v]), np.array([[0, 1, 2], [0, 2, 3]])


def _is_ball(collider: Collider, scenario: Scenario) -> TypeGuard[SphereCollider]:
    """Whether a collider is drawn as a ball at rest that hides what is behind it."""
    if not isinstance(collider, SphereCollider) or collider.inside or collider.motion is not None:
        return False
    return collider.name not in scenario.render.opacity


def _pose(collider: Collider, time: float) -> Pose:
    """Where the pivot of a collider that moves is [m], and how it is turned."""
    frame = frame_at(collider.body(), time, 0.0)
    rotation = np.eye(3) if frame.rows is None else np.array(frame.rows)
    return (float(frame.x), float(frame.y), float(frame.z)), rotation
