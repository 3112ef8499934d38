"""`psim sweep`: what it says, and its exit codes."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

from .conftest import LONG, start


def test_a_sweep(psim) -> None:
    ended = psim("sweep", "tiny.toml", "--vary", "particles.balls.mass=0.1,0.2", "-j", 1)
    assert ended.code == 0
    assert ended.out.strip() == "outputs/tiny-sweep/results.csv"
    lines = Path("outputs/tiny-sweep/results.csv").read_text().splitlines()
    assert lines[0].startswith("run,particles.balls.mass,count,")
    assert [line.split(",")[:2] for line in lines[1:]] == [["1", "0.1"], ["2", "0.2"]]
    again = psim("sweep", "tiny.toml", "--vary", "particles.balls.mass=0.1,0.2", "-j", 1)
    assert "2 of 2 (2 of them earlier)" in again.err


def test_exit_code_of_the_worst(psim) -> None:
    ended = psim("sweep", "tiny.toml", "--vary", "particles.balls.mass=0.1,-1", "-j", 1, "--json")
    assert ended.code == ended.json["exit_code"] == 2
    assert ended.json["counts"]["done"] == ended.json["counts"]["bad_scenario"] == 1


def test_bad_input_leaves_nothing(psim) -> None:
    for arguments in (
        ("--vary", "simulation.dtt=1,2"),
        ("--vary", "simulation.seed="),
        ("--vary", "simulation.seed=1,2", "--vary", "render.fps=1,2,3", "--zip"),
        ("--vary", "simulation.dt=uniform(1e-3, 1e-2)"),
        ("--vary", "simulation.dt=gauss(1, 2)"),
        ("--vary", "simulation.seed=1", "--quantity", "enrgy"),
        (),
    ):
        ended = psim("sweep", "tiny.toml", *arguments)
        assert ended.code == 2, arguments
        assert "Traceback" not in ended.err
    assert not Path("outputs").exists()


def test_a_million_runs_are_asked_for(psim) -> None:
    many = ("--vary", "simulation.seed=linspace(1, 1001, 1001)")
    ended = psim("sweep", "tiny.toml", *many, "--vary", "particles.balls.mass=linspace(1, 2, 1000)")
    assert ended.code == 2
    assert "1,001,000 runs" in ended.err
    assert "--yes" in ended.err


def test_ctrl_c_keeps_what_is_done() -> None:
    Path("long.toml").write_text(LONG)
    process = start("sweep", "long.toml", "--vary", "simulation.duration=0.1,0.2,1e6", "-j", 1, "-o", "out")
    deadline = time.monotonic() + 60
    while not Path("out/0002/result.json").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "2 of 3" in err
    assert "goes on from here" in err
    assert len(Path("out/results.csv").read_text().splitlines()) == 3
    assert json.loads(Path("out/0001/result.json").read_text())["status"] == "done"
