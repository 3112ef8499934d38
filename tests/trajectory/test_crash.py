"""Killed writers, readers beside a writer, full disks: no finished frame is ever lost."""

import errno
import os
import subprocess
import sys
import time
from collections import namedtuple
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest

from particlesim.errors import InputOutputError, UsageError
from particlesim.trajectory import frame_file, reader, superblock
from particlesim.trajectory.recovery import recover


def counts_of_victim(frames, particles):
    return [(particles * (k % 5)) // 4 for k in range(frames)]


@pytest.mark.parametrize(
    ("compression", "particles", "seed"), [("gzip", 8, 1), ("none", 100, 2), ("gzip", 3000, 3)]
)
def test_every_acknowledged_frame_survives_a_kill(
    tmp_path, synthetic, kill_writer, compression, particles, seed
):
    moment = np.random.default_rng(seed).uniform(0, 0.15)
    path = kill_writer(
        tmp_path / "a.vtkhdf", acknowledged=3, moment=moment, particles=particles, compression=compression
    )
    with reader.open(path) as trajectory:
        assert len(trajectory) >= 3
        assert trajectory.status == "interrupted"
        before = len(trajectory)
        synthetic.check(trajectory, counts_of_victim(before, particles))
    assert recover(path)
    with h5py.File(path, "r") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == before == len(file["VTKHDF/Steps/Values"])
        assert len(file["psim/events/births"]) == before
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, counts_of_victim(before, particles))
        assert trajectory.status == "interrupted"


def test_kill_count_is_what_was_acknowledged(tmp_path, start_writer):
    """Several kills at random moments: the file never has fewer frames than were reported before the kill."""
    moments = np.random.default_rng(7).uniform(0, 0.08, 3)
    for k, moment in enumerate(moments):
        path = tmp_path / f"{k}.vtkhdf"
        process = start_writer(path, particles=500, compression="none")
        process.stdout.readline()
        time.sleep(moment)
        process.kill()
        process.wait()
        lines = process.stdout.read().split("\n")[:-1]
        with reader.open(path) as trajectory:
            assert len(trajectory) >= int((lines or [1])[-1])
            assert len(trajectory[-1].position) == len(trajectory[-1])


def test_reading_while_another_process_writes(tmp_path, synthetic, start_writer):
    path = tmp_path / "a.vtkhdf"
    process = start_writer(path, pause=0.004, frames=120)
    process.stdout.readline()
    seen = []
    with pytest.raises(UsageError, match="being written"):
        recover(path)
    with reader.open(path) as trajectory:
        while trajectory.status == "running":
            seen.append(len(trajectory))
            synthetic.check(trajectory, counts_of_victim(len(trajectory), 100))
            trajectory.refresh()
        assert process.wait(timeout=20) == 0
        trajectory.refresh()
        assert trajectory.status == "complete"
        synthetic.check(trajectory, counts_of_victim(120, 100))
    assert len(set(seen)) > 1, "it should be read while it grows"
    assert seen == sorted(seen)


def test_reading_in_the_process_that_writes(tmp_path, synthetic):
    path = tmp_path / "a.vtkhdf"
    with synthetic.open_writer(path) as writer, reader.open(path) as trajectory:
        assert len(trajectory) == 0
        with pytest.raises(UsageError, match="no frames"):
            trajectory.frame_at(0)
        writer.append(0, 0, synthetic.columns(0, 5), synthetic.ledger(0))
        while not writer.frames_written:
            time.sleep(0.001)
        trajectory.refresh()
        synthetic.check(trajectory, [5])
        assert trajectory.status == "running"


def test_a_file_in_use_is_not_overwritten(tmp_path, synthetic):
    path = tmp_path / "a.vtkhdf"
    with synthetic.open_writer(path) as writer:
        with pytest.raises(UsageError, match="being written"):
            synthetic.open_writer(path, overwrite=True)
        writer.append(0, 0, synthetic.columns(0, 5), synthetic.ledger(0))
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [5])


def append_until_error(writer, synthetic, limit=2000, particles=400):
    for k in range(limit):
        writer.append(k / 10, 5 * k, synthetic.columns(k, particles), synthetic.ledger(k))
        time.sleep(0.0005)
    pytest.fail("no error came up")


