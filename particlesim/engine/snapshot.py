"""The state of a simulation as named arrays and numbers, and back again.

All attributes of a simulation, its islands and its groups are state unless `FOLLOWS` lists them as following from the
scenario, so that a new array or counter is stored without further code; an attribute that cannot be stored is an error.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from types import BuiltinFunctionType, FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from particlesim.emitters import Schedule
from particlesim.engine.interactions.interaction import Interaction
from particlesim.engine.interactions.neighbours.record import Neighbours
from particlesim.engine.islands.births import Births
from particlesim.engine.simulation import Events, Simulation
from particlesim.engine.state.group_state import Deaths, GroupState
from particlesim.engine.state.table import TABLE
from particlesim.integrators import Method
from particlesim.model.arrays import packed
from particlesim.sampling.random_streams import Streams

Array = NDArray[Any]
Number = int | float

FIXED = (
    BaseModel,
    Method,
    Schedule,
    Streams,
    np.dtype,
    str,
    frozenset,
    type,
    FunctionType,
    BuiltinFunctionType,
    type(None),
)
"""Kinds of values that never change in the course of a run."""

FOLLOWS: dict[str, frozenset[str]] = {
    "Simulation": frozenset(
        {
            *("scenario", "grid", "graph", "islands", "states", "team", "events"),
            *("_kicks", "_labels", "_sources", "_ledger_columns", "_totals", "_pressures"),
            *("_energies", "_energies_of", "_order", "_heard", "_numbers", "_codes", "_meetings"),
        }
    ),
    "Crossings": frozenset(("_watched",)),
    "Guard": frozenset(("_judged", "_from", "_drift")),
    "Account": frozenset(("_names", "_absolute")),
    "Books": frozenset(("names", "_spent", "_stored", "jolts")),
    "RigidIsland": frozenset(
        (
            "_joined",
            "_structure",
            "_method",
            "_scene",
            "_still",
            "_shapes",
            "visitors",
            "_asked",
            "left",
            "guests",
            "told",
            "_motion",
            "_contacts",
            "_kept",
            "_kept_memory",
            *("_made", "_springs", "_order", "_scenario", "_particles", "_party", "_crew"),
            *("_seen", "_obstacles", "_blows", "_set_out"),
            "kept_from",
            "impacts",
        )
    ),
    "Loads": frozenset(("_away",)),
    "Ties": frozenset(("_sets", "_states", "rows", "held", "given", "awaited", "_after")),
    "IndependentIsland": frozenset(("program", "_booking", "_rooms", "_rested", "_steady", "impacts")),
    "CoupledIsland": frozenset(
        {
            *("names", "kept_from", "_scenario", "_structure", "_joined", "_stepper", "_site", "_sets"),
            *("_books", "_kept", "_method", "impacts", "_obstacles", "_left"),
        }
    ),
    "Layout": frozenset(
        {
            *("bounds", "parts", "driven", "constraint", "work", "count", "dtype", "effort"),
            *("_cooling", "_method", "_shares"),
        }
    ),
    "Neighbours": frozenset(Neighbours._fields) - {"order", "place", "base", "wrap", "skin", "report"},
    "Roster": frozenset(("number", "pairs", "rest")),
    "GroupState": frozenset({"axes", "holders", "_known_columns", *(column.name for column in TABLE)}),
}
"""By the classes of the engine: attributes that follow from the scenario or from other attributes, and scratch arrays that
every step fills anew. The columns of groups are stored by their table."""


@dataclass
class Snapshot:
    """Arrays and numbers of a state, by names such as 'drops.x' and 'drops._source.born'."""

    arrays: dict[str, Array] = field(default_factory=dict)
    numbers: dict[str, Number] = field(default_factory=dict)


class MisfitError(ValueError):
    """A snapshot that does not belong to the simulation it is put into."""


def snapshot(simulation: Simulation) -> Snapshot:
    """A copy of the state, with the births and deaths that no frame has taken yet.

    Raises TypeError for an attribute of a kind that cannot be stored.
    """
    found = _captured(simulation)
    found.arrays = {name: array.copy() for name, array in found.arrays.items()}
    births, deaths = simulation.events.births, simulation.events.deaths
    found.arrays["births.ids"] = _joined([each.ids for each in births], np.int64)
    found.arrays["births.times"] = _joined([each.times for each in births], np.float64)
    found.arrays["deaths.ids"] = _joined([each.ids for each in deaths], np.int64)
    found.arrays["deaths.times"] = _joined([each.times for each in deaths], np.float64)
    found.arrays["deaths.causes"] = _joined([each.causes for each in deaths], np.uint8)
    return found


def weight(simulation: Simulation) -> int:
    """About how many bytes a snapshot of the state would take; nothing is copied."""
    return sum(array.nbytes for array in _captured(simulation).arrays.values())


def restore(simulation: Simulation, saved: Snapshot) -> None:
    """Put a snapshot into a simulation of the same scenario that has not begun. Raises MisfitError if it is of another."""
    known = _captured(simulation)
    events = {"births.ids", "births.times", "deaths.ids", "deaths.times", "deaths.causes"}
    if set(known.arrays) | events != set(saved.arrays) or set(known.numbers) != set(saved.numbers):
        raise MisfitError("it holds the state of another simulation")
    _restored(simulation, "simulation", saved)
    for island, name in _islands(simulation):
        before = [state.id[: state.count].copy() for state in island.states]
        for k, state in enumerate(island.states):
            _restored(state, f"{name}.states.{k}", saved)
        island.resettle(np.concatenate(before))
        _restored(island, name, saved)
        island.recall()
    array = saved.arrays
    simulation.events = Events()
    if len(array["births.ids"]):
        simulation.events.births.append(Births(array["births.ids"], array["births.times"]))
    if len(array["deaths.ids"]):
        simulation.events.deaths.append(
            Deaths(array["deaths.ids"], array["deaths.times"], array["deaths.causes"])
        )


def _captured(simulation: Simulation) -> Snapshot:
    """The state itself, not copied."""
    found = Snapshot()
    _capture(simulation, "simulation", found)
    for island, name in _islands(simulation):
        _capture(island, name, found)
    return found


def _islands(simulation: Simulation) -> list[tuple[Any, str]]:
    return [(island, f"island.{k}") for k, island in enumerate(simulation.islands)]


def _joined(parts: list[Array], dtype: Any) -> Array:
    return np.concatenate([np.empty(0, dtype), *parts])


def _children(value: Any) -> list[tuple[str, Any]] | None:
    """The named parts of a container or of an object of the engine; None for anything else."""
    left_out = (
        value.follows if isinstance(value, Interaction) else FOLLOWS.get(type(value).__name__, frozenset())
    )
    parts: Iterable[tuple[str, Any]]
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        parts = zip(value._fields, value, strict=True)
    elif isinstance(value, tuple | list):
        parts = ((str(k), each) for k, each in enumerate(value))
    elif isinstance(value, dict):
        parts = ((str(k), each) for k, each in value.items())
    elif type(value).__module__.startswith("particlesim.") and hasattr(value, "__dict__"):
        parts = vars(value).items()
    else:
        return None
    return [(name, each) for name, each in parts if name not in left_out]


def _capture(value: Any, name: str, found: Snapshot) -> None:
    if isinstance(value, np.ndarray):
        found.arrays[name] = value
    elif isinstance(value, bool | int | float | np.generic):
        found.numbers[name] = value.item() if isinstance(value, np.generic) else value
    elif isinstance(value, FIXED):
        return
    elif (children := _children(value)) is None:
        raise TypeError(f"{name} is a {type(value).__name__}, which a checkpoint cannot hold")
    else:
        if isinstance(value, GroupState):
            found.arrays |= {f"{name}.{key}": column for key, column in value.columns_by_name().items()}
        for key, child in children:
            _capture(child, f"{name}.{key}", found)


def _restored(value: Any, name: str, saved: Snapshot) -> Any:
    """What takes the place of `value`: the same object with its content changed where that is possible, as arrays are
    shared between groups and islands."""
    if isinstance(value, np.ndarray):
        new = _fitting(value, saved.arrays[name], name)
        if value.shape != new.shape:
            value = packed(new.shape, new.dtype)
        value[...] = new
        return value
    if isinstance(value, bool | int | float | np.generic):
        return type(value)(saved.numbers[name])
    if isinstance(value, FIXED):
        return value
    if isinstance(value, GroupState):
        _restore_columns(value, name, saved)
    children = {key: _restored(child, f"{name}.{key}", saved) for key, child in _children(value) or ()}
    if isinstance(value, tuple):
        if hasattr(value, "_replace"):
            return value._replace(**children)
        return type(value)(children.values())
    if isinstance(value, list):
        value[:] = children.values()
    elif isinstance(value, dict):
        value.update(zip(value, children.values(), strict=True))
    else:
        for key, child in children.items():
            setattr(value, key, child)
    return value


def _restore_columns(state: GroupState, name: str, saved: Snapshot) -> None:
    count = int(saved.numbers[f"{name}.count"])
    state.reserve(count)
    state.count = count
    for key, column in state.columns_by_name().items():
        new = _fitting(column, saved.arrays[f"{name}.{key}"], f"{name}.{key}")
        if new.shape != column.shape:
            raise MisfitError(f"{name}.{key} has shape {new.shape}, not {column.shape}")
        column[...] = new


def _fitting(here: Array, saved: Array, name: str) -> Array:
    """The saved array, which may differ in one of its lengths: some have room for more than they hold, along their first
    axis (memories of contacts) or their last one."""
    same = here.dtype == saved.dtype and here.ndim == saved.ndim
    if not same or sum(a != b for a, b in zip(here.shape, saved.shape, strict=True)) > 1:
        raise MisfitError(f"{name} is of another kind")
    return saved
