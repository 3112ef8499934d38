"""`psim run`: run a scenario, write its trajectory and, on request, its video."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psim.junit import reported
from psim.options import (
    CheckpointEvery,
    CheckpointWall,
    Force,
    JUnit,
    MaxWall,
    Overrides,
    Quiet,
    Resume,
    ScenarioFile,
    Threads,
    parse_seconds,
)
from psim.progress import render_progress, run_progress, told_when_long

if TYPE_CHECKING:
    from particlesim.runs.filming import Filming
    from particlesim.runs.runner import Progress, Result
    from particlesim.scenario.scenario import Scenario

VIDEO_SIZE = [1280, 720]
"""Pixels of a video that comes with a run, unless the scenario says another size: most of its time goes into pictures."""


def run(
    scenario: ScenarioFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The trajectory to write; outputs/SCENARIO.vtkhdf by default.",
        ),
    ] = None,
    overrides: Overrides = None,
    force: Force = False,
    video: Annotated[
        bool,
        typer.Option(
            "--video",
            help="Also render an MP4 beside the trajectory, of 1280x720 pixels unless the scenario says another size.",
        ),
    ] = False,
    threads: Threads = None,
    quiet: Quiet = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the summary, or the error, as JSON; nothing else.")
    ] = False,
    junit: JUnit = None,
    bless: Annotated[
        bool,
        typer.Option(
            "--bless",
            help="Make the trajectory the reference of the checks that name one, if all other checks pass.",
        ),
    ] = False,
    resume: Resume = False,
    checkpoint_every: CheckpointEvery = None,
    checkpoint_wall: CheckpointWall = None,
    max_wall: MaxWall = None,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes", help="Run even if memory or disk may not suffice, by upper bounds of what the run needs."
        ),
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Print what would run and about how long it would take, and stop."),
    ] = False,
) -> None:
    """Run a scenario and write its trajectory.

    The trajectory opens in ParaView as it is. Shows progress and ends with a summary; the paths of what was written go to
    stdout. Ctrl-C keeps every frame that was finished, and --resume continues from there. Exit code 1 when a check of the
    scenario fails.
    """
    options = {
        "overwrite": force,
        "threads": threads,
        "bless": bless,
        "resume": resume,
        "must_fit": not yes,
        "checkpoint_every": parse_seconds("--checkpoint-every", checkpoint_every),
        "checkpoint_wall": parse_seconds("--checkpoint-wall", checkpoint_wall),
        "max_wall": parse_seconds("--max-wall", max_wall),
    }
    if dry_run:
        _dry_run(scenario, overrides, output, threads, as_json, must_fit=not yes)
        return
    quiet = quiet or as_json
    said: list[str] = []
    with reported(junit, scenario.stem) as report:
        loaded, path = _prepare(scenario, overrides, output)
        film = path.with_suffix(".mp4") if video else None
        report.keep_apart(path, film)
        _check_targets(loaded, path, film, force, resume)
        if film is None:
            result = _simulate(loaded, scenario, path, quiet, options, said)
            report.of_run(result)
            warnings = list(result.warnings)
        else:
            with _filming(loaded, film, force or resume, threads) as filming:
                result = _simulate(loaded, scenario, path, quiet, options, said, filming)
                report.of_run(result)
                warnings = [*result.warnings, *_render(path, film, filming, quiet)]
    _tell(result, scenario, film, warnings, said, quiet=quiet, as_json=as_json)
    if bless and result.passed and not quiet:
        _show_blessed(loaded)
    if not result.passed:
        raise typer.Exit(1)


def _tell(
    result: Result,
    scenario: Path,
    film: Path | None,
    warnings: list[str],
    said: list[str],
    *,
    quiet: bool,
    as_json: bool,
) -> None:
    """How a run ended, for people or as JSON, without the warnings that were `said` before; failures as annotations, too."""
    from psim.annotations import annotate_checks
    from psim.console import print_json, print_path
    from psim.summary import show_failures, show_summary, summary

    told = summary(result, scenario, film, warnings)
    if as_json:
        print_json(told)
    elif not quiet:
        unsaid = [text for text in warnings if text not in said]
        show_summary({**told, "warnings": unsaid}, result.scenario)
        for path in (result.path, film):
            if path is not None:
                print_path(path)
    if not result.passed:
        annotate_checks(result, scenario)
        if not as_json:
            show_failures(result)


def _show_blessed(loaded: Scenario) -> None:
    from particlesim.runs.references import reference_paths
    from psim.console import say

    for reference in reference_paths(loaded):
        say(f"written: {reference}, the reference of later runs")


def _output(scenario: Path, output: Path | None) -> Path:
    """Where the trajectory goes. Raises UsageError for a name that no reader would take for one."""
    from particlesim.errors import UsageError
    from particlesim.trajectory.target import check_trajectory_name
    from psim.plan import default_output

    path = default_output(scenario) if output is None else output
    if path.suffix.lower() == ".mp4":
        raise UsageError(f"{path} is a name for a video", "For a video beside the trajectory: --video.")
    check_trajectory_name(path)
    return path


def _prepare(scenario: Path, overrides: list[str] | None, output: Path | None) -> tuple[Scenario, Path]:
    """The scenario, and where its trajectory goes. Raises UsageError."""
    import particlesim as ps

    return ps.load(scenario, overrides or ()), _output(scenario, output)


def _dry_run(
    scenario: Path,
    overrides: list[str] | None,
    output: Path | None,
    threads: int | None,
    as_json: bool,
    *,
    must_fit: bool,
) -> None:
    from particlesim.preflight.run_time import estimated_seconds
    from psim.console import print_json
    from psim.plan import plan, show_plan

    loaded, path = _prepare(scenario, overrides, output)
    with told_when_long(scenario.stem, quiet=as_json):
        planned = plan(loaded, path, must_fit=must_fit)
        planned["seconds"] = estimated_seconds(loaded, threads=threads)
    if as_json:
        print_json({"scenario": str(scenario), **planned, "exit_code": 0})
    else:
        show_plan(str(scenario), planned, loaded)


def _check_targets(loaded: Scenario, path: Path, film: Path | None, force: bool, resume: bool) -> None:
    """Refuse what could not be written at the end, before anything is computed."""
    from particlesim.trajectory.target import check_target

    check_target(path, overwrite=force or resume)
    if film is not None:
        from particlesim.render.film import check_film

        check_film(loaded, film, overwrite=force or resume)


def _filming(loaded: Scenario, film: Path, overwrite: bool, threads: int | None) -> Filming:
    """What makes the video of a run."""
    from particlesim.runs.filming import Filming, Video

    size = {} if "size" in loaded.render.model_fields_set else {"render.size": VIDEO_SIZE}
    return Filming(Video(film, size, overwrite, threads))


def _simulate(
    loaded: Scenario,
    scenario: Path,
    path: Path,
    quiet: bool,
    options: dict[str, Any],
    said: list[str],
    filming: Filming | None = None,
) -> Result:
    """Run with the options of `ps.run`; an error in the middle says where the frames before it are. What is warned of at
    the start goes to `said`."""
    import particlesim as ps
    from psim.console import warn

    def tell(text: str) -> None:
        warn(text, loaded)
        said.append(text)

    try:
        with run_progress(scenario.stem, quiet=quiet) as shown:

            def progress(now: Progress) -> None:
                if filming is not None:
                    filming.begin(path)
                if shown is not None:
                    shown(now)

            return ps.run(loaded, path, progress=progress, warn=None if quiet else tell, **options)
    except (ps.Interrupted, ps.DivergenceError) as error:
        kept = f"every frame before that is in {path}"
        if isinstance(error, ps.Interrupted):
            kept += "; --resume continues from there"
        error.hint = f"{error.hint.rstrip('.')}; {kept}" if error.hint else kept
        raise


def _render(path: Path, film: Path, filming: Filming, quiet: bool) -> list[str]:
    """Wait for the video of the trajectory; returns what to warn of. An error, or a stop, tells that the latter
    is there."""
    import shlex

    import particlesim as ps
    from psim.signals import requested

    kept = f"the trajectory {path} is complete; its video: psim render {shlex.quote(str(path))}"
    kept += " --force" if film.exists() else ""
    try:
        with render_progress(film.name, quiet=quiet) as progress:
            return list(filming.finish(path, progress).warnings)
    except ps.PsimError as error:
        error.hint = f"{error.hint.rstrip('.')}; {kept}" if error.hint else kept
        raise
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) or requested():
            raise ps.Interrupted("stopped while the video was made", kept) from None
        raise
