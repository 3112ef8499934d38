"""The rendered text: carets stand below what they mean, whatever the line holds."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from particlesim.errors import Diagnostic, Label, Span
from particlesim.scenario.text.report import render_all, render_text

SOURCE = 'a = 1\nb = "x"\n\n\ncoefficient = -1\n'


def test_the_whole_picture() -> None:
    diagnostic = Diagnostic(
        "must be greater than 0, got -1",
        "forces.air.coefficient",
        Path("fountain.toml"),
        SOURCE,
        Span(5, 15, 2),
        (Label(Span(1, 5), "the other"),),
        "a number > 0, in kg/s",
        "use 1",
    )
    assert render_text(diagnostic) == "\n".join(
        [
            "error: must be greater than 0, got -1",
            " --> fountain.toml:5:15  (forces.air.coefficient)",
            "  |",
            "1 | a = 1",
            "  |     - the other",
            "...",
            "5 | coefficient = -1",
            "  |               ^^",
            "  = allowed: a number > 0, in kg/s",
            "  = help: use 1",
        ]
    )


def test_an_override_has_no_line_number() -> None:
    text = render_text(Diagnostic("m", "simulation.dt", None, "--set simulation.dt=0", Span(1, 21)))
    assert text.split("\n")[2:] == ["  |", "  | --set simulation.dt=0", "  |                     ^"]


def test_colours_only_when_asked() -> None:
    diagnostic = Diagnostic("m", "p", Path("f"), SOURCE, Span(1, 5), hint="h")
    assert "\x1b[" not in render_text(diagnostic)
    coloured = render_text(diagnostic, color=True)
    assert "\x1b[" in coloured
    assert coloured.count("\x1b[0m") * 2 == coloured.count("\x1b[")


def caret_text(line: str, column: int, length: int = 1) -> tuple[str, str]:
    rendered = render_text(Diagnostic("m", "p", Path("f"), line, Span(1, column, length))).split("\n")
    return rendered[3][4:], rendered[4][4:]


@pytest.mark.parametrize(
    ("line", "column", "shown", "under"),
    [
        ("\ta = -1", 6, "    a = -1", "        ^"),
        ('a = "日本" # x', 11, 'a = "日本" # x', " " * 12 + "^"),
        ("a = \x1b[31m1", 5, "a = \ufffd[31m1", "    ^"),
        ("\n", 1, "", "^"),
    ],
)
def test_columns_of_tabs_wide_and_control_characters(line: str, column: int, shown: str, under: str) -> None:
    assert caret_text(line, column) == (shown, under)


@given(st.integers(0, 3000), st.integers(0, 3000), st.integers(1, 3000))
def test_long_lines_are_cut_around_the_caret(before: int, after: int, length: int) -> None:
    line = "a" * before + "X" * length + "b" * after
    shown, under = caret_text(line, before + 1, length)
    assert len(shown) <= 100
    assert len(under) <= 100
    assert shown[under.index("^")] == "X"


def test_control_characters_of_messages_are_hidden() -> None:
    assert "\x1b" not in render_text(Diagnostic("unknown key '\x1b[2J'", "a.\x1b[2J"))


def test_long_lists_of_allowed_words_are_folded() -> None:
    text = render_text(Diagnostic("m", allowed=", ".join(f"word_{i}" for i in range(40))))
    lines = text.split("\n")
    assert len(lines) > 3
    assert all(len(line) < 115 for line in lines)
    assert all(line.index("word") == lines[1].index("word") for line in lines[2:])


def test_all() -> None:
    assert render_all([Diagnostic("a"), Diagnostic("b")]) == "error: a\n\nerror: b"
