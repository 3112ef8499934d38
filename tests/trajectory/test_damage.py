"""Truncated and damaged files: an error at once or what is intact, never a wait without end."""

import os
import shutil
import struct
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from threading import Thread

import h5py
import numpy as np
import pytest

from particlesim.errors import UsageError
from particlesim.trajectory import reader, superblock
from particlesim.trajectory.describe import describe
from particlesim.trajectory.files import check_readable
from particlesim.trajectory.recovery import recover
from particlesim.trajectory.target import check_target
from particlesim.trajectory.topology import Topology
from particlesim.trajectory.writer import TrajectoryWriter

DAMAGE = """
import random, sys, time
from pathlib import Path
from particlesim.errors import UsageError
from particlesim.trajectory import reader
from particlesim.trajectory.describe import describe
from particlesim.trajectory.recovery import recover

source, seed = Path(sys.argv[1]), int(sys.argv[2])
whole, path, random = source.read_bytes(), source.with_suffix(".bad.vtkhdf"), random.Random(seed)
outcomes = []
for case in range(60):
    data = bytearray(whole)
    if case % 2:
        data = data[: random.randrange(len(data))]
    for _ in range(random.choice([0, 1, 50]) if case % 2 else random.choice([1, 4, 100])):
        if len(data) > 48:
            data[random.randrange(48, len(data))] = random.randrange(256)
    path.write_bytes(data)
    for use in (describe, lambda p: [f[n] for f in reader.open(p) for n in f.fields], recover, describe):
        began = time.process_time()  # others may have the processor
        try:
            use(path)
            outcomes.append("fine")
        except UsageError as error:
            assert "H5" not in error.message and "synchronously" not in error.message, error.message
            outcomes.append("refused")
        assert time.process_time() - began < 2
print(*outcomes)
"""


