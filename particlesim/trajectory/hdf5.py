"""Opening HDF5 files that may be damaged, so that reading them ends.

A reader beside a writer (SWMR) reads metadata again while its checksum is wrong, in case it came upon a write in
progress. HDF5 doubles the wait each time, from 1 ns on, and tries a hundred times: in a damaged file that is for ever.
h5py does not offer the setting that limits this, so it is made through the library that h5py has loaded.

Source: HDF5 Reference Manual, H5Pset_metadata_read_attempts.
"""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from pathlib import Path
from typing import Any

import h5py
from h5py import h5f, h5p

PATIENCE = 28
"""Attempts beside a living writer: 2^28 ns = 0.27 s in all, where writing a piece of metadata takes microseconds."""


def open_beside_writer(path: Path, attempts: int) -> h5py.File:
    """`path` open for reading in SWMR mode; what is not intact after so many attempts raises OSError or RuntimeError."""
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_libver_bounds(h5f.LIBVER_EARLIEST, h5f.LIBVER_LATEST)
    if _setter()(access.id, attempts) < 0:
        raise RuntimeError("HDF5 refused the number of read attempts")
    name = str(path).encode(sys.getfilesystemencoding(), "surrogateescape")
    return h5py.File(h5f.open(name, h5f.ACC_RDONLY | h5f.ACC_SWMR_READ, access))


@cache
def _setter() -> Any:
    """H5Pset_metadata_read_attempts of the library that h5py uses."""
    # On Linux and macOS a symbol is looked up in what a module was linked with, too; on Windows libraries go by name.
    library = ctypes.CDLL("hdf5" if sys.platform == "win32" else h5p.__file__)
    setter = library.H5Pset_metadata_read_attempts
    setter.argtypes, setter.restype = (ctypes.c_int64, ctypes.c_uint), ctypes.c_int
    return setter
