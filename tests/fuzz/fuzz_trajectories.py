"""Damaged and foreign trajectories, and all that psim does with them: an error that says so, or what is intact.

    python tests/fuzz/fuzz_trajectories.py --cases 10000 [--seed 0] [--first 0]

Every case is a file made from a good one by its number alone: bytes changed, zeroed, cut off or moved, datasets and
attributes of other types, shapes and contents, data in other files. All that opens trajectories is then let loose on it.
Looked for: exceptions that are not psim's own, more than five seconds of computing or a minute on the clock for anything,
the end of the process, and the content of another file in what is told or written. `--first 123 --cases 1` repeats a case.

Cases run in a process forked from this one, which has imported and compiled what they need: the system ends it after five
seconds of computing, be it in code of HDF5, and the next case begins in a new one.
"""

from __future__ import annotations

import argparse
import faulthandler
import functools
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import h5py
import numpy as np

import particlesim as ps
from particlesim.analysis import series
from particlesim.analysis.difference import compare
from particlesim.trajectory import reader
from particlesim.trajectory.describe import describe
from particlesim.trajectory.export import export
from particlesim.trajectory.recovery import recover
from particlesim.verification.rerun import recorded_scenario

SECRET = "the content of another file, 5e7bd2"
LONGEST = 5.0
"""Seconds of computing that anything may take here; the process that looks through files has a limit of its own."""
HANG = 60.0
"""Seconds on the clock after which it hangs; a busy machine takes its time."""
EXIT_CODES = (2, 3, 4)
"""Of the errors that a file may be told of with."""

SCENARIO: dict[str, Any] = {
    "title": "Fuzz",
    "simulation": {"duration": 0.2, "dt": 0.01},
    "output": {"every": 5, "fields": ["velocity", "mass"]},
    "particles": [
        {
            "name": "net",
            "layout": {"type": "points", "position": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]},
            "mass": 0.1,
        }
    ],
    "emitters": [
        {
            "name": "drops",
            "rate": 100,
            "shape": {"type": "disc", "center": [0, 2, 0], "radius": 0.2, "normal": [0, 1, 0]},
            "direction": [0, 1, 0],
            "speed": 5.0,
            "lifetime": 0.05,
            "mass": 0.01,
        }
    ],
    "springs": [
        {
            "name": "links",
            "on": "net",
            "pairs": [[0, 1], [1, 2], [2, 3]],
            "stiffness": 10.0,
            "break_strain": 0.05,
        }
    ],
    "forces": [{"type": "gravity"}],
    "checks": [{"quantity": "count", "at": "end", "min": 1}],
    "render": {"size": [32, 24]},
}


@dataclass(frozen=True)
class Ground:
    """Where a fuzz takes place: good files to start from, a file that nothing may lead to, and a place for the bad one."""

    good: tuple[Path, ...]
    secret: Path
    pipe: Path
    folder: Path


def _stop(progress: ps.Progress) -> None:
    """Ends a run half-way."""
    if progress.step >= 10:
        raise KeyboardInterrupt


def prepare(folder: Path) -> Ground:
    """Good trajectories: complete, stopped with a checkpoint, without compression."""
    secret, pipe = folder / "secret", folder / "pipe"
    secret.write_text(SECRET * 200)
    if hasattr(os, "mkfifo"):
        os.mkfifo(pipe)
    good = []
    for name, output in (("complete", {}), ("plain", {"compression": "none"}), ("stopped", {})):
        path = folder / f"{name}.vtkhdf"
        scenario = ps.from_table({**SCENARIO, "output": {**SCENARIO["output"], **output}})
        if name == "stopped":
            with suppress(ps.Interrupted):
                ps.run(scenario, path, checkpoint_every=0.05, progress=_stop)
        else:
            ps.run(scenario, path)
        good.append(path)
    ground = Ground(tuple(good), secret, pipe, folder)
    for path in good:  # compiles what will be called
        path = _copied(path, ground)
        for use in USES.values():
            use(path, ground)
    return ground


