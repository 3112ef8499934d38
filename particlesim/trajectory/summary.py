"""The summary of a run in its finished trajectory: JSON in /psim/summary, which has no checksum."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from particlesim.trajectory.files import damaged

_CHECK: dict[str, tuple[type, ...]] = {
    "name": (str,),
    "quantity": (str,),
    "passed": (bool,),
    "value": (int, float, type(None)),
    "bound": (str,),
    "time": (int, float, type(None)),
    "message": (str,),
}


def read_summary(text: bytes, path: Path) -> dict[str, Any]:
    """A JSON object of numbers and text; empty for a run that has not ended. Raises UsageError for anything else."""
    told = _parse(text or b"{}")
    if not isinstance(told, dict) or not all(isinstance(value, int | float | str) for value in told.values()):
        raise damaged(path, "its summary cannot be read")
    return told


def recorded_checks(summary: dict[str, Any], path: Path) -> list[dict[str, Any]]:
    """Results of checks in the summary of `path`, each with the fields of a CheckResult; a value that is not finite is
    None. Raises UsageError for anything else.
    """
    told = _parse(summary.get("checks", "[]"))
    if not isinstance(told, list) or not all(_is_check(each) for each in told):
        raise damaged(path, "its results of checks cannot be read")
    return told


def _parse(text: Any) -> Any:
    """Data of JSON; None where it is none."""
    try:
        return json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None


def _is_check(told: Any) -> bool:
    return (
        isinstance(told, dict)
        and told.keys() == _CHECK.keys()
        and all(isinstance(told[key], kinds) for key, kinds in _CHECK.items())
    )
