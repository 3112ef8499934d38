"""`psim run --video`: how large its pictures are, that they are those of `psim render`, and that a process makes them."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

import particlesim as ps
from particlesim.runs import filming
from particlesim.runs.filming import Filming, Video

from .conftest import LONG, TINY, files, start

UNSIZED = TINY.replace("size = [64, 48]", "")
SEEN_BEFORE = """[render]
bounds = [[-1, 0, -1], [1, 2, 1]]
trails = false
color_by = "none"
"""
FORESEEN = TINY.replace("[render]\n", SEEN_BEFORE)
TEARING = (
    TINY
    + """
[[springs]]
name = "links"
on = "balls"
pairs = [[0, 1], [1, 2]]
stiffness = 1
break_strain = 0.01
"""
)
ENDLESS = LONG + "speed = 1e4\n"
"""A long run whose video is short enough to be asked for."""


@pytest.fixture
def asked(monkeypatch):
    """The overrides that videos are asked for with; none is made."""
    from types import SimpleNamespace

    found: list[object] = []

    class Asked(Filming):
        def __init__(self, video: Video) -> None:
            found.append(video.overrides)
            super().__init__(Video(video.out, video.overrides, video.overwrite, threads=1))

    monkeypatch.setattr(filming, "Filming", Asked)
    monkeypatch.setattr("particlesim.render.film.film", lambda *_, **__: SimpleNamespace(warnings=()))
    return found


def test_a_video_is_small_unless_another_size_is_asked_for(psim, asked) -> None:
    assert psim("run", "tiny.toml", "--video").code == 0
    Path("tiny.toml").write_text(UNSIZED)
    assert psim("run", "tiny.toml", "--video", "--force").code == 0
    assert psim("run", "tiny.toml", "--video", "--force", "--set", "render.size=[1920, 1080]").code == 0
    assert asked == [{}, {"render.size": [1280, 720]}, {}]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("text", "options"),
    [(TINY, ()), (UNSIZED, ("--size", "1280x720")), (FORESEEN, ()), (TEARING, ())],
    ids=["of all frames", "of another size", "foreseen", "torn"],
)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_video_is_that_of_psim_render(psim, text: str, options: tuple[str, ...], threads: int) -> None:
    Path("tiny.toml").write_text(text)
    assert psim("run", "tiny.toml", "--video", "-o", "a.vtkhdf", "--threads", threads).code == 0
    assert psim("render", "a.vtkhdf", "-o", "b.mp4", *options).code == 0
    assert Path("a.mp4").read_bytes() == Path("b.mp4").read_bytes()


def test_pictures_are_drawn_before_the_run_ends(tmp_path) -> None:
    scenario = ps.loads(FORESEEN)
    path, out = tmp_path / "a.vtkhdf", tmp_path / "a.mp4"
    drawn: list[int] = []

    def progress(now: ps.Progress) -> None:
        video.begin(path)
        until = time.monotonic() + 60
        while now.step == scenario.grid.steps // 2 and not video.drawn and time.monotonic() < until:
            time.sleep(0.01)
            video.begin(path)
        drawn.append(video.drawn)

    with Filming(Video(out, {}, overwrite=False, threads=2)) as video:
        ps.run(scenario, path, progress=progress)
        video.finish(path, None)
    assert drawn[0] == 0 < drawn[-1]
    assert {each.name for each in tmp_path.iterdir()} == {"tiny.toml", "a.vtkhdf", "a.mp4"}


def begun() -> subprocess.Popen[str]:
    """A long run with a video, in a group of processes of its own, some time after its first frame."""
    Path("long.toml").write_text(ENDLESS)
    process = start("run", "long.toml", "--video", "--threads", 2, "--quiet", start_new_session=True)
    while not Path("outputs/long.vtkhdf").exists() and process.poll() is None:
        time.sleep(0.02)
    time.sleep(0.5)
    assert process.poll() is None
    return process


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupted_run_leaves_no_video() -> None:
    process = begun()
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in said
    assert "outputs/long.vtkhdf" in files()
    assert not [name for name in files() if "mp4" in name]


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_what_makes_the_video_ends_with_a_run_that_is_killed() -> None:
    process = begun()
    process.kill()
    process.communicate(timeout=60)
    until = time.monotonic() + 60
    while _has_processes(process.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert not _has_processes(process.pid)
    assert not [name for name in files() if "mp4" in name]


def _has_processes(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_video_that_cannot_follow_its_run_is_made_afterwards(tmp_path, monkeypatch) -> None:
    path, out = tmp_path / "a.vtkhdf", tmp_path / "a.mp4"
    with Filming(Video(out, {}, overwrite=False, threads=2)) as video:
        assert video._beside is not None
        video._beside._process.kill()
        ps.run(ps.loads(TINY), path, progress=lambda _: video.begin(path))
        assert video.finish(path, None).frames == 4
    assert out.exists()


def test_errors_of_videos_are_those_of_film(tmp_path) -> None:
    path = tmp_path / "a.vtkhdf"
    with Filming(
        Video(tmp_path / "a.mp4", {"render.color_by": "temperature"}, overwrite=False, threads=2)
    ) as video:
        ps.run(ps.loads(TINY), path, progress=lambda _: video.begin(path))
        with pytest.raises(ps.PsimError, match="temperature"):
            video.finish(path, None)
    assert not (tmp_path / "a.mp4").exists()
