"""Read trajectories: complete ones, ones that are being written, ones whose writer was killed."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar, overload

import h5py
import numpy as np
import numpy.typing as npt

from particlesim.errors import PsimError, UsageError
from particlesim.trajectory.fields import FIELDS, unknown_name
from particlesim.trajectory.files import check_readable, damaged, finished_frames, lies_inside, open_file
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.hdf5 import entries
from particlesim.trajectory.integrity import check_contents, check_tables
from particlesim.trajectory.layout import STATES, STATUS, column_path, read_box
from particlesim.trajectory.lock import is_being_written
from particlesim.trajectory.summary import read_summary
from particlesim.trajectory.superblock import read_superblock
from particlesim.trajectory.topology import Topology, read_topology

Array = npt.NDArray[Any]

_T = TypeVar("_T")
_PATIENCE = 1.0
"""Seconds for which a file that is being written is looked at again and again."""


def open(path: str | PathLike[str]) -> Trajectory:
    """Open the trajectory file `path` for reading.

    Raises UsageError when it is missing, no trajectory, truncated or damaged, InputOutputError when it leads to other files.
    """
    return Trajectory(Path(path))


class Trajectory(Sequence[Frame]):
    """The frames of a file, in order of time; nothing is loaded before it is used.

    A context manager and a sequence: `len(t)`, `t[0]`, `t[-1]`, `t[10:20]` (a list), `for frame in t`.
    Attributes (arrays over all frames): `times` [s], `steps`, `counts` of particles, `ledger` by column name.
    """

    path: Path
    fields: tuple[str, ...]
    groups: tuple[str, ...]
    provenance: dict[str, str | int | float]
    times: npt.NDArray[np.float64]
    steps: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int64]
    ledger: dict[str, npt.NDArray[np.float64]]
    status: str
    summary: dict[str, Any]

    def __init__(self, path: Path) -> None:
        self.path = path
        self._live = False  # whether it was being written when it was opened
        self._patiently(self._take_in, lambda: None)

    def _take_in(self) -> None:
        """Open the file, and read what it holds now.

        A writer finishes the data of a frame, then its row in /psim/frames, at the end the status, and then gives back its
        lock. HDF5 remembers how long a dataset was when it first looked, so this looks in the opposite order: what it knows
        of is there.
        """
        check_readable(self.path)
        self._live = is_being_written(self.path)
        self._file = open_file(self.path)
        self._topology: Mapping[str, Topology] | None = None
        try:
            try:
                self.status = _status(self._file["psim/status"])
                len(self._file["psim/frames"])
            finally:  # also when that failed: it tells why
                check_contents(self._file, self.path)
            if self.status not in STATES:
                raise damaged(self.path, "it does not tell how the run ended")
            if self.status == "running" and not self._live:
                self.status = "interrupted"
            self._read_header()
            self._read_frames()
        except PsimError:
            self._file.close()
            raise
        except Exception as error:  # what h5py raises on damaged metadata is of many kinds
            self._file.close()
            raise damaged(self.path) from error

    def _patiently(self, read: Callable[[], _T], again: Callable[[], None]) -> _T:
        """What `read` gives. In a file that is being written it may meet a write in progress: then `again`, and anew."""
        until = time.monotonic() + _PATIENCE
        while True:
            try:
                return read()
            except Exception:
                if time.monotonic() > until or not (self._live or self._is_written()):
                    raise
            time.sleep(0.01)
            again()

    def _is_written(self) -> bool:
        try:
            return is_being_written(self.path)
        except OSError:
            return False

    def _bind_again(self) -> None:
        """Open the file anew without taking notice of more frames."""
        self._file.close()
        self._live = self._is_written()
        self._file = open_file(self.path)
        self._bind()

    def _read_header(self) -> None:
        psim = self._file["psim"]
        recorded = self._file["VTKHDF/PointData"]
        self.fields = tuple(name for name in FIELDS if name == "position" or name in recorded)
        self.groups = tuple(psim["groups"].asstr()[:]) if len(psim["groups"]) else ()
        self.box = read_box(psim)
        if self.box is not None and "image" not in self.fields:
            raise damaged(self.path, "it has a periodic box and no images")
        self.provenance = {name: _plain(dataset) for name, dataset in entries(psim["provenance"])}
        if not isinstance(self.provenance.get("scenario", ""), str):
            raise damaged(self.path, "its scenario is not text")
        self._bind()

    def _bind(self) -> None:
        self._columns: dict[str, h5py.Dataset] = {name: self._file[column_path(name)] for name in self.fields}

    def _read_frames(self) -> None:
        self._cut_off = self._end_if_cut_off()
        rows = finished_frames(self._whole(self._file["psim/frames"]))
        self._check_places(rows)
        self._rows = rows
        self.times, self.steps, self.counts = (rows[name].copy() for name in ("time", "step", "count"))
        self.ledger = {}
        if "psim/ledger" in self._file:
            ledger = self._whole(self._file["psim/ledger"])[: len(rows)]
            if len(ledger) < len(rows):
                raise damaged(self.path, "its ledger has fewer rows than there are frames")
            self.ledger = {name: ledger[name].copy() for name in ledger.dtype.names}
        self.summary = read_summary(self._file["psim/summary"][:].tobytes(), self.path)

    def _end_if_cut_off(self) -> int | None:
        """The size of a file that lacks something at its end, as HDF5 would read zeros there; None if it is whole.

        Only a killed writer's file gets here so: a file in use is still growing, and `open_file` refuses others.
        """
        block, size = read_superblock(self.path), self.path.stat().st_size
        return size if self.status != "running" and block is not None and block.end > size else None

    def _whole(self, table: h5py.Dataset) -> h5py.Dataset:
        """A table all of whose rows are in the file. Raises UsageError if it is cut off."""
        if self._cut_off is not None and not lies_inside(table, 0, len(table), self._cut_off):
            raise damaged(self.path, f"it is cut off within its tables, after {self._cut_off} bytes")
        return table

    def _check_places(self, rows: Array) -> None:
        """Raise UsageError for rows of /psim/frames that lead outside of the file's columns."""
        length = min(len(column) for column in self._columns.values())
        wrong = (rows["offset"] < 0) | (rows["count"] < 0) | (rows["count"] > length)
        wrong |= (rows["offset"] > length - rows["count"]) | (np.diff(rows["step"], prepend=-1) < 0)
        with np.errstate(invalid="ignore", over="ignore"):
            wrong |= ~np.isfinite(rows["time"]) | (np.diff(rows["time"], prepend=-np.inf) < 0)
        for kind in ("births", "deaths"):
            wrong |= (rows[kind] < 0) | (rows[kind] > len(self._file[f"psim/events/{kind}"]))
        if wrong.any():
            raise damaged(self.path, f"its table of frames makes no sense at frame {int(wrong.argmax())}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled, it is its path: another process opens the file anew."""
        return type(self), (self.path,)

    def refresh(self) -> None:
        """Take notice of the frames that a running simulation has added meanwhile."""
        self._open_file().close()
        self._patiently(self._take_in, lambda: None)

    @property
    def scenario(self) -> str:
        """The scenario as it was run, TOML text; "" when the file holds none."""
        return str(self.provenance.get("scenario", ""))

    @property
    def most(self) -> int | None:
        """About how many particles there are at most at the same time, as was known before the run; None where the file does
        not tell."""
        told = self.provenance.get("particles")
        return told if isinstance(told, int) and told >= 0 else None

    @property
    def precision(self) -> str:
        """How floats are stored: "single" or "double"."""
        return "single" if self._columns["position"].dtype.itemsize == 4 else "double"

    @property
    def topology(self) -> Mapping[str, Topology]:
        """Springs and surfaces by name: sets of springs as in the ledger (flag.structural), surfaces as groups (flag).

        Read when first asked for, and again after `refresh`.
        """
        if self._topology is None:
            self._open_file()
            try:
                self._topology = self._patiently(lambda: read_topology(self._file), self._bind_again)
            except Exception as error:
                raise damaged(self.path, "its springs and surfaces cannot be read") from error
        return self._topology

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self._frame(i) for i in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return self._frame(index % len(self))

    def __iter__(self) -> Iterator[Frame]:
        return (self._frame(i) for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<Trajectory {self.path}: {len(self)} frame{'s' * (len(self) != 1)}, {self.status}>"

    def _frame(self, index: int) -> Frame:
        row = self._rows[index]
        return Frame(
            index=index,
            time=float(row["time"]),
            step=int(row["step"]),
            count=int(row["count"]),
            fields=self.fields,
            groups=self.groups,
            load=lambda field: self._read(field, index),
            box=self.box,
        )

    def _read(self, field: str, index: int, row: int | None = None) -> Array:
        """A field of a frame, or of the one particle in `row` of it (then with a leading length of 1)."""
        self._open_file()
        offset, count = int(self._rows["offset"][index]), int(self._rows["count"][index])
        start, stop = (offset, offset + count) if row is None else (offset + row, offset + row + 1)
        what = f"{field!r} of frame {index} cannot be read"
        try:
            return self._patiently(lambda: self._rows_of(field, start, stop, what), self._bind_again)
        except PsimError:
            raise
        except Exception as error:
            raise damaged(self.path, what) from error

    def _rows_of(self, field: str, start: int, stop: int, what: str) -> Array:
        column = self._columns[field]
        if self._cut_off is not None and not lies_inside(column, start, stop, self._cut_off):
            raise damaged(self.path, f"it is cut off, {what}")
        values: Array = column[start:stop]
        if len(values) != stop - start:
            raise damaged(self.path, what)
        if field == "group" and not ((values >= 0) & (values < len(self.groups))).all():
            raise damaged(self.path, f"{what}: it counts into {len(self.groups)} groups")
        return values

    def verify(self, frames: int, seconds: float) -> int:
        """Whether the first `frames` frames are whole. Reads every index of chunks and the tables, and then, for so many
        seconds, the data of the frames, the newest first; returns how many of them were read.

        HDF5's own structures and compressed data carry checksums; other numbers do not, and of those of
        tables, what is there twice is compared. Raises UsageError for what is damaged.
        """
        until = time.monotonic() + seconds
        try:
            check_tables(self._open_file(), self.path, self._rows[:frames])
        except PsimError:
            raise
        except Exception as error:
            raise damaged(self.path) from error
        for read, index in enumerate(reversed(range(frames))):
            if time.monotonic() > until:
                return read
            for field in self.fields:
                self._read(field, index)
        return frames

    def frame_at(self, time: float) -> Frame:
        """The frame nearest to `time` [s], of two equally near the earlier. UsageError if there is none."""
        if not len(self):
            raise UsageError(f"{self.path} has no frames yet")
        return self._frame(int(np.argmin(np.abs(self.times - time))))

    def track(self, id: int) -> dict[str, Array]:
        """The life of one particle: "time" [k], "step" [k] and every recorded field, [k] or [k, 3].

        Frames in which it does not exist are left out. UsageError when it is in none.
        """
        places = self._find(id)
        if not places:
            raise UsageError(f"no particle in {self.path} has the id {id}")
        frames = np.array([index for index, _ in places])
        track: dict[str, Array] = {"time": self.times[frames], "step": self.steps[frames]}
        for field in self.fields:
            track[field] = np.concatenate([self._read(field, index, row) for index, row in places])
        return track

    def _find(self, id: int) -> list[tuple[int, int]]:
        """Frame and row of a particle wherever it exists; mostly the row is that of the frame before."""
        places: list[tuple[int, int]] = []
        row = 0
        for index, count in enumerate(self.counts):
            if not (places and row < count and self._read("id", index, row)[0] == id):
                found = np.flatnonzero(self._read("id", index) == id)
                if not len(found):
                    continue
                row = int(found[0])
            places.append((index, row))
        return places

    def events(self, kind: str) -> dict[str, Array]:
        """All births or deaths ("birth", "death") up to the last frame: "id", "time" [s] and "cause", each
        [k].

        A cause is a name when the file has names for the codes, else the code.
        """
        if kind not in ("birth", "death"):
            raise unknown_name("kind of event", kind, ("birth", "death"))
        self._open_file()
        known = int(self._rows[f"{kind}s"][-1]) if len(self) else 0
        try:
            rows, names = self._patiently(lambda: self._events(kind, known), self._bind_again)
            causes = rows["cause"]
        except PsimError:
            raise
        except Exception as error:
            raise damaged(self.path, f"its {kind}s cannot be read") from error
        if len(rows) and int(causes.max()) < len(names):
            causes = np.array(names)[causes]
        return {"id": rows["id"].copy(), "time": rows["time"].copy(), "cause": causes}

    def _events(self, kind: str, known: int) -> tuple[Array, list[str]]:
        """The first rows of a table of events, and the names of causes."""
        table = self._whole(self._file[f"psim/events/{kind}s"])
        names = json.loads(table.attrs["causes"])
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise damaged(self.path, f"its causes of {kind}s have no names")
        return table[:known], names

    def shape_of(self, field: str, rows: int) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """Shape and type that `rows` particles have in `field`."""
        if field not in self.fields:
            raise unknown_name("field", field, self.fields)
        return FIELDS[field].shape(rows), self._columns[field].dtype

    def close(self) -> None:
        """Close the file; frames keep the fields they have loaded."""
        self._file.close()

    def _open_file(self) -> h5py.File:
        if not self._file:
            raise UsageError(
                f"{self.path} has been closed",
                "Use the trajectory and its frames inside the `with` block; fields that a frame has loaded there stay.",
            )
        return self._file

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _status(dataset: h5py.Dataset) -> str:
    """What `psim/status` says; nothing where it is not what `layout` makes, so that nothing large is read."""
    return dataset[()].decode() if dataset.shape == () and dataset.dtype == STATUS else ""


def _plain(dataset: h5py.Dataset) -> str | int | float:
    """A scalar dataset as Python's own type. Raises ValueError for a dataset with more values."""
    if dataset.shape != ():
        raise ValueError(f"{dataset.name} has the shape {dataset.shape}")
    value = dataset[()]
    plain: str | int | float = value.decode() if isinstance(value, bytes) else value.item()
    return plain
