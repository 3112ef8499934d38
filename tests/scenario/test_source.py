"""Reading: every unusable file and every text that is no TOML ends in an error that says what to do."""

import os
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from particlesim.errors import Diagnostic, ScenarioError, UsageError
from particlesim.scenario.text.source import parse_source, read_source


def syntax_error(text: str) -> Diagnostic:
    with pytest.raises(ScenarioError) as caught:
        parse_source(text)
    (diagnostic,) = caught.value.diagnostics
    return diagnostic


def test_a_good_file(tmp_path: Path) -> None:
    path = tmp_path / "good.toml"
    path.write_bytes(b"\xef\xbb\xbfformat = 1\r\ntitle = '\xc3\xa9'\r\n")
    source = read_source(path)
    assert source.raw == {"format": 1, "title": "é"}
    assert source.file == path


@pytest.mark.parametrize(
    ("name", "data", "message", "hint"),
    [
        ("utf16.toml", "a = 1".encode("utf-16"), "UTF-16", "UTF-8"),
        ("latin.toml", b"a = 1\nb = '\xe9'", "not UTF-8 text: byte 0xe9 in line 2", "UTF-8"),
        ("run.vtkhdf", b"\x89HDF\r\n\x1a\n" + bytes(99), "HDF5", "psim inspect"),
    ],
)
def test_files_that_are_no_text(tmp_path: Path, name: str, data: bytes, message: str, hint: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UsageError, match=message) as caught:
        read_source(tmp_path / name)
    assert hint in str(caught.value.hint)
    assert caught.value.exit_code == 2


def test_100_megabytes_are_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "big.toml"
    with path.open("wb") as file:
        file.truncate(100 * 2**20)
    with pytest.raises(UsageError, match="100 MiB") as caught:
        read_source(path)
    assert "CSV or NPY" in str(caught.value.hint)


def test_a_stream_without_size_is_bounded() -> None:
    endless = subprocess.Popen(["cat", "/dev/zero"], stdout=subprocess.PIPE)
    assert endless.stdout is not None
    with endless, pytest.raises(UsageError, match="at most 8 MiB"):
        read_source(f"/dev/fd/{endless.stdout.fileno()}")


def test_a_device_is_told_as_such() -> None:
    with pytest.raises(UsageError, match="/dev/zero is a device"):
        read_source("/dev/zero")


def test_directory_and_missing_file(tmp_path: Path) -> None:
    (tmp_path / "fountain.toml").write_text("format = 1")
    with pytest.raises(UsageError, match="is a directory") as caught:
        read_source(tmp_path)
    assert "fountain.toml" in str(caught.value.hint)
    with pytest.raises(UsageError, match="does not exist") as caught:
        read_source(tmp_path / "fontain.toml")
    assert f"did you mean {tmp_path / 'fountain.toml'}?" in str(caught.value.hint)
    with pytest.raises(UsageError) as caught:
        read_source(tmp_path / "none" / "x.toml")
    assert "folder" in str(caught.value.hint)


@pytest.mark.parametrize("name", ["a\0b", "x" * 5000])
def test_impossible_names(name: str) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        read_source(name)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may read everything")
def test_unreadable_file(tmp_path: Path) -> None:
    path = tmp_path / "locked.toml"
    path.write_text("a = 1")
    path.chmod(0)
    with pytest.raises(UsageError, match="may not be read"):
        read_source(path)


