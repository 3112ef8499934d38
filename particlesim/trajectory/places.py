"""The kind of file at a path, found before it is opened: opening a pipe waits, and reading a device never ends."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path

from particlesim.errors import UsageError

_KINDS = (
    (stat.S_ISREG, "file"),
    (stat.S_ISDIR, "folder"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
    (stat.S_ISCHR, "device"),
    (stat.S_ISBLK, "device"),
)
_LONGEST_NAME = 255  # bytes; what file systems allow, unless this one tells


def kind_of(path: Path) -> str | None:
    """ "file", "folder", "pipe", "socket" or "device"; None when there is nothing.

    Raises UsageError for a path that cannot be looked at: too long, a loop of links, no permission.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError as error:
        raise UsageError(f"{str(path)!r} is not a path: {error}") from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise _too_long(path) from error
        raise UsageError(f"{path} cannot be looked at: {error.strerror}") from error
    return next((kind for test, kind in _KINDS if test(mode)), "device")


def open_regular(path: Path) -> BufferedReader:
    """A file open for reading. Raises OSError, also for a pipe or device: opening one may wait, reading it never end."""

    def opener(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    file = open(path, "rb", opener=opener)  # noqa: SIM115  the caller's
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "it is no file", str(path))
    return file


def check_name_length(path: Path, folder: Path) -> None:
    """Raise UsageError for a name that is too long for the existing folder it would be in, or under."""
    try:
        longest = os.pathconf(folder, "PC_NAME_MAX")
    except (AttributeError, OSError, ValueError):
        longest = _LONGEST_NAME
    if any(len(os.fsencode(part)) > longest for part in path.parts):
        raise _too_long(path)


def _too_long(path: Path) -> UsageError:
    part = max(path.parts, key=len)
    shown = part if len(part) <= 40 else f"{part[:20]}…{part[-15:]}"
    return UsageError(
        f"the name {shown!r} is too long for the file system ({len(os.fsencode(part))} bytes)",
        f"Most file systems allow {_LONGEST_NAME} bytes for a name; choose a shorter one.",
    )
