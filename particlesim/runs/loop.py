"""The course of one run, frame by frame: records, checks, checkpoints and progress."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from particlesim.compiler import compiling_seconds
from particlesim.engine.simulation import Simulation
from particlesim.engine.state.group_state import CAUSES
from particlesim.engine.state.table import ROTATION, SPIN
from particlesim.errors import Interrupted
from particlesim.process.signals import Held
from particlesim.runs.checks import Checks
from particlesim.runs.frames import columns_of, frame_of
from particlesim.runs.result import Progress
from particlesim.runs.validity import Watch, infinite
from particlesim.scenario.digest import columns_digest

if TYPE_CHECKING:
    from particlesim.runs.checkpoints import Keeper
    from particlesim.runs.resume import Resumption
    from particlesim.trajectory.writer import TrajectoryWriter


@dataclass
class RunLog:
    """Times and ledger rows of the frames so far, counts of births and deaths."""

    times: list[float] = field(default_factory=list)
    rows: list[dict[str, float]] = field(default_factory=list)
    born: int = 0
    died: dict[str, int] = field(default_factory=dict)


class Course:
    """Takes a simulation from where it is to its end.

    `writer` and `keeper` record it and make its checkpoints, if given. `progress` is called at every frame and between the
    pieces of long intervals: those are the safe points, at which `signals` are heard, checkpoints made, and the run ends
    once it has taken `max_wall` seconds.
    """

    def __init__(
        self,
        simulation: Simulation,
        checks: Checks,
        signals: Held,
        *,
        writer: TrajectoryWriter | None = None,
        keeper: Keeper | None = None,
        progress: Callable[[Progress], None] | None = None,
        max_wall: float | None = None,
    ) -> None:
        self.simulation, self.checks, self.writer, self.keeper = simulation, checks, writer, keeper
        self.watch, self.log = Watch(simulation.scenario), RunLog()
        self._signals, self._progress, self._max_wall = signals, progress, max_wall
        self._began = time.perf_counter()
        self._compiled = compiling_seconds()
        self._before = 0.0
        self.state: str | None = None
        """The digest of the final particles, once it is known."""

    @property
    def seconds(self) -> float:
        """Wall-clock time that the run has taken, with that before it was resumed."""
        return self._before + time.perf_counter() - self._began

    @property
    def compiling(self) -> float:
        """How much of it went into compiling, since it was resumed."""
        return compiling_seconds() - self._compiled

    def resume(self, found: Resumption) -> None:
        """Take over what the run had before; its simulation has been restored, and its checks too."""
        facts = found.facts
        self.log = RunLog(list(found.times), list(found.rows), int(facts["born"]), dict(facts["died"]))
        self.watch.restore(facts["watch"])
        self._before = float(facts["seconds"])

    def run(self) -> None:
        """Frame after frame, from the next one to the last.

        Raises DivergenceError, InputOutputError, Interrupted when `max_wall` is over, KeyboardInterrupt on a signal.
        """
        steps = (0, *self.simulation.grid.frame_steps())
        for step in itertools.islice(steps, len(self.log.times), None):
            self.simulation.advance_to(step, between=self._rest, asked=self._asked)
            row = self._record()
            self.checks.look(self.simulation, row, self.log.born, self.log.died)
            self.watch.look(self.simulation)
            self._rest()

    def summary(self) -> dict[str, int | str]:
        """What the trajectory tells of the whole run; results of checks as JSON."""
        # A frame keeps what it has made, so each column is that of another one.
        turns = any({ROTATION, SPIN} & set(state.parts) for state in self.simulation.states)
        self.state = columns_digest(lambda field: frame_of(self.simulation, 0)[field], turns=turns)
        told: dict[str, int | str] = {
            "state": self.state,
            "steps": self.simulation.step,
            "particle_steps": self.simulation.particle_steps,
            "born": self.log.born,
            "missed_crossings": self.simulation.missed_crossings(),
        }
        told |= {f"broken.{name}": number for name, (number, _) in self.simulation.broken().items()}
        if results := self.checks.results():
            told["checks"] = json.dumps([result.as_data() for result in results], ensure_ascii=False)
        return told

    def _rest(self) -> None:
        """A safe point."""
        try:
            self._signals.check()
        except KeyboardInterrupt:
            self._save()
            raise
        if self._late and self.simulation.step < self.simulation.grid.steps:
            self._save()
            raise Interrupted(f"stopped after {self._max_wall:g} s, as asked, {self.where()}")
        if self.keeper is not None:
            self.keeper.look(self.simulation, len(self.log.times), self._facts)
        self._show(self.simulation.step)

    def _asked(self, step: int) -> bool:
        """Whether there is something to do at a step, for which the state is wanted; shows how far the run is."""
        self._show(step)
        if self._signals.waiting or self._late:
            return True
        return self.keeper is not None and self.keeper.wants(self.simulation, step * self.simulation.grid.dt)

    @property
    def _late(self) -> bool:
        """Whether the run has taken as long as it may."""
        return self._max_wall is not None and time.perf_counter() - self._began >= self._max_wall

    def _show(self, step: int) -> None:
        """Tell how far the run is."""
        if self._progress is not None:
            simulation = self.simulation
            further = step - simulation.step
            self._progress(
                Progress(
                    step,
                    simulation.grid.steps,
                    simulation.time + further * simulation.grid.dt,
                    simulation.count,
                    simulation.particle_steps + further * simulation.count,
                    self.seconds,
                    len(self.log.times),
                    self.compiling,
                )
            )

    def where(self) -> str:
        """How far the run is, in words."""
        return f"at t = {self.simulation.time:.9g} s of {self.simulation.grid.duration:.9g} s"

    def _save(self) -> None:
        if self.keeper is not None:
            self.keeper.save(self.simulation, len(self.log.times), self._facts())

    def _facts(self) -> dict[str, Any]:
        """The contents of a checkpoint other than the state of the simulation."""
        return {
            "step": self.simulation.step,
            "time": self.simulation.time,
            "born": self.log.born,
            "died": self.log.died,
            "checks": self.checks.state(),
            "watch": self.watch.state(),
            "seconds": self.seconds,
        }

    def _record(self) -> dict[str, float]:
        """Take the frame of the present state; returns its row of the ledger, empty when none is kept."""
        simulation, writer, log = self.simulation, self.writer, self.log
        self._take_events()
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
            fields, now = simulation.scenario.recorded_fields(), simulation.time
            columns = columns_of(
                simulation, fields, writer.buffer, lambda field: self.watch.overflowed(field, now)
            )
            writer.append(now, simulation.step, columns, row)
        return row

    def _take_events(self) -> None:
        """Births and deaths since the last frame, to the log and to the file."""
        events = self.simulation.take_events()
        for births in events.births:
            self.log.born += len(births.ids)
            if self.writer is not None:
                self.writer.events("birth", births.ids, births.times, 0)
        for deaths in events.deaths:
            for code, number in zip(*np.unique(deaths.causes, return_counts=True), strict=True):
                name = CAUSES[int(code)]
                self.log.died[name] = self.log.died.get(name, 0) + int(number)
            if self.writer is not None:
                self.writer.events("death", deaths.ids, deaths.times, deaths.causes)
