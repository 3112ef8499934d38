"""The command `psim`: its subcommands, and the way in.

Only Typer is imported here; every subcommand imports what it needs when it is called, so that help is instant.
"""

from __future__ import annotations

import gc
import sys
from typing import Annotated, Any

import typer

from psim import std_streams as standard
from psim.check import check
from psim.describe import describe
from psim.diff import diff
from psim.examples import examples
from psim.export import export
from psim.fit import fit
from psim.graph import graph
from psim.inspect import inspect
from psim.migrate import migrate
from psim.new import new
from psim.plot import plot
from psim.render import render
from psim.report import guarded, report
from psim.rerun import rerun
from psim.run import run
from psim.schema import schema
from psim.signals import INTERRUPTED, end_at_once, listen
from psim.stability import stability
from psim.sweep import sweep
from psim.verify import verify

app = typer.Typer(
    name="psim",
    help="Particle simulations from TOML files: [bold]run[/bold] a scenario, [bold]render[/bold] it, look inside.",
    epilog="[bold]Start here[/bold]\n\n"
    "psim examples fountain --copy .\n\n"
    "psim run fountain.toml --video\n\n"
    "Exit codes: 0 done, 1 a check failed, 2 bad usage or scenario, 3 the simulation diverged, "
    "4 input or output failed, 70 a mistake in psim itself, 130 interrupted.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},
)

_SIMULATE, _LOOK, _LEARN = "Simulate", "Look", "Learn"

# name, function, help panel, examples
_COMMANDS: tuple[tuple[str, Any, str, tuple[str, ...]], ...] = (
    (
        "run",
        run,
        _SIMULATE,
        (
            "psim run fountain.toml --video",
            "psim run fountain.toml --set simulation.dt=1e-3 --set forces.air.coefficient=0.3 -o fine.vtkhdf",
            "psim run fountain.toml --json > summary.json",
            "psim run fountain.toml --max-wall 10m --resume",
        ),
    ),
    (
        "sweep",
        sweep,
        _SIMULATE,
        (
            "psim sweep fountain.toml --vary forces.air.coefficient=0.1,0.2,0.5 --vary simulation.integrator=heun,rk4",
            "psim sweep fountain.toml --vary 'forces.air.coefficient=linspace(0, 1, 11)' --workers 2 "
            "--plot x=forces.air.coefficient y=energy",
            "psim sweep sweep.toml",
            "psim sweep fountain.toml --vary 'forces.air.coefficient=uniform(0.1, 0.5)' --samples 64 --seed 1",
        ),
    ),
    (
        "fit",
        fit,
        _SIMULATE,
        (
            "psim fit ball.toml measured.csv --vary forces.air.coefficient=0,2 -o fitted.toml",
            "psim fit ball.toml --aim ball --target 40,0,0",
        ),
    ),
    (
        "verify",
        verify,
        _SIMULATE,
        ("psim verify orbit.toml", "psim verify orbit.toml --set simulation.dt=1e-3 --json"),
    ),
    (
        "check",
        check,
        _SIMULATE,
        ("psim check scenarios/*.toml", "psim check fountain.toml --set emitters.drops.rate=1e6"),
    ),
    (
        "stability",
        stability,
        _SIMULATE,
        (
            "psim stability orbit.toml",
            "psim stability orbit.toml --set simulation.dt=86400 --plot region.png",
        ),
    ),
    (
        "render",
        render,
        _LOOK,
        (
            "psim render outputs/fountain.vtkhdf",
            "psim render outputs/fountain.vtkhdf -o still.png --frames=-1: --look dots --color-by y",
            "psim render outputs/fountain.vtkhdf -o turn.webp --size 640x360 --set render.camera.orbit=20",
        ),
    ),
    (
        "inspect",
        inspect,
        _LOOK,
        ("psim inspect outputs/fountain.vtkhdf", "psim inspect outputs/fountain.vtkhdf --json"),
    ),
    (
        "diff",
        diff,
        _LOOK,
        (
            "psim diff outputs/a.vtkhdf outputs/b.vtkhdf",
            "psim diff fine.vtkhdf coarse.vtkhdf --tolerance 1e-6",
        ),
    ),
    (
        "rerun",
        rerun,
        _LOOK,
        ("psim rerun outputs/fountain.vtkhdf", "psim rerun theirs.vtkhdf --tolerance 1e-9 -o mine.vtkhdf"),
    ),
    (
        "plot",
        plot,
        _LOOK,
        (
            "psim plot outputs/fountain.vtkhdf energy",
            "psim plot outputs/fountain.vtkhdf y --ids 0,1,2 -o height.svg",
        ),
    ),
    (
        "export",
        export,
        _LOOK,
        (
            "psim export outputs/fountain.vtkhdf -o last.csv --frames=-1:",
            "psim export outputs/fountain.vtkhdf -o all.npz",
        ),
    ),
    (
        "migrate",
        migrate,
        _LEARN,
        ("psim migrate old.toml", "psim migrate --check scenarios/*.toml"),
    ),
    ("new", new, _LEARN, ("psim new sparks --template emitter",)),
    ("examples", examples, _LEARN, ("psim examples", "psim examples fountain --copy .")),
    ("describe", describe, _LEARN, ("psim describe", "psim describe drag", "psim describe rk4")),
    ("graph", graph, _LEARN, ("psim graph fountain.toml", "psim graph fountain.toml --mermaid >> README.md")),
    ("schema", schema, _LEARN, ("psim schema -o psim.schema.json",)),
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from particlesim.version import __version__

        print(f"psim {__version__}")
        raise typer.Exit


@app.callback()
def _psim(
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", callback=_print_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass


def _unwrapped(text: str) -> str:
    """A docstring with one line per paragraph, which the terminal's width folds."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in text.split("\n\n"))


for _name, _function, _panel, _examples in _COMMANDS:
    app.command(
        _name,
        help=_unwrapped(_function.__doc__),
        rich_help_panel=_panel,
        epilog="[bold]Examples[/bold]\n\n" + "\n\n".join(_examples).replace("[", r"\["),
        no_args_is_help=_name not in ("schema", "examples", "describe"),
    )(guarded(_function))


def main() -> None:
    """Run the command line and end the process with its exit code."""
    # Imports make some hundred thousand objects that live to the end: looking through them again and again, and once more
    # at the end, takes a fifth of the time of a short run.
    gc.set_threshold(100_000)
    standard.prepare()
    code = 0
    try:
        listen()
        code = _call()
        sys.stdout.flush()
    except OSError as error:
        code = report(error) or code
    except KeyboardInterrupt:  # before the subcommand began, or after it ended
        code = code or INTERRUPTED
    end_at_once(code)
    gc.freeze()
    sys.exit(code)


def _call() -> int:
    """Run the command line; returns its exit code. Raises OSError when help or a version cannot be printed."""
    try:
        app(prog_name="psim")
    except SystemExit as end:
        cause = end.__context__
        if isinstance(cause, BrokenPipeError):  # Typer found the reader of the help gone
            standard.discard_output()
            return 0
        if isinstance(cause, typer.Abort):  # Ctrl-C before the subcommand began
            return INTERRUPTED
        if end.code == 2 and "--json" in sys.argv[1:]:
            _usage_as_json(cause)
        return int(end.code or 0)
    return 0


def _usage_as_json(error: BaseException | None) -> None:
    """A mistake in the arguments, which Typer has explained on stderr, for programs that read stdout."""
    if error is not None and hasattr(error, "format_message"):
        import json

        print(json.dumps({"error": error.format_message(), "exit_code": 2}, ensure_ascii=False))
