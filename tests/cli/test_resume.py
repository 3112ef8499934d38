"""`psim run --resume` and `--max-wall`: stop in order, go on, and say why not."""

from pathlib import Path

import pytest

from .conftest import TINY, files


def test_stopped_and_resumed(psim):
    stopped = psim("run", "tiny.toml", "-o", "a.vtkhdf", "--max-wall", "1e-6s", "--checkpoint-every", "0.02")
    assert stopped.code == 130
    assert "as asked" in stopped.err
    assert "--resume continues from there" in " ".join(stopped.err.split())
    assert Path("a.vtkhdf.checkpoint").exists()
    refused = psim("run", "tiny.toml", "-o", "a.vtkhdf", "--resume", "--set", "simulation.dt=0.005")
    assert refused.code == 2
    assert "simulation.dt: 0.01 → 0.005" in " ".join(refused.err.split())
    assert psim("run", "tiny.toml", "-o", "a.vtkhdf", "--resume").code == 0
    assert not Path("a.vtkhdf.checkpoint").exists()
    whole = psim("run", "tiny.toml", "-o", "whole.vtkhdf", "--json")
    again = psim("run", "tiny.toml", "-o", "a.vtkhdf", "--resume", "--json")
    assert again.code == 0
    assert "nothing was left to do" in again.json["warnings"][0]
    for same in ("state", "steps", "particle_steps", "frames", "particles", "energy"):
        assert again.json[same] == whole.json[same]
    assert psim("diff", "a.vtkhdf", "whole.vtkhdf").code == 0


@pytest.mark.parametrize("text", ["soon", "0", "-5", "10 parsecs", "1e999", ""])
def test_times_that_are_none(psim, text):
    before = files()
    for option in ("--max-wall", "--checkpoint-wall", "--checkpoint-every"):
        ended = psim("run", "tiny.toml", f"{option}={text}")
        assert ended.code == 2
        assert "is not a time" in ended.err
    assert files() == before


def test_names_that_are_too_long_are_refused_before_anything_is_computed(psim):
    before = files()
    ended = psim("run", "tiny.toml", "-o", "n" * 300 + ".vtkhdf")
    assert ended.code == 2
    assert "too long" in ended.err
    assert files() == before


def test_a_run_that_diverged_is_said_to_have_diverged(psim):
    field = '\n[[forces]]\ntype = "field"\nforce = ["1/(t - t)", "0", "0"]\n'
    Path("tiny.toml").write_text(TINY + field)
    for option in ((), ("--resume",)):
        ended = psim("run", "tiny.toml", *option)
        assert ended.code == 3
    assert "diverged, and would do so again" in ended.err
    assert "--force" in ended.err
