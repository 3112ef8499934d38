"""What is done before the first step, for those who wait: preparations that may take seconds say what they are about."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LISTENERS: list[Callable[[str | None], None]] = []


@contextmanager
def preparing(what: str) -> Iterator[None]:
    """Tell those who listen that this process is at `what`, and when it is no longer."""
    for listener in tuple(_LISTENERS):
        listener(what)
    try:
        yield
    finally:
        for listener in tuple(_LISTENERS):
            listener(None)


@contextmanager
def told_of_preparing(listener: Callable[[str | None], None]) -> Iterator[None]:
    """Calls `listener` with the description of a preparation when it begins and with None when it ends, in any thread."""
    _LISTENERS.append(listener)
    try:
        yield
    finally:
        _LISTENERS.remove(listener)
