"""The laws of all hard contacts of an island, whose impulses are found together: pair by pair, the numbers of its table.

Each table has its own neighbour lists. The pairs that they find lie on one bench, as a heap of grains under several tables
is one heap: what grains of one table push on each other presses those of another one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.response import STEADY, FallingRecord, falls_by
from particlesim.engine.interactions.interaction import Site
from particlesim.engine.state.columns import type_of
from particlesim.interactions import PairSet
from particlesim.interactions.contact import Contact
from particlesim.scenario.reach import pair_sets, touches_by_surfaces


class Laws(NamedTuple):
    """By the numbers of tables: restitution of slow impacts [tables]; static and kinetic coefficients of friction
    [2, tables]; v₀ [m/s] and n of restitution that falls with speed [2, tables]; rolling friction [tables]. The last three
    None where no table has any."""

    restitution: Any
    friction: Any = None
    falling: Any = None
    rolling: Any = None


def tables_of(site: Site) -> tuple[PairSet, ...]:
    """The hard contacts of an island, in the order in which they act."""
    scenario, found = site.scenario, []
    for each in pair_sets(scenario):
        hard = (
            isinstance(each.law, Contact)
            and each.law.by_impulses
            and any(name in site.state for name in each.groups)
        )
        groups = [group for group in scenario.groups if group.name in each.groups]
        if hard and not touches_by_surfaces(each.law, groups):
            found.append(each)
    return tuple(found)


def laws_of(site: Site) -> Laws:
    """The laws of the hard contacts of an island."""
    records: list[Any] = [each.law.record() for each in tables_of(site)]
    rubs, falls, rolls = (
        any(getattr(each, name) is not None for each in records)
        for name in ("friction", "falling", "rolling")
    )

    def columns(numbers: Any) -> Any:
        return np.array(list(numbers), site.dtype).T.copy()

    return Laws(
        columns(each.restitution for each in records),
        columns(each.friction or (0.0, 0.0) for each in records) if rubs else None,
        columns(each.falling or STEADY for each in records) if falls else None,
        columns(each.rolling or 0.0 for each in records) if rolls else None,
    )


# Kernels


def restitution_at(each: Any, k: Any) -> Any:
    """Restitution of slow impacts of pair k."""
    return each.laws.restitution[each.bench.table[k]]


def bounces_at(law: Any, approach: Any) -> Any:
    """Restitution by a law at the approach of an impact [m/s]."""
    e = type_of(approach, law.restitution)
    return e if law.falling is None else e * falls_by(law.falling, approach)


def bounces_of(each: Any, k: Any, approach: Any) -> Any:
    """Restitution of pair k at the approach of an impact [m/s]."""
    falling, e = each.laws.falling, type_of(approach, restitution_at(each, k))
    if falling is None:
        return e
    at = each.bench.table[k]
    return e * falls_by(FallingRecord(falling[0, at], falling[1, at]), approach)


def static_at(each: Any, k: Any) -> Any:
    """The coefficient of friction of pair k at rest; there is some in a table."""
    return each.laws.friction[0, each.bench.table[k]]


def kinetic_at(each: Any, k: Any) -> Any:
    """The coefficient of friction of pair k when it slides; there is some in a table."""
    return each.laws.friction[1, each.bench.table[k]]


def rolling_at(each: Any, k: Any) -> Any:
    """The rolling friction of pair k; there is some in a table."""
    return each.laws.rolling[each.bench.table[k]]


def some_rest(laws: Any) -> bool:
    """Whether some contacts may come to rest: elastic ones do not."""
    found = False
    for at in range(laws.restitution.size):
        found = found | (laws.restitution[at] < 1)
    return found
