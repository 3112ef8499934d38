"""The compiler against plain Python: what kernels can say means the same, compiled and not."""

from __future__ import annotations

import itertools
import linecache
import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from particlesim.compiler import elementary, exact, kernel, lanes, on_stack, outlined, quickly, store
from particlesim.compiler.kernel import write
from particlesim.compiler.machine import optimised, target
from particlesim.compiler.unit import CompileError, Unit

_NUMBERS = itertools.count()


def defined(text: str, name: str, **scope: Any) -> Callable[..., Any]:
    """A function from its text, with a source that the compiler finds."""
    file = f"<generated {next(_NUMBERS)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    exec(compile(text, file, "exec"), scope)
    return scope[name]  # type: ignore[no-any-return]


class Pair(NamedTuple):
    a: Any
    b: Any


# Generated programs

NAMES = ("x", "y", "n", "k")


@st.composite
def expressions(draw: Any, depth: int = 3) -> str:
    """An expression of numbers, with all operators, calls and choices."""
    if depth == 0:
        return str(draw(st.sampled_from([*NAMES, "1", "2", "0.5", "3.0", "p.a", "p.b", "v[1]", "w[n % 3]"])))
    one = expressions(depth - 1)
    kind = draw(st.integers(0, 7))
    a, b = draw(one), draw(one)
    if kind <= 2:
        return f"({a} {draw(st.sampled_from('+-*'))} {b})"
    if kind == 3:
        return f"({a} / (1.5 + abs({b})))"
    if kind == 4:
        return f"({a} if {draw(one)} {draw(st.sampled_from(['<', '>=', '==', '!=']))} {b} else {draw(one)})"
    if kind == 5:
        return f"{draw(st.sampled_from(['min', 'max']))}({a}, {b})"
    if kind == 6:
        return f"(-{a} if {a} < {b} and not {b} > 2 or {a} == {b} else abs({b}))"
    return f"step({a}, {b})"


@st.composite
def programs(draw: Any) -> str:
    """A function with branches, loops, early returns, tuples and arrays."""
    lines = ["def program(x, y, n, p, v, w):", "    k = 0"]

    def block(indent: int, depth: int) -> None:
        pad = "    " * indent
        for _ in range(draw(st.integers(1, 3))):
            value = draw(expressions(2))
            match draw(st.integers(0, 8 if depth else 4)):
                case 0:
                    lines.append(f"{pad}x = {value}")
                case 1:
                    lines.append(f"{pad}y += {value}")
                case 2:
                    lines.append(f"{pad}w[k % 3] = {value}")
                case 3:
                    lines.append(f"{pad}x, y = y, {value}")
                case 4:
                    lines.append(f"{pad}p = Pair({value}, p.a)")
                case 5 | 6:
                    lines.append(f"{pad}if {value} > {draw(expressions(1))}:")
                    block(indent + 1, depth - 1)
                    if draw(st.booleans()):
                        lines.append(f"{pad}else:")
                        block(indent + 1, depth - 1)
                    elif draw(st.booleans()):
                        lines.append(f"{pad}    return x, y, k")
                case 7:
                    lines.append(f"{pad}for k in range(n + {draw(st.integers(0, 2))}):")
                    block(indent + 1, depth - 1)
                    lines.append(f"{pad}    if x > 1e3:")
                    lines.append(f"{pad}        {draw(st.sampled_from(['break', 'continue', 'x = 0.5']))}")
                case 8:
                    lines.append(f"{pad}for part in (x, y, p.b):")
                    lines.append(f"{pad}    y = y - part * 0.25")

    block(1, 2)
    lines.append("    return x, y, p.a + p.b + w[0] + w[1] + w[2] + k")
    return "\n".join(lines) + "\n"


def step(a: float, b: float) -> float:
    """What programs call: an early return and a loop."""
    if a > b:
        return 0.5 * a
    total = 0
    while total < 3 and b > 0:
        total += 1
        b = b - 1
    return total + b


