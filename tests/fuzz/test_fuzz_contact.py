"""A part of the fuzz of contact; `fuzz_contact.py` does as much as it is asked."""

from __future__ import annotations

from fuzz.fuzz_contact import broken_rules


def test_nothing_is_on_the_wrong_side_and_nothing_gains_energy() -> None:
    done, wrong = 0, []
    for seed in range(24):
        steps, found = broken_rules(seed)
        done, wrong = done + steps, wrong + found
    assert wrong == []
    assert done > 1e5
