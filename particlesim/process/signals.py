"""Signals that are heard at safe points.

Python raises KeyboardInterrupt wherever it happens to be: between taking a lock and the line that would release it, or
inside a callback that swallows exceptions. Long work therefore holds signals, and hears them between its pieces.
"""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Callable
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)

GRACE = 2.0
"""Seconds after which a signal is heard even without a safe point, as in the middle of a long compilation."""


class Held:
    """Signals with handlers in Python that wait for `check`. The second one does not wait."""

    def __init__(self) -> None:
        self._handlers: dict[int, Callable[[int, FrameType | None], Any]] = {}
        self._waiting: int | None = None
        self._reminder: _thread.LockType | None = None

    @property
    def waiting(self) -> bool:
        """Whether a signal waits for `check`."""
        return self._waiting is not None

    def check(self) -> None:
        """A safe point: if a signal came, its own handler is called (Python's own raises KeyboardInterrupt).

        Also if it was called before: where that was in vain, its exception swallowed by the end of an object's life.
        """
        if self._waiting is not None:
            self._deliver(self._waiting, None)

    def take(self) -> None:
        """Begin to hold; only in the main thread."""
        for number in SIGNALS:
            handler = signal.getsignal(number)
            if callable(handler):  # not those that are ignored, or that end the process
                self._handlers[number] = handler
                signal.signal(number, self._note)

    def give_back(self) -> None:
        """Put the handlers back. A signal that still waits stays to be heard by `check`."""
        self._forget_reminder()
        for number in self._handlers:
            signal.signal(number, self._handlers[number])

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._waiting is not None:
            self._deliver(number, frame)
            return
        self._waiting = number
        # This may interrupt the start of a thread, so nothing here takes the locks of `threading`.
        self._reminder = _thread.allocate_lock()
        self._reminder.acquire()
        _thread.start_new_thread(_remind, (self._reminder, number))

    def _deliver(self, number: int, frame: FrameType | None) -> None:
        self._forget_reminder()
        self._handlers[number](number, frame)

    def _forget_reminder(self) -> None:
        reminder, self._reminder = self._reminder, None
        if reminder is not None:
            reminder.release()


def _remind(reminder: _thread.LockType, number: int) -> None:
    """Send the signal once more after a while, unless the lock is released before."""
    if not reminder.acquire(timeout=GRACE):
        _thread.interrupt_main(signal.Signals(number))


_active: Held | None = None


@contextmanager
def held_signals() -> Iterator[Held]:
    """Hold signals inside the block; the caller calls `check` at its safe points.

    Inside another such block it is that block's. A signal that came after the last safe point is heard at the end. Threads
    other than the main one hear none, and hold none.
    """
    global _active
    if threading.current_thread() is not threading.main_thread():
        yield Held()
        return
    if _active is not None:
        yield _active
        return
    held = Held()
    held.take()
    _active = held
    try:
        yield held
    finally:
        _active = None
        held.give_back()
    held.check()
