"""Particles from a file: CSV, NPY, or a frame of a trajectory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, StringConstraints

from particlesim.errors import UsageError
from particlesim.layouts.base import CHUNK, Layout, LayoutError, Placed
from particlesim.layouts.csv_file import line_of, read_csv
from particlesim.layouts.input_file import check_regular, require_memory
from particlesim.layouts.npy_file import open_npy
from particlesim.layouts.table import Columns, Table
from particlesim.model.arrays import Floats
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.base import Name
from particlesim.model.spelling import did_you_mean
from particlesim.sampling.random_streams import Streams

if TYPE_CHECKING:
    from particlesim.trajectory.frame import Frame

COLUMNS = ("x", "y", "z", "vx", "vy", "vz", *ATTRIBUTES)
"""Columns that a CSV file or a structured NPY file may have, in SI units; x, y and z are needed."""

PARTICLE = 36
"""Memory of a particle in a run, at least [bytes]: position, velocity and mass in single precision, and its id."""


class File(Layout):
    """Particles read from a file, relative to the scenario's folder.

    `.csv`: a header line naming the columns x, y, z and any of vx, vy, vz, mass, radius, temperature, charge (SI units),
    then a line per particle. `.npy`: an array of real numbers of shape [n, 3] (positions), [n, 6] (positions and
    velocities), or a structured array of shape [n] with these names. `.vtkhdf`: a frame of another trajectory.
    """

    type: Literal["file"] = "file"
    path: Annotated[str, StringConstraints(min_length=1, max_length=4096)]
    """The file; its ending says what it is."""
    frame: Annotated[int, Field(strict=True)] = -1
    """Frame of a trajectory; −1 is the last."""
    group: Name | None = None
    """Group of a trajectory; all particles unless given."""

    _table: Table | None = PrivateAttr(default=None)

    def open(self, folder: Path | None) -> File:
        path = Path(self.path)
        if not path.is_absolute() and folder is not None:
            path = folder / path
        opened = self.model_copy()
        opened._table = self._read(path)
        return opened

    def _read(self, path: Path) -> Table:
        kinds: dict[str, Callable[[Path], Table]] = {
            ".csv": lambda path: Columns(read_csv(path)),
            ".npy": lambda path: open_npy(path, COLUMNS),
            **dict.fromkeys((".vtkhdf", ".h5", ".hdf5"), lambda path: Columns(self._read_trajectory(path))),
        }
        suffix = path.suffix.lower()
        try:
            check_regular(path, "a file of particles", "a .csv, .npy or .vtkhdf file")
            if suffix not in kinds:
                raise UsageError(
                    f"{path}: unknown kind of file {suffix!r}",
                    "particles are read from .csv, .npy and .vtkhdf",
                )
            table = kinds[suffix](path)
            require_memory(path, PARTICLE * table.number, f"{table.number:,} particles")
            _check(path, table)
            return table
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
            count = int(trajectory.counts[self.frame])
            require_memory(path, 2 * 8 * len(COLUMNS) * count, f"{count:,} particles in frame {self.frame}")
            frame = trajectory[self.frame]
            chosen = slice(None) if self.group is None else self._of_group(frame, self.group)
            position = np.asarray(frame.position, dtype=float)[chosen]
            columns = dict(zip("xyz", position.T, strict=True))
            if "velocity" in trajectory.fields:
                velocity = np.asarray(frame["velocity"], dtype=float)[chosen]
                columns |= dict(zip(("vx", "vy", "vz"), velocity.T, strict=True))
            for name in ATTRIBUTES:
                if name in trajectory.fields:
                    columns[name] = np.asarray(frame[name], dtype=float)[chosen]
        return columns

    def _of_group(self, frame: Frame, group: str) -> NDArray[np.bool_]:
        try:
            return frame.of(group)
        except UsageError as error:
            raise LayoutError(error.message, error.hint, key="group") from None

    def number(self) -> int | None:
        return None if self._table is None else self._table.number

    def attributes(self) -> frozenset[str]:
        return frozenset() if self._table is None else frozenset(self._table.columns) & ATTRIBUTES.keys()

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        assert self._table is not None, "open() comes first"
        part = self._table.read(first, count)
        zeros = np.zeros(count)
        return Placed(
            np.stack([part["x"], part["y"], part["z"]]),
            np.stack([part.get(name, zeros) for name in ("vx", "vy", "vz")]),
            {name: part[name] for name in ATTRIBUTES if name in part},
        )


def _check(path: Path, table: Table) -> None:
    """Raises UsageError for columns and numbers that are none of particles. Looks at some rows after the other."""
    unknown = [name for name in table.columns if name not in COLUMNS]
    missing = [name for name in "xyz" if name not in table.columns]
    if unknown or missing:
        what = f"unknown column {unknown[0]!r}" if unknown else f"no column {missing[0]!r}"
        hint = did_you_mean(unknown[0], COLUMNS) if unknown else None
        raise UsageError(f"{path}: {what}", hint or "columns: x, y, z, and any of " + ", ".join(COLUMNS[3:]))
    if table.number == 0:
        raise UsageError(f"{path} holds no particles")
    for first in range(0, table.number, CHUNK):
        for name, column in table.read(first, min(CHUNK, table.number - first)).items():
            attribute = ATTRIBUTES.get(name)
            bad = np.flatnonzero(~np.isfinite(column) | (attribute is not None and ~attribute.allows(column)))
            if bad.size:
                k, value = first + int(bad[0]), column[bad[0]]
                rule = attribute.rule if attribute is not None and np.isfinite(value) else "finite"
                raise UsageError(
                    f"{_place(path, k)}: {name} of particle {k} is {value:g}", f"it must be {rule}"
                )


def _place(path: Path, particle: int) -> str:
    """The file, with the line of a particle where it has lines."""
    return f"{path}:{line_of(path, particle)}" if path.suffix.lower() == ".csv" else str(path)
