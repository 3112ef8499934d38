"""Whether two trajectories are the same, and where they first differ."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.scenario.digest import physics_of
from particlesim.scenario.extensions import parsed
from particlesim.trajectory.fields import FIELDS, Precision
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.reader import Trajectory

Array = npt.NDArray[Any]

SAME_TIME = 1e-9
"""Times that differ by this fraction of the duration are the same when a tolerance is given."""
_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Difference:
    """One value that differs: where, what, and by how much.

    `frame`, `step` and `time` [s] are those of the first file. `what` is a field with its component ("position.y"), a
    column of the ledger ("ledger.kinetic"), "births", "deaths", "time", "step", "frames" or "particle" (one that only one
    file has). `ulp` counts the floating-point numbers of the stored precision between `a` and `b`; `relative` is
    |a − b| / max(|a|, |b|); `scaled` divides by the largest value of the field in the frame, which is what a tolerance
    bounds. None where a number makes no sense.
    """

    what: str
    frame: int | None = None
    step: int | None = None
    time: float | None = None
    particle: int | None = None
    group: str | None = None
    a: float | int | None = None
    b: float | int | None = None
    ulp: int | None = None
    relative: float | None = None
    scaled: float | None = None
    particles: int | None = None
    """How many particles of the frame differ in this field."""

    def as_data(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)


@dataclass(frozen=True)
class Change:
    """A key of the physics of a scenario that two runs do not share; None where it is missing."""

    key: str
    a: Any
    b: Any


@dataclass(frozen=True)
class Comparison:
    """What comparing two trajectories gave: the frames compared, the first and the largest difference, and whence they come.

    `largest` has the largest `scaled` difference of the particle fields, also of those that a tolerance allows.
    """

    frames: int
    fields: tuple[str, ...]
    tolerance: float
    first: Difference | None
    largest: Difference | None
    changes: tuple[Change, ...]
    notes: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether nothing differs, or nothing by more than the tolerance."""
        return self.first is None


def compare(a: Trajectory, b: Trajectory, *, tolerance: float = 0.0, part: bool = False) -> Comparison:
    """Compare frames, particles (by id), recorded fields, ledger, births and deaths of two trajectories.

    Without a tolerance every bit counts, and frames are taken in order. With one, frames at the same times are compared, and
    a value may differ by that fraction of the largest value of its field in the frame; ledger, births and deaths, which
    follow from the particles, are then left out. Floats stored in different precisions are compared in the lower one.
    With `part`, `a` may end before `b`.
    Raises UsageError for a tolerance that is no number of 0 or more, and for files without a common frame.
    """
    if not 0 <= tolerance < float("inf"):
        raise UsageError(f"a tolerance is a number of 0 or more, not {tolerance}", "--tolerance 1e-9")
    precision: Precision = "single" if "single" in (a.precision, b.precision) else "double"
    fields = tuple(name for name in a.fields if name in b.fields and name != "id")
    pairs = _by_time(a, b) if tolerance else list(zip(range(len(a)), range(len(b)), strict=False))
    if not pairs:
        raise UsageError(
            f"{a.path} and {b.path} have no frame in common", "They must be recorded at the same times."
        )
    first: Difference | None = None
    largest: Difference | None = None
    for i, j in pairs:
        for found in _frame(a[i], b[j], fields, precision, tolerance):
            if first is None and (found.scaled is None or found.scaled > tolerance or not tolerance):
                first = found
            if found.scaled is not None and (largest is None or found.scaled > (largest.scaled or 0.0)):
                largest = found
        if first is None and not tolerance:
            first = _ledger(a, b, i)
    if first is None and not part:
        first = _ends(a, b, tolerance) or (None if tolerance else _events(a, b))
    return Comparison(
        len(pairs), fields, tolerance, first, largest, _changes(a, b), _notes(a, b, len(pairs), precision)
    )


def ulp_distance(a: float, b: float, dtype: Any) -> int | None:
    """How many numbers of a floating-point type lie from `a` to `b`; −0 and 0 are neighbours. None for NaN."""
    if a != a or b != b:
        return None
    return abs(_ordinal(a, dtype) - _ordinal(b, dtype))


