"""Truncated and damaged files: an error at once or what is intact, never a wait without end."""

import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from particlesim.errors import UsageError
from particlesim.trajectory import reader
from particlesim.trajectory.files import check_readable
from particlesim.trajectory.target import check_target

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
for case in range(120):
    data = bytearray(whole)
    if case % 2:
        data = data[: random.randrange(len(data))]
    for _ in range(random.choice([0, 1, 50]) if case % 2 else random.choice([1, 4, 100])):
        if len(data) > 48:
            data[random.randrange(48, len(data))] = random.randrange(256)
    path.write_bytes(data)
    for use in (describe, lambda p: [f[n] for f in reader.open(p) for n in f.fields], recover, describe):
        began = time.monotonic()
        try:
            use(path)
            outcomes.append("fine")
        except UsageError as error:
            assert "H5" not in error.message and "synchronously" not in error.message, error.message
            outcomes.append("refused")
        assert time.monotonic() - began < 2
print(*outcomes)
"""


@pytest.mark.parametrize("compression", ["gzip", "none"])
def test_random_damage_never_hangs(tmp_path, kill_writer, compression):
    """Killed writers' files, cut anywhere and with random bytes; HDF5 alone would wait for ever in some of them."""
    path = kill_writer(tmp_path / "a.vtkhdf", acknowledged=5, compression=compression)
    done = subprocess.run(
        [sys.executable, "-c", DAMAGE, str(path), "1"], capture_output=True, text=True, timeout=60
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
