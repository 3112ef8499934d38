"""Open a trajectory to write further frames after a given one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from particlesim.errors import InputOutputError, PsimError, UsageError
from particlesim.trajectory.chunks import padded
from particlesim.trajectory.examiner import UnreadableError, look_through
from particlesim.trajectory.files import damaged, finished_frames
from particlesim.trajectory.hdf5 import entries
from particlesim.trajectory.layout import LIBVER, STATUS
from particlesim.trajectory.recovery import cut_back
from particlesim.trajectory.superblock import clear_mark, read_superblock
from particlesim.trajectory.target import FORBIDDEN


def cut_to(path: Path, frames: int, broke: Mapping[str, npt.NDArray[np.float64]]) -> str:
    """Cut a trajectory that no process writes back to its first frames, and say that it is being written; returns the name
    of its run.

    `broke` has the times at which springs broke until then [s], by the name of their set. Raises UsageError when the file
    is in use, is damaged, or has fewer frames, InputOutputError when it may not be changed.
    """
    try:
        look_through(path)
        block = read_superblock(path)
        if block is not None and block.marked:
            clear_mark(path)
        file = h5py.File(path, "r+", libver=LIBVER)
    except UnreadableError as error:
        raise damaged(path, str(error)) from error
    except OSError as error:
        kind = InputOutputError if error.errno in FORBIDDEN else UsageError
        raise kind(
            f"{path} cannot be opened to go on writing it",
            "Is it open in another program, or are you not allowed to change it?",
        ) from error
    try:
        with file:
            rows = finished_frames(file["psim/frames"])[:frames]
            if len(rows) < frames:
                raise UsageError(
                    f"{path} has {len(rows)} frames, and its checkpoint was made after {frames}",
                    "Is it an older copy? --force starts the run anew.",
                )
            cut_back(file, rows)
            _cut_columns(file, int(rows[-1]["offset"] + rows[-1]["count"]) if frames else 0)
            for name, times in broke.items():
                file[f"psim/topology/{name}/broke"][...] = times
            file["psim/summary"].resize(0, axis=0)
            file["psim/status"][()] = np.array(b"running", STATUS)
            provenance = file["psim/provenance"]
            return str(provenance["run"].asstr()[()]) if "run" in provenance else ""
    except PsimError:
        raise
    except Exception as error:
        raise damaged(path) from error


def _cut_columns(file: h5py.File, end: int) -> None:
    """Drop the rows of particles from `end` on, but for the chunk that it is in."""
    points = file["VTKHDF/Points"]
    rows = padded(end, points.chunks[0])
    for column in (points, *(column for _, column in entries(file["VTKHDF/PointData"]))):
        if len(column) > rows:
            column.resize(rows, axis=0)
