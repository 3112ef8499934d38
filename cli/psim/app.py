"""The command `psim`: its subcommands, and the way in.

Only Typer is imported here; every subcommand imports what it needs when it is called, so that help is instant.
"""

from __future__ import annotations

import gc
import importlib
import sys
from collections.abc import Iterable
from typing import Annotated, Any

import typer

from psim import std_streams as standard
from psim.report import guarded, report
from psim.signals import INTERRUPTED, end_at_once, listen

_SIMULATE, _LOOK, _LEARN = "Simulate", "Look", "Learn"

# name of the command, of its module and of its function; help panel; examples
_COMMANDS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    (
        "run",
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
        _SIMULATE,
        (
            "psim fit ball.toml measured.csv --vary forces.air.coefficient=0,2 -o fitted.toml",
            "psim fit ball.toml --aim ball --target 40,0,0",
        ),
    ),
    (
        "verify",
        _SIMULATE,
        ("psim verify orbit.toml", "psim verify orbit.toml --set simulation.dt=1e-3 --json"),
    ),
    (
        "check",
        _SIMULATE,
        ("psim check scenarios/*.toml", "psim check fountain.toml --set emitters.drops.rate=1e6"),
    ),
    (
        "stability",
        _SIMULATE,
        (
            "psim stability orbit.toml",
            "psim stability orbit.toml --set simulation.dt=86400 --plot region.png",
        ),
    ),
    (
        "render",
        _LOOK,
        (
            "psim render outputs/fountain.vtkhdf",
            "psim render outputs/fountain.vtkhdf -o still.png --frames=-1: --look dots --color-by y",
            "psim render outputs/fountain.vtkhdf -o turn.webp --size 640x360 --set render.camera.orbit=20",
        ),
    ),
    (
        "inspect",
        _LOOK,
        ("psim inspect outputs/fountain.vtkhdf", "psim inspect outputs/fountain.vtkhdf --json"),
    ),
    (
        "diff",
        _LOOK,
        (
            "psim diff outputs/a.vtkhdf outputs/b.vtkhdf",
            "psim diff fine.vtkhdf coarse.vtkhdf --tolerance 1e-6",
        ),
    ),
    (
        "rerun",
        _LOOK,
        ("psim rerun outputs/fountain.vtkhdf", "psim rerun theirs.vtkhdf --tolerance 1e-9 -o mine.vtkhdf"),
    ),
    (
        "plot",
        _LOOK,
        (
            "psim plot outputs/fountain.vtkhdf energy",
            "psim plot outputs/fountain.vtkhdf y --ids 0,1,2 -o height.svg",
        ),
    ),
    (
        "export",
        _LOOK,
        (
            "psim export outputs/fountain.vtkhdf -o last.csv --frames=-1:",
            "psim export outputs/fountain.vtkhdf -o all.npz",
        ),
    ),
    (
        "migrate",
        _LEARN,
        ("psim migrate old.toml", "psim migrate --check scenarios/*.toml"),
    ),
    ("new", _LEARN, ("psim new sparks --template emitter",)),
    ("examples", _LEARN, ("psim examples", "psim examples fountain --copy .")),
    ("describe", _LEARN, ("psim describe", "psim describe drag", "psim describe rk4")),
    ("graph", _LEARN, ("psim graph fountain.toml", "psim graph fountain.toml --mermaid >> README.md")),
    ("schema", _LEARN, ("psim schema -o psim.schema.json",)),
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from particlesim.version import __version__

        print(f"psim {__version__}")
        raise typer.Exit


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


def _app(names: Iterable[str]) -> typer.Typer:
    """The command line with these subcommands: Typer takes a while to look at the parameters of all of them."""
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
    app.callback()(_psim)
    for name, panel, examples in _COMMANDS:
        if name in names:
            function = getattr(importlib.import_module(f"psim.{name}"), name)
            app.command(
                name,
                help=_unwrapped(function.__doc__),
                rich_help_panel=panel,
                epilog="[bold]Examples[/bold]\n\n" + "\n\n".join(examples).replace("[", r"\["),
                no_args_is_help=name not in ("schema", "examples", "describe"),
            )(guarded(function))
    return app


_NAMES = tuple(name for name, *_ in _COMMANDS)


def __getattr__(name: str) -> Any:
    """`psim.app.app`, with all subcommands: made when it is asked for."""
    if name != "app":
        raise AttributeError(f"module 'psim.app' has no attribute {name!r}")
    app = globals()["app"] = _app(_NAMES)
    return app


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
        asked = sys.argv[1:2]
        _app(asked if asked and asked[0] in _NAMES else _NAMES)(prog_name="psim")
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