def _ordinal(value: float, dtype: Any) -> int:
    """The place of a number among all of its type, in order."""
    bits = np.dtype(dtype).itemsize * 8
    pattern = int(np.array(value, dtype).view(f"i{bits // 8}"))
    return pattern if pattern >= 0 else -(pattern + (1 << (bits - 1))) - 1


def _by_time(a: Trajectory, b: Trajectory) -> list[tuple[int, int]]:
    """Frames at the same times."""
    if not len(a) or not len(b):
        return []
    near = SAME_TIME * max(abs(float(a.times[-1])), abs(float(b.times[-1])))
    right = np.searchsorted(b.times, a.times - near).clip(max=len(b) - 1)
    return [(i, int(j)) for i, j in enumerate(right) if abs(a.times[i] - b.times[j]) <= near]


def _frame(
    a: Frame, b: Frame, fields: tuple[str, ...], precision: Precision, tolerance: float
) -> Iterator[Difference]:
    """The differences of two frames, one for each field; with a tolerance the largest, else the first."""
    if not tolerance and a.time != b.time:
        yield _at(a, what="time", **_numbers(a.time, b.time, np.float64))
    rows = np.arange(len(b))
    if not np.array_equal(a.id, b.id):
        lost = np.setxor1d(a.id, b.id)
        if len(lost):
            yield _missing(a, b, int(lost[0]), len(lost))
            return
        order = np.argsort(b.id)
        rows = order[np.searchsorted(b.id, a.id, sorter=order)]
    for name in fields:
        spec = FIELDS[name]
        left, right = (np.asarray(v, spec.dtype(precision)) for v in (a[name], b[name][rows]))
        if left.tobytes() != right.tobytes():
            yield _field(a, name, left, right, tolerance)
    if not tolerance and a.step != b.step:
        yield _at(a, what="step", a=a.step, b=b.step)


def _field(frame: Frame, name: str, a: Array, b: Array, tolerance: float) -> Difference:
    """Where two columns, which are not the same, differ."""
    a, b = a.reshape(len(a), -1), b.reshape(len(b), -1)
    whole = a.dtype.kind == "i"
    x, y = a.astype(np.float64), b.astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(x - y)
        apart[(x == y) | (np.isnan(x) & np.isnan(y))] = 0.0
    apart[np.isnan(apart)] = np.inf
    finite = [float(np.abs(v[np.isfinite(v)]).max(initial=0.0)) for v in (x, y)]
    scale = max(finite)
    scaled = apart / scale if scale > 0 else np.where(apart > 0, np.inf, 0.0)
    differs = scaled > tolerance if tolerance else (a.view(f"i{a.itemsize}") != b.view(f"i{b.itemsize}"))
    place = int(scaled.argmax()) if tolerance else int(differs.argmax())
    row, axis = divmod(place, a.shape[1])
    return _at(
        frame,
        what=name if a.shape[1] == 1 else f"{name}.{_AXES[axis]}",
        particle=int(frame.id[row]),
        group=_group(frame, row),
        particles=int(differs.any(axis=1).sum()),
        **_numbers(a[row, axis].item(), b[row, axis].item(), None if whole else a.dtype),
        scaled=None if whole else float(scaled[row, axis]),
    )


def _numbers(a: float, b: float, dtype: Any) -> dict[str, Any]:
    """Two values and how far they are apart; whole numbers have no ULPs."""
    if dtype is None or isinstance(a, int):
        return {"a": a, "b": b}
    top = max(abs(a), abs(b))
    relative = abs(a - b) / top if 0 < top < float("inf") else None
    return {"a": a, "b": b, "ulp": ulp_distance(a, b, dtype), "relative": relative}


def _at(frame: Frame, **facts: Any) -> Difference:
    return Difference(**{"frame": frame.index, "step": frame.step, "time": frame.time, **facts})


def _group(frame: Frame, row: int) -> str | None:
    """The group of the particle in a row, where the file knows."""
    if "group" in frame.fields:
        return frame.groups[int(frame["group"][row])]
    return frame.groups[0] if len(frame.groups) == 1 else None


