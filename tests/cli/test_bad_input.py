"""Bad input: exit code 2, a message that names the mistake, no traceback, and nothing written."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from .conftest import TINY, files, real


def replaced(old: str, new: str) -> str:
    """The tiny scenario with one mistake."""
    assert old in TINY
    return TINY.replace(old, new)


EMITTER = """
[[emitters]]
rate = 1e308
limit = 10
shape = { type = "point", position = [0, 1, 0] }
"""

MISTAKES = {
    "rate beyond all numbers": (TINY + EMITTER, "1e+307 births in 0.1 s are more than a run can make"),
    "rate that a limit does not bound": (
        TINY + EMITTER.replace("1e308", "1e13"),
        "births between two frames",
    ),
    "burst that a limit does not bound": (
        TINY + EMITTER.replace("rate = 1e308", "burst = { count = 10_000_000_000, at = 0.07 }"),
        "births between two frames",
    ),
    "broken TOML": (replaced("[simulation]", "[simulation"), "bad.toml:4"),
    "escape sequence in a title": (replaced('"Tiny"', r'"a\u001b[2Jb"'), "a line of text without control"),
    "reversed writing in a description": (
        replaced('title = "Tiny"', r'description = "two\nlines\u202e"'),
        "text without control characters",
    ),
    "wrong type": (replaced("dt = 0.01", "dt = [1]"), "expected a duration"),
    "unknown key": (replaced("restitution", "restituton"), 'did you mean "restitution"?'),
    "misspelt force": (replaced('"gravity"', '"gravty"'), 'did you mean "gravity"?'),
    "NaN": (replaced("mass = 0.1", "mass = nan"), "must be finite"),
    "infinity": (replaced("duration = 0.1", "duration = inf"), "must be finite"),
    "negative mass": (replaced("mass = 0.1", "mass = -0.1"), "must be greater than 0"),
    "zero normal": (replaced("restitution = 0.5", "normal = [0, 0, 0]"), "a direction needs a finite length"),
    "zero dt": (replaced("dt = 0.01", "dt = 0"), "must be greater than 0"),
    "negative dt": (replaced("dt = 0.01", "dt = -0.01"), "must be greater than 0"),
    "duration not reached": (replaced("duration = 0.1", "duration = 0.123"), "not a whole number of steps"),
    "unknown group": (
        replaced('type = "gravity"', 'type = "gravity"\non = ["bals"]'),
        'did you mean "balls"?',
    ),
    "code in an expression": (
        TINY + '\n[[forces]]\ntype = "field"\nforce = ["__import__(\'os\').getpid()", "0", "0"]\n',
        "functions can be called",
    ),
    "odd video": (replaced("[64, 48]", "[65, 48]"), "multiple of 2"),
    "unknown color field": (replaced("size = [64, 48]", 'color_by = "sped"'), 'did you mean "speed"?'),
    "too many particles": (
        replaced(
            'layout = { type = "points", position = [[0, 1, 0], [0.5, 1, 0], [0, 1.5, 0.5]] }',
            'layout = { type = "random", count = 10_000_000_000, shape = { type = "ball", center = [0, 1, 0], '
            "radius = 1 } }",
        ),
        "of memory",
    ),
    "too many frames": (
        replaced("duration = 0.1", "duration = 1e9")
        .replace("fps = 20", "every = 1")
        .replace("dt = 0.01", "dt = 1e-4"),
        "frames",
    ),
    "missing particle file": (
        replaced(
            'layout = { type = "points", position = [[0, 1, 0], [0.5, 1, 0], [0, 1.5, 0.5]] }',
            'layout = { type = "file", path = "gone.csv" }',
        ),
        "gone.csv does not exist",
    ),
    "UTF-16": (TINY.encode("utf-16"), "UTF-8"),
}


def refused(ended, words: str) -> None:
    assert ended.code == 2, ended
    assert words in " ".join(ended.err.split()), ended.err
    assert "Traceback" not in ended.err
    assert not ended.out


@pytest.mark.parametrize("name", MISTAKES)
def test_bad_scenario(psim, name):
    text, words = MISTAKES[name]
    Path("bad.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    before = files()
    for command in (
        ("run",),
        ("run", "--video", "--force", "-o", "new/a.vtkhdf"),
        ("run", "--dry-run"),
        ("check",),
    ):
        refused(psim(*command, "bad.toml"), words)
    told = psim("run", "bad.toml", "--json")
    assert told.code == 2
    assert told.json["exit_code"] == 2
    assert not told.err
    assert words.split('"')[0] in str(told.json) or words == "bad.toml:4"
    assert files() == before


def test_unusable_paths(psim, tmp_path):
    with Path("huge.toml").open("wb") as file:
        file.truncate(100 << 20)
    Path("folder.toml").mkdir()
    before = files()
    refused(psim("run", "gone.toml"), "gone.toml does not exist")
    refused(psim("run", "tony.toml"), "did you mean tiny.toml?")
    refused(psim("run", "huge.toml"), "100 MiB")
    refused(psim("run", "folder.toml"), "is a directory")
    refused(psim("run", "tiny.toml", "-o", "folder.toml"), "is a folder")
    refused(psim("run", "tiny.toml", "-o", "tiny.toml/a.vtkhdf"), "is not a folder")
    refused(psim("run", "tiny.toml", "-o", "video.mp4"), "--video")
    refused(psim("run", "tiny.toml", "-o", "data.bin"), "data.vtkhdf")
    assert files() == before


def test_output_that_exists_is_kept(psim):
    Path("outputs").mkdir()
    Path("outputs/tiny.mp4").write_bytes(b"precious")
    before = files()
    refused(psim("run", "tiny.toml", "--video"), "outputs/tiny.mp4 exists")
    assert files() == before
    Path("outputs/tiny.vtkhdf").write_bytes(b"precious too")
    before = files()
    refused(psim("run", "tiny.toml"), "--force")
    assert files() == before
    assert psim("run", "tiny.toml", "--force").code == 0
    assert Path("outputs/tiny.vtkhdf").read_bytes()[:4] == b"\x89HDF"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_folder_that_may_not_be_written(psim):
    Path("locked").mkdir(mode=0o500)
    ended = psim("run", "tiny.toml", "-o", "locked/a.vtkhdf")
    assert ended.code == 4
    assert "cannot write into the folder locked" in ended.err


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc")
def test_folder_that_the_system_makes(psim):
    """Its permissions are no use to root, and it has no space: neither is the reason."""
    for place in (("-o", "/proc/a.vtkhdf"), ("--junit", "/proc/report.xml")):
        ended = psim("run", "tiny.toml", *place)
        assert ended.code == 4
        assert "cannot write into the folder /proc" in ended.err
    assert psim("sweep", "tiny.toml", "--vary", "simulation.dt=0.01", "-o", "/proc/sweep").code == 4
    assert not Path("outputs").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--threads", "0"), "greater than or equal to 1"),
        (("--set", "nonsense"), "not of the form key=value"),
        (("--set", "simulation.dt=soon"), "the value is not"),
        (("--set", "simulation.duraton=1"), "unknown key 'duraton'"),
        (("--set", "forces.wind.type=1"), "has no entry 'wind'"),
        (("--set", "particles.7.mass=1"), "particles"),
        (("--no-such-option",), "--no-such-option"),
        (("second.toml",), "second.toml"),
    ],
)
def test_bad_options(psim, arguments, words):
    before = files()
    ended = psim("run", "tiny.toml", *arguments)
    assert ended.code == 2
    assert words in " ".join(ended.err.replace("│", "").split())
    assert "Traceback" not in ended.err
    assert files() == before


def test_bad_usage_as_json(psim):
    told = psim("run", "tiny.toml", "--json", "--threads", "none").json
    assert told["exit_code"] == 2
    assert "--threads" in told["error"]


def test_bad_trajectories(psim):
    assert psim("run", "tiny.toml", "-q").code == 0
    good = Path("outputs/tiny.vtkhdf").read_bytes()
    Path("text.vtkhdf").write_text("no HDF5")
    Path("cut.vtkhdf").write_bytes(good[: len(good) // 2])
    Path("empty.vtkhdf").touch()
    Path("folder.vtkhdf").mkdir()
    before = files()
    for name, words in {
        "text": "is no HDF5 file",
        "cut": "is truncated",
        "empty": "is no HDF5 file",
        "folder": "is a folder",
        "gone": "there is no file gone.vtkhdf",
    }.items():
        for command in (
            ("inspect",),
            ("render",),
            ("plot", "energy"),
            ("export", "-o", "a.csv"),
            ("inspect", "--repair"),
        ):
            refused(psim(command[0], f"{name}.vtkhdf", *command[1:]), words)
    assert files() == before


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("render", "--size", "65x48"), "multiple of 2"),
        (("render", "--size", "big"), "Write it as --size 1280x720"),
        (("render", "--camera-eye", "1,2"), "Write it as --camera-eye 4,2,6"),
        (("render", "--look", "shiny"), '"dots", "spheres"'),
        (("render", "--color-by", "sped"), 'did you mean "speed"?'),
        (("render", "--color-by", "age"), "under [output]"),
        (("render", "--frames", "some"), "names no frames"),
        (("render", "--frames", "90:"), "no frame is chosen"),
        (("render", "--fps", "0"), "greater than 0"),
        (("render", "-o", "video.gif"), ".webp"),
        (("render", "-o", "recorded.vtkhdf/video.mp4"), "is not a folder"),
        (("plot", "enery"), "Did you mean 'energy'?"),
        (("plot", "x", "--ids", "one"), "Write them as --ids 0,5,7"),
        (("plot", "x", "--ids", "77"), "no particle has the id 77"),
        (("plot", "x", "--group", "bals"), "Did you mean 'balls'?"),
        (("plot", "x", "-o", "plot.bmp"), "unknown ending"),
        (("export", "-o", "data.xyz"), "unknown ending"),
        (("export", "-o", "data.csv", "--fields", "velocty"), "Did you mean 'velocity'?"),
    ],
)
def test_bad_requests(psim, recorded, command, words):
    before = files()
    refused(psim(command[0], recorded, *command[1:]), words)
    assert files() == before


def test_others(psim):
    before = files()
    refused(psim("new", "tiny"), "tiny.toml exists")
    refused(psim("new", "other", "--template", "emiter"), 'did you mean "emitter"?')
    refused(psim("examples", "fountan"), 'did you mean "fountain"?')
    refused(psim("describe", "gravty"), 'did you mean "gravity"?')
    refused(psim("schema", "-o", "tiny.toml"), "tiny.toml exists")
    assert files() == before


def test_check_tells_of_all_scenarios(psim):
    Path("bad.toml").write_text(MISTAKES["negative mass"][0])
    ended = psim("check", "bad.toml", "tiny.toml", "gone.toml")
    assert ended.code == 2
    assert "must be greater than 0" in ended.err
    assert "gone.toml does not exist" in ended.err
    assert "tiny.toml · Tiny" in ended.out
    codes = [
        entry["exit_code"] for entry in psim("check", "bad.toml", "tiny.toml", "gone.toml", "--json").json
    ]
    assert codes == [2, 0, 2]


def test_in_a_process_of_its_own():
    Path("bad.toml").write_text(MISTAKES["misspelt force"][0])
    before = files()
    refused(real("run", "bad.toml"), 'did you mean "gravity"?')
    assert files() == before


def test_a_bug_shows_where_it_is(psim, monkeypatch):
    import particlesim as ps

    def broken(*_, **__):
        raise ZeroDivisionError("by mistake")

    monkeypatch.setattr(ps, "load", broken)
    ended = psim("run", "tiny.toml")
    assert ended.code == 70
    assert "Traceback" in ended.err
    assert "please report it" in ended.err


def test_debugging_shows_tracebacks(psim, monkeypatch):
    monkeypatch.setenv("PSIM_DEBUG", "1")
    assert "Traceback" in psim("run", "gone.toml").err


def test_out_of_memory_is_told(psim, monkeypatch):
    import particlesim as ps

    def greedy(*_, **__):
        raise MemoryError("Unable to allocate 1 TiB")

    monkeypatch.setattr(ps, "run", greedy)
    ended = psim("run", "tiny.toml")
    assert ended.code == 4
    assert "out of memory: Unable to allocate 1 TiB" in ended.err
    assert "Traceback" not in ended.err


if sys.platform == "win32":
    pytest.skip("paths are compared with slashes", allow_module_level=True)