@settings(max_examples=100, deadline=None)
@given(programs(), st.floats(-3, 3), st.floats(-3, 3), st.integers(0, 3))
def test_programs_mean_the_same_compiled_and_not(text: str, x: float, y: float, n: int) -> None:
    # Numbers that Python keeps as integers are floats where a variable also holds floats: equal, and equally rounded as
    # long as nothing is contracted.
    program = defined(text, "program", Pair=Pair, step=step)
    results = []
    compiled = kernel(program)
    for run, quick in ((exact(program), False), (compiled, False), (compiled, True)):
        v, w = np.array([0.5, -1.25, 2.0]), np.zeros(3)
        with np.errstate(all="ignore"), quickly(quick):
            try:
                results.append((*run(x, y, n, Pair(0.75, -0.5), v, w), *w))
            except OverflowError:
                return  # Python's integers and floats end differently
    plain, full, sooner = results
    if all(math.isfinite(each) and abs(each) < 1e15 for each in plain):
        assert full == plain, text
        assert sooner == plain, text


# Numbers


@pytest.mark.parametrize("a", [-7, -1, 0, 1, 7, 2**20])
@pytest.mark.parametrize("b", [-3, -1, 1, 2, 3])
def test_integers_divide_as_in_python(a: int, b: int) -> None:
    @kernel
    def divide(a: int, b: int) -> Any:
        return a // b, a % b, a // 3, a % 3, a / b, a**3, abs(a), a >> 2, a & b, a ^ b, a | b

    assert divide(a, b) == divide.python(a, b)


def test_precision_is_numpys() -> None:
    @kernel
    def mix(x: Any, n: int, out: Any) -> None:
        out[0] = x * x + x
        out[1] = x * 0.1
        out[2] = x * n
        out[3] = type(x)(0.1) * x
        out[4] = np.float32(n) / x
        out[5] = np.sqrt(x)

    x, n = np.float32(1.7), 3
    compiled, plain = np.zeros(6), np.zeros(6)
    mix(x, n, compiled)
    f = np.float32
    plain[:] = x * x + x, np.float64(x) * 0.1, np.float64(x) * 3, f(0.1) * x, f(3) / x, np.sqrt(x)
    np.testing.assert_allclose(compiled, plain, rtol=2**-23)
    assert (compiled[1:] == plain[1:]).all()


