"""Some cases of `tests/fuzz/fuzz_trajectories.py`, which has thousands."""

import importlib.util
import sys
from collections import Counter
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "fuzz" / "fuzz_trajectories.py"
CASES = 15


@pytest.fixture(scope="module")
def fuzz():
    spec = importlib.util.spec_from_file_location("fuzz_trajectories", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its data classes look themselves up there
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def ground(fuzz, tmp_path_factory):
    return fuzz.prepare(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize("first", [CASES, pytest.param(4 * CASES, marks=pytest.mark.slow)])
def test_bad_trajectories_are_told_as_such(fuzz, ground, first):
    outcomes = Counter()
    for number in range(first, first + CASES):
        assert fuzz.check(number, 0, ground, outcomes) is None
    assert (
        min(outcomes["fine"], outcomes["2"], outcomes["4"]) > 0
    )  # some damage does not matter, some data are elsewhere


def test_a_case_is_known_by_its_number(fuzz, ground):
    one, done = fuzz.spoil(12, 0, ground)
    content = one.read_bytes()
    again, done_again = fuzz.spoil(12, 0, ground)
    assert (content, done) == (again.read_bytes(), done_again)
