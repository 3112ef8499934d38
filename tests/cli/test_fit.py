"""`psim fit` from the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from particlesim.scenario.load import load

SHOT = """
[simulation]
duration = 2.0
dt = 0.02
integrator = "rk4"
[[particles]]
name = "ball"
layout = { type = "points", position = [[0, 0, 0]], velocity = [[3, 9, 0]] }
[[forces]]
type = "gravity"
"""


@pytest.fixture
def data(psim):
    Path("shot.toml").write_text(SHOT)
    rows = [f"{t},{3.5 * t},{8 * t - 0.5 * 9.80665 * t * t}" for t in (0.2, 0.6, 1.0, 1.4)]
    Path("m.csv").write_text("\n".join(["time,x,y", *rows]))
    return psim


VARY = ("--vary", "particles.ball.layout.velocity.0.0", "--vary", "particles.ball.layout.velocity.0.1=0,20")


def test_fit_writes_a_scenario_and_a_plot(data):
    ended = data("fit", "shot.toml", "m.csv", *VARY, "-o", "fitted.toml", "--plot", "r.png")
    assert ended.code == 0, ended.err
    assert ended.out.endswith("fitted.toml\nr.png\n")
    assert load("fitted.toml").particles[0].layout.velocity[0] == pytest.approx((3.5, 8, 0))
    assert Path("r.png").read_bytes()[:4] == b"\x89PNG"
    again = data("fit", "shot.toml", "m.csv", *VARY, "-o", "fitted.toml")
    assert again.code == 2
    assert "exists" in again.err


def test_fit_as_json(data):
    told = data("fit", "shot.toml", "m.csv", *VARY, "--json").json
    values = [p["value"] for p in told["parameters"].values()]
    assert values == pytest.approx([3.5, 8])
    assert told["degrees_of_freedom"] == 6
    assert told["converged"]


def test_aim(data):
    ended = data("fit", "shot.toml", "--aim", "ball", "--target", "5,0,0", "-o", "aimed.toml")
    assert ended.code == 0, ended.err
    assert ended.out.count("elevation") == 2
    assert ended.out.endswith("aimed.toml\naimed-2.toml\n")
    told = data("fit", "shot.toml", "--aim", "ball", "--target", "5,0,0", "--json").json
    flat, steep = (shot["elevation"] for shot in told["shots"])
    assert flat + steep == pytest.approx(90)  # level ground, no air


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "nothing to fit to"),
        (("m.csv",), "nothing to vary"),
        (("m.csv", "--aim", "ball", "--target", "1,0,0"), "aiming takes no data"),
        (("--aim", "ball"), "belong together"),
        (("--aim", "ball", "--target", "1,0"), "is not a point"),
        (("--aim", "ball", "--target", "99,0,0"), "out of range"),
        (("none.csv", "--vary", "a"), "does not exist"),
        (("m.csv", "--vary", "a", "--plot", "r.txt"), "unknown ending"),
    ],
)
def test_bad_input(data, arguments, words):
    ended = data("fit", "shot.toml", *arguments)
    assert ended.code == 2
    assert words in ended.err
