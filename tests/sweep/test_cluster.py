"""Sweeps on a real Dask cluster of this machine: the same results, lost workers, other versions, nobody there."""

from __future__ import annotations

import csv
import importlib
import os
import signal
import socket
import subprocess
import sys
import time
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from particlesim.errors import InputOutputError, UsageError
from particlesim.sweep import Design, InProcess, Sweep, SweepProgress, parse_axis
from particlesim.sweep.cluster import DaskExecutor, _next_size, do_chunk, scheduler, slurm

HERE = Path(__file__).parent
SCENARIO = """
[simulation]
duration = 0.2
dt = 0.01
[[particles]]
layout = { type = "random", count = 20, shape = { type = "ball", radius = 1.0 } }
[[forces]]
type = "gravity"
"""


def test_chunks_grow_to_half_a_second() -> None:
    assert _next_size(1, 10.0) == 1
    assert _next_size(4, 0.01) == 8
    assert _next_size(8, 0.05) == 10
    assert _next_size(256, 0.0) == 256


def test_a_worker_that_came_later_with_another_version() -> None:
    with pytest.raises(UsageError, match=r"psim .* and this is 0\.0"):
        do_chunk(abs, [1], "0.0")
    assert do_chunk(abs, [-1, 2], importlib.import_module("particlesim.version").__version__)[0] == [1, 2]


LOCAL = {"threads_per_worker": 1, "dashboard_address": "127.0.0.1:0", "host": "127.0.0.1"}
"""A cluster for nobody but these tests, on ports that are free."""


@pytest.fixture(scope="module")
def cluster(tmp_path_factory) -> Iterator[Any]:
    """Two worker processes on this machine, which are gone afterwards."""
    distributed = pytest.importorskip("distributed")
    dask, psutil = (importlib.import_module(name) for name in ("dask", "psutil"))
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(str(HERE))
    patch.setenv("PYTHONPATH", ":".join(path for path in sys.path if path))
    patch.setenv("PSIM_TEST_MARK", str(tmp_path_factory.mktemp("mark") / "mark"))
    before = set(psutil.Process().children(recursive=True))
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(n_workers=2, **LOCAL) as made,
    ):
        yield made
        mine = set(psutil.Process().children(recursive=True)) - before
        address = made.scheduler_address
    patch.undo()
    workers = [process for process in mine if "resource_tracker" not in " ".join(command_of(process))]
    assert psutil.wait_procs(workers, timeout=10)[1] == []
    with socket.socket() as port, pytest.raises(OSError, match="refused"):
        port.connect(("127.0.0.1", int(address.rpartition(":")[2])))


def command_of(process: Any) -> list[str]:
    """The command line of a process, empty for one that has ended."""
    try:
        return list(process.cmdline())
    except importlib.import_module("psutil").Error:
        return []


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as lines:
        return [{k: v for k, v in row.items() if k != "seconds"} for row in csv.DictReader(lines)]


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_the_same_table_as_in_one_process_with_a_worker_killed_in_the_middle(cluster, tmp_path) -> None:
    distributed = pytest.importorskip("distributed")
    file = tmp_path / "balls.toml"
    file.write_text(SCENARIO)
    sweep = Sweep(
        file, Design((parse_axis("simulation.seed=linspace(1, 40, 40)"), parse_axis("simulation.dt=0.01,-1")))
    )
    here = sweep.run(tmp_path / "here", executor=InProcess())
    with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
        victims = [next(iter(client.run(os.getpid).values()))]

    def kill(now: SweepProgress) -> None:
        if now.ended >= 7 and victims:
            os.kill(victims.pop(), signal.SIGKILL)

    with scheduler(cluster.scheduler_address) as executor:
        there = sweep.run(tmp_path / "there", executor=executor, progress=kill)
    assert not victims
    assert there.counts == here.counts == {"done": 40, "bad_scenario": 40}
    assert rows(there.table) == rows(here.table)
    state = [(tmp_path / where / "0001/scenario.toml").read_bytes() for where in ("here", "there")]
    assert state[0] == state[1]


