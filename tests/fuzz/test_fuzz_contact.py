"""A part of the fuzz of contact; `fuzz_contact.py` does as much as it is asked."""

from __future__ import annotations

import numpy as np
import pytest
from fuzz.fuzz_contact import Drawn, broken_in_scene, broken_rules, search
from simulate import points, way


@pytest.mark.slow
def test_nothing_is_on_the_wrong_side_and_nothing_gains_energy() -> None:
    done, wrong = 0, []
    for seed in range(24):
        _, steps, found = broken_rules(seed, 256, "room")
        done, wrong = done + steps, wrong + found
    assert wrong == []
    assert done > 1e5


def test_hypothesis_finds_no_scene_that_breaks_a_rule() -> None:
    assert search(5e4, 128, 0, "room", "velocity_verlet") > 2e4


def test_what_slides_on_a_sheet_does_not_pass_another_part_of_it() -> None:
    # a room of one thin mesh, in corners and along its walls at up to 10⁵ m/s
    _, steps, wrong = broken_rules(5001, 192, "sheets")
    assert wrong == []
    assert steps > 3e3


def test_nothing_is_under_what_stands_on_a_floor() -> None:
    # points, along a turned floor at up to 10⁵ m/s
    _, steps, wrong = broken_rules(2, 1024, "floor")
    assert wrong == []
    assert steps > 1e4


def test_nothing_is_inside_of_a_box_that_moves() -> None:
    # led and turned, with particles that slide over its edges
    _, steps, wrong = broken_rules(1004, 512, "box_upright")
    assert wrong == []
    assert steps > 5e3


@pytest.mark.sampled(4)
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
        # slides along the crease of a thin mesh that ends at a third wall, and slows down by friction
        pytest.param(2615, 65536, None, [48509, 48973, 50755], id="wall at the end of a crease"),
        # stops in a curved crease, 38 nm higher than its energy reaches
        pytest.param(7171, 65536, None, [7084], id="stop in a curved crease"),
        # stops between a floor and the upright edge of a box, of which two stand side by side
        # slides along what is pushed over a floor, and may not stop while that goes on
        pytest.param(21031, 65536, None, [52948], id="beside what is pushed"),
        pytest.param(106, 65536, "floor", [8084, 38486], id="stop around an edge"),
    ],
)
def test_what_the_fuzz_has_found_once(seed: int, particles: int, scene: str | None, among: list[int]) -> None:
    _, steps, wrong = broken_rules(seed, particles, scene, among)
    assert wrong == []
    assert steps == 20 * len(among)


DRAWN = [
    *(39666544, "velocity_verlet", 1, 0.0, "room", 0.008333333333330065, "floor", 0.05867129443073881),
    *(
        0.30579777757038,
        0.3697027407028015,
        75.86024660184833,
        0.0,
        "box",
        0.8,
        1.0,
        1e-09,
        0.2,
        0.1706858061527328,
    ),
    *("cylinder", 2.0, 0, 0, 2.0, 1.0, 0.3933576939479908, 0.3089015008593399, 0.3, 0.1, 0.3, 0.2),
    *(
        0.3333333333333333,
        0.3333333333333333,
        0,
        0,
        0.3,
        1e-09,
        0.4062452631167228,
        0.2052039952733083,
        0,
        0.1,
        1e-09,
    ),
    *(
        1e-09,
        0.5866092272215919,
        0.48498097654467454,
        0.8,
        0,
        0.3,
        0.2,
        0.695952755563713,
        2.93177550584344,
        0.0,
        1.0,
    ),
    -2.839162236332608,
]
"""What hypothesis drew: a smooth cylinder is led over a floor whose kinetic friction is above its static one."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Using `assume` outside")  # what was drawn is what it assumes
def test_what_stops_after_each_push_is_not_overrun() -> None:
    draws = iter(DRAWN)
    rng = Drawn(lambda _: next(draws))
    _, steps, wrong = broken_in_scene(
        rng, rng, "hypothesis", 65536, among=[46047, 47701], method=str(rng.draw(None))
    )
    assert wrong == []
    assert steps == 40


def test_velocities_of_symplectic_euler_are_late_after_too_many_impacts_too() -> None:
    """Seed 2662: at 51 km/s between two walls it had gained h f/2 in each step, as the next one began half a step later."""
    _, steps, wrong = broken_rules(2662, 65536, None, [5950], "symplectic_euler")
    assert wrong == []
    assert steps == 20


def test_what_lies_on_a_sheet_hits_walls_with_the_velocities_of_its_places() -> None:
    """Symplectic Euler. A step of 1.2 m leads beside the edge of the sheet on the way down, not on the way up: with late
    velocities for one of both impacts alone, each cycle had gained 2 h v·g, 13 J/kg."""
    _, steps, wrong = broken_rules(510, 16384, "sheets", [15632, 9144, 284], "symplectic_euler")
    assert wrong == []
    assert steps == 60


def test_what_lies_on_a_bent_wall_for_a_part_of_a_step_does_not_fly_through_it_in_another() -> None:
    """Seed 2634. In a hollow torus, which is there twice, it lies for longer and for shorter times, and would fly 1 m
    through the wall in between; put back from there, a tenth of such ways had gained g times that, 0.18 J/kg."""
    x = np.array([-1.1501484053651014, -2.6799354535223527e-4, -0.48954922748842133])
    v = np.array([-8780.136552705857, -10.042597403170435, 20628.09409949257])
    g = np.array([0.00227016719147857, 0.00229774485706977, 0.2380227034145352])
    ways = v * (1 + 1e-13 * np.random.default_rng(5).normal(size=(400, 3)))
    torus = {"type": "torus", "inside": True, "radius": 0.8, "tube": 0.5}
    world = {"type": "sphere", "inside": True, "radius": 3.0, "restitution": 1.0}
    x, v = way(
        1,
        0.00061589818702992,
        0.00061589818702992,
        "velocity_verlet",
        particles=[points(*[x.tolist()] * len(ways), velocity=ways.tolist(), mass=1.0, radius=0.05)],
        forces=[{"type": "gravity", "acceleration": g.tolist()}],
        colliders=[*({**torus, "restitution": e} for e in (1.0, 0.3)), world],
    )
    energy = (v**2).sum(-1) / 2 - x @ g
    assert (energy[1] - energy[0]).max() < 1e-3
