"""Fits recover what made the data, within the errors that they state."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

import particlesim as ps
from particlesim.errors import UsageError
from particlesim.fit import fit, parse_range, read_measurements
from particlesim.fit.parameters import within_limits
from particlesim.fit.predict import predict

BALL = """
[simulation]
duration = 1.0
dt = 0.02
integrator = "rk4"

[[particles]]
name = "ball"
layout = { type = "points", position = [[0, 1, 0]], velocity = [[3, 4, 0]] }
mass = 0.5

[[forces]]
type = "gravity"

[[forces]]
name = "air"
type = "linear_drag"
coefficient = 0.2
"""
RANGES = [parse_range("forces.air.coefficient=0,2"), parse_range("particles.ball.layout.velocity.0.1")]
TRUE = (0.3, 4.2)


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.toml"
    path.write_text(BALL)
    return path


def write(path: Path, times: np.ndarray, states: np.ndarray, sigma: float | None = None) -> Path:
    """Positions in the plane as measurements."""
    header = "time,x,y" + ("" if sigma is None else ",sigma_x,sigma_y")
    errors = "" if sigma is None else f",{sigma!r},{sigma!r}"
    rows = [
        f"{float(t)!r},{float(s[0])!r},{float(s[1])!r}{errors}" for t, s in zip(times, states, strict=True)
    ]
    path.write_text("\n".join([header, *rows]))
    return path


def truth(ball: Path) -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(0.05, 0.97, 12)
    scenario = ps.load(
        ball, {"forces.air.coefficient": TRUE[0], "particles.ball.layout.velocity": [[3, TRUE[1], 0]]}
    )
    return times, predict(scenario, times, None)


def test_predictions_between_steps_are_of_fourth_order(ball):
    # x'' = −(c/m) x' has x = v (m/c) (1 − e^(−ct/m)); with RK4, the largest error is that of the interpolation.
    times = np.linspace(0.013, 0.99, 40)
    rate = 0.2 / 0.5
    exact = 3 / rate * -np.expm1(-rate * times)
    errors = [
        np.abs(predict(ps.load(ball, {"simulation.dt": dt}), times, None)[:, 0] - exact).max()
        for dt in (0.1, 0.05)
    ]
    # x'''' h⁴/384 with x'''' = v (c/m)³
    assert errors[0] < 3 * rate**3 * 0.1**4 / 384 * 2
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.5)


def test_exact_data_give_back_their_parameters(ball, tmp_path):
    times, states = truth(ball)
    found = fit(ball, read_measurements(write(tmp_path / "m.csv", times, states)), RANGES)
    assert [p.value for p in found.parameters] == pytest.approx(TRUE, rel=1e-7)
    assert found.converged
    assert found.scenario.forces[1].coefficient == found.parameters[0].value
    assert np.nanmax(np.abs(found.residuals)) < 1e-7


@pytest.mark.slow
def test_stated_errors_are_the_scatter_of_many_fits(ball, tmp_path):
    """64 data sets of 6 numbers with σ = 0.01 and 2 parameters, each fitted with σ known and not: 4 degrees of freedom.

    With σ known the stated variance is that of the fitted values over the data sets, which is known to √(2/63); with σ from
    the residuals it is the same on average, within √(2/4/64), and so is χ²/4. Divided by 4 ± 2 instead, it would be off by
    a factor of 2/3 or 2. Of the data sets, 68 % have the truth within one standard error. Three standard deviations each.
    """
    times, states = truth(ball)
    times, states = times[[2, 7, 11]], states[[2, 7, 11]]
    random = np.random.default_rng(5)
    values, stated, guessed, chi2 = [], [], [], []
    for _ in range(64):
        noisy = states + random.normal(0, 0.01, states.shape)
        known, unknown = (
            fit(ball, read_measurements(write(tmp_path / "m.csv", times, noisy, sigma)), RANGES)
            for sigma in (0.01, None)
        )
        assert (known.freedom, unknown.freedom) == (4, 4)
        values.append([p.value for p in known.parameters])
        stated.append([p.error for p in known.parameters])
        guessed.append([p.error for p in unknown.parameters])
        chi2.append(known.chi2 / known.freedom)
    variance = np.mean(np.square(stated), axis=0)
    assert np.var(values, axis=0, ddof=1) / variance == pytest.approx(1, abs=3 * math.sqrt(2 / 63))
    assert np.mean(np.square(guessed), axis=0) / variance == pytest.approx(1, abs=3 * math.sqrt(2 / 256))
    assert np.mean(chi2) == pytest.approx(1, abs=3 * math.sqrt(2 / 256))
    inside = (np.abs(np.array(values) - TRUE) < stated).sum(axis=0)
    assert ((inside > 32) & (inside < 55)).all(), inside


def test_known_errors_are_believed_whatever_the_residuals(ball, tmp_path):
    """With σ known the stated errors are proportional to it; χ² tells that it is not that of the data, and nothing else."""
    times, states = truth(ball)
    noisy = states + np.random.default_rng(6).normal(0, 0.01, states.shape)
    one, three = (
        fit(ball, read_measurements(write(tmp_path / "m.csv", times, noisy, sigma)), RANGES)
        for sigma in (0.01, 0.03)
    )
    assert [p.error for p in three.parameters] == pytest.approx(
        [3 * p.error for p in one.parameters], rel=1e-4
    )
    assert three.chi2 == pytest.approx(one.chi2 / 9, rel=1e-4)


def test_a_straight_line_has_the_errors_of_the_textbook(tmp_path):
    """Height and speed of a throw without drag are a straight line's a + b t: s² = χ²/(n − 2), var b = s²/S, S = Σ (t − t̄)²,
    var a = s² (1/n + t̄²/S), and their correlation is −t̄/√(S/n + t̄²)."""
    path = tmp_path / "throw.toml"
    path.write_text(BALL[: BALL.rindex("[[forces]]")])
    times = np.array([0.1, 0.3, 0.45, 0.8, 0.9])
    off = np.array([0.02, -0.03, 0.01, 0.04, -0.02])
    states = np.zeros((5, 2))
    states[:, 1] = 1 + 4 * times - 9.80665 / 2 * times**2 + off
    rows = "\n".join(f"{t!r},{y!r}" for t, y in zip(times.tolist(), states[:, 1].tolist(), strict=True))
    (tmp_path / "m.csv").write_text("time,y\n" + rows)
    keys = ("particles.ball.layout.position.0.1", "particles.ball.layout.velocity.0.1")
    found = fit(path, read_measurements(tmp_path / "m.csv"), [parse_range(key) for key in keys])
    slope, height = np.polyfit(times, 1 + 4 * times + off, 1)
    assert [p.value for p in found.parameters] == pytest.approx([height, slope], rel=1e-6)
    n, mean, total = 5, times.mean(), ((times - times.mean()) ** 2).sum()
    s2 = ((1 + 4 * times + off - height - slope * times) ** 2).sum() / (n - 2)
    errors = [math.sqrt(s2 * (1 / n + mean**2 / total)), math.sqrt(s2 / total)]
    assert [p.error for p in found.parameters] == pytest.approx(errors, rel=1e-6)
    assert found.correlation[0, 1] == pytest.approx(-mean / math.sqrt(total / n + mean**2), rel=1e-6)


@pytest.mark.slow
def test_several_starts_find_the_best_of_several_minima(tmp_path):
    """The phase of an oscillation fits again and again, best at the true frequency."""
    path = tmp_path / "spring.toml"
    path.write_text(
        """
        [simulation]
        duration = 4.0
        dt = 0.04
        integrator = "velocity_verlet"
        [[particles]]
        name = "ball"
        layout = { type = "points", position = [[1, 0, 0]] }
        mass = 1.0
        [[forces]]
        name = "spring"
        type = "point_spring"
        stiffness = 4.0
        """
    )
    times = np.linspace(0, 4, 30)
    states = predict(ps.load(path, {"forces.spring.stiffness": 40.0}), times, None)
    data = read_measurements(write(tmp_path / "m.csv", times, states))
    ranges = [parse_range("forces.spring.stiffness=1,100")]
    assert fit(path, data, ranges).parameters[0].value != pytest.approx(40, rel=1e-2)
    found = fit(path, data, ranges, starts=8, seed=1)
    assert found.parameters[0].value == pytest.approx(40, rel=1e-6)
    assert len(found.starts) == 8
    assert found.starts[0] < 1e-10 < found.starts[-1]


def test_bounds_that_the_model_knows_need_not_be_given(ball, tmp_path):
    """Without drag, and with noise that looks like a push, the search would leave what a coefficient can be."""
    times = np.linspace(0.05, 0.95, 10)
    states = predict(ps.load(ball, {"forces.air.coefficient": 0.0}), times, None)
    states[:, 0] += 0.01 * times**2
    data = read_measurements(write(tmp_path / "m.csv", times, states))
    found = fit(ball, data, [parse_range("forces.air.coefficient"), RANGES[1]])
    assert found.parameters[0].value == pytest.approx(0, abs=1e-6)
    assert found.parameters[0].at_bound
    mass = within_limits(parse_range("particles.ball.mass=-1,3"), ps.load(ball))
    assert 0 < mass.low < 1e-11
    assert mass.high == 3
    with pytest.raises(UsageError, match="cannot lie between"):
        within_limits(parse_range("particles.ball.mass=-2,-1"), ps.load(ball))


def test_keys_are_looked_at_before_the_data(ball, tmp_path):
    data = read_measurements(write(tmp_path / "m.csv", np.array([0.5]), np.zeros((1, 6))))
    with pytest.raises(UsageError, match="no entry 'aer'"):
        fit(ball, data, [parse_range("forces.aer.coefficient"), *RANGES])
    with pytest.raises(UsageError, match="outside of its bounds"):
        fit(ball, data, [parse_range("forces.air.coefficient=1,2"), *RANGES[1:]])
    with pytest.raises(UsageError, match="cannot determine 2"):
        fit(ball, data, RANGES)


def test_what_the_data_do_not_determine_is_told(ball, tmp_path):
    times, states = truth(ball)
    data = read_measurements(write(tmp_path / "m.csv", times, states))
    sideways = parse_range("particles.ball.layout.position.0.2")
    assert fit(ball, data, [*RANGES, sideways]).undetermined == (sideways.key,)


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("forces.wind.coefficient", "no entry 'wind'"),
        ("forces.air.coeficient", "no number"),
        ("forces.air.type", "is text"),
        ("particles.ball.layout.velocity", "is a list"),
        ("forces.air.coefficient=0.5,2", "outside of its bounds"),
    ],
)
def test_what_cannot_be_varied(ball, tmp_path, argument, words):
    data = read_measurements(write(tmp_path / "m.csv", *truth(ball)))
    with pytest.raises(UsageError, match=words):
        fit(ball, data, [parse_range(argument)])


@pytest.mark.parametrize("text", ["", "=1,2", "a=1", "a=2,1", "a=x,y", "a=1,2,3"])
def test_ranges_that_are_none(text):
    with pytest.raises(UsageError, match="--vary"):
        parse_range(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("time,x\n", "no measurements"),
        ("t,x\n0,1", ":1: unknown column 't'"),
        ("x\n1", ":1: there is no column 'time'"),
        ("time,x,x\n0,1,1", "occurs twice"),
        ("time,x [kg]\n0,1", ":1: column 'x': expected a length"),
        ("time,x [mn]\n0,1", "unknown unit"),
        ("time,x\n0,1\n1,a", ":3: x is 'a'"),
        ("time,x\n0,1\n1", ":3: 1 cells"),
        ("time,x\n-1,1", ":2: the time is negative"),
        ("time,x\n0,nan", ":2: x is nan"),
        ("time,x\n0,", "holds no measured numbers"),
        ("time,x,id\n0,1,0.5", ":2: 0.5 is not an id"),
        ("time,x,id\n0,1,1e300", ":2: 1e+300 is not an id"),
        ("time,x\n0,1_000", ":2: x is '1_000'"),
        ("time,x [km]\n0,1e306", ":2: x is 1e306, which is beyond"),
        ("time,x\n0,1" + " " * (1 << 16), ":2: a line of more than"),
        ("time,x,sigma_x\n0,1,0", ":2: x has no standard error above 0"),
    ],
)
def test_data_that_are_none(tmp_path, text, words):
    path = tmp_path / "m.csv"
    path.write_text(text)
    with pytest.raises(UsageError) as caught:
        read_measurements(path)
    assert words in caught.value.message


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_data_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for path, words in (
        (tmp_path / "pipe.csv", "is a pipe"),
        (Path("/dev/zero"), "is a device"),
        (tmp_path, "is a directory"),
    ):
        with pytest.raises(UsageError, match=words):
            read_measurements(path)


def test_units_in_the_header(tmp_path):
    path = tmp_path / "m.csv"
    path.write_text("time [ms],x [mm],vy [km/h]\n\n20,5,36\n40,,18\n")
    data = read_measurements(path)
    assert data.times.tolist() == [0.02, 0.04]
    assert data.values[0, [0, 4]].tolist() == [0.005, 10.0]
    assert data.count == 3


def test_data_that_do_not_fit_the_scenario(ball, tmp_path):
    times, states = truth(ball)
    late = read_measurements(write(tmp_path / "m.csv", times + 1, states))
    with pytest.raises(UsageError, match="the scenario ends at 1 s") as caught:
        fit(ball, late, RANGES)
    assert caught.value.hint == "--set simulation.duration=1.97"
    (tmp_path / "m.csv").write_text("time,id,x\n0.1,7,1\n0.2,7,1\n0.3,7,2")
    with pytest.raises(UsageError, match="there is no particle 7"):
        fit(ball, read_measurements(tmp_path / "m.csv"), RANGES)
    (tmp_path / "m.csv").write_text("time,x\n0.1,1\n")
    with pytest.raises(UsageError, match="cannot determine"):
        fit(ball, read_measurements(tmp_path / "m.csv"), RANGES)
