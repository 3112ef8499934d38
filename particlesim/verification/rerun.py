"""Repeat a run from what its trajectory holds, and compare."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from particlesim.analysis.difference import Comparison, compare
from particlesim.errors import DivergenceError, UsageError
from particlesim.runs.runner import Progress, run
from particlesim.scenario.extensions import unavailable
from particlesim.scenario.load import scenario_of
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.source import parse_source
from particlesim.trajectory import reader
from particlesim.trajectory.reader import Trajectory

PARTIAL = ("interrupted", "failed", "running")
"""How runs stand that have fewer frames than their scenario asks for."""


def recorded_scenario(trajectory: Trajectory) -> Scenario:
    """The scenario as it was run, overrides included, with relative paths starting where they did.

    Raises UsageError when the file holds none, or when a package is missing that a type of it comes from; ScenarioError when
    this version of psim cannot read it.
    """
    if not trajectory.scenario:
        raise UsageError(f"{trajectory.path} does not hold its scenario")
    if missing := unavailable(str(trajectory.provenance.get("extensions", ""))):
        raise UsageError(
            f"the run of {trajectory.path} needs {' and '.join(missing)}, which is not installed",
            "Install it, in this version for the same bits.",
        )
    folder = str(trajectory.provenance.get("folder", ""))
    return scenario_of(parse_source(trajectory.scenario), (), Path(folder) if folder else None)


def rerun(
    path: Path,
    output: Path | None = None,
    *,
    tolerance: float = 0.0,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Comparison:
    """Run what the trajectory `path` holds once more, and compare the two; the new one is kept as `output`, if given.

    A run that diverged diverges again, and the frames before that are compared; so are those of a run that was interrupted,
    with the first frames of the new one.
    Raises as `runner.run` and `analysis.difference.compare` do.
    """
    with reader.open(path) as original:
        scenario = recorded_scenario(original)
        if output is not None and output.exists() and output.samefile(path):
            raise UsageError("a run cannot be repeated onto itself", "Choose another --output.")
        with tempfile.TemporaryDirectory(prefix="psim-") as folder:
            target = output if output is not None else Path(folder) / "again.vtkhdf"
            try:
                run(scenario, target, overwrite=overwrite, threads=threads, progress=progress)
            except DivergenceError:
                if original.status != "diverged":
                    raise
            with reader.open(target) as again:
                return compare(original, again, tolerance=tolerance, part=original.status in PARTIAL)
