"""Checkpoint files: facts and arrays from which a run is resumed, in the folder of its trajectory.

NAME.vtkhdf.checkpoint is a ZIP archive, not compressed, of facts.json and one NPY file per array; each carries a checksum.
It replaces the previous one in one step, which stays as NAME.vtkhdf.checkpoint.previous.
"""

from __future__ import annotations

import errno
import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.trajectory.target import replacing

Array = npt.NDArray[Any]

FORMAT = 1
_FACTS = "facts.json"


def checkpoint_path(trajectory: Path) -> Path:
    """Where the checkpoint of a trajectory is."""
    return trajectory.with_name(trajectory.name + ".checkpoint")


def previous_path(trajectory: Path) -> Path:
    """Where the checkpoint before that is."""
    return trajectory.with_name(trajectory.name + ".checkpoint.previous")


def write_checkpoint(trajectory: Path, facts: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
    """Write the checkpoint of a trajectory; at any moment the new or the old one is there, whole.

    `facts` must be what JSON can say. Raises InputOutputError.
    """

    def put(temporary: Path, path: Path) -> None:
        if path.exists():
            path.replace(previous_path(trajectory))
        temporary.replace(path)

    with (
        replacing(checkpoint_path(trajectory), put) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive,
    ):
        archive.writestr(_FACTS, json.dumps({"format": FORMAT, **facts}))
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as raw:
                _write_array(raw, array)


def _write_array(raw: IO[bytes], array: Array) -> None:
    contiguous = np.ascontiguousarray(array)
    np.lib.format.write_array_header_2_0(
        raw,
        {
            "descr": np.lib.format.dtype_to_descr(array.dtype),
            "fortran_order": False,
            "shape": array.shape,
        },
    )
    raw.write(contiguous.reshape(-1).view(np.uint8).data)


def read_checkpoint(path: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """Facts and arrays of a checkpoint file. Raises UsageError if it is none, is damaged, or of a newer format."""
    try:
        with zipfile.ZipFile(path) as archive:
            facts = json.loads(archive.read(_FACTS))
            arrays = {}
            for name in archive.namelist():
                if name.endswith(".npy"):
                    with archive.open(name) as raw:
                        arrays[name.removesuffix(".npy")] = np.lib.format.read_array(raw, allow_pickle=False)
                        if raw.read(1):
                            raise ValueError("longer than its header says")
        version = int(facts["format"])
    except OSError as error:
        raise UsageError(f"the checkpoint {path} cannot be read: {os.strerror(error.errno or 5)}") from error
    except Exception as error:  # zipfile, json and NumPy raise errors of many kinds
        raise UsageError(f"{path} is damaged, or no checkpoint of psim") from error
    if version > FORMAT:
        raise UsageError(
            f"{path} has format {version}; this psim reads up to {FORMAT}", "Install a newer particlesim."
        )
    return facts, arrays


def discard_checkpoints(trajectory: Path) -> None:
    """Remove the checkpoints of a trajectory, if there are any."""
    for path in (checkpoint_path(trajectory), previous_path(trajectory)):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:  # then there can be none
                raise
