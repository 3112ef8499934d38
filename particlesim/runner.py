"""Run a scenario: the one file that joins validation, engine and recorder."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.advice import advice
from particlesim.bounds import check_fits, needs
from particlesim.checking import CheckResult, Checks
from particlesim.engine import cache
from particlesim.engine.simulation import Simulation
from particlesim.engine.stability import suspects
from particlesim.engine.state import CAUSES
from particlesim.errors import DivergenceError, Interrupted, UsageError
from particlesim.interruption import Held, held_signals
from particlesim.provenance import provenance
from particlesim.recording import columns_of, frame_of
from particlesim.references import bless as give_blessing
from particlesim.references import check_references
from particlesim.scenario.load import load
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.target import check_target, check_trajectory_name
from particlesim.trajectory.writer import TrajectoryWriter
from particlesim.validity import Watch, check_ledger, infinite


@dataclass(frozen=True)
class Progress:
    """How far a run is: steps done and in all, simulated time [s], particles alive, particle-steps done, wall time [s]."""

    step: int
    steps: int
    time: float
    particles: int
    particle_steps: int
    elapsed: float
    frames: int


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

    def __repr__(self) -> str:
        where = "" if self.path is None else f" in {str(self.path)!r}"
        return f"<Result: {len(self.times)} frames{where}, to t = {self.times[-1]:g} s>"

    @property
    def passed(self) -> bool:
        """Whether every check of the scenario holds."""
        return all(check.passed for check in self.checks)

    @property
    def energy(self) -> NDArray[np.float64]:
        """Kinetic plus all potential energy at every frame [J]."""
        parts = [v for k, v in self.ledger.items() if k == "kinetic" or k.startswith("potential.")]
        return np.sum(parts, axis=0) if parts else np.zeros(len(self.times))


@dataclass
class _Log:
    """Ledger rows, counts of births and deaths."""

    times: list[float] = field(default_factory=list)
    rows: list[dict[str, float]] = field(default_factory=list)
    born: int = 0
    died: dict[str, int] = field(default_factory=dict)


def run(
    scenario: Scenario | str | Path,
    output: str | Path | None = None,
    *,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    bless: bool = False,
    warn: Callable[[str], None] | None = None,
) -> Result:
    """Run a scenario, or the scenario of a file, from its start to its end.

    With `output`, frames go to that trajectory file (.vtkhdf) while the run goes on; without it nothing is written. The
    last frame is in memory either way, as `result.final`. `threads` bounds the threads (all cores unless given);
    results do not depend on it. `progress` is called at every frame, and between frames that take long; `warn` before the
    first step, with what is wrong with the step, if anything: see `ps.stability`. It is among `result.warnings`, too. With
    `bless`, checks against references are left out, and when all others hold, the trajectory becomes their reference.

    Raises UsageError before anything is computed when the output exists (unless `overwrite`) or the run cannot fit,
    DivergenceError when a number stops being finite, Interrupted on Ctrl-C, InputOutputError when writing fails. Frames
    recorded until then are kept.
    """
    if isinstance(scenario, str | PathLike):
        scenario = load(scenario)
    if not isinstance(scenario, Scenario):
        raise TypeError(f"run takes a Scenario or the path of one, not {type(scenario).__name__}")
    _check_threads(threads)
    path = None if output is None else Path(output)
    if path is not None:
        check_trajectory_name(path)
        check_target(path, overwrite=overwrite)
    check_references(scenario, path, bless=bless)
    required = needs(scenario)
    check_fits(required, path)
    checks = Checks(scenario, bless=bless)
    simulation = Simulation(scenario, threads=threads)
    check_ledger(simulation)
    unstable = suspects(simulation).warnings
    if warn is not None:
        for text in unstable:
            warn(text)
    with held_signals() as signals:
        result = _recorded(simulation, checks, path, overwrite, required.particles, progress, signals)
    if bless and path is not None and result.passed:
        give_blessing(scenario, path)
    return replace(result, warnings=(*unstable, *result.warnings))


def _check_threads(threads: int | None) -> None:
    if threads is None:
        return
    if isinstance(threads, bool) or not isinstance(threads, Integral):
        raise TypeError(f"threads is a whole number or None, not {threads!r}")
    if threads < 1:
        raise UsageError(f"{threads} threads cannot run anything", "Give 1 or more, or none for all cores.")


def _recorded(
    simulation: Simulation,
    checks: Checks,
    path: Path | None,
    overwrite: bool,
    particles: int,
    progress: Callable[[Progress], None] | None,
    signals: Held,
) -> Result:
    """Run to the end, and write what there is however it ends; `particles` is the largest number of them expected."""
    scenario = simulation.scenario
    writer = _writer(scenario, simulation, path, overwrite, particles) if path is not None else None
    watch = Watch(scenario)
    log = _Log()
    began = time.perf_counter()
    status: str = "failed"
    summary: dict[str, int | str] = {}
    try:
        _steps(simulation, writer, watch, checks, log, progress, signals, began)
        status = "complete"
        summary = _summary(simulation, log, checks)
    except DivergenceError as error:
        status = "diverged"
        if log.times:
            error.after_frame(len(log.times) - 1, log.times[-1])
        raise
    except KeyboardInterrupt:
        status = "interrupted"
        raise Interrupted(
            f"stopped at t = {simulation.time:.9g} s of {scenario.grid.duration:.9g} s"
        ) from None
    finally:
        simulation.close()
        checks.close()
        if writer is not None:
            writer.close(status, summary)
    seconds = time.perf_counter() - began
    problems = (cache.problem,) if cache.problem is not None else ()
    return Result(
        scenario=scenario,
        final=frame_of(simulation, len(log.times) - 1),
        path=path,
        times=np.array(log.times),
        ledger={k: np.array([row[k] for row in log.rows]) for k in (log.rows[0] if log.rows else ())},
        steps=simulation.step,
        particle_steps=simulation.particle_steps,
        born=log.born,
        died=log.died,
        seconds=seconds,
        warnings=(*advice(scenario), *watch.warnings, *problems),
        broken=simulation.broken(),
        checks=checks.results(),
    )


def _summary(simulation: Simulation, log: _Log, checks: Checks) -> dict[str, int | str]:
    """What the trajectory tells of the whole run; results of checks as JSON."""
    told: dict[str, int | str] = {
        "steps": simulation.step,
        "particle_steps": simulation.particle_steps,
        "born": log.born,
    }
    told |= {f"broken.{name}": number for name, (number, _) in simulation.broken().items()}
    if results := checks.results():
        told["checks"] = json.dumps([result.as_data() for result in results], ensure_ascii=False)
    return told


def _writer(
    scenario: Scenario, simulation: Simulation, path: Path, overwrite: bool, most: int
) -> TrajectoryWriter:
    return TrajectoryWriter(
        path,
        fields=scenario.recorded_fields(),
        groups=[group.name for group in scenario.groups],
        ledger=simulation.ledger_columns() if scenario.output.ledger else (),
        provenance=provenance(scenario),
        precision=scenario.output.precision,
        compression=scenario.output.compression,
        overwrite=overwrite,
        causes=tuple(CAUSES.values()),
        particles_hint=max(most, 1),
        topology=simulation.topology(),
    )


def _steps(
    simulation: Simulation,
    writer: TrajectoryWriter | None,
    watch: Watch,
    checks: Checks,
    log: _Log,
    progress: Callable[[Progress], None] | None,
    signals: Held,
    began: float,
) -> None:
    """Frame after frame, from the one at the start to the last."""
    grid = simulation.scenario.grid
    fields = simulation.scenario.recorded_fields()

    def tell() -> None:
        signals.check()
        if progress is not None:
            elapsed = time.perf_counter() - began
            done = simulation.particle_steps
            progress(
                Progress(
                    simulation.step,
                    grid.steps,
                    simulation.time,
                    simulation.count,
                    done,
                    elapsed,
                    len(log.times),
                )
            )

    for step in (0, *grid.frame_steps()):
        simulation.advance_to(step, between=tell)
        row = _record(simulation, writer, log, fields)
        checks.look(simulation, row, log.born, sum(log.died.values()))
        watch.look(simulation)
        tell()


def _record(
    simulation: Simulation, writer: TrajectoryWriter | None, log: _Log, fields: tuple[str, ...]
) -> dict[str, float]:
    """Take the frame of the present state; returns its row of the ledger, empty when none is kept."""
    events = simulation.take_events()
    for births in events.births:
        log.born += len(births.ids)
        if writer is not None:
            writer.events("birth", births.ids, births.times, 0)
    for deaths in events.deaths:
        for code, number in zip(*np.unique(deaths.causes, return_counts=True), strict=True):
            name = CAUSES[int(code)]
            log.died[name] = log.died.get(name, 0) + int(number)
        if writer is not None:
            writer.events("death", deaths.ids, deaths.times, deaths.causes)
    if writer is not None:
        for name, broke in simulation.broke().items():
            writer.breaks(name, broke)
    row: dict[str, float] = {}
    if simulation.scenario.output.ledger:
        row = simulation.ledger()
        if (column := infinite(row)) is not None:
            raise simulation.overflow(column)
    simulation.check()
    if row:
        log.rows.append(row)
    log.times.append(simulation.time)
    if writer is not None:
        columns: dict[str, Any] = columns_of(simulation, fields, writer.buffer)
        writer.append(simulation.time, simulation.step, columns, row)
    return row
