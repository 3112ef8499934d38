"""Opening trajectory files for reading, with errors that say what is wrong with a file."""

from __future__ import annotations

import time
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.trajectory.examiner import UnreadableError, look_through
from particlesim.trajectory.hdf5 import open_alone
from particlesim.trajectory.layout import FORMAT
from particlesim.trajectory.lock import is_being_written
from particlesim.trajectory.places import kind_of
from particlesim.trajectory.superblock import Superblock, read_superblock

_ENDING = ".vtkhdf"
_BLOCK = 1 << 16
_PATIENCE = 1.0
"""Seconds to wait until a file that is being written can be opened."""


class DamagedError(UsageError):
    """A file of which a part is missing or has changed."""


def check_readable(path: Path) -> Superblock:
    """The superblock of a file that may be a trajectory.

    Raises UsageError when `path` is missing, a folder, a pipe or a device, unreadable, no HDF5 file, or truncated.
    """
    kind = kind_of(path)
    if kind == "folder":
        raise UsageError(f"{path} is a folder, not a trajectory", _nearby(path, inside=path))
    if kind is None:
        raise UsageError(f"there is no file {path}", _nearby(path, inside=path.parent))
    if kind != "file":
        raise UsageError(
            f"{path} is a {kind}, not a trajectory",
            "A trajectory is read here and there, so it must be a file.",
        )
    try:
        block = read_superblock(path)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    if block is None:
        raise DamagedError(
            f"{path} is no HDF5 file, or its header is damaged",
            f"Trajectories are written by `psim run` and end in {_ENDING}.",
        )
    size = path.stat().st_size
    # While a file is marked as being written, its length on record runs ahead of, or behind, the real one.
    if not block.marked and block.end > size:
        raise DamagedError(
            f"{path} is truncated: it has {size} bytes of {block.end}",
            "An incomplete copy or download? Fetch it again.",
        )
    return block


def open_file(path: Path) -> h5py.File:
    """The trajectory `path`, open for reading, also while a simulation writes it or after its writer was
    killed.

    Raises UsageError as `check_readable` does, and when the file is HDF5 but no trajectory of psim; InputOutputError when it
    leads to other files.
    """
    file = _open_readable(path)
    try:
        check_format(file, path)
    except BaseException:
        file.close()
        raise
    return file


def _open_readable(path: Path) -> h5py.File:
    """An HDF5 file open for reading as it is now.

    What is being written may be caught in the middle of a write: then it is tried again for a while.
    """
    until = time.monotonic() + _PATIENCE
    while True:
        block = check_readable(path)
        written = block.marked and is_being_written(path)
        try:
            look_through(path)
            return open_alone(path)
        except (OSError, RuntimeError, ValueError, KeyError, UnreadableError) as error:
            if not written:
                raise damaged(path, *(error.args if isinstance(error, UnreadableError) else ())) from error
            if time.monotonic() > until:
                raise UsageError(
                    f"{path} cannot be opened while another program writes it", "Close that program."
                ) from error
            time.sleep(0.01)


def check_format(file: h5py.File, path: Path) -> None:
    """Raise UsageError unless `file` is a trajectory of a format that this version reads."""
    try:
        version = file["psim"].attrs.get("format") if "psim" in file else None
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise damaged(path) from error
    if version is None:
        raise DamagedError(
            f"{path} is HDF5 but no trajectory of psim", "It lacks the group /psim that `psim run` writes."
        )
    if not isinstance(version, np.integer):
        raise damaged(path, "the number of its format is none")
    if version > FORMAT:
        raise UsageError(
            f"{path} has format {version}; this psim reads up to {FORMAT}", "Install a newer particlesim."
        )


def damaged(path: Path, what: str = "its contents cannot be read") -> DamagedError:
    """The error for a file that HDF5 cannot make sense of; its own words go to the error's cause."""
    return DamagedError(
        f"{path} is damaged: {what}", "Was it cut off or changed after the run? Fetch it again."
    )


def finished_frames(table: h5py.Dataset) -> npt.NDArray[np.void]:
    """The rows of /psim/frames that were finished: each carries its number, counted from 1."""
    blocks: list[npt.NDArray[np.void]] = []
    for start in range(0, len(table), _BLOCK):  # a table may be declared that is longer than memory
        rows = table[start : start + _BLOCK]
        valid = rows["number"] == np.arange(start + 1, start + len(rows) + 1)
        blocks.append(rows[: len(rows) if valid.all() else int(valid.argmin())])
        if not valid.all():
            break
    return np.concatenate(blocks) if blocks else table[:0]


def lies_inside(dataset: h5py.Dataset, start: int, stop: int, size: int) -> bool:
    """Whether the chunks of the rows [start, stop) lie inside a file of `size` bytes.

    HDF5 reads zeros beyond the end of a file, which only a compressed chunk would betray.
    """
    if dataset.chunks is None:  # rewritten by another program
        return True
    rows, tail = dataset.chunks[0], (0,) * (dataset.ndim - 1)
    for row in range(start - start % rows, stop, rows):
        chunk = dataset.id.get_chunk_info_by_coord((row, *tail))
        if chunk.byte_offset is None or chunk.byte_offset + chunk.size > size:
            return False
    return True


def _nearby(path: Path, inside: Path) -> str:
    """A hint with the trajectories of a folder, the most similar name first."""
    names = sorted(p.name for p in inside.glob(f"*{_ENDING}")) if inside.is_dir() else []
    from difflib import get_close_matches

    if near := get_close_matches(path.name, names, n=1):
        return f"Did you mean {inside / near[0]}?"
    if names:
        return f"Trajectories in {inside}: {', '.join(names[:5])}{', ...' if len(names) > 5 else ''}"
    return "Trajectories are written by `psim run`."
