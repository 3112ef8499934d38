"""How far a run is, and what it leaves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.runs.checks import CheckResult
from particlesim.scenario.digest import state_digest
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.frame import Frame


@dataclass(frozen=True)
class Progress:
    """How far a run is: steps done and in all, simulated time [s], particles alive, particle-steps done, wall time [s], and
    how much of it went into compiling kernels [s]."""

    step: int
    steps: int
    time: float
    particles: int
    particle_steps: int
    elapsed: float
    frames: int
    compiling: float = 0.0


@dataclass(repr=False, eq=False)
class Result:
    """What a run leaves: the last frame in memory, the ledger over time, and how it went."""

    scenario: Scenario
    final: Frame
    path: Path | None
    times: NDArray[np.float64]
    ledger: dict[str, NDArray[np.float64]]
    steps: int
    particle_steps: int
    born: int
    died: dict[str, int]
    seconds: float
    warnings: tuple[str, ...] = ()
    checks: tuple[CheckResult, ...] = ()
    broken: dict[str, tuple[int, int]] = field(default_factory=dict)
    """For every set of springs that can break: how many are broken, and how many there were."""
    methods: dict[str, str] = field(default_factory=dict)
    """How the forces of interactions were summed, by their names in the ledger, where there is something to tell."""
    missed_crossings: int = 0
    """How often particles or bodies passed colliders or bodies that should have held them back, as far as it was seen."""
    known_state: str | None = None
    compiling: float = 0.0
    """How much of `seconds` went into compiling kernels, which are kept for the next run."""

    def __repr__(self) -> str:
        where = "" if self.path is None else f" in {str(self.path)!r}"
        return f"<Result: {len(self.times)} frame{'s' * (len(self.times) != 1)}{where}, to t = {self.times[-1]:g} s>"

    @property
    def state(self) -> str:
        """The digest of the final particles (`digest.state_digest`)."""
        if self.known_state is None:
            self.known_state = state_digest(self.final)
        return self.known_state

    @property
    def passed(self) -> bool:
        """Whether every check of the scenario holds."""
        return all(check.passed for check in self.checks)

    @property
    def energy(self) -> NDArray[np.float64]:
        """Kinetic plus all potential energy at every frame [J]."""
        parts = [v for k, v in self.ledger.items() if k == "kinetic" or k.startswith("potential.")]
        return np.sum(parts, axis=0) if parts else np.zeros(len(self.times))


def recorded_result(scenario: Scenario, path: Path) -> Result:
    """What a run left that is complete in the trajectory `path`; its last frame is the recorded one.

    Raises UsageError when the file lacks what a complete one has.
    """
    from particlesim.trajectory.files import damaged
    from particlesim.trajectory.reader import Trajectory
    from particlesim.trajectory.summary import recorded_checks

    with Trajectory(path) as trajectory:
        told = trajectory.summary
        numbers = [told.get(name) for name in ("steps", "particle_steps", "born")]
        if not len(trajectory) or "state" not in told or not all(isinstance(n, int) for n in numbers):
            raise damaged(path, "it says that the run is complete, and does not hold how it ended")
        final = trajectory[-1]
        for name in final.fields:
            final[name]  # loaded while the file is open
        causes, deaths = np.unique(trajectory.events("death")["cause"], return_counts=True)
        broken = {
            name: (int(np.isfinite(each.broke).sum()), len(each.pairs))
            for name, each in trajectory.topology.items()
            if each.breakable
        }
        return Result(
            scenario=scenario,
            final=final,
            path=path,
            times=trajectory.times,
            ledger=trajectory.ledger,
            steps=told["steps"],
            particle_steps=told["particle_steps"],
            born=told["born"],
            died={str(cause): int(number) for cause, number in zip(causes, deaths, strict=True)},
            seconds=0.0,
            warnings=(f"{path} is complete already; nothing was left to do",),
            checks=tuple(_check(data) for data in recorded_checks(told, path)),
            broken=broken,
            missed_crossings=int(told.get("missed_crossings", 0)),
            known_state=str(told["state"]),
        )


def _check(data: dict[str, Any]) -> CheckResult:
    """A result of a check from plain data, in which numbers that are not finite are None."""
    value = data["value"]
    return CheckResult(**{**data, "value": math.nan if value is None else value})