def _copied(good: Path, ground: Ground) -> Path:
    """A copy of a good file and of what is beside it, alone in a folder."""
    path = ground.folder / "case" / good.name
    shutil.rmtree(path.parent, ignore_errors=True)
    path.parent.mkdir()
    for beside in ground.folder.glob(good.name + "*"):
        shutil.copy(beside, path.parent)
    return path


# ---------------------------------------------------------------------------- bad files


def flip(data: bytearray, r: random.Random, ground: Ground) -> None:
    """Some bytes, anywhere or close together."""
    start = r.randrange(len(data))
    spread = r.choice([1, 64, len(data)])
    for _ in range(r.choice([1, 3, 30])):
        data[(start + r.randrange(spread)) % len(data)] = r.randrange(256)


def zero(data: bytearray, r: random.Random, ground: Ground) -> None:
    """A range becomes zeros, or ones."""
    start, length = r.randrange(len(data)), r.choice([1, 8, 64, 512, 4096])
    data[start : start + length] = bytes([r.choice([0, 0, 255])]) * len(data[start : start + length])


def truncate(data: bytearray, r: random.Random, ground: Ground) -> None:
    del data[r.randrange(len(data)) :]


def splice(data: bytearray, r: random.Random, ground: Ground) -> None:
    """A piece of this file or another over, or into, another place."""
    other = r.choice(ground.good).read_bytes()
    source, target, length = r.randrange(len(other)), r.randrange(len(data)), r.choice([8, 64, 512, 4096])
    piece = other[source : source + length]
    data[target : target + r.choice([0, len(piece)])] = piece


def point(data: bytearray, r: random.Random, ground: Ground) -> None:
    """An eight-byte address or length somewhere becomes another: loops, and the end of the file."""
    at = r.randrange(len(data) - 8) // 8 * 8
    value = r.choice([0, at, r.randrange(len(data)), len(data), 1 << 40, (1 << 64) - 1])
    data[at : at + 8] = value.to_bytes(8, "little")


BYTES = (flip, zero, truncate, splice, point)

VALUES: tuple[Any, ...] = (
    np.array(b"text", "S16"),
    "text",
    "",
    "\x1b[31m\x00",
    -1,
    2**62,
    np.nan,
    np.inf,
    [],
    [[]],
    ["a", "b"],
    np.arange(12.0).reshape(3, 4),
    np.zeros((4, 3), "c8"),
    np.ones(5, bool),
    np.zeros(3, [("a", "<i8"), ("b", "S3")]),
    np.bytes_(b"\xff\xfe"),
    h5py.Empty("f8"),
)
TEXTS = (
    "[]",
    "{}",
    "[1]",
    "null",
    "NaN",
    "{",
    '"x"',
    '{"a": [1]}',
    '{"checks": "[1]"}',
    '{"checks": "[{}]"}',
    '{"steps": "a", "particle_steps": 1, "born": 1, "state": 3}',
    "[" * 5000,
    "\udcff",
    "=",
    "title = 3",
    "[simulation]\ndt = 1e999",
)
NUMBERS = (-1, 0, 1, 7, 2**31, 2**40, 2**62, -(2**62), np.nan, np.inf, -np.inf, 1e300)


def _names(file: h5py.File) -> tuple[list[str], list[str]]:
    """Datasets and groups."""
    found: tuple[list[str], list[str]] = ([], [])
    file.visititems(lambda name, entry: found[isinstance(entry, h5py.Group)].append(name))
    return found


