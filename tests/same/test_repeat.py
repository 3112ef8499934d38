"""A run is repeated from its own file, and its digest names its physics."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import particlesim as ps
from particlesim.errors import UsageError
from particlesim.scenario.digest import MOVES, physics_digest, state_digest
from particlesim.verification.rerun import rerun

SCENARIO = """
title = "Balls"
[simulation]
duration = 0.2
dt = 0.01
seed = 3
[output]
every = 5
[[particles]]
name = "balls"
layout = { type = "random", count = 4, shape = { type = "ball", radius = 1.0 } }
[[forces]]
type = "gravity"
[[checks]]
quantity = "count"
equals = 4
"""


def scenario(**overrides: object) -> ps.Scenario:
    return ps.loads(SCENARIO, {key.replace("__", "."): value for key, value in overrides.items()})


def test_a_run_repeats_itself(tmp_path) -> None:
    path = tmp_path / "a.vtkhdf"
    ps.run(scenario(simulation__dt=0.02), path)
    assert rerun(path).same
    again = rerun(path, tmp_path / "again.vtkhdf", threads=1)
    assert again.same
    assert again.frames == 3
    assert (tmp_path / "again.vtkhdf").exists()
    with pytest.raises(UsageError, match="onto itself"):
        rerun(path, path, overwrite=True)


def test_a_changed_result_is_noticed(tmp_path) -> None:
    path = tmp_path / "a.vtkhdf"
    ps.run(scenario(), path)
    with h5py.File(path, "r+") as file:
        file["VTKHDF/Points"][9, 1] += 1e-3  # the second particle of the third frame
    first = rerun(path).first
    assert first is not None
    assert (first.frame, first.particle, first.what) == (2, 1, "position.y")


def test_a_run_that_was_cut_off_is_compared_as_far_as_it_goes(tmp_path) -> None:
    path = tmp_path / "a.vtkhdf"

    def stop(progress: ps.Progress) -> None:
        if progress.frames == 3:
            raise KeyboardInterrupt

    with pytest.raises(ps.Interrupted):
        ps.run(scenario(), path, progress=stop)
    assert rerun(path).same


def test_a_divergence_repeats_itself(tmp_path) -> None:
    blowing = SCENARIO + '[[forces]]\ntype = "field"\nforce = ["1e-304*exp(5e3*t)", "0", "0"]\n'
    path = tmp_path / "a.vtkhdf"
    with pytest.raises(ps.DivergenceError):
        ps.run(ps.loads(blowing), path)
    with ps.open(path) as trajectory:
        frames = len(trajectory)
        assert trajectory.status == "diverged"
    again = rerun(path)
    assert again.same
    assert again.frames == frames > 1


EVERYTHING = """
[simulation]
duration = 1
dt = 0.01
box = { size = [10, 10, 10] }
[[particles]]
name = "a"
mass = 1
layout = { type = "points", position = [[1, 0, 0], [2, 0, 0], [3, 0, 0]] }
[[emitters]]
name = "b"
mass = 1
rate = 1301
shape = { type = "point", position = [0, 1, 0] }
direction = [0, 1, 0]
speed = 1
[[springs]]
on = "a"
pairs = [[0, 1]]
stiffness = 1303
[[angles]]
on = "a"
triples = [[0, 1, 2]]
stiffness = 1307
[[interactions]]
type = "yukawa"
strength = 1319
screening_length = 1
cutoff = 2
[[forces]]
type = "linear_drag"
coefficient = 1321
[[impulses]]
on = ["a"]
at = 0.5
impulse = [1327, 0, 0]
[[motions]]
on = "a"
particles = [0]
path = ["x + 1361*t", "y", "z"]
"""
BODIES = """
[simulation]
duration = 1
dt = 0.01
[[bodies]]
name = "c"
mass = 1301
shape = { type = "sphere", radius = 1303 }
angular_velocity = [1307, 0, 0]
[[colliders]]
type = "sphere"
center = [1319, 0, 0]
radius = 1
[[planes]]
restitution = 0.5
friction = 1321
"""


@pytest.mark.parametrize(
    ("text", "numbers"),
    [(EVERYTHING, (1301, 1303, 1307, 1319, 1321, 1327, 1361)), (BODIES, (1301, 1303, 1307, 1319, 1321))],
)
def test_the_digest_hears_of_every_part(text: str, numbers: tuple[int, ...]) -> None:
    """No part of a scenario that moves particles may be left out: a run would be resumed, or called the same that is not."""
    found = {physics_digest(ps.loads(text))}
    for number in numbers:
        assert text.count(str(number)) == 1
        found.add(physics_digest(ps.loads(text.replace(str(number), str(number + 1)))))
    assert len(found) == 1 + len(numbers)


def test_the_digest_is_that_of_the_physics() -> None:
    here = physics_digest(scenario())
    assert len(here) == 64
    assert here == physics_digest(ps.from_table({**ps_table(), "title": "Others", "checks": []}))
    assert here == physics_digest(scenario(output__precision="double", render__look="dots"))
    assert here == physics_digest(scenario(output__every=10))
    for changed in (
        scenario(simulation__seed=4),
        scenario(simulation__dt=0.02),
        scenario(simulation__precision="single"),
        scenario(forces__gravity__acceleration=[0.0, -9.8, 0.0]),
    ):
        assert physics_digest(changed) != here


def ps_table() -> dict[str, object]:
    import tomllib

    return tomllib.loads(SCENARIO)


def test_a_step_shortened_for_frames_is_another() -> None:
    # 24 frames per second shorten steps of 0.01 s to 1/120 s.
    shortened = scenario(output={"fps": 24}, simulation__duration=0.25)
    assert physics_digest(shortened) != physics_digest(scenario(simulation__duration=0.25))
    same = scenario(output={"fps": 24}, simulation__duration=0.25, simulation__dt=1 / 24 / 5)
    assert physics_digest(shortened) == physics_digest(same)


def test_files_count_by_content(tmp_path: Path) -> None:
    text = SCENARIO.replace(
        'layout = { type = "random", count = 4, shape = { type = "ball", radius = 1.0 } }',
        'layout = { type = "file", path = "start.csv" }',
    )
    digests = []
    for name, start in (("a", "x,y,z\n1,2,3\n"), ("b", "x,y,z\n1,2,3\n"), ("c", "x,y,z\n1,2,4\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "start.csv").write_text(start)
        (tmp_path / name / "balls.toml").write_text(text)
        digests.append(physics_digest(ps.load(tmp_path / name / "balls.toml")))
    assert digests[0] == digests[1] != digests[2]
    (tmp_path / "a/start.csv").unlink()
    with pytest.raises(UsageError, match=r"start\.csv"):
        physics_digest(ps.load(tmp_path / "a/balls.toml"))


def test_files_of_colliders_count_by_content(tmp_path: Path) -> None:
    collider = '[[colliders]]\ntype = "height_field"\npath = "hills.npy"\nsize = [2, 2]\nheight = 1\n'
    digests = []
    for name, top in (("a", 1.0), ("b", 1.0), ("c", 2.0)):
        (tmp_path / name).mkdir()
        np.save(tmp_path / name / "hills.npy", np.diag([1.0, 0.5, top]))
        (tmp_path / name / "balls.toml").write_text(SCENARIO + collider)
        digests.append(physics_digest(ps.load(tmp_path / name / "balls.toml")))
    assert digests[0] == digests[1] != digests[2]


def test_provenance(tmp_path) -> None:
    path = tmp_path / "a.vtkhdf"
    run = ps.loads(SCENARIO, ["simulation.dt=0.02"])
    result = ps.run(run, path)
    with ps.open(path) as trajectory:
        facts = trajectory.provenance
        assert facts["physics"] == physics_digest(run)
        assert facts["overrides"] == "simulation.dt=0.02"
        assert facts["seed"] == 3
        assert ps.loads(str(facts["scenario"])).simulation.dt == 0.02
        for name in ("psim", "python", "llvmlite", "numpy", "h5py", "platform", "host", "command", "started"):
            assert facts[name], name
    assert state_digest(result.final) == state_digest(ps.run(run).final)


@pytest.mark.parametrize("field", ["id", "position", "velocity", "orientation", "angular_velocity"])
def test_the_digest_of_a_state_hears_of_its_last_bit(field) -> None:
    final = ps.run(scenario()).final
    columns = {name: final[name].copy() for name in (*MOVES, "mass")}
    first = state_digest(columns)
    assert first == state_digest(final)
    columns["mass"] *= 2  # follows from the scenario
    assert state_digest(columns) == first
    value = columns[field].reshape(-1)[-1:]
    value.view(np.uint8)[0] ^= 1
    assert state_digest(columns) != first
