"""References of checks: trajectories known to be right, which only `bless` writes."""

from __future__ import annotations

import shutil
from pathlib import Path

from particlesim.errors import UsageError
from particlesim.scenario.named_files import reference_files
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.target import check_target, replacing


def reference_paths(scenario: Scenario) -> tuple[Path, ...]:
    """The references that the checks of a scenario name, each once."""
    return tuple(dict.fromkeys(file.path for file in reference_files(scenario)))


def check_references(scenario: Scenario, output: Path | None, *, bless: bool) -> None:
    """Refuse a run that would write over its own reference, and a blessing that could not be given. Raises UsageError."""
    paths = reference_paths(scenario)
    for path in paths:
        if output is not None and path.resolve() == output.resolve():
            raise UsageError(
                f"{path} is the reference of a check, which only psim run --bless writes",
                "Choose another output.",
            )
        if bless:
            _check_beside(path, scenario)
            check_target(path, overwrite=True)
    if bless and not paths:
        raise UsageError(
            "no check of the scenario has a reference to bless",
            'Such as: quantity = "position", reference = "reference.vtkhdf", tolerance = 1e-9',
        )
    if bless and output is None:
        raise UsageError(
            "a reference is a copy of the trajectory, and no trajectory is written", "Give an output."
        )


def _check_beside(path: Path, scenario: Scenario) -> None:
    """A scenario names no place to write to but its own folder, and what is below. Raises UsageError."""
    home = (scenario.folder or Path()).resolve()
    if not path.resolve().is_relative_to(home):
        raise UsageError(
            f"the reference {path} is not in the scenario's folder, or below it",
            "psim run --bless writes nowhere else; use --bless with a scenario in its folder.",
        )


def bless(scenario: Scenario, trajectory: Path) -> tuple[Path, ...]:
    """Make a finished trajectory the reference of all checks that name one; returns what was written.

    Raises InputOutputError when that fails; the earlier references are then as they were.
    """
    paths = reference_paths(scenario)
    for path in paths:
        with replacing(path) as temporary:
            shutil.copyfile(trajectory, temporary)
    return paths