@pytest.mark.slow
def test_lost_workers_are_replaced(cluster) -> None:
    """Run 3 takes its worker down the first time, run 5 always."""
    fragile = importlib.import_module("fragile_task").fragile
    with scheduler(cluster.scheduler_address) as executor:
        assert dict(executor.each(fragile, range(1, 8))) == {
            k: (None if k == 5 else k * k) for k in range(1, 8)
        }


def test_another_version_is_refused(cluster) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
        client.wait_for_workers(1, timeout=30)  # they may still be on their way back from the test before
        with pytest.raises(UsageError, match=r"has psim .*, and this is 99\.0") as caught:
            DaskExecutor(client, version="99.0")
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    "error",
    [ModuleNotFoundError("No module named 'particlesim'"), Exception("ImportError('no particlesim here')")],
    ids=["raised", "passed on as text"],
)
def test_a_worker_without_psim_is_told(error: Exception) -> None:
    class Client:
        def run(self, function: object) -> None:
            raise error

    with pytest.raises(UsageError, match="a worker cannot import psim") as caught:
        DaskExecutor(Client())  # type: ignore[arg-type]
    assert "Install the same" in str(caught.value.hint)


def test_other_errors_of_workers_are_not_taken_for_that() -> None:
    class Client:
        def run(self, function: object) -> None:
            raise RuntimeError("out of memory")

    with pytest.raises(RuntimeError, match="out of memory"):
        DaskExecutor(Client())  # type: ignore[arg-type]


CLUSTER = """
import sys, time
from distributed import LocalCluster
local = {"processes": False, "protocol": "tcp", "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
print(LocalCluster(n_workers=1, threads_per_worker=1, **local).scheduler_address, flush=True)
time.sleep(120)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_a_scheduler_that_dies(tmp_path) -> None:
    """What has ended is in the table, and the same command continues."""
    pytest.importorskip("distributed")
    file = tmp_path / "balls.toml"
    file.write_text(SCENARIO)
    sweep = Sweep(file, Design((parse_axis("simulation.seed=linspace(1, 2000, 2000)"),)))
    with subprocess.Popen([sys.executable, "-c", CLUSTER], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()

        def kill(now: SweepProgress) -> None:
            if now.ended >= 5:
                process.kill()

        with pytest.raises(InputOutputError, match="the scheduler is lost") as caught:  # noqa: SIM117
            with scheduler(address, timeout=3) as executor:
                sweep.run(tmp_path / "out", executor=executor, progress=kill)
    assert caught.value.exit_code == 4
    assert "the same command continues" in str(caught.value.hint)
    assert 5 <= len(rows(tmp_path / "out/results.csv")) < 2000


def test_slurm_through_its_jobqueue(monkeypatch, tmp_path) -> None:
    """dask-jobqueue's class in the place of which stands a cluster of this machine."""
    distributed = pytest.importorskip("distributed")

    class SLURMCluster(distributed.LocalCluster):
        def __init__(self) -> None:
            super().__init__(n_workers=0, **LOCAL)

    module = types.ModuleType("dask_jobqueue")
    module.SLURMCluster = SLURMCluster  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "dask_jobqueue", module)
    with slurm(1) as executor:
        assert dict(executor.each(abs, [-1, 2])) == {-1: 1, 2: 2}

    def broken() -> None:
        raise ValueError("you must specify how many cores")

    module.SLURMCluster = broken  # type: ignore[attr-defined]
    with pytest.raises(UsageError, match="how many cores"), slurm(1):
        pass


@pytest.mark.parametrize("silent", [False, True], ids=["closed", "silent"])
def test_nobody_answers(silent) -> None:
    """Nothing listens at the address, or something does that is no scheduler and says nothing."""
    pytest.importorskip("distributed")
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        if silent:
            other.listen()
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(UsageError, match="no scheduler answers at"), scheduler(address, timeout=0.5):
            pass
        assert time.monotonic() - began < 10


def test_a_scheduler_without_workers() -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=0, **LOCAL) as empty,
        pytest.raises(UsageError, match=r"has no workers after 0\.3 s"),
        scheduler(empty.scheduler_address, timeout=0.3),
    ):
        pass


def test_without_dask(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    with pytest.raises(UsageError, match="needs dask-jobqueue"), slurm(1):
        pass
    with pytest.raises(UsageError, match="clusters need Dask"), scheduler("tcp://127.0.0.1:1"):
        pass
