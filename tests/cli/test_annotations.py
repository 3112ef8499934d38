"""Annotations of GitHub Actions, and the workflow that users copy."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from .conftest import REPOSITORY, TINY

CHECK = '\n[[checks]]\nname = "height"\nquantity = "position.y"\nstatistic = "max"\nmax = 1.0\n'


@pytest.fixture
def _on_github(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path))


def annotations(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith("::")]


def test_nothing_elsewhere(psim, monkeypatch) -> None:
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    assert not annotations(psim("run", "nothing.toml").err)


@pytest.mark.usefixtures("_on_github")
def test_mistakes_have_their_places(psim, tmp_path) -> None:
    Path("tiny.toml").write_text(TINY.replace("duration = 0.1", "duration = -1"))
    (told,) = annotations(psim("check", str(tmp_path / "tiny.toml")).err)
    assert told.startswith("::error file=tiny.toml,line=5,col=12::must be greater than 0, got -1%0Aallowed")
    ended = psim("run", "no,such:file.toml", "--json")
    (told,) = annotations(ended.err)
    assert told.startswith("::error::no,such:file.toml does not exist")
    assert ended.json["exit_code"] == 2


@pytest.mark.usefixtures("_on_github")
def test_failed_checks_have_theirs(psim) -> None:
    Path("tiny.toml").write_text(TINY + CHECK)
    ended = psim("run", "tiny.toml", "--quiet")
    assert ended.code == 1
    (told,) = annotations(ended.err)
    line = TINY.count("\n") + 2
    assert told.startswith(f"::error file=tiny.toml,line={line}::check failed: height is not ≤ 1:")


@pytest.mark.usefixtures("_on_github")
def test_failed_runs_of_a_sweep(psim) -> None:
    ended = psim("sweep", "tiny.toml", "--vary", "particles.balls.mass=0.1,-1", "-j", 1)
    (told,) = annotations(ended.err)
    assert told.startswith("::error file=tiny.toml::bad_scenario: run 2 (particles.balls.mass=-1)")


def test_the_workflow_calls_commands_that_exist() -> None:
    from typer.main import get_command

    from psim.app import app

    known = get_command(app).commands
    text = (REPOSITORY / "docs/github-workflow.yml").read_text()
    lines = re.findall(r"^ +(psim .*)$", text, re.MULTILINE)
    assert len(lines) >= 5
    for line in lines:
        name, *words = shlex.split(line)[1:]
        options = {option for parameter in known[name].params for option in parameter.opts}
        for word in words:
            assert not re.match(r"-{1,2}[a-z]", word) or word in options, line
    assert (REPOSITORY / "scenarios/fountain.toml").exists()
