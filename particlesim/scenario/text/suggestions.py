"""What to say of a word that a scenario may not say at its place: what psim calls it, where it belongs, or how it is spelt.

In this order: a long word with one wrong letter, a word of other tools by the thesaurus, a word of psim that belongs
elsewhere, a near miss of the words that may stand there. Where none of them is sure, nothing is said: a suggestion never
misleads.
"""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path

from pydantic import BaseModel

from particlesim.model.spelling import did_you_mean, folded, near_miss, slips
from particlesim.scenario.text.vocabulary import Place, vocabulary, whereabouts

THESAURUS = Path(__file__).with_name("thesaurus.toml")
ANYWHERE = "anywhere"
TOP = "file"
LONG = 7
"""Letters from which on a misspelt word of other tools is known: "boids" are no bonds, and "lift" is not "life"."""


def suggestion(
    word: str, known: Iterable[str], at: Sequence[str | int], root: type[BaseModel], *, key: bool = False
) -> str | None:
    """A hint for `word`, which is none of `known`, in the table or as the value at the path `at` of a `root` file.

    `key`: whether the word stands where a key of a table does.
    """
    steps = [step for step in at if isinstance(step, str)]
    known = list(known)
    numbers = [name for name in known if f"{word}s" == name or word == f"{name}s"]  # singular for plural
    sure = did_you_mean(word, numbers) or _slip(word, known) or translation(word, steps)
    if sure is not None:
        return sure
    for ours in (word, _singular(word)):
        if ours in vocabulary(root):  # spelt as it should be
            return _belongs(ours, steps, root, key=key)
    return did_you_mean(word, known) or _near_translation(word, steps)


def _slip(word: str, known: Iterable[str]) -> str | None:
    """A hint with a long word of `known` that `word` is but for one letter: that is meant, whatever it means elsewhere."""
    return next(
        (f'did you mean "{name}"?' for name in known if len(name) >= LONG and _one_letter_off(word, name)),
        None,
    )


def _one_letter_off(word: str, name: str) -> bool:
    return slips(folded(word), folded(name), 2) < 2


def translation(word: str, steps: Sequence[str] | None = None) -> str | None:
    """What the thesaurus says of `word` at an address, or with None at any; None where it does not know it."""
    entries = _entries(steps)
    return entries.get(folded(word)) or entries.get(_singular(folded(word)))


def _singular(word: str) -> str:
    return word.removesuffix("s")


def _near_translation(word: str, steps: Sequence[str]) -> str | None:
    """What the thesaurus says of a word that `word` misspells."""
    entries = _entries(steps)
    near = near_miss(word, [other for other in entries if len(other) >= LONG])
    return None if near is None else f'did you mean "{near}"? {entries[near]}'


def _entries(steps: Sequence[str] | None) -> dict[str, str]:
    """The thesaurus as it holds at an address, the narrowest section first; with None all of it."""
    sections = thesaurus()
    tried = [ANYWHERE, *sections] if steps is None else [*_addresses(steps), ANYWHERE]
    return {word: said for name in reversed(tried) for word, said in sections.get(name, {}).items()}


def _addresses(steps: Sequence[str]) -> list[str]:
    """Sections of the thesaurus that speak of an address, the narrowest first: "a.b", "*.b", "a", "*.a"."""
    if not steps:
        return [TOP]
    return [name for k in range(len(steps), 0, -1) for name in (".".join(steps[:k]), f"*.{steps[k - 1]}")]


@functools.cache
def thesaurus() -> dict[str, dict[str, str]]:
    """By address: what to say of each word, written as `folded` has it."""
    with THESAURUS.open("rb") as file:
        sections = tomllib.load(file)
    return {
        address: {folded(word): _said(text) for words, text in section.items() for word in words.split()}
        for address, section in sections.items()
    }


def _said(text: str) -> str:
    said = text.replace("`", '"')
    return f"psim calls it {said}" if " " not in said else said


def belongs(word: str, places: tuple[Place, ...]) -> str | None:
    """Where a word of psim stands: '"restitution" belongs in [[planes]]'."""
    told = []
    for role in dict.fromkeys(place.role for place in places):
        where = whereabouts(tuple(place for place in places if place.role == role))
        if role == "table":
            return f'"{word}" stands at the top of the file: {where}'
        if where:
            told.append(f"belongs in {where}" if role == "key" else f"is a {role} of {where}")
    return f'"{word}" {", and ".join(told)}' if told else None


def _belongs(word: str, steps: Sequence[str], root: type[BaseModel], *, key: bool) -> str | None:
    """Where else in a file `word` may stand, in the same part of it if there is one."""
    places = vocabulary(root).get(word, ())
    if not key:  # a value: what is said of keys is about something else
        places = tuple(place for place in places if place.role != "key")
    part = (f"[{steps[0]}]", f"[[{steps[0]}]]") if steps else ()
    here = tuple(place for place in places if place.table.endswith(part))
    near = here or places
    outer = min((place.table.count(" of ") for place in near), default=0)
    told = belongs(word, tuple(place for place in near if place.table.count(" of ") == outer))
    return None if steps and told == f'"{word}" belongs in [[{steps[0]}]]' else told  # it stands there
