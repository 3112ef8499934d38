"""Springs and surfaces in trajectories: which particles they join, when they broke, and what other programs see."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import points, record

from particlesim.layouts import Cloth, Jelly
from particlesim.trajectory import reader
from particlesim.trajectory.topology import Topology

FLAG = {
    "name": "flag",
    "layout": {"type": "cloth", "size": [3, 2], "resolution": [4, 3], "pinned": "left"},
    "springs": {"structural": 100.0, "shear": 20.0},
}


def normals(x: Any, triangles: Any) -> Any:
    a, b, c = (x[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def test_a_trajectory_tells_what_joins_its_particles(tmp_path: Path) -> None:
    loose = points((5, 0, 0), (5, 1, 0), (5, 3, 0), name="loose")
    with record(
        tmp_path / "a.vtkhdf",
        0.02,
        0.01,
        particles=[loose, FLAG],
        springs=[{"on": "loose", "pairs": [[0, 1], [2, 1]], "stiffness": 1.0, "name": "link"}],
    ) as trajectory:
        sets = trajectory.topology
        assert set(sets) == {"flag.structural", "flag.shear", "link", "flag"}
        link = sets["link"]
        assert sorted(map(tuple, link.pairs.tolist())) == [(0, 1), (2, 1)]
        assert sorted(link.rest.tolist()) == [1, 2]
        assert link.holds(1e9).all()
        cloth = Cloth(size=(3, 2), resolution=(4, 3))
        for kind in ("structural", "shear"):
            wanted = {frozenset(pair) for pair in (cloth.edges(kind) + 3).tolist()}
            assert {frozenset(pair) for pair in sets[f"flag.{kind}"].pairs.tolist()} == wanted
        x, flag = trajectory[0].position, sets["flag"]
        area = normals(x, flag.triangles) / 2
        assert len(flag.triangles) == 2 * 3 * 2
        np.testing.assert_allclose(area, [[0, 0, 0.5]] * 12, atol=1e-15)


def test_the_surface_of_a_jelly_is_closed_and_points_outwards() -> None:
    # The normals of a closed surface add up to nothing; the volume is ⅓ Σ x·n.
    jelly = Jelly(size=(1, 2, 3), resolution=(2, 3, 4))
    x = jelly.place(None, 0, 24).position.T  # type: ignore[arg-type]
    triangles = jelly.triangles()
    n = normals(x, triangles) / 2
    assert np.abs(n.sum(axis=0)).max() < 1e-14
    assert (x[triangles].mean(axis=1) * n).sum() / 3 == pytest.approx(6, rel=1e-14)
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = {tuple(edge) for edge in directed.tolist()}
    assert len(edges) == len(directed)
    assert edges == {(b, a) for a, b in edges}


def test_springs_tell_when_they_broke(tmp_path: Path) -> None:
    # Ends drawn apart by 1, 2 and 0 m/s from 1 m: strain 0.5 is exceeded after 0.5 s, 0.25 s and never.
    chain = points(
        *((x, y, 0.0) for y in range(3) for x in (0.0, 1.0)),
        velocity=[(0, 0, 0), (1, 0, 0), (0, 0, 0), (2, 0, 0), (0, 0, 0), (0, 0, 0)],
        mass=1e9,
        name="ends",
    )
    spring = {
        "on": "ends",
        "pairs": [[0, 1], [2, 3], [4, 5]],
        "stiffness": 1.0,
        "break_strain": 0.5,
        "name": "thread",
    }
    path = tmp_path / "a.vtkhdf"
    with record(path, 1.0, 0.01, particles=[chain], springs=[spring], output={"every": 10}) as trajectory:
        thread = trajectory.topology["thread"]
        broke = dict(zip(thread.pairs[:, 0].tolist(), thread.broke.tolist(), strict=True))
        assert broke[0] == pytest.approx(0.51, abs=0.0101)
        assert broke[2] == pytest.approx(0.26, abs=0.0101)
        assert broke[4] == np.inf
        assert [thread.holds(t).sum() for t in trajectory.times] == [3, 3, 3, 2, 2, 2, 1, 1, 1, 1, 1]


def test_a_growing_file_shows_springs_as_they_break(tmp_path: Path, synthetic: Any) -> None:
    pairs = np.array([[0, 1], [1, 2]])
    one = Topology("a", pairs, np.ones(2), np.full(2, np.inf), breakable=True)
    with synthetic.open_writer(tmp_path / "a.vtkhdf", topology=[one]) as writer:
        writer.append(0.0, 0, synthetic.columns(0, 5), synthetic.ledger(0))
        writer.breaks("a", np.array([np.inf, 0.05]))
        writer.append(0.1, 5, synthetic.columns(1, 5), synthetic.ledger(1))
        while writer.frames_written < 2:
            pass
        with reader.open(tmp_path / "a.vtkhdf") as trajectory:
            assert trajectory.topology["a"].broke.tolist() == [np.inf, 0.05]
            writer.breaks("a", np.array([0.15, 0.05]))
            writer.append(0.2, 10, synthetic.columns(2, 5), synthetic.ledger(2))
            while writer.frames_written < 3:
                pass
            assert trajectory.topology["a"].broke.tolist() == [np.inf, 0.05]
            trajectory.refresh()
            assert trajectory.topology["a"].broke.tolist() == [0.15, 0.05]


CELLS = """
import sys, json
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.util.numpy_support import vtk_to_numpy
source = vtkHDFReader()
source.SetFileName(sys.argv[1])
source.UpdateInformation()
seen = []
for k in range(source.GetNumberOfSteps()):
    source.SetStep(k)
    source.Update()
    mesh = source.GetOutput()
    seen.append([vtk_to_numpy(cells.GetConnectivityArray()).reshape(-1, size).tolist()
                 for cells, size in ((mesh.GetVerts(), 1), (mesh.GetLines(), 2), (mesh.GetPolys(), 3))])
