"""The open HDF5 file of a writer: frames are appended in order, and are finished when `append` returns.

Not safe for threads; `TrajectoryWriter` feeds it from a queue by one thread.
"""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
from h5py import h5a

from particlesim.trajectory.chunks import Column, compress, cut, padded
from particlesim.trajectory.hdf5 import entries, open_for_frames
from particlesim.trajectory.layout import CELLS, EVENT, FRAME, STATUS, TOPOLOGY_ROWS, column_path
from particlesim.trajectory.tables import GrowingTable

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

# What HDF5 may need beside the data of a frame: headers, the blocks in which it hands out space, status and end.
_RESERVE = 16 << 10
# Its index of the chunks of one column grows by a block of up to 5.7 √chunks entries of 20 bytes, with pointers to it.
_INDEX = 160
_VERTICES = 4 << 10
"""Bytes of 65 536 consecutive numbers, compressed; 3.3 kB as measured."""

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
        """Particles in the frame."""
        return len(self.columns["id"])

    @property
    def nbytes(self) -> int:
        """Bytes of its columns."""
        return sum(column.nbytes for column in self.columns.values())


@dataclass(frozen=True)
class EventData:
    """Births or deaths on their way to the disk; `rows` of type EVENT."""

    kind: EventKind
    rows: npt.NDArray[Any]

    @property
    def nbytes(self) -> int:
        """Bytes of the rows."""
        return self.rows.nbytes


@dataclass(frozen=True)
class BreakData:
    """Springs of a set that broke, on their way to the disk: the first of them, and the times of all from there on [s]."""

    name: str
    first: int
    times: npt.NDArray[np.float64]

    @property
    def nbytes(self) -> int:
        """Bytes of the times."""
        return self.times.nbytes


Item = FrameData | EventData | BreakData


class FrameFile:
    """Appends to a file made by `layout.create_file`."""

    def __init__(self, path: Path, fields: Sequence[str]) -> None:
        self._path = path
        self._file = open_for_frames(path)
        try:
            self._bind(fields)
            self._steps = h5a.open(self._file["VTKHDF/Steps"].id, b"NSteps")
        except BaseException:
            self._file.close()
            raise
        self.bytes_written = 0
        self._broken = False
        self._pool = _compressors() if self._compressed else None

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
        self._broke = {name: entry["broke"] for name, entry in entries(psim["topology"]) if "broke" in entry}
        self._next_row = len(self._columns["position"])
        self._values = table("Steps/Values")

    def append(self, batch: Sequence[Item]) -> None:
        """Write frames and events, in the order given; when this returns, other processes can read them.

        Raises OSError (or what HDF5 makes of it, RuntimeError) when the system refuses; frames of earlier
        calls stay readable.
        """
        self._check_space(self._growth(batch))
        with self._watched():
            self._write(batch)

    def _growth(self, batch: Sequence[Item]) -> int:
        """Bytes by which the file may grow: an upper bound, with little to spare where frames are small."""
        frames = [item for item in batch if isinstance(item, FrameData)]
        rows = sum(padded(frame.count, self._rows) for frame in frames)
        chunks = (self._next_row + rows) / self._rows
        per_row = sum(table.row_size for table in self._columns.values())
        # zlib makes incompressible chunks longer, by less than a thousandth and some bytes.
        growth = rows * per_row + rows * per_row // 1000 + 64 * len(self._columns) * rows // self._rows
        growth += int(_INDEX * len(self._columns) * math.sqrt(chunks))
        tables = [*self._tables.values(), self._values, self._frames, self._ledger]
        growth += sum(table.new_chunks(len(frames)) for table in tables if table is not None)
        for kind, table in self._events.items():
            growth += table.new_chunks(
                sum(len(item.rows) for item in batch if isinstance(item, EventData) and item.kind == kind)
            )
        most = max((frame.count for frame in frames), default=0)
        return growth + self._more_vertices(most) // TOPOLOGY_ROWS * len(self._topology) * _VERTICES

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
        for start in range(have, have + self._more_vertices(count), TOPOLOGY_ROWS):
            data = compress(np.arange(start, start + TOPOLOGY_ROWS, dtype="<i8"))
            for table in self._topology:
                table.grow_to(start + TOPOLOGY_ROWS)
                table.put_chunk(start, data)

    def _more_vertices(self, count: int) -> int:
        """How many vertices to add when there are `count` particles; whole chunks."""
        have = len(self._topology[0])
        return 0 if count < have else padded(max(count + 1, 2 * have), TOPOLOGY_ROWS) - have

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
        """Refuse what will not fit, before HDF5 finds out in the middle of its work: it cannot take a write back, and what
        it could not write it tries again until the process crashes.
        """
        number = None
        if shutil.disk_usage(self._path.parent).free < nbytes + _RESERVE:
            number = errno.ENOSPC
        elif self._file.id.get_filesize() + nbytes + _RESERVE > _largest_file():
            number = errno.EFBIG
        if number is not None:
            raise OSError(number, os.strerror(number), str(self._path))

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
                self._end(status, dict(summary or {}))
        finally:
            if self._broken and os.name == "posix":
                self._detach(status)
            self._file.close()

    def _end(self, status: str, summary: dict[str, Any]) -> None:
        """Status and summary; a summary that does not fit is left out, and the status is "failed" then."""
        text = json.dumps(summary, ensure_ascii=False).encode() if summary else b""
        table = GrowingTable(self._file["psim/summary"])
        try:
            if text:
                self._check_space(table.new_chunks(len(text)))
        except OSError:
            status, text = "failed", b""
            raise
        finally:
            with self._watched():
                # A run that says that it is complete has all it tells of itself, wherever it is killed.
                table.extend(np.frombuffer(text, np.uint8))
                self._file.flush()
                self._file["psim/status"][()] = np.array(status.encode(), STATUS)
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


def _compressors() -> ThreadPoolExecutor:
    """Threads that compress chunks: half the cores, as stepping goes on meanwhile."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(min(8, max(1, (os.cpu_count() or 2) // 2)))


def _largest_file() -> float:
    """Bytes that a file of this process may have: what `ulimit -f` and batch systems set."""
    if sys.platform == "win32":
        return math.inf
    import resource

    soft = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return math.inf if soft == resource.RLIM_INFINITY else soft


def _memory_file() -> IO[bytes]:
    """An unnamed file in memory: the disk may be full."""
    return os.fdopen(os.memfd_create("trajectory"), "w+b")


def event_rows(ids: npt.ArrayLike, times: npt.ArrayLike, causes: npt.ArrayLike) -> npt.NDArray[Any]:
    """Ids, times [s] and cause codes, each [n], as rows of the event tables."""
    ids = np.asarray(ids, np.int64)
    rows = np.empty(len(ids), EVENT)
    rows["id"], rows["time"], rows["cause"] = ids, times, causes
    return rows
