"""Whether the datasets of a trajectory are of the types and shapes that `layout` gives them.

A file that was changed, or damaged where no checksum covers it, is reported as such when it is opened, not by the first
formula that fails on an array of strings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from particlesim.trajectory.fields import FIELDS
from particlesim.trajectory.files import damaged
from particlesim.trajectory.hdf5 import entries
from particlesim.trajectory.layout import CELLS, EVENT, FRAME, STATUS, column_path
from particlesim.trajectory.structure import MOST_TEXT

_Type = Callable[[np.dtype[Any]], bool]
_Expected = tuple[str, tuple[int, ...] | None, _Type]
"""A dataset's name, the lengths that a row has (None for a scalar), and whether a type is right."""

_DENSEST = 1032
"""Bytes that one compressed byte can stand for, at most (zlib)."""
_FILLED_IN = 64 << 20
"""Bytes of a table that may be nothing but HDF5's fill value, which is not stored."""
_LARGEST_CHUNK = 64 << 20
"""Bytes; psim's are up to 1.5 MB."""
_REQUIRED = ("VTKHDF/Points", "VTKHDF/PointData/id", "psim/frames", "psim/status", "psim/summary", "psim/groups",
             "psim/events/births", "psim/events/deaths")  # fmt: skip


def check_contents(file: h5py.File, path: Path) -> None:
    """Raise UsageError for a dataset that is missing, not what `layout` makes, or longer than the file can hold.

    Reads no data.
    """
    size = path.stat().st_size
    for name in _REQUIRED:
        if not isinstance(file.get(name), h5py.Dataset):
            raise damaged(path, f"it lacks the dataset /{name}")
    for name, row, fits in _expected(file):
        dataset = file.get(name)
        if dataset is None:
            continue
        if not isinstance(dataset, h5py.Dataset):
            raise damaged(path, f"/{name} is not a dataset")
        if not fits(dataset.dtype):
            raise damaged(path, f"the dataset /{name} holds values of type {_type_name(dataset.dtype)}")
        if dataset.ndim != (0 if row is None else 1 + len(row)) or dataset.shape[1:] != (row or ()):
            raise damaged(path, f"the dataset /{name} has the shape {list(dataset.shape or ())}")
        if not _can_hold(dataset, size):
            raise damaged(path, f"the dataset /{name} is longer than the file can hold: {dataset.shape[0]:,}")
    topology = file.get("psim/topology", {})
    if isinstance(topology, h5py.Dataset) or not all(
        isinstance(entry, h5py.Group) for _, entry in entries(topology)
    ):
        raise damaged(path, "its springs and surfaces cannot be read")
    if len(file["psim/groups"]) > MOST_TEXT:
        raise damaged(path, "it has too many groups")


def _can_hold(dataset: h5py.Dataset, size: int) -> bool:
    """Whether a file of `size` bytes can hold what a dataset declares: a few bytes declare any length, and memory for it
    is taken before HDF5 finds nothing there.
    """
    settings = dataset.id.get_create_plist()
    packed = settings.get_nfilters() > 0
    chunk = math.prod(dataset.chunks or ()) * dataset.dtype.itemsize
    return chunk <= _LARGEST_CHUNK and dataset.nbytes <= (_DENSEST if packed else 1) * size + _FILLED_IN


def check_tables(file: h5py.File, path: Path, rows: npt.NDArray[np.void]) -> None:
    """Read all but the particles: the index of every dataset, all tables, and what VTK reads, which must say the same as
    `rows`, those of the frames that matter. Raises UsageError, or what h5py raises on damaged metadata.
    """
    size = path.stat().st_size
    columns = {column_path(name) for name in FIELDS}
    for name, _, _ in _expected(file):
        dataset = file.get(name)
        if dataset is None:
            continue
        if dataset.chunks is not None:
            _check_index(dataset, path, size)
        if name not in columns:
            dataset[()]
    told = {
        "VTKHDF/NumberOfPoints": rows["count"],
        "VTKHDF/Steps/Values": rows["time"],
        "VTKHDF/Steps/PointOffsets": rows["offset"],
        "VTKHDF/Steps/PartOffsets": rows["number"] - 1,
    }
    for name, values in told.items():
        if not np.array_equal(file[name][: len(rows)], values):
            raise damaged(path, f"/{name} and the table of frames contradict each other")


def _check_index(dataset: h5py.Dataset, path: Path, size: int) -> None:
    """Look up where every chunk is; all must lie inside the file, of `size` bytes."""
    beyond: list[Any] = []

    def look(chunk: Any) -> None:
        if chunk.byte_offset + chunk.size > size:
            beyond.append(chunk)

    dataset.id.chunk_iter(look)
    if beyond:
        raise damaged(path, f"parts of {dataset.name} are missing")


def _expected(file: h5py.File) -> Iterator[_Expected]:
    for spec in FIELDS.values():
        types = {spec.dtype("single"), spec.dtype("double")}
        yield column_path(spec.name), spec.shape(0)[1:], types.__contains__
    yield "psim/frames", (), FRAME.__eq__
    yield "psim/ledger", (), _is_ledger
    for kind in ("births", "deaths"):
        yield f"psim/events/{kind}", (), EVENT.__eq__
    yield "psim/groups", (), _is_text
    yield "psim/status", None, STATUS.__eq__
    yield "psim/summary", (), np.dtype("u1").__eq__
    yield from _vtk()
    topology = file.get("psim/topology")
    for name in list(topology) if isinstance(topology, h5py.Group) else ():
        for part, row in (("pairs", (2,)), ("triangles", (3,))):
            yield f"psim/topology/{name}/{part}", row, _is_integer
        yield f"psim/topology/{name}/points", (2, 3), np.dtype("<f8").__eq__
        for part in ("rest", "broke"):
            yield f"psim/topology/{name}/{part}", (), np.dtype("<f8").__eq__


def _vtk() -> Iterator[_Expected]:
    """What VTK reads; repairs and resumed runs change it."""
    yield "VTKHDF/NumberOfPoints", (), _is_integer
    yield "VTKHDF/Steps/Values", (), np.dtype("<f8").__eq__
    for name in ("PointOffsets", "PartOffsets", "NumberOfParts"):
        yield f"VTKHDF/Steps/{name}", (), _is_integer
    for spec in FIELDS.values():
        yield f"VTKHDF/Steps/PointDataOffsets/{spec.name}", (), _is_integer
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        yield f"VTKHDF/Steps/{name}", (4,), _is_integer
    for kind in (*CELLS, "Vertices"):
        for name in ("NumberOfCells", "NumberOfConnectivityIds", "Offsets", "Connectivity"):
            yield f"VTKHDF/{kind}/{name}", (), _is_integer


def _is_integer(dtype: np.dtype[Any]) -> bool:
    return dtype.kind == "i"


def _is_text(dtype: np.dtype[Any]) -> bool:
    return h5py.check_string_dtype(dtype) is not None


def _is_ledger(dtype: np.dtype[Any]) -> bool:
    return dtype.names is not None and all(dtype[name] == np.dtype("<f8") for name in dtype.names)


def _type_name(dtype: np.dtype[Any]) -> str:
    """A type in few words: that of a table may be long."""
    return "compound" if dtype.names else "text" if _is_text(dtype) else str(dtype)
