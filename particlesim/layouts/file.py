"""Particles from a file: CSV, NPY, or a frame of a trajectory."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, StringConstraints

from particlesim.errors import UsageError
from particlesim.layouts.base import Floats, Layout, LayoutError, Placed
from particlesim.layouts.csv_file import line_of, read_csv
from particlesim.model import Name
from particlesim.names import did_you_mean
from particlesim.streams import Streams
from particlesim.trajectory.places import kind_of

if TYPE_CHECKING:
    from particlesim.trajectory.frame import Frame

COLUMNS = ("x", "y", "z", "vx", "vy", "vz", "mass", "radius", "temperature")
"""Columns that a CSV file or a structured NPY file may have, in SI units; x, y and z are needed."""


class File(Layout):
    """Particles read from a file, relative to the scenario's folder.

    `.csv`: a header line naming the columns x, y, z and any of vx, vy, vz, mass, radius, temperature (SI units), then a
    line per particle. `.npy`: an array of shape [n, 3] (positions), [n, 6] (positions and velocities), or a structured
    array with these names. `.vtkhdf`: a frame of another trajectory.
    """

    type: Literal["file"] = "file"
    path: Annotated[str, StringConstraints(min_length=1, max_length=4096)]
    """The file; its ending says what it is."""
    frame: Annotated[int, Field(strict=True)] = -1
    """Frame of a trajectory; −1 is the last."""
    group: Name | None = None
    """Group of a trajectory; all particles unless given."""

    _columns: dict[str, Floats] | None = PrivateAttr(default=None)

    def open(self, folder: Path | None) -> File:
        path = Path(self.path)
        if not path.is_absolute() and folder is not None:
            path = folder / path
        opened = self.model_copy()
        opened._columns = _checked(path, self._read(path))
        return opened

    def _read(self, path: Path) -> dict[str, Floats]:
        kinds = {".csv": read_csv, ".npy": _read_npy}
        kinds |= dict.fromkeys((".vtkhdf", ".h5", ".hdf5"), self._read_trajectory)
        suffix = path.suffix.lower()
        try:
            _check_file(path)
            if suffix not in kinds:
                raise UsageError(
                    f"{path}: unknown kind of file {suffix!r}",
                    "particles are read from .csv, .npy and .vtkhdf",
                )
            return kinds[suffix](path)
        except (OSError, ValueError) as error:  # ValueError: a NUL character in the name
            reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            raise UsageError(
                f"{path} cannot be read: {reason}", "check the path and its permissions"
            ) from None

    def _read_trajectory(self, path: Path) -> dict[str, Floats]:
        from particlesim.trajectory import reader

        with reader.open(path) as trajectory:
            if not -len(trajectory) <= self.frame < len(trajectory):
                last = len(trajectory) - 1
                raise LayoutError(
                    f"{path} has no frame {self.frame}", f"its frames are 0 to {last}", key="frame"
                )
            frame = trajectory[self.frame]
            chosen = slice(None) if self.group is None else self._of_group(frame, self.group)
            position = np.asarray(frame.position, dtype=float)[chosen]
            columns = dict(zip("xyz", position.T, strict=True))
            if "velocity" in trajectory.fields:
                velocity = np.asarray(frame["velocity"], dtype=float)[chosen]
                columns |= dict(zip(("vx", "vy", "vz"), velocity.T, strict=True))
            for name in ("mass", "radius", "temperature"):
                if name in trajectory.fields:
                    columns[name] = np.asarray(frame[name], dtype=float)[chosen]
        return columns

    def _of_group(self, frame: Frame, group: str) -> NDArray[np.bool_]:
        try:
            return frame.of(group)
        except UsageError as error:
            raise LayoutError(error.message, error.hint, key="group") from None

    def number(self) -> int | None:
        return None if self._columns is None else len(self._columns["x"])

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        assert self._columns is not None, "open() comes first"
        part = {name: column[first : first + count] for name, column in self._columns.items()}
        zeros = np.zeros(count)
        return Placed(
            np.stack([part["x"], part["y"], part["z"]]),
            np.stack([part.get(name, zeros) for name in ("vx", "vy", "vz")]),
            part.get("mass"),
            part.get("radius"),
            part.get("temperature"),
        )


def _check_file(path: Path) -> None:
    """Refuse what is no file, before anything waits for it to be read. Raises UsageError."""
    if path.is_dir():
        raise UsageError(
            f"{path} is a directory, not a file of particles", "name a .csv, .npy or .vtkhdf file"
        )
    if not path.exists():
        raise UsageError(
            f"{path} does not exist", "the path of a layout is relative to the scenario's folder"
        )
    if not path.is_file():
        raise UsageError(f"{path} is a {kind_of(path)}, not a file", "name a .csv, .npy or .vtkhdf file")


def _read_npy(path: Path) -> dict[str, Floats]:
    try:
        _check_npy_length(path)
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:  # its own words speak of pickles, which may run code
        hint = "numpy.save(name, array) writes one; arrays of Python objects are not read"
        raise UsageError(f"{path} is no NPY file of numbers", hint) from error
    if array.dtype.names:
        return {name: np.asarray(array[name], dtype=float).ravel() for name in array.dtype.names}
    if array.ndim != 2 or array.shape[1] not in (3, 6) or array.dtype.kind not in "fiu":
        raise UsageError(
            f"{path}: an array of shape {list(array.shape)} and type {array.dtype}",
            "positions have shape [n, 3], positions with velocities [n, 6]",
        )
    return {name: np.array(array[:, k], dtype=float) for k, name in enumerate(COLUMNS[: array.shape[1]])}


def _check_npy_length(path: Path) -> None:
    """Refuse an array that the file has no room for, before memory is taken for it.

    Raises UsageError, and ValueError for what is no NPY file of versions 1 and 2 (3 is for names beyond Latin-1).
    """
    with path.open("rb") as file:
        readers = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        version = np.lib.format.read_magic(file)
        if version not in readers:
            raise ValueError("unknown version")
        shape, _, dtype = readers[version](file)
        there = path.stat().st_size - file.tell()
    if not dtype.hasobject and math.prod(shape) * dtype.itemsize > there:
        raise UsageError(
            f"{path} is shorter than its header says: {there:,} bytes for an array of shape {list(shape)} and type {dtype}",
            "an incomplete copy or download? fetch it again",
        )


def _checked(path: Path, columns: dict[str, Floats]) -> dict[str, Floats]:
    unknown = [name for name in columns if name not in COLUMNS]
    missing = [name for name in "xyz" if name not in columns]
    if unknown or missing:
        what = f"unknown column {unknown[0]!r}" if unknown else f"no column {missing[0]!r}"
        hint = did_you_mean(unknown[0], COLUMNS) if unknown else None
        raise UsageError(f"{path}: {what}", hint or "columns: x, y, z, and any of " + ", ".join(COLUMNS[3:]))
    for name, column in columns.items():
        least = {"mass": np.nextafter(0, 1), "radius": 0, "temperature": 0}.get(name, -np.inf)
        bad = np.flatnonzero(~np.isfinite(column) | (column < least))
        if bad.size:
            k = int(bad[0])
            allowed = {"mass": "greater than 0", "radius": "0 or more", "temperature": "0 or more"}
            rule = allowed[name] if name in allowed and np.isfinite(column[k]) else "finite"
            raise UsageError(
                f"{_place(path, k)}: {name} of particle {k} is {column[k]:g}", f"it must be {rule}"
            )
    if len(columns["x"]) == 0:
        raise UsageError(f"{path} holds no particles")
    return columns


def _place(path: Path, particle: int) -> str:
    """The file, with the line of a particle where it has lines."""
    return f"{path}:{line_of(path, particle)}" if path.suffix.lower() == ".csv" else str(path)
