"""`psim render`: make a video or pictures of a trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psim.options import Force, Frames, Overrides, Quiet, Threads, TrajectoryFile, parse_frames

if TYPE_CHECKING:
    from particlesim.render.video import RenderReport


def render(
    trajectory: TrajectoryFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="What to write: .mp4, .webp or .png; the trajectory's name with .mp4 by default.",
        ),
    ] = None,
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="Width and height in pixels, such as 1280x720.")
    ] = None,
    look: Annotated[str | None, typer.Option(help="How particles are drawn: spheres or dots.")] = None,
    fps: Annotated[float | None, typer.Option(help="Pictures per second of video.")] = None,
    speed: Annotated[float | None, typer.Option(help="Simulated seconds per second of video.")] = None,
    color_by: Annotated[
        str | None, typer.Option(metavar="FIELD", help="Field that colours particles, or none.")
    ] = None,
    camera_eye: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help=r"Where the camera is \[m].")
    ] = None,
    camera_target: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help=r"What the camera looks at \[m].")
    ] = None,
    frames: Frames = None,
    overrides: Overrides = None,
    force: Force = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Render a trajectory to a video or to pictures.

    The look is that of the scenario's \\[render] table; options change it, and --set render.KEY=VALUE changes anything in
    it. Several PNG pictures are numbered. Nothing half-written is left behind, whatever happens.
    """
    import json

    import particlesim as ps
    from psim.console import print_path, say, warn
    from psim.progress import render_progress

    given = {"look": look, "color_by": color_by, "fps": fps, "speed": speed}
    settings = [f"render.{name}={json.dumps(value)}" for name, value in given.items() if value is not None]
    if size is not None:
        settings.append(f"render.size=[{_numbers(size, 'x', 2, '--size', '1280x720')}]")
    if camera_eye is not None:
        settings.append(f"render.camera.eye=[{_numbers(camera_eye, ',', 3, '--camera-eye', '4,2,6')}]")
    if camera_target is not None:
        settings.append(
            f"render.camera.target=[{_numbers(camera_target, ',', 3, '--camera-target', '0,1,0')}]"
        )
    out = output or trajectory.with_suffix(".mp4")
    with render_progress(out.name, quiet=quiet) as progress:
        made = ps.film(
            trajectory,
            out,
            [*settings, *(overrides or ())],
            frames=parse_frames(frames),
            overwrite=force,
            threads=threads,
            progress=progress,
        )
    if quiet:
        return
    for text in made.warnings:
        warn(text)
    say(_took(made))
    for path in made.paths:
        print_path(path)


def _took(made: RenderReport) -> str:
    """'181 pictures in 31.2 s, 12.1 s of them for compiling kernels, which are kept; 9.5 per second'."""
    from psim.console import counted, duration
    from psim.summary import LONG

    text = f"{counted(made.frames, 'picture')} in {duration(made.seconds)}"
    if made.compiling >= LONG:
        text += f", {duration(made.compiling)} of them for compiling kernels, which are kept"
    seconds = made.seconds - made.compiling
    return text + (f"; {made.frames / seconds:.1f} per second" if seconds > 0 else "")


def _numbers(text: str, separator: str, count: int, option: str, example: str) -> str:
    """The numbers of an option, as TOML separates them. Raises UsageError unless there are `count` of them."""
    from particlesim.errors import UsageError

    parts = [part.strip() for part in text.lower().split(separator)]
    try:
        [float(part) for part in parts]
    except ValueError:
        parts = []
    if len(parts) != count:
        raise UsageError(f"{option} {text!r} is not {count} numbers", f"Write it as {option} {example}.")
    return ", ".join(parts)
