"""`psim run` with checks: exit code, summary, JSON, JUnit."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from .conftest import TINY

CHECKS = """
[[checks]]
quantity = "count"
equals = 3

[[checks]]
name = "height"
quantity = "position.y"
statistic = "max"
max = 1.0
"""


def test_a_failed_check_ends_with_1(psim) -> None:
    Path("tiny.toml").write_text(TINY + CHECKS)
    ended = psim("run", "tiny.toml", "--junit", "report.xml")
    assert ended.code == 1
    assert "passed  count = 3: 3" in ended.err
    assert "FAILED  height ≤ 1:" in ended.err
    assert "check failed: height is not ≤ 1: 1.4" in ended.err
    assert ended.out.strip() == "outputs/tiny.vtkhdf"
    suite = ElementTree.parse("report.xml").getroot()
    assert {key: suite.get(key) for key in ("tests", "failures", "errors")} == {
        "tests": "3",
        "failures": "1",
        "errors": "0",
    }
    assert [case.get("name") for case in suite] == ["run", "count", "height"]
    assert [case.find("failure") is not None for case in suite] == [False, False, True]


def test_passed_checks_and_json(psim) -> None:
    Path("tiny.toml").write_text(TINY + CHECKS)
    ended = psim("run", "tiny.toml", "--json", "--set", "checks.height.max=2")
    assert ended.code == 0
    assert ended.json["exit_code"] == 0
    assert [check["passed"] for check in ended.json["checks"]] == [True, True]
    failed = psim("run", "tiny.toml", "--json", "--force")
    assert failed.code == failed.json["exit_code"] == 1


def test_quiet_says_what_failed(psim) -> None:
    Path("tiny.toml").write_text(TINY + CHECKS)
    ended = psim("run", "tiny.toml", "--quiet")
    assert ended.code == 1
    assert ended.err.startswith("check failed: height")
    assert ended.out == ""


def test_a_run_that_diverges_is_an_error_in_the_report(psim) -> None:
    field = '\n[[forces]]\ntype = "field"\nforce = ["1/(t - t)", "0", "0"]\n'
    Path("tiny.toml").write_text(TINY + CHECKS + field)
    ended = psim("run", "tiny.toml", "--junit", "report.xml")
    assert ended.code == 3
    suite = ElementTree.parse("report.xml").getroot()
    assert suite.get("errors") == "1"
    assert suite.find("testcase/error").get("type") == "DivergenceError"


def test_a_report_in_folders_that_are_made(psim) -> None:
    assert psim("run", "tiny.toml", "--junit", "new/deep/report.xml").code == 0
    assert ElementTree.parse("new/deep/report.xml").getroot().get("errors") == "0"
    assert [path.name for path in Path("new/deep").iterdir()] == ["report.xml"]


@pytest.mark.parametrize(
    "place", ["tiny.toml", "right.vtkhdf", "outputs/tiny.vtkhdf", "outputs/../outputs/tiny.vtkhdf"]
)
def test_a_report_takes_the_place_of_nothing_but_a_report(psim, place: str) -> None:
    psim("run", "tiny.toml", "-o", "right.vtkhdf")
    before = {path: path.read_bytes() for path in (Path("tiny.toml"), Path("right.vtkhdf"))}
    ended = psim("run", "tiny.toml", "--junit", place)
    assert ended.code == 2
    assert "--junit" in ended.err
    assert {path: path.read_bytes() for path in before} == before
    assert not Path("outputs").exists()


def test_a_report_takes_the_place_of_an_earlier_one_or_an_empty_file(psim) -> None:
    Path("report.xml").touch()
    for _ in range(2):
        assert psim("run", "tiny.toml", "--force", "--junit", "report.xml").code == 0
    assert ElementTree.parse("report.xml").getroot().get("errors") == "0"


@pytest.mark.parametrize("place", ["tiny.toml/report.xml", "folder"])
def test_a_report_that_cannot_be_written(psim, place: str) -> None:
    Path("folder").mkdir()
    ended = psim("run", "tiny.toml", "--junit", place)
    assert ended.code == 2
    assert place.partition("/")[0] in ended.err
    assert not Path("outputs").exists()


def test_bless(psim) -> None:
    reference = '\n[[checks]]\nquantity = "position"\nreference = "right.vtkhdf"\n'
    Path("tiny.toml").write_text(TINY + reference)
    missing = psim("run", "tiny.toml")
    assert missing.code == 2
    assert "psim run --bless" in missing.err
    blessed = psim("run", "tiny.toml", "--bless")
    assert blessed.code == 0
    assert "written: right.vtkhdf" in blessed.err.replace(str(Path().resolve()) + "/", "")
    assert psim("run", "tiny.toml", "--force").code == 0
    assert psim("run", "tiny.toml", "--force", "--set", "simulation.dt=0.005").code == 1


def test_inspect_shows_checks(psim) -> None:
    Path("tiny.toml").write_text(TINY + CHECKS)
    psim("run", "tiny.toml")
    shown = psim("inspect", "outputs/tiny.vtkhdf")
    assert "passed  count = 3: 3" in shown.out
    assert "FAILED  height ≤ 1:" in shown.out
    told = psim("inspect", "outputs/tiny.vtkhdf", "--json").json["summary"]["checks"]
    assert [(check["name"], check["passed"]) for check in told] == [("count", True), ("height", False)]


@pytest.mark.parametrize("broken", ["", "nonsense = 1"])
def test_a_bad_or_missing_scenario_is_an_error_in_the_report(psim, broken: str) -> None:
    if broken:
        Path("bad.toml").write_text(TINY + broken)
    Path("report.xml").write_text('<?xml version="1.0"?><testsuite name="of an earlier run"/>')
    assert psim("run", "bad.toml", "--junit", "report.xml").code == 2
    assert ElementTree.parse("report.xml").getroot().get("errors") == "1"
