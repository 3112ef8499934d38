"""`psim run`: what it writes and says, and how it ends when something happens on the way."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import particlesim as ps
from particlesim.preflight import resources as bounds

from .conftest import LONG, TINY, Ended, environment, files, start

TABLE = (
    "Tiny",
    "3 placed, 3 alive",
    "0.1 s in 10 steps of 0.01 s",
    "3 frames",
    "particle-steps/s",
    "J →",
    "kg m/s",
)


def test_run_writes_the_default_output_and_tells(psim):
    ended = psim("run", "tiny.toml")
    assert ended.code == 0
    assert ended.out == "outputs/tiny.vtkhdf\n"
    for words in TABLE:
        assert words in ended.err
    assert "\x1b" not in ended.err
    assert set(files()) == {"tiny.toml", "outputs", "outputs/tiny.vtkhdf"}
    with ps.open("outputs/tiny.vtkhdf") as trajectory:
        assert trajectory.status == "complete"
        assert len(trajectory) == 3
        # Free fall from rest at (0, 1, 0): symplectic Euler is g dt t / 2 below the parabola.
        assert trajectory[-1].position[0, 1] == pytest.approx(1 - 9.80665 * 0.1 * (0.1 + 0.01) / 2, rel=1e-6)


def test_set_and_threads(psim):
    arguments = (
        "--set",
        "simulation.dt=5e-3",
        "--set",
        "particles.balls.mass=2",
        "-j",
        "1",
        "-o",
        "deep/er/a.vtkhdf",
    )
    ended = psim("run", "tiny.toml", *arguments)
    assert ended.code == 0
    assert "20 steps of 0.005 s" in ended.err
    with ps.open("deep/er/a.vtkhdf") as trajectory:
        assert trajectory.provenance["overrides"] == "simulation.dt=5e-3\nparticles.balls.mass=2"


def test_quiet_says_nothing(psim):
    assert psim("run", "tiny.toml", "--quiet") == Ended(0, "", "")


def test_json_summary(psim):
    ended = psim("run", "tiny.toml", "--json")
    assert ended.err == ""
    told = ended.json
    assert told["particles"] == {"placed": 3, "born": 0, "died": {}, "alive": 3}
    assert (told["steps"], told["frames"], told["dt"], told["exit_code"]) == (10, 3, 0.01, 0)
    assert told["bytes"] == Path(told["trajectory"]).stat().st_size
    # Σ m g y of the three balls, at rest
    assert told["energy"]["first"] == pytest.approx(0.1 * 9.80665 * 3.5)
    # Σ m g t downwards
    assert told["momentum"]["last"][1] == pytest.approx(-3 * 0.1 * 9.80665 * 0.1)


def test_video(psim):
    ended = psim("run", "tiny.toml", "--video")
    assert ended.code == 0, ended.err
    assert ended.out == "outputs/tiny.vtkhdf\noutputs/tiny.mp4\n"
    assert Path("outputs/tiny.mp4").read_bytes()[4:8] == b"ftyp"


def test_dry_run_writes_nothing(psim):
    before = files()
    ended = psim("run", "tiny.toml", "--dry-run", "-o", "new/a.vtkhdf")
    assert ended.code == 0
    for words in (
        "at most 3 at once",
        "10 of 0.01 s",
        "3 with position, id, velocity, radius",
        "new/a.vtkhdf",
    ):
        assert words in ended.out
    told = psim("run", "tiny.toml", "--dry-run", "--json").json
    assert told["steps"] == 10
    assert 0 < told["seconds"] < 60
    assert "of stepping" in psim("run", "tiny.toml", "--dry-run").out
    assert files() == before


@pytest.mark.slow  # bounds of the steepness of so many pairs take long with quick kernels
def test_a_dry_run_of_too_many_pairs_tries_none(psim):
    Path("many.toml").write_text(
        '[simulation]\nduration = 1.0\ndt = 0.01\n\n[[particles]]\nmass = 1.0\nlayout = { type = "random", count = 100000, '
        'shape = { type = "ball", radius = 1.0 } }\n\n[[interactions]]\ntype = "gravity"\nconstant = 1.0\nsoftening = 0.1\n'
        'method = "direct"\n'
    )
    told = psim("run", "many.toml", "--dry-run", "--json", "--threads", "1").json
    assert told["seconds"] == pytest.approx(100 * 10, rel=0.01)  # 1e10 pairs at 1e9 a second, 100 times


def test_shortened_step_is_told(psim):
    ended = psim("run", "tiny.toml", "--set", "simulation.dt=0.012", "--dry-run")
    assert "10 of 0.01 s (dt = 0.012 s is shortened" in ended.out
    assert "shortened from 0.012 s" in psim("run", "tiny.toml", "--set", "simulation.dt=0.012").err


def test_warnings_are_shown(psim, monkeypatch):
    from particlesim.compiler import store

    monkeypatch.setattr(store, "problem", "kernels are compiled anew in every process")
    ended = psim("run", "tiny.toml")
    assert ended.code == 0
    assert "warning: kernels are compiled anew" in ended.err
    assert psim("run", "tiny.toml", "-f", "--json").json["warnings"] == [store.problem]


def test_doubts_are_told_before_the_run_and_once(psim, monkeypatch):
    import particlesim as ps

    told, begun = [], []
    true_run = ps.run

    def run(*args, **options):
        shown = options["warn"]
        options["warn"] = lambda text: (told.append((text, bool(begun))), shown(text))
        options["progress"] = lambda now: begun.append(now)
        return true_run(*args, **options)

    monkeypatch.setattr(ps, "run", run)
    doubtful = ("--set", "planes.0.friction={static=0.1, kinetic=0.2}")
    ended = psim("run", "tiny.toml", *doubtful)
    assert ended.code == 0
    assert [late for text, late in told if "kinetic" in text] == [False]
    assert ended.err.count(told[0][0][:40]) == 1


def test_divergence_keeps_what_was_computed(psim):
    # Speeds grow by 10³⁰⁶ m/s in a step, and pass the largest number (1.8 · 10³⁰⁸) after 1.8 s; energies pass it at once,
    # and without a ledger the speeds themselves are found absurd at the next frame, if there is one before they overflow.
    strong = ("--set", "forces.gravity.acceleration=[0, 1e308, 0]", "--set", "simulation.duration=5")
    ended = psim("run", "tiny.toml", *strong, "-o", "energy.vtkhdf")
    assert ended.code == 3
    assert "the ledger's kinetic is no longer finite at t = 0.05 s; particle 0 of 'balls' was at" in ended.err
    wild = (*strong, "--set", "output.ledger=false")
    ended = psim("run", "tiny.toml", *wild, "-o", "speed.vtkhdf")
    assert ended.code == 3
    assert "speeds in 'balls' had grown a thousandfold" in ended.err
    wild = (*wild, "--set", "output.fps=0.4")
    ended = psim("run", "tiny.toml", *wild)
    assert ended.code == 3, ended
    assert "no longer finite" in ended.err
    assert "try a smaller step" in ended.err
    assert "outputs/tiny.vtkhdf" in ended.err
    assert "Traceback" not in ended.err
    with ps.open("outputs/tiny.vtkhdf") as trajectory:
        assert trajectory.status == "diverged"
        assert len(trajectory) == 1
        assert trajectory[0].position.shape == (3, 3)
    assert psim("run", "tiny.toml", "--force", "--json", *wild).json["exit_code"] == 3


def stopped_after_some_frames(number: int, **options) -> Ended:
    """Send a signal to a long run that has written frames."""
    Path("long.toml").write_text(LONG)
    process = start("run", "long.toml", **options)
    deadline = time.monotonic() + 40
    while time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.05)
        if Path("outputs/long.vtkhdf").exists():
            with ps.open("outputs/long.vtkhdf") as trajectory:
                if len(trajectory) > 5:
                    break
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    return Ended(process.returncode, out, err)


@pytest.mark.sampled(2)
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_interrupted_run_keeps_its_frames(name):
    ended = stopped_after_some_frames(getattr(signal, name))
    assert ended.code == 130, ended
    assert re.search(r"interrupted: stopped at t = .* s of 1000000 s", ended.err)
    assert "outputs/long.vtkhdf" in ended.err
    assert "Traceback" not in ended.err
    with ps.open("outputs/long.vtkhdf") as trajectory:
        assert trajectory.status == "interrupted"
        assert len(trajectory) > 5
        assert len(trajectory[-1].position) == 3


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_killed_run_keeps_its_frames(psim):
    ended = stopped_after_some_frames(signal.SIGKILL)
    assert ended.code == -signal.SIGKILL
    told = psim("inspect", "outputs/long.vtkhdf")
    assert told.code == 0
    assert re.search(r"status +interrupted", told.out)
    assert "psim inspect --repair outputs/long.vtkhdf" in told.err
    assert psim("inspect", "--repair", "outputs/long.vtkhdf").err == "repaired\n"
    assert psim("inspect", "--repair", "outputs/long.vtkhdf").err == "nothing to repair\n"
    assert psim("render", "outputs/long.vtkhdf", "--frames", "0:2").code == 0


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_interrupted_rendering_leaves_nothing(psim, monkeypatch):
    from particlesim.render.renderer import Renderer

    draw = Renderer.draw
    drawn = []

    def interrupt(self, *arguments):
        drawn.append(True)
        if len(drawn) == 2:
            raise KeyboardInterrupt
        return draw(self, *arguments)

    monkeypatch.setattr(Renderer, "draw", interrupt)
    ended = psim("run", "tiny.toml", "--video", "--threads", 1)
    assert ended.code == 130
    assert "interrupted: stopped while the video was made" in ended.err
    assert "outputs/tiny.vtkhdf is complete; its video: psim render outputs/tiny.vtkhdf\n" in ended.err
    assert set(files()) == {"tiny.toml", "outputs", "outputs/tiny.vtkhdf"}
    monkeypatch.setattr(Renderer, "draw", draw)
    assert psim("render", "outputs/tiny.vtkhdf").code == 0


def test_reader_that_goes_away_is_no_mistake():
    process = subprocess.run(
        f"{sys.executable} -m psim schema | head -1",
        shell=True,
        capture_output=True,
        text=True,
        env=environment(),
        check=True,
    )
    assert process.stdout == "{\n"
    assert process.stderr == ""


def test_terminal_shows_progress_and_colors():
    pty = pytest.importorskip("pty")
    Path("longer.toml").write_text(TINY.replace("duration = 0.1", "duration = 20.0"))
    main, other = pty.openpty()
    options = {
        "stderr": other,
        "env": {**environment(), "TERM": "xterm-256color", "NO_COLOR": "", "COLUMNS": "120"},
    }
    process = start("run", "longer.toml", **options)
    os.close(other)
    seen = b""
    while True:
        try:
            piece = os.read(main, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        seen += piece
    os.close(main)
    assert process.wait(timeout=30) == 0
    process.communicate()
    text = seen.decode()
    assert "3 particles" in text
    assert "%" in text
    assert "\x1b[1mTiny" in text  # the summary's heading, bold


def test_compiling_is_no_part_of_the_speed():
    # 40 s of 50 s go into compiling: the other ten make 100 steps of 7 particles, and 100 more are to come.
    from particlesim.runs.result import Progress
    from psim.progress import _Speed
    from psim.summary import _took

    speed = _Speed()
    assert speed.of(Progress(10, 210, 0.1, 7, 70, 3.0, 2, 2.0)) == ""
    now = Progress(110, 210, 1.1, 7, 770, 53.0, 12, 42.0)
    assert speed.of(now) == "70 particle-steps/s"
    assert speed.left(now) == pytest.approx(10.0)
    told = {"seconds": 53.0, "compiling": 42.0, "particle_steps_per_second": 70.0}
    assert _took(told) == "53.0 s, 42.0 s of them for compiling kernels, which are kept, 70 particle-steps/s"


def test_what_cannot_fit_by_its_bounds_is_run_if_told_so(psim, monkeypatch):
    monkeypatch.setattr(bounds, "FILE_BYTES", 1e18)
    refused = psim("run", "tiny.toml")
    assert refused.code == 2
    assert "--yes" in refused.err
    assert psim("run", "tiny.toml", "--force", "--dry-run").code == 2
    assert psim("run", "tiny.toml", "--yes", "--dry-run").code == 0
    assert psim("run", "tiny.toml", "--yes").code == 0
