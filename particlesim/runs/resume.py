"""From where a run can be resumed: its trajectory and checkpoint, examined before anything is computed or changed."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import MisfitError, Snapshot, restore
from particlesim.errors import DivergenceError, UsageError
from particlesim.scenario.changes import changes
from particlesim.scenario.digest import physics_digest
from particlesim.scenario.extensions import recorded
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.checkpoint_file import checkpoint_path, previous_path, read_checkpoint
from particlesim.trajectory.files import DamagedError, damaged
from particlesim.trajectory.places import kind_of
from particlesim.trajectory.reader import Trajectory
from particlesim.trajectory.recovery import recover
from particlesim.version import __version__

MOST_SHOWN = 8
"""Changes of a scenario that an error lists."""
VERIFY = 0.4
"""Seconds in which frames that are kept are read again, the newest first, before a run goes on."""
ANEW = "--force (overwrite=True) starts the run anew."


@dataclass(frozen=True)
class Resumption:
    """Where a run goes on: the checkpoint's facts and state, the frames that are kept with their times [s] and ledger, and
    what to tell the user."""

    facts: dict[str, Any]
    state: Snapshot
    times: list[float]
    rows: list[dict[str, float]]
    notes: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """Frames that are kept."""
        return len(self.times)

    def apply(self, simulation: Simulation, path: Path) -> None:
        """Put the state into a simulation that has not begun. Raises UsageError if it is the state of another."""
        try:
            restore(simulation, self.state)
        except (MisfitError, KeyError) as error:
            raise UsageError(f"the checkpoint of {path} does not belong to this scenario", ANEW) from error


def find(scenario: Scenario, path: Path) -> Resumption | Literal["complete"] | None:
    """Where the run that was to write `path` goes on, "complete" if it has ended, None if it has to begin anew.

    Raises UsageError when the trajectory is of another scenario or version, is being written, or is damaged, and when its
    checkpoints are damaged or of another run; DivergenceError when it diverged.
    """
    if kind_of(path) is None:
        return None
    try:
        found = _find(scenario, path)
        if found == "complete":
            recover(path)  # killed after its last word: the mark of its writer would keep other readers out
        return found
    except DamagedError as error:
        raise UsageError(error.message, ANEW) from error


def _find(scenario: Scenario, path: Path) -> Resumption | Literal["complete"] | None:
    with Trajectory(path) as trajectory:
        _check_same(scenario, trajectory)
        if trajectory.status == "running":
            raise UsageError(
                f"{path} is being written by a running simulation", "Wait for it, or stop it, then resume."
            )
        if trajectory.status == "diverged":
            raise DivergenceError(f"the run of {path} diverged, and would do so again", ANEW)
        if trajectory.status == "complete":
            return "complete"
        found = _latest(path)
        if found is None:
            return None
        facts, arrays, notes = found
        run, frames = trajectory.provenance.get("run"), int(facts["frames"])
        if facts.get("run") != run or len(trajectory) < frames:
            raise UsageError(f"{checkpoint_path(path)} belongs to another run than {path}", ANEW)
        trajectory.verify(frames, VERIFY)
        return Resumption(
            facts,
            Snapshot(arrays, facts["numbers"]),
            trajectory.times[:frames].tolist(),
            _rows(trajectory.ledger, frames),
            notes,
        )


def _check_same(scenario: Scenario, trajectory: Trajectory) -> None:
    """Raise UsageError unless the trajectory is of this scenario and this version of psim."""
    path, version = trajectory.path, trajectory.provenance.get("psim")
    if version != __version__:
        raise UsageError(
            f"{path} was begun by psim {version}, and this is {__version__}; the two may not compute the same bits",
            ANEW,
        )
    found = changes(_table(trajectory), scenario)
    if found:
        shown = [f"{address}: {before} → {after}" for address, before, after in found[:MOST_SHOWN]]
        if len(found) > MOST_SHOWN:
            shown.append(f"and {len(found) - MOST_SHOWN} more")
        raise UsageError(
            f"{path} is of another scenario; changed since: {'; '.join(shown)}",
            f"Undo the changes, or choose another --output. {ANEW}",
        )
    before, now = str(trajectory.provenance.get("extensions", "")), recorded(scenario)
    if before != now:
        was, present = (text.replace("\n", ", ") or "no packages" for text in (before, now))
        raise UsageError(
            f"{path} was begun with other packages, {was}; now there are {present}: the two may not compute the same bits",
            ANEW,
        )
    if trajectory.provenance.get("physics") != physics_digest(scenario):
        raise UsageError(
            f"the files that the particles of {path} come from have changed since the run began",
            f"Put them back as they were, or choose another --output. {ANEW}",
        )


def _table(trajectory: Trajectory) -> dict[str, Any]:
    """The scenario of a trajectory. Raises UsageError when its text, which carries no checksum, is no TOML any more."""
    try:
        return tomllib.loads(trajectory.scenario)
    except ValueError as error:
        raise damaged(trajectory.path, "its scenario cannot be read") from error


def _latest(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]], tuple[str, ...]] | None:
    """The newest checkpoint of a trajectory that is whole; None if there is none. Raises UsageError if all are damaged."""
    problems: list[UsageError] = []
    for candidate in (checkpoint_path(path), previous_path(path)):
        if kind_of(candidate) is None:
            continue
        try:
            facts, arrays = read_checkpoint(candidate)
        except UsageError as error:
            problems.append(error)
            continue
        notes = tuple(f"{problem.message}; continued from the previous checkpoint" for problem in problems)
        return facts, arrays, notes
    if problems:
        raise UsageError(problems[0].message, ANEW) from problems[0]
    return None


def _rows(ledger: dict[str, NDArray[np.float64]], frames: int) -> list[dict[str, float]]:
    """The first rows of a ledger; none if there is no ledger."""
    columns = {name: values[:frames].tolist() for name, values in ledger.items()}
    return [{name: values[k] for name, values in columns.items()} for k in range(frames)] if columns else []
