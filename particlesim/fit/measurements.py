"""Measured trajectories from a CSV file.

The header names the columns, with units where they are not those of the SI: `time [ms], id, x [mm], y [mm], sigma_y [mm]`.
An empty cell was not measured.
"""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO, get_args

import numpy as np
from numpy.typing import NDArray

from particlesim.errors import UsageError
from particlesim.layouts.input_file import bounded_lines, check_regular, require_memory
from particlesim.model.arrays import Floats
from particlesim.model.spelling import did_you_mean
from particlesim.model.units import Metres, MetresPerSecond, Seconds, Unit

COMPONENTS = ("x", "y", "z", "vx", "vy", "vz")
_POSITION, _VELOCITY = (get_args(kind)[1] for kind in (Metres, MetresPerSecond))
_UNITS: dict[str, Unit] = {
    "time": get_args(Seconds)[1],
    **dict.fromkeys(COMPONENTS[:3], _POSITION),
    **dict.fromkeys(COMPONENTS[3:], _VELOCITY),
}
_UNITS |= {f"sigma_{name}": _UNITS[name] for name in COMPONENTS}
COLUMNS = (*_UNITS, "id")
ROWS = 1 << 16
"""Rows after which the memory for as many more is asked for."""
ROW = 1000
"""Memory of a row, at most [bytes]: its 14 numbers three times, and what a fit predicts for them."""


@dataclass(frozen=True)
class Measurements:
    """Rows of a data file: times [s], particle ids (None without such a column), and what was measured.

    `values` and `sigma` have shape [rows, 6]: position [m] and velocity [m/s], NaN where nothing was measured; the standard
    errors in `sigma` are None when the file gives none.
    """

    path: Path
    times: Floats
    ids: NDArray[np.int64] | None
    values: Floats
    sigma: Floats | None

    @property
    def count(self) -> int:
        """Numbers that were measured."""
        return int(np.isfinite(self.values).sum())


def read_measurements(path: Path) -> Measurements:
    """The measurements in a CSV file.

    Raises UsageError, with the line, for a file that cannot be read, unknown columns or units, and cells that are no
    numbers.
    """
    try:
        check_regular(path, "a file of measurements", "a CSV file", missing=None)
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = _cells(path, file)
            first = next(lines, None)
            if first is None:
                raise UsageError(
                    f"{path} is empty", f"The first line names the columns: {', '.join(COLUMNS)}."
                )
            names, factors = _header(path, *first)
            numbers, places = array("d"), array("q")
            for line, cells in lines:
                if len(places) % ROWS == 0:
                    require_memory(path, ROW * (len(places) + ROWS), f"{len(places):,} measurements or more")
                numbers.extend(_row(path, line, cells, names, factors))
                places.append(line)
    except UnicodeDecodeError:
        raise UsageError(f"{path} is not a text file", "Measurements are read from CSV files.") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from None
    except csv.Error as error:
        raise UsageError(f"{path} is not a CSV file: {error}") from None
    if not places:
        raise UsageError(f"{path} has a header and no measurements")
    table = np.array(numbers).reshape(len(places), -1)
    columns = dict(zip(names, table.T, strict=True))
    missing = np.full(len(table), np.nan)
    values = np.column_stack([columns.get(name, missing) for name in COMPONENTS])
    if not np.isfinite(values).any():
        raise UsageError(
            f"{path} holds no measured numbers", f"Give at least one of {', '.join(COMPONENTS)}."
        )
    return Measurements(
        path, columns["time"], _ids(path, places, columns), values, _sigma(path, places, columns, values)
    )


def _cells(path: Path, file: TextIO) -> Iterator[tuple[int, list[str]]]:
    """The cells of lines that have any, with the numbers of the lines. Raises UsageError, csv.Error."""
    reader = csv.reader(bounded_lines(path, file))
    return ((reader.line_num, row) for row in reader if any(cell.strip() for cell in row))


def _header(path: Path, line: int, cells: list[str]) -> tuple[list[str], list[float]]:
    """Names of the columns, and what their numbers are multiplied with to be in SI units."""
    names, factors = [], []
    for cell in cells:
        name, bracket, unit = (part.strip() for part in cell.partition("["))
        if name not in COLUMNS:
            known = f"The columns are {', '.join(COLUMNS)}, with units in brackets: x [mm]."
            raise UsageError(f"{path}:{line}: unknown column {name!r}", did_you_mean(name, COLUMNS) or known)
        if name in names:
            raise UsageError(f"{path}:{line}: the column {name!r} occurs twice")
        names.append(name)
        factors.append(_factor(path, line, name, unit.removesuffix("]").strip()) if bracket else 1.0)
    for name in ("time",):
        if name not in names:
            raise UsageError(f"{path}:{line}: there is no column 'time'", "Every measurement has a time.")
    return names, factors


def _factor(path: Path, line: int, name: str, unit: str) -> float:
    if name == "id":
        raise UsageError(f"{path}:{line}: an id has no unit")
    try:
        return _UNITS[name].parse(f"1 {unit}")
    except ValueError as error:
        raise UsageError(f"{path}:{line}: column {name!r}: {error}") from None


def _row(path: Path, line: int, cells: list[str], names: list[str], factors: list[float]) -> list[float]:
    if len(cells) != len(names):
        raise UsageError(f"{path}:{line}: {len(cells)} cells, the header names {len(names)} columns")
    row = []
    for name, factor, cell in zip(names, factors, cells, strict=True):
        try:
            if "_" in cell:
                raise ValueError  # which Python takes for 1000 in 1_000
            value = float(cell) if cell.strip() else math.nan
        except ValueError:
            raise UsageError(
                f"{path}:{line}: {name} is {cell.strip()!r}, which is not a number",
                "Leave the cell empty where nothing was measured; units stand in the header.",
            ) from None
        if math.isinf(value) or (math.isnan(value) and (cell.strip() or name in ("time", "id"))):
            raise UsageError(f"{path}:{line}: {name} is {cell.strip() or 'missing'}, it must be finite")
        if name == "time" and value < 0:
            raise UsageError(f"{path}:{line}: the time is negative", "Runs begin at time 0.")
        if math.isinf(value * factor):
            raise UsageError(
                f"{path}:{line}: {name} is {cell.strip()}, which is beyond all numbers in SI units"
            )
        row.append(value * factor)
    return row


def _ids(path: Path, places: Sequence[int], columns: dict[str, Floats]) -> NDArray[np.int64] | None:
    if "id" not in columns:
        return None
    ids = columns["id"]
    wrong = np.flatnonzero((ids < 0) | (ids > 2**53) | (ids != np.floor(ids)))
    if wrong.size:
        raise UsageError(
            f"{path}:{places[wrong[0]]}: {ids[wrong[0]]:g} is not an id", "Ids are whole numbers from 0 on."
        )
    return ids.astype(np.int64)


def _sigma(path: Path, places: Sequence[int], columns: dict[str, Floats], values: Floats) -> Floats | None:
    if not any(name.startswith("sigma_") for name in columns):
        return None
    missing = np.full(len(values), np.nan)
    sigma = np.column_stack([columns.get(f"sigma_{name}", missing) for name in COMPONENTS])
    wrong = np.argwhere(np.isfinite(values) & ~(sigma > 0))
    if wrong.size:
        row, component = wrong[0]
        raise UsageError(
            f"{path}:{places[row]}: {COMPONENTS[component]} has no standard error above 0",
            f"With one column sigma_..., every measured number needs its own: sigma_{COMPONENTS[component]}.",
        )
    return sigma
