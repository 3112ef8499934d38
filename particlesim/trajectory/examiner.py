"""Examine files from elsewhere in a process that may hang or crash, before this one uses them.

HDF5 has no defence against some damage: a broken heap of strings puts the library into an endless loop, where no signal
handler of Python runs. So a small process, which imports h5py and nothing else of size, examines every file that this
process has not written itself (see `structure`), with a limit on its CPU time. It starts with the first such file, examines
all later ones, and ends with this process, even when that is killed.

Where no process can be started, files are examined in this one, without a limit.
"""

from __future__ import annotations

import atexit
import faulthandler
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Any

from particlesim.errors import InputOutputError

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

_SECONDS = 1
"""Computing time for a small file [s]; 20 ms are usual."""
_PER_SECOND = 100_000_000
"""Bytes on the disk that give a second more: an index of chunks takes a fiftieth of that."""
_WALL = 30
"""Times the computing time that may pass on the clock: disks are slow, and processors shared."""
_MEMORY = 4 << 30
"""Bytes of address space for the process; 0.5 GB are usual."""
_KNOWN = 1024
"""Files that are remembered as seen."""

_START = "import sys, json; sys.path[:] = json.loads(sys.stdin.readline()); from {} import serve; serve()"


class UnreadableError(Exception):
    """A file on which HDF5 crashes, or does not end, or whose objects it cannot find; its text says which."""


Signature = tuple[int, int]
_known: dict[tuple[int, int], Signature] = {}


def vouch(path: Path) -> None:
    """Remember `path` as it is now: this process has written it, or looked through it."""
    with suppress(OSError):
        _remember(*_identity(path))


def look_through(path: Path) -> None:
    """Make sure that reading `path`, an HDF5 file, ends, and does not leave the file. Files seen before cost nothing.

    Raises InputOutputError for a file whose data are in other files, UnreadableError for a damaged one, OSError.
    """
    file, signature = _identity(path)
    if _known.get(file) == signature:
        return
    told = _examiner.ask(path)
    if where := told.get("elsewhere"):
        raise InputOutputError(
            f"{path} leads to other files: {where}",
            "A trajectory holds all of its data; external links, external storage and virtual datasets are not followed.",
        )
    if problem := told.get("problem"):
        raise UnreadableError(problem)
    if _identity(path) == (file, signature):  # else it is being written
        _remember(file, signature)


def _identity(path: Path) -> tuple[tuple[int, int], Signature]:
    """Which file it is, and what changes when it is written."""
    found = path.stat()
    return (found.st_dev, found.st_ino), (found.st_size, found.st_mtime_ns)


def _remember(file: tuple[int, int], signature: Signature) -> None:
    _known.pop(file, None)
    _known[file] = signature
    while len(_known) > _KNOWN:
        del _known[next(iter(_known))]


class _Examiner:
    """The process, started when it is first needed. Safe for threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[str] | None = None

    def ask(self, path: Path) -> dict[str, str]:
        """What `examine` says of a file."""
        with self._lock:
            while True:
                fresh = self._process is None
                if fresh and not self._start():
                    return examine(path)
                answer, code = self._exchange(path)
                if answer is not None:
                    return answer
                if fresh or code in _TOO_LONG:
                    return {"problem": _reason(code)}
                # Files before this one may have had a part in it: once more, in a new process.

    def _start(self) -> bool:
        """Whether the process could be started, and has what it needs."""
        # Programs with Python inside of them name themselves.
        if "python" not in Path(sys.executable or "").name.lower() or getattr(sys, "frozen", False):
            return False
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _START.format(__name__)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
                encoding="utf-8",
            )
        except OSError:
            return False
        self._send([str(folder) for folder in sys.path])
        if self._receive() == {"ready": "yes"}:
            return True
        self.stop()
        return False

    def _exchange(self, path: Path) -> tuple[dict[str, str] | None, int]:
        """The answer for a file, or None and how the process ended."""
        try:
            self._send(os.fspath(path.absolute()))
            answer = self._receive()
        except BaseException:  # interrupted: the answer would be taken for the next one
            self.stop()
            raise
        return answer, 0 if answer is not None else self.stop()

    def _send(self, value: Any) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # then there will be no answer
            self._process.stdin.write(json.dumps(value) + "\n")
            self._process.stdin.flush()

    def _receive(self) -> dict[str, str] | None:
        assert self._process is not None
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        return json.loads(line) if line.endswith("\n") else None

    def stop(self) -> int:
        """End the process, unless it has ended by itself; returns how."""
        process, self._process = self._process, None
        if process is None:
            return 0
        process.kill()
        with suppress(OSError), process:  # closes the pipes
            pass
        return process.wait()

    def forget(self) -> None:
        """After a fork: the process belongs to the parent."""
        if self._process is not None:
            self._process.returncode = 0  # not to be waited for here
        self.__init__()  # type: ignore[misc]


_TOO_LONG = (1, -getattr(signal, "SIGPROF", 0))


def _reason(code: int) -> str:
    return "reading it does not end" if code in _TOO_LONG else "the HDF5 library crashes on it"


def examine(path: Path) -> dict[str, str]:
    """Look through a file: {} if all is well, else why not, as "elsewhere" or "problem"."""
    from particlesim.trajectory.structure import ElsewhereError, survey

    try:
        survey(path)
    except ElsewhereError as error:
        return {"elsewhere": str(error)}
    except Exception:  # what h5py raises on damaged metadata is of many kinds
        return {"problem": "its contents cannot be read"}
    return {}


def serve() -> None:
    """The process: a path per line comes in, an answer per line goes out."""
    import particlesim.trajectory.structure  # noqa: F401  what takes time, and may fail

    _confine()
    answers = sys.stdout
    sys.stdout = sys.stderr
    print(json.dumps({"ready": "yes"}), file=answers, flush=True)
    for line in sys.stdin:
        path = Path(json.loads(line))
        with _limit(path):
            answer = examine(path)
        print(json.dumps(answer), file=answers, flush=True)


def _confine() -> None:
    """Limits that hold for all files, where the system has them. Ctrl-C is meant for the main process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGPROF"):
        signal.signal(signal.SIGPROF, signal.SIG_DFL)  # should the main process ignore it
    if resource is None:
        return
    for what, most in ((resource.RLIMIT_AS, _MEMORY), (resource.RLIMIT_CORE, 0)):
        with suppress(OSError, ValueError):  # a lower one is set already, or the system has none
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))


@contextmanager
def _limit(path: Path) -> Iterator[None]:
    """End this process if the block takes too long. Both clocks work while HDF5 goes round in its own code."""
    seconds = _SECONDS + _stored(path) // _PER_SECOND
    faulthandler.dump_traceback_later(_WALL * seconds, exit=True)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_PROF, 0)


def _stored(path: Path) -> int:
    """Bytes that a file takes on the disk; one with holes may be longer."""
    found = path.stat()
    blocks: int | None = getattr(found, "st_blocks", None)
    return found.st_size if blocks is None else min(found.st_size, 512 * blocks)


_examiner = _Examiner()
atexit.register(_examiner.stop)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_examiner.forget)
