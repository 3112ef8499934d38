"""Sweeps equal single runs bit by bit, survive interruption and lost workers, and tell how every run ended."""

from __future__ import annotations

import csv
import importlib
import json
import multiprocessing
import shutil
import sys
import time
from pathlib import Path

import pytest

import particlesim as ps
from particlesim.errors import ScenarioError, UsageError
from particlesim.scenario.digest import state_digest
from particlesim.sweep import Design, InProcess, LocalWorkers, Sweep, SweepProgress, SweepResult, parse_axis
from particlesim.sweep.plotting import check_plot, plot_table

SCENARIO = """
format = 1
[simulation]
duration = 0.2
dt = 0.01
[output]
every = 10
[[particles]]
layout = { type = "random", count = 20, shape = { type = "ball", radius = 1.0 } }
radius = 0.1
[[forces]]
type = "gravity"
[[forces]]
name = "air"
type = "linear_drag"
coefficient = 0.1
[[checks]]
name = "slow"
quantity = "speed"
statistic = "max"
max = 10.0
"""


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "balls.toml"
    path.write_text(SCENARIO)
    return path


def sweep(file: Path, *vary: str, **options) -> Sweep:
    return Sweep(file, Design(tuple(parse_axis(text) for text in vary)), **options)


def rows(result: SweepResult) -> list[dict[str, str]]:
    with result.table.open(newline="") as lines:
        return list(csv.DictReader(lines))


def facts(result: SweepResult) -> list[dict[str, str]]:
    """The table without wall times."""
    return [{key: value for key, value in row.items() if key != "seconds"} for row in rows(result)]


def test_equal_to_single_runs_whatever_the_workers(file, tmp_path) -> None:
    vary = ("forces.air.coefficient=linspace(0, 1, 3)", "simulation.seed=1,2")
    one = sweep(file, *vary).run(tmp_path / "one", workers=1)
    two = sweep(file, *vary).run(tmp_path / "two", workers=2)
    assert one.exit_code == two.exit_code == 0
    assert [row["run"] for row in rows(two)] == ["1", "2", "3", "4", "5", "6"]
    assert facts(one) == facts(two)
    for row in rows(two):
        number = int(row["run"])
        folder = tmp_path / "two" / f"{number:04}"
        single = ps.run(
            ps.load(
                file,
                {
                    "forces.air.coefficient": float(row["forces.air.coefficient"]),
                    "simulation.seed": int(row["simulation.seed"]),
                },
            )
        )
        assert row["kinetic"] == repr(float(single.ledger["kinetic"][-1]))
        assert row["energy"] == repr(float(single.energy[-1]))
        assert row["check slow"] == repr(single.checks[0].value)
        result = json.loads((folder / "result.json").read_text())
        assert result["state"] == state_digest(single.final)
        again = ps.run(ps.load(folder / "scenario.toml"))  # the resolved scenario gives the same run
        assert state_digest(again.final) == result["state"]


def test_every_end_is_a_row(file, tmp_path) -> None:
    vary = sweep(
        file, "simulation.dt=0.01,-1,0.02", "forces.air.coefficient=0.1,1e200", "checks.slow.max=10,1"
    )
    result = vary.run(tmp_path / "out", executor=InProcess())
    states = [row["status"] for row in rows(result)]
    assert states[0] == "done"
    assert states[1] == "check_failed"
    assert states[4:8] == ["bad_scenario"] * 4
    assert states[2] == states[10] == "diverged"
    assert "greater than 0" in rows(result)[4]["cause"]
    assert rows(result)[1]["cause"].startswith("slow is not ≤ 1")
    assert rows(result)[2]["kinetic"] == ""
    assert result.exit_code == 3
    assert sum(result.counts.values()) == result.total == 12


def test_values_that_json_cannot_say(file, tmp_path) -> None:
    vary = sweep(file, "forces.air.coefficient=0.1,nan,2020-01-01,[inf]")
    first = vary.run(tmp_path / "out", executor=InProcess())
    assert first.counts == {"done": 1, "bad_scenario": 3}
    written = first.table.read_text()
    again = vary.run(tmp_path / "out", executor=InProcess())
    assert again.earlier == 4
    assert again.table.read_text() == written


