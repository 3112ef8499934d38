"""Make a trajectory whose writer was killed an ordinary file again."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from particlesim.errors import PsimError, UsageError
from particlesim.trajectory.files import check_readable, damaged, finished_frames, open_file
from particlesim.trajectory.integrity import check_contents
from particlesim.trajectory.layout import LIBVER, STATUS
from particlesim.trajectory.lock import is_being_written
from particlesim.trajectory.superblock import clear_mark

_PER_FRAME = (
    "VTKHDF/NumberOfPoints",
    "VTKHDF/Lines/NumberOfCells",
    "VTKHDF/Lines/NumberOfConnectivityIds",
    "VTKHDF/Polygons/NumberOfCells",
    "VTKHDF/Polygons/NumberOfConnectivityIds",
    "VTKHDF/Strips/NumberOfCells",
    "VTKHDF/Strips/NumberOfConnectivityIds",
    "VTKHDF/Steps/Values",
    "VTKHDF/Steps/PointOffsets",
    "VTKHDF/Steps/PartOffsets",
    "VTKHDF/Steps/NumberOfParts",
    "VTKHDF/Steps/CellOffsets",
    "psim/frames",
    "psim/ledger",
)


def recover(path: Path) -> bool:
    """Take the mark of a killed writer off `path` and cut it back to its finished frames.

    Afterwards ParaView, VTK and h5py open it like any other; its status is "interrupted". Returns whether
    there was anything to do. Raises UsageError when a simulation is writing the file, or it is no usable
    trajectory, or may not be changed; InputOutputError when it leads to other files.
    """
    path = Path(path)
    marked = check_readable(path).marked
    # Asked first: a writer that ends in between has then left its status, which must not be overwritten.
    if marked and is_being_written(path):
        raise UsageError(f"{path} is being written by a running simulation", "Wait for it, or stop it.")
    try:
        with open_file(path) as file:
            check_contents(file, path)
            if not (check_readable(path).marked or _unfinished(file)):
                return False
    except PsimError:
        raise
    except Exception as error:  # what h5py raises on damaged metadata is of many kinds
        raise damaged(path) from error
    try:
        if check_readable(path).marked:
            clear_mark(path)
        file = h5py.File(path, "r+", libver=LIBVER)
    except OSError as error:
        raise UsageError(
            f"{path} cannot be opened to repair it"
            + (f": {os.strerror(error.errno)}" if error.errno else ""),
            "Is it open in another program, or are you not allowed to change it? Repair a copy.",
        ) from error
    try:
        with file:
            cut_back(file, finished_frames(file["psim/frames"]))
            if file["psim/status"][()] == b"running":
                file["psim/status"][()] = np.array(b"interrupted", STATUS)
    except Exception as error:
        raise damaged(path) from error
    return True


def _unfinished(file: h5py.File) -> bool:
    """Whether the end of the run, or of its last frame, was not recorded."""
    frames = len(finished_frames(file["psim/frames"]))
    return (
        file["psim/status"][()] == b"running"
        or file["VTKHDF/Steps"].attrs["NSteps"] != frames
        or any(len(file[name]) != frames for name in _PER_FRAME if name in file)
    )


def cut_back(file: h5py.File, rows: npt.NDArray[np.void]) -> None:
    """Drop the bookkeeping of all frames but the first, whose `rows` of /psim/frames are given; VTK needs NSteps and Values
    to agree."""
    for name in _PER_FRAME:
        if name in file:
            file[name].resize(len(rows), axis=0)
    file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(len(rows)))
    for kind in ("births", "deaths"):
        file[f"psim/events/{kind}"].resize(int(rows[kind][-1]) if len(rows) else 0, axis=0)
