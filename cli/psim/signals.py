"""Ctrl-C, SIGTERM and SIGHUP: all end a command in order, and what was computed is kept.

Nothing is imported here that takes time, as signals count from the first moment.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from types import FrameType

INTERRUPTED = 130
"""Exit code of a command that a signal ended."""

_requested = False


def end_at_once(code: int = INTERRUPTED) -> None:
    """A signal ends the process with an exit code from here on: where there is nothing to put in order, as before the
    command has begun, when it would fall into the middle of an import, and after it has ended."""
    _install(lambda number, frame: os._exit(code))


def listen() -> None:
    """A signal raises KeyboardInterrupt from here on, so that the command ends in order."""
    global _requested
    _requested = False
    _install(_stop)


def requested() -> bool:
    """Whether a signal came. The making of a class and compiled code turn its exception into errors of their own."""
    return _requested


def _install(handler: Callable[[int, FrameType | None], None]) -> None:
    """Without effect outside of the main thread. A signal that is ignored (`nohup`) stays so."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            try:
                signal.signal(number, handler)
            except ValueError:
                return


def _stop(number: int, frame: FrameType | None) -> None:
    global _requested
    _requested = True
    raise KeyboardInterrupt
