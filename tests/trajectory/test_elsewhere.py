"""Files that lead to other files, and files on which HDF5 hangs: whoever opens them says so, and ends."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

import particlesim as ps
from particlesim.trajectory import examiner, reader

SECRET = "the content of another file"
SCENARIO = """
title = "Ball"
[simulation]
duration = 0.1
dt = 0.01
[[particles]]
name = "ball"
mass = 1
layout = { type = "points", position = [[0, 1, 0]] }
"""


def external_storage(file, name, other):
    file.create_dataset(name, (1, 3), "f4", external=[(str(other), 0, 12)])


def external_link(file, name, other):
    file[name] = h5py.ExternalLink(str(other), "/x")


def virtual_dataset(file, name, other):
    """One that grows with its source: to ask for its length alone would open that."""
    endless = h5py.h5s.UNLIMITED
    layout = h5py.VirtualLayout((1, 3), "f4", maxshape=(None, 3))
    layout[0:endless] = h5py.VirtualSource(str(other), "x", (1, 3), maxshape=(None, 3))[0:endless]
    file.create_virtual_dataset(name, layout)


WAYS = (external_storage, external_link, virtual_dataset)


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    """A good trajectory, its scenario, a secret file and a pipe."""
    folder = tmp_path_factory.mktemp("elsewhere")
    (folder / "secret").write_text(SECRET)
    os.mkfifo(folder / "pipe")
    (folder / "ball.toml").write_text(SCENARIO)
    ps.run(folder / "ball.toml", folder / "good.vtkhdf")
    return folder


def make_bad(ground, way, other, name="VTKHDF/Points"):
    bad = ground / "bad.vtkhdf"
    shutil.copy(ground / "good.vtkhdf", bad)
    with h5py.File(bad, "r+", libver=("v110", "v110")) as file:
        del file[name]
        way(file, name, ground / other)
    return bad


@pytest.mark.parametrize("other", ["secret", "pipe"])
@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_data_in_other_files_are_refused(ground, way, other):
    for name in (
        "VTKHDF/Points",
        "psim/status",
        "psim/provenance/title",
        "VTKHDF/Steps/Values",
        "unknown/thing",
    ):
        if name == "unknown/thing":
            bad = ground / "bad.vtkhdf"
            shutil.copy(ground / "good.vtkhdf", bad)
            with h5py.File(bad, "r+", libver=("v110", "v110")) as file:
                way(file.create_group("unknown"), "thing", ground / other)
        else:
            bad = make_bad(ground, way, other, name)
        with pytest.raises(ps.InputOutputError, match=f"leads to other files.*/{name}") as caught:
            reader.open(bad)
        assert caught.value.exit_code == 4


def _hangs(path: Path) -> bool:
    """Whether plain HDF5 does not end on a file."""
    read = "import h5py, sys\nf = h5py.File(sys.argv[1])['psim']\n[f['provenance'][n][()] for n in f['provenance']]"
    try:
        subprocess.run([sys.executable, "-c", read, path], timeout=1.5, capture_output=True, check=False)
    except subprocess.TimeoutExpired:
        return True
    return False


def test_a_file_on_which_hdf5_hangs_is_told_as_damaged(tmp_path, ground):
    """The heap that holds texts, from its first length on, becomes zeros: HDF5 goes round on an object of no length."""
    whole = (ground / "good.vtkhdf").read_bytes()
    path = tmp_path / "bad.vtkhdf"
    heap = whole.index(b"GCOL")
    data = bytearray(whole)
    data[heap + 300 : heap + 812] = bytes(512)
    path.write_bytes(data)
    assert _hangs(path)
    with pytest.raises(ps.UsageError, match="damaged: reading it does not end"):
        reader.open(path)
    with reader.open(ground / "good.vtkhdf") as trajectory:  # the next one is none the worse
        assert trajectory[-1].position.shape == (1, 3)


def test_a_process_looks_through_files_of_others_once(tmp_path, ground, monkeypatch):
    asked = []
    ask = examiner._examiner.ask
    monkeypatch.setattr(examiner._examiner, "ask", lambda path: asked.append(path) or ask(path))
    path = tmp_path / "a.vtkhdf"
    ps.run(ground / "ball.toml", path)
    ps.open(path).close()
    assert not asked  # its own
    copy = tmp_path / "b.vtkhdf"
    shutil.copy(path, copy)
    for _ in range(2):
        ps.open(copy).close()
    assert asked == [copy]
    with h5py.File(copy, "r+", libver=("v110", "v110")) as file:
        file["psim/frames"].attrs["touched"] = 1
    ps.open(copy).close()
    assert asked == [copy, copy]


def test_a_process_that_was_ended_from_outside_is_started_again(tmp_path, ground):
    path = tmp_path / "a.vtkhdf"
    for _ in range(2):
        shutil.copy(ground / "good.vtkhdf", path)
        examiner._known.clear()
        ps.open(path).close()
        examiner._examiner._process.kill()


def test_without_a_process_files_are_looked_through_all_the_same(ground, monkeypatch):
    monkeypatch.setattr(examiner, "_examiner", examiner._Examiner())
    monkeypatch.setattr(sys, "executable", "/usr/bin/blender")
    for way in WAYS:
        with pytest.raises(ps.InputOutputError, match="leads to other files"):
            reader.open(make_bad(ground, way, "secret"))
    examiner._known.clear()
    reader.open(ground / "good.vtkhdf").close()
    assert examiner._examiner._process is None


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_has_its_own(tmp_path, ground):
    reader.open(make_copy(ground, tmp_path / "a.vtkhdf")).close()
    first = examiner._examiner._process
    child = os.fork()
    if child == 0:
        try:
            reader.open(make_copy(ground, tmp_path / "b.vtkhdf")).close()
            os._exit(0 if examiner._examiner._process not in (None, first) else 1)
        except BaseException:
            os._exit(2)
    assert os.waitpid(child, 0)[1] == 0
    reader.open(make_copy(ground, tmp_path / "c.vtkhdf")).close()
    assert examiner._examiner._process is first


def make_copy(ground, path):
    shutil.copy(ground / "good.vtkhdf", path)
    return path
