"""Ctrl-C, SIGTERM and SIGHUP: all end a command in order, and what was computed is kept."""

from __future__ import annotations

import contextlib
import signal
from types import FrameType

_requested = False


def listen() -> None:
    """Install the handlers; without effect outside of the main thread. A signal that is ignored (`nohup`) stays so."""
    global _requested
    _requested = False
    with contextlib.suppress(ValueError):
        for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, _stop)


def requested() -> bool:
    """Whether a signal came. The making of a class and compiled code turn its exception into errors of their own."""
    return _requested


def _stop(number: int, frame: FrameType | None) -> None:
    global _requested
    _requested = True
    raise KeyboardInterrupt
