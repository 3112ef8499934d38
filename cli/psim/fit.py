"""`psim fit`: parameters from measured trajectories, or the launch that hits a target."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psim.complete import override_keys
from psim.console import facts, number, print_json, print_path, say, warn
from psim.options import Force, Overrides, Quiet, ScenarioFile

if TYPE_CHECKING:
    from particlesim.fit import Aim, Fit, Shot


def fit(
    scenario: ScenarioFile,
    data: Annotated[
        Path | None,
        typer.Argument(
            metavar="[DATA.csv]",
            help=r"Measurements: columns time, id, x, y, z, vx, vy, vz, sigma_x ...; units in brackets, as x \[mm].",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY[=LOW,HIGH]",
            help="A number of the scenario to be fitted, and its bounds. Repeatable.",
            autocompletion=override_keys,
        ),
    ] = None,
    aim: Annotated[
        str | None, typer.Option("--aim", metavar="GROUP", help="Aim the one particle or body of this group.")
    ] = None,
    target: Annotated[
        str | None, typer.Option("--target", metavar="X,Y,Z", help=r"The point \[m] that --aim has to hit.")
    ] = None,
    overrides: Overrides = None,
    starts: Annotated[
        int,
        typer.Option(
            min=1,
            help="Number of searches: the first from the scenario's values, others from points between the bounds.",
        ),
    ] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Seed of those points.")] = 0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write the scenario with the values found."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE", help="Draw the residuals: .png, .svg or .pdf.")
    ] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON; nothing else.")] = False,
    quiet: Quiet = False,
) -> None:
    """Fit a scenario to measured trajectories, or aim it.

    With DATA.csv and --vary, least squares: the values with standard errors and correlations. With --aim and --target,
    the directions of launch that hit, at the speed that the particle has.
    """
    from particlesim.trajectory.target import check_target

    for path in (output, plot):
        if path is not None:
            check_target(path, overwrite=force)
    point = _aimed_at(aim, target, data is not None or bool(vary) or plot is not None)
    if aim is not None and point is not None:
        _aim(scenario, aim, point, overrides, output, force, as_json, quiet)
        return
    found = _least_squares(
        scenario,
        data,
        vary or (),
        plot,
        force,
        quiet or as_json,
        overrides=overrides or (),
        starts=starts,
        seed=seed,
    )
    if output is not None:
        _write(output, found.scenario, force)
    if as_json:
        print_json(_fit_data(found, output))
        return
    if not quiet:
        _show_fit(found)
    _warn_of(found, scenario)
    for path in (output, plot):
        if path is not None and not quiet:
            print_path(path)


def _aimed_at(aim: str | None, target: str | None, fitted: bool) -> tuple[float, ...] | None:
    """The point to aim at, None when that is not asked for. Raises UsageError for what does not go together."""
    from particlesim.errors import UsageError

    if aim is None and target is None:
        return None
    usage = "psim fit SCENARIO --aim GROUP --target X,Y,Z"
    if fitted:
        raise UsageError("aiming takes no data, --vary or --plot", usage)
    if aim is None or target is None:
        raise UsageError("--aim and --target belong together", usage)
    return _point(target)


def _least_squares(
    scenario: Path,
    data: Path | None,
    vary: Sequence[str],
    plot: Path | None,
    force: bool,
    quiet: bool,
    **options: Any,
) -> Fit:
    """Fit with progress, and draw the residuals where they are asked for; `options` are those of `particlesim.fit`."""
    from particlesim.analysis.figure import check_image, new_figure
    from particlesim.errors import UsageError
    from particlesim.fit import fit as least_squares
    from particlesim.fit import parse_range, read_measurements
    from particlesim.fit.plot import plot_residuals
    from psim.progress import fit_progress

    if data is None:
        raise UsageError(
            "there is nothing to fit to",
            "psim fit SCENARIO DATA.csv --vary KEY, or --aim GROUP --target X,Y,Z",
        )
    ranges = [parse_range(argument) for argument in vary]
    measurements = read_measurements(data)
    if plot is not None:
        check_image(plot, overwrite=force)
        new_figure()
    with fit_progress(scenario.stem, quiet=quiet) as progress:
        found = least_squares(scenario, measurements, ranges, progress=progress, **options)
    if plot is not None:
        plot_residuals(found, measurements, plot, overwrite=force)
    return found


def _point(text: str) -> tuple[float, ...]:
    """Three numbers. Raises UsageError."""
    from particlesim.errors import UsageError

    try:
        parts = tuple(float(part) for part in text.split(","))
    except ValueError:
        parts = ()
    if len(parts) != 3:
        raise UsageError(f"--target {text!r} is not a point", "For example: --target 40,0,0")
    return parts


def _aim(
    scenario: Path,
    group: str,
    target: tuple[float, ...],
    overrides: list[str] | None,
    output: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    from particlesim.fit import aim

    found = aim(scenario, group, target, overrides=overrides or ())
    written = []
    for k, shot in enumerate(found.shots):
        if output is not None:
            path = output if k == 0 else output.with_stem(f"{output.stem}-{k + 1}")
            _write(path, shot.scenario, force)
            written.append(path)
    if as_json:
        print_json({"shots": [_shot_data(shot) for shot in found.shots], "exit_code": 0})
        return
    if not quiet:
        _show_aim(found)
        for path in written:
            print_path(path)


def _write(path: Path, scenario: Any, force: bool) -> None:
    """The resolved scenario as TOML, its files named from where it lies."""
    from particlesim.scenario.named_files import dump_for
    from particlesim.trajectory.target import check_target, replacing

    check_target(path, overwrite=force)
    with replacing(path) as temporary:
        temporary.write_text(dump_for(scenario, path.resolve().parent), encoding="utf-8")


def _show_fit(found: Fit) -> None:
    rows = []
    for p in found.parameters:
        bound = ", at its bound" if p.at_bound else ""
        rows.append((p.key, f"{p.value:.8g} ± {p.error:.2g}{bound} (began at {number(p.start)})"))
    reduced = found.chi2 / found.freedom
    if found.known_sigma:
        rows.append(("χ²", f"{found.chi2:.4g} with {found.freedom} degrees of freedom ({reduced:.3g} each)"))
    for p, row in zip(found.parameters[1:], found.correlation[1:], strict=True):
        for other, value in zip(found.parameters, row, strict=False):
            if other is p:
                break
            rows.append(("correlation", f"{value:+.3f} of {other.key} and {p.key}"))
    if len(found.starts) > 1:
        same = sum(chi2 <= found.starts[0] * 1.001 + 1e-30 for chi2 in found.starts)
        rows.append(("starts", f"{same} of {len(found.starts)} end at this minimum"))
    rows.append(("runs", number(found.runs)))
    facts(rows, sys.stdout)


def _warn_of(found: Fit, scenario: Path) -> None:
    """What is wrong with a result."""
    for key in found.undetermined:
        warn(
            f"the data do not determine {key}: its value is arbitrary, or another parameter can stand in for it"
        )
    for p in found.parameters:
        if p.at_bound:
            warn(f"{p.key} stopped at its bound; its standard error holds only if that bound is true")
    if not found.converged:
        warn("the search ended before it met its tolerances; begin nearer, or with --starts")


def _show_aim(found: Aim) -> None:
    for k, shot in enumerate(found.shots, 1):
        name = f"shot {k}" if len(found.shots) > 1 else "shot"
        side = f", azimuth {shot.azimuth:.6g}°" if abs(shot.azimuth) > 1e-9 else ""
        vector = ", ".join(f"{part:.8g}" for part in shot.velocity)
        facts(
            [
                (
                    name,
                    f"elevation {shot.elevation:.8g}°{side}, velocity [{vector}] m/s, hits after {shot.time:.6g} s",
                )
            ],
            sys.stdout,
        )
    say("one direction hits" if len(found.shots) == 1 else f"{len(found.shots)} directions hit")


def _fit_data(found: Fit, output: Path | None) -> dict[str, Any]:
    return {
        "parameters": {
            p.key: {"value": p.value, "error": p.error, "start": p.start, "at_bound": p.at_bound}
            for p in found.parameters
        },
        "correlation": found.correlation.tolist(),
        "chi2": found.chi2,
        "degrees_of_freedom": found.freedom,
        "sigma_known": found.known_sigma,
        "starts": list(found.starts),
        "runs": found.runs,
        "converged": found.converged,
        "undetermined": list(found.undetermined),
        "scenario": None if output is None else str(output),
        "exit_code": 0,
    }


def _shot_data(shot: Shot) -> dict[str, Any]:
    names = ("elevation", "azimuth", "velocity", "time", "miss")
    return {name: getattr(shot, name) for name in names}
