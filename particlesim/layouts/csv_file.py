"""Tables of numbers as comma-separated values, with the line and column of what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TextIO

import numpy as np

from particlesim.errors import UsageError
from particlesim.layouts.base import Floats

LONGEST_SHOWN = 60


def read_csv(path: Path) -> dict[str, Floats]:
    """The columns of a file by their names, which its first line holds. Lines that begin with # are comments.

    Raises UsageError with the place of the first mistake, OSError when the file cannot be read.
    """
    with _opened(path) as lines:
        header = [name.strip() for name in lines.readline().split(",")]
        first = next((line for line in lines if _is_data(line)), None)
        if first is None:
            raise UsageError(
                f"{path} holds no particles", "a line with a number per column for each is missing"
            )
        try:
            table = np.loadtxt(chain([first], lines), delimiter=",", ndmin=2)
        except ValueError as error:
            raise _mistake(path, len(header)) or UsageError(f"{path}: {error}") from None
    if table.shape[1] != len(header):
        raise _mistake(path, len(header)) or UsageError(f"{path}: {table.shape[1]} columns")
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(header)}


def line_of(path: Path, row: int) -> int:
    """The line in which a row of the table stands, counted from 1; the rows from 0."""
    with _opened(path) as lines:
        for k, (number, _) in enumerate(_rows(lines)):
            if k == row:
                return number
    return 1


def _opened(path: Path) -> TextIO:
    return path.open(encoding="utf-8-sig", errors="replace")


def _is_data(line: str) -> bool:
    return bool(line.split("#")[0].strip())


def _rows(lines: TextIO) -> Iterator[tuple[int, str]]:
    """The lines of data below the header, with their numbers."""
    lines.readline()
    return ((number, line) for number, line in enumerate(lines, 2) if _is_data(line))


def _mistake(path: Path, columns: int) -> UsageError | None:
    """The first line that does not hold as many numbers as there are columns."""
    with _opened(path) as lines:
        for number, line in _rows(lines):
            cells = line.split("#")[0].rstrip("\r\n").split(",")
            column = 1
            for cell in cells:
                if not _is_number(cell):
                    start = column + len(cell) - len(cell.lstrip())
                    hint = f"line {number} is: {line.strip()[:LONGEST_SHOWN]}"
                    if len(cells) == 1 and any(mark in cell.strip() for mark in "; \t"):
                        hint = f"columns are separated by commas; {hint}"
                    return UsageError(
                        f"{path}:{number}:{start}: expected a number, got {cell.strip()[:LONGEST_SHOWN]!r}",
                        hint,
                    )
                column += len(cell) + 1
            if len(cells) != columns:
                return UsageError(
                    f"{path}:{number}: {columns} columns are named in the first line, {len(cells)} are filled here",
                    f"line {number} is: {line.strip()[:LONGEST_SHOWN]}",
                )
    return None


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell
