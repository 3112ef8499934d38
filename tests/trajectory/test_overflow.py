"""Numbers that a run holds and its trajectory, of single precision, does not: never infinite without a word."""

import json

import numpy as np
import pytest

import particlesim as ps
from particlesim.runs.validity import Watch


def scenario(x, v, **output):
    """One particle that flies to x + v within a second, without forces."""
    return ps.from_table(
        {
            "simulation": {"duration": 1, "dt": 0.25},
            "output": {"every": 1, "ledger": False, **output},
            "particles": [
                {
                    "name": "far",
                    "layout": {"type": "points", "position": [[0, x, 0]], "velocity": [[0, v, 0]]},
                }
            ],
        }
    )


@pytest.mark.parametrize(
    ("x", "v", "field"), [(1e150, 0, "position"), (-1e39, 0, "position"), (0, 1e39, "velocity")]
)
def test_a_start_that_cannot_be_stored_is_refused(tmp_path, x, v, field):
    path = tmp_path / "a.vtkhdf"
    with pytest.raises(ps.UsageError, match=f"cannot store a {field} that is beyond 3.4e") as caught:
        ps.run(scenario(x, v), path)
    assert 'precision = "double"' in caught.value.hint
    assert not list(tmp_path.iterdir())
    assert ps.run(scenario(x, v)).final.position[0, 1] == pytest.approx(x + v, rel=1e-12)
    ps.run(scenario(x, v, precision="double"), path)
    with ps.open(path) as trajectory:
        assert trajectory[-1].position[0, 1] == pytest.approx(x + v, rel=1e-12)


def test_a_start_that_the_run_itself_cannot_hold_is_refused():
    for x, v in ((1e39, 0), (0, 1e39)):
        table = scenario(x, v).model_dump(mode="json", exclude_unset=True)
        table["simulation"]["precision"] = "single"
        with pytest.raises(ps.UsageError, match="numbers of 'far' are beyond 3"):
            ps.run(ps.from_table(table))


def test_what_grows_beyond_what_can_be_stored_is_told(tmp_path):
    """3 × 10³⁸ + 10³⁸ t passes 3.4 × 10³⁸ between 0.25 s and 0.5 s."""
    path = tmp_path / "a.vtkhdf"
    result = ps.run(scenario(3e38, 1e38), path)
    assert np.isfinite(result.final.position).all()
    (told,) = result.warnings
    assert told.startswith("position: from t = 0.5 s on, some are beyond 3.4e+38 and stored as infinite")
    with ps.open(path) as trajectory:
        finite = [bool(np.isfinite(frame.position).all()) for frame in trajectory]
    assert finite == [True, True, False, False, False]
    assert not ps.run(scenario(3e38, 1e38, precision="double"), path, overwrite=True).warnings


def test_a_resumed_run_has_not_forgotten_it():
    watch, later = Watch(scenario(0, 0)), Watch(scenario(0, 0))
    watch.overflowed("position", 0.5)
    watch.overflowed("position", 0.75)
    later.restore(json.loads(json.dumps(watch.state())))
    assert later.warnings == watch.warnings
    assert "t = 0.5 s" in later.warnings[0]
