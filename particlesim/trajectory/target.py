"""Putting an output file in its place: nothing is overwritten unasked, or before the new file is there."""

from __future__ import annotations

import errno
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from particlesim.errors import InputOutputError, OutputExistsError, UsageError

ENDINGS = (".vtkhdf", ".hdf", ".hdf5", ".h5")
"""Endings of trajectories; ParaView knows the first."""


def check_target(path: Path, *, overwrite: bool) -> None:
    """Refuse a path that is a folder, exists (unless `overwrite`) or cannot be written. Nothing is made.

    Raises UsageError.
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder", "Give the name of a file to write.")
    if path.exists() and not overwrite:
        raise OutputExistsError(path)
    folder = path.parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent  # what is missing will be made there
    if not folder.is_dir():
        raise UsageError(f"{folder} is no folder", "A file is in the way; choose another place to write to.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(
            f"cannot write into the folder {folder}", "Choose another place, or its permissions."
        )


def check_trajectory_name(path: Path) -> None:
    """Refuse a name that no reader would take for a trajectory. Raises UsageError."""
    if path.suffix.lower() not in ENDINGS and not path.is_dir():
        raise UsageError(
            f"{path} does not have the ending of a trajectory",
            f"Name it {path.with_suffix(ENDINGS[0])}, so that ParaView knows what it is.",
        )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`; the file written there becomes `path` if the block ends without error.

    Missing folders are made. Whatever goes wrong, `path` is as it was and no partial file stays. OSError is raised as
    InputOutputError.
    """
    temporary = _temporary_name(path)
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise write_error(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_error(path: Path, error: BaseException) -> InputOutputError:
    """What to tell about a failed write of `path`."""
    text = str(error)
    if getattr(error, "errno", None) == errno.ENOSPC or f"errno = {errno.ENOSPC}," in text:
        return InputOutputError(
            f"the disk is full: {path} could not be written further",
            "What was finished is kept. Free some space, record fewer fields or frames, or write elsewhere.",
        )
    # HDF5 puts the system's message into a long text of file positions.
    inside = re.search(r"error message = '([^']*)'", text)
    reason = getattr(error, "strerror", None) or (inside[1] if inside else text)
    return InputOutputError(f"writing {path} failed: {reason}", "What was finished before is kept.")


def _temporary_name(path: Path) -> Path:
    """A free name in the same folder (so that renaming is atomic), with the permissions of a new file."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(
            prefix=f".{path.name}.", suffix=".part" + path.suffix, dir=path.parent
        )
    except OSError as error:
        raise write_error(path, error) from error
    os.close(descriptor)
    umask = os.umask(0)
    os.umask(umask)
    temporary = Path(name)
    temporary.chmod(0o666 & ~umask)
    return temporary