def test_finished_runs_are_never_redone(file, tmp_path) -> None:
    vary = sweep(file, "simulation.seed=1,2,3,4", "checks.slow.max=10,1")

    class Stop(InProcess):
        def each(self, task, numbers):
            for number in numbers:
                if number == 4:
                    raise KeyboardInterrupt
                yield number, task(number)

    first = vary.run(tmp_path / "out", executor=Stop())
    assert first.interrupted
    assert first.exit_code == 130
    assert len(rows(first)) == 3
    stamps = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").glob("000[123]/result.json")}
    assert len(stamps) == 3
    second = vary.run(tmp_path / "out", executor=InProcess())
    assert second.earlier == 3
    assert second.ended == len(rows(second)) == 8
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())
    whole = vary.run(tmp_path / "whole", executor=InProcess())
    assert facts(whole) == facts(second)

    def never(number):
        raise AssertionError(number)

    class Idle:
        def each(self, task, numbers):
            yield from map(never, numbers)

    assert vary.run(tmp_path / "out", executor=Idle()).earlier == 8


def test_damaged_and_failed_results_are_done_again(file, tmp_path) -> None:
    vary = sweep(file, "simulation.seed=1,2,3")
    out = tmp_path / "out"
    vary.run(out, executor=InProcess())
    (out / "0002/result.json").write_text('{"run": 2')
    data = json.loads((out / "0003/result.json").read_text())
    (out / "0003/result.json").write_text(json.dumps({**data, "status": "failed"}))
    again = vary.run(out, executor=InProcess())
    assert again.earlier == 1
    assert again.counts == {"done": 3}


def test_another_sweep_in_the_folder(file, tmp_path) -> None:
    out = tmp_path / "out"
    sweep(file, "simulation.seed=1,2,3").run(out, executor=InProcess())
    other = sweep(file, "simulation.seed=4,5", overrides=["forces.air.coefficient=0.2"])
    with pytest.raises(UsageError, match="another sweep: runs, set, vary changed"):
        other.run(out)
    (out / "0003/notes.txt").write_text("mine")
    result = other.run(out, executor=InProcess(), force=True)
    assert len(rows(result)) == 2
    assert not (out / "0003/result.json").exists()
    assert (out / "0003/notes.txt").exists()  # nothing is removed that a sweep did not write


def test_a_folder_of_something_else(file, tmp_path) -> None:
    out = tmp_path / "thesis"
    out.mkdir()
    (out / "chapter1.tex").write_text("dear")
    for force in (False, True):
        with pytest.raises(UsageError, match="holds no sweep"):
            sweep(file, "simulation.seed=1").run(out, force=force)
    assert [path.name for path in out.iterdir()] == ["chapter1.tex"]
    with pytest.raises(UsageError, match="not a folder"):
        sweep(file, "simulation.seed=1").run(out / "chapter1.tex")


NAMING = (
    SCENARIO.replace(
        'layout = { type = "random", count = 20, shape = { type = "ball", radius = 1.0 } }',
        'layout = { type = "file", path = "sub/points.csv" }',
    )
    + """
[[checks]]
name = "same"
quantity = "position"
reference = "right.vtkhdf"
tolerance = 1e-9
[[particles]]
name = "shell"
layout = { type = "mesh", path = "sub/shell.obj" }
"""
)
POINTS = "x,y,z\n0,1,0\n1,2,0\n"


