"""Files of particles: what is wrong is told with its place in the file and in the scenario."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import particlesim as ps
from particlesim.engine.world import World
from particlesim.layouts.file import File
from particlesim.preflight.resources import needs

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
    "a column twice": ("x,y,z,x\n1,2,3,4\n", "data.csv:1: the column 'x' occurs twice"),
    "an endless line": ("x,y,z\n1,2,3" + " " * (1 << 16), "data.csv:2: a line of more than"),
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
    assert "is not an NPY file" in str(mistake(tmp_path, "text.npy"))
    np.save(tmp_path / "objects.npy", np.array([None]), allow_pickle=True)
    assert "Python objects" in str(mistake(tmp_path, "objects.npy"))
    np.save(tmp_path / "flat.npy", np.zeros(4))
    assert "shape [4]" in str(mistake(tmp_path, "flat.npy"))
    np.save(tmp_path / "nan.npy", np.array([[0, 0, 0], [0, np.nan, 0]]))
    assert "y of particle 1 is nan" in str(mistake(tmp_path, "nan.npy"))
    np.savez(tmp_path / "several.npz", np.zeros((4, 3)))
    (tmp_path / "several.npz").rename(tmp_path / "several.npy")
    assert "is not an NPY file" in str(mistake(tmp_path, "several.npy"))


@pytest.mark.parametrize("shape", [(5, 3), (200_000_000_000, 3), (1 << 62, 1 << 62, 3)])
def test_an_npy_file_that_is_shorter_than_its_header_says(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """Four particles, and a header that tells of more: no memory is taken for those."""
    with (tmp_path / "cut.npy").open("wb") as file:
        np.lib.format.write_array_header_2_0(file, {"descr": "<f8", "fortran_order": False, "shape": shape})
        file.write(np.zeros((4, 3)).tobytes())
    told = str(mistake(tmp_path, "cut.npy"))
    assert "is shorter than its header says: 96 bytes" in told
    assert "fetch it again" in told


def npy(header: str, data: bytes = b"", length: int | None = None) -> bytes:
    """An NPY file of version 2 whose header is any text, and says to have any length."""
    return (
        b"\x93NUMPY\2\0"
        + struct.pack("<I", len(header) if length is None else length)
        + header.encode()
        + data
    )


HEADER = "{'descr': %s, 'fortran_order': False, 'shape': %s}\n"
XYZ = "('x', '<f8'), ('y', '<f8'), ('z', '<f8')"
NO_ARRAYS = {
    "subarray": (npy(HEADER % ("[('x', '<f8', (2,)), ('y', '<f8'), ('z', '<f8')]", "(1,)"), bytes(32)), "in a column"),
    "nested": (npy(HEADER % ("[('x', [('a', '<f8')]), ('y', '<f8'), ('z', '<f8')]", "(1,)"), bytes(24)), "in a column"),
    "records in a table": (npy(HEADER % (f"[{XYZ}]", "(1, 1)"), bytes(24)), "records of shape [1, 1]"),
    "a truth as length": (npy(HEADER % ("'<f8'", "(True, 3)"), bytes(24)), "is not an NPY file"),
    "a negative length": (npy(HEADER % ("'<f8'", "(-1, 3)"), bytes(24)), "is not an NPY file"),
    "brackets": (npy("(" * 4000), "is not an NPY file"),
    "spaces": (npy("{'descr': '<f8', \0" + " " * 9900), "is not an NPY file"),
    "minus signs": (npy("-" * 9000 + "1"), "is not an NPY file"),
    "a header without an end": (npy("", length=0xFFFFFFFF), "is not an NPY file"),
    "complex": (npy(HEADER % ("'<c16'", "(1, 3)"), bytes(48)), "type complex128"),
    "complex column": (npy(HEADER % (f"[{XYZ}, ('mass', '<c16')]", "(1,)"), bytes(40)), "complex128 in a column"),
    "dates": (npy(HEADER % ("'<M8[D]'", "(1, 3)"), bytes(24)), "type datetime64[D]"),
    "times": (npy(HEADER % (f"[{XYZ}, ('vx', '<m8[s]')]", "(1,)"), bytes(32)), "timedelta64[s] in a column"),
    "text": (npy(HEADER % ("'<U1'", "(1, 3)"), bytes(12)), "type <U1"),
    "truths": (npy(HEADER % ("'|b1'", "(1, 3)"), bytes(3)), "type bool"),
    "no particles": (npy(HEADER % ("'<f8'", "(0, 3)")), "holds no particles"),
    "beyond doubles": (npy(HEADER % ("'<f16'", "(1, 3)"), np.full(3, np.longdouble("1e4000")).tobytes()), "is inf"),
}  # fmt: skip


@pytest.mark.parametrize("name", NO_ARRAYS)
def test_npy_files_that_are_no_particles(tmp_path: Path, name: str) -> None:
    if name == "beyond doubles" and np.finfo(np.longdouble).maxexp < 16384:
        pytest.skip("long doubles are doubles here")
    content, words = NO_ARRAYS[name]
    (tmp_path / "data.npy").write_bytes(content)
    assert words in str(mistake(tmp_path, "data.npy"))


@pytest.mark.parametrize("kind", [">f4", "<i2", "<f2"])
@pytest.mark.parametrize("order", ["C", "F", "records"])
def test_arrays_are_read_piece_by_piece(tmp_path: Path, kind: str, order: str) -> None:
    numbers = np.arange(60.0).reshape(10, 6).astype(kind)
    if order == "records":
        names = ("vz", "vy", "vx", "z", "y", "x")
        stored = np.rec.fromarrays(numbers.T[::-1], names=",".join(names))
    else:
        stored = np.asarray(numbers, order=order)
    np.save(tmp_path / "data.npy", stored)
    layout = File(path="data.npy").open(tmp_path)
    assert layout.number() == 10
    placed = layout.place(None, 3, 4)  # type: ignore[arg-type]  # no random numbers here
    np.testing.assert_array_equal(np.hstack([placed.position.T, placed.velocity.T]), numbers[3:7])


@pytest.mark.sampled(3)
@pytest.mark.skipif(sys.platform != "linux", reason="needs holes in files, and what a process took at most")
@pytest.mark.parametrize("ending", ["npy", "csv", "obj", "ply", "stl"])
def test_files_with_holes_take_no_memory(tmp_path: Path, ending: str) -> None:
    """Six gigabytes of zeros, behind a header that may be true: looked at, and refused, within 200 MB."""
    count = 250_000_000
    begin = {
        "npy": npy(HEADER % ("'<f8'", f"({count}, 3)")),
        "csv": b"x,y,z\n1,2,3\n",
        "obj": b"v 0 0 0\n",
        "ply": b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty double x\nproperty double y\n"
        b"property double z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
        % (count - 100),
        "stl": bytes(80) + struct.pack("<I", 24 * count // 50),
    }[ending]
    with (tmp_path / f"hole.{ending}").open("wb") as file:
        file.write(begin)
        file.truncate(len(begin) + (24 * count // 50 * 50 if ending == "stl" else 24 * count))
    kind = "mesh" if ending in ("obj", "ply", "stl") else "file"
    (tmp_path / "s.toml").write_text(
        SCENARIO.replace('"file"', f'"{kind}"').replace("NAME", f"hole.{ending}")
    )
    code = """
