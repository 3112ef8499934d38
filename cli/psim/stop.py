"""Ctrl-C and SIGTERM: both end a run in order, and what was computed is kept.

The handler raises KeyboardInterrupt as Python's own does. Where that falls into a callback that swallows exceptions, such
as the end of an object's life, the request is not lost: long work asks `check` between its pieces.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable
from types import FrameType
from typing import ParamSpec

P = ParamSpec("P")

_requested = False


def listen() -> None:
    """Install the handlers; without effect outside of the main thread."""
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, _stop)
        signal.signal(signal.SIGTERM, _stop)


def _stop(number: int, frame: FrameType | None) -> None:
    global _requested
    _requested = True
    raise KeyboardInterrupt


def check() -> None:
    """Raise KeyboardInterrupt if it was asked for and went unheard."""
    global _requested
    if _requested:
        _requested = False
        raise KeyboardInterrupt


def stoppable(show: Callable[P, None] | None) -> Callable[P, None]:
    """A progress function that also listens; `show` None shows nothing."""

    def step(*args: P.args, **kwargs: P.kwargs) -> None:
        check()
        if show is not None:
            show(*args, **kwargs)

    return step
