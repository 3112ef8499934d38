"""The front door: what `import particlesim as ps` offers, and what it says to arguments of the wrong kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import particlesim as ps

TEXT = """\
simulation = { duration = 1, dt = 0.5 }
particles = [{ name = "ball", layout = { type = "points", position = [[0, 1, 0]] } }]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "ball.toml"
    path.write_text(TEXT)
    return path


def test_dir_shows_what_is_for_users() -> None:
    assert dir(ps) == sorted(ps.__all__)
    assert all(getattr(ps, name) is not None for name in dir(ps))


def test_run_takes_a_path(file: Path, tmp_path: Path) -> None:
    result = ps.run(str(file), tmp_path / "ball.vtkhdf", threads=np.int64(1))
    assert result.scenario == ps.load(file)
    assert repr(result) == f"<Result: 3 frames in '{tmp_path}/ball.vtkhdf', to t = 1 s>"
    assert repr(ps.run(file)) == "<Result: 3 frames, to t = 1 s>"


def test_arguments_of_the_wrong_kind(file: Path) -> None:
    scenario = ps.load(file)
    for wrong in (
        lambda: ps.run({"simulation": {}}),  # type: ignore[arg-type]
        lambda: ps.load(3),  # type: ignore[arg-type]
        lambda: ps.loads(file),  # type: ignore[arg-type]
        lambda: ps.from_table("simulation"),  # type: ignore[arg-type]
        lambda: ps.load(file, [3]),  # type: ignore[list-item]
        lambda: ps.load(file, {3: 4}),  # type: ignore[dict-item]
        lambda: ps.load(file, 3),  # type: ignore[arg-type]
        lambda: ps.run(scenario, threads="a"),  # type: ignore[arg-type]
        lambda: ps.run(scenario, threads=1.5),  # type: ignore[arg-type]
        lambda: ps.run(scenario, threads=True),
    ):
        with pytest.raises(TypeError, match=r"takes|are a dict|whole number"):
            wrong()
    with pytest.raises(ps.UsageError, match="1 or more, got 0"):
        ps.run(scenario, threads=0)


def test_one_override_may_stand_alone(file: Path) -> None:
    assert ps.load(file, "simulation.dt=0.25").simulation.dt == 0.25


def test_a_trajectory_has_the_ending_of_one(file: Path, tmp_path: Path) -> None:
    with pytest.raises(ps.UsageError, match=r"x\.txt does not have the ending(.|\n)*x\.vtkhdf"):
        ps.run(file, tmp_path / "x.txt")
    assert not (tmp_path / "x.txt").exists()


def test_an_output_that_exists_is_told_in_the_words_of_python(file: Path, tmp_path: Path) -> None:
    (tmp_path / "a.vtkhdf").touch()
    with pytest.raises(ps.UsageError) as caught:
        ps.run(file, tmp_path / "a.vtkhdf")
    assert "overwrite=True" in str(caught.value)
    assert "--" not in str(caught.value)


def test_scenarios_are_equal_when_they_say_the_same(file: Path, tmp_path: Path) -> None:
    other = tmp_path / "elsewhere" / "ball.toml"
    other.parent.mkdir()
    other.write_text(f"# the same\n{TEXT}")
    same = ps.load(file)
    assert same == ps.load(other)
    assert same == ps.loads(TEXT)
    assert same == ps.loads(TEXT.replace("0.5", "0.25"), {"simulation.dt": 0.5})
    assert same != ps.loads(TEXT.replace("0.5", "0.25"))
    assert same != TEXT