print(json.dumps(seen))
"""


@pytest.mark.skipif(find_spec("vtkmodules") is None, reason="VTK is not installed")
@pytest.mark.parametrize("deadly", [False, True])
def test_vtk_sees_lines_and_polygons_in_every_frame(tmp_path: Path, deadly: bool) -> None:
    # Where particles that were there from the start may die, rows move, and the cells are left out.
    emitter = {
        "name": "dust",
        "rate": 300,
        "shape": {"type": "point", "position": [0, 9, 0]},
        "speed": 1.0,
        "lifetime": 0.02,
    }
    floor = {"point": [0, -50, 0], "normal": [0, 1, 0], "contact": "kill", "on": ["loose"]}
    ends = points((5, 0, 0), (5, 1, 0), name="ends")
    path = tmp_path / "a.vtkhdf"
    record(
        path,
        0.05,
        0.01,
        particles=[points((9, 9, 9), name="loose"), ends, FLAG],
        emitters=[emitter],
        springs=[{"on": "ends", "pairs": [[0, 1]], "stiffness": 1.0, "name": "link"}],
        output={"every": 1},
        **({"planes": [floor]} if deadly else {}),
    ).close()
    done = subprocess.run([sys.executable, "-c", CELLS, path], capture_output=True, text=True, timeout=60)
    if "libEGL" in done.stderr or "libGL" in done.stderr:
        pytest.skip("VTK does not load here: " + done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stderr
    assert "ERR" not in done.stderr, done.stderr
    frames = json.loads(done.stdout.splitlines()[-1])
    with reader.open(path) as trajectory:
        assert len(set(trajectory.counts.tolist())) > 1
        triangles = trajectory.topology["flag"].triangles.tolist()
        for count, (vertices, lines, polygons) in zip(trajectory.counts, frames, strict=True):
            assert len(vertices) == count
            assert lines == ([] if deadly else [[1, 2]])
            assert polygons == ([] if deadly else triangles)
