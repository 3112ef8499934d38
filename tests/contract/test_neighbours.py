"""Neighbour lists hold every pair within the cutoff, against k-d trees; with the same bits for any number of threads."""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.spatial import cKDTree

from particlesim.compiler import kernel
from particlesim.engine.barrier import new_gate
from particlesim.engine.interactions.neighbours.curve import curve_key
from particlesim.engine.interactions.neighbours.record import (
    BUILDS,
    FAR,
    GROUP,
    OVERFLOW,
    candidates_of,
    enlarged,
    forget,
    found_again,
    lasting,
    new_neighbours,
    with_lasting,
)
from particlesim.engine.interactions.neighbours.refresh import refresh
from particlesim.engine.state.columns import Clock


class Member(NamedTuple):
    """What `refresh` reads of a share."""

    number: int
    threads: int
    gate: Any


class Places(NamedTuple):
    """What `refresh` reads of columns."""

    x: Any
    y: Any
    z: Any
    r: Any = None
    clock: Any = None


@kernel
def bring_up_to_date(near: Any, c: Any, share: Any, t: Any) -> bool:
    """`refresh` as a kernel of its own."""
    return refresh(near, c, share, t)


def refreshed(near: Any, c: Places, threads: int = 1, t: float = 0.0) -> Any:
    """Lists brought up to date by some threads, with as much room as they need."""
    while True:
        gate = new_gate()
        team = [
            threading.Thread(target=bring_up_to_date, args=(near, c, Member(k, threads, gate), t))
            for k in range(threads)
        ]
        for each in team:
            each.start()
        for each in team:
            each.join()
        if not near.report[OVERFLOW]:
            return near
        near = enlarged(near)


def places(x: Any, **more: Any) -> Places:
    """Columns of places [n, 3]."""
    return Places(*np.array(x, copy=True).T.copy(), **more)


def pairs_in(near: Any, cutoff: float) -> set[tuple[int, int]]:
    """Rows of every target with every candidate that is within the cutoff, by the places that the lists hold."""
    found = []
    for g in range(near.begin.size):
        k, image = candidates_of(near, g)
        x = near.x[:, k].astype(float) + near.images[:, image]
        for place in range(GROUP * g, GROUP * g + GROUP):
            row = near.order[place]
            if row >= 0 and near.x[0, place] < FAR:
                distance = np.linalg.norm(x - near.x[:, place, None], axis=0)
                reach = cutoff if near.radii is None else cutoff + near.radii[place] + near.radii[k]
                close = (distance < reach) & (near.order[k] != row) & (abs(near.x[0, k]) < FAR)
                found += [(int(row), int(other)) for other in near.order[k[close]]]
    assert len(set(found)) == len(found)  # nobody twice
    return set(found)


def pairs_by_tree(x: Any, cutoff: float, box: Any = None) -> set[tuple[int, int]]:
    """The same by a k-d tree, which has pairs at the cutoff, too."""
    tree = cKDTree(x if box is None else np.mod(x, np.where(np.array(box) > 0, box, np.inf)), boxsize=box)
    pairs = tree.query_pairs(np.nextafter(cutoff, 0), output_type="ndarray")
    return set(map(tuple, pairs.tolist())) | set(map(tuple, pairs[:, ::-1].tolist()))


def lattice(number: int, spacing: float) -> Any:
    return spacing * np.stack(np.meshgrid(*[np.arange(number)] * 3, indexing="ij"), -1).reshape(-1, 3)


