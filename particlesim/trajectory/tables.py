"""Datasets that grow by rows, appended to through HDF5's own calls.

h5py's `dataset[a:b] = values` and `resize` look everything up anew each time, which would be three quarters of the time to
write a small frame.
"""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
from h5py import h5s, h5t


class GrowingTable:
    """Appends rows to a dataset of shape [rows, ...]."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self.dataset = dataset
        self._id = dataset.id
        self._tail = dataset.shape[1:]
        self._length = dataset.shape[0]
        self._type = h5t.py_create(dataset.dtype, logical=True)

    def __len__(self) -> int:
        return int(self._length)

    @property
    def row_size(self) -> int:
        """Bytes of a row."""
        return int(self.dataset.dtype.itemsize * np.prod(self._tail, dtype=int))

    def new_chunks(self, rows: int) -> int:
        """Bytes of the chunks, uncompressed, that so many more rows begin."""
        size: int = self.dataset.chunks[0]
        return (-(-(self._length + rows) // size) + self._length // -size) * size * self.row_size

    def grow_to(self, length: int) -> None:
        """Set the length; new rows hold the dataset's fill value until they are written."""
        self._id.set_extent((length, *self._tail))
        self._length = length

    def extend(self, values: npt.NDArray[Any]) -> None:
        """Append rows, of the dataset's type."""
        count = len(values)
        if not count:
            return
        start = self._length
        self.grow_to(start + count)
        place = h5s.create_simple((self._length, *self._tail))
        place.select_hyperslab((start, *(0 for _ in self._tail)), (count, *self._tail))
        rows = np.ascontiguousarray(values, self.dataset.dtype)
        self._id.write(h5s.create_simple((count, *self._tail)), place, rows, self._type)

    def put_chunk(self, row: int, data: bytes | npt.NDArray[Any]) -> None:
        """Hand over the finished chunk that begins at `row`, past HDF5's filters and its cache."""
        self._id.write_direct_chunk((row, *(0 for _ in self._tail)), data)
