"""Every word that a scenario may say, and where: what is unknown at one place may be known at another."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import NamedTuple

from pydantic import BaseModel

from particlesim.scenario.extensions import count_added
from particlesim.scenario.text import typewalk
from particlesim.scenario.text.typewalk import Node


class Place(NamedTuple):
    """Where a word is used: in `table` ("[[planes]]", "layout of [[particles]]"), and if that has several types, in the one
    called `tag`. `role` is "key"; "table" where the word is the name of `table` itself; or the key whose value the word is:
    "type", "method". `model`: what has that key, or is of that type."""

    table: str
    tag: str | None
    role: str
    model: type[BaseModel]


def vocabulary(root: type[BaseModel]) -> dict[str, tuple[Place, ...]]:
    """The keys of all tables under the model `root`, and the values that tell types of tables apart, with their places."""
    return _vocabulary(root, count_added())


@functools.lru_cache(maxsize=4)
def _vocabulary(root: type[BaseModel], added: int) -> dict[str, tuple[Place, ...]]:
    """The words once packages have added so many types."""
    found: dict[str, dict[Place, None]] = {}
    for word, place in _walk(typewalk.node(root), "", None, ()):
        found.setdefault(word, {})[place] = None
    return {word: tuple(places) for word, places in found.items()}


def whereabouts(places: tuple[Place, ...], most: int = 3) -> str | None:
    """The places in words: '[[planes]]', '[[forces]] of type "drag" or "stokes_drag"'; None for more than `most` tables."""
    tables = dict.fromkeys(place.table for place in places)
    if len(tables) > most:
        return None
    told = []
    for table in tables:
        tags = [place.tag for place in places if place.table == table]
        named = [f'"{tag}"' for tag in tags if tag is not None]
        told.append(f"{table} of type {_either(named)}" if 0 < len(named) <= most else table)
    return _either(told)


def _either(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def _walk(kind: Node, table: str, tag: str | None, above: tuple[object, ...]) -> Iterator[tuple[str, Place]]:
    """The words of a type and of all that it holds; `above` are the models around it."""
    if kind.is_union:
        for branch in typewalk.branches(kind):
            named = typewalk.tags(branch) if branch.model is not None else []
            for name in named:
                assert branch.model is not None
                yield name, Place(table, None, typewalk.tag_key(kind), branch.model)
            yield from _walk(branch, table, named[0] if len(named) == 1 else None, above)
    elif kind.is_list:
        element = typewalk.child(kind, 0, None)
        if element is not None:
            yield from _walk(element, table, tag, above)
    elif kind.model is not None and kind.model not in above:
        for key in typewalk.allowed_keys(kind.model):
            inner = typewalk.child(kind, key, None)
            assert inner is not None
            name = _inside(table, key, inner)
            yield key, Place(table or name, tag, "key" if table else "table", kind.model)
            yield from _walk(inner, name, None, (*above, kind.model))


def _inside(table: str, key: str, kind: Node) -> str:
    """The name of the table that `key` of `table` holds; "" is the top of the file."""
    if table:
        return f"{key} of {table}"
    return f"[[{key}]]" if kind.is_list else f"[{key}]" if kind.model is not None else "the top of the file"
