"""Checks look at the right number at the right moment, pass and fail where they must, and are told of everywhere."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from simulate import G, points, table

import particlesim as ps
from particlesim.preflight.advice import advice
from particlesim.runs.checks import total
from particlesim.scenario.ledger_columns import totals

HEIGHTS = (1.0, 2.0, 4.0)


def scenario(*checks: dict[str, Any], **parts: Any) -> ps.Scenario:
    """Three particles in free fall for 1 s, velocity Verlet (exact for a constant force), a frame every 0.25 s."""
    start = {
        "particles": [
            points(*((0.5 * h, h, 0.0) for h in HEIGHTS), velocity=[[3.0, 0.0, 4.0]], name="balls", mass=2.0),
            points((0, 100, 0), name="far", pinned=True),
        ],
        "forces": [{"type": "gravity"}],
        "output": {"every": 25},
    }
    return ps.from_table(table(1.0, 0.01, **{**start, **parts}, checks=list(checks)))


def result(check: dict[str, Any], **parts: Any) -> Any:
    (only,) = ps.run(scenario(check, **parts), threads=1).checks
    return only


FALLEN = 0.5 * G
CASES: list[tuple[dict[str, Any], float]] = [
    ({"quantity": "count"}, 4),
    ({"quantity": "count", "group": "balls"}, 3),
    ({"quantity": "born"}, 0),
    ({"quantity": "died"}, 0),
    ({"quantity": "position.y", "statistic": "min", "group": "balls"}, 1 - FALLEN),
    ({"quantity": "position.y", "statistic": "max", "group": "balls"}, 4 - FALLEN),
    ({"quantity": "position.y", "statistic": "mean", "group": "balls"}, 7 / 3 - FALLEN),
    ({"quantity": "position.y", "statistic": "percentile", "percentile": 75, "group": "balls"}, 3 - FALLEN),
    ({"quantity": "position.y", "statistic": "max"}, 100),
    ({"quantity": "position.x", "statistic": "max", "group": "balls", "at": 0.25}, 2.75),
    ({"quantity": "speed", "statistic": "max", "at": 0}, 5),
    ({"quantity": "speed", "statistic": "max"}, math.hypot(5, G)),
    ({"quantity": "mass", "statistic": "min"}, 1),
    ({"quantity": "age", "statistic": "max", "at": 0.5}, 0.5),
    ({"quantity": "force.y", "statistic": "min", "group": "balls"}, -2 * G),
    ({"quantity": "acceleration.y", "statistic": "min"}, -G),
    ({"quantity": "kinetic", "at": 0}, 3 * 25),
    ({"quantity": "potential", "at": 0}, G * (2 * 7 + 100)),
    ({"quantity": "potential.gravity", "at": 0}, G * (2 * 7 + 100)),
    ({"quantity": "energy"}, 75 + G * 114),
    ({"quantity": "energy.drift"}, 0),
    ({"quantity": "momentum.x"}, 18),
    ({"quantity": "momentum", "at": 0}, 30),
    ({"quantity": "angular_momentum.y", "at": 0}, -4 * 2 * 0.5 * 7),
]


@pytest.mark.parametrize(("check", "expected"), CASES, ids=lambda case: str(case)[:60])
def test_every_quantity(check: dict[str, Any], expected: float) -> None:
    # 100 steps of sums of a few numbers of size ~1e3: rounding stays below 1e-10 of the value.
    near = result({**check, "equals": expected, "tolerance": 1e-9})
    assert near.passed, near.message
    assert near.value == pytest.approx(expected, abs=1e-9)
    off = result({**check, "equals": expected + 1, "tolerance": 0.9})
    assert not off.passed
    assert "is not" in off.message


def test_single_bounds_and_the_edge() -> None:
    assert result({"quantity": "count", "min": 4, "max": 4}).passed
    assert not result({"quantity": "count", "min": 5}).passed
    assert not result({"quantity": "count", "max": 3}).passed
    assert result({"quantity": "count", "equals": 5, "relative_tolerance": 0.2}).passed
    assert not result({"quantity": "count", "equals": 5, "relative_tolerance": 0.1}).passed


def test_always_keeps_the_worst_and_its_time() -> None:
    # In the group the lowest particle starts at 1 m and falls: the worst of y ≥ −1 is the last frame.
    low = result({"quantity": "position.y", "statistic": "min", "group": "balls", "at": "always", "min": -1})
    assert not low.passed
    assert low.time == 1.0
    high = result({"quantity": "position.y", "statistic": "max", "group": "balls", "at": "always", "max": 5})
    assert high.passed
    assert (high.value, high.time) == (4.0, 0.0)


def test_the_ledger_need_not_be_kept() -> None:
    assert result({"quantity": "energy.drift", "max": 1e-12}, output={"every": 25, "ledger": False}).passed


def test_emitters_and_moments_without_particles() -> None:
    emitter = {
        "name": "sparks",
        "rate": 10.0,
        "start": 0.5,
        "shape": {"type": "point", "position": [0, 1, 0]},
        "lifetime": 0.35,
    }
    parts = {"emitters": [emitter], "particles": []}
    assert result({"quantity": "born", "equals": 5}, **parts).passed
    assert result({"quantity": "died", "equals": 2}, **parts).passed
    height = {"quantity": "position.y", "statistic": "max", "max": 1.5}
    assert result({**height, "at": "always"}, **parts).passed  # nobody there before 0.5 s: no bound broken
    empty = result({**height, "at": 0.25}, **parts)
    assert not empty.passed
    assert math.isnan(empty.value)


def test_drift_begins_with_the_first_particles() -> None:
    # a burst at 0 is in the first frame after it: the ten that are born fall, and keep their energy
    gas = {
        "name": "gas",
        "burst": {"at": 0, "count": 10},
        "shape": {"type": "box", "min": [0, 1, 0], "max": [1, 2, 1]},
        "speed": 2.0,
    }
    drift = {"quantity": "energy.drift", "at": "always", "max": 1e-9}
    parts = {"emitters": [gas], "particles": []}
    assert result(drift, **parts).passed
    assert not any("births" in told for told in advice(scenario(drift, **parts)))
    later = [
        {**parts, "emitters": [gas, {**gas, "name": "more", "burst": {"at": 0.5, "count": 1}}]},
        {**parts, "emitters": [{"rate": 10, **{key: gas[key] for key in ("name", "shape", "speed")}}]},
        {"emitters": [gas]},  # others are there before
    ]
    for each in later:
        assert not result(drift, **each).passed
        assert any("births" in told and "balance" in told for told in advice(scenario(drift, **each)))


def test_a_drift_from_nothing_says_so() -> None:
    still = points((0, 0, 0), name="still")
    drift = result({"quantity": "energy.drift", "max": 1}, particles=[still])
    assert not drift.passed
    assert "no energy at the start" in drift.message


def test_nan_fails() -> None:
    parts = {
        "particles": [points((0, 0, 0), temperature=300.0, name="warm"), points((0, 0, 0), name="plain")]
    }
    got = result({"quantity": "temperature", "statistic": "max", "max": 1e9}, **parts)
    assert not got.passed
    assert got.as_data()["value"] is None


def test_drift_is_measured_from_the_start() -> None:
    assert total("energy.drift", {"kinetic": 5.0, "potential.well": 1.0, "momentum.x": 9.0}, 4.0) == 0.5
    assert total("energy.drift", {"kinetic": 1.0, "potential.sun": -4.0}, -4.0) == 0.25


def test_drift_from_no_energy() -> None:
    assert total("energy.drift", {"kinetic": 0.0}, 0.0) == 0
    assert total("energy.drift", {"kinetic": 1.0}, 0.0) == math.inf
    assert math.isnan(total("energy.drift", {"kinetic": math.nan}, 0.0))


WRONG = [
    ({"quantity": "energy.drfit", "max": 1}, "unknown quantity", 'did you mean "energy.drift"?'),
    ({"quantity": "position", "max": 1}, "unknown quantity", "position.x"),
    ({"quantity": "balls.vx", "max": 1}, "unknown quantity", 'quantity = "velocity.x", group = "balls"'),
    ({"quantity": "potential.wind", "max": 1}, "unknown quantity", "potential.gravity"),
    ({"quantity": "balance", "max": 1}, "work is not recorded", "work = true under [output]"),
    ({"quantity": "work.contact", "max": 1}, "unknown quantity", "work is done by: nothing"),
    ({"quantity": "count", "group": "bals", "max": 1}, "unknown group", 'did you mean "balls"?'),
    ({"quantity": "energy"}, "needs a bound", None),
    ({"quantity": "energy", "equals": 1, "max": 2}, "contradict", None),
    ({"quantity": "energy", "max": 2, "tolerance": 1}, "belongs to equals", None),
    ({"quantity": "missed_crossings", "max": -1}, "never below 0", None),
    ({"quantity": "kinetic", "equals": -2, "tolerance": 1}, "never below 0", None),
    ({"quantity": "kinetic", "equals": -2, "relative_tolerance": 0.9}, "never below 0", None),
    ({"quantity": "energy", "min": 2, "max": 1}, "min is above max", None),
    ({"quantity": "speed", "max": 2}, "needs a statistic", None),
    ({"quantity": "energy", "statistic": "max", "max": 2}, "there is no statistic", None),
    ({"quantity": "energy", "group": "balls", "max": 2}, "sum over all groups", None),
    ({"quantity": "speed", "statistic": "percentile", "max": 2}, "a percentile needs", None),
    ({"quantity": "speed", "statistic": "max", "percentile": 5, "max": 2}, "needs statistic", None),
    ({"quantity": "count", "max": 2, "at": 1.5}, "after the end", None),
    ({"quantity": "count", "max": 2, "at": 0.3}, "no frame at 0.3 s", "0.25 s and 0.5 s"),
    ({"quantity": "temperature", "statistic": "max", "max": 2}, "temperature", None),
]


@pytest.mark.parametrize(("check", "message", "hint"), WRONG, ids=lambda case: str(case)[:50])
def test_mistakes_point_into_the_file(check: dict[str, Any], message: str, hint: str | None) -> None:
    with pytest.raises(ps.ScenarioError) as caught:
        scenario({"quantity": "count", "max": 9}, check)
    (diagnostic,) = caught.value.diagnostics
    assert message in diagnostic.message
    assert diagnostic.path.startswith("checks.1")
    assert hint is None or (diagnostic.hint is not None and hint in diagnostic.hint)


BREAKING = {
    "between": ["anchor", "load"],
    "pairs": [[0, 0]],
    "stiffness": 10.0,
    "damping": 0.1,
    "break_strain": 0.05,
}
EVERYTHING: dict[str, Any] = {
    "output": {"every": 25, "ledger": True, "work": True},
    "particles": [
        points((0, 5, 0), name="anchor", pinned=True),
        points((0, 4, 0), name="load", mass=2.0),
        points((3, 0.5, 0), (4, 0.1, 0), name="balls", radius=0.05),
    ],
    "emitters": [
        {"name": "drops", "rate": 8.0, "shape": {"type": "point", "position": [8, 1, 0]}, "lifetime": 0.5},
    ],
    "forces": [
        {"type": "gravity"},
        {"type": "linear_drag", "name": "air", "coefficient": 0.1, "on": ["load"]},
    ],
    "springs": [{"name": "link", **BREAKING}],
    "planes": [
        {"point": [0, 0, 0], "on": ["balls"], "restitution": 0.5},
        {"point": [0, 0.4, 0], "on": ["drops"], "contact": "kill"},
    ],
    "impulses": [{"at": 0.5, "on": ["balls"], "impulse": [0.1, 0, 0]}],
}


def test_every_total_of_the_ledger_and_the_summary() -> None:
    """A check for each of them, at the end, sees what the result tells."""
    plain = ps.run(scenario(**EVERYTHING), threads=1)
    last = {name: float(values[-1]) for name, values in plain.ledger.items()}
    work = {name: value for name, value in last.items() if name.startswith("work.")}
    assert set(work) == {
        f"work.{cause}"
        for cause in ("air", "link", "link.breaking", "contact", "births", "deaths", "impulses")
    }
    wanted = {
        **last,
        "potential": sum(value for name, value in last.items() if name.startswith("potential.")),
        "energy": float(plain.energy[-1]),
        "work": sum(work.values()),
        "born": plain.born,
        "died": sum(plain.died.values()),
        "died.plane": plain.died["plane"],
        "died.age": plain.died.get("age", 0),
        "broken": plain.broken["link"][0],
        "broken.link": plain.broken["link"][0],
    }
    assert wanted["broken"] == 1
    known = totals(plain.scenario)
    assert set(wanted) < set(known)
    checks = [{"quantity": name, "equals": value} for name, value in wanted.items()]
    checked = ps.run(scenario(*checks, **EVERYTHING), threads=1)
    assert [check.message for check in checked.checks if not check.passed] == []
    # Velocity Verlet takes drag at the beginning of a step: the balance is off by some (c/m) h of the 60 J that move.
    near = {"quantity": "balance", "at": "always", "min": -0.05, "max": 0.05}
    assert ps.run(scenario(near, **EVERYTHING), threads=1).passed


BOOKED_WRONG = [
    ("work.airr", 'did you mean "work.air"?'),
    ("broken.lnik", 'did you mean "broken.link"?'),
    ("died.hunger", "died.age"),
]


@pytest.mark.parametrize(("name", "hint"), BOOKED_WRONG)
def test_misspelt_totals(name: str, hint: str) -> None:
    with pytest.raises(ps.ScenarioError) as caught:
        scenario({"quantity": name, "max": 1}, **EVERYTHING)
    (diagnostic,) = caught.value.diagnostics
    assert hint in f"{diagnostic.hint} {diagnostic.allowed}"


def test_work_that_is_not_booked_is_offered() -> None:
    off = {**EVERYTHING, "output": {"every": 25, "ledger": True, "work": False}}
    with pytest.raises(ps.ScenarioError) as caught:
        scenario({"quantity": "work.link.breaking", "max": 1}, **off)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.message == "work.link.breaking is not in the ledger, as work is not recorded"
    assert diagnostic.hint is not None
    assert "work = true under [output]" in diagnostic.hint


def test_two_checks_of_one_name() -> None:
    check = {"name": "calm", "quantity": "energy", "max": 1}
    with pytest.raises(ps.ScenarioError, match="two checks are called"):
        scenario(check, check)
    unnamed = {"quantity": "count", "max": 9}
    names = [c.name for c in ps.run(scenario(unnamed, unnamed), threads=1).checks]
    assert names == ["count", "count_2"]


def test_results_are_in_the_trajectory(tmp_path) -> None:
    path = tmp_path / "run.vtkhdf"
    run = ps.run(scenario({"quantity": "count", "max": 3}), path, threads=1)
    assert not run.passed
    with ps.open(path) as trajectory:
        (told,) = json.loads(trajectory.summary["checks"])
    assert told == run.checks[0].as_data()
    assert not told["passed"]


def test_checks_change_no_bit() -> None:
    """Looking does not touch."""
    output = {"every": 25, "ledger": True}
    drift = {"quantity": "energy.drift", "at": "always", "max": 1}
    plain, checked = scenario(output=output), scenario(drift, output=output)
    a, b = (ps.run(s, threads=1) for s in (plain, checked))
    assert np.array_equal(a.final.position, b.final.position)
    assert a.ledger["kinetic"].tobytes() == b.ledger["kinetic"].tobytes()