rng = np.random.default_rng(12)
SETS = {
    "random": (rng.random((700, 3)), 0.2),
    "clustered": (np.concatenate([a + 0.003 * rng.normal(size=(60, 3)) for a in rng.random((12, 3))]), 0.004),
    "equal places": (np.repeat(rng.random((20, 3)), 30, axis=0), 0.1),
    "all in one place": (np.full((100, 3), 0.3), 1.0),
    "lattice at the cutoff": (lattice(8, 0.25), 0.25),
    "lattice beyond it": (lattice(8, 0.25), 0.25 * (1 + 1e-12)),
    "flat": (rng.random((600, 3)) * (1, 1, 0), 0.1),
    "in a row": (rng.random((300, 3)) * (0, 1, 0), 0.02),
    "very sparse": (1e6 * rng.random((500, 3)), 1.0),
    "sparse clumps": (np.repeat(1e7 * rng.random((50, 3)), 10, axis=0) + rng.random((500, 3)), 0.5),
    "strays": (np.concatenate([rng.random((500, 3)), 1e9 * rng.normal(size=(20, 3))]), 0.1),
    "everybody": (rng.random((90, 3)), 10.0),
    "one": (rng.random((1, 3)), 1.0),
    "two": (np.array([[0, 0, 0], [0, 0.5, 0]]), 1.0),
    "nine": (rng.random((9, 3)), 0.5),
}


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("skin", [0.0, 0.3])
def test_pairs_are_those_of_a_tree(name: str, skin: float) -> None:
    x, cutoff = SETS[name]
    near = new_neighbours(np.arange(len(x)), len(x), cutoff, skin * cutoff)
    near = refreshed(near, places(x))
    assert pairs_in(near, cutoff) == pairs_by_tree(x, cutoff)
    assert sorted(near.order[near.order >= 0]) == list(range(len(x)))


def test_strays_do_not_make_lists_longer() -> None:
    x = rng.random((2000, 3))
    alone = refreshed(new_neighbours(np.arange(2000), 2000, 0.05, 0.0), places(x))
    both = np.concatenate([x, [[1e12, -1e13, 0]]])
    near = refreshed(new_neighbours(np.arange(2001), 2001, 0.05, 0.0), places(both))
    assert near.count.sum() < 1.2 * alone.count.sum()


@pytest.mark.parametrize("box", [(1.0, 1.0, 1.0), (1.0, None, 0.7), (None, None, 1.3), (0.41, 0.4, 5.0)])
def test_images_are_those_of_a_tree(box: tuple[float | None, ...]) -> None:
    # Places are far outside of the box, as paths of particles are; cutoffs go up to half of the period.
    x = rng.normal(size=(400, 3)) * 3
    x[:, [each is None for each in box]] *= 0.2
    for cutoff in (0.08, 0.2):
        near = new_neighbours(np.arange(400), 400, cutoff, 0.01, box=box)
        near = refreshed(near, places(x))
        sizes = [0.0 if each is None else each for each in box]
        moved = x - x.min(0) * [each is None for each in box]  # k-d trees want positive numbers
        assert pairs_in(near, cutoff) == pairs_by_tree(moved, cutoff, sizes)


def test_reach_of_radii_that_differ_ten_times() -> None:
    x, r = rng.random((500, 3)), 10 ** rng.uniform(-2.2, -1.2, 500)
    near = new_neighbours(np.arange(500), 500, 0.01, 0.004, radii=True)
    near = refreshed(near, places(x, r=r))
    distance = np.linalg.norm(x[:, None] - x, axis=2)
    close = (distance < r[:, None] + r + 0.01) & ~np.eye(500, dtype=bool)
    assert pairs_in(near, 0.01) == set(map(tuple, np.argwhere(close).tolist()))


def test_two_sections_see_each_other_only() -> None:
    x = rng.random((300, 3))
    members = np.concatenate([np.arange(40, 143), np.arange(200, 290)])
    near = new_neighbours(members, 300, 0.2, 0.02, split=103, box=(1.0, 1.0, 1.0))
    near = refreshed(near, places(x))
    first = (np.arange(300) >= 40) & (np.arange(300) < 143)
    second = (np.arange(300) >= 200) & (np.arange(300) < 290)
    wanted = {
        (i, j)
        for i, j in pairs_by_tree(x, 0.2, (1.0, 1.0, 1.0))
        if (first[i] and second[j]) or (second[i] and first[j])
    }
    assert pairs_in(near, 0.2) == wanted
    assert (near.place[:40] == -1).all()


