"""A part of the fuzz of bodies on grains; `fuzz_bodies_on_grains.py` does as much as it is asked."""

from __future__ import annotations

import pytest
from fuzz.fuzz_bodies_on_grains import CALM, alone, broken_rules, draw, worst_of


@pytest.mark.sampled(4)
@pytest.mark.parametrize("number", [12, 14, 113, 149])
def test_no_body_sinks_into_grains_and_nothing_gains_energy(number: int) -> None:
    scenario, name = draw(number, duration=0.3)
    assert broken_rules(worst_of(scenario)) == [], name


@pytest.mark.slow
def test_what_is_hit_beside_a_body_begins_its_own_step_as_high_as_its_speed_tells() -> None:
    scenario, name = draw(59, duration=0.1)
    assert worst_of(scenario).gain < CALM, name


@pytest.mark.sampled(3)
@pytest.mark.parametrize("number", [24, 59, 61])
def test_grains_alone_gain_nothing_while_they_come_to_rest(number: int) -> None:
    scenario, name = draw(number, duration=0.4)
    assert worst_of(alone(scenario, "grains")).gain < CALM / 2, name


@pytest.mark.parametrize("number", [49, 64])
def test_bodies_alone_gain_nothing_while_they_come_to_rest(number: int) -> None:
    scenario, name = draw(number, duration=0.4)
    assert worst_of(alone(scenario, "bodies")).gain < CALM, name
