"""What cannot be resumed is refused before anything is touched; where there is nothing to resume, nothing is harmed."""

import copy
import random
import shutil
import time
from contextlib import suppress

import h5py
import pytest

import particlesim as ps
from particlesim.runs import runner
from particlesim.runs.resume import find
from particlesim.trajectory.checkpoint_file import checkpoint_path, previous_path
from particlesim.trajectory.hdf5 import open_for_frames
from particlesim.trajectory.superblock import clear_mark

SLOW = {
    "simulation": {"duration": 1.0, "dt": 0.01},
    "output": {"every": 5},
    "particles": [{"name": "ball", "layout": {"type": "points", "position": [[0, 1, 0]]}, "mass": 0.1}],
    "forces": [{"type": "gravity"}],
}


def changed(**parts):
    table = copy.deepcopy(SLOW)
    for section, values in parts.items():
        table[section] |= values
    return ps.from_table(table)


@pytest.fixture
def stopped(tmp_path, resume):
    """A run that was stopped, and its trajectory."""
    path = tmp_path / "a.vtkhdf"
    with pytest.raises(ps.Interrupted):
        ps.run(changed(), path, checkpoint_every=0.1, progress=resume.stop_at(8))
    assert previous_path(path).exists()
    return path


def refuse(path, words, scenario=None, **options):
    before = {p: p.read_bytes() for p in path.parent.iterdir()}
    with pytest.raises(ps.UsageError, match=words) as caught:
        ps.run(scenario or changed(), path, resume=True, **options)
    assert caught.value.hint
    assert {p: p.read_bytes() for p in path.parent.iterdir()} == before


def test_a_changed_scenario_is_refused_with_what_changed(stopped):
    scenario = changed(simulation={"dt": 0.005}, output={"precision": "double"})
    refuse(stopped, r"simulation.dt: 0.01 → 0.005; output.precision: 'single' → 'double'", scenario)


def test_changes_without_effect_are_welcome(stopped):
    table = copy.deepcopy(SLOW) | {"title": "Now with a title", "render": {"look": "spheres"}}
    table["output"]["checkpoint_wall"] = 5.0
    assert ps.run(ps.from_table(table), stopped, resume=True).steps == 100


def test_a_damaged_checkpoint_gives_way_to_the_one_before(stopped, tmp_path, resume):
    data = bytearray(checkpoint_path(stopped).read_bytes())
    middle = slice(
        len(data) // 2, len(data) // 2 + 300
    )  # longer than what a ZIP archive holds without a checksum
    data[middle] = bytes(byte ^ 255 for byte in data[middle])
    checkpoint_path(stopped).write_bytes(data)
    result = ps.run(changed(), stopped, resume=True)
    assert "continued from the previous checkpoint" in result.warnings[0]
    ps.run(changed(), tmp_path / "whole.vtkhdf")
    resume.same(stopped, tmp_path / "whole.vtkhdf")


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04" + bytes(200)])
def test_two_damaged_checkpoints_are_refused(stopped, content):
    for path in (checkpoint_path(stopped), previous_path(stopped)):
        path.write_bytes(content)
    refuse(stopped, "is damaged, or no checkpoint")


def test_truncated_checkpoints_are_refused(stopped):
    previous_path(stopped).unlink()
    data = checkpoint_path(stopped).read_bytes()
    for size in range(1, len(data), 997):
        checkpoint_path(stopped).write_bytes(data[:size])
        refuse(stopped, "is damaged, or no checkpoint")


def test_a_foreign_checkpoint_is_refused(stopped, tmp_path, resume):
    other = tmp_path / "other" / "b.vtkhdf"
    with pytest.raises(ps.Interrupted):
        ps.run(changed(), other, progress=resume.stop_at(8))
    shutil.copy(checkpoint_path(other), checkpoint_path(stopped))
    shutil.rmtree(other.parent)
    refuse(stopped, "belongs to another run")


def test_a_trajectory_that_is_shorter_than_its_checkpoint_is_refused(stopped):
    from particlesim.trajectory.continuation import cut_to

    cut_to(stopped, 3, {})
    refuse(stopped, "belongs to another run")


def test_options_that_contradict(stopped):
    refuse(stopped, "continues a run", overwrite=True)
    with pytest.raises(ps.UsageError, match="without an output"):
        ps.run(changed(), resume=True)
    for name in ("max_wall", "checkpoint_wall", "checkpoint_every"):
        with pytest.raises(ps.UsageError, match="greater than 0"):
            ps.run(changed(), **{name: 0.0})


