"""What is told while pictures are made and sweeps go on: on a clock of the test's own."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest

from particlesim import compiler
from particlesim.compiler.kernel import _timed as compiling
from particlesim.process.preparing import preparing
from particlesim.sweep.sweep import SweepProgress
from psim import progress
from psim.progress import render_progress, run_progress, sweep_progress, told_when_long


@pytest.fixture
def clock(monkeypatch):
    """Seconds that the test lets pass, and how many of them went into compiling."""
    now = SimpleNamespace(seconds=0.0, compiling=0.0)
    monkeypatch.setattr(progress, "time", SimpleNamespace(perf_counter=lambda: now.seconds))
    monkeypatch.setattr(compiler, "compiling_seconds", lambda: now.compiling)
    return now


@pytest.fixture
def told(monkeypatch):
    said: list[str] = []
    monkeypatch.setattr(progress, "animated", lambda: False)
    monkeypatch.setattr(progress, "say", said.append)
    return said


def test_compiling_is_no_part_of_the_time_left_of_a_video(clock, told):
    """200 pictures at two per second; the first comes after 14 s of compiling, and the tenth waits for 8 s more."""
    with render_progress("a.mp4", quiet=False) as show:
        clock.seconds, clock.compiling = 14.5, 14.0
        show(1, 200)
        for done in range(2, 201):
            clock.seconds += 0.5
            if done == 10:
                clock.seconds, clock.compiling = clock.seconds + 8.0, clock.compiling + 8.0
            show(done, 200)
    assert told[0] == "a.mp4: 2 of 200 pictures, 1 min 39 s left"
    assert [line.split(",")[1] for line in told[1:]] == [" 1 min 17 s left", " 47.0 s left", " 17.0 s left"]


def test_what_a_first_run_takes_to_begin_is_no_part_of_the_time_left_of_a_sweep(clock, told):
    with sweep_progress("a", quiet=False) as show:
        for ended, seconds in ((0, 0.0), (1, 30.0), (2, 31.0), (50, 79.0)):
            clock.seconds = seconds
            show(SweepProgress(ended, 100, 0, 0, seconds))
    assert [line.rsplit(", ", 1)[1] for line in told] == ["1 min 38 s left", "50.0 s left"]


def test_a_video_says_that_it_compiles(told, monkeypatch):
    heard = threading.Event()
    monkeypatch.setattr(progress, "FIRST_LINE", 0.0)
    monkeypatch.setattr(progress, "say", lambda text: (told.append(text), heard.set()))
    with render_progress("a.mp4", quiet=False), compiling():
        assert heard.wait(60)
    assert told == ["a.mp4: compiling kernels, which are kept for the next run"]


def test_what_takes_long_before_the_first_step_is_told_once(told, monkeypatch):
    heard = threading.Event()
    monkeypatch.setattr(progress, "WAITED", 0.0)
    monkeypatch.setattr(progress, "say", lambda text: (told.append(text), heard.set()))
    for way in (run_progress, told_when_long):
        told.clear()
        with way("a", quiet=False):
            for _ in range(2):
                with preparing("counting sheep"):
                    assert heard.wait(60)
        assert told == ["a: counting sheep"]
    with told_when_long("a", quiet=True), preparing("counting sheep"):
        pass
    assert told == ["a: counting sheep"]


def test_what_is_done_before_it_is_long_is_not_told(told):
    with told_when_long("a"):
        with preparing("counting sheep"):
            pass
        assert not [
            each
            for each in threading.enumerate()
            if isinstance(each, threading.Timer) and not each.finished.is_set()
        ]
    assert told == []


@pytest.fixture
def notes(monkeypatch):
    """What a bar says of what is done."""
    notes: list[str] = []

    class Bar:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def add_task(self, *_, note, **__):
            notes.append(note)

        def update(self, *_, note, **__):
            notes.append(note)

    monkeypatch.setattr(progress, "animated", lambda: True)
    monkeypatch.setattr(progress, "_bar", lambda *_, **__: Bar())
    return notes


def test_a_bar_says_what_is_prepared(notes):
    with run_progress("a", quiet=False), preparing("counting sheep"), compiling():
        pass
    said = ["preparing", "counting sheep", "compiling kernels, to be kept", "counting sheep", "preparing"]
    assert notes == said


def test_a_bar_says_that_it_compiles(notes):
    with render_progress("a.mp4", quiet=False) as show:
        with compiling():
            pass
        show(1, 10)
    assert notes == ["preparing", "compiling kernels, to be kept", "preparing", "picture 1 of 10"]


def test_what_is_told_of_a_video_at_its_end():
    from psim.render import _took

    made = SimpleNamespace(frames=100, seconds=30.0, compiling=20.0)
    assert (
        _took(made)
        == "100 pictures in 30.0 s, 20.0 s of them for compiling kernels, which are kept; 10.0 per second"
    )
    made = SimpleNamespace(frames=1, seconds=0.5, compiling=0.0)
    assert _took(made) == "1 picture in 0.50 s; 2.0 per second"
