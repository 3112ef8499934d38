"""Checkpoints of a run: when they are due, what they hold, and a thread that writes them while the run goes on."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import Snapshot, snapshot, weight
from particlesim.preflight.resources import size
from particlesim.trajectory.checkpoint_file import discard_checkpoints, write_checkpoint

if TYPE_CHECKING:
    from particlesim.trajectory.writer import TrajectoryWriter

FIRST, LONGEST = 1.0, 60.0
"""Wall-clock time before the first checkpoint, and between two of a long run [s]; in between it doubles."""
SHARE = 0.02
"""Part of a run's time that its checkpoints may take, unless their times are given."""
SPEED = 500e6
"""Bytes of state per second that a checkpoint is taken to copy and write, before there has been one."""


@dataclass(frozen=True)
class Saving:
    """When checkpoints are made: after so much simulated time [s] (None: it does not matter) or wall-clock time [s] (None:
    after a second, then after twice as long each time, up to a minute, and at a `SHARE` of the run's time), whichever comes
    first."""

    every: float | None
    wall: float | None


class Keeper:
    """Makes the checkpoints of the run that `writer` records."""

    def __init__(self, writer: TrajectoryWriter, saving: Saving) -> None:
        self._writer, self._saving = writer, saving
        self._thread: Thread | None = None
        self._error: BaseException | None = None
        self._last_wall = time.monotonic()
        self._last_time: float | None = None
        self._gap = FIRST
        self._copying, self._writing = 0.0, 0.0
        self._cost: float | None = None
        self.problem: str | None = None
        """Why a checkpoint that was due was not made."""

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
        if self._thread is not None:
            return
        if self._has_come(simulation.time):
            self.save(simulation, frames, facts())
        elif self._late(simulation):
            self._gap = min(2 * self._gap, LONGEST)
            if self._saving.wall is not None or self._has_room(simulation):
                self.save(simulation, frames, facts())

    def wants(self, simulation: Simulation, time: float) -> bool:
        """Whether a checkpoint is due, by then [s]."""
        if self._thread is not None and self._thread.is_alive():
            return False
        return self._has_come(time) or self._late(simulation)

    def _has_come(self, time: float) -> bool:
        """Whether a checkpoint is due by simulated time [s]."""
        every, last = self._saving.every, self._last_time
        return every is not None and last is not None and time - last >= every * (1 - 1e-9)

    def _late(self, simulation: Simulation) -> bool:
        """Whether a checkpoint is due by wall-clock time."""
        waited = time.monotonic() - self._last_wall
        if self._saving.wall is not None:
            return waited >= self._saving.wall
        if waited < self._gap:
            return False
        cost = weight(simulation) / SPEED if self._cost is None else self._cost
        return cost <= SHARE * waited

    def _has_room(self, simulation: Simulation) -> bool:
        """Whether an automatic checkpoint leaves the trajectory as much room on the disk as it takes itself."""
        needed, free = weight(simulation), shutil.disk_usage(self.path.parent).free
        if free >= 2 * needed:
            return True
        self._last_wall = time.monotonic()
        room = f"{size(free)} are free in {self.path.parent}"
        self.problem = f"no automatic checkpoint was made: it takes {size(needed)}, and {room}"
        return False

    def save(self, simulation: Simulation, frames: int, facts: dict[str, Any]) -> None:
        """Make a checkpoint now: copy the state, and have it written in the background."""
        self._finish()
        began = time.monotonic()
        state = snapshot(simulation)
        self._copying = time.monotonic() - began
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
            self._cost = self._copying + self._writing
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _write(self, facts: dict[str, Any], state: Snapshot) -> None:
        try:
            # A checkpoint must not tell of frames that a kill could still take away.
            self._writer.wait_for(facts["frames"])
            began = time.monotonic()
            write_checkpoint(self.path, facts, state.arrays)
            self._writing = time.monotonic() - began
        except BaseException as error:
            self._error = error
