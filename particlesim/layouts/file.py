"""Particles from a file: CSV, NPY, or a frame of a trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PrivateAttr, StringConstraints

from particlesim.errors import UsageError
from particlesim.layouts.base import Floats, Layout, Placed
from particlesim.model import Name
from particlesim.streams import Streams
from particlesim.trajectory.places import kind_of

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
        if path.is_dir():
            raise UsageError(
                f"{path} is a directory, not a file of particles", "name a .csv, .npy or .vtkhdf file"
            )
        if not path.is_file():
            kind = kind_of(path)
            raise UsageError(
                f"{path} is a {kind}, not a file" if kind else f"{path} does not exist",
                "the path of a layout is relative to the scenario's folder",
            )
        suffix = path.suffix.lower()
        if suffix == ".csv":
            return _read_csv(path)
        if suffix == ".npy":
            return _read_npy(path)
        if suffix in (".vtkhdf", ".h5", ".hdf5"):
            return self._read_trajectory(path)
        raise UsageError(
            f"{path}: unknown kind of file {suffix!r}", "particles are read from .csv, .npy and .vtkhdf"
        )

    def _read_trajectory(self, path: Path) -> dict[str, Floats]:
        from particlesim.trajectory import reader

        with reader.open(path) as trajectory:
            if not -len(trajectory) <= self.frame < len(trajectory):
                raise UsageError(f"{path} has {len(trajectory)} frames, there is no frame {self.frame}")
            frame = trajectory[self.frame]
            chosen = slice(None) if self.group is None else frame.of(self.group)
            position = np.asarray(frame.position, dtype=float)[chosen]
            columns = dict(zip("xyz", position.T, strict=True))
            if "velocity" in trajectory.fields:
                velocity = np.asarray(frame["velocity"], dtype=float)[chosen]
                columns |= dict(zip(("vx", "vy", "vz"), velocity.T, strict=True))
            for name in ("mass", "radius", "temperature"):
                if name in trajectory.fields:
                    columns[name] = np.asarray(frame[name], dtype=float)[chosen]
        return columns

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


def _read_csv(path: Path) -> dict[str, Floats]:
    with path.open(encoding="utf-8-sig", errors="replace") as lines:
        header = [name.strip() for name in lines.readline().split(",")]
        try:
            table = np.loadtxt(lines, delimiter=",", ndmin=2)
        except ValueError as error:
            raise UsageError(
                f"{path}: {error}", "every line after the header holds one number per column"
            ) from None
    if table.size == 0:
        raise UsageError(f"{path} holds no particles")
    if table.shape[1] != len(header):
        raise UsageError(f"{path}: {len(header)} columns are named, {table.shape[1]} are filled")
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(header)}


def _read_npy(path: Path) -> dict[str, Floats]:
    try:
        array = np.load(path, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise UsageError(f"{path} is no NPY file: {error}") from None
    if array.dtype.names:
        return {name: np.asarray(array[name], dtype=float).ravel() for name in array.dtype.names}
    if array.ndim != 2 or array.shape[1] not in (3, 6) or array.dtype.kind not in "fiu":
        raise UsageError(
            f"{path}: an array of shape {list(array.shape)} and type {array.dtype}",
            "positions have shape [n, 3], positions with velocities [n, 6]",
        )
    return {name: np.array(array[:, k], dtype=float) for k, name in enumerate(COLUMNS[: array.shape[1]])}


def _checked(path: Path, columns: dict[str, Floats]) -> dict[str, Floats]:
    unknown = [name for name in columns if name not in COLUMNS]
    missing = [name for name in "xyz" if name not in columns]
    if unknown or missing:
        what = f"unknown column {unknown[0]!r}" if unknown else f"no column {missing[0]!r}"
        raise UsageError(f"{path}: {what}", "columns: x, y, z, and any of " + ", ".join(COLUMNS[3:]))
    for name, column in columns.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise UsageError(
                f"{path}: {name} of particle {bad[0]} is {column[bad[0]]}", "every number must be finite"
            )
        if (name == "mass" and (column <= 0).any()) or (
            name in ("radius", "temperature") and (column < 0).any()
        ):
            raise UsageError(f"{path}: {name} of particle {int(column.argmin())} is {column.min()}")
    if len(columns["x"]) == 0:
        raise UsageError(f"{path} holds no particles")
    return columns
