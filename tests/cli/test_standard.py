"""Standard streams that are closed, full or gone: never a traceback, and the exit code tells how it ended."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from .conftest import REPOSITORY, TINY, Ended, environment

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux has devices that refuse")


def shell(command: str, **environ: str) -> Ended:
    """A command line of the shell, with `psim` for the command."""
    command = command.replace("psim ", f"'{sys.executable}' -m psim ")
    done = subprocess.run(
        command, shell=True, capture_output=True, text=True, timeout=60, env=environment() | environ
    )
    assert "Traceback" not in done.stderr, done.stderr
    assert "Exception ignored" not in done.stderr, done.stderr
    return Ended(done.returncode, done.stdout, done.stderr)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("command", ["--version", "--help", "describe rk4", "check tiny.toml --json"])
@pytest.mark.parametrize(
    ("where", "reason"), [(">&-", "Bad file descriptor"), (">/dev/full", "No space left on device")]
)
def test_data_that_cannot_be_written_is_an_error(command, where, reason):
    ended = shell(f"psim {command} {where}")
    assert ended.code == 4
    assert f"error: standard output: {reason}" in ended.err


@pytest.mark.sampled(2)
@pytest.mark.parametrize("where", ["2>&-", "2>/dev/full"])
def test_talk_that_nobody_hears_is_none(where):
    # With stderr closed its number must not go to the trajectory, where talk would then be written.
    assert shell(f"psim run tiny.toml {where}") == Ended(0, "outputs/tiny.vtkhdf\n", "")
    assert (
        "nothing else" in shell("psim inspect outputs/tiny.vtkhdf --json >/dev/null; echo nothing else").out
    )
    assert shell(f"psim check gone.toml {where}").code == 2
    assert shell(f"psim run --nonsense {where}").code == 2


def test_all_streams_closed():
    assert shell("psim run tiny.toml <&- >&- 2>&-").code == 4
    assert Path("outputs/tiny.vtkhdf").read_bytes()[:4] == b"\x89HDF"
    assert shell("psim inspect outputs/tiny.vtkhdf").code == 0


@pytest.mark.slow
def test_a_reader_that_goes_away():
    Path("bad.toml").write_text(TINY.replace('"gravity"', '"gravty"'))
    for command, code in {"schema": 0, "--help": 0, "check tiny.toml bad.toml": 2}.items():
        ended = shell(f"( psim {command}; echo code $? >&2 ) | true")
        assert f"code {code}" in ended.err
        assert "Broken pipe" not in ended.err


def test_an_encoding_without_the_characters():
    ended = shell("psim describe drag", PYTHONIOENCODING="ascii")
    assert ended.code == 0
    assert "drag" in ended.out


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_while_the_command_is_still_being_imported(tmp_path, name):
    (tmp_path / "early").mkdir()
    (tmp_path / "early/typer.py").write_text(
        f"import os, signal, time\nos.kill(os.getpid(), signal.{name})\ntime.sleep(9)\n"
    )
    path = os.pathsep.join(map(str, (tmp_path / "early", REPOSITORY, REPOSITORY / "cli")))
    assert shell("psim --help", PYTHONPATH=path) == Ended(130, "", "")


def test_names_of_files_do_not_reach_the_terminal_as_commands(psim):
    name = "a\x1b[2J\x1b]0;title\x07\u202eb"
    Path(f"{name}.toml").write_text(TINY)
    Path(f"{name}.junk.toml").write_text(TINY.replace("restitution", "restituton"))
    for ended in (
        psim("check", f"{name}.toml"),
        psim("check", f"{name}.junk.toml", "gone.toml"),
        psim("run", f"{name}.toml", "--junit", "report.xml", "-o", f"{name}.vtkhdf"),
        psim("inspect", f"{name}.vtkhdf"),
        psim("render", f"gone{name}.vtkhdf"),
    ):
        shown = (ended.out + ended.err).replace(
            f"{name}.vtkhdf\n", ""
        )  # the data of `psim run`: a path for programs
        assert "\x1b" not in shown
        assert "\x07" not in shown
        assert "\u202e" not in shown
    ElementTree.parse("report.xml")  # XML has no control characters