@pytest.mark.parametrize(
    "name", ["exp", "expm1", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
)
def test_elementary_functions_have_the_same_bits_compiled(name: str) -> None:
    function = getattr(elementary, name)

    @kernel
    def each(x: Any, y: Any) -> None:
        for i in range(x.size):
            y[i] = function(x[i])

    low, high = {"log": (0.0, 800.0), "asin": (-1, 1), "acos": (-1, 1)}.get(name, (-800.0, 800.0))
    x = np.concatenate(
        [np.random.default_rng(3).uniform(low, high, 3000), [0.0, -0.0, 1.0, math.inf, -math.inf, math.nan]]
    )
    y = np.empty_like(x)
    each(x, y)
    plain = np.array([function(float(t)) for t in x])
    assert y.tobytes() == plain.tobytes() or (
        (np.isnan(y) == np.isnan(plain)).all() and (y == plain)[~np.isnan(y)].all()
    )


def test_powers_have_the_same_bits_compiled() -> None:
    @kernel
    def powers(x: Any, p: Any, y: Any) -> None:
        for i in range(x.size):
            y[i] = x[i] ** p[i]

    rng = np.random.default_rng(5)
    x, p = rng.uniform(0, 50, 3000), rng.uniform(-30, 30, 3000)
    y = np.empty_like(x)
    powers(x, p, y)
    assert y.tolist() == [elementary.power(float(a), float(b)) for a, b in zip(x, p, strict=True)]


# Structure


def test_what_is_known_is_decided_while_compiling() -> None:
    @kernel
    def run(columns: Any, records: Any, out: Any) -> None:
        for k, record in enumerate(records):
            if columns is None:
                out[k] = -1.0
            elif isinstance(record, Pair):
                out[k] = record.a + len(records)
            else:
                out[k] = columns[k]

    out = np.zeros(2)
    run(None, (1.0, 2.0), out)
    assert out.tolist() == [-1, -1]
    run(np.array([5.0, 6.0]), (Pair(1.0, 2.0), 3.0), out)
    assert out.tolist() == [3, 6]


def test_numbers_are_looked_for_in_tuples() -> None:
    """What is not known yet was in no tuple."""

    @kernel
    def run(numbers: Any, last: Any, out: Any) -> None:
        for i in range(numbers.size):
            out[i] = 1.0 if numbers[i] in (1, 2, last) else 0.0
            if numbers[i] not in (0, last) and "a" in ("a", "b"):
                out[i] += 2.0

    for numbers in (np.arange(5), np.arange(5.0)):
        out = np.zeros(5)
        run(numbers, 4, out)
        assert out.tolist() == [0, 3, 3, 2, 1]


def test_functions_may_return_arrays_and_take_functions() -> None:
    def row(table: Any, k: int) -> Any:
        return table[k, 1:]

    def doubled(x: Any) -> Any:
        return 2 * x

    def apply(f: Any, x: Any) -> Any:
        return f(x)

    @kernel
    def run(table: Any) -> float:
        total = 0.0
        for k in range(table.shape[0]):
            part = row(table, k)
            for j in range(part.size):
                total += apply(doubled, part[j])
        return total

    table = np.arange(12.0).reshape(3, 4)
    assert run(table) == run.python(table) == 2 * table[:, 1:].sum()
    assert run(np.asfortranarray(table)) == run(table)


def test_slices_end_where_the_array_ends() -> None:
    @kernel
    def sizes(x: Any, a: int, b: int) -> Any:
        return x[a:b].size, x[:b].size, x[a:].size, x[:-1].size, x[1:-1].size

    x = np.zeros(5)
    for a, b in itertools.product(range(8), repeat=2):
        assert sizes(x, a, b) == sizes.python(x, a, b)


def test_parts_of_arrays_are_filled_and_copied() -> None:
    @kernel
    def fill(x: Any, y: Any) -> None:
        x[1:3] = 7
        x[:, 0] = y[0]
        x[4] = y[1, :3]

    y = np.arange(20.0).reshape(4, 5)
    a, b = np.zeros((5, 3), np.float32), np.zeros((5, 3), np.float32)
    fill(a, np.ascontiguousarray(y))
    b[1:3] = 7
    b[:, 0] = y[0]
    b[4] = y[1, :3]
    assert (a == b).all()


def test_integers_of_all_sizes_come_and_go() -> None:
    @kernel
    def shift(x: Any, y: Any) -> None:
        for i in range(x.size):
            y[i] = x[i] + 1

    for dtype in (
        np.int8,
        np.uint8,
        np.int16,
        np.uint16,
        np.int32,
        np.uint32,
        np.int64,
        np.float32,
        np.bool_,
    ):
        x = np.array([0, 1, 100], dtype)
        y = np.zeros(3, np.float64)
        shift(x, y)
        assert y.tolist() == (x.astype(float) + 1).tolist()
        back = np.zeros(3, dtype)
        shift(x, back)
        assert back.tolist() == (x.astype(float) + 1).astype(dtype).tolist()


def test_tuples_that_come_again_are_those_that_they_are_now() -> None:
    @kernel
    def total(p: Any) -> float:
        return p.a[0] + p.b

    pairs = [Pair(np.full(3, x), b) for x in (1.0, 2.0) for b in (10.0, 20.0, np.float32(0.5), 3)]
    for _ in range(2):
        assert [total(p) for p in pairs] == [p.a[0] + p.b for p in pairs]
    pairs[0].a[0] = 5.0
    assert total(pairs[0]) == 15.0
    # Whatever has the place in memory of one that is gone is another one.
    assert [total(Pair(np.full(1, x), 0.5)) for x in range(200)] == [x + 0.5 for x in range(200)]
    large = np.zeros(1 << 20)  # 8 MiB are more than a kernel keeps
    before = sys.getrefcount(large)
    assert total(Pair(large, 1.0)) == 1.0
    assert total(Pair(large[:2], 1.0)) == 1.0
    assert sys.getrefcount(large) == before


def test_a_loop_over_parts_of_a_tuple_by_number_is_unrolled() -> None:
    @kernel
    def total(parts: Any) -> float:
        found = 0.0
        for k in range(3):
            found += parts[k]
        return found

    assert total((1.0, 2.0, 4.5)) == 7.5


def test_a_variable_that_holds_floats_later_holds_floats() -> None:
    @kernel
    def mean(x: Any) -> Any:
        total, count = 0, 0
        for i in range(x.size):
            total += x[i]
            count += 1
        return total / count, count

    assert mean(np.array([1.0, 2.5])) == (1.75, 2)


def test_conditions_guard_what_they_guard() -> None:
    @kernel
    def at(x: Any, i: int) -> Any:
        inside = i >= 0 and i < x.size and x[i] > 0
        return inside, x[i] if i < x.size else -1.0, 1 if i >= x.size or x[i] < 0 else 0

    x = np.array([1.0, -2.0])
    for i in (0, 1, 2, 10**12):
        assert at(x, i) == at.python(x, i)


def test_outlined_functions_are_called() -> None:
    @outlined
    def heavy(x: Any, pair: Any, nothing: Any) -> Any:
        if x > 2.0:
            return pair.a, 1
        return x + pair.b if nothing is None else 0.0, 2

    @kernel
    def run(x: Any, pair: Any) -> Any:
        total, count = 0.0, 0
        for i in range(x.size):
            value, n = heavy(x[i], pair, None)
            total += value
            count += n
        return total, count

    x, pair = np.array([1.0, 2.0, 3.0]), Pair(10.0, 0.5)
    assert run(x, pair) == run.python(x, pair) == (14.0, 5)


def test_room_on_the_stack() -> None:
    @kernel
    def sums(x: Any) -> float:
        room = on_stack(4, 8, np.float64)
        for k in range(4):
            for i in range(8):
                room[k, i] = x[i] * k
        total = 0.0
        for i in range(8):
            total += room[3, i]
        return total

    x = np.arange(8.0)
    assert sums(x) == 3 * x.sum()


def test_lanes_are_not_written_out_before_they_are_vectorised() -> None:
    def sums(x: Any, out: Any) -> None:
        held = on_stack(1, 8, np.float64)[0]
        for i in lanes(8):
            held[i] = 0.0
        for k in range(x.size):
            for i in lanes(8):
                held[i] += x[k] * (i + 1)
        for i in lanes(8):
            out[i] = held[i]

    x, out = np.arange(5.0), np.zeros(8)
    kernel(sums)(x, out)
    assert np.array_equal(out, x.sum() * np.arange(1, 9))
    text, _, _ = write(sums, (x, out))
    marks = re.findall(r"br label %\S+, !llvm.loop (!\d+)", text)
    assert len(set(marks)) == 3
    assert all(f"{mark} = distinct !{{{mark}, !0}}" in text for mark in marks)
    assert '!0 = !{!"llvm.loop.unroll.disable"}' in text


def test_loops_over_many_arrays_are_vectorised() -> None:
    def step(rows: Any, h: Any) -> None:
        for i in range(rows[0].size):
            for row in rows:
                row[i] += h * row[i]

    text, _, _ = write(step, (tuple(np.ones(4) for _ in range(20)), 0.5))
    assert "x double>" in str(optimised(text, target()))


# Errors


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("def f(x):\n    return x.shift\n", "a number has no shift"),
        ("def f(x):\n    y = x\n    return [z for z in y]\n", "a loop goes over"),
        ("def f(x):\n    return missing + x\n", "missing is not set"),
        (
            "def f(x):\n    if x > 0:\n        y = (1.0, 2.0)\n    else:\n        y = 1.0\n    return y\n",
            "in one branch",
        ),
        (
            "def f(x):\n    try:\n        return x\n    except ValueError:\n        return 0.0\n",
            "Try is not in the language",
        ),
        ("def f(x):\n    return (1.0, 2.0)[int(x)]\n", "a part of a tuple is chosen by a number"),
        ("def f(x):\n    return print(x)\n", "'print' is not in the language"),
        ("def f(x):\n    return f(x)\n", "without end"),
        ("def f(x):\n    return x in 'abc'\n", "tuples of numbers"),
    ],
)
def test_errors_have_a_place_and_a_reason(text: str, reason: str) -> None:
    with pytest.raises(CompileError) as caught:
        kernel(defined(text, "f"))(1.0)
    told = str(caught.value)
    assert reason in told
    assert caught.value.places[0][1] >= 1
    assert "<generated" in told


