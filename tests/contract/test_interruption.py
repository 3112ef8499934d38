"""Signals wait for safe points, but not for ever."""

import gc
import signal
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import thread as pools
from types import FrameType
from typing import Any

import pytest

from particlesim.process import signals as interruption
from particlesim.process import threads as team
from particlesim.process.signals import held_signals
from particlesim.process.threads import Team


def test_a_signal_waits_for_the_safe_point():
    reached = False
    with pytest.raises(KeyboardInterrupt), held_signals() as signals:  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        reached = True
        signals.check()
        reached = False
    assert reached


def test_a_signal_after_the_last_safe_point_is_heard_at_the_end():
    with pytest.raises(KeyboardInterrupt), held_signals():
        signal.raise_signal(signal.SIGINT)


def test_the_second_signal_does_not_wait():
    passed = 0
    with pytest.raises(KeyboardInterrupt), held_signals():  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        passed += 1
        signal.raise_signal(signal.SIGINT)
        passed += 1
    assert passed == 1


def test_without_a_safe_point_it_is_heard_after_a_while(monkeypatch):
    monkeypatch.setattr(interruption, "GRACE", 0.05)
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), held_signals():  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        while time.monotonic() - began < 20:
            time.sleep(0.01)
    assert time.monotonic() - began < 10


def test_handlers_are_put_back_and_errors_pass():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(ZeroDivisionError), held_signals():  # noqa: PT012
        assert signal.getsignal(signal.SIGINT) is not before
        raise ZeroDivisionError
    assert signal.getsignal(signal.SIGINT) is before


def test_a_block_inside_a_block_shares_it():
    with held_signals() as outer, held_signals() as inner:
        assert inner is outer


def test_other_threads_hold_nothing():
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def work() -> None:
        with held_signals() as signals:
            signals.check()
            seen.append(signal.getsignal(signal.SIGINT) is before)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [True]


STARTING = {team.__file__, threading.__file__, pools.__file__}
"""Where a team and its threads are started and ended."""


def _interrupted_at(place: int, work: Callable[[], None]) -> bool:
    """Whether a signal came while `work` was at its line number `place` of those files, counted as they are executed."""
    lines = 0

    def trace(frame: FrameType, event: str, argument: object) -> Callable[..., Any] | None:
        nonlocal lines
        if frame.f_code.co_filename not in STARTING:
            return None
        if event == "line":
            lines += 1
            if lines == place:
                signal.raise_signal(signal.SIGINT)
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def test_a_team_that_is_interrupted_at_any_line_of_its_start_leaves_nothing_behind():
    """A thread that waits for a sibling that never comes, or that its pool does not know, would keep the process alive."""

    def work() -> None:
        with Team(2) as team:
            team.started()

    gc.collect()
    gc.freeze()  # what is here already would be looked through every time
    place = 1
    while _interrupted_at(place, work):
        left = [thread for thread in threading.enumerate() if thread.name.startswith("psim")]
        if left:
            gc.collect()  # a pool that was lost ends its threads
        for thread in left:
            thread.join(5)
        assert not any(thread.is_alive() for thread in left), place
        place += 3  # nearly every line, in a third of the time
    gc.unfreeze()
    assert place > 50
