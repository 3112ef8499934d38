"""VTK's own reader, hence ParaView and PyVista, sees the same frames. In a subprocess: VTK may crash."""

import json
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from simulate import record

from particlesim.trajectory import reader
from particlesim.trajectory.recovery import recover

READ = """
import sys, json
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.util.numpy_support import vtk_to_numpy
source = vtkHDFReader()
source.SetFileName(sys.argv[1])
source.UpdateInformation()
frames = []
for k in range(source.GetNumberOfSteps()):
    source.SetStep(k)
    source.Update()
    mesh = source.GetOutput()
    data = mesh.GetPointData()
    arrays = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]
    fields = {array.GetName(): vtk_to_numpy(array).tolist() for array in arrays}
    points = vtk_to_numpy(mesh.GetPoints().GetData()).tolist() if mesh.GetNumberOfPoints() else []
    others = mesh.GetNumberOfLines() + mesh.GetNumberOfPolys() + mesh.GetNumberOfStrips()
    cells = [mesh.GetNumberOfVerts(), others]
    ids = [mesh.GetCell(i).GetPointId(0) for i in range(min(cells[0], 50))]
    frames.append({"time": source.GetTimeValue(), "position": points, "cells": cells, "ids": ids, **fields})
print(json.dumps(frames))
"""

pytestmark = pytest.mark.skipif(find_spec("vtkmodules") is None, reason="VTK is not installed")


def read_with_vtk(path):
    done = subprocess.run([sys.executable, "-c", READ, path], capture_output=True, text=True, timeout=60)
    if "libEGL" in done.stderr or "libGL" in done.stderr:
        pytest.skip("VTK does not load here: " + done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stderr
    assert "ERR" not in done.stderr, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def assert_same(frames, path):
    with reader.open(path) as trajectory:
        assert len(frames) == len(trajectory)
        for seen, frame in zip(frames, trajectory, strict=True):
            assert seen["time"] == frame.time
            assert seen["cells"] == [len(frame), 0]
            assert seen["ids"] == list(range(min(len(frame), 50)))
            for name in trajectory.fields:
                np.testing.assert_array_equal(np.array(seen[name]).reshape(frame[name].shape), frame[name])


@pytest.mark.parametrize(
    "options", [{}, {"compression": "none", "precision": "double", "particles_hint": 300}]
)
def test_every_step(tmp_path, synthetic, options):
    path = synthetic.record(tmp_path / "a.vtkhdf", [0, 3, 300, 0, 299, 1], **options)
    assert_same(read_with_vtk(path), path)


def test_more_particles_than_one_block_of_vertices(tmp_path, synthetic):
    """The shared vertex tables grow by 65 536: counts at and beyond the border, then few again."""
    path = synthetic.record(tmp_path / "a.vtkhdf", [10, 65_536, 65_535, 70_000, 2])
    frames = read_with_vtk(path)
    assert [frame["cells"][0] for frame in frames] == [10, 65_536, 65_535, 70_000, 2]


def test_a_killed_file_after_recovery(tmp_path, kill_writer):
    path = kill_writer(tmp_path / "a.vtkhdf", acknowledged=5)
    assert recover(path)
    assert not recover(path)
    frames = read_with_vtk(path)
    assert len(frames) >= 5
    assert_same(frames, path)


TURN = """
import sys, json
from vtkmodules.vtkCommonCore import vtkMath
rows = [[0.0] * 3 for _ in range(3)]
turned = []
for q in json.loads(sys.argv[1]):
    vtkMath.QuaternionToMatrix3x3(q, rows)
    turned.append([list(row) for row in rows])
print(json.dumps(turned))
"""


def test_poses_of_bodies_are_as_vtk_has_them(tmp_path):
    # Quaternions w, x, y, z, as VTK's glyphs are turned by: a quarter turn about x takes y to z.
    path = tmp_path / "body.vtkhdf"
    body = {
        "shape": {"type": "box", "size": [0.1, 0.2, 0.3]},
        "position": [1, 2, 3],
        "orientation": {"axis": [1, 0, 0], "angle": 90},
        "angular_velocity": [0, 0, 1],
    }
    record(path, 0.1, 0.05, bodies=[body])
    frames = read_with_vtk(path)
    assert_same(frames, path)
    assert frames[0]["position"] == [[1, 2, 3]]
    quaternions = [frame["orientation"][0] for frame in frames]
    done = subprocess.run(
        [sys.executable, "-c", TURN, json.dumps(quaternions)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    turned = np.array(json.loads(done.stdout))
    assert turned[0] == pytest.approx(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), abs=1e-15)
    c, s = np.cos(0.1), np.sin(0.1)  # then about z
    assert turned[-1] == pytest.approx(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ turned[0], abs=1e-4)
