"""Suggestions for misspelt names: near misses only, as a wrong suggestion is worse than none."""

from __future__ import annotations

from collections.abc import Iterable

LONGEST = 64
"""Characters beyond which a word is no slip of the hand."""


def did_you_mean(word: str, known: Iterable[str]) -> str | None:
    """A hint with the one of `known` that `word` was probably meant to be."""
    near = near_miss(word, known)
    return None if near is None else f'did you mean "{near}"?'


def near_miss(word: str, known: Iterable[str]) -> str | None:
    """The one of `known` that `word` misspells or cuts short, None where none is near.

    Capitals and dashes do not count. Slips are letters left out, added, replaced or swapped with the next one: none in a
    word of two letters, one in six letters, two in ten, three in longer ones. In a word of three
    the first and the last letter are right, as it could be any word otherwise; digits may differ.
    """
    wanted, names = folded(word), list(known)
    if len(wanted) == 3:
        names = [name for name in names if len(folded(name)) != 3 or _alike(wanted, folded(name))]
    if not wanted or len(word) > LONGEST:
        return None
    far = 1 + (len(wanted) > 2) + (len(wanted) > 6) + (len(wanted) > 10)
    found = [(slips(wanted, folded(name), far), k) for k, name in enumerate(names)]
    fewest, first = min(found, default=(far, 0))
    if fewest < far:
        return names[first]
    begun = [name for name in names if len(wanted) > 2 and folded(name).startswith(wanted)]
    return begun[0] if len(begun) == 1 else None


def _alike(word: str, name: str) -> bool:
    """Whether two words of three letters are near: ends that agree, or the same letters."""
    ends = (word[0], word[-1]) == (name[0], name[-1])
    return ends or sorted(filter(str.isalpha, word)) == sorted(filter(str.isalpha, name))


def folded(name: str) -> str:
    """`name` without what does not count in a comparison: capitals, dashes, underscores and spaces."""
    return "".join(letter for letter in name.lower() if letter.isalnum())


def slips(word: str, name: str, far: int) -> int:
    """Optimal string alignment distance of two words, or `far` where it is not less.

    Source: F. J. Damerau, A technique for computer detection and correction of spelling errors, CACM 7(3), 1964.
    """
    if abs(len(word) - len(name)) >= far:
        return far
    last: list[int] = []
    row = list(range(len(name) + 1))
    for i, a in enumerate(word, 1):
        before, last, row = last, row, [i]
        for j, b in enumerate(name, 1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (a != b))
            if i > 1 and j > 1 and a == name[j - 2] and word[i - 2] == b:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
    return min(row[-1], far)
