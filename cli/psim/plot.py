"""`psim plot`: draw a quantity over time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psim.options import Force, Quiet, TrajectoryFile


def plot(
    trajectory: TrajectoryFile,
    quantity: Annotated[
        str,
        typer.Argument(
            metavar="QUANTITY",
            help="energy, drift, momentum, angular_momentum, count, pressure, displacement, kinetic_temperature, rdf, "
            "density_profile, power_spectrum, or a component such as x, vy, speed, temperature.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Image to write: .png, .svg or .pdf; TRAJECTORY-QUANTITY.png by default.",
        ),
    ] = None,
    ids: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Only the particles with these ids.")
    ] = None,
    group: Annotated[
        str | None, typer.Option(metavar="NAME", help="Only the particles of this group.")
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Draw a quantity of a trajectory over time, or how particles are arranged in its last frame: rdf (the radial
    distribution), density_profile, power_spectrum.

    Up to 12 particles get a line each, more are shown as median and bands. Needs matplotlib:
    pip install 'particlesim\\[plot]'.
    """
    import particlesim as ps
    from particlesim.analysis.plot import plot as draw
    from psim.console import print_path

    chosen = None if ids is None else _ids(ids)
    out = output or trajectory.with_name(f"{trajectory.stem}-{quantity}.png")
    with ps.open(trajectory) as opened:
        draw(opened, quantity, out, ids=chosen, group=group, overwrite=force)
    if not quiet:
        print_path(out)


def _ids(text: str) -> list[int]:
    """Ids from '0,5,7'. Raises UsageError."""
    from particlesim.errors import UsageError

    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(f"--ids {text!r} is not a list of ids", "Write them as --ids 0,5,7.") from None