@pytest.mark.parametrize("compression", [pytest.param("gzip", marks=pytest.mark.slow), "none"])
def test_random_damage_never_hangs(tmp_path, kill_writer, compression):
    """Killed writers' files, cut anywhere and with random bytes; HDF5 alone would wait for ever in some of them."""
    path = kill_writer(tmp_path / "a.vtkhdf", acknowledged=5, compression=compression)
    done = subprocess.run(
        [sys.executable, "-c", DAMAGE, str(path), "1"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    outcomes = done.stdout.split()
    assert {"fine", "refused"} == set(outcomes)


def test_a_killed_file_that_was_cut_off_shows_no_zeros(tmp_path, synthetic, kill_writer):
    """HDF5 reads zeros beyond the end of a file. Whatever is readable must be what was written."""
    path = kill_writer(tmp_path / "a.vtkhdf", acknowledged=40, compression="none", particles=100)
    whole = path.read_bytes()
    cut = tmp_path / "cut.vtkhdf"
    for size in range(len(whole) - 30_000, len(whole), 1_001):
        cut.write_bytes(whole[:size])
        with suppress(UsageError), reader.open(cut) as trajectory:
            synthetic.check(trajectory, [(100 * (k % 5)) // 4 for k in range(len(trajectory))])
            trajectory.events("birth")


def test_pipes_devices_and_folders_are_told_as_such(tmp_path):
    os.mkfifo(tmp_path / "pipe.vtkhdf")
    for path, kind in (
        (tmp_path / "pipe.vtkhdf", "pipe"),
        (Path("/dev/zero"), "device"),
        (tmp_path, "folder"),
    ):
        with pytest.raises(UsageError, match=f"is a {kind}, not a trajectory"):
            reader.open(path)
        with pytest.raises(UsageError, match=f"is a {kind}"):
            check_target(path, overwrite=True)


def test_names_that_are_too_long(tmp_path):
    path = tmp_path / ("ä" * 150 + ".vtkhdf")  # 307 bytes
    for refuse in (check_readable, lambda p: check_target(p, overwrite=False)):
        with pytest.raises(UsageError, match="too long") as caught:
            refuse(path)
        assert len(caught.value.message) < 120
    with pytest.raises(UsageError, match="too long"):
        check_target(tmp_path / ("b" * 300) / "a.vtkhdf", overwrite=False)
    check_target(tmp_path / ("ä" * 120 + ".vtkhdf"), overwrite=False)


def test_long_names_that_fit_are_written(tmp_path, synthetic):
    path = synthetic.record(tmp_path / ("ä" * 120 + ".vtkhdf"), [3])
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [3])


def test_a_frame_outlives_its_file_only_with_what_it_has_loaded(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", [3])
    with reader.open(path) as trajectory:
        frame = trajectory[0]
        loaded = frame.velocity
    assert frame.velocity is loaded
    for use in (lambda: frame.position, lambda: frame["temperature"], lambda: trajectory.events("birth")):
        with pytest.raises(UsageError, match="has been closed") as caught:
            use()
        assert "with" in caught.value.hint


def test_one_frame_at_most_is_on_its_way(tmp_path, synthetic, monkeypatch):
    """So that a kill loses no more: when `append` returns, all frames before that one are in the file."""
    with synthetic.open_writer(tmp_path / "a.vtkhdf") as writer:
        write = writer._file.append

        def slow(batch):
            time.sleep(0.002)
            write(batch)

        monkeypatch.setattr(writer._file, "append", slow)
        for k in range(20):
            writer.events("birth", [k], k / 10, 0)
            writer.append(k / 10, 5 * k, synthetic.columns(k, 10), synthetic.ledger(k))
            assert writer.frames_written >= k
        writer.flush()
        assert writer.frames_written == 20
    with reader.open(writer.path) as trajectory:
        assert len(trajectory.events("birth")["id"]) == 20


def test_a_file_whose_writer_was_killed_as_it_opened_it(tmp_path, synthetic):
    """Until a resumed run shares its file, HDF5's mark says that nobody else may read it."""
    path = synthetic.record(tmp_path / "a.vtkhdf", [3, 4])
    head = bytearray(path.read_bytes()[:48])
    head[11] = 1
    head[44:48] = struct.pack("<I", superblock.lookup3(bytes(head[:44])))
    with path.open("r+b") as file:
        file.write(head)
    before = path.read_bytes()
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [3, 4])
    assert path.read_bytes() == before
    assert recover(path)
    with h5py.File(path, "r") as file:
        assert len(file["psim/frames"]) == 2


def test_going_on_behind_a_frame(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", [5, 300, 7, 8], particles_hint=64)
    whole = synthetic.record(tmp_path / "b.vtkhdf", [5, 300, 9], particles_hint=64)
    options = {"fields": ["velocity", "temperature", "group"], "ledger": list(synthetic.ledger(0))}
    with TrajectoryWriter.continuing(path, 2, **options) as writer:
        with pytest.raises(UsageError, match="being written"):
            TrajectoryWriter.continuing(path, 2, **options)
        with reader.open(path) as trajectory:
            synthetic.check(trajectory, [5, 300])
            assert trajectory.status == "running"
        writer.append(0.2, 10, synthetic.columns(2, 9), synthetic.ledger(2))
    for each in (path, whole):
        with reader.open(each) as trajectory:
            synthetic.check(trajectory, [5, 300, 9])
    with h5py.File(path) as one, h5py.File(whole) as other:
        assert one["VTKHDF/Points"].shape == other["VTKHDF/Points"].shape
    with pytest.raises(UsageError, match="has 3 frames"):
        TrajectoryWriter.continuing(path, 4, **options)
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [5, 300, 9])


def _datasets(path):
    """Every dataset, by one of its names."""
    found = []
    with h5py.File(path) as file:
        file.visititems(lambda name, entry: found.append(name) if isinstance(entry, h5py.Dataset) else None)
    return [name for name in found if not name.startswith("psim/provenance")]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("wrong", ["text", "shape", "group", "missing"])
def test_datasets_of_another_type_or_shape(tmp_path, synthetic, wrong):
    """Whatever is replaced: it is refused when the file is opened or repaired, or it plays no part in reading."""
    topology = [
        Topology("net", np.array([[0, 1]]), np.ones(1), np.full(1, np.inf), np.array([[0, 1, 2]]), True)
    ]
    whole = synthetic.record(tmp_path / "a.vtkhdf", [3, 4], topology=topology)
    names, refused = _datasets(whole), {}
    for name in names:
        path = tmp_path / "changed.vtkhdf"
        shutil.copy(whole, path)
        with h5py.File(path, "r+") as file:
            shape, dtype = file[name].shape, file[name].dtype
            del file[name]
            if wrong == "text":
                file[name] = np.full(shape, 1 if dtype.kind == "O" else b"abc")
            elif wrong == "shape":
                file.create_dataset(name, (*shape, 5), dtype)
            elif wrong == "group":
                file.create_group(name)
        try:
            use_all(path)
            recover(path)
        except UsageError as error:
            refused[name] = error.message
    assert all("is damaged" in message for message in refused.values())
    if wrong == "missing":
        assert {"VTKHDF/Points", "VTKHDF/PointData/id", "psim/frames", "psim/status"} <= set(refused)
        return
    assert list(refused) == names
    assert all(f"/{name}" in message for name, message in refused.items())


def use_all(path):
    """Read whatever a trajectory holds."""
    describe(path)
    with reader.open(path) as trajectory:
        assert all(len(frame[field]) == len(frame) for frame in trajectory for field in trajectory.fields)
        assert trajectory.topology is not None


def set_format(file, value):
    del file["psim"].attrs["format"]
    file["psim"].attrs["format"] = value


def set_summary(file, text):
    file["psim/summary"].resize(len(text), axis=0)
    file["psim/summary"][...] = np.frombuffer(text, np.uint8)


def set_frames(file, column, value):
    rows = file["psim/frames"][:]
    rows[column][1] = value
    file["psim/frames"][...] = rows


def set_group(file, code):
    file["VTKHDF/PointData/group"][0] = code


def declare(file, name, rows):
    """A dataset of so many rows, of which the file holds none."""
    old = file[name]
    shape, dtype = (rows, *old.shape[1:]), old.dtype
    del file[name]
    file.create_dataset(name, shape, dtype, chunks=(256, *shape[1:]))


NONSENSE = {
    "format as text": (set_format, "one", "the number of its format"),
    "several formats": (set_format, [1, 1], "the number of its format"),
    "summary: a list": (set_summary, b"[1, 2]", "its summary"),
    "summary: nested": (set_summary, b'{"checks": [1]}', "its summary"),
    "summary: no JSON": (set_summary, b"[" * 5000, "its summary"),
    "checks: no list": (set_summary, b'{"checks": "3"}', "its results of checks"),
    "checks: others": (set_summary, b'{"checks": "[{}]"}', "its results of checks"),
    "a time that is none": (lambda f, v: set_frames(f, "time", v), np.nan, "no sense at frame 1"),
    "a time before": (lambda f, v: set_frames(f, "time", v), -1.0, "no sense at frame 1"),
    "a group too many": (set_group, 2, "counts into 2 groups"),
    "a group too few": (set_group, -1, "counts into 2 groups"),
    "events declared": (
        lambda f, v: declare(f, "psim/events/births", v),
        10**10,
        "longer than the file can hold",
    ),
    "frames declared": (lambda f, v: declare(f, "psim/frames", v), 10**10, "longer than the file can hold"),
    "particles declared": (
        lambda f, v: declare(f, "VTKHDF/Points", v),
        10**10,
        "longer than the file can hold",
    ),
    "springs without lengths": (
        lambda f, v: declare(f, "psim/topology/net/rest", v),
        300,
        "springs and surfaces",
    ),
    "no set of springs": (
        lambda f, v: f["psim/topology"].create_dataset("b", data=v),
        3,
        "springs and surfaces",
    ),
    "groups declared": (lambda f, v: declare(f, "psim/groups", v), 2**21, "too many groups"),
}


@pytest.mark.parametrize("nonsense", NONSENSE)
def test_nonsense(tmp_path, synthetic, nonsense):
    """What no checksum protects, or somebody wrote: it is told, and no memory is taken for it."""
    change, value, words = NONSENSE[nonsense]
    net = Topology("net", np.array([[0, 1]]), np.ones(1), np.full(1, np.inf))
    path = synthetic.record(tmp_path / "a.vtkhdf", [3, 4], topology=[net])
    with h5py.File(path, "r+", libver=("v110", "v110")) as file:
        change(file, value)
    with pytest.raises(UsageError, match=words):
        use_all(path)


def test_an_error_leaves_the_library_to_other_threads(tmp_path, synthetic):
    """h5py's iterators hold its lock, and one in the traceback of an error that is kept would keep it."""
    path = synthetic.record(tmp_path / "a.vtkhdf", [3])
    bad = Path(shutil.copy(path, tmp_path / "bad.vtkhdf"))
    with h5py.File(bad, "r+", libver=("v110", "v110")) as file:
        del file["psim/provenance/scenario"]
        file["psim/provenance/scenario"] = [1, 2]
    with pytest.raises(UsageError) as kept:
        reader.open(bad)
    thread = Thread(target=lambda: reader.open(path).close(), daemon=True)
    thread.start()
    thread.join(30)
    assert not thread.is_alive()
    assert kept.value