def test_arguments_that_kernels_do_not_take_are_told() -> None:
    @kernel
    def f(x: Any) -> int:
        return 0

    with pytest.raises(TypeError, match="kernels take numbers"):
        f([1.0])
    with pytest.raises(TypeError, match="missing a required argument"):
        f()
    with pytest.raises(TypeError, match="complex128"):
        f(np.zeros(2, complex))


# Kept on disk

MODULE = """
from particlesim.compiler import kernel
import other

FACTOR = 3

@kernel
def times(x):
    return other.grow(x * FACTOR)
"""
PROGRAM = """
from particlesim.compiler import machine
compiled = []
real = machine.object_code
machine.object_code = lambda *given: (compiled.append(1), real(*given))[1]
import module
print(module.times(2.0), len(compiled))
"""


def run_program(folder: Path, mode: str = "") -> str:
    import os

    root = Path(__file__).parents[2]
    environment = {
        **os.environ,
        "PSIM_CACHE_DIR": str(folder / "cache"),
        "PSIM_KERNELS": mode,
        "PYTHONPATH": f"{root}{os.pathsep}{folder}",
        "PYTHONDONTWRITEBYTECODE": "1",  # Python takes a file of the same second and length for the same
    }
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
        cwd=folder,
    )
    return ended.stdout.strip()


