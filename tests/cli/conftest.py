"""The command line in this process (fast) and in one of its own (real), in an empty working directory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from psim import app, signals

REPOSITORY = Path(__file__).resolve().parents[2]

TINY = """\
format = 1
title = "Tiny"

[simulation]
duration = 0.1
dt = 0.01

[output]
fps = 20

[[particles]]
name = "balls"
layout = { type = "points", position = [[0, 1, 0], [0.5, 1, 0], [0, 1.5, 0.5]] }
mass = 0.1
radius = 0.05

[[forces]]
type = "gravity"

[[planes]]
restitution = 0.5

[render]
size = [64, 48]
"""
"""A run of a few milliseconds, with every kind of kernel that these tests need."""

LONG = TINY.replace("duration = 0.1", "duration = 1e6").replace("fps = 20", "interval = 0.1")
"""The same, for far longer than any test waits."""


@dataclass(frozen=True)
class Ended:
    """How a command ended, and what it said."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture(autouse=True)
def _empty_place(tmp_path, monkeypatch):
    """An empty working directory with one scenario, and no colours."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TERM", "dumb")
    (tmp_path / "tiny.toml").write_text(TINY)


@pytest.fixture(autouse=True)
def _nobody_insists(monkeypatch):
    """No thread ends the process of the tests where one of them keeps a signal to itself."""
    monkeypatch.setattr(signals, "_watch", lambda: None)


@pytest.fixture
def psim(capsys, monkeypatch):
    """Run `psim ARGUMENTS` in this process."""
    import gc
    import signal

    def run(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["psim", *map(str, arguments)])
        handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
        threshold = gc.get_threshold()
        capsys.readouterr()
        try:
            with pytest.raises(SystemExit) as end:
                app.main()
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
            gc.set_threshold(*threshold)
            gc.unfreeze()
        said = capsys.readouterr()
        return Ended(int(end.value.code or 0), said.out, said.err)

    return run


def environment() -> dict[str, str]:
    """Of a process that finds the packages of this checkout."""
    return {**os.environ, "PYTHONPATH": f"{REPOSITORY}{os.pathsep}{REPOSITORY / 'cli'}"}


def start(*arguments: object, **options: Any) -> subprocess.Popen[str]:
    """`psim ARGUMENTS` in a process of its own."""
    pipes = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
        "env": environment(),
        **options,
    }
    return subprocess.Popen([sys.executable, "-m", "psim", *map(str, arguments)], **pipes)


def real(*arguments: object, **options: Any) -> Ended:
    """`psim ARGUMENTS` in a process of its own, to its end."""
    process = start(*arguments, **options)
    out, err = process.communicate(timeout=60)
    return Ended(process.returncode, out or "", err or "")


def files() -> dict[str, int]:
    """Everything below the working directory, with sizes."""
    return {str(path): path.stat().st_size for path in Path().rglob("*")}


@pytest.fixture(scope="session")
def trajectory(tmp_path_factory) -> Path:
    """A trajectory of the tiny scenario."""
    import particlesim as ps

    path = tmp_path_factory.mktemp("trajectory") / "tiny.vtkhdf"
    ps.run(ps.loads(TINY), path)
    return path


@pytest.fixture
def recorded(trajectory) -> Path:
    """A copy of it in the working directory."""
    import shutil

    return Path(shutil.copy(trajectory, "recorded.vtkhdf"))
