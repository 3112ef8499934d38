"""Annotations of GitHub Actions: lines on stderr that the runner shows beside the file they speak of.

Source: GitHub Docs, "Workflow commands for GitHub Actions".
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from particlesim.errors import PsimError
    from particlesim.runs.runner import Result


def annotate(
    level: str, message: str, file: Path | None = None, line: int | None = None, column: int | None = None
) -> None:
    """Tell GitHub an "error" or a "warning"; without effect elsewhere."""
    if os.environ.get("GITHUB_ACTIONS") != "true":
        return
    facts = {"file": None if file is None else _in_repository(file), "line": line, "col": column}
    shown = ",".join(f"{key}={_property(str(value))}" for key, value in facts.items() if value is not None)
    print(f"::{level} {shown}".rstrip() + f"::{_data(message)}", file=sys.stderr)


def annotate_error(error: PsimError) -> None:
    """An error, at the place of every mistake in a scenario."""
    from particlesim.errors import ScenarioError

    if not isinstance(error, ScenarioError):
        annotate("error", str(error))
        return
    for mistake in error.diagnostics:
        span = mistake.span if mistake.file is not None else None
        hints = (mistake.allowed and f"allowed: {mistake.allowed}", mistake.hint)
        text = "\n".join(part for part in (mistake.message, *hints) if part)
        annotate(
            "error",
            text,
            mistake.file,
            None if span is None else span.line,
            None if span is None else span.column,
        )


def annotate_checks(result: Result, file: Path) -> None:
    """The checks that failed, at their places in the scenario."""
    for check in result.checks:
        if not check.passed:
            annotate("error", f"check failed: {check.message}", file, _line(result, check.name))


def _line(result: Result, name: str) -> int | None:
    """The line of a check in the scenario's file."""
    from particlesim.scenario.rules.checks import check_labels

    source = result.scenario.source
    labels = check_labels(result.scenario)
    if source is None or name not in labels:
        return None
    place = source.main.found.places.get(("checks", labels.index(name)))
    return None if place is None else source.main.span(place.value).line


def _in_repository(file: Path) -> str:
    """The path as GitHub knows it: from the root of the repository."""
    root = os.environ.get("GITHUB_WORKSPACE", "")
    absolute = file.resolve()
    return absolute.relative_to(root).as_posix() if root and absolute.is_relative_to(root) else str(file)


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
