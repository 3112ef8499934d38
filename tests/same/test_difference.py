"""Comparing trajectories: identical ones are, and the first difference is found, named and measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import particlesim as ps
from particlesim.analysis.difference import Comparison, compare, ulp_distance
from particlesim.errors import UsageError
from particlesim.trajectory.writer import TrajectoryWriter

SCENARIO = '[simulation]\nduration = 1.0\ndt = 0.5\n[[forces]]\nname = "air"\ncoefficient = 0.1\n'


def frames(count: int = 3, seed: int = 0) -> list[dict[str, Any]]:
    """Frames of four particles in two groups, as the writer takes them."""
    random = np.random.default_rng(seed)
    return [
        {
            "time": 0.5 * k,
            "step": k,
            "position": random.normal(size=(4, 3)),
            "id": np.arange(4),
            "velocity": random.normal(size=(4, 3)),
            "group": np.array([0, 0, 1, 1], np.int32),
        }
        for k in range(count)
    ]


def write(path: Path, recorded: list[dict[str, Any]], scenario: str = SCENARIO, **options: Any) -> Path:
    precision = options.pop("precision", "double")
    deaths = options.pop("deaths", ())
    kinetic = options.pop("kinetic", 1.0)
    with TrajectoryWriter(
        path,
        fields=[name for name in recorded[0] if name not in ("time", "step", "position", "id")],
        groups=["balls", "drops"],
        ledger=["kinetic"],
        provenance={"scenario": scenario, "psim": options.pop("psim", "1.0")},
        precision=precision,
        causes=("age",),
    ) as writer:
        for ids, times in deaths:
            writer.events("death", ids, times, 0)
        for frame in recorded:
            columns = {}
            for name, values in frame.items():
                if name not in ("time", "step"):
                    columns[name] = writer.buffer(name, len(values))
                    columns[name][...] = values
            writer.append(frame["time"], frame["step"], columns, {"kinetic": kinetic})
    return path


def compared(a: Path, b: Path, **options: Any) -> Comparison:
    with ps.open(a) as left, ps.open(b) as right:
        return compare(left, right, **options)


def pair(tmp_path: Path, changed: list[dict[str, Any]], **options: Any) -> Comparison:
    tolerance = options.pop("tolerance", 0.0)
    a = write(tmp_path / "a.vtkhdf", frames())
    return compared(a, write(tmp_path / "b.vtkhdf", changed, **options), tolerance=tolerance)


def test_identical(tmp_path) -> None:
    same = pair(tmp_path, frames())
    assert same.same
    assert (same.frames, same.fields) == (3, ("position", "velocity", "group"))
    assert same.first is same.largest is None
    assert same.changes == same.notes == ()


def test_the_first_bit_that_differs(tmp_path) -> None:
    changed = frames()
    value = changed[1]["velocity"][2, 1]
    changed[1]["velocity"][2, 1] = np.nextafter(np.nextafter(value, np.inf), np.inf)
    changed[1]["velocity"][3, 0] += 1.0
    changed[2]["position"][0, 0] += 100.0
    found = pair(tmp_path, changed)
    first = found.first
    assert not found.same
    assert first is not None
    assert (first.what, first.frame, first.step, first.time) == ("velocity.y", 1, 1, 0.5)
    assert (first.particle, first.group, first.particles) == (2, "drops", 2)
    assert (first.a, first.ulp) == (value, 2)
    assert first.relative == pytest.approx(2 * np.spacing(value) / abs(value), rel=1e-6)
    assert found.largest is not None
    assert (found.largest.what, found.largest.frame) == ("position.x", 2)


def test_rows_are_matched_by_id(tmp_path) -> None:
    changed = frames()
    for frame in changed:
        for name in ("position", "id", "velocity", "group"):
            frame[name] = frame[name][::-1]
    assert pair(tmp_path, changed).same


def test_a_particle_that_one_lacks(tmp_path) -> None:
    changed = frames()
    for name in ("position", "id", "velocity", "group"):
        changed[1][name] = changed[1][name][[0, 1, 3]]
    first = pair(tmp_path, changed).first
    assert first is not None
    assert (first.what, first.frame, first.particle, first.group) == ("particle", 1, 2, "drops")
    assert (first.a, first.b) == (4, 3)


@pytest.mark.parametrize(
    ("values", "same"), [((np.nan, np.nan), True), ((0.0, -0.0), False), ((1.0, np.nan), False)]
)
def test_numbers_that_are_none(tmp_path, values, same) -> None:
    recorded, changed = frames(), frames()
    recorded[1]["position"][0, 0], changed[1]["position"][0, 0] = values
    a, b = write(tmp_path / "a.vtkhdf", recorded), write(tmp_path / "b.vtkhdf", changed)
    assert compared(a, b).same is same
    # A tolerance does not care for the sign of zero, and no tolerance is wide enough for what is no number.
    assert compared(a, b, tolerance=0.5).same is not np.isnan(values[1]) or same


def test_tolerance(tmp_path) -> None:
    changed = frames()
    scale = max(np.abs(frames()[2]["position"]).max(), np.abs(changed[2]["position"]).max())
    changed[2]["position"][1, 2] += 1e-6 * scale
    assert pair(tmp_path, changed, tolerance=2e-6).same
    for name in ("a", "b"):
        (tmp_path / f"{name}.vtkhdf").unlink()
    found = pair(tmp_path, changed, tolerance=0.5e-6)
    assert found.first is not None
    assert found.first.what == "position.z"
    assert found.first.scaled == pytest.approx(1e-6, rel=1e-3)


def test_common_times_with_a_tolerance(tmp_path) -> None:
    recorded = frames(5)
    every_second = [frame for k, frame in enumerate(recorded) if k % 2 == 0]
    a, b = write(tmp_path / "a.vtkhdf", recorded), write(tmp_path / "b.vtkhdf", every_second)
    close = compared(a, b, tolerance=1e-12)
    assert close.same
    assert close.frames == 3
    assert "compared 3 frames, of 5 and 3" in close.notes
    assert not compared(a, b).same
    shorter = write(tmp_path / "c.vtkhdf", recorded[:3])
    ended = compared(a, shorter, tolerance=1e-12).first
    assert ended is not None
    assert (ended.what, ended.a, ended.b) == ("time", 2.0, 1.0)


def test_ledger_events_frames_steps(tmp_path) -> None:
    cases: list[tuple[list[dict[str, Any]], dict[str, Any], str]] = [
        (frames(), {"kinetic": 2.0}, "ledger.kinetic"),
        (frames(), {"deaths": [(np.array([7]), 0.25)]}, "deaths"),
        (frames(4), {}, "frames"),
        ([{**frame, "step": 2 * frame["step"]} for frame in frames()], {}, "step"),
        ([{**frame, "time": 2 * frame["time"]} for frame in frames()], {}, "time"),
    ]
    for number, (changed, options, what) in enumerate(cases):
        folder = tmp_path / str(number)
        folder.mkdir()
        first = pair(folder, changed, **options).first
        assert first is not None
        assert first.what == what


def test_scenario_versions_fields_and_precision_are_told(tmp_path) -> None:
    changed = [{key: value for key, value in frame.items() if key != "velocity"} for frame in frames()]
    other = SCENARIO.replace("0.1", "0.2") + '[render]\nlook = "dots"\n'
    found = pair(tmp_path, changed, scenario=other, psim="2.0", precision="single")
    assert [(change.key, change.a, change.b) for change in found.changes] == [
        ("forces.air.coefficient", 0.1, 0.2)
    ]
    assert found.same  # the doubles of one, rounded, are the singles of the other
    notes = "\n".join(found.notes)
    assert "holds velocity" in notes
    assert "single precision" in notes
    assert "psim: 1.0 and 2.0" in notes


@pytest.mark.parametrize("tolerance", [-1.0, float("nan"), float("inf")])
def test_what_is_no_tolerance(tmp_path, tolerance) -> None:
    with pytest.raises(UsageError, match="tolerance"):
        pair(tmp_path, frames(), tolerance=tolerance)


def test_nothing_in_common(tmp_path) -> None:
    later = [{**frame, "time": frame["time"] + 0.2} for frame in frames()]
    with pytest.raises(UsageError, match="no frame in common"):
        pair(tmp_path, later, tolerance=1e-3)


@given(st.floats(allow_nan=False), st.integers(0, 5))
def test_ulps_count_floats(start, steps) -> None:
    value = start
    for _ in range(steps):
        value = float(np.nextafter(value, np.inf))
    if np.isfinite(value) and not (start < 0 <= value):  # −0 and 0 are two, which nextafter takes for one
        assert ulp_distance(start, value, np.float64) == steps
    assert ulp_distance(-0.0, 0.0, np.float64) == 1
    assert ulp_distance(1.0, 1.0 + 2.0**-23, np.float32) == 1
    assert ulp_distance(float("nan"), 1.0, np.float64) is None
