"""Tables of numbers as comma-separated values, with the line and column of what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np

from particlesim.errors import UsageError
from particlesim.layouts.input_file import bounded_lines, require_memory
from particlesim.model.arrays import Floats

LONGEST_SHOWN = 60
ROWS = 1 << 16
"""Lines that are turned into numbers together."""


def read_csv(path: Path) -> dict[str, Floats]:
    """The columns of a file by their names, which its first line holds. Lines that begin with # are comments.

    Raises UsageError with the place of the first mistake, ResourceError when memory ends, OSError when the file cannot be
    read.
    """
    with _opened(path) as file:
        lines = bounded_lines(path, file)
        header = [name.strip() for name in next(lines, "").split(",")]
        if len(set(header)) < len(header):
            twice = next(name for name in header if header.count(name) > 1)
            raise UsageError(f"{path}:1: the column {twice!r} occurs twice")
        parts = list(_parts(path, filter(_is_data, lines), len(header)))
    if not parts:
        raise UsageError(f"{path} holds no particles", "a line with a number per column for each is missing")
    return {name: np.concatenate([part[:, k] for part in parts]) for k, name in enumerate(header)}


def line_of(path: Path, row: int) -> int:
    """The line in which a row of the table stands, counted from 1; the rows from 0."""
    with _opened(path) as file:
        for k, (number, _) in enumerate(_rows(path, file)):
            if k == row:
                return number
    return 1


def _parts(path: Path, lines: Iterator[str], columns: int) -> Iterator[Floats]:
    """The numbers of some lines after the other, as far as memory reaches."""
    rows = 0
    while some := list(islice(lines, ROWS)):
        rows += len(some)
        require_memory(path, 2 * 8 * columns * rows, f"{rows:,} particles or more")
        try:
            part = np.loadtxt(some, delimiter=",", ndmin=2)
        except ValueError as error:
            raise _mistake(path, columns) or UsageError(f"{path}: {error}") from None
        if part.shape[1] != columns:
            raise _mistake(path, columns) or UsageError(f"{path}: {part.shape[1]} columns")
        yield part


def _opened(path: Path) -> TextIO:
    return path.open(encoding="utf-8-sig", errors="replace")


def _is_data(line: str) -> bool:
    return bool(line.split("#")[0].strip())


def _rows(path: Path, file: TextIO) -> Iterator[tuple[int, str]]:
    """The lines of data below the header, with their numbers."""
    lines = enumerate(bounded_lines(path, file), 1)
    next(lines, None)
    return ((number, line) for number, line in lines if _is_data(line))


def _mistake(path: Path, columns: int) -> UsageError | None:
    """The first line that does not hold as many numbers as there are columns."""
    with _opened(path) as file:
        for number, line in _rows(path, file):
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