def test_code_is_kept_until_what_went_in_changes(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text(MODULE)
    (tmp_path / "other.py").write_text("def grow(x):\n    return x + 1\n")
    (tmp_path / "unused.py").write_text("")
    assert run_program(tmp_path) == "7.0 1"
    assert run_program(tmp_path) == "7.0 0"
    (tmp_path / "other.py").write_text("def grow(x):\n    return x + 2\n")
    assert run_program(tmp_path) == "8.0 1"
    (tmp_path / "module.py").write_text(MODULE.replace("FACTOR = 3", "FACTOR = 4"))
    assert run_program(tmp_path) == "10.0 1"
    (file,) = (tmp_path / "cache" / "kernels").iterdir()
    damaged = bytearray(file.read_bytes())
    damaged[-100] ^= 1
    file.write_bytes(damaged)
    assert run_program(tmp_path) == "10.0 1"
    assert file.stat().st_mode & 0o077 == 0
    file.chmod(0o666)
    assert run_program(tmp_path) == "10.0 1"


def test_code_of_another_compiler_is_not_taken(tmp_path: Path) -> None:
    """Kept code had been told by a number that nobody changed."""
    (tmp_path / "module.py").write_text(MODULE)
    (tmp_path / "other.py").write_text("def grow(x):\n    return x + 1\n")
    assert run_program(tmp_path) == "7.0 1"
    another = tmp_path / "sitecustomize.py"
    another.write_text("from particlesim.compiler import store\nstore.compiler = str\n")
    assert run_program(tmp_path) == "7.0 1"
    another.unlink()
    assert run_program(tmp_path) == "7.0 0"


def test_quick_kernels_are_never_taken_for_others(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text(MODULE)
    (tmp_path / "other.py").write_text("def grow(x):\n    return x + 1\n")
    for mode, expected in (("", "7.0 1"), ("quick", "7.0 1"), ("quick", "7.0 0"), ("", "7.0 0")):
        assert run_program(tmp_path, mode) == expected


SHARED = """
from particlesim.compiler import kernel, shared

@shared
def grow(x, by):
    return x + by

@kernel
def once(x):
    return grow(x, 1.0)

@kernel
def twice(x):
    return grow(grow(x, 1.0), 2.0)

def times(x):
    return once(x) + twice(x)
"""


def test_shared_functions_are_compiled_once(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text(SHARED)
    assert run_program(tmp_path) == "8.0 3"
    assert run_program(tmp_path) == "8.0 0"
    (kept,) = (tmp_path / "cache" / "kernels").glob("*.shared")
    damaged = bytearray(kept.read_bytes())
    damaged[-100] ^= 1
    kept.write_bytes(damaged)
    assert run_program(tmp_path) == "8.0 2", "a kernel without its shared function is made anew"
    (tmp_path / "module.py").write_text(SHARED.replace("x + by", "x + by * by"))
    assert run_program(tmp_path) == "10.0 3"


def test_a_folder_that_others_may_write_is_not_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PSIM_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(store, "problem", None)
    store.folder.cache_clear()
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels").chmod(0o777)
    try:
        assert store.folder() is None
        assert "somebody else" in str(store.problem)
    finally:
        store.folder.cache_clear()


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("file", "{place} is not a folder"),
        ("file/in/it", "cannot be made: Not a directory"),
        ("linked", "is a link"),
    ],
)
def test_what_is_no_folder_is_told_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, said: str
) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "kernels").symlink_to(tmp_path)
    monkeypatch.setenv("PSIM_CACHE_DIR", str(tmp_path / place))
    monkeypatch.setattr(store, "problem", None)
    store.folder.cache_clear()
    try:
        assert store.folder() is None
        assert said.format(place=tmp_path / place) in str(store.problem)
        assert "Errno" not in str(store.problem)
    finally:
        store.folder.cache_clear()


