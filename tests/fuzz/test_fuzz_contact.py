"""A part of the fuzz of contact; `fuzz_contact.py` does as much as it is asked."""

from __future__ import annotations

import pytest
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


@pytest.mark.parametrize(
    ("seed", "particles", "scene", "among"),
    [
        # rounding hides the first touch of an impact at 8 km/s; what puts the particle back must not lift it
        pytest.param(3000094, 16384, None, [185, 8267], id="fast between sheets"),
        # slides on the outermost edge of a hollow cone that is led and turned
        pytest.param(900469, 16384, None, [696, 894], id="rim of a moving cone"),
        # the first part of a step that turns around leads through a wall
        pytest.param(3012, 4096, "sheets", [1202], id="turns and crosses"),
        # slides from one face of a thin sheet to another
        pytest.param(3010, 4096, "sheets", [76, 113, 141, 674], id="faces of sheets"),
        # slides at 51 km/s along a crease, which ends within its first step, whatever part of it is taken
        pytest.param(26000009, 4096, None, [2170], id="end of a crease"),
        # comes to rest in a corner, and what would lie for a shorter time flies away
        pytest.param(26000008, 65536, None, [969, 2788], id="corner of a hollow box"),
        # lies on two sheets in a whole step, and on one of them in the part of it up to a third
        pytest.param(62000028, 65536, None, [34717], id="seam of sheets"),
    ],
)
def test_what_the_fuzz_has_found_once(seed: int, particles: int, scene: str | None, among: list[int]) -> None:
    _, steps, wrong = broken_rules(seed, particles, scene, among)
    assert wrong == []
    assert steps == 20 * len(among)
