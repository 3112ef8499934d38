"""Moving an output file to its name: nothing is overwritten unasked, or before the new file is complete."""

from __future__ import annotations

import errno
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from particlesim.errors import InputOutputError, OutputExistsError, UsageError
from particlesim.trajectory.places import check_name_length, kind_of

ENDINGS = (".vtkhdf", ".hdf", ".hdf5", ".h5")
"""Endings of trajectories; ParaView knows the first."""

FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
"""Numbers of the system's errors where nothing may be written."""
_STEM = 24
"""Characters of a name that its temporary name begins with; so that it is not too long where the name itself is not."""


def check_target(path: Path, *, overwrite: bool) -> None:
    """Refuse a path that is a folder, exists (unless `overwrite`) or cannot be written. Nothing is left there.

    Raises UsageError, and InputOutputError where the system lets nothing be written.
    """
    kind = kind_of(path)
    if kind not in (None, "file"):
        raise UsageError(f"{path} is a {kind}", "Give the name of a file to write.")
    if kind is not None and not overwrite:
        raise OutputExistsError(path)
    folder = followed(path).parent
    while (kind := kind_of(folder)) is None and folder != folder.parent:
        folder = folder.parent  # what is missing will be made there
    check_name_length(path, folder)
    if kind != "folder":
        raise UsageError(
            f"{folder} is not a folder", "A file is in the way; choose another place to write to."
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise _not_writable(folder)
    try:  # permissions do not tell all: some folders, such as /proc, are made by the system
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _not_writable(folder, f": {error.strerror}") from error


def _not_writable(folder: Path, why: str = "") -> InputOutputError:
    return InputOutputError(
        f"cannot write into the folder {folder}{why}", "Choose another place, or its permissions."
    )


def followed(path: Path) -> Path:
    """Where a symbolic link leads to, whether that exists or not; other paths as they are.

    A file that replaced the link would leave the one that it stands for as it was.
    """
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def check_trajectory_name(path: Path) -> None:
    """Refuse a name that no reader would take for a trajectory. Raises UsageError."""
    if path.suffix.lower() not in ENDINGS and not path.is_dir():
        raise UsageError(
            f"{path} does not have the ending of a trajectory",
            f"Name it {path.with_suffix(ENDINGS[0])}, so that ParaView knows what it is.",
        )


@contextmanager
def replacing(path: Path, put: Callable[[Path, Path], None] = os.replace) -> Iterator[Path]:
    """A temporary name beside `path`; the file written there becomes `path` if the block ends without error.

    `put(temporary, path)` puts it in its place; of a symbolic link, in that of its target. Missing folders are made.
    Whatever goes wrong, `path` is as it was and no partial file stays. OSError is raised as InputOutputError.
    """
    temporary = temporary_name(path)
    try:
        yield temporary
        put(temporary, followed(path))
    except OSError as error:
        raise write_error(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def put_new(temporary: Path, path: Path) -> None:
    """Give the file `temporary` the name `path`, unless something has it already: of two processes that want the same
    name, one gets it. Raises UsageError for the other.
    """
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise OutputExistsError(path) from None
    except OSError:  # a file system without hard links
        try:
            path.open("xb").close()
        except FileExistsError:
            raise OutputExistsError(path) from None
        temporary.replace(path)


def write_error(path: Path, error: BaseException, kept: str = "") -> InputOutputError:
    """What to tell about a failed write of `path`, of which `kept` (a sentence) can still be read."""
    text = str(error)
    # HDF5 puts the system's message into a long text of file positions.
    inside = re.search(r"errno = (\d+), error message = '([^']*)'", text)
    number = getattr(error, "errno", None) or (int(inside[1]) if inside else None)
    if number == errno.ENOSPC:
        message = f"the disk is full: {path} could not be written further"
        advice = "Free some space, record fewer fields or frames, or write elsewhere."
    elif number == errno.EFBIG:
        message = f"writing {path} failed: {os.strerror(errno.EFBIG)}"
        advice = "Files may not grow further here: see `ulimit -f`, or record fewer fields or frames."
    else:
        reason = os.strerror(number) if number else inside[2] if inside else None
        message, advice = f"writing {path} failed" + (f": {reason}" if reason else ""), ""
    return InputOutputError(message, " ".join(filter(None, (kept, advice))) or None)


def temporary_name(path: Path) -> Path:
    """A new file with the ending of `path`, in its folder or that of its target (so that renaming is atomic), with the
    permissions of any new file. The folder is made if need be. Raises InputOutputError.
    """
    folder = followed(path).parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(
            prefix=f".{path.stem[:_STEM]}.", suffix=".part" + path.suffix[:_STEM], dir=folder
        )
    except OSError as error:
        raise write_error(path, error) from error
    os.close(descriptor)
    umask = os.umask(0)
    os.umask(umask)
    temporary = Path(name)
    temporary.chmod(0o666 & ~umask)
    return temporary
