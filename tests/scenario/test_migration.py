"""Old formats are read and rewritten, new ones refused; scenarios of version 1 stay readable for ever."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import particlesim as ps
from particlesim.errors import ScenarioError
from particlesim.preflight.advice import advice
from particlesim.scenario.dump import to_table
from particlesim.scenario.text import migration
from particlesim.scenario.text.migration import Edit, format_of, migrated
from particlesim.scenario.text.source import Source, parse_source, read_source

FROZEN = sorted((Path(__file__).parents[1] / "data/format1").glob("*.toml"))


def test_there_are_frozen_scenarios() -> None:
    assert len(FROZEN) >= 10


@pytest.mark.parametrize("path", FROZEN, ids=lambda path: path.stem)
def test_version_1_says_what_it_said(path: Path) -> None:
    """Every number, truth value and list of numbers of the file is in the scenario, under the same name."""
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    assert raw["format"] == 1
    held(raw, to_table(migrated_scenario(path), defaults=True), "")


def migrated_scenario(path: Path) -> ps.Scenario:
    scenario = ps.load(path)
    assert scenario.written_format == 1
    return scenario


def held(raw: Any, loaded: Any, place: str) -> None:
    if isinstance(raw, dict) and isinstance(loaded, dict):
        for key, value in raw.items():
            assert key in loaded, f"{place}.{key}"
            held(value, loaded[key], f"{place}.{key}")
    elif isinstance(raw, list) and isinstance(loaded, list):
        assert len(raw) == len(loaded), place
        for k, (a, b) in enumerate(zip(raw, loaded, strict=True)):
            held(a, b, f"{place}.{k}")
    elif isinstance(raw, int | float) and isinstance(loaded, int | float) and place != ".format":
        assert raw == loaded, place


OLD = """\
#:schema ./psim.schema.json
# a comment
title = "Old"  # kept

[simulation]
length = 2.0   # the duration of old
dt = 0.01

[[particles]]
layout = { type = "points", position = [[0, 0, 0]] }
"""


@pytest.fixture
def _version_2(monkeypatch) -> None:
    """As if this psim read version 2, in which `length` of version 1 is called `duration`."""

    def rename(source: Source) -> Iterator[Edit]:
        place = source.place(("simulation", "length"))
        if place is not None and place.key is not None:
            yield Edit(place.key, "duration")

    monkeypatch.setattr(migration, "CURRENT", 2)
    monkeypatch.setitem(migration.MIGRATIONS, 1, rename)


@pytest.mark.usefixtures("_version_2")
@pytest.mark.parametrize("head", ["", "format = 1\n"])
def test_edits_keep_comments_and_order(head: str) -> None:
    new = migrated(parse_source(head + OLD))
    assert new.raw["format"] == 2
    assert "duration = 2.0   # the duration of old" in new.main.text
    kept = [line for line in new.main.text.splitlines() if not line.startswith("format")]
    assert kept == OLD.replace("length", "duration").splitlines()
    assert new.main.text.startswith("format = 2\n" if head else "#:schema")
    assert migrated(new) is new


@pytest.mark.usefixtures("_version_2")
def test_tables_without_a_text() -> None:
    new = migrated(Source(tomllib.loads(OLD), parse_source("").main))
    assert new.raw["simulation"] == {"duration": 2.0, "dt": 0.01}


@pytest.mark.parametrize("version", [2, 99])
def test_a_newer_format_is_refused(version: int, tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    path.write_text(f"title = 'x'\nformat = {version}\n[future]\n")
    with pytest.raises(ScenarioError) as caught:
        ps.load(path)
    (told,) = caught.value.diagnostics
    assert told.message == f"format {version} is newer than this psim, which reads up to 1"
    assert told.span is not None
    assert (told.span.line, told.span.column) == (2, 10)
    assert told.hint is not None
    assert "newer particlesim" in told.hint


@pytest.mark.parametrize("version", ["0", "-1", "'1'", "true", "1.5"])
def test_what_is_no_version(version: str) -> None:
    with pytest.raises(ScenarioError, match="format"):
        ps.loads(f"format = {version}\n{OLD.replace('length', 'duration')}")


def test_an_old_format_is_told_of() -> None:
    scenario = ps.loads(OLD.replace("length", "duration"))
    assert not advice(scenario)
    old = scenario.loaded_from(None, (), None, 0)
    assert "psim migrate" in advice(old)[0]


def test_the_current_format_is_left_alone() -> None:
    for path in FROZEN:
        source = read_source(path)
        if format_of(source) == migration.CURRENT:
            assert migrated(source) is source
