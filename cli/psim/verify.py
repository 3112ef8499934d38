"""`psim verify`: whether a scenario converges as its method promises."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from psim.annotations import annotate
from psim.console import paint, plain, print_json, say
from psim.options import Overrides, Quiet, ScenarioFile, Threads
from psim.progress import run_progress

if TYPE_CHECKING:
    from particlesim.verification.convergence import Convergence, Verification

_WORDS = {
    "ok": "as promised",
    "exact": "exact to rounding",
    "rounding": "rounding hides it",
    "below": "BELOW ITS METHOD",
    "random": "random kicks have no order",
}
_HEAD = ("group", "field", "|dt − dt/2|", "|dt/2 − dt/4|", "order", "method", "error at dt", "verdict")


def verify(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    threads: Threads = None,
    quiet: Quiet = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as one JSON object.")] = False,
) -> None:
    """Run a scenario at dt, dt/2 and dt/4, and see how fast it converges.

    Prints the observed order of every group beside that of its method, and Richardson's estimate of the error at dt. Exit
    code 1 when an order is clearly below that of its method, with the known reasons. Notes name colliders with
    tangential_loss, on which particles slide by a distance that depends on dt.
    """
    import particlesim as ps
    from particlesim.verification.convergence import verify as converge

    loaded = ps.load(scenario, overrides or ())
    with run_progress(scenario.stem, quiet=quiet or as_json) as progress:
        found = converge(loaded, threads=threads, progress=progress)
    code = 0 if found.passed else 1
    if as_json:
        print_json({"scenario": str(scenario), **found.as_data(), "exit_code": code})
    elif not quiet:
        _show(found, str(scenario))
    elif code:
        _show_failures(found)
    for row in found.rows:
        if row.verdict == "below":
            annotate("error", _failure(row), scenario)
    if code:
        raise typer.Exit(code)


def _show(found: Verification, name: str) -> None:
    """The table, reasons, and notes, on stdout."""
    out = sys.stdout
    steps = ", ".join(f"{step:.6g}" for step in found.steps)
    print(paint(f"{name} at dt = {steps} s", "bold", out))
    lines = [_HEAD, *(_cells(row) for row in found.rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for number, line in enumerate(lines):
        text = "  ".join(
            f"{cell:<{width}}" if k in (0, 1, 7) else f"{cell:>{width}}"
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        bad = number and found.rows[number - 1].verdict == "below"
        print("  " + (paint(text, "red", out) if bad else paint(text, "dim", out) if not number else text))
    for reason in found.reasons:
        print(f"  {paint('reason', 'cyan', out)}: {reason}")
    for note in found.notes:
        print(f"  {paint('note', 'yellow', out)}: {note}")
    if not found.passed and not found.reasons:
        unknown = "none is known; a step that does not resolve the motion, or chaos, hides the order"
        print(f"  {paint('reason', 'cyan', out)}: {unknown}")


def _show_failures(found: Verification) -> None:
    """What is below its method, on stderr."""
    for row in found.rows:
        if row.verdict == "below":
            say(f"{paint('below its method', 'red')}: {plain(_failure(row))}")


def _failure(row: Convergence) -> str:
    return f"{row.field} of {row.group}: {row.method} has the order {row.expected}, and {row.order:.2f} is observed"


def _cells(row: Convergence) -> tuple[str, ...]:
    order = "–" if row.order is None else f"{row.order:.2f}"
    error = "–" if row.error is None else f"{row.error:.2e}"
    coarse, fine = (f"{value:.2e}" for value in row.differences)
    method = f"{row.method}, {row.expected}"
    verdict = _WORDS[row.verdict]
    if row.verdict == "ok" and row.order is not None and row.order > row.expected + 0.5:
        verdict = "above its method; a longer step may show its own"
    return row.group, row.field, coarse, fine, order, method, error, verdict
