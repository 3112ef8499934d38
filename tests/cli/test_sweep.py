"""`psim sweep`: what it says, and its exit codes."""

from __future__ import annotations

import json
import signal
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest

from .conftest import LONG, TINY, start


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
    long = psim("sweep", "tiny.toml", "--vary", "simulation.seed=linspace(1, 1000001, 1000001)")
    assert long.code == 2
    assert "1,000,001 runs" in long.err


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
    assert "continues from here" in err
    assert len(Path("out/results.csv").read_text().splitlines()) == 3
    assert json.loads(Path("out/0001/result.json").read_text())["status"] == "done"


SWEEP = """
scenario = "tiny.toml"
quantities = ["kinetic"]
workers = 1
[vary]
"particles.balls.mass" = [0.1, 0.2]
"simulation.dt" = "linspace(0.005, 0.01, 2)"
[set]
"planes.0.restitution" = 0.25
title = "Swept"
"""


def test_a_sweep_file(psim) -> None:
    Path("sweep.toml").write_text(SWEEP)
    ended = psim("sweep", "sweep.toml")
    assert ended.code == 0, ended.err
    lines = Path("outputs/tiny-sweep/results.csv").read_text().splitlines()
    assert lines[0].startswith("run,particles.balls.mass,simulation.dt,kinetic,status")
    assert len(lines) == 5
    assert "restitution = 0.25" in Path("outputs/tiny-sweep/0001/scenario.toml").read_text()
    # The same on the command line is the same sweep, which goes on: nothing is left to do.
    again = psim(
        *("sweep", "tiny.toml", "--vary", "particles.balls.mass=0.1,0.2", "--quantity", "kinetic"),
        *("--vary", "simulation.dt=0.005,0.01", "-j", 1),
        *("--set", "planes.0.restitution = 0.25", "--set", 'title = "Swept"'),
    )
    assert again.code == 0, again.err
    assert "4 of 4 (4 of them earlier)" in again.err


def test_options_beside_a_sweep_file(psim) -> None:
    Path("sweep.toml").write_text(SWEEP)
    ended = psim("sweep", "sweep.toml", "--vary", "simulation.dt=0.01", "--quantity", "count", "-o", "out")
    assert ended.code == 0
    lines = Path("out/results.csv").read_text().splitlines()
    assert lines[0].startswith("run,particles.balls.mass,simulation.dt,count,status")
    assert len(lines) == 3


def test_mistakes_in_a_sweep_file(psim) -> None:
    for broken, place in (
        (SWEEP.replace("workers = 1", "worker = 1"), "sweep.toml:4:1"),
        (SWEEP.replace("[0.1, 0.2]", "[]"), "sweep.toml:6:"),
        (SWEEP.replace("workers = 1", 'workers = "1"'), "sweep.toml:4:"),
        (SWEEP.replace("workers = 1", 'samples = "4"'), "sweep.toml:4:"),
        (SWEEP.replace("workers = 1", "zip = 1"), "sweep.toml:4:"),
        (SWEEP.replace('title = "Swept"', '"simulation.dt" = 0.1'), "simulation.dt is both set and varied"),
        (SWEEP.replace("workers = 1", 'method = "sobel"'), "sweep.toml:4:"),
        (SWEEP.replace('"tiny.toml"', '"gone.toml"'), "gone.toml"),
        (SWEEP.replace("linspace(", "linspce("), "linspce"),
        ("scenario = 'tiny.toml'\n", "vary"),
        (SWEEP.replace("particles.balls.mass", "particles.bals.mass"), "bals"),
    ):
        Path("sweep.toml").write_text(broken)
        ended = psim("sweep", "sweep.toml")
        assert ended.code == 2, broken
        assert place in ended.err
        assert "Traceback" not in ended.err
    assert not Path("outputs").exists()


def test_plots(psim) -> None:
    vary = ("--vary", "particles.balls.mass=0.1,0.2,0.3", "--vary", "planes.0.restitution=0.2,0.4")
    ended = psim("sweep", "tiny.toml", *vary, "-j", 1, "--plot", "y=energy", "x=particles.balls.mass")
    assert ended.code == 0, ended.err
    assert ended.out.split() == ["outputs/tiny-sweep/results.csv", "outputs/tiny-sweep/plot.png"]
    assert Path("outputs/tiny-sweep/plot.png").read_bytes().startswith(b"\x89PNG")
    for columns, word in ((("x=enrgy", "y=energy"), "energy"), (("energy", "y=count"), "--plot x=")):
        wrong = psim("sweep", "tiny.toml", *vary, "-o", "other", "--plot", *columns)
        assert wrong.code == 2
        assert word in wrong.err
    assert not Path("other").exists()


