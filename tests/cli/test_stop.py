"""Ctrl-C, SIGTERM and SIGHUP end a command; one that is ignored stays ignored."""

from __future__ import annotations

import signal

import pytest

from psim import stop


@pytest.fixture(autouse=True)
def handlers():
    """Put the handlers back."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_interrupts(name: str) -> None:
    stop.listen()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(getattr(signal, name))


def test_what_nohup_ignores_stays_ignored() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    stop.listen()
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


def test_ctrl_c_that_compiled_code_makes_another_error_of(psim, monkeypatch):
    import particlesim as ps

    def build(*_, **__):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            raise ValueError("building failed: KeyboardInterrupt") from error

    monkeypatch.setattr(ps, "load", build)
    ended = psim("run", "tiny.toml")
    assert ended.code == 130
    assert "Traceback" not in ended.err
