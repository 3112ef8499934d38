"""Arrays of particles as NumPy stores them, read piece by piece.

Source: NumPy, Enhancement Proposal 1, A Simple File Format for NumPy Arrays.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from particlesim.errors import UsageError
from particlesim.model.arrays import Floats

LONGEST_HEADER = 10_000
"""Bytes. NumPy reads no longer ones."""

_HINT = "numpy.save(name, array) writes one; arrays of Python objects are not read"


@dataclass(frozen=True)
class NpyTable:
    """An array in a file: as rows of `width` numbers, or as records with named fields (`width` is None)."""

    path: Path
    columns: tuple[str, ...]
    number: int
    width: int | None
    dtype: np.dtype[Any]
    fortran: bool
    offset: int

    def read(self, first: int, count: int) -> dict[str, Floats]:
        """Columns of the rows first … first + count − 1. Raises OSError, and UsageError when the file has become shorter."""
        with self.path.open("rb") as file, np.errstate(all="ignore"):  # what overflows is seen by its result
            if self.width is None:
                rows = self._numbers(file, first, count)
                return {name: rows[name].astype(float) for name in self.columns}
            if self.fortran:
                parts = [self._numbers(file, k * self.number + first, count) for k in range(self.width)]
            else:
                parts = list(self._numbers(file, first * self.width, count * self.width).reshape(count, -1).T)
            return {name: part.astype(float) for name, part in zip(self.columns, parts, strict=True)}

    def _numbers(self, file: BinaryIO, first: int, count: int) -> np.ndarray[Any, Any]:
        file.seek(self.offset + first * self.dtype.itemsize)
        found = np.fromfile(file, self.dtype, count)
        if len(found) < count:
            raise UsageError(f"{self.path} has become shorter while it was read")
        return found


def open_npy(path: Path, names: Sequence[str]) -> NpyTable:
    """The array of a file, of which nothing but the header is read; `names` are those of 3 or 6 columns without any.

    Raises UsageError for what is no array of particles, or lacks a part; OSError.
    """
    with path.open("rb") as file:
        try:
            shape, fortran, dtype = _header(file)
        except OSError:
            raise
        except Exception:  # NumPy's own are of many kinds, and speak of pickles, which may run code
            raise UsageError(f"{path} is not an NPY file of numbers", _HINT) from None
        offset = file.tell()
    fields = dtype.fields
    kinds = [dtype] if fields is None else [entry[0] for entry in fields.values()]
    wrong = [kind for kind in kinds if kind.kind not in "fiu" or kind.shape]
    if dtype.hasobject:
        raise UsageError(f"{path} is not an NPY file of numbers", _HINT)
    there = path.stat().st_size - offset
    if math.prod(shape) * dtype.itemsize > there:
        raise UsageError(
            f"{path} is shorter than its header says: {there:,} bytes for an array of shape {list(shape)} and type {dtype}",
            "an incomplete copy or download? fetch it again",
        )
    if fields is not None and (wrong or len(shape) != 1):
        told = f"{wrong[0]} in a column" if wrong else f"records of shape {list(shape)}"
        raise UsageError(
            f"{path}: {told}", "records have shape [n], and each of their fields is one real number"
        )
    if fields is None and (wrong or len(shape) != 2 or shape[1] not in (3, 6)):
        raise UsageError(
            f"{path}: an array of shape {list(shape)} and type {dtype}",
            "positions have shape [n, 3], positions with velocities [n, 6], of real numbers",
        )
    width = None if fields is not None else shape[1]
    columns = tuple(dtype.names) if dtype.names is not None else tuple(names[:width])
    return NpyTable(path, columns, shape[0], width, dtype, fortran, offset)


def _header(file: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether columns are stored one after the other, and type. Raises an exception of any kind for no header."""
    version = np.lib.format.read_magic(file)
    size = {(1, 0): 2, (2, 0): 4}[version]  # 3 is for names beyond Latin-1
    length = int.from_bytes(file.read(size), "little")
    text = file.read(min(length, LONGEST_HEADER)).decode("latin-1")
    if len(text) < length:
        raise ValueError("a header that is too long")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Python's parser, on what looks like a number and is none
        told = ast.literal_eval(text)  # NumPy's own reader looks for numbers of Python 2, too, for seconds
    shape, fortran = told["shape"], told["fortran_order"]
    dtype = np.lib.format.descr_to_dtype(told["descr"])
    if len(told) != 3 or type(fortran) is not bool or type(shape) is not tuple:
        raise ValueError("this is no header of NPY")
    if any(type(side) is not int or side < 0 for side in shape):
        raise ValueError("this is no shape")
    return shape, fortran, dtype