@pytest.fixture
def naming(tmp_path) -> Path:
    """A scenario that names a table of particles, a mesh and a reference."""
    home = tmp_path / "home"
    (home / "sub").mkdir(parents=True)
    (home / "sub/points.csv").write_text(POINTS)
    (home / "sub/shell.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    path = home / "naming.toml"
    path.write_text(NAMING)
    ps.run(ps.load(path), tmp_path / "blessed.vtkhdf", bless=True)
    return path


def test_scenarios_of_runs_name_their_files_from_where_they_lie(naming, tmp_path) -> None:
    vary = sweep(naming, "simulation.precision=double,single")
    result = vary.run(tmp_path / "elsewhere/out", workers=1)
    assert result.counts == {"done": 1, "check_failed": 1}
    for row in rows(result):
        folder = tmp_path / f"elsewhere/out/{int(row['run']):04}"
        loaded = ps.load(folder / "scenario.toml")
        assert loaded.particles[0].layout.path == "../../../home/sub/points.csv"
        again = ps.run(loaded)
        assert json.loads((folder / "result.json").read_text())["state"] == again.state
        assert again.passed is (row["status"] == "done")


@pytest.mark.parametrize("name", ["sub/points.csv", "sub/shell.obj", "right.vtkhdf"])
def test_runs_with_files_that_changed_since_are_refused(naming, tmp_path, name) -> None:
    vary = sweep(naming, "simulation.seed=1,2")
    vary.run(tmp_path / "out", workers=1)
    file = naming.parent / name
    before = file.read_bytes()
    file.write_bytes(before + b"\n")
    with pytest.raises(UsageError, match="has changed since run 1 was done") as caught:
        vary.run(tmp_path / "out", workers=1)
    assert str(file) in caught.value.message
    file.write_bytes(before)
    assert vary.run(tmp_path / "out", workers=1).earlier == 2


def test_runs_that_lacked_a_file_are_done_once_it_is_there(naming, tmp_path) -> None:
    vary = sweep(
        naming, "particles.0.layout.path='sub/points.csv','sub/others.csv'", "checks.same.tolerance=1"
    )
    assert vary.run(tmp_path / "out", workers=1).counts == {"done": 1, "bad_scenario": 1}
    (naming.parent / "sub/others.csv").write_text(POINTS)
    again = vary.run(tmp_path / "out", workers=1)
    assert (again.earlier, again.counts) == (1, {"done": 2})


def test_fail_fast(file, tmp_path) -> None:
    vary = sweep(file, "checks.slow.max=10,1,10,10")
    result = vary.run(tmp_path / "out", executor=InProcess(), fail_fast=True)
    assert [row["status"] for row in rows(result)] == ["done", "check_failed"]
    assert result.exit_code == 1
    again = vary.run(tmp_path / "out", executor=InProcess(), fail_fast=True)
    assert (again.ended, again.exit_code) == (2, 1)
    assert vary.run(tmp_path / "out", executor=InProcess()).ended == 4


def test_a_machine_that_is_too_small_is_no_fault_of_the_scenario(file, tmp_path, monkeypatch) -> None:
    vary = sweep(file, "simulation.seed=1,2", record=True)
    with monkeypatch.context() as small:
        small.setattr(shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(10, 10, 0))
        full = vary.run(tmp_path / "out", executor=InProcess())
    assert (full.counts, full.exit_code) == ({"failed": 2}, 4)
    assert "on disk" in full.failures[0].cause
    with monkeypatch.context() as small:
        small.setattr("particlesim.preflight.resources.available_memory", lambda: 1000)
        assert vary.run(tmp_path / "out", executor=InProcess()).counts == {"failed": 2}
    assert vary.run(tmp_path / "out", executor=InProcess()).counts == {"done": 2}


def test_record_quantities_progress(file, tmp_path) -> None:
    told: list[SweepProgress] = []
    vary = sweep(file, "simulation.seed=1,2", quantities=["kinetic", "count"], record=True)
    result = vary.run(tmp_path / "out", executor=InProcess(), progress=told.append)
    assert list(rows(result)[0]) == [
        "run", "simulation.seed", "kinetic", "count", "check slow", "status", "cause", "seconds",
    ]  # fmt: skip
    with ps.open(tmp_path / "out/0002/trajectory.vtkhdf") as trajectory:
        assert len(trajectory) == 3
    assert [(p.ended, p.total) for p in told] == [(0, 2), (1, 2), (2, 2)]


@pytest.mark.parametrize(
    ("vary", "options", "error", "message"),
    [
        (
            "forces.air.coefficient=1,2",
            {"overrides": ["forces.1.coefficient=3"]},
            UsageError,
            "both set and varied",
        ),
        ("forces.air={}", {"overrides": ["forces.air.coefficient=3"]}, ScenarioError, "type"),
        (
            "simulation={duration=1,dt=0.1}",
            {"overrides": ["simulation.dt=0.2"]},
            UsageError,
            "is in simulation",
        ),
        ("forces.aer.coefficient=1,2", {}, ScenarioError, 'did you mean "air"'),
        ("simulation.dtt=1,2", {}, ScenarioError, "dt"),
        ("simulation.seed=1,2", {"overrides": ["simulation.dt=-1"]}, ScenarioError, "greater than 0"),
        ("simulation.seed=1,2", {"quantities": ["kinetik"]}, UsageError, 'did you mean "kinetic"'),
        (
            "simulation.seed=1,2",
            {"quantities": ["energy"], "overrides": ["output.ledger=false"]},
            UsageError,
            "switched off",
        ),
    ],
)
def test_mistakes_before_anything_runs(file, vary, options, error, message) -> None:
    with pytest.raises(error) as caught:
        sweep(file, vary, **options)
    assert message in str(caught.value)


def test_lost_workers_are_replaced(tmp_path, monkeypatch) -> None:
    """Run 3 takes its worker down the first time, run 5 always."""
    monkeypatch.setenv("PSIM_TEST_MARK", str(tmp_path / "mark"))
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    task = importlib.import_module("fragile_task").fragile
    assert dict(LocalWorkers(2).each(task, range(1, 8))) == {
        k: (None if k == 5 else k * k) for k in range(1, 8)
    }


def test_ctrl_c_ends_the_workers(tmp_path, monkeypatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    task = importlib.import_module("fragile_task").endless
    ends = LocalWorkers(2).each(task, range(3))
    next(ends)
    began = time.perf_counter()
    ends.close()
    assert time.perf_counter() - began < 5
    assert not multiprocessing.active_children()


def test_parquet_where_pyarrow_is(file, tmp_path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    result = sweep(file, "simulation.seed=1,2", "checks.slow.max=10,1").run(tmp_path / "out", workers=1)
    assert result.parquet is not None
    table = parquet.read_table(result.parquet).to_pylist()
    assert [row["run"] for row in table] == [1, 2, 3, 4]
    for ours, text in zip(table, rows(result), strict=True):
        assert repr(ours["kinetic"]) == text["kinetic"]
        assert ours["status"] == text["status"]


def test_types_of_parquet_do_not_depend_on_how_runs_end(file, tmp_path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")

    def types(name: str, *vary: str) -> dict[str, str]:
        path = sweep(file, *vary).run(tmp_path / name, workers=1).parquet
        assert path is not None
        return {field.name: str(field.type) for field in parquet.read_schema(path)}

    well = types("well", "checks.slow.max=10", "simulation.seed=1")
    badly = types("badly", "checks.slow.max=10,-1.5,nan", "simulation.seed=1,-1")
    assert well == {**badly, "checks.slow.max": "int64"}
    assert badly["checks.slow.max"] == badly["kinetic"] == badly["check slow"] == "double"
    assert badly["cause"] == badly["status"] == "string"
    assert badly["run"] == badly["count"] == badly["simulation.seed"] == "int64"
    words = types("words", "simulation.integrator=heun,rk4", "output.work=true,false")
    assert (words["simulation.integrator"], words["output.work"]) == ("string", "bool")


def test_without_pyarrow_there_is_no_parquet(file, tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    result = sweep(file, "simulation.seed=1").run(tmp_path / "out", workers=1)
    assert result.parquet is None
    assert result.exit_code == 0


def test_plots_need_numbers(file, tmp_path) -> None:
    swept = sweep(file, "simulation.integrator=heun,rk4")
    result = swept.run(tmp_path / "out", workers=1)
    with pytest.raises(UsageError, match="no run has a number"):
        plot_table(result.table, swept.design, "simulation.integrator", "energy", tmp_path / "plot.png")
    with pytest.raises(UsageError, match="unknown column"):
        check_plot("energy", "nothing", swept.columns, tmp_path / "plot.png")
    with pytest.raises(UsageError, match="unknown ending"):
        check_plot("energy", "count", swept.columns, tmp_path / "plot.bmp")