def test_nothing_to_resume(tmp_path):
    path = tmp_path / "a.vtkhdf"
    first = ps.run(changed(), path, resume=True)
    assert first.steps == 100
    before = path.read_bytes()
    again = ps.run(changed(), path, resume=True)
    assert path.read_bytes() == before
    assert "nothing was left to do" in again.warnings[0]
    assert (again.steps, again.particle_steps, again.state) == (100, 100, first.state)
    assert again.ledger.keys() == first.ledger.keys()


def test_a_run_without_a_checkpoint_begins_anew(stopped, tmp_path, resume):
    for path in (checkpoint_path(stopped), previous_path(stopped)):
        path.unlink()
    result = ps.run(changed(), stopped, resume=True)
    assert "started from the beginning" in result.warnings[0]
    ps.run(changed(), tmp_path / "whole.vtkhdf")
    resume.same(stopped, tmp_path / "whole.vtkhdf")


def test_a_new_run_takes_old_checkpoints_away(stopped):
    ps.run(changed(), stopped, overwrite=True)
    assert not checkpoint_path(stopped).exists()
    assert not previous_path(stopped).exists()


def test_the_longest_time(tmp_path, resume):
    path = tmp_path / "a.vtkhdf"
    with pytest.raises(ps.Interrupted, match="stopped after 1e-06 s, as asked"):
        ps.run(changed(), path, max_wall=1e-6)
    ps.run(changed(), path, resume=True)
    ps.run(changed(), tmp_path / "whole.vtkhdf")
    resume.same(path, tmp_path / "whole.vtkhdf")


def refuse_damage(path, place, bit, words):
    """One bit is wrong; the hint says what can be done about it."""
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)
    with pytest.raises(ps.UsageError, match=words) as caught:
        find(changed(), path)
    assert "--force" in caught.value.hint


def test_damage_in_the_frames_that_are_kept_is_refused(stopped):
    with h5py.File(stopped, "r") as file:
        chunk = file["VTKHDF/PointData/velocity"].id.get_chunk_info(1)
    refuse_damage(stopped, chunk.byte_offset + chunk.size // 2, 3, "'velocity' of frame 1 cannot be read")


def test_damage_in_the_scenario_is_refused(stopped):
    refuse_damage(stopped, stopped.read_bytes().index(b"[simulation]"), 5, "its scenario cannot be read")


def test_tables_that_contradict_each_other_are_refused(stopped):
    with h5py.File(stopped, "r") as file:
        place = file["VTKHDF/Steps/Values"].id.get_chunk_info(0).byte_offset
    refuse_damage(stopped, place + 8 + 6, 0, "contradict each other")


def test_no_bit_of_structure_makes_a_resume_hang_or_fail_otherwise(stopped):
    """HDF5's own structures, and whatever else is where they are: refused at once, or of no effect."""
    whole, random_ = stopped.read_bytes(), random.Random(5)
    places = [i for name in (b"EAHD", b"EAIB", b"OHDR", b"GCOL", b"FSHD") for i in _all(whole, name)]
    for place in [p + random_.randrange(30) for p in random_.sample(places, min(30, len(places)))]:
        data = bytearray(whole)
        data[place] ^= 1 << random_.randrange(8)
        stopped.write_bytes(data)
        began = time.monotonic()
        with suppress(ps.UsageError):
            find(changed(), stopped)
        assert time.monotonic() - began < 5


def _all(data, part):
    return [i for i in range(len(data) - len(part)) if data[i : i + len(part)] == part]


def test_a_writer_does_not_wait_for_what_is_damaged(stopped):
    """HDF5 as it comes would read a damaged index a hundred times, with waits that double, and hear no signal."""
    clear_mark(stopped)
    data = bytearray(stopped.read_bytes())
    for place in _all(bytes(data), b"EAHD"):
        data[place + 6] ^= 1
    stopped.write_bytes(data)
    began = time.monotonic()
    with pytest.raises((OSError, RuntimeError, KeyError)), open_for_frames(stopped) as file:
        file["VTKHDF/Points"][()]
    assert time.monotonic() - began < 5


def test_a_file_that_a_run_is_writing_is_not_replaced(tmp_path, monkeypatch):
    """Not even with overwrite=True, and told before anything is computed."""
    path, refused = tmp_path / "a.vtkhdf", []

    def progress(now):
        if now.frames == 5 and not refused:
            with monkeypatch.context() as patch:
                patch.setattr(runner, "needs", lambda scenario: pytest.fail("it began"))
                with pytest.raises(ps.UsageError, match="being written"):
                    ps.run(changed(), path, overwrite=True)
            refused.append(True)

    ps.run(changed(), path, progress=progress)
    assert refused
    with ps.open(path) as trajectory:
        assert trajectory.status == "complete"
