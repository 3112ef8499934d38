"""A trajectory that leads to another file: no command follows it."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest

from .conftest import TINY, files

SECRET = "the content of another file"
READS = '[[particles]]\nname = "more"\nmass = 1\nlayout = { type = "file", path = "recorded.vtkhdf" }\n'
COMPARES = '[[checks]]\nquantity = "position"\nreference = "recorded.vtkhdf"\ntolerance = 1\n'


@pytest.mark.parametrize(
    "command",
    [
        "inspect recorded.vtkhdf",
        "inspect --json recorded.vtkhdf",
        "inspect --repair recorded.vtkhdf",
        "plot recorded.vtkhdf x -o out.png",
        "diff recorded.vtkhdf recorded.vtkhdf",
        "export recorded.vtkhdf -o out.csv",
        "render recorded.vtkhdf -o out.png",
        "rerun recorded.vtkhdf",
        "run tiny.toml -o recorded.vtkhdf --resume",
        "run compares.toml -o out.vtkhdf",
        "run reads.toml -o out.vtkhdf",
        "check reads.toml",
        "verify reads.toml",
        "stability reads.toml",
    ],
)
def test_every_command_refuses_it(psim, recorded, command) -> None:
    """Exit code 4, nothing written, and nothing of the other file told."""
    Path("secret").write_text(SECRET * 100)
    Path("reads.toml").write_text(TINY + READS)
    Path("compares.toml").write_text(TINY + COMPARES)
    with h5py.File(recorded, "r+", libver=("v110", "v110")) as file:
        del file["VTKHDF/Points"]
        file.create_dataset("VTKHDF/Points", (30, 3), "f4", external=[("secret", 0, 360)])
    before = files()
    ended = psim(*command.split())
    told = ended.out + ended.err
    assert ended.code == 4, told
    assert "recorded.vtkhdf leads to other files: the data of /VTKHDF/Points are in another file" in " ".join(
        told.split()
    )
    if command in ("check reads.toml", "run reads.toml -o out.vtkhdf"):
        assert "reads.toml:28:34: particles.more.layout.path: " in told
    assert SECRET not in told
    assert files() == before
