"""What cannot be resumed is refused before anything is touched; where there is nothing to resume, nothing is harmed."""

import copy
import shutil

import pytest

import particlesim as ps
from particlesim.trajectory.checkpoint_file import checkpoint_path, previous_path

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
    assert "went on from the one before it" in result.warnings[0]
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
    refuse(stopped, "goes on", overwrite=True)
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
    assert "began anew" in result.warnings[0]
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
