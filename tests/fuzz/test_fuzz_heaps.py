"""A part of the fuzz of heaps; `fuzz_heaps.py` does as much as it is asked."""

from __future__ import annotations

import pytest
from fuzz.fuzz_heaps import broken_rules, draw, found_in


@pytest.mark.sampled(6)
@pytest.mark.parametrize("number", [1, 26, 49, 73, 96, 132])
def test_no_heap_comes_above_the_energy_that_it_began_with(number: int) -> None:
    scenario, name = draw(number)
    assert broken_rules(found_in(scenario)) == [], name
