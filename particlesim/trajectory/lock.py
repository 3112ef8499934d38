"""Tell a file that is being written from one whose writer was killed.

HDF5 marks a file that is open for writing, but a killed process leaves the mark behind. So the writer also
holds a lock that the operating system drops when the process ends, on a byte far behind the data that nothing
else locks. On Linux it is an open-file-description lock, which survives that the same process opens and
closes the file elsewhere. Systems without such locks go by time: a marked file that changed in the last minute counts as in
use.
"""

from __future__ import annotations

import errno
import os
import struct
import sys
import time
from pathlib import Path

_FAR = 1 << 62
_RECENT = 60.0  # s


class WriterLock:
    """Held from `acquire` until `release` or the end of the process."""

    def __init__(self) -> None:
        self._descriptor: int | None = None

    def acquire(self, path: Path) -> bool:
        """Mark `path` as being written; False if another process has done so.

        On file systems without locks, quietly do without.
        """
        if sys.platform != "linux":
            return True
        import fcntl

        self._descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        try:
            fcntl.fcntl(self._descriptor, fcntl.F_OFD_SETLK, _request(fcntl.F_WRLCK))
        except OSError as error:
            self.release()
            return error.errno not in (errno.EAGAIN, errno.EACCES)
        return True

    def holds(self, path: Path) -> bool:
        """Whether the file that is locked is still the one at `path`; so it is where there are no locks."""
        if self._descriptor is None:
            return True
        try:
            return os.path.samestat(os.fstat(self._descriptor), path.stat())
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Give the lock back; harmless when it is not held."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def is_being_written(path: Path) -> bool:
    """Whether a living process writes `path` through `WriterLock`."""
    if sys.platform != "linux":
        return time.time() - path.stat().st_mtime < _RECENT
    import fcntl

    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)  # a pipe would wait for a writer
    try:
        answer = fcntl.fcntl(descriptor, fcntl.F_OFD_GETLK, _request(fcntl.F_RDLCK))
    except OSError:
        return time.time() - path.stat().st_mtime < _RECENT
    finally:
        os.close(descriptor)
    kind: int = struct.unpack_from("@h", answer)[0]
    return kind != fcntl.F_UNLCK


def _request(kind: int) -> bytes:
    """A `struct flock` of Linux for one byte: type, whence, start, length, process (0 for these locks)."""
    return struct.pack("@hhqqi0q", kind, os.SEEK_SET, _FAR, 1, 0)
