"""Opening HDF5 files that may be damaged, or that other processes write or read, such that no call hangs.

HDF5's own mode for reading while another process writes (SWMR) is not suitable. It treats all that a process has open of one
file as one file, and gives wrong errors once one of several readers refreshes a part of it. And while a checksum of metadata
is wrong, it reads them again, as a write may be in progress, with a wait that doubles each time from 1 ns on, a hundred
times: with a damaged file that never ends. But the file of a SWMR writer is consistent on disk at every moment, so a reader
needs no such mode: it opens the file anew to see new frames, and repeats failed attempts itself, for a limited time.

A writer must not hang either. h5py does not offer the setting that limits its attempts, so it is made through the library
that h5py has loaded. Where that is not accessible, the limit is missing: only a file that was damaged since it was last
verified could make the writer hang.

Source: HDF5 Reference Manual, H5Pset_metadata_read_attempts.
"""

from __future__ import annotations

import ctypes
import io
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import h5py
from h5py import h5f, h5p

from particlesim.trajectory.places import open_regular
from particlesim.trajectory.superblock import unmarked


def open_alone(path: Path) -> h5py.File:
    """`path` open for reading as it is now, whether its writer has closed it or not, and apart from all others that this
    process has open. What is damaged raises OSError, RuntimeError, ValueError or KeyError.
    """
    return h5py.File(_Unmarked(path), "r")


def open_for_frames(path: Path) -> h5py.File:
    """`path` open for writing while others read it (SWMR). What is damaged raises OSError or RuntimeError, at once."""
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_libver_bounds(*(h5f.LIBVER_V110,) * 2)
    if (setter := _setter()) is not None and setter(access.id, 1) < 0:
        raise RuntimeError("HDF5 refused the number of read attempts")
    name = str(path).encode(sys.getfilesystemencoding(), "surrogateescape")
    # Begun afterwards, SWMR would take a hundred attempts whatever was asked for.
    return h5py.File(h5f.open(name, h5f.ACC_RDWR | h5f.ACC_SWMR_WRITE, access))


def entries(group: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Names and objects of a group. An iterator of h5py over them holds the library's lock until it ends, and one that an
    error has left does not end: all other threads wait then.
    """
    return [(name, group[name]) for name in list(group)]


class _Unmarked(io.RawIOBase):
    """The bytes of a file, but for the mark in its superblock."""

    def __init__(self, path: Path) -> None:
        self._file = open_regular(path)
        try:  # older superblocks carry no mark
            self._head = b"" if self._file.read(9)[8:] < b"\3" else unmarked(self._file)
        except BaseException:
            self._file.close()
            raise
        self._file.seek(0)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        start = self._file.tell()
        count = self._file.readinto(buffer)
        if start < len(self._head):
            part = self._head[start : start + count]
            memoryview(buffer).cast("B")[: len(part)] = part
        return count

    def close(self) -> None:
        self._file.close()
        super().close()


@cache
def _setter() -> Any:
    """H5Pset_metadata_read_attempts of the library that h5py uses; None where it is not to be found."""
    # On Linux and macOS a symbol is looked up in what a module was linked with, too; on Windows libraries go by name.
    try:
        library = ctypes.CDLL("hdf5" if sys.platform == "win32" else h5p.__file__)
        setter = library.H5Pset_metadata_read_attempts
    except (OSError, AttributeError):
        return None
    setter.argtypes, setter.restype = (ctypes.c_int64, ctypes.c_uint), ctypes.c_int
    return setter
