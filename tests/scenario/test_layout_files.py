"""Files of particles: what is wrong is told with its place in the file and in the scenario."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import particlesim as ps
from particlesim.bounds import needs

SCENARIO = """\
format = 1
simulation = { duration = 1, dt = 0.1 }

[[particles]]
name = "cloud"
layout = { type = "file", path = "NAME" }
"""

MISTAKES = {
    "text": ("x,y,z\n# two words\n1,2,3\n\n1, abc,3\n", "data.csv:5:4: expected a number, got 'abc'"),
    "empty cell": ("x,y,z\n1,,3\n", "data.csv:2:3: expected a number, got ''"),
    "too few": ("x,y,z\n1,2,3\n1,2\n", "data.csv:3: 3 columns are named in the first line, 2 are filled"),
    "too many": ("x,y,z\n1,2,3,4\n", "data.csv:2: 3 columns are named in the first line, 4 are filled"),
    "NaN": ("x,y,z\n1,2,3\n\n1,2,nan\n", "data.csv:4: z of particle 1 is nan"),
    "mass": ("x,y,z,mass\n1,2,3,1\n1,2,3,0\n", "data.csv:3: mass of particle 1 is 0"),
    "semicolons": ("x;y;z\n1;2;3\n", "columns are separated by commas"),
    "misspelt column": ("x,y,z,raduis\n1,2,3,4\n", 'did you mean "radius"?'),
    "missing column": ("x,y\n1,2\n", "no column 'z'"),
    "no lines": ("x,y,z\n# none\n\n", "holds no particles"),
    "nothing": ("", "holds no particles"),
    "other bytes": (b"x,y,z\n\xff\xfe,1,2\n", "data.csv:2:1: expected a number"),
}


def mistake(tmp_path: Path, name: str) -> ps.ScenarioError:
    file = tmp_path / "scenario.toml"
    file.write_text(SCENARIO.replace("NAME", name))
    with pytest.raises(ps.ScenarioError) as caught:
        needs(ps.load(file))
    (found,) = caught.value.diagnostics
    assert found.path == "particles.cloud.layout.path"
    assert (found.file, found.span.line, found.span.column) == (file, 6, 34)
    with pytest.raises(ps.ScenarioError):
        ps.run(ps.load(file))
    return caught.value


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_in_csv(tmp_path: Path, name: str) -> None:
    content, words = MISTAKES[name]
    (tmp_path / "data.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    assert words in str(mistake(tmp_path, "data.csv"))


def test_mistakes_in_npy(tmp_path: Path) -> None:
    (tmp_path / "text.npy").write_text("no array")
    assert "is no NPY file" in str(mistake(tmp_path, "text.npy"))
    np.save(tmp_path / "objects.npy", np.array([None]), allow_pickle=True)
    assert "Python objects" in str(mistake(tmp_path, "objects.npy"))
    np.save(tmp_path / "flat.npy", np.zeros(4))
    assert "shape [4]" in str(mistake(tmp_path, "flat.npy"))
    np.save(tmp_path / "nan.npy", np.array([[0, 0, 0], [0, np.nan, 0]]))
    assert "y of particle 1 is nan" in str(mistake(tmp_path, "nan.npy"))
    np.savez(tmp_path / "several.npz", np.zeros((4, 3)))
    (tmp_path / "several.npz").rename(tmp_path / "several.npy")
    assert "is no NPY file" in str(mistake(tmp_path, "several.npy"))


@pytest.mark.parametrize("shape", [(5, 3), (200_000_000_000, 3), (1 << 62, 1 << 62, 3)])
def test_an_npy_file_that_is_shorter_than_its_header_says(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """Four particles, and a header that tells of more: no memory is taken for those."""
    with (tmp_path / "cut.npy").open("wb") as file:
        np.lib.format.write_array_header_2_0(file, {"descr": "<f8", "fortran_order": False, "shape": shape})
        file.write(np.zeros((4, 3)).tobytes())
    told = str(mistake(tmp_path, "cut.npy"))
    assert "is shorter than its header says: 96 bytes" in told
    assert "fetch it again" in told


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.csv").mkdir()
    assert "is a pipe" in str(mistake(tmp_path, "pipe.csv"))
    assert "is a device" in str(mistake(tmp_path, "/dev/zero"))
    assert "is a directory" in str(mistake(tmp_path, "folder.csv"))
    assert "does not exist" in str(mistake(tmp_path, "gone.csv"))


def test_mistakes_about_a_trajectory(tmp_path: Path) -> None:
    ps.run(ps.from_table(table := {
        "simulation": {"duration": 1, "dt": 0.5},
        "particles": [{"name": "ball", "layout": {"type": "points", "position": [[0, 0, 0]]}}],
    }), tmp_path / "ball.vtkhdf")  # fmt: skip
    for key, value, words in (("frame", 9, "has no frame 9"), ("group", "bal", "Did you mean 'ball'?")):
        table["particles"][0]["layout"] = {
            "type": "file",
            "path": str(tmp_path / "ball.vtkhdf"),
            key: value,
        }
        with pytest.raises(ps.ScenarioError, match=words) as caught:
            needs(ps.from_table(table))
        assert caught.value.diagnostics[0].path == f"particles.ball.layout.{key}"


def test_a_good_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "data.csv").write_text("\ufeffx, y ,z,mass\n# first\n1,2,3,4 # here\n\n5,6,7,8\n")
    (tmp_path / "scenario.toml").write_text(SCENARIO.replace("NAME", "data.csv"))
    scenario = ps.load(tmp_path / "scenario.toml")
    layout = scenario.opened(scenario.particles[0])
    placed = layout.place(None, 0, 2)  # type: ignore[arg-type]  # no random numbers here
    assert placed.position.tolist() == [[1, 5], [2, 6], [3, 7]]
    assert placed.mass.tolist() == [4, 8]
