"""`psim diff` and `psim rerun`: what they say, and their exit codes."""

from __future__ import annotations

import h5py


def test_identical(psim, recorded) -> None:
    ended = psim("diff", recorded, recorded)
    assert ended.code == 0
    assert ended.out.startswith("identical: ")
    assert psim("diff", recorded, recorded, "--json").json["same"] is True


def test_different(psim, recorded) -> None:
    psim("run", "tiny.toml", "-q", "-o", "other.vtkhdf", "--set", "particles.balls.mass=0.2")
    ended = psim("diff", recorded, "other.vtkhdf")
    assert ended.code == 1
    assert "ledger.potential.gravity" in ended.out  # heavier balls fall alike; their energies differ
    assert "particles.balls.mass: 0.1 and 0.2" in ended.out
    within = psim("diff", recorded, "other.vtkhdf", "--tolerance", "1e-12")
    assert within.code == 0
    assert within.out.startswith("the same within 1e-12")
    with h5py.File("other.vtkhdf", "r+") as file:
        file["VTKHDF/Points"][4, 1] += 1e-6
    ended = psim("diff", recorded, "other.vtkhdf", "--tolerance", "1e-9", "--json")
    assert ended.code == ended.json["exit_code"] == 1
    first = ended.json["first"]
    assert (first["what"], first["frame"], first["particle"], first["group"]) == ("position.y", 1, 1, "balls")
    shown = psim("diff", recorded, "other.vtkhdf", "--tolerance", "1e-9")
    assert "1 of 'balls'" in shown.out
    assert "ULP" in shown.out


def test_what_cannot_be_compared(psim, recorded) -> None:
    for arguments in (
        ("diff", recorded, "nothing.vtkhdf"),
        ("diff", recorded, "tiny.toml"),
        ("diff", recorded, recorded, "--tolerance", "-1"),
        ("rerun", "tiny.toml"),
    ):
        ended = psim(*arguments)
        assert ended.code == 2, arguments
        assert "Traceback" not in ended.err


def test_rerun(psim, recorded) -> None:
    ended = psim("rerun", recorded)
    assert ended.code == 0
    assert ended.out.startswith("identical: recorded.vtkhdf and its repetition")
    with h5py.File(recorded, "r+") as file:
        file["VTKHDF/Points"][4, 1] += 1e-6
    ended = psim("rerun", recorded, "-o", "again.vtkhdf")
    assert ended.code == 1
    assert "frame 1" in ended.out
    assert psim("diff", recorded, "again.vtkhdf").code == 1


def test_a_run_prints_its_digest(psim) -> None:
    told = psim("run", "tiny.toml")
    data = psim("run", "tiny.toml", "--json", "--force").json
    assert f"physics {data['physics'][:16]}, final state {data['state'][:16]}" in told.err
