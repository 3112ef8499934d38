"""Some of the cases of fuzz_files.py, which makes any number of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz.fuzz_files import KINDS, failures


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_told(tmp_path: Path, kind: str) -> None:
    found = failures(kind, range(80), 0, tmp_path, seconds=60)  # a busy machine is no hang
    assert [f"{failure.case}: {failure.words}" for failure in found] == []