def test_an_empty_section_and_no_members() -> None:
    x = rng.random((30, 3))
    for members, split in ((np.arange(30), 30), (np.arange(30), 0), (np.arange(0), None)):
        near = new_neighbours(members, 30, 0.5, 0.1, split=split)
        assert pairs_in(refreshed(near, places(x)), 0.5) == set()


def test_who_does_not_act_is_nobodys_neighbour() -> None:
    # Of each ten: pinned (start infinite), not yet born, dead; those to be born are in the lists, for when they are.
    x = rng.random((300, 3))
    kind = np.arange(300) % 10
    start = np.where(kind == 0, np.inf, np.where(kind == 1, 5.0, 0.0))
    stop = np.where(kind == 2, 1.0, np.inf)
    clock = Clock(start, stop, np.zeros(300, np.int64), 2.0, 2.5)
    near = new_neighbours(np.arange(300), 300, 0.2, 0.02, clocked=True)
    near = refreshed(near, places(x, clock=clock), t=2.0)
    here = (kind != 1) & (kind != 2)
    everybody = pairs_by_tree(x, 0.2)
    assert pairs_in(near, 0.2) == {(i, j) for i, j in everybody if here[i] and here[j]}
    clock = clock._replace(begin=4.5, end=5.5)
    near = refreshed(near, places(x, clock=clock), t=4.5)
    assert (near.part[near.place[kind == 1]] == 0.5).all()
    assert near.report[BUILDS] == 1
    assert pairs_in(near, 0.2) == {(i, j) for i, j in everybody if kind[i] != 2 and kind[j] != 2}


def test_lists_hold_until_two_have_approached_by_the_skin() -> None:
    # One goes 0.019 one way, another 0.019, then 0.021 the other way; skin 0.04.
    x = rng.random((400, 3))
    near = new_neighbours(np.arange(400), 400, 0.2, 0.04, box=(1.0, 1.0, 1.0))
    for way, builds in ((0.0, 1), (0.019, 1), (0.021, 2), (0.023, 2)):
        y = x.copy()
        y[7, 1] -= way if way < 0.02 else 0.021
        y[9, 1] += way
        near = refreshed(near, places(y))
        assert near.report[BUILDS] == builds
        assert pairs_in(near, 0.2) == pairs_by_tree(y, 0.2, (1.0, 1.0, 1.0))


def test_lists_hold_while_all_move_alike() -> None:
    x = rng.random((400, 3))
    near = refreshed(new_neighbours(np.arange(400), 400, 0.2, 0.04), places(x))
    drift = np.array([5, -7, 100])
    jitter = rng.uniform(-0.01, 0.01, (400, 3))
    near = refreshed(near, places(x + drift + jitter))
    assert near.report[BUILDS] == 1
    assert pairs_in(near, 0.2) == pairs_by_tree(x + drift + jitter, 0.2)
    near = refreshed(near, places(x + np.where(np.arange(400) % 2, 5, 5.05)[:, None]))
    assert near.report[BUILDS] == 2


def test_numbers_that_are_not_finite_do_no_harm() -> None:
    x = rng.random((200, 3))
    x[17], x[18], x[19, 1] = np.nan, np.inf, -np.inf
    near = refreshed(new_neighbours(np.arange(200), 200, 0.2, 0.02), places(x))
    fine = np.delete(np.arange(200), [17, 18, 19])
    wanted = {(int(fine[i]), int(fine[j])) for i, j in pairs_by_tree(x[fine], 0.2)}
    with np.errstate(invalid="ignore"):
        assert pairs_in(near, 0.2) == wanted