def test_code_with_elementary_functions_is_kept(tmp_path: Path) -> None:
    """A process that compiles nothing has not imported them, and must not take them for changed."""
    (tmp_path / "module.py").write_text(
        "import math\nfrom particlesim.compiler import kernel\n\n@kernel\ndef times(x):\n    return math.exp(math.sin(x))\n"
    )
    first, second = (run_program(tmp_path).split() for _ in range(2))
    assert (first[1], second[1]) == ("1", "0")
    assert first[0] == second[0]


def test_a_disk_that_is_full_does_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store, "problem", None)
    monkeypatch.setattr(Path, "replace", full)
    entry = store.Entry(tmp_path / "a.kernel", "a")

    store.write(entry, b"code", "double", Unit(), [])
    assert "No space left on device" in str(store.problem)
    assert not list(tmp_path.iterdir())


# Checked indices

BOUNDS = """
import sys
import numpy as np
from particlesim.compiler import kernel, outlined

@outlined
def at(x, i):
    return x[i]

@kernel
def total(x, first, last):
    result = 0.0
    for i in range(first, last):
        result += at(x, i) + x[i:].size
    return result

@kernel
def part(x, first, row):
    return x[row, first:].size

which, first, second = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
x = np.arange(6.0)
print(total(x, first, second) if which == "total" else part(x.reshape(2, 3), first, second))
"""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("total", "0", "6"), None),
        (("total", "4", "7"), "index 6 of an axis of length 6"),
        (("total", "-1", "2"), "index -1 of an axis of length 6"),
        (("part", "1", "1"), None),
        (("part", "0", "2"), "index 2 of an axis of length 2"),
        (("part", "-1", "1"), "index -1 is negative"),
    ],
)
def test_checked_kernels_end_at_an_index_outside(
    tmp_path: Path, arguments: tuple[str, ...], said: str | None
) -> None:
    (tmp_path / "bounds.py").write_text(BOUNDS)
    ended = run_checked(tmp_path, arguments)
    if said is None:
        assert (ended.returncode, ended.stderr) == (0, "")
    else:
        line = 8 if arguments[0] == "total" else 19
        assert ended.returncode == 70
        assert f"bounds.py:{line}:" in ended.stderr
        assert said in ended.stderr
    assert not (tmp_path / "cache").exists() or not list((tmp_path / "cache").glob("*/*"))


def run_checked(folder: Path, arguments: tuple[str, ...]) -> subprocess.CompletedProcess[str]:
    import os

    root = Path(__file__).parents[2]
    return subprocess.run(
        [sys.executable, "bounds.py", *arguments],
        capture_output=True,
        text=True,
        env={
            **os.environ,
            "PSIM_KERNELS": "checked",
            "PSIM_CACHE_DIR": str(folder / "cache"),
            "PYTHONPATH": str(root),
        },
        cwd=folder,
        check=False,
    )


def test_ranges_are_tuples_of_their_numbers() -> None:
    @kernel
    def digits(x: Any) -> None:
        for k in reversed(tuple(range(4))):
            x[0] = 10 * x[0] + k
        for k, (a, b) in enumerate(zip(range(2, 4), range(5, 7), strict=True)):
            x[1] = 1000 * x[1] + 100 * k + 10 * a + b

    compiled, plain = np.zeros(2), np.zeros(2)
    digits(compiled)
    digits.python(plain)
    assert compiled.tolist() == plain.tolist() == [3210, 25136]
