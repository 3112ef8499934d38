"""The table of columns, and what follows from it: state, blocks, what steps keep, growth, joining, records of kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from particlesim.compiler import kernel
from particlesim.engine.state.columns import (
    Clock,
    Columns,
    Thermal,
    block_of,
    changing,
    copied,
    keep,
    mapped,
    put_back,
    replaced,
)
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import (
    CHANGING,
    CLINGS,
    CLOCK,
    HEARD,
    HIT,
    ROTATION,
    SPIN,
    TABLE,
    TRACED,
    WATCHED,
)
from particlesim.laws.registry import Particle
from particlesim.model.attributes import ATTRIBUTES, FURTHER, OPTIONAL

EVERYTHING = frozenset({CLINGS, CLOCK, ROTATION, SPIN, WATCHED, TRACED, HEARD, *OPTIONAL})
UNITLESS = ("id", "memory", "outcome", "cause", "missed", "exhausted", "hit", "turn")


def filled(count: int, memory: int, parts: frozenset[str] = EVERYTHING, capacity: int = 0) -> GroupState:
    """A group with another number in every place."""
    state = GroupState("all", max(count, capacity), memory=memory, parts=parts)
    number = iter(range(1, 10**6))
    for column in state.arrays():
        column[:count] = [next(number) % 120 for _ in column[:count]]
    state.count = count
    return state


def test_the_table_agrees_with_the_records_of_kernels() -> None:
    assert {field for column in TABLE for field in column.kernel} == set(Columns._fields)
    assert {each.symbol for each in ATTRIBUTES.values()} < set(Particle._fields)
    assert all(column.unit or column.name in UNITLESS for column in TABLE)


def test_a_group_has_no_arrays_but_those_of_the_table() -> None:
    arrays = {name for name, value in vars(filled(3, 2)).items() if isinstance(value, np.ndarray)}
    assert arrays == {column.name for column in TABLE}


@kernel
def disturb(c: Any, kept: Any) -> None:
    """Keep every particle, write over all that may change, and put it back."""
    for i in range(c.x.size):
        keep(c, kept, i)
    for array in changing(c):
        for i in range(c.x.size):
            array[i] = 0
    for i in range(c.x.size):
        put_back(c, kept, i)


@pytest.mark.parametrize("parts", [frozenset[str](), EVERYTHING], ids=["bare", "everything"])
@pytest.mark.parametrize("memory", [0, 4, 7, 12])
def test_what_is_kept_comes_back_however_much_a_method_remembers(memory: int, parts: frozenset[str]) -> None:
    state = filled(5, memory, parts)
    before = [column.copy() for column in state.arrays()]
    columns = state.columns(frozenset(ATTRIBUTES))
    more = (
        1 + 3 + 2 * 3 + 1 + 1 + len(HIT)
    )  # moment of sticking, clock, spin, missed crossings, steps with too many impacts, impact
    assert len(changing(columns)) == 6 + memory + (more if parts else 0)
    disturb(columns, np.full((len(changing(columns)), 5), np.nan))
    for column, old in zip(state.arrays(), before, strict=True):
        np.testing.assert_array_equal(column, old)


def test_a_copy_has_all_that_changes_to_itself_and_shares_the_rest() -> None:
    columns = filled(4, 3).columns(frozenset(ATTRIBUTES))
    copy = copied(columns)
    for name in Columns._fields:
        mine: list[Any] = []
        theirs: list[Any] = []
        mapped(mine.append, getattr(columns, name))
        mapped(theirs.append, getattr(copy, name))
        assert len(mine) == len(theirs) > 0
        assert [np.shares_memory(a, b) for a, b in zip(mine, theirs, strict=True)] == [
            name not in CHANGING
        ] * len(mine)
    again = replaced(columns, iter(changing(copy)))
    assert all(a is b for a, b in zip(changing(again), changing(copy), strict=True))


def test_blocks_cut_every_array_and_nothing_else() -> None:
    columns = filled(6, 2).columns(frozenset(ATTRIBUTES))
    columns = columns._replace(thermal=columns.thermal._replace(rate=0.5, ambient=290.0))
    block = block_of(columns, 2, 5)
    assert isinstance(block, Columns)
    assert isinstance(block.clock, Clock)
    assert isinstance(block.thermal, Thermal)
    assert block.thermal[2:] == (0.5, 290.0)
    whole: list[Any] = []
    cut: list[Any] = []
    mapped(whole.append, columns)
    mapped(cut.append, block)
    assert len(whole) == 8 + 2 + 4 + 2 + len(FURTHER) + 2 * 3 + 2 + len(HIT)
    for array, part in zip(whole, cut, strict=True):
        np.testing.assert_array_equal(part, array[2:5])


def test_columns_that_nothing_reads_or_a_group_does_not_have_are_none() -> None:
    bare = filled(2, 0, frozenset()).columns(frozenset(ATTRIBUTES))
    assert (bare.thermal, bare.clock, bare.further) == (None, None, (None,) * len(FURTHER))
    unread = filled(2, 0).columns(frozenset())
    assert (unread.r, unread.thermal, unread.further) == (None, None, (None,) * len(FURTHER))


def test_growth_keeps_every_column() -> None:
    state = filled(5, 3)
    before = {name: column.copy() for name, column in state.columns_by_name().items()}
    state.reserve(40)
    assert state.capacity >= 40
    for name, column in state.columns_by_name().items():
        np.testing.assert_array_equal(column, before[name])


def test_deaths_take_their_row_out_of_every_column() -> None:
    state = filled(6, 3, capacity=9)
    state.stop[:6] = np.inf
    state.stop[[1, 4]] = 0.5
    before = {name: column.copy() for name, column in state.columns_by_name().items()}
    assert state.bury(1.0).ids.tolist() == before["id"][[1, 4]].tolist()
    assert state.count == 4
    for name, column in state.columns_by_name().items():
        np.testing.assert_array_equal(column, np.delete(before[name], [1, 4], axis=-1))


def test_a_stretch_is_a_view_of_every_column() -> None:
    state = filled(7, 2)
    view = GroupState("part", 0, dtype=state.dtype, parts=state.parts)
    view.move_into(state, slice(2, 6))
    view.count = 4
    for name, column in view.columns_by_name().items():
        np.testing.assert_array_equal(column, state.columns_by_name()[name][..., 2:6])
        assert np.shares_memory(column, state.columns_by_name()[name])
