"""Checkpoints of a run: when they are due, what they hold, and a thread that writes them while the run goes on."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any

from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import Snapshot, snapshot
from particlesim.trajectory.checkpoint_file import discard_checkpoints, write_checkpoint
from particlesim.trajectory.writer import TrajectoryWriter


@dataclass(frozen=True)
class Saving:
    """When checkpoints are made: after so much simulated time [s] (None: it does not matter) or wall-clock time [s],
    whichever comes first."""

    every: float | None
    wall: float


class Keeper:
    """Makes the checkpoints of the run that `writer` records."""

    def __init__(self, writer: TrajectoryWriter, saving: Saving) -> None:
        self._writer, self._saving = writer, saving
        self._thread: Thread | None = None
        self._error: BaseException | None = None
        self._last_wall = time.monotonic()
        self._last_time: float | None = None

    @property
    def path(self) -> Path:
        """The trajectory that it belongs to."""
        return self._writer.path

    def look(self, simulation: Simulation, frames: int, facts: Callable[[], dict[str, Any]]) -> None:
        """A safe point, after so many frames: make a checkpoint if one is due. `facts` gives what it holds beside the state.

        Raises InputOutputError when the last one could not be written.
        """
        if self._last_time is None:
            self._last_time = simulation.time
        if self._thread is not None and not self._thread.is_alive():
            self._finish()
        late = time.monotonic() - self._last_wall >= self._saving.wall
        every = self._saving.every
        far = every is not None and simulation.time - self._last_time >= every * (1 - 1e-9)
        if (late or far) and self._thread is None:
            self.save(simulation, frames, facts())

    def save(self, simulation: Simulation, frames: int, facts: dict[str, Any]) -> None:
        """Make a checkpoint now: copy the state, and have it written in the background."""
        self._finish()
        state = snapshot(simulation)
        told = {"run": self._writer.run, **facts, "frames": frames, "numbers": state.numbers}
        self._thread = Thread(target=self._write, args=(told, state), name="checkpoint", daemon=True)
        self._thread.start()
        self._last_wall, self._last_time = time.monotonic(), simulation.time

    def close(self) -> None:
        """Wait until the last checkpoint is written. Raises InputOutputError when it could not be."""
        self._finish()

    def discard(self) -> None:
        """Remove the checkpoints: the run needs no more of them."""
        self._finish()
        discard_checkpoints(self.path)

    def _finish(self) -> None:
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _write(self, facts: dict[str, Any], state: Snapshot) -> None:
        try:
            # A checkpoint must not tell of frames that a kill could still take away.
            self._writer.wait_for(facts["frames"])
            write_checkpoint(self.path, facts, state.arrays)
        except BaseException as error:
            self._error = error