import resource, sys
import particlesim as ps
from particlesim.preflight import resources as bounds
from particlesim.errors import ResourceError
from particlesim.layouts import input_file
bounds.available_memory = input_file.available_memory = lambda: 4 << 30
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    bounds.check_fits(bounds.needs(ps.load(sys.argv[2])), None)
except (ps.ScenarioError if sys.argv[1] == "csv" else ResourceError) as error:
    print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) >> 10, error)
"""
    told = subprocess.run(
        [sys.executable, "-c", code, ending, tmp_path / "s.toml"], capture_output=True, text=True, check=True
    )
    megabytes, words = told.stdout.split(" ", 1)
    assert int(megabytes) < 200
    assert ("a line of more than" if ending == "csv" else "of memory") in words


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
    assert placed.attributes["mass"].tolist() == [4, 8]


def sized(tmp_path: Path, text: str, *more: str) -> ps.Scenario:
    (tmp_path / "data.csv").write_text(text)
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO.replace("NAME", "data.csv") + "\n".join(more) + "\n")
    return ps.load(path)


def test_a_density_acts_on_the_sizes_of_a_file(tmp_path: Path) -> None:
    """m = 4/3 π ρ r³ of each, whichever of the two the file gives; sizes of the file go before those of the group, and what
    it gives both of is as it says."""
    radii = np.array([0.1, 0.2])
    masses = 4 / 3 * np.pi * 1000 * radii**3
    for column, values in (("radius", radii), ("mass", masses)):
        text = f"x,y,z,{column}\n" + "".join(
            f"{k},0,0,{value!r}\n" for k, value in enumerate(values.tolist())
        )
        for more in ([], [f"{column} = 3.0"]):
            (state,) = World(sized(tmp_path, text, "density = 1000", *more)).states
            assert state.radius[:2] == pytest.approx(radii, rel=1e-6)
            assert state.mass[:2] == pytest.approx(masses, rel=1e-6)
    (state,) = World(sized(tmp_path, "x,y,z,mass,radius\n0,0,0,5,0.5\n", "density = 1000")).states
    assert (state.mass[0], state.radius[0]) == (5, 0.5)


@pytest.mark.parametrize(
    ("text", "more", "wrong"),
    [
        ("x,y,z\n0,0,0\n", [], "its file neither masses nor radii"),
        ("x,y,z,radius\n0,0,0,1\n", ["mass = 1"], "the third follows from two"),
        ("x,y,z,mass\n0,0,0,1\n", ["radius = 1"], "the third follows from two"),
        ("x,y,z,radius\n0,0,0,0\n", [], "has no radius"),
    ],
)
def test_a_density_and_a_file_that_do_not_fit(tmp_path: Path, text: str, more: list[str], wrong: str) -> None:
    with pytest.raises(ps.UsageError, match=wrong):
        World(sized(tmp_path, text, "density = 1000", *more))
