"""Ctrl-C, SIGTERM and SIGHUP end a command; one that is ignored stays ignored."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest

from psim import app
from psim import signals as stop

from .conftest import Ended


@pytest.fixture(autouse=True)
def nothing_requested(monkeypatch):
    """A signal that a test sends is not heard by commands of later tests in the same process."""
    monkeypatch.setattr(stop, "_requested", False)


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


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_before_the_subcommand_begins(psim, monkeypatch, name):
    import typer.main

    monkeypatch.setattr(typer.main, "get_command", lambda _: signal.raise_signal(getattr(signal, name)))
    assert psim("run", "tiny.toml") == Ended(130, "", "")


def test_a_signal_after_the_subcommand_has_ended_keeps_its_exit_code(psim, monkeypatch):
    def end(*_: object) -> None:
        signal.raise_signal(signal.SIGTERM)

    ended = []
    monkeypatch.setattr(stop.os, "_exit", ended.append)
    monkeypatch.setattr(app, "gc", SimpleNamespace(freeze=end, set_threshold=gc.set_threshold))
    assert psim("check", "tiny.toml").code == 0
    assert psim("check", "gone.toml").code == 2
    assert ended == [0, 2]


class Mortal:
    def __del__(self) -> None:
        signal.raise_signal(signal.SIGTERM)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("arguments", [("check", "tiny.toml"), ("run", "tiny.toml")])
def test_a_signal_that_the_end_of_an_object_swallows_is_heard(psim, monkeypatch, arguments):
    """As in the libraries of the compiler, which let go of many objects while kernels are loaded."""
    from pathlib import Path

    from particlesim.engine.world import World

    begin = World.__init__

    def swallow(*given, **named):
        Mortal()
        begin(*given, **named)

    monkeypatch.setattr(World, "__init__", swallow)
    ended = psim(*arguments)
    assert ended.code == 130
    assert "interrupted" in ended.err
    assert not Path("outputs/tiny.vtkhdf").exists()


DEAF = """
import signal, time
from psim import signals
signals.PATIENCE = 0.2
signals.listen()
signal.signal(signal.SIGTERM, lambda *_: None)  # never heard, as in a kernel that runs for minutes
print("deaf", flush=True)
while True:
    time.sleep(1)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_signal_in_the_middle_of_long_work_ends_it() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", DEAF], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as deaf:
        assert deaf.stdout is not None
        assert deaf.stdout.readline() == b"deaf\n"
        deaf.terminate()
        _, told = deaf.communicate(timeout=60)
    assert deaf.returncode == stop.INTERRUPTED
    assert b"stopped in the middle of a step" in told
