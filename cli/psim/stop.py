"""Ctrl-C, SIGTERM and SIGHUP: all end a command in order, and what was computed is kept."""

from __future__ import annotations

import contextlib
import signal
from types import FrameType


def listen() -> None:
    """Install the handlers; without effect outside of the main thread. A signal that is ignored (`nohup`) stays so."""
    with contextlib.suppress(ValueError):
        for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, _stop)


def _stop(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
