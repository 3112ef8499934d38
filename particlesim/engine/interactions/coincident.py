"""Particles at the same position: an error where the force between them has no value."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.interactions.interaction import Floats, Ints, Site
from particlesim.errors import DivergenceError, PostMortem, UsageError
from particlesim.interactions import PairSet


class Coincidence(NamedTuple):
    """Two particles in one place: their groups and rows there, and the place [m], in the box if there is one."""

    groups: tuple[str, str]
    rows: tuple[int, int]
    place: Floats


def refuse_coincident(site: Site, pairs: PairSet) -> None:
    """Raise UsageError for two particles at the same place that act on each other."""
    if (found := _coincident(site, pairs)) is not None:
        raise UsageError(_told(site, pairs, found, found.rows), "move one of them" + _softer(pairs))


def refuse_coincident_births(site: Site, pairs: PairSet, born: Ints, time: float) -> None:
    """Raise DivergenceError for a particle that was born, by its id, and is at the place of another on which it acts, at a
    time [s].

    The force between them is taken as 0 there, and a tree's energy would be that of a distance of rounding.
    """
    found = _coincident(site, pairs, born)
    if found is None:
        return
    states = [site.state[name] for name in found.groups]
    ids = tuple(int(state.id[row]) for state, row in zip(states, found.rows, strict=True))
    newest = max(range(2), key=lambda k: (ids[k] in born, ids[k]))
    state, row = states[newest], found.rows[newest]
    x, v = ((float(a), float(b), float(c)) for a, b, c in (state.x[:, row], state.v[:, row]))
    dt = site.scenario.grid.dt
    post_mortem = PostMortem(
        "birth", time, ids[newest], found.groups[newest], time, x, v, pairs.name, math.nan, dt, None
    )
    told = _told(site, pairs, found, (ids[0], ids[1]))
    raise DivergenceError(told, "let them be born apart" + _softer(pairs), post_mortem)


def _told(site: Site, pairs: PairSet, found: Coincidence, numbers: tuple[int, int]) -> str:
    """Which two particles, by their numbers, are where."""
    a, b = found.groups
    first, second = numbers
    who = f"particle {first} of {a!r} and particle {second} of {b!r}"
    if a == b:
        who = f"particles {first} and {second} of {a!r}"
    place = ", ".join(f"{value:g}" for value in found.place)
    box = " of the periodic box" if site.scenario.simulation.box is not None else ""
    return (
        f"{pairs.name}: {who} are at the same place{box} ({place}), where the force between them has no value"
    )


def _softer(pairs: PairSet) -> str:
    return ", or give the interaction a softening" if hasattr(pairs.law, "softening") else ""


def _coincident(site: Site, pairs: PairSet, born: Ints | None = None) -> Coincidence | None:
    """Two particles at the same place, one of them born if ids are given, that act on each other."""
    states = [site.state[name] for name in pairs.groups]
    x = np.concatenate([state.position.astype(float) for state in states])
    group = np.repeat(np.arange(len(states)), [state.count for state in states])
    row = np.concatenate([np.arange(state.count) for state in states])
    box = site.scenario.simulation.box
    if box is not None:
        x = box.as_box().wrapped(x)
    if born is not None:
        new: NDArray[np.bool_] = np.isin(np.concatenate([state.id for state in states]), born)
        near = np.isin(x[:, 0], x[new, 0])
        x, group, row = x[near], group[near], row[near]
    order = np.lexsort(x.T)
    same = (x[order][1:] == x[order][:-1]).all(axis=1)
    if pairs.law.between is not None:
        same &= group[order][1:] != group[order][:-1]
    if not same.any():
        return None
    k = int(same.argmax())
    (a, first), (b, second) = sorted((int(group[i]), int(row[i])) for i in order[k : k + 2])
    return Coincidence((pairs.groups[a], pairs.groups[b]), (first, second), x[order[k]])
