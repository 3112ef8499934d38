"""`psim migrate`: rewrites what is old, leaves alone what is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from particlesim.scenario.text import migration
from particlesim.scenario.text.migration import Edit


def test_nothing_to_do(psim) -> None:
    before = Path("tiny.toml").read_bytes()
    ended = psim("migrate", "tiny.toml")
    assert ended.code == 0
    assert "nothing to do" in ended.err
    assert psim("migrate", "--check", "tiny.toml", "--json").json == [
        {"scenario": "tiny.toml", "format": 1, "current": 1, "exit_code": 0}
    ]
    assert Path("tiny.toml").read_bytes() == before


def test_what_cannot_be_migrated(psim) -> None:
    Path("newer.toml").write_text("format = 7\n")
    Path("broken.toml").write_text("format = 1\n[simulation]\n")
    for name in ("newer.toml", "broken.toml", "nothing.toml"):
        ended = psim("migrate", "tiny.toml", name)
        assert ended.code == 2
        assert "Traceback" not in ended.err


@pytest.fixture
def _version_0(monkeypatch) -> None:
    """As if there had been a version before the first, which called gravity gravitation."""

    def rename(source):
        yield Edit(source.place(("forces", 0, "type")).value, '"gravity"')

    monkeypatch.setitem(migration.MIGRATIONS, 0, rename)
    real = migration.format_of
    monkeypatch.setattr(
        migration,
        "format_of",
        lambda source: 0 if source.raw.get("format") == 0 else real(source),
    )


@pytest.mark.usefixtures("_version_0")
def test_an_old_file_is_rewritten(psim) -> None:
    old = Path("tiny.toml").read_text().replace("format = 1", "format = 0  # old")
    Path("tiny.toml").write_text(old.replace('"gravity"', '"gravitation"'))
    checked = psim("migrate", "--check", "tiny.toml")
    assert checked.code == 1
    assert "format 0" in checked.err
    assert "gravitation" in Path("tiny.toml").read_text()
    ended = psim("migrate", "tiny.toml")
    assert ended.code == 0
    assert ended.out.strip() == "tiny.toml"
    text = Path("tiny.toml").read_text()
    assert "format = 1  # old" in text
    assert text.replace("format = 1  # old", "format = 0  # old") == old
    assert psim("migrate", "--check", "tiny.toml").code == 0
