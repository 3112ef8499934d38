"""Results and frames outlive their run, its threads and its file, and go to other processes."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import particlesim as ps
from particlesim.errors import Diagnostic, OutputExistsError, PostMortem, PsimError, ResourceError, Span
from particlesim.process.threads import Team

DUST = """\
simulation = { duration = 0.02, dt = 0.01 }
forces = [{ type = "gravity" }]
[[particles]]
name = "dust"
layout = { type = "random", count = %d, shape = { type = "box", min = [0, 0, 0], max = [1, 1, 1] } }
"""
ENOUGH_FOR_THREADS = 200_000


def fields_of(frame: ps.Frame) -> dict[str, bytes]:
    return {name: frame[name].tobytes() for name in frame.fields}


def final_of(count: int) -> ps.Result:
    return ps.run(ps.loads(DUST % count), threads=2)


def test_a_closed_team_works_alone() -> None:
    team = Team(2)
    team.close()
    team.close()
    done: list[tuple[int, int]] = []
    team.over_range(10, 2, lambda first, last: done.append((first, last)))
    team.each(lambda k: done.append((k, k)), 3)
    assert done == [(0, 10), (0, 0), (1, 1), (2, 2)]


def test_the_last_frame_of_many_particles_is_read_after_the_run() -> None:
    result = final_of(ENOUGH_FOR_THREADS)
    for name in result.final.fields:
        assert len(result.final[name]) == ENOUGH_FOR_THREADS
    alone = ps.run(ps.loads(DUST % ENOUGH_FOR_THREADS), threads=1)
    assert result.state == alone.state
    assert fields_of(result.final) == fields_of(alone.final)


@pytest.mark.parametrize("again", [lambda r: pickle.loads(pickle.dumps(r)), copy.deepcopy, copy.copy])
def test_a_result_and_its_frame_are_carried_whole(again) -> None:
    result = final_of(10)
    carried = again(result)
    assert carried.scenario == result.scenario
    assert carried.state == result.state
    assert {k: v.tolist() for k, v in carried.ledger.items()} == {
        k: v.tolist() for k, v in result.ledger.items()
    }
    assert carried.final.fields == result.final.fields
    assert fields_of(carried.final) == fields_of(result.final)
    with pytest.raises(ps.UsageError, match="unknown field"):
        carried.final["colour"]


def test_a_recorded_frame_needs_no_file_once_pickled(tmp_path: Path) -> None:
    path = tmp_path / "dust.vtkhdf"
    ps.run(ps.loads(DUST % 10), path)
    with ps.open(path) as trajectory:
        frames = pickle.loads(pickle.dumps(trajectory[:]))
        opened_anew = pickle.loads(pickle.dumps(trajectory))
        expected = [fields_of(frame) for frame in trajectory]
    with opened_anew:
        assert [fields_of(frame) for frame in opened_anew] == expected
    path.unlink()
    assert [fields_of(frame) for frame in frames] == expected


def test_a_pool_of_processes_returns_results_and_errors() -> None:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        # Functions of the package: the process need not find this file.
        result = pool.submit(ps.run, ps.loads(DUST % 10)).result()
        with pytest.raises(ps.ScenarioError, match="durations") as caught:
            pool.submit(ps.loads, DUST.replace("duration", "durations") % 10).result()
    here = final_of(10)
    assert result.state == here.state
    assert np.array_equal(result.final.velocity, here.final.velocity)
    assert caught.value.diagnostics[0].span == Span(1, 14, 31)


@pytest.mark.parametrize(
    "error",
    [
        ps.UsageError("wrong", "right"),
        OutputExistsError(Path("a.vtkhdf")),
        ResourceError("no room"),
        ps.ScenarioError([Diagnostic("wrong", "a.b", Path("a.toml"), "a = 1", Span(1, 2), hint="right")]),
        ps.DivergenceError(
            "lost", None, PostMortem("energy", 1.0, 0, "a", 1.0, (0, 0, 0), (0, 0, 0), None, 0.0, 0.1, None)
        ),
        ps.InputOutputError("full"),
        ps.Interrupted("stopped", "go on"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_are_carried_whole(error: PsimError) -> None:
    carried = pickle.loads(pickle.dumps(error))
    assert type(carried) is type(error)
    assert (str(carried), repr(carried), vars(carried)) == (str(error), repr(error), vars(error))