def replace(file: h5py.File, r: random.Random, ground: Ground) -> None:
    """A dataset of another type or shape, a group in its place, or nothing."""
    name = r.choice(_names(file)[0])
    old = file[name]
    shape, dtype, values = old.shape, old.dtype, old[()]
    how = r.choice(["value", "text", "missing", "group", "shape", "type", "long", "short", "chunks"])
    del file[name]
    if how == "value":
        file[name] = r.choice(VALUES)
    elif how == "text":
        file[name] = r.choice(TEXTS).encode("utf-8", "surrogateescape")
    elif how == "group":
        file.create_group(name)
    elif how == "shape":
        file.create_dataset(name, (*shape, 2), dtype)
    elif how == "type" and dtype.names is None and dtype.kind in "iuf":
        file[name] = values.astype(r.choice(["f8", "f4", "i8", "i4", "u1", ">f8", "f2"]))
    elif how == "long" and shape:
        length = r.choice([10**4, 10**6, 10**9, 10**12])
        file.create_dataset(
            name, (length, *shape[1:]), dtype, chunks=(256, *shape[1:]), maxshape=(None, *shape[1:])
        )
    elif how == "short" and shape:
        file.create_dataset(name, data=values[: len(values) // 2], chunks=True, maxshape=(None, *shape[1:]))
    elif how == "chunks" and shape:
        file.create_dataset(name, shape, dtype, chunks=(1 << 24, *shape[1:]), maxshape=(None, *shape[1:]))


def renumber(file: h5py.File, r: random.Random, ground: Ground) -> None:
    """Numbers of a dataset become others."""
    name = r.choice([n for n in _names(file)[0] if file[n].size and file[n].dtype.kind in "iufV"])
    values = file[name][()]
    part = values
    if values.dtype.names:
        part = values[r.choice(values.dtype.names)]
    if not values.shape:
        return
    with np.errstate(all="ignore"):
        number = r.choice(NUMBERS)
        if part.dtype.kind in "iu":
            number = int(np.nan_to_num(number, posinf=2**62, neginf=-(2**62))) % 2 ** (8 * part.itemsize - 1)
        part[r.randrange(len(part)) if r.random() < 0.7 else slice(None)] = number
    file[name][...] = values


def attribute(file: h5py.File, r: random.Random, ground: Ground) -> None:
    """An attribute of another type or content, or none."""
    datasets, groups = _names(file)
    owner = file[r.choice([n for n in datasets + groups if len(file[n].attrs)])]
    key = r.choice(list(owner.attrs))
    del owner.attrs[key]
    if r.random() < 0.9:
        owner.attrs[key] = r.choice([*VALUES[:-1], *[t.encode("utf-8", "surrogateescape") for t in TEXTS]])


def summary(file: h5py.File, r: random.Random, ground: Ground) -> None:
    """Another summary, scenario or status."""
    text = r.choice(TEXTS).encode("utf-8", "surrogateescape")
    where = r.choice(["psim/summary", "psim/provenance/scenario", "psim/status"])
    if where == "psim/summary":
        file[where].resize(len(text), axis=0)
        file[where][...] = np.frombuffer(text, np.uint8)
    elif where == "psim/status":
        file[where][()] = np.array(
            r.choice([b"complete", b"running", b"diverged", b"interrupted", b"odd"]), "S16"
        )
    else:
        del file[where]
        file[where] = text


def swap(file: h5py.File, r: random.Random, ground: Ground) -> None:
    """Two objects change places, or one is in two places."""
    datasets, groups = _names(file)
    a, b = r.choice(datasets + groups), r.choice(datasets + groups)
    if a == b or a.startswith(b + "/") or b.startswith(a + "/"):
        return
    first, second = file[a], file[b]
    del file[b]
    if r.random() < 0.5:
        del file[a]
        file[a] = second
    file[b] = first


def link(file: h5py.File, r: random.Random, ground: Ground) -> None:
    """Loops of links and of groups, and names that no file of psim has."""
    datasets, groups = _names(file)
    name = r.choice(datasets + groups)
    how = r.choice(["soft", "loop", "cycle", "dangling", "odd"])
    if how == "odd":
        file[f"psim/topology/{r.choice(['a b', 'ä', chr(27) + '[31m', 'x' * 300])}"] = r.choice(VALUES[:-1])
        return
    old = file[name]
    del file[name]
    if how == "soft":
        file["kept"] = old
        file[name] = h5py.SoftLink("/kept")
    elif how == "cycle":
        file[name] = file["/"]
    else:
        file[name] = h5py.SoftLink(f"/{name}" if how == "loop" else "/nowhere")


def elsewhere(file: h5py.File, r: random.Random, ground: Ground) -> None:
    """Data in another file: a secret one, or a pipe."""
    name = r.choice(_names(file)[0])
    shape, dtype = file[name].shape, file[name].dtype
    place = str(r.choice([ground.secret, ground.pipe]))
    how = r.choice(["storage", "link", "virtual"])
    if how == "storage" and dtype.hasobject:
        how = "link"
    del file[name]
    if how == "link":
        file[name] = h5py.ExternalLink(place, "/x")
    elif how == "storage":
        file.create_dataset(name, shape or (4,), dtype, external=[(place, 0, h5py.h5f.UNLIMITED)])
    else:
        layout = h5py.VirtualLayout(shape or (4,), dtype)
        layout[...] = h5py.VirtualSource(place, "x", shape or (4,))
        file.create_virtual_dataset(name, layout)


STRUCTURE = (replace, replace, renumber, renumber, attribute, summary, swap, link, elsewhere)


def spoil(number: int, seed: int, ground: Ground) -> tuple[Path, str]:
    """The bad file of a case, and what was done to it."""
    r = random.Random(f"{seed}/{number}")
    good = r.choice(ground.good)
    path = _copied(good, ground)
    done = []
    if number % 2:
        with h5py.File(path, "r+", libver=("v110", "v110")) as file:
            for _ in range(r.choice([1, 1, 2])):
                change = r.choice(STRUCTURE)
                done.append(change.__name__)
                try:
                    change(file, r, ground)
                except (KeyError, ValueError, TypeError, OSError, RuntimeError, IndexError, OverflowError):
                    done[-1] += " (in part)"  # what an earlier change has left does not allow it
    else:
        data = bytearray(path.read_bytes())
        for _ in range(r.choice([1, 1, 2])):
            change_bytes = r.choice(BYTES)
            if len(data) > 64:
                change_bytes(data, r, ground)
                done.append(change_bytes.__name__)
        path.write_bytes(data)
    return path, f"{good.stem}: {', '.join(done)}"


# ---------------------------------------------------------------------------- what psim does with a file


def _read(path: Path, ground: Ground) -> Any:
    with reader.open(path) as trajectory:
        for frame in trajectory:
            for field in trajectory.fields:
                frame[field]
        told = [trajectory.events(kind) for kind in ("birth", "death")]
        known = {name: each.holds(0.1).sum() for name, each in trajectory.topology.items()}
        trajectory.frame_at(0.1)
        return told, known, trajectory.track(0), trajectory.provenance


def _series(path: Path, ground: Ground) -> Any:
    with reader.open(path) as trajectory:
        for quantity in ("x", "vy", "speed"):
            series.of_particles(trajectory, quantity)
        return (
            series.energies(trajectory),
            series.vector(trajectory, "momentum"),
            series.relative_energy_drift(trajectory),
        )


def _export(ending: str) -> Callable[[Path, Ground], Any]:
    def use(path: Path, ground: Ground) -> Any:
        out = path.with_name(f"out{ending}")
        try:
            export(path, out, overwrite=True)
        finally:
            content = out.read_bytes() if out.exists() else b""
        return content

    return use


def _compare(path: Path, ground: Ground) -> Any:
    with reader.open(path) as one, reader.open(ground.good[0]) as other:
        return [
            compare(*pair, tolerance=tolerance)
            for tolerance in (0.0, 1e-6)
            for pair in ((one, other), (other, one))
        ]


def _film(path: Path, ground: Ground) -> Any:
    out = path.with_name("out.png")
    try:
        ps.film(path, out, frames=slice(-1, None), overwrite=True)
    finally:
        out.unlink(missing_ok=True)


def _layout(path: Path, ground: Ground) -> Any:
    table = {
        "simulation": {"duration": 0.01, "dt": 0.01},
        "particles": [{"name": "a", "layout": {"type": "file", "path": str(path)}, "mass": 1.0}],
    }
    return ps.run(ps.from_table(table)).final.position


def _reference(path: Path, ground: Ground) -> Any:
    check = {"quantity": "position", "reference": str(path), "tolerance": 1.0}
    return ps.run(ps.from_table({**SCENARIO, "checks": [check]})).checks


@functools.cache
def _scenario(good: Path) -> ps.Scenario:
    """The scenario of a good file."""
    with reader.open(good) as trajectory:
        return recorded_scenario(trajectory)


def _resume(path: Path, ground: Ground) -> Any:
    return ps.run(_scenario(ground.folder / path.name), path, resume=True).final.position


def _repair(path: Path, ground: Ground) -> Any:
    recover(path)
    return describe(path)


def _again(path: Path, ground: Ground) -> Any:
    with reader.open(path) as trajectory:
        return recorded_scenario(trajectory)


USES: dict[str, Callable[[Path, Ground], Any]] = {
    "inspect": lambda path, ground: json.dumps(describe(path)),
    "read": _read,
    "plot": _series,
    "export csv": _export(".csv"),
    "export npz": _export(".npz"),
    "diff": _compare,
    "render": _film,
    "layout": _layout,
    "reference": _reference,
    "rerun": _again,
    "resume": _resume,
    "repair": _repair,
}
"""In this order: the last ones change the file."""


def check(number: int, seed: int, ground: Ground, outcomes: Counter[str]) -> str | None:
    """What is wrong with how psim takes the file of a case; `outcomes` counts what came of it."""
    path, done = spoil(number, seed, ground)
    for name, use in USES.items():
        problem = _problem(use, path, ground, outcomes)
        if problem is not None:
            return f"{done}; {name}: {problem}"
    return None


def _problem(
    use: Callable[[Path, Ground], Any], path: Path, ground: Ground, outcomes: Counter[str]
) -> str | None:
    """What is wrong with one use of a file. Does not come back from what takes too long."""
    faulthandler.dump_traceback_later(HANG, exit=True)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)  # what it takes on the processor, this process alone
    try:
        told = str(use(path, ground))
        outcomes["fine"] += 1
    except ps.PsimError as error:
        told = str(error)
        outcomes[str(error.exit_code)] += 1
        if error.exit_code not in EXIT_CODES:
            return f"exit code {error.exit_code}: {error}"
    except Exception:
        return traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.cancel_dump_traceback_later()
    return "told of another file" if SECRET[:16] in told else None


# ---------------------------------------------------------------------------- many of them


def run_cases(numbers: range, seed: int, ground: Ground, outcomes: Counter[str]) -> Iterator[str]:
    """The problems of cases, which run in processes of their own, as many in one as it lives for."""
    rest = list(numbers)
    while rest:
        receiver, sender = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(receiver)
            _work(rest, seed, ground, sender)
        os.close(sender)
        with os.fdopen(receiver) as told:
            for line in told:
                number, problem, counted = json.loads(line)
                outcomes.update(counted)
                rest = rest[rest.index(number) + 1 :]
                print(f"\r{number}", end="", file=sys.stderr)
                if problem is not None:
                    yield f"case {number} (seed {seed}), {problem}"
        _, ended = os.waitpid(child, 0)
        if rest:
            code = os.waitstatus_to_exitcode(ended)
            why = {-signal.SIGPROF: f"over {LONGEST:g} s of computing", 1: f"over {HANG:g} s on the clock"}
            yield f"case {rest[0]} (seed {seed}): {why.get(code, f'the process ended with {code}')}"
            rest = rest[1:]


def _work(numbers: list[int], seed: int, ground: Ground, sender: int) -> NoReturn:
    """Check case after case in a process of its own, and tell the other of each."""
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    faulthandler.register(signal.SIGPROF, chain=True)  # says where, and then the process ends
    try:
        with os.fdopen(sender, "w") as told:
            for number in numbers:
                outcomes: Counter[str] = Counter()
                problem = check(number, seed, ground, outcomes)
                print(json.dumps([number, problem, outcomes]), file=told, flush=True)
    except BaseException:
        traceback.print_exc()
        os._exit(70)
    os._exit(0)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    outcomes: Counter[str] = Counter()
    failed = 0
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        ground = prepare(Path(folder))
        numbers = range(arguments.first, arguments.first + arguments.cases)
        for problem in run_cases(numbers, arguments.seed, ground, outcomes):
            failed += 1
            print(f"\n{problem}", flush=True)
    print(f"\n{arguments.cases} files, {failed} failures; outcomes by exit code: {dict(outcomes)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
