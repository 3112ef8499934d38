"""When checkpoints are made by themselves, on a clock of the test's own; and that a killed run goes on from one."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections import namedtuple
from pathlib import Path
from types import SimpleNamespace

import pytest

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import snapshot, weight
from particlesim.runs import checkpoints
from particlesim.runs.checkpoints import SHARE, SPEED, Keeper, Saving

Usage = namedtuple("Usage", "free")


class Clock:
    """Seconds that pass only when the test lets them; copying and writing a checkpoint take `cost` of them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, cost: float, weight: float, free: float) -> None:
        self.now, self.cost = 1000.0, cost
        monkeypatch.setattr(checkpoints, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(checkpoints, "weight", lambda _: weight)
        monkeypatch.setattr(checkpoints, "snapshot", self.copy)
        monkeypatch.setattr(checkpoints, "write_checkpoint", self.write)
        monkeypatch.setattr(checkpoints.shutil, "disk_usage", lambda _: Usage(free))

    def copy(self, _):
        self.now += 0.25 * self.cost
        return SimpleNamespace(numbers={}, arrays={})

    def write(self, *_):
        self.now += 0.75 * self.cost


@pytest.fixture
def saved(monkeypatch, tmp_path):
    """The times [s] after its beginning at which a run of `until` seconds makes checkpoints."""

    def times(saving: Saving, until: float, cost: float = 0.0, weight: float = 0.0, free: float = 1e12):
        clock = Clock(monkeypatch, cost, weight, free)
        writer = SimpleNamespace(path=tmp_path / "a.vtkhdf", run="a", wait_for=lambda _: None)
        keeper = Keeper(writer, saving)  # type: ignore[arg-type]
        made: list[float] = []

        def facts() -> dict[str, float]:
            made.append(clock.now - 1000.0)
            return {}

        for k in itertools.count():
            if clock.now > 1000.0 + until:
                break
            simulation = SimpleNamespace(time=0.001 * k)
            keeper.look(simulation, k, facts)  # type: ignore[arg-type]
            keeper.close()
            clock.now += 0.125
        return made, keeper.problem

    return times


def test_they_begin_after_a_second_and_grow_apart(saved):
    assert saved(Saving(None, None), 200) == ([1, 3, 7, 15, 31, 63, 123, 183], None)


@pytest.mark.parametrize("cost", [0.05, 0.5, 4.0])
def test_they_take_two_percent_at_most(saved, cost):
    made, _ = saved(Saving(None, None), 1000, cost, weight=0.5 * cost * SPEED)
    assert len(made) >= 3
    for number, at in enumerate(made[1:], 1):
        assert number * cost <= SHARE * at


def test_a_big_state_waits_for_its_first(saved):
    made, _ = saved(Saving(None, None), 1000, cost=1.0, weight=SPEED)
    assert made[0] == 1 / SHARE


def test_those_that_are_asked_for_are_made(saved):
    assert saved(Saving(None, 5.0), 16, cost=1.0, weight=1e12, free=0.0)[0] == [5, 11]
    assert saved(Saving(0.02, 1e9), 8, weight=1e12, free=0.0)[0] == [2.5, 5, 7.5]


def test_they_leave_room_on_the_disk(saved):
    made, problem = saved(Saving(None, None), 20, weight=1e6, free=1.9e6)
    assert made == []
    assert problem is not None
    assert "it takes 1.0 MB, and 1.9 MB are free" in problem


def test_what_a_snapshot_weighs(resume):
    simulation = Simulation(ps.from_table(resume.kinds["cloth"]))
    taken = snapshot(simulation)
    simulation.close()
    assert weight(simulation) == sum(array.nbytes for array in taken.arrays.values())
    assert not any(array.base is not None for array in taken.arrays.values())


KILLED = """
import os, signal, sys, time
from pathlib import Path
sys.path.insert(0, {folder!r})
from conftest import KINDS
import particlesim as ps
from particlesim.trajectory.checkpoint_file import checkpoint_path

path = Path({path!r})

def progress(now):
    if checkpoint_path(path).exists():
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.2)

ps.run(ps.from_table(KINDS["memory"]), path, progress=progress)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed")
def test_a_run_killed_in_its_first_minute_goes_on(tmp_path, resume, whole):
    path = tmp_path / "a.vtkhdf"
    script = KILLED.format(folder=str(Path(__file__).parent), path=str(path))
    killed = subprocess.run([sys.executable, "-c", script], timeout=120)
    assert killed.returncode == -9
    result = ps.run(ps.from_table(resume.kinds["memory"]), path, resume=True)
    assert not any("started from the beginning" in text for text in result.warnings)
    resume.same(path, whole("memory"))
