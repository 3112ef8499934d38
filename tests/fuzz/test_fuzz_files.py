"""Some of the cases of fuzz_files.py, which makes any number of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz.fuzz_files import KINDS, failures


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_told(tmp_path: Path, kind: str) -> None:
    assert [f"{f.case}: {f.words}" for f in failures(kind, range(80), 0, tmp_path)] == []
