"""Disks that fail in the middle of a run: exit code 4, a readable trajectory, and a run that can go on."""

import subprocess
import sys
from pathlib import Path

import pytest

import particlesim as ps

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
