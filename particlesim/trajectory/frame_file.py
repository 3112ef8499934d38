"""The open HDF5 file of a writer: frames go in, in order, and are finished when `append` returns.

Not safe for threads; `TrajectoryWriter` puts a queue and a thread before it.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal

import h5py
import numpy as np
import numpy.typing as npt
from h5py import h5a

from particlesim.trajectory.chunks import Column, compress, cut, padded
from particlesim.trajectory.layout import CELLS, EVENT, FRAME, LIBVER, STATUS, TOPOLOGY_ROWS, column_path
from particlesim.trajectory.tables import GrowingTable

# Free space that must remain: the tables of HDF5 itself, status and summary still have to go in.
_RESERVE = 4 << 20

EventKind = Literal["birth", "death"]


@dataclass(frozen=True)
class FrameData:
    """One frame on its way to the disk: columns of the stored type, and the row of the ledger."""

    time: float
    step: int
    columns: dict[str, Column]
    ledger: tuple[float, ...]

    @property
    def count(self) -> int:
        return len(self.columns["id"])

    @property
    def nbytes(self) -> int:
        return sum(column.nbytes for column in self.columns.values())


@dataclass(frozen=True)
class EventData:
    """Births or deaths on their way to the disk; `rows` of type EVENT."""

    kind: EventKind
    rows: npt.NDArray[Any]

    @property
    def nbytes(self) -> int:
        return self.rows.nbytes


@dataclass(frozen=True)
class BreakData:
    """Springs of a set that broke, on their way to the disk: the first of them, and the times of all from there on [s]."""

    name: str
    first: int
    times: npt.NDArray[np.float64]

    @property
    def nbytes(self) -> int:
        return self.times.nbytes


Item = FrameData | EventData | BreakData


class FrameFile:
    """Appends to a file made by `layout.create_file`."""

    def __init__(self, path: Path, fields: Sequence[str]) -> None:
        self._path = path
        self._file = h5py.File(path, "r+", libver=LIBVER)
        try:
            self._bind(fields)
            self._file.swmr_mode = True
            self._steps = h5a.open(
                self._file["VTKHDF/Steps"].id, b"NSteps"
            )  # SWMR begins with no attribute open
        except BaseException:
            self._file.close()
            raise
        self.bytes_written = 0
        self._broken = False
        self._pool = (
            ThreadPoolExecutor(min(8, max(1, (os.cpu_count() or 2) // 2))) if self._compressed else None
        )

    def _bind(self, fields: Sequence[str]) -> None:
        vtk, psim = self._file["VTKHDF"], self._file["psim"]

        def table(name: str) -> GrowingTable:
            return GrowingTable(vtk[name])

        self._columns = {name: GrowingTable(self._file[column_path(name)]) for name in fields}
        points = self._columns["position"].dataset
        self._compressed = points.compression is not None
        self._rows: int = points.chunks[0]
        self._tables = {
            name: table(name) for name in ("NumberOfPoints", "Steps/PointOffsets", "Steps/PartOffsets")
        }
        cells = [f"{kind}/{name}" for kind in CELLS for name in ("NumberOfCells", "NumberOfConnectivityIds")]
        self._filled_in = [table(name) for name in ("Steps/NumberOfParts", "Steps/CellOffsets", *cells)]
        self._topology = [table(name) for name in ("Vertices/Connectivity", "Vertices/Offsets")]
        self._frames = GrowingTable(psim["frames"])
        self._ledger = GrowingTable(psim["ledger"]) if "ledger" in psim else None
        self._events = {kind: GrowingTable(psim[f"events/{kind}s"]) for kind in ("birth", "death")}
        self._broke = {name: entry["broke"] for name, entry in psim["topology"].items() if "broke" in entry}
        self._next_row = 0
        self._values = table("Steps/Values")

    def append(self, batch: Sequence[Item]) -> None:
        """Write frames and events, in the order given; when this returns, other processes can read them.

        Raises OSError (or what HDF5 makes of it, RuntimeError) when the system refuses; frames of earlier
        calls stay readable.
        """
        self._check_space(sum(item.nbytes for item in batch))
        with self._watched():
            self._write(batch)

    def _write(self, batch: Sequence[Item]) -> None:
        rows: list[tuple[int | float, ...]] = []
        for item in batch:
            if isinstance(item, EventData):
                self._events[item.kind].extend(item.rows)
            elif isinstance(item, BreakData):
                self._broke[item.name][item.first : item.first + len(item.times)] = item.times
            else:
                rows.append(self._write_columns(item, len(self._frames) + len(rows)))
        frames = [item for item in batch if isinstance(item, FrameData)]
        if frames:
            self._write_tables(np.array(rows, FRAME), [frame.ledger for frame in frames])
        else:
            self._file.flush()

    def _write_columns(self, frame: FrameData, index: int) -> tuple[int | float, ...]:
        """Write the particles of a frame behind all others; return the frame's row of /psim/frames."""
        offset, self._next_row = self._next_row, self._next_row + padded(frame.count, self._rows)
        for name, column in frame.columns.items():
            self._columns[name].grow_to(self._next_row)
            self._write_chunks(self._columns[name], offset, column)
        self._grow_topology(frame.count)
        births, deaths = len(self._events["birth"]), len(self._events["death"])
        return index + 1, frame.step, frame.time, offset, frame.count, births, deaths

    def _write_chunks(self, table: GrowingTable, offset: int, column: Column) -> None:
        """Hand finished chunks to HDF5: one copy, into the page cache."""
        pieces = cut(column, self._rows)
        if self._pool is None:
            for start, block in pieces:
                table.put_chunk(offset + start, block)
                self.bytes_written += block.nbytes
            return
        starts, blocks = zip(*pieces, strict=True) if len(column) else ((), ())
        # A pool costs more than it saves where there is one chunk to compress.
        finished = self._pool.map(compress, blocks) if len(blocks) > 1 else map(compress, blocks)
        for start, data in zip(starts, finished, strict=True):
            table.put_chunk(offset + start, data)
            self.bytes_written += len(data)

    def _grow_topology(self, count: int) -> None:
        """Have at least `count` vertices: both tables are 0, 1, 2, ...; Offsets needs one more than that."""
        have = len(self._topology[0])
        if count < have:
            return
        want = padded(max(count + 1, 2 * have), TOPOLOGY_ROWS)
        for start in range(have, want, TOPOLOGY_ROWS):
            data = compress(np.arange(start, start + TOPOLOGY_ROWS, dtype="<i8"))
            for table in self._topology:
                table.grow_to(start + TOPOLOGY_ROWS)
                table.put_chunk(start, data)

    def _write_tables(self, rows: npt.NDArray[Any], ledger: Sequence[tuple[float, ...]]) -> None:
        """Bookkeeping of new frames; what announces them comes last, behind a flush.

        NSteps grows before Values does: VTK crashes on a file that has more Values than NSteps.
        """
        end = len(self._frames) + len(rows)
        self._tables["NumberOfPoints"].extend(rows["count"])
        self._tables["Steps/PointOffsets"].extend(rows["offset"])
        self._tables["Steps/PartOffsets"].extend(rows["number"] - 1)
        for table in self._filled_in:
            table.grow_to(end)
        if self._ledger is not None:
            self._ledger.extend(np.array(ledger, self._ledger.dataset.dtype))
        self._file.flush()
        self._steps.write(np.array(end, np.int64))
        self._values.extend(rows["time"])
        self._frames.extend(rows)
        self._file.flush()

    def _check_space(self, nbytes: int) -> None:
        """Refuse what will not fit, before HDF5 finds out in the middle of its work."""
        free = shutil.disk_usage(self._path.parent).free
        if free < nbytes + _RESERVE:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self._path))

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Remember a failure of HDF5: what it takes to be in the file need not be there from then on."""
        try:
            yield
        except BaseException:
            self._broken = True
            raise

    def close(self, status: str, summary: Mapping[str, Any] | None) -> None:
        """Record how the run ended, close, and take HDF5's mark "open for writing" away.

        After a failed write the status is all that is recorded. Raises as `append` does; the file is closed
        then too, but may still be marked.
        """
        if self._pool is not None:
            self._pool.shutdown()
        try:
            if not self._broken:
                with self._watched():
                    self._write_end(status, summary)
        finally:
            if self._broken and os.name == "posix":
                self._detach(status)
            self._file.close()

    def _write_end(self, status: str, summary: Mapping[str, Any] | None) -> None:
        self._file["psim/status"][()] = np.array(status.encode(), STATUS)
        if summary:
            text = json.dumps(dict(summary), ensure_ascii=False).encode()
            GrowingTable(self._file["psim/summary"]).extend(np.frombuffer(text, np.uint8))
        self._file.flush()

    def _detach(self, status: str) -> None:
        """Let HDF5 do the rest of its writing into a file that is thrown away.

        It cannot give up a file: what it could not write, it tries again when the file closes, and if that
        fails too it crashes the process later (h5py issue 914). What is on the disk by now is what readers
        will see.
        """
        descriptor: int = self._file.id.get_vfd_handle()
        text = status.encode().ljust(STATUS.itemsize, b"\0")
        with suppress(OSError):
            os.pwrite(descriptor, text, self._file["psim/status"].id.get_offset())
        with tempfile.TemporaryFile() if sys.platform != "linux" else _memory_file() as sink:
            os.dup2(sink.fileno(), descriptor)


def _memory_file() -> IO[bytes]:
    """An unnamed file in memory: the disk may be full."""
    return os.fdopen(os.memfd_create("trajectory"), "w+b")


def event_rows(ids: npt.ArrayLike, times: npt.ArrayLike, causes: npt.ArrayLike) -> npt.NDArray[Any]:
    """Ids, times [s] and cause codes, each [n], as rows of the event tables."""
    ids = np.asarray(ids, np.int64)
    rows = np.empty(len(ids), EVENT)
    rows["id"], rows["time"], rows["cause"] = ids, times, causes
    return rows
