"""A resumed run ends with the bytes of one that was never stopped."""

import pytest

import particlesim as ps
from particlesim.trajectory.checkpoint_file import checkpoint_path, previous_path

KINDS = [
    "fountain",
    "cloth",
    "memory",
    "adaptive",
    "rods",
    "pairs",
    "bodies",
    "swift",
    "grains",
    "hard",
    "asleep",
    "crushed",
]


@pytest.mark.sampled(8)
@pytest.mark.parametrize("kind", KINDS)
def test_stopped_twice_and_resumed(tmp_path, resume, whole, kind):
    scenario = ps.from_table(resume.kinds[kind])
    path = tmp_path / "a.vtkhdf"
    uninterrupted = ps.run(scenario)
    for frames in (3, 9):
        with pytest.raises(ps.Interrupted):
            ps.run(scenario, path, resume=True, progress=resume.stop_at(frames))
        assert checkpoint_path(path).exists()
        with ps.open(path) as trajectory:
            assert trajectory.status == "interrupted"
            assert frames <= len(trajectory) <= frames + 1
    result = ps.run(scenario, path, resume=True)
    resume.same(path, whole(kind))
    assert not checkpoint_path(path).exists()
    assert not previous_path(path).exists()
    assert result.particle_steps == uninterrupted.particle_steps
    assert result.died == uninterrupted.died
    assert result.broken == uninterrupted.broken
    assert result.checks == uninterrupted.checks
    assert {k: v.tobytes() for k, v in result.ledger.items()} == {
        k: v.tobytes() for k, v in uninterrupted.ledger.items()
    }
    assert result.final.position.tobytes() == uninterrupted.final.position.tobytes()