def test_a_full_disk_is_noticed_before_hdf5_is_hurt(tmp_path, synthetic, monkeypatch):
    usage = namedtuple("usage", "free")
    free = iter([1 << 30] * 4)
    monkeypatch.setattr(frame_file.shutil, "disk_usage", lambda path: usage(next(free, 1000)))
    path = tmp_path / "a.vtkhdf"
    writer = synthetic.open_writer(path)
    with pytest.raises(InputOutputError, match="disk is full"):
        append_until_error(writer, synthetic)
    with pytest.raises(InputOutputError, match="disk is full"):
        writer.append(0, 0, synthetic.columns(0, 1), synthetic.ledger(0))
    with pytest.raises(InputOutputError, match="disk is full"):
        writer.close()
    assert writer.frames_written >= 4
    with reader.open(path) as trajectory:
        assert trajectory.status == "failed"
        synthetic.check(trajectory, [400] * writer.frames_written)
        assert trajectory.times[-1] == writer.last_time


def test_an_error_of_the_thread_comes_up_once_and_nothing_hangs(tmp_path, synthetic, monkeypatch):
    def fail(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    writer = synthetic.open_writer(tmp_path / "a.vtkhdf")
    writer.append(0, 0, synthetic.columns(0, 400), synthetic.ledger(0))
    while not writer.frames_written:
        time.sleep(0.001)
    monkeypatch.setattr(writer._file, "_write_chunks", fail)
    with pytest.raises(InputOutputError, match="Input/output error"), writer:
        append_until_error(writer, synthetic)
    with reader.open(writer.path) as trajectory:
        synthetic.check(trajectory, [400])
        assert trajectory.status == "failed"


def test_an_exception_in_the_block_marks_the_file_failed(tmp_path, synthetic):
    path = tmp_path / "a.vtkhdf"

    def run():
        with synthetic.open_writer(path) as writer:
            writer.append(0, 0, synthetic.columns(0, 3), synthetic.ledger(0))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [3])
        assert trajectory.status == "failed"


LIMITED = """
import resource, sys, time
from pathlib import Path
sys.path.insert(0, {folder!r})
from conftest import open_writer, synthetic_columns, synthetic_ledger
from particlesim.errors import InputOutputError
from particlesim.trajectory import frame_file

def limit(size):
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

def unlimited_memory_file(make=frame_file._memory_file):
    limit(resource.RLIM_INFINITY)  # the limit stands for a full disk, and memory is none
    return make()

frame_file._memory_file = unlimited_memory_file
frame_file.FrameFile._check_space = lambda *_: None  # the quota of a user, say, shows only when it is used up
limit({limit})
try:
    with open_writer(Path({path!r}), compression={compression!r}) as writer:
        for k in range(10000):
            writer.append(k / 10, 5 * k, synthetic_columns(k, 400), synthetic_ledger(k))
            while writer.frames_written < min(k, 3):
                time.sleep(0.001)
except InputOutputError as error:
    print(writer.frames_written, error.message)
"""


