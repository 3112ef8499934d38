"""Signals wait for safe points, but not for ever."""

import signal
import threading
import time

import pytest

from particlesim import interruption
from particlesim.interruption import held_signals


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
