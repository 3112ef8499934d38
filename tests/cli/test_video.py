"""`psim run --video`: the size of its pictures, and that they are those of `psim render`."""

from __future__ import annotations

from pathlib import Path

import pytest

from .conftest import TINY

UNSIZED = TINY.replace("size = [64, 48]", "")


@pytest.fixture
def asked(monkeypatch):
    """The overrides that videos are asked for with; none is made."""
    from types import SimpleNamespace

    import particlesim as ps

    found: list[object] = []

    def film(path, out, overrides=(), **_):
        found.append(overrides)
        return SimpleNamespace(warnings=())

    monkeypatch.setattr(ps, "film", film)
    return found


def test_a_video_is_small_unless_another_size_is_asked_for(psim, asked) -> None:
    assert psim("run", "tiny.toml", "--video").code == 0
    Path("tiny.toml").write_text(UNSIZED)
    assert psim("run", "tiny.toml", "--video", "--force").code == 0
    assert psim("run", "tiny.toml", "--video", "--force", "--set", "render.size=[1920, 1080]").code == 0
    assert asked == [{}, {"render.size": [1280, 720]}, {}]


@pytest.mark.parametrize(("text", "size"), [(TINY, ()), (UNSIZED, ("--size", "1280x720"))])
def test_a_video_is_that_of_psim_render(psim, text: str, size: tuple[str, ...]) -> None:
    Path("tiny.toml").write_text(text)
    assert psim("run", "tiny.toml", "--video", "-o", "a.vtkhdf").code == 0
    assert psim("render", "a.vtkhdf", "-o", "b.mp4", *size).code == 0
    assert Path("a.mp4").read_bytes() == Path("b.mp4").read_bytes()
