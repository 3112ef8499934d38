"""Record a trajectory while a simulation runs: a background thread writes one frame while the next is computed.

No more than one frame is on its way: a process that is killed loses that one at most.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Condition, Thread
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

from particlesim.errors import InputOutputError, UsageError
from particlesim.trajectory.box import Box
from particlesim.trajectory.buffers import BufferPool
from particlesim.trajectory.checkpoint_file import discard_checkpoints
from particlesim.trajectory.continuation import cut_to
from particlesim.trajectory.examiner import vouch
from particlesim.trajectory.fields import FieldSpec, Precision, select_fields, unknown_name
from particlesim.trajectory.files import damaged
from particlesim.trajectory.frame_file import (
    BreakData,
    EventData,
    EventKind,
    FrameData,
    FrameFile,
    Item,
    event_rows,
)
from particlesim.trajectory.layout import STATES, create_file
from particlesim.trajectory.lock import WriterLock, is_being_written
from particlesim.trajectory.superblock import clear_mark, read_superblock
from particlesim.trajectory.target import FORBIDDEN, check_target, put_new, replacing, write_error
from particlesim.trajectory.topology import Topology


class TrajectoryWriter:
    """Writes `path` (VTKHDF, see `layout`) frame by frame; other processes can read it meanwhile.

    fields: what to record beside position and id (names of `FIELDS`). groups: names that the field `group`
    counts into. ledger: names of scalars given with every frame. provenance: where the file comes from; the
    key "scenario" holds its TOML text. causes: names of the codes that `events` takes. particles_hint: the
    largest count expected in a frame; it only chooses how the file is cut (`chunks`). topology: springs and
    surfaces, of names of their own. box: the periodic box that positions are in; `fields` then has "image".

    The file is at `path` as soon as the constructor returns. Raises UsageError for an unknown field and for a
    path that exists (unless `overwrite`) or cannot be written.
    """

    def __init__(
        self,
        path: Path,
        *,
        fields: Sequence[str],
        groups: Sequence[str],
        ledger: Sequence[str],
        provenance: Mapping[str, str | int | float],
        precision: Precision = "single",
        compression: Literal["gzip", "none"] = "gzip",
        overwrite: bool = False,
        causes: Sequence[str] = (),
        particles_hint: int = 8192,
        topology: Sequence[Topology] = (),
        box: Box | None = None,
    ) -> None:
        self._take(path, fields, ledger, precision, topology)
        check_target(self.path, overwrite=overwrite)
        refuse_file_in_use(self.path)
        self._overwrite = overwrite
        self._create(
            fields=tuple(self._fields.values()),
            groups=groups,
            ledger=self._ledger,
            causes=causes,
            provenance=provenance,
            precision=precision,
            compressed=compression == "gzip",
            particles=particles_hint,
            topology=topology,
            box=box,
        )
        self._run = str(provenance.get("run", ""))
        self._begin(0)

    @classmethod
    def continuing(
        cls,
        path: Path,
        frames: int,
        *,
        fields: Sequence[str],
        ledger: Sequence[str],
        precision: Precision = "single",
        topology: Sequence[Topology] = (),
    ) -> TrajectoryWriter:
        """A writer that continues after the first `frames` frames of a trajectory that no process writes; later frames are
        dropped. The other arguments are those with which it was made.

        Raises UsageError when it is in use, is damaged, or has fewer frames, InputOutputError when it may not be written.
        """
        writer = cls.__new__(cls)
        writer._take(path, fields, ledger, precision, topology)
        try:
            if not writer._lock.acquire(path):
                raise _in_use(path)
            writer._run = cut_to(path, frames, writer._broke)
            writer._file = FrameFile(path, tuple(writer._fields))
        except OSError as error:
            writer._lock.release()
            if error.errno is None:  # not the system's, but HDF5's
                raise damaged(path) from error
            kind = InputOutputError if error.errno in FORBIDDEN else UsageError
            raise kind(f"{path} cannot be written further: {error.strerror}") from error
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            writer._lock.release()
            raise damaged(path) from error
        except BaseException:
            writer._lock.release()
            raise
        writer._begin(frames)
        return writer

    def _take(
        self,
        path: Path,
        fields: Sequence[str],
        ledger: Sequence[str],
        precision: Precision,
        topology: Sequence[Topology],
    ) -> None:
        """What is to be written."""
        self.path = Path(path)
        self._fields = {spec.name: spec for spec in select_fields(fields)}
        self._precision: Precision = precision
        self._ledger = tuple(ledger)
        self._broke = {each.name: np.array(each.broke, float) for each in topology if each.breakable}
        self._lock = WriterLock()

    def _begin(self, frames: int) -> None:
        """Start the thread; `frames` are in the file."""
        self._pending: list[Item] = []  # events that belong to the next frame
        self._waiting: list[Item] = []  # a frame with its events, for the thread to take
        self._writing = False
        self._changed = Condition()
        self._ending = False
        self._closed = False
        self._error: BaseException | None = None
        self._frames_written = frames
        self._last_time: float | None = None
        self._buffers = BufferPool()
        self._thread = Thread(target=self._write_frames, name="trajectory writer", daemon=True)
        self._thread.start()

    def _create(self, **layout: Any) -> None:
        """Make the file beside `path`, open it for writing, and only then put it in its place.

        So whoever finds it at `path` finds it readable and locked. Windows cannot rename an open file: there
        it is opened afterwards.
        """
        try:
            with replacing(self.path, put_replacing if self._overwrite else _put_new) as temporary:
                create_file(temporary, **layout)
                if os.name == "posix":
                    self._open(temporary)
            if self.path.is_symlink():
                discard_checkpoints(self.path)  # they are beside the link, and not those beside its target
            if os.name != "posix":
                self._open(self.path)
        except BaseException:
            self._lock.release()
            raise

    def _open(self, path: Path) -> None:
        self._lock.acquire(path)
        self._file = FrameFile(path, tuple(self._fields))

    @property
    def run(self) -> str:
        """The name of the run that the file was made for; "" if it has none."""
        return self._run

    @property
    def frames_written(self) -> int:
        """Frames that are in the file and readable, whatever happens to this process."""
        return self._frames_written

    @property
    def bytes_written(self) -> int:
        """Bytes of particle data written so far, as stored."""
        return self._file.bytes_written

    @property
    def last_time(self) -> float | None:
        """Simulated time [s] of the last frame in the file; None before the first."""
        return self._last_time

    def buffer(self, name: str, n: int) -> npt.NDArray[Any]:
        """An array for field `name` of `n` particles, of the stored type, to fill and give to `append`.

        Its content is undefined. Memory of frames already written is used again.
        """
        spec = self._spec(name)
        return self._buffers.lend(name, spec.shape(n), spec.dtype(self._precision))

    def append(
        self, time: float, step: int, columns: Mapping[str, npt.NDArray[Any]], ledger: Mapping[str, float]
    ) -> None:
        """Hand over the frame at `time` [s] as soon as the one before it is in the file.

        `columns` has every recorded field, in the stored type, [n] or [n, 3]. The arrays belong to the writer
        from here on. Raises UsageError when columns or ledger are not what the
        file was made for, InputOutputError when an earlier frame could not be written (disk full, device
        error); frames before it are kept.
        """
        self._check_columns(columns)
        if set(ledger) != set(self._ledger):
            raise UsageError(f"the ledger has {sorted(ledger)}, the file expects {sorted(self._ledger)}")
        row = tuple(float(ledger[name]) for name in self._ledger)
        ordered = {name: columns[name] for name in self._fields}
        self._check_open()
        self._hand_over([*self._pending, FrameData(float(time), int(step), ordered, row)])
        self._pending = []

    def events(
        self, kind: EventKind, ids: npt.ArrayLike, times: npt.ArrayLike, causes: npt.ArrayLike
    ) -> None:
        """Note births or deaths: particle ids, times [s] and cause codes (0 to 255), each [n].

        times and causes may be one value for all. The events belong to the frame that is appended next.
        Raises as `append` does.
        """
        self._check_open()
        rows = event_rows(ids, times, causes)
        if len(rows):
            self._pending.append(EventData(kind, rows))

    def breaks(self, name: str, broke: npt.NDArray[np.float64]) -> None:
        """Note when the springs of a set broke [s], infinity for those that hold, shape [springs].

        What the writer knows already costs nothing. Raises as `append` does.
        """
        if name not in self._broke:
            raise unknown_name("set of springs that can break", name, self._broke)
        self._check_open()
        known = self._broke[name]
        changed = np.flatnonzero(broke != known)
        if len(changed):
            first, last = int(changed[0]), int(changed[-1]) + 1
            known[first:last] = broke[first:last]
            self._pending.append(BreakData(name, first, known[first:last].copy()))

    def close(self, status: str = "complete", summary: Mapping[str, float | int | str] | None = None) -> None:
        """Finish the last frame, write how the run ended, and close. Calling it again does nothing.

        status: one of "complete", "interrupted", "diverged", "failed". Raises InputOutputError when a frame
        could not be written; the file then says "failed".
        """
        if self._closed:
            return
        if status not in STATES or status == "running":
            raise unknown_name("status", status, [state for state in STATES if state != "running"])
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join()
        self._closed = True
        self._finish("failed" if self._error else status, summary)
        self._raise_error()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
            return
        try:
            self.close("failed")
        except Exception as second:
            error.add_note(f"closing the trajectory failed too: {second}")

    def flush(self) -> None:
        """Wait until every frame that was appended is in the file. Raises as `append` does."""
        with self._changed:
            self._changed.wait_for(lambda: self._error is not None or not (self._waiting or self._writing))
            self._raise_error()

    def wait_for(self, frames: int) -> None:
        """Wait until so many frames are in the file. Raises as `append` does."""
        with self._changed:
            self._changed.wait_for(lambda: self._error is not None or self._frames_written >= frames)
            self._raise_error()

    def _hand_over(self, batch: list[Item]) -> None:
        with self._changed:
            self.flush()
            self._waiting = batch
            self._changed.notify_all()

    def _write_frames(self) -> None:
        """The background thread. After an error it stops; the error waits for the next append or close."""
        while batch := self._next_batch():
            try:
                self._file.append(batch)
            except Exception as error:
                with self._changed:
                    self._error = error
                    self._changed.notify_all()
                return
            self._release(batch)

    def _next_batch(self) -> list[Item]:
        """The frame that waits, with its events; empty at the end."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._waiting) or self._ending)
            batch, self._waiting = self._waiting, []
            self._writing = bool(batch)
            return batch

    def _release(self, batch: Sequence[Item]) -> None:
        """Count a written frame and take its memory back."""
        frames = [item for item in batch if isinstance(item, FrameData)]
        for frame in frames:
            for column in frame.columns.values():
                self._buffers.give_back(column)
        with self._changed:
            self._frames_written += len(frames)
            if frames:
                self._last_time = frames[-1].time
            self._writing = False
            self._changed.notify_all()

    def _check_open(self) -> None:
        if self._closed or self._ending:
            raise UsageError(f"{self.path} is closed", "Append before close().")

    def _finish(self, status: str, summary: Mapping[str, Any] | None) -> None:
        """Close the file, and make it readable whatever happened."""
        try:
            self._file.close(status, summary)
        except Exception as error:
            self._error = self._error or error
        self._lock.release()
        if self._error is not None:
            _repair_header(self.path)
        else:
            vouch(self.path)

    def _raise_error(self) -> None:
        if self._error is not None:
            number = self._frames_written
            kept = "1 frame was" if number == 1 else f"{number} frames were"
            kept = f"{kept} finished and can be read." if number else "No frame was finished."
            raise write_error(self.path, self._error, kept) from self._error

    def _spec(self, name: str) -> FieldSpec:
        if name not in self._fields:
            raise unknown_name("field", name, self._fields)
        return self._fields[name]

    def _check_columns(self, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        if missing := [name for name in self._fields if name not in columns]:
            raise UsageError(f"the frame lacks the fields {', '.join(missing)}")
        n = len(columns["id"])
        for name, column in columns.items():
            spec = self._spec(name)
            shape, dtype = spec.shape(n), spec.dtype(self._precision)
            if column.shape != shape or column.dtype != dtype or not column.flags.c_contiguous:
                raise UsageError(
                    f"field {name!r} has shape {column.shape} and type {column.dtype}",
                    f"The file stores C-contiguous {dtype} of shape {shape}.",
                )


def _repair_header(path: Path) -> None:
    """Make a file readable that HDF5 could not close: still marked, or longer on record than it is."""
    try:
        block = read_superblock(path)
        if block is not None and (block.marked or block.end != path.stat().st_size):
            clear_mark(path)
    except OSError:
        # The error that brought us here is the one to report; `recover` can repair the file later.
        pass


def _put_new(temporary: Path, path: Path) -> None:
    """Give `temporary` the name `path`, which nothing has; checkpoints of a trajectory that is gone are no use."""
    if not path.exists():
        discard_checkpoints(path)
    put_new(temporary, path)


def put_replacing(temporary: Path, path: Path) -> None:
    """Give `temporary` the name `path` and let go of the file that had it, unless a simulation is writing that.

    The old file is locked while it is replaced: of two processes that replace it at the same time, one wins. Raises
    UsageError for the other.
    """
    while True:
        old = WriterLock()
        try:
            if not old.acquire(path):
                raise _in_use(path)
            if old.holds(path):
                discard_checkpoints(path)
                temporary.replace(path)
                return
        except FileNotFoundError:
            with suppress(UsageError):  # somebody was faster: look at that file
                _put_new(temporary, path)
                return
        except PermissionError:  # no file of ours, so no simulation of ours writes it
            temporary.replace(path)
            return
        finally:
            old.release()


def refuse_file_in_use(path: Path) -> None:
    """Raise UsageError for a file that a simulation is writing: to replace it would lose its output without a word."""
    if not path.exists():
        return
    block = read_superblock(path)
    if block is not None and block.marked and is_being_written(path):
        raise _in_use(path)


def _in_use(path: Path) -> UsageError:
    return UsageError(f"{path} is being written by a running simulation", "Choose another name, or stop it.")
