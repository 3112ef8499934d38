"""Errors and interruptions: the one place that turns them into messages and exit codes."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from psim.console import paint, plain
from psim.signals import requested
from psim.std_streams import OUTPUT, discard_output

if TYPE_CHECKING:
    from particlesim.errors import Diagnostic, PsimError

BUG = 70
"""Exit code of a mistake in psim itself (EX_SOFTWARE of sysexits.h): never taken for a failed check."""

_ISSUES = "please report it, with the scenario and the lines above, where you got psim from"


def guarded(command: Callable[..., Any]) -> Callable[..., Any]:
    """A subcommand whose errors are told to the user, and end it with their exit code."""

    @functools.wraps(command)
    def call(**arguments: Any) -> None:
        try:
            command(**arguments)
            sys.stdout.flush()
            if requested():  # it was swallowed, as the end of an object's life does
                raise KeyboardInterrupt
        except Exception as error:
            raise typer.Exit(report(error, as_json=bool(arguments.get("as_json")))) from None
        except KeyboardInterrupt as error:
            raise typer.Exit(report(error, as_json=bool(arguments.get("as_json")))) from None

    return call


def report(error: BaseException, *, as_json: bool = False) -> int:
    """Tell `error`, on stderr or as JSON on stdout; return the exit code that belongs to it."""
    from particlesim.errors import OutputExistsError, PsimError

    if isinstance(error, typer.Exit):
        return int(error.exit_code)
    if _is_usage(error):  # Typer shows its own
        raise error
    if isinstance(error, BrokenPipeError):
        discard_output()  # the reader has gone (`psim schema | head`), which is no mistake
        return 0
    if os.environ.get("PSIM_DEBUG", "") not in ("", "0"):
        _print_traceback(error)
    told: PsimError = error if isinstance(error, PsimError) else _as_psim_error(error)
    if isinstance(told, OutputExistsError):
        told.hint = "Overwrite it with --force, or choose another name."
    from psim.annotations import annotate_error

    annotate_error(told)
    if as_json and _print_json(told):
        return told.exit_code
    if getattr(error, "filename", None) == OUTPUT:
        discard_output()
    _print(told)
    return told.exit_code


def _print_json(error: PsimError) -> bool:
    """The error as JSON on stdout; returns whether that worked."""
    import json

    try:
        print(json.dumps(as_data(error), ensure_ascii=False), flush=True)
    except OSError:
        discard_output()
        return False
    return True


def _print_traceback(error: BaseException) -> None:
    import traceback

    traceback.print_exception(error)


def _is_usage(error: BaseException) -> bool:
    """Whether it is an error of the parser of arguments. (Typer carries Click's classes under changing names.)"""
    return hasattr(error, "format_message")


def _as_psim_error(error: BaseException) -> Any:
    """The error of the library that says what happened; a bug shows its traceback."""
    import errno

    from particlesim.errors import InputOutputError, Interrupted, PsimError

    if isinstance(error, KeyboardInterrupt) or (not isinstance(error, OSError) and requested()):
        return Interrupted("stopped")
    if isinstance(error, MemoryError):
        detail = f": {error}" if str(error) else ""
        return InputOutputError(f"out of memory{detail}", 'Use fewer particles, or precision = "single".')
    if isinstance(error, OSError):
        what = f"{error.filename}: " if error.filename else ""
        hint = "Free some space, or write elsewhere." if error.errno == errno.ENOSPC else None
        return InputOutputError(f"{what}{error.strerror or error}", hint)
    _print_traceback(error)
    bug = PsimError(f"this is a mistake in psim: {type(error).__name__}: {error}", _ISSUES)
    bug.exit_code = BUG
    return bug


def _print(error: Any) -> None:
    """The message and the hint; mistakes in a scenario with the lines they stand in."""
    from particlesim.errors import Interrupted, ScenarioError

    color = sys.stderr.isatty() and "NO_COLOR" not in os.environ
    if isinstance(error, ScenarioError):
        from particlesim.scenario.text.report import render_all

        print(render_all(error.diagnostics, color=color), file=sys.stderr)
        return
    word, style = ("interrupted", "yellow") if isinstance(error, Interrupted) else ("error", "red")
    print(f"{paint(word, style)}: {plain(error.message)}", file=sys.stderr)
    if error.hint:
        print(f"  {paint('help', 'cyan')}: {plain(error.hint)}", file=sys.stderr)


def as_data(error: Any) -> dict[str, Any]:
    """An error as plain data, for JSON."""
    data = {"error": error.message, "hint": error.hint, "exit_code": error.exit_code}
    if (found := getattr(error, "post_mortem", None)) is not None:
        data["post_mortem"] = asdict(found)
    return data | {"diagnostics": [_diagnostic(d) for d in getattr(error, "diagnostics", ())]}


def _diagnostic(diagnostic: Diagnostic) -> dict[str, Any]:
    span = diagnostic.span
    return {
        "message": diagnostic.message,
        "path": diagnostic.path,
        "file": None if diagnostic.file is None else str(diagnostic.file),
        "line": None if span is None else span.line,
        "column": None if span is None else span.column,
        "allowed": diagnostic.allowed,
        "hint": diagnostic.hint,
    }
