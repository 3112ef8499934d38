"""Synthetic frames: every value tells which frame and which particle it belongs to."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from particlesim.trajectory.writer import TrajectoryWriter

LEDGER = ("kinetic", "potential.gravity", "momentum.x", "momentum.y", "momentum.z")


def synthetic_columns(frame: int, count: int, floats: str = "f4") -> dict[str, np.ndarray]:
    """Position, velocity, temperature, id and group of `count` particles in frame number `frame`."""
    ids = np.arange(count, dtype=np.int64) + frame
    position = np.stack([ids + 0.25, ids * 0.0 + frame, -ids / 3.0], axis=1)
    columns = {"position": position, "velocity": position * 2 + 1, "temperature": 300.0 + ids}
    floats_only = {name: np.ascontiguousarray(values, dtype=floats) for name, values in columns.items()}
    return {**floats_only, "id": ids, "group": (ids % 2).astype("i4")}


def synthetic_ledger(frame: int) -> dict[str, float]:
    return {name: frame * 10.0 + k for k, name in enumerate(LEDGER)}


def open_writer(path: Path, **options: Any) -> TrajectoryWriter:
    defaults: dict[str, Any] = {
        "fields": ["velocity", "temperature", "group"],
        "groups": ["sparks", "dust, fine"],
        "ledger": LEDGER,
        "provenance": {"scenario": 'title = "test"\n', "seed": 7, "rate": 0.5},
    }
    return TrajectoryWriter(path, **(defaults | options))


def record(path: Path, counts: Sequence[int], **options: Any) -> Path:
    """A closed trajectory whose k-th frame, at k/10 s and step 5 k, has counts[k] particles."""
    floats = "f8" if options.get("precision") == "double" else "f4"
    with open_writer(path, **options) as writer:
        for k, count in enumerate(counts):
            writer.append(k / 10, 5 * k, synthetic_columns(k, count, floats), synthetic_ledger(k))
    return path


def assert_synthetic(trajectory: Any, counts: Sequence[int], floats: str = "f4") -> None:
    """Every frame, field and ledger row is what `record` wrote, to the last bit."""
    assert list(trajectory.counts) == list(counts)
    for k, (frame, count) in enumerate(zip(trajectory, counts, strict=True)):
        assert (frame.time, frame.step, len(frame)) == (k / 10, 5 * k, count)
        for name, expected in synthetic_columns(k, count, floats).items():
            assert frame[name].dtype == expected.dtype
            np.testing.assert_array_equal(frame[name], expected)
    for name, values in trajectory.ledger.items():
        np.testing.assert_array_equal(values, [synthetic_ledger(k)[name] for k in range(len(counts))])


class Synthetic:
    """The helpers above, as one fixture (tests are imported without packages)."""

    columns = staticmethod(synthetic_columns)
    ledger = staticmethod(synthetic_ledger)
    open_writer = staticmethod(open_writer)
    record = staticmethod(record)
    check = staticmethod(assert_synthetic)


@pytest.fixture
def synthetic() -> type[Synthetic]:
    return Synthetic


@pytest.fixture
def start_writer() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts `victim.py` on a file; see there. What still runs at the end of the test is killed."""
    running: list[subprocess.Popen[str]] = []

    def start(
        path: Path, particles: int = 100, compression: str = "gzip", pause: float = 0.0, frames: int = 10**6
    ) -> subprocess.Popen[str]:
        command = [sys.executable, Path(__file__).with_name("victim.py"), path, particles, compression]
        command += [pause, frames]
        running.append(subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, text=True))
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.fixture
def kill_writer(start_writer: Callable[..., subprocess.Popen[str]]) -> Callable[..., Path]:
    """Runs `victim.py` until it has acknowledged some frames and a moment more, then kills it (SIGKILL)."""

    def run_and_kill(path: Path, acknowledged: int, moment: float = 0.0, **options: Any) -> Path:
        process = start_writer(path, **options)
        while int(process.stdout.readline()) < acknowledged:
            pass
        time.sleep(moment)
        process.kill()
        process.wait()
        return path

    return run_and_kill