@pytest.mark.parametrize(
    ("text", "message", "line", "column", "hint"),
    [
        ("a = 1\nb: 1", "not valid TOML", 2, 2, "TOML separates key and value with '=': b = ..."),
        ("b 1", "not valid TOML", 1, 3, "there must be '=' between key and value: b = ..."),
        ("a = \nb = 2", "not valid TOML", 1, 4, "a has no value"),
        ("a = hello world", "not valid TOML", 1, 5, 'text stands in quotes: "hello world"'),
        ("a = 36.6 mm", "not valid TOML", 1, 5, 'a number with a unit is text: "36.6 mm"'),
        ("a = 0,5", "not valid TOML", 1, 5, "write the decimal point as '.': 0.5"),
        ("a = [1, .5]", "not valid TOML", 1, 9, "a number starts with a digit: 0.5"),
        ("a = 5.", "not valid TOML", 1, 5, "a number ends with a digit: 5.0"),
        ("a = 007", "not valid TOML", 1, 5, "a number has no leading zeros"),
        ("a = True", "not valid TOML", 1, 5, "write true or false, in lower case"),
        ("a = None", "not valid TOML", 1, 5, "TOML has no empty value: leave the key out"),
        ("a = NaN", "not valid TOML", 1, 5, "the number must be finite"),
        ("a = “x”", "not valid TOML", 1, 5, "use straight quotes: \"text\" or 'text'"),
        ("[[f]\nx = 1", "not valid TOML", 1, 5, "an entry of a list of tables has two brackets: [[forces]]"),
        ("[f\nx = 1", "not valid TOML", 1, 3, "a table's name stands in brackets: [simulation]"),
        ('a = "x\nb = 1', "this text has no closing quote", 1, 5, None),
        ('a = """x\ny', "this text has no closing quotes", 1, 5, None),
        ("a = 1  # \0", "a control character (number 0) cannot stand here", 1, 10, "take it out"),
        ('a = "C:\\Users"', "a backslash starts an escape", 1, 8, "single quotes"),
        ("a = [1,\n2\n\n[[f]]\nb = 3", "this '[' is not closed", 1, 5, None),
        ("a = [1,,2]", "expected a value, ',' or ']' here", 1, 8, None),
        ("a = " + "9" * 5000, "this integer has too many digits", 1, 5, "1e300"),
        (
            "[[p]]\nlayout = {type=1,position=[[0,np.float64(4.35),0]]}",
            "not valid TOML",
            2,
            31,
            "no calls: write what np.float64(4.35) gives",
        ),
        (
            "a = {b=8, c=1e-5, }",
            "a table in braces has no comma after its last key",
            1,
            17,
            "leave the comma out",
        ),
        ("\0", "not valid TOML: invalid statement", 1, 1, None),
    ],
)
def test_typical_mistakes(text: str, message: str, line: int, column: int, hint: str | None) -> None:
    mistake = syntax_error(text)
    assert mistake.message == message
    assert mistake.span is not None
    assert (mistake.span.line, mistake.span.column) == (line, column)
    assert mistake.hint == hint or (hint is not None and hint in str(mistake.hint))


@pytest.mark.parametrize(
    ("text", "name", "first", "second"),
    [
        ("dt = 1\nx = 2\ndt = 3", "dt", (1, 1), (3, 1)),
        ("[s]\nx = 1\n[s]\ny = 2", "s", (1, 2), (3, 2)),
        ("[s]\nx = 1\n[[s]]\n", "s", (1, 2), (3, 3)),
        ("f = 1\n[[f]]\n", "f", (1, 1), (2, 3)),
        ("a = { x = 1, x = 2 }", "a.x", (1, 7), (1, 14)),
    ],
)
def test_duplicates_point_at_both(text: str, name: str, first: object, second: object) -> None:
    mistake = syntax_error(text)
    assert mistake.message == f"'{name}' is defined twice"
    assert mistake.span is not None
    assert (mistake.span.line, mistake.span.column) == second
    (label,) = mistake.labels
    assert (label.span.line, label.span.column) == first


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000,
        "a = " + "[" * 70 + "]" * 70,
        "a." * 500_000 + "b = 1",
        "a = True\nb = " + "[" * 9000,
    ],
    ids=["recursion", "deep", "endless key", "deep after a mistake"],
)
def test_hostile_nesting(text: str) -> None:
    assert syntax_error(text).message


@given(st.binary(max_size=80))
def test_random_bytes_never_break_reading(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "random.toml"
    path.write_bytes(data)
    try:
        read_source(path)
    except UsageError as error:
        assert str(error)  # noqa: PT017


@given(st.text(alphabet="ab=[]{},.\"'#\n 1\\-:", max_size=40))
def test_random_toml_never_breaks_parsing(text: str) -> None:
    try:
        parse_source(text)
    except ScenarioError as error:
        assert all(d.span is not None for d in error.diagnostics)  # noqa: PT017