@pytest.mark.sampled(2)
@pytest.mark.parametrize("compression", ["gzip", "none"])
@pytest.mark.parametrize("limit", [300_000, 1_000_003, 1_500_000])
def test_writes_that_the_system_refuses(tmp_path, synthetic, compression, limit):
    """A limit on file size makes the system refuse a write in the middle of HDF5's own work."""
    path = tmp_path / "a.vtkhdf"
    script = LIMITED.format(
        folder=str(Path(__file__).parent), path=str(path), compression=compression, limit=limit
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    written = int(done.stdout.split()[0])
    assert "File too large" in done.stdout
    with reader.open(path) as trajectory:
        assert len(trajectory) >= written > 0
        synthetic.check(trajectory, [400] * len(trajectory))
    recover(path)
    with reader.open(path) as trajectory:
        assert len(trajectory) >= written


SMALL_FILES = """
import resource, sys
from pathlib import Path
sys.path.insert(0, {folder!r})
from conftest import open_writer, synthetic_columns, synthetic_ledger
from particlesim.errors import InputOutputError

writer = None
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
try:
    with open_writer(Path({path!r}), compression={compression!r}, particles_hint=1) as writer:
        for k in range(300):
            writer.events("birth", [k], k / 10, 0)
            writer.append(k / 10, 5 * k, synthetic_columns(k, 1), synthetic_ledger(k))
except InputOutputError as error:
    print(writer.frames_written if writer else "none", error)
"""


@pytest.mark.sampled(2)
@pytest.mark.skipif(sys.platform == "win32", reason="no such limits")
@pytest.mark.parametrize("compression", ["gzip", "none"])
@pytest.mark.parametrize(("limit", "least"), [(10_000, None), (40_000, 0), (130_000, 50), (155_000, 150)])
def test_a_limit_on_the_size_of_files(tmp_path, synthetic, compression, limit, least):
    """HDF5 must not come upon it: memory is limited like files, so there is no place for what it would write."""
    path = tmp_path / "a.vtkhdf"
    script = SMALL_FILES.format(
        folder=str(Path(__file__).parent), path=str(path), compression=compression, limit=limit
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert "File too large" in done.stdout
    written = done.stdout.split()[0]
    if least is None:
        assert written == "none"
        assert not list(tmp_path.iterdir())
        return
    assert not recover(path)
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [1] * int(written))
        assert int(written) >= least
        assert trajectory.status == "failed"


def test_a_summary_that_does_not_fit(tmp_path, synthetic, monkeypatch):
    writer = synthetic.open_writer(tmp_path / "a.vtkhdf")
    writer.append(0, 0, synthetic.columns(0, 5), synthetic.ledger(0))
    writer.flush()
    monkeypatch.setattr(frame_file.shutil, "disk_usage", lambda path: namedtuple("usage", "free")(1000))
    with pytest.raises(InputOutputError, match="disk is full") as caught:
        writer.close("complete", {"state": "0"})
    assert "1 frame was finished" in caught.value.hint
    with reader.open(writer.path) as trajectory:
        synthetic.check(trajectory, [5])
        assert (trajectory.status, trajectory.summary) == ("failed", {})


def test_the_last_kilobytes_of_a_disk_are_used(tmp_path, synthetic, monkeypatch):
    """What is refused is refused because it would not fit: of 200 kB, a large part is used."""
    path = tmp_path / "a.vtkhdf"
    free = namedtuple("usage", "free")
    monkeypatch.setattr(
        frame_file.shutil,
        "disk_usage",
        lambda _: free(200_000 - (path.stat().st_size if path.exists() else 0)),
    )
    writer = synthetic.open_writer(path, particles_hint=1)
    with pytest.raises(InputOutputError, match="disk is full"):
        append_until_error(writer, synthetic, particles=1)
    with pytest.raises(InputOutputError):
        writer.close()
    assert writer.frames_written > 200
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [1] * writer.frames_written)


def test_the_checksum_is_the_published_one():
    """Value from the source of lookup3.c: hashlittle("Four score and seven years ago", 30, 0)."""
    assert superblock.lookup3(b"Four score and seven years ago") == 0x17770551
    assert superblock.lookup3(b"") == 0xDEADBEEF


def test_two_readers_of_one_file(tmp_path, synthetic):
    """Many frames, as HDF5's index of them must have blocks; alternately, and from threads."""
    path = synthetic.record(tmp_path / "a.vtkhdf", [5] * 60)
    with reader.open(path) as one, reader.open(path) as other:
        for k in range(60):
            assert np.array_equal(one[k].velocity, other[k].velocity)

    def read(_):
        with reader.open(path) as trajectory:
            synthetic.check(trajectory, [5] * 60)

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(read, range(6)))


def test_two_readers_beside_a_writer(tmp_path, synthetic, start_writer):
    path = tmp_path / "a.vtkhdf"
    process = start_writer(path, pause=0.002, frames=80)
    process.stdout.readline()
    with reader.open(path) as one, reader.open(path) as other:
        while "running" in (one.status, other.status):
            for trajectory in (one, other):
                synthetic.check(trajectory, counts_of_victim(len(trajectory), 100))
                trajectory.refresh()
        assert len(one) == len(other) == 80
    assert process.wait(timeout=20) == 0


def test_what_a_run_tells_of_itself_is_on_disk_before_it_says_that_it_is_complete(
    tmp_path, synthetic, monkeypatch
):
    flush, seen = h5py.File.flush, []

    def noted(file: h5py.File) -> None:
        flush(file)
        if "psim/summary" in file:
            seen.append((file["psim/status"][()].decode(), len(file["psim/summary"])))

    monkeypatch.setattr(h5py.File, "flush", noted)
    with synthetic.open_writer(tmp_path / "a.vtkhdf") as writer:
        writer.close("complete", {"steps": 5})
    status, told = zip(*seen[-2:], strict=True)
    assert status == ("running", "complete")
    assert told[0] == told[1] > 0