def _missing(a: Frame, b: Frame, particle: int, count: int) -> Difference:
    """A particle that only one of two frames has."""
    inside = np.flatnonzero(a.id == particle)
    owner, row = (a, int(inside[0])) if len(inside) else (b, int(np.flatnonzero(b.id == particle)[0]))
    return _at(
        a,
        what="particle",
        particle=particle,
        group=_group(owner, row),
        a=len(a),
        b=len(b),
        particles=count,
    )


def _ledger(a: Trajectory, b: Trajectory, index: int) -> Difference | None:
    """The first column of the ledger that differs in a frame."""
    for name, values in a.ledger.items():
        if name not in b.ledger:
            continue
        x, y = float(values[index]), float(b.ledger[name][index])
        if np.float64(x).tobytes() != np.float64(y).tobytes():
            return _at(a[index], what=f"ledger.{name}", **_numbers(x, y, np.float64))
    return None


def _ends(a: Trajectory, b: Trajectory, tolerance: float) -> Difference | None:
    """Whether one of them goes on where the other has ended."""
    if tolerance:
        near = SAME_TIME * max(float(a.times[-1]), float(b.times[-1]))
        for k in (0, -1):
            if abs(a.times[k] - b.times[k]) > near:
                return Difference("time", a=float(a.times[k]), b=float(b.times[k]))
    elif len(a) != len(b):
        return Difference("frames", a=len(a), b=len(b))
    return None


def _events(a: Trajectory, b: Trajectory) -> Difference | None:
    """The first birth or death that differs."""
    for kind in ("birth", "death"):
        x, y = a.events(kind), b.events(kind)
        for k, (i, j) in enumerate(zip(x["id"], y["id"], strict=False)):
            if i != j or x["time"][k] != y["time"][k] or x["cause"][k] != y["cause"][k]:
                times = _numbers(float(x["time"][k]), float(y["time"][k]), np.float64)
                return Difference(f"{kind}s", time=float(x["time"][k]), particle=int(i), **times)
        if len(x["id"]) != len(y["id"]):
            return Difference(f"{kind}s", a=len(x["id"]), b=len(y["id"]))
    return None


def _changes(a: Trajectory, b: Trajectory) -> tuple[Change, ...]:
    """Keys of the physics that the two scenarios do not share."""
    left, right = (dict(_flat(_physics(t.path, t.scenario))) for t in (a, b))
    keys = dict.fromkeys((*left, *right))
    missing = object()
    return tuple(
        Change(key, left.get(key), right.get(key))
        for key in keys
        if left.get(key, missing) != right.get(key, missing)
    )


def _physics(path: Path, text: str) -> dict[str, Any]:
    try:
        return physics_of(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} does not hold its scenario: {error}") from None


def _flat(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Leaves of a table by dotted address; entries of arrays of tables go by name, type or index."""
    if isinstance(value, dict) and (value or not key):
        for name, child in value.items():
            yield from _flat(child, f"{key}.{name}" if key else name)
    elif isinstance(value, list) and value and all(isinstance(child, dict) for child in value):
        for index, child in enumerate(value):
            yield from _flat(child, f"{key}.{child.get('name', index)}")
    else:
        yield key, value


def _notes(a: Trajectory, b: Trajectory, compared: int, precision: Precision) -> tuple[str, ...]:
    """Fields that were not compared, and other differences."""
    notes = []
    for left, right in ((a, b), (b, a)):
        if only := [name for name in left.fields if name not in right.fields]:
            notes.append(f"only {left.path} holds {', '.join(only)}")
    if a.precision != b.precision:
        notes.append(f"stored in different precision; compared in {precision} precision")
    if compared < max(len(a), len(b)):
        notes.append(f"compared {compared} frames, of {len(a)} and {len(b)}")
    for what in ("psim", "llvmlite", "numba", "numpy", "python", "platform"):
        versions = [str(t.provenance.get(what, "unknown")) for t in (a, b)]
        if versions[0] != versions[1]:
            notes.append(f"{what}: {versions[0]} and {versions[1]}")
    first, second = (parsed(str(t.provenance.get("extensions", ""))) for t in (a, b))
    notes += [
        f"{name}: {first[name]} and {second[name]}"
        for name in first
        if second.get(name, first[name]) != first[name]
    ]
    return tuple(notes)