def test_one_sweep_at_a_time_in_a_folder(psim) -> None:
    from particlesim.sweep.files import alone

    with alone(Path("out")):
        ended = psim("sweep", "tiny.toml", "--vary", "simulation.seed=1,2", "-o", "out")
    assert ended.code == 2
    assert "another sweep is at work" in ended.err
    assert psim("sweep", "tiny.toml", "--vary", "simulation.seed=1,2", "-o", "out", "-j", 1).code == 0


def test_clusters_that_are_none(psim, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    for arguments, message in (
        (("--cluster", "pbs"), "there is no cluster 'pbs'"),
        (("--cluster", "slurm", "--scheduler", "tcp://localhost:1"), "contradict"),
        (("--scheduler", "tcp://localhost:1"), "pip install 'particlesim[cluster]'"),
    ):
        ended = psim("sweep", "tiny.toml", "--vary", "simulation.seed=1,2", *arguments)
        assert ended.code == 2
        assert message in ended.err
    assert not Path("outputs").exists()


LIGHT = """
[[checks]]
name = "light"
quantity = "kinetic"
max = 1.0
"""


def test_a_report_has_a_case_for_every_run(psim) -> None:
    Path("tiny.toml").write_text(TINY + LIGHT)
    options = ("--vary", "particles.balls.mass=0.001,-1,100", "-j", 1, "--junit", "report.xml")
    assert psim("sweep", "tiny.toml", *options).code == 2
    suite = ElementTree.parse("report.xml").getroot()
    counts = {key: suite.get(key) for key in ("name", "tests", "failures", "errors", "skipped")}
    assert counts == {"name": "tiny", "tests": "4", "failures": "1", "errors": "1", "skipped": "0"}
    assert [case.get("name") for case in suite] == [
        "sweep",
        *(f"run {k}: particles.balls.mass={mass}" for k, mass in ((1, "0.001"), (2, "-1"), (3, "100"))),
    ]
    assert [[problem.tag for problem in case] for case in suite] == [[], [], ["error"], ["failure"]]
    error, failure = suite.find("testcase/error"), suite.find("testcase/failure")
    assert (error.get("type"), failure.get("type")) == ("bad_scenario", "check_failed")
    assert "light is not" in failure.get("message")
    assert psim("sweep", "tiny.toml", *options).code == 2, "what is there already is told as well"
    assert ElementTree.parse("report.xml").getroot().get("tests") == "4"


def test_a_report_says_which_runs_were_not_done(psim) -> None:
    values = ("--vary", "particles.balls.mass=-1,0.1,0.2", "-j", 1, "--fail-fast")
    assert psim("sweep", "tiny.toml", *values, "--junit", "report.xml").code == 2
    suite = ElementTree.parse("report.xml").getroot()
    assert [[problem.tag for problem in case] for case in suite] == [[], ["error"], ["skipped"], ["skipped"]]


@pytest.mark.parametrize("values", ["simulation.dtt=1,2", "simulation.seed="])
def test_a_sweep_that_cannot_begin_is_an_error_in_the_report(psim, values: str) -> None:
    assert psim("sweep", "tiny.toml", "--vary", values, "--junit", "report.xml").code == 2
    suite = ElementTree.parse("report.xml").getroot()
    assert [(case.get("name"), case[0].tag) for case in suite] == [("sweep", "error")]


def test_a_sweep_that_is_stopped_is_an_error_in_the_report(psim, monkeypatch) -> None:
    from particlesim.errors import Interrupted
    from particlesim.sweep import task

    def stop(*_: object, **__: object) -> None:
        raise Interrupted("stopped at t = 0.05 s")

    monkeypatch.setattr(task, "run", stop)
    values = ("--vary", "particles.balls.mass=0.1,0.2", "-j", 1)
    assert psim("sweep", "tiny.toml", *values, "--junit", "report.xml").code == 130
    suite = ElementTree.parse("report.xml").getroot()
    assert [case[0].tag for case in suite] == ["error", "skipped", "skipped"]
    assert suite.find("testcase/error").get("type") == "Interrupted"


def test_a_report_is_not_put_into_the_folder_of_the_sweep(psim) -> None:
    values = ("--vary", "particles.balls.mass=0.1,0.2", "-o", "out", "--junit", "out/a/report.xml")
    ended = psim("sweep", "tiny.toml", *values)
    assert ended.code == 2
    assert "outside of it" in ended.err
    assert not Path("out").exists()
