"""The scanner: the text at each reported place is the value that tomllib reads."""

import tomllib
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from particlesim.scenario.text.positions import Path, decode, scan
from particlesim.scenario.text.source import parse_source

DOCUMENT = """\
title = "x"  # a comment = "no"
"quoted key".'dotted'.bare = 1
when = 1979-05-27 07:32:00
text = \"\"\"
two "lines\\
   \"\"\"\"\"
[simulation]  # the table
dt = 0.1
deep.er = { a.b = [1, { c = 2 }], d = "}" }

[[particles]]
layout = { position = [
  [0, 1, 2],  # ] is no end
  [3, 4,
   5],
] }
[[particles]]
name = 'C:\\n'
[[particles.parts]]
x = 1
[[particles.parts]]
x = 2
[particles.parts.more]
y = [ ]
"""

scalars = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(st.characters(blacklist_categories=("Cs",)), max_size=8)
    | st.datetimes()
    | st.dates()
)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
)
documents = st.dictionaries(st.text(max_size=6), values, max_size=5)


def leaves(value: Any, path: Path = ()) -> list[tuple[Path, Any]]:
    items: list[tuple[str | int, Any]]
    if isinstance(value, dict):
        items = list(value.items())
    elif isinstance(value, list):
        items = list(enumerate(value))
    else:
        return [(path, value)]
    return [leaf for key, child in items for leaf in leaves(child, (*path, key))]


def check_document(text: str) -> None:
    found = scan(text)
    assert found.stopped_at is None
    assert not found.duplicates
    for path, value in leaves(tomllib.loads(text)):
        place = found.places[path]
        assert tomllib.loads("v = " + text[place.value.start : place.value.end]) == {"v": value}, path
        if isinstance(path[-1], str):
            assert place.key is not None
            key = text[place.key.start : place.key.end]
            assert tomllib.loads(f"{key} = 0") == {path[-1]: 0}


def test_every_form_of_key_and_value() -> None:
    check_document(DOCUMENT)


@given(documents)
def test_places_of_generated_documents(document: dict[str, Any]) -> None:
    check_document(tomli_w.dumps(document))
    check_document(tomli_w.dumps(document, multiline_strings=True))


@given(st.text(max_size=60) | st.text(alphabet="ab=[]{},.\"'#\n 1\\", max_size=40))
def test_the_scanner_ends_on_any_text(text: str) -> None:
    scan(text)


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        (("simulation",), "[simulation]"),
        (("particles",), "[[particles]]"),
        (("particles", 1), "[[particles]]"),
        (("particles", 1, "parts", 1, "x"), "2"),
        (("particles", 1, "parts", 1, "more"), "[particles.parts.more]"),
        (("particles", 0, "layout", "position", 1, 2), "5"),
        (("particles", 0, "layout", "position", 0), "[0, 1, 2]"),
        (("simulation", "deep"), "deep"),
        (("simulation", "deep", "er", "a", "b", 1, "c"), "2"),
    ],
)
def test_tables_and_nested_elements(path: Path, expected: str) -> None:
    place = scan(DOCUMENT).places[path]
    assert DOCUMENT[place.value.start : place.value.end] == expected


def test_lines_and_columns() -> None:
    source = parse_source("a = 1\r\n[b]\r\nc = [\r\n  1,\r\n  22]\r\n")
    place = source.place(("b", "c", 1))
    assert place is not None
    span = source.main.span(place.value)
    assert (span.line, span.column, span.length) == (5, 3, 2)
    whole = source.place(("b", "c"))
    assert whole is not None
    assert source.main.span(whole.value).length == 1  # only the bracket on the first line is underlined


@pytest.mark.parametrize(
    ("literal", "offset", "column"),
    [
        ('"-k*x"', 3, 9),
        ("'-k*x'", 0, 6),
        (r'"a\tb\u00e9c"', 2, 9),  # the b after \t
        (r'"a\tb\u00e9c"', 4, 16),  # the c after \u00e9
        ('"abc"', 3, 9),  # past the end: the closing quote
        ('"abc"', 99, 9),
    ],
)
def test_offsets_inside_strings(literal: str, offset: int, column: int) -> None:
    span = parse_source(f"f = {literal}").span_in_string(("f",), offset)
    assert span is not None
    assert (span.line, span.column) == (1, column)


def test_offsets_inside_text_of_several_lines() -> None:
    span = parse_source('f = """\nab\ncd"""').span_in_string(("f",), 3, 2)
    assert span is not None
    assert (span.line, span.column, span.length) == (3, 1, 2)


def test_a_number_has_no_offsets_inside() -> None:
    assert parse_source("f = 1").span_in_string(("f",), 0) is None


@given(st.text(st.characters(blacklist_categories=("Cs",)), max_size=12))
def test_decoding_gives_what_tomllib_reads(text: str) -> None:
    literal = tomli_w.dumps({"v": text})[4:-1]
    assert "".join(character for character, _ in decode(literal)) == text
