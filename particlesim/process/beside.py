"""A child process: how it starts, and that it ends with this one.

On Linux it is a copy of this process, ready at once, where no other thread could hold a lock in the moment of copying;
elsewhere a new interpreter, which imports what it needs.
"""

from __future__ import annotations

import multiprocessing
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from multiprocessing.connection import Connection
from typing import Any

ENDING = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
"""Signals that end a process."""


class Beside:
    """A process that does `work(connection, *arguments)`; `connection` is our end of the pipe to it.

    `others` are our ends of the pipes to processes that began earlier. `work` and the arguments must survive pickling.
    """

    def __init__(
        self, work: Callable[..., None], arguments: Sequence[Any], others: Sequence[Connection] = ()
    ) -> None:
        forks = _may_fork()
        context: Any = multiprocessing.get_context("fork" if forks else "spawn")
        self.connection, theirs = context.Pipe()
        # A copy of this process has copies of our ends, too, which would hide that we are gone.
        inherited = [self.connection, *others] if forks else []
        self._process = context.Process(target=_begin, args=(work, theirs, arguments, inherited), daemon=True)
        with warnings.catch_warnings():
            # Python 3.12 counts threads of libraries as well; those that NumPy starts live through a fork.
            warnings.simplefilter("ignore", DeprecationWarning)
            with _deaf() if forks else nullcontext():
                self._process.start()
        theirs.close()  # so that the end of the process is the end of the stream

    def end(self, grace: float = 0.0) -> None:
        """End the process; one that cleans up when it is asked to end has `grace` seconds for it."""
        self.connection.close()
        self._process.terminate()
        self._process.join(grace or None)
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()
        self._process.close()


@contextmanager
def _deaf() -> Iterator[None]:
    """Signals that end a process wait until the copy of this one has handlers of its own: those of this one would raise in
    the middle of the fork, and the copy would go on with all that this process has yet to do."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _may_fork() -> bool:
    """Whether a process can be a copy of this one: on Linux, if no thread of ours could hold a lock."""
    return sys.platform == "linux" and threading.active_count() == 1


def _begin(
    work: Callable[..., None],
    connection: Connection,
    arguments: Sequence[Any],
    inherited: Sequence[Connection],
) -> None:
    """In the process: what it is for."""
    for each in inherited:
        each.close()
    # Ctrl-C reaches the whole group of processes; the one that started this one decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    work(connection, *arguments)
