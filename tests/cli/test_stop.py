"""A request to stop is not lost where its exception is swallowed."""

from __future__ import annotations

import os
import signal

import pytest

from psim import stop


def test_a_swallowed_request_is_heard_later() -> None:
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    stop.listen()
    try:
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            stop.stoppable(None)()
        stop.check()  # heard once
    finally:
        signal.signal(signal.SIGTERM, before[0])
        signal.signal(signal.SIGINT, before[1])


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
