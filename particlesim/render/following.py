"""A trajectory that a run is still writing, read as if it were complete: asking for a frame waits until it is recorded.

So pictures can be prepared while the run goes on, and drawn where their view does not depend on later frames. They are the
same as those of the finished file.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from threading import RLock
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from particlesim.errors import PsimError
from particlesim.process.signals import held_signals
from particlesim.scenario.timegrid import TimeGrid
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.reader import Trajectory
from particlesim.trajectory.topology import Topology

SHORTEST, LONGEST = 0.02, 1.0
"""Seconds between two looks at the file; within these, ten times as long as a look takes."""
AHEAD = 128 << 20
"""Bytes of frames that are read while there is time, for later."""


class LostError(PsimError):
    """The run ended before its last frame, or recorded others than its scenario says."""


class Following(Sequence[Frame]):
    """The frames of a run on `grid` that writes `trajectory`; what it has not recorded yet is waited for.

    `waiting` is called now and then while it waits, says whether the run is known to have ended, and may raise to end the
    waiting. Safe for threads: `trajectory` is read by one at a time. Raises LostError.
    """

    def __init__(self, trajectory: Trajectory, grid: TimeGrid, waiting: Callable[[], bool]) -> None:
        self._trajectory, self._waiting = trajectory, waiting
        steps = [0, *grid.frame_steps()]
        self.times: npt.NDArray[np.float64] = np.array([step * grid.dt for step in steps])
        self.fields, self.groups, self.box = trajectory.fields, trajectory.groups, trajectory.box
        self._kept: dict[int, Frame] = {}
        self._room = AHEAD
        self._lock = RLock()
        self._pause, self._next = SHORTEST, 0.0

    def __len__(self) -> int:
        return len(self.times)

    @property
    def ended(self) -> bool:
        """Whether all frames are there."""
        return len(self._trajectory) == len(self)

    @property
    def most(self) -> int | None:
        """As `Trajectory.most`."""
        return self._trajectory.most

    @property
    def topology(self) -> Mapping[str, Topology]:
        """Springs and surfaces; where some can break, as they are at the end."""
        with self._lock:
            found = self._trajectory.topology
            if not any(each.breakable for each in found.values()):
                return found
        self[len(self) - 1]
        with self._lock:
            return self._trajectory.topology

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        index %= len(self)
        while True:
            with self._lock:
                if index < len(self._trajectory):
                    return self._kept.get(index) or self._guarded(index)
                self._look()
            with held_signals() as signals:
                signals.check()
            if self._waiting():
                self._next = 0.0
            else:
                time.sleep(SHORTEST)

    def _look(self) -> None:
        """See what there is by now, and read some of it, unless it was looked at just now."""
        if time.monotonic() < self._next:
            return
        known = len(self._trajectory)
        began = time.monotonic()
        self._trajectory.refresh()
        self._check()
        self._pause = min(max(SHORTEST, 10 * (time.monotonic() - began)), LONGEST)
        for index in range(known, len(self._trajectory)):
            self._keep(index)
        self._next = time.monotonic() + self._pause

    def _check(self) -> None:
        """Raise LostError if this is not, or will not be, the run that was expected."""
        there = self._trajectory
        if not np.array_equal(there.times, self.times[: len(there)]):
            raise LostError(f"{there.path} has other frames than its scenario says")
        if there.status != "running" and not self.ended:
            raise LostError(f"the run that writes {there.path} has ended before its last frame")

    def _keep(self, index: int) -> None:
        """Read a frame for later, while there is room for it."""
        if self._room <= 0:
            return
        frame = self._guarded(index)
        self._room -= sum(frame[field].nbytes for field in frame.fields)
        self._kept[index] = frame

    def _guarded(self, index: int) -> Frame:
        """A frame that is read by one thread at a time, and not while the file is opened anew."""
        frame = self._trajectory[index]

        def load(field: str) -> npt.NDArray[Any]:
            with self._lock:
                return frame[field]

        return Frame(
            index=index,
            time=frame.time,
            step=frame.step,
            count=len(frame),
            fields=frame.fields,
            groups=frame.groups,
            load=load,
            box=frame.box,
        )
