"""A part of the fuzz of contact; `fuzz_contact.py` does as much as it is asked."""

from __future__ import annotations

from fuzz.fuzz_contact import broken_rules


def test_nothing_is_on_the_wrong_side_and_nothing_gains_energy() -> None:
    done, wrong = 0, []
    for seed in range(24):
        _, steps, found = broken_rules(seed, 256, "room")
        done, wrong = done + steps, wrong + found
    assert wrong == []
    assert done > 1e5


def test_what_slides_on_a_sheet_does_not_pass_another_part_of_it() -> None:
    # a room of one thin mesh, in corners and along its walls at up to 10⁵ m/s
    _, steps, wrong = broken_rules(5001, 192, "sheets")
    assert wrong == []
    assert steps > 3e3


def test_nothing_is_inside_of_a_box_that_moves() -> None:
    # led and turned, with particles that slide over its edges
    _, steps, wrong = broken_rules(1004, 512, "box_upright")
    assert wrong == []
    assert steps > 5e3
