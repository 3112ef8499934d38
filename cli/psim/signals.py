"""Ctrl-C, SIGTERM and SIGHUP: all end a command in order, and what was computed is kept.

Nothing is imported here that takes time, as signals count from the first moment.
"""

from __future__ import annotations

import _thread
import contextlib
import os
import signal
import time
from collections.abc import Callable
from types import FrameType

INTERRUPTED = 130
"""Exit code of a command that a signal ended."""

PATIENCE = 10.0
"""Seconds after which a signal ends the process at once, if nobody has heard it: in a step that takes minutes, Python runs
no handler before it ends."""
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")

_requested = False
_alarm = -1  # the end of a pipe that a signal writes its number to


def end_at_once(code: int = INTERRUPTED) -> None:
    """A signal ends the process with an exit code from here on: where there is nothing to put in order, as before the
    command has begun, when it would fall into the middle of an import, and after it has ended."""
    _install(lambda number, frame: os._exit(code))
    _wake(-1)


def listen() -> None:
    """A signal raises KeyboardInterrupt from here on, so that the command ends in order."""
    global _requested
    _requested = False
    _install(_stop)
    _watch()


def requested() -> bool:
    """Whether a signal came. The making of a class and compiled code turn its exception into errors of their own."""
    return _requested


def _install(handler: Callable[[int, FrameType | None], None]) -> None:
    """Without effect outside of the main thread. A signal that is ignored (`nohup`) stays so."""
    for name in _NAMES:
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


def _watch() -> None:
    """Have a thread see signals of this process as they come. Windows has no such pipe."""
    global _alarm
    if os.name != "posix":
        return
    if _alarm < 0:
        reader, _alarm = os.pipe()
        os.set_blocking(_alarm, False)
        os.register_at_fork(after_in_child=lambda: _wake(-1))
        _thread.start_new_thread(_end_unheard, (reader,))
    _wake(_alarm)


def _wake(alarm: int) -> None:
    """Without effect outside of the main thread, which alone hears signals."""
    with contextlib.suppress(ValueError):
        signal.set_wakeup_fd(alarm, warn_on_full_buffer=False)


def _end_unheard(reader: int) -> None:
    """End the process some time after a signal that nobody hears. Files are then as after the loss of power."""
    numbers = {getattr(signal, name) for name in _NAMES if hasattr(signal, name)}
    while True:
        if os.read(reader, 1)[0] in numbers:
            time.sleep(PATIENCE)
            if not _requested:
                os.write(2, b"error: stopped in the middle of a step; what was recorded before it is kept\n")
                os._exit(INTERRUPTED)
