"""`psim verify`: its table, its JSON, its exit codes."""

from __future__ import annotations

from pathlib import Path

from .conftest import TINY


def test_a_table(psim) -> None:
    ended = psim("verify", "tiny.toml")
    assert ended.code == 0, ended.out
    lines = ended.out.splitlines()
    assert lines[0] == "tiny.toml at dt = 0.01, 0.005, 0.0025 s"
    assert "error at dt" in lines[1]
    assert [line.split()[:2] for line in lines[2:4]] == [["balls", "position"], ["balls", "velocity"]]
    assert not Path("outputs").exists()


def test_lost_order(psim) -> None:
    drag = '\n[[forces]]\ntype = "linear_drag"\ncoefficient = 1.0\n'
    Path("tiny.toml").write_text(TINY + drag)
    ended = psim("verify", "tiny.toml", "--set", "simulation.integrator='velocity_verlet'")
    assert ended.code == 1
    assert "BELOW ITS METHOD" in ended.out
    assert "reason: velocity_verlet is only first order" in ended.out
    told = psim("verify", "tiny.toml", "--set", "simulation.integrator='velocity_verlet'", "--json")
    assert told.code == told.json["exit_code"] == 1
    assert told.json["rows"][0]["verdict"] == "below"


def test_bad_input(psim) -> None:
    assert psim("verify", "nothing.toml").code == 2
    assert psim("verify", "tiny.toml", "--set", "simulation.dt=-1").code == 2


def test_a_file_that_is_missing_is_told_with_its_place(psim) -> None:
    layout = (
        TINY.split("[[particles]]", 1)[0]
        + '[[particles]]\nname = "a"\nlayout = { type = "file", path = "gone.npy" }\n'
    )
    Path("tiny.toml").write_text(layout)
    ended = psim("verify", "tiny.toml")
    assert ended.code == 2
    assert "particles.a.layout.path" in ended.err


def test_quiet(psim) -> None:
    ended = psim("verify", "tiny.toml", "--set", "planes=[]", "--quiet")
    assert (ended.code, ended.out, ended.err) == (0, "", "")


def test_what_no_nature_does(psim) -> None:
    """A block that lies on a slope converges as its method promises, to no sliding at all: check and verify say so."""
    Path("slope.toml").write_text(
        """[simulation]
duration = 0.5
dt = 0.01
[[particles]]
name = "block"
mass = 1
layout = { type = "points", position = [[0, 0, 0]] }
[[forces]]
type = "gravity"
[[planes]]
normal = [0.5, 0.8660254, 0]
restitution = 0
tangential_loss = 0.3
"""
    )
    ended = psim("verify", "slope.toml")
    assert "note: plane 0: tangential_loss acts at every contact" in ended.out
    assert "depends on dt" in psim("verify", "slope.toml", "--json").json["notes"][0]
    assert "not of friction" in " ".join(psim("check", "slope.toml").err.split())
    assert "note" not in psim("verify", "tiny.toml").out
