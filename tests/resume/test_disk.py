"""Disks that fail in the middle of a run: exit code 4, a readable trajectory, and a run that can go on."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import particlesim as ps
from particlesim.scenario.dump import dump
from particlesim.trajectory import frame_file

FULL = """
import resource, signal, sys
from pathlib import Path
sys.path.insert(0, {folder!r})
from conftest import KINDS, assert_same
import particlesim as ps
from particlesim.trajectory import frame_file

def limit(size):
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

def unlimited_memory_file(make=frame_file._memory_file):
    limit(resource.RLIM_INFINITY)  # the limit stands for a full disk, and memory is none
    return make()

frame_file._memory_file = unlimited_memory_file
scenario, path, whole = ps.from_table(KINDS["memory"]), Path({path!r}), Path({whole!r})
limit({limit})
try:
    ps.run(scenario, path, checkpoint_every=0.1)
except ps.InputOutputError as error:
    print(error.exit_code, error.message)
limit(resource.RLIM_INFINITY)
with ps.open(path) as trajectory:
    print(trajectory.status, len(trajectory), len(trajectory[-1].position))
ps.run(scenario, path, resume=True)
assert_same(path, whole)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
def test_a_full_disk(tmp_path, whole):
    reference = whole("memory")
    script = FULL.format(
        folder=str(Path(__file__).parent),
        path=str(tmp_path / "a.vtkhdf"),
        whole=str(reference),
        limit=int(0.7 * reference.stat().st_size),
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    failed, read = done.stdout.splitlines()
    assert failed.startswith("4 writing")
    assert "File too large" in failed
    status, frames, _ = read.split()
    assert status == "failed"
    assert int(frames) > 3


@pytest.mark.skipif(sys.platform == "win32", reason="open files cannot be moved there")
def test_a_folder_that_vanishes(tmp_path, resume):
    folder, away = tmp_path / "disk", tmp_path / "elsewhere"

    def vanish(now):
        if now.frames == 8 and folder.exists():
            folder.rename(away)

    with pytest.raises(ps.InputOutputError, match="No such file") as caught:
        ps.run(ps.from_table(resume.kinds["memory"]), folder / "a.vtkhdf", progress=vanish)
    assert caught.value.exit_code == 4
    with ps.open(away / "a.vtkhdf") as trajectory:
        assert trajectory.status in ("failed", "interrupted")
        assert 7 <= len(trajectory) <= 8
        assert len(trajectory[-1].position)
    assert not folder.exists()


@pytest.mark.parametrize("number", [errno.EROFS, errno.EIO, errno.ENODEV], ids=errno.errorcode.get)
def test_a_disk_that_becomes_read_only_or_breaks(tmp_path, resume, whole, monkeypatch, number):
    """From the sixth frame on the system refuses every write to the file, the one of its status among them."""
    path, complete, written = tmp_path / "a.vtkhdf", whole("memory"), []
    write, end = frame_file.FrameFile._write_columns, os.pwrite

    def refuse(*_):
        raise OSError(number, os.strerror(number))

    def write_some(self, frame, index):
        written.append(index)
        return write(self, frame, index) if len(written) <= 5 else refuse()

    monkeypatch.setattr(frame_file.FrameFile, "_write_columns", write_some)
    monkeypatch.setattr(os, "pwrite", refuse)
    scenario = ps.from_table(resume.kinds["memory"])
    with pytest.raises(ps.InputOutputError, match=os.strerror(number)) as caught:
        ps.run(scenario, path, checkpoint_every=0.1)
    assert caught.value.exit_code == 4
    with ps.open(path) as trajectory, ps.open(complete) as reference:
        assert trajectory.status in ("failed", "interrupted")
        assert 4 <= len(trajectory) <= 5
        for frame, expected in zip(trajectory, reference, strict=False):
            assert frame.position.tobytes() == expected.position.tobytes()
    monkeypatch.setattr(frame_file.FrameFile, "_write_columns", write)
    monkeypatch.setattr(os, "pwrite", end)
    ps.run(scenario, path, resume=True)
    resume.same(path, complete)


FILLED = """
import sys
from pathlib import Path
import particlesim as ps

scenario, path = map(Path, sys.argv[1:])

def fill(now):
    if now.frames == 8:
        with (path.parent / "other").open("wb", buffering=0) as other:
            while other.write(bytes(4096)) == 4096:
                pass

def fill_up(now):
    try:
        fill(now)
    except OSError:
        pass

try:
    ps.run(scenario, path, progress=fill_up, checkpoint_every=0.1)
except ps.InputOutputError as error:
    print(error, file=sys.stderr)
    print("exit code", error.exit_code)
"""
OWN_DISK = """
set -e
mount -t tmpfs -o size=4m none {disk}
psim() {{ {python} -m psim run {scenario} -o {disk}/a.vtkhdf --quiet "$@" || echo "exit code $?"; }}
{python} {filled} {scenario} {disk}/a.vtkhdf
cp {disk}/a.vtkhdf {out}/failed.vtkhdf
rm {disk}/other
psim --resume
cp {disk}/a.vtkhdf {out}/resumed.vtkhdf
mount -o remount,ro {disk}
psim --force
"""


def can_mount() -> bool:
    """Whether a process may have mounts of its own here."""
    asked = ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"]
    return shutil.which("unshare") is not None and not subprocess.run(asked, capture_output=True).returncode


@pytest.mark.skipif(not can_mount(), reason="needs mounts of its own")
def test_a_real_disk_that_others_fill_and_that_is_read_only_then(tmp_path, resume, whole):
    """A file system for this test alone: full in the middle (4), with space again (done), and read-only (4)."""
    reference = whole("memory")
    (tmp_path / "disk").mkdir()
    (tmp_path / "a.toml").write_text(dump(ps.from_table(resume.kinds["memory"])), encoding="utf-8")
    (tmp_path / "filled.py").write_text(FILLED, encoding="utf-8")
    script = OWN_DISK.format(
        filled=tmp_path / "filled.py",
        disk=tmp_path / "disk",
        python=sys.executable,
        scenario=tmp_path / "a.toml",
        out=tmp_path,
    )
    done = subprocess.run(["unshare", "-rm", "sh", "-c", script], capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n") == ["exit code 4", "exit code 4", ""], done.stderr
    assert "disk is full" in done.stderr
    assert "cannot write into" in done.stderr
    with ps.open(tmp_path / "failed.vtkhdf") as trajectory:
        assert trajectory.status == "failed"
        assert len(trajectory) > 3
        assert len(trajectory[-1].position)
    resume.same(tmp_path / "resumed.vtkhdf", reference)
