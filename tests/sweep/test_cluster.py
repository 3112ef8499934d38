"""Sweeps on a real Dask cluster of this machine: the same results, lost workers, other versions, nobody there."""

from __future__ import annotations

import csv
import importlib
import socket
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from particlesim.errors import UsageError
from particlesim.sweep import Design, InProcess, Sweep, parse_axis
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


@pytest.fixture(scope="module")
def cluster(tmp_path_factory) -> Iterator[Any]:
    """Two worker processes on this machine."""
    distributed = pytest.importorskip("distributed")
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(str(HERE))
    patch.setenv("PYTHONPATH", ":".join(path for path in sys.path if path))
    patch.setenv("PSIM_TEST_MARK", str(tmp_path_factory.mktemp("mark") / "mark"))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as made:
        yield made
    patch.undo()


pytestmark = pytest.mark.filterwarnings("default")  # of Dask and Tornado


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as lines:
        return [{k: v for k, v in row.items() if k != "seconds"} for row in csv.DictReader(lines)]


def test_the_same_table_as_in_one_process(cluster, tmp_path) -> None:
    file = tmp_path / "balls.toml"
    file.write_text(SCENARIO)
    sweep = Sweep(
        file, Design((parse_axis("simulation.seed=linspace(1, 40, 40)"), parse_axis("simulation.dt=0.01,-1")))
    )
    here = sweep.run(tmp_path / "here", executor=InProcess())
    with scheduler(cluster.scheduler_address) as executor:
        there = sweep.run(tmp_path / "there", executor=executor)
    assert there.counts == here.counts == {"done": 40, "bad_scenario": 40}
    assert rows(there.table) == rows(here.table)
    state = [(tmp_path / where / "0001/scenario.toml").read_bytes() for where in ("here", "there")]
    assert state[0] == state[1]


def test_lost_workers_are_replaced(cluster) -> None:
    """Run 3 takes its worker down the first time, run 5 always."""
    fragile = importlib.import_module("fragile_task").fragile
    with scheduler(cluster.scheduler_address) as executor:
        assert dict(executor.each(fragile, range(1, 8))) == {
            k: (None if k == 5 else k * k) for k in range(1, 8)
        }


def test_another_version_is_refused(cluster) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.Client(cluster.scheduler_address, set_as_default=False) as client,
        pytest.raises(UsageError, match=r"has psim .*, and this is 99\.0"),
    ):
        DaskExecutor(client, version="99.0")


def test_slurm_through_its_jobqueue(monkeypatch, tmp_path) -> None:
    """dask-jobqueue's class in the place of which stands a cluster of this machine."""
    distributed = pytest.importorskip("distributed")

    class SLURMCluster(distributed.LocalCluster):
        def __init__(self) -> None:
            super().__init__(n_workers=0, threads_per_worker=1, dashboard_address=None, host="127.0.0.1")

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


def test_nobody_answers() -> None:
    pytest.importorskip("distributed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(UsageError, match="no scheduler answers at"), scheduler(address, timeout=0.5):
        pass


def test_without_dask(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    with pytest.raises(UsageError, match="needs dask-jobqueue"), slurm(1):
        pass
    with pytest.raises(UsageError, match="clusters need Dask"), scheduler("tcp://127.0.0.1:1"):
        pass