def test_lists_that_have_no_room_say_so() -> None:
    x = rng.random((3000, 3))
    near = new_neighbours(np.arange(3000), 3000, 2.0, 0.0)
    assert near.candidates.size < 3000 * 3000 // GROUP
    bring_up_to_date(near, places(x), Member(0, 1, new_gate()), 0.0)
    assert near.report[OVERFLOW]
    near = refreshed(near, places(x))
    assert (near.count == 3000).all()


@pytest.mark.parametrize("box", [None, (1.0, 1.0, None)])
def test_same_bits_for_any_number_of_threads(box: Any) -> None:
    x = np.concatenate([rng.random((3000, 3)), np.repeat(rng.random((10, 3)), 20, axis=0)])
    kept = []
    for threads in (1, 2, 3):
        near = new_neighbours(np.arange(3200), 3200, 0.1, 0.01, box=box)
        near = refreshed(near, places(x), threads)
        forget(near)
        near = refreshed(near, places(x), threads)
        lists = [np.stack(candidates_of(near, g)).tobytes() for g in range(near.begin.size)]
        kept.append((near.order.tobytes(), near.x.tobytes(), near.boxes.tobytes(), lists))
    assert kept[0] == kept[1] == kept[2]


def lists_in(near: Any) -> list[bytes]:
    return [np.stack(candidates_of(near, g)).tobytes() for g in range(near.begin.size)]


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("box", [None, (1.0, 1.0, None)])
def test_lists_are_found_again_from_what_lasts(box: Any, threads: int) -> None:
    # members have moved since, but not so far that lists are built anew
    x, r = rng.random((900, 3)), 0.001 + 0.01 * rng.random(900)
    near = refreshed(new_neighbours(np.arange(900), 900, 0.05, 0.02, box=box, radii=True), places(x, r=r))
    moved = places(x + 0.004 * rng.random((900, 3)), r=r)
    kept = [each.copy() for each in lasting(near)]
    near = refreshed(near, moved)
    other = new_neighbours(np.arange(900), 900, 0.05, 0.02, box=box, radii=True)
    other = refreshed(found_again(with_lasting(other, iter(kept))), moved, threads)
    assert other.report[BUILDS] == 1
    assert lists_in(near) == lists_in(other)
    assert np.array_equal(near.order, other.order)
    assert np.array_equal(near.x, other.x)
    assert np.array_equal(near.radii, other.radii)


def test_members_keep_their_places_when_the_skin_changes() -> None:
    x, r = rng.random((4000, 3)), np.full(4000, 0.01)
    near = refreshed(
        new_neighbours(np.arange(4000), 4000, 0.0, uses=(1000, 2000), radii=True), places(x, r=r)
    )
    order, skins = near.order.copy(), [float(near.skin[0])]
    for step in range(1, 5):  # which are too short-lived for a skin that is as wide as now
        x[0] = 0.5 + 0.1 * step
        near = refreshed(near, places(x, r=r))
        skins.append(float(near.skin[0]))
    assert near.report[BUILDS] == 5
    assert (np.diff(skins) > 0).all()
    assert (near.order[near.order != 0] == order[order != 0]).all()  # but for the one that moves


def test_single_precision_finds_the_same_pairs() -> None:
    x = rng.random((500, 3)).astype(np.float32)
    near = new_neighbours(np.arange(500), 500, 0.2, 0.02, dtype=np.float32)
    near = refreshed(near, places(x))
    found, wanted = pairs_in(near, 0.2), pairs_by_tree(x.astype(float), 0.2)
    assert found == wanted


def test_cells_that_follow_each_other_are_neighbours() -> None:
    # That is what makes it the Hilbert curve, with every cell passed once.
    cells = lattice(16, 1).astype(int)
    order = np.argsort([curve_key(*map(int, cell), 4) for cell in cells])
    assert (np.abs(np.diff(cells[order], axis=0)).sum(axis=1) == 1).all()


def test_too_small_a_box_is_refused() -> None:
    with pytest.raises(ValueError, match="shorter than the cutoff"):
        new_neighbours(np.arange(3), 3, 0.5, 0.1, box=(1.0, 0.5, 1.0))
