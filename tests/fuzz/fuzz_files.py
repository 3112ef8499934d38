"""Broken input files: every one of them is read, or told as an error of its own kind, in seconds.

    python tests/fuzz/fuzz_files.py [--kind npy] [--cases 10000] [--seed 0] [--first 0]

Files of a kind (tables, arrays, meshes, measurements, sweeps, scenarios) are mutated and read in this process as psim reads
them. A case is named by its kind, the seed and its number, and is the same on every machine. It fails with any exception but
UsageError (one with a place in the scenario, if a scenario names the file), with any warning, with particles that are not
finite, and when it takes more than five seconds of processor time, or a minute on the clock. Failing
files are kept in the folder --keep.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np

import particlesim as ps
from particlesim.errors import ScenarioError, UsageError
from particlesim.scenario.digest import physics_digest
from particlesim.scenario.dump import dump

SECONDS = 5.0
"""Processor time of a case, at most."""
HANG = 12.0
"""Times as long that it may take on the clock: machines are busy."""
MEMORY = 4 << 30
"""What reading any of these small files may take, at most."""

SCENARIOS = Path(__file__).parents[2] / "scenarios"

SCENARIO = """\
simulation = {{ duration = 1, dt = 0.1 }}
[[particles]]
name = "cloud"
layout = {{ type = "{type}", path = {path} }}
"""

RUN = """\
simulation = { duration = 1, dt = 0.1 }
[[particles]]
name = "ball"
layout = { type = "points", position = [[0, 0, 0]] }
[[forces]]
type = "linear_drag"
name = "air"
coefficient = 0.3
"""


class Hang(BaseException):
    """A case that took too long; no Exception, so that no reader takes it for one of its own."""


@dataclass(frozen=True)
class Failure:
    """A case that failed, the file that did it, and how."""

    kind: str
    case: int
    content: bytes
    words: str


NUMBERS = (
    b"0 -1 1 3 255 256 65535 1e308 1e999 -0.0 nan inf -inf 2147483648 4294967295 9223372036854775808 "
    b"1_0 0x10 1j 1e5 99999999"
).split()
TOKENS = {
    "npy": (
        b"<f8|>f4|<c16|<M8[D]|O|b1|<U4|(|((((|[|True|None|'descr'|'shape'|(3,)|('x', '<f8', (2,))|"
        b"[('x','<f8')]|\x93NUMPY|L|lambda: 0"
    ).split(b"|"),
    "csv": (b',|;|\t|"|#|\n|\r|\r\n|x,y,z|mass|\xff|\x00|\xe2\x80\xa8|2020-01-01| |\x1c|\x85').split(b"|"),
    "ply": (
        b"ply\n|format ascii 1.0\n|binary_little_endian|binary_big_endian|element vertex 3\n|"
        b"element face 1\n|property|property list|property list uchar int vertex_indices\n|"
        b"property list x\n|property float s\n|property double x\n|texcoord|end_header\n|"
        b"comment TextureFile a.png\n|uchar|double|int8|\n\n|\xff|\x00"
    ).split(b"|"),
    "obj": (
        b"v |vn 0 0 1\n|vt 0 0\n|f |f 1 2 3\n|f 1/1/1 2//2 3\n|f -1 -2 -3\n|/|//|\\\n|usemtl a\n|o b\n|"
        b"g c\n|mtllib d.mtl\n|#|\n|\r|\xff|\x00|l 1 2\n|p 1\n"
    ).split(b"|"),
    "stl": (
        b"solid|endsolid|facet normal|outer loop|endloop|endfacet\n|vertex |vertex 0 0 0\n|\n|\xff|\x00|"
        b"normal|loop"
    ).split(b"|"),
    "measurements": (
        b',|;|"|\n|\r|time|id|x [mm]|[|]|sigma_x|x [km/h]|x [1/0]|x [m**999]|\xff|\x00|1 mm|\xe2\x80\xa8'
    ).split(b"|"),
    "scenario": (
        b"=|[|]|{|}|\"|'|\n|#|.|_|[[forces]]\n|[[springs]]\n|[[emitters]]\n|[[colliders]]\n|[[checks]]\n|[simulation]\n|"
        b'[render]\n|type = |name = |on = |"all"|"1 m"|"3 kg/s"|"0 K"|"x**2"|"9**9**9"|"((((("|true|1979-05-27|'
        b'{ type = "uniform", low = 0, high = 1 }|{ type = "normal", mean = 1, std = -1 }|\xff|\x00|\xe2\x80\xa8|\x1b[31m'
    ).split(b"|"),
    "sweep": (
        b"=|[|]|{|}|\"|'|\n|#|vary|set|scenario = |samples = 3\n|zip = true\n|method = 'lhs'\n|"
        b'"linspace(0, 1, 5)"|"logspace(-3, 0, 3)"|"uniform(0, 1)"|(|)|\xff|\x00|simulation.dt|'
        b"particles.ball.mass|.|forces.air.coefficient|1979-05-27"
    ).split(b"|"),
}
"""What may be in a file of each kind, beside the bytes of a good one."""


def seeds(kind: str) -> list[bytes]:
    """Good files of a kind."""
    x = np.arange(24.0).reshape(4, 6)
    if kind == "npy":
        names = ("x", "y", "z", "mass", "vx")
        records = np.rec.fromarrays(1 + x.T[:5], names=",".join(names))
        arrays = (x[:, :3], x, np.asfortranarray(x.astype(">f4")), x[:, :3].astype(np.int16), records)
        return [_npy(array, version) for array in arrays for version in ((1, 0), (2, 0))]
    if kind == "scenario":
        return [path.read_bytes() for path in sorted(SCENARIOS.glob("*.toml"))]
    if kind == "csv":
        return [
            b"x,y,z\n" + b"".join(b"%f,%f,%f\n" % tuple(row[:3]) for row in x),
            b"\xef\xbb\xbfx, y, z,mass,radius,vx\r\n# words\r\n1,2,3,4,5,6 # here\r\n\r\n1,2,3,4,0,-6e3\r\n",
        ]
    if kind == "measurements":
        return [
            b"time,x,y\n0.1,1,2\n0.2,,3\n",
            b"time [ms],id,x [mm],vy [km/h],sigma_x [mm],sigma_vy\n\n20,0,5,36,1,2\n40,1,6,,1,\n",
        ]
    if kind == "sweep":
        return [
            b'scenario = "run.toml"\n[vary]\n"simulation.dt" = [0.1, 0.05]\n'
            b'"forces.air.coefficient" = "linspace(0, 1, 3)"\n',
            b'scenario = "run.toml"\nsamples = 4\nmethod = "lhs"\nseed = 7\nset = { "simulation.duration" = 2 }\n'
            b'[vary]\n"particles.ball.mass" = "loguniform(0.1, 10)"\n',
        ]
    return _meshes(kind)


def _npy(array: np.ndarray, version: tuple[int, int]) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array(file, array, version)
    return file.getvalue()


def _meshes(kind: str) -> list[bytes]:
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 0)]
    faces = [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3], [3, 2, 4]]]
    if kind == "obj":
        corners = b"".join(b"v %g %g %g\n" % p for p in points)
        return [
            corners + b"f 1 2 3\nf 1 3 4\n",
            b"# words\nmtllib a.mtl\no a\n"
            + corners
            + b"vt 0 0\nvn 0 0 1\nusemtl b\nf 1/1/1 2/1/1 3//1\nf -1 -2 -3 \\\n -4\n",
        ]
    if kind == "stl":
        triangles = [[points[k] for k in face] for face in faces[0]]
        text = b"".join(
            b"facet normal 0 0 1\nouter loop\n"
            + b"".join(b"vertex %g %g %g\n" % p for p in t)
            + b"endloop\nendfacet\n"
            for t in triangles
        )
        packed = b"".join(struct.pack("<12fH", 0, 0, 1, *(c for p in t for c in p), 0) for t in triangles)
        return [b"solid a\n" + text + b"endsolid a\n", bytes(80) + struct.pack("<I", 2) + packed]
    made = []
    for order, name in (("", "ascii"), ("<", "binary_little_endian"), (">", "binary_big_endian")):
        for chosen in faces:
            head = f"ply\nformat {name} 1.0\ncomment words\nelement vertex 5\n"
            head += "".join(f"property float {axis}\n" for axis in "xyz")
            head += f"property uchar red\nelement face {len(chosen)}\nproperty list uchar int vertex_indices\nend_header\n"
            if order:
                body = b"".join(struct.pack(order + "fffB", *p, 7) for p in points)
                body += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in chosen)
            else:
                rows = [*((*p, 7) for p in points), *((len(f), *f) for f in chosen)]
                body = "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
            made.append(head.encode() + body)
    return made


def mutated(kind: str, random: np.random.Generator) -> bytes:
    """A good file with some mistakes; half of the arrays and PLYs have them in one part, header or numbers, and the length
    of a header is mended, so that they are not seen at once."""
    files = seeds(kind)
    data = files[random.integers(len(files))]
    words = [*TOKENS[kind], *NUMBERS]
    splits = {"npy": _split_npy, "ply": _split_ply}
    parts = splits[kind](data) if kind in splits and random.random() < 0.5 else (data,)
    chosen = int(random.integers(len(parts)))
    for _ in range(int(random.geometric(0.5))):
        part = _mistake(parts[chosen], files, words, random)
        parts = (*parts[:chosen], part, *parts[chosen + 1 :])
    if len(parts) == 1:
        return parts[0]
    return _joined_npy(parts) if kind == "npy" else b"".join(parts)


def _split_npy(data: bytes) -> tuple[bytes, ...]:
    """Header and numbers of an NPY file, without what stands before the header."""
    size = 2 * data[6]
    end = 8 + size + int.from_bytes(data[8 : 8 + size], "little")
    return data[8 + size : end], data[end:]


def _joined_npy(parts: tuple[bytes, ...]) -> bytes:
    return b"\x93NUMPY\2\0" + struct.pack("<I", len(parts[0])) + b"".join(parts)


def _split_ply(data: bytes) -> tuple[bytes, ...]:
    """The header of a PLY file between its first and its last line, and the rest."""
    at, end = data.index(b"element"), data.index(b"end_header")
    return data[:at], data[at:end], data[end:]


def _mistake(data: bytes, files: list[bytes], words: list[bytes], random: np.random.Generator) -> bytes:
    """Something that is replaced, moved, cut off, repeated or put in."""

    def word() -> bytes:
        return words[random.integers(len(words))]

    a = int(random.integers(len(data) + 1))
    b = min(len(data), a + int(random.integers(1, 40)))
    match random.integers(14):
        case 0:
            return data[:a] + random.bytes(b - a) + data[b:]
        case 1:  # one bit
            return data[:a] + bytes(c ^ 1 << random.integers(8) for c in data[a : a + 1]) + data[a + 1 :]
        case 2:
            return data[:a] + data[b:]
        case 3:
            return data[:a]
        case 4:
            return data[:b] + data[a:b] * int(random.choice([1, 2, 300])) + data[b:]
        case 5:
            return data[:a] + word() + data[a:]
        case 6 | 7 | 8:
            return _replaced(data, rb"-?\d+(\.\d+)?", NUMBERS[random.integers(len(NUMBERS))], random)
        case 9 | 10:
            return _replaced(data, rb"[A-Za-z_']+", word(), random)
        case 11 | 12:
            lines = data.splitlines(keepends=True) or [b""]
            line = lines.pop(random.integers(len(lines)))
            lines.insert(random.integers(len(lines) + 1), line)
            return b"".join(lines)
        case _:
            other = files[random.integers(len(files))]
            return data[:a] + other[random.integers(len(other)) :]


def _replaced(data: bytes, what: bytes, by: bytes, random: np.random.Generator) -> bytes:
    """One of the places that match a pattern, with something else there."""
    found = list(re.finditer(what, data))
    if not found:
        return data + by
    place = found[random.integers(len(found))]
    return data[: place.start()] + by + data[place.end() :]


def read_layout(kind: str, path: Path) -> None:
    """A scenario that names the file: its particles, and what a mesh brings."""
    scenario_file = path.with_name("scenario.toml")
    mesh = kind in ("ply", "obj", "stl")
    scenario_file.write_text(SCENARIO.format(type="mesh" if mesh else "file", path=f'"{path.name}"'))
    scenario = ps.load(scenario_file)
    try:
        layout = scenario.opened(scenario.particles[0])
    except ScenarioError as error:
        if any(diagnostic.span is None for diagnostic in error.diagnostics):
            raise AssertionError("the error of a scenario's file has no place") from error
        raise
    except UsageError as error:
        raise AssertionError("the error of a scenario's file is none of the scenario") from error
    placed = layout.place(scenario.streams(scenario.particles[0]), 0, layout.number() or 0)
    assert layout.number()
    assert np.isfinite(placed.position).all()
    assert np.isfinite(placed.velocity).all()
    if mesh:
        assert layout.edges("structural").max() < layout.number()
        layout.hinges("dihedral")


def read_sweep(path: Path) -> None:
    """A sweep, up to where its runs would begin."""
    from particlesim.sweep import Design, Sweep
    from psim.sweep import _definition

    path.with_name("run.toml").write_text(RUN)
    told, axes = _definition(path, [])
    design = Design(axes, told.zip, told.samples, told.method, told.seed)  # type: ignore[arg-type]
    overrides = told.settings()
    Sweep(
        path.parent / told.scenario,
        design,
        overrides=overrides,
        quantities=told.quantities,
        record=told.record,
    )


def read_scenario(path: Path) -> None:
    """A scenario, written down again, and by its name."""
    for named in SCENARIOS.iterdir():  # what shipped scenarios name
        if named.suffix in {".png", ".obj", ".ply"} and not path.with_name(named.name).exists():
            shutil.copy(named, path.with_name(named.name))
    scenario = ps.load(path)
    physics_digest(scenario)
    path.with_name("again.toml").write_text(dump(scenario), encoding="utf-8")
    assert ps.load(path.with_name("again.toml")) == scenario


def read_measured(path: Path) -> None:
    """Measurements."""
    from particlesim.fit import read_measurements

    found = read_measurements(path)
    assert np.isfinite(found.times).all()
    assert found.count > 0


def reader(kind: str) -> Callable[[Path], None]:
    """What reads a file of a kind."""
    others = {"sweep": read_sweep, "measurements": read_measured, "scenario": read_scenario}
    return others.get(kind, lambda path: read_layout(kind, path))


ENDINGS = {"sweep": "toml", "scenario": "toml", "measurements": "csv"}
KINDS = tuple(TOKENS)


def failures(kind: str, cases: range, seed: int, folder: Path, seconds: float = SECONDS) -> Iterator[Failure]:
    """The cases that fail, also by taking too many seconds. The good files that they are made of must be read."""
    read = reader(kind)
    path = folder / f"data.{ENDINGS.get(kind, kind)}"
    for number, content in enumerate(
        seeds(kind)
    ):  # the first of them imports what reads them, which takes its time
        path.write_bytes(content)
        os.utime(path, ns=(0, number))
        read(path)
    for case in cases:
        content = mutated(kind, np.random.default_rng([seed, zlib.crc32(kind.encode()), case]))
        path.write_bytes(content)
        os.utime(path, ns=(0, 1000 + case))  # a file that was read is known by its time
        words = _outcome(read, path, seconds)
        if words is not None:
            yield Failure(kind, case, content, words)


def _outcome(read: Callable[[Path], None], path: Path, seconds: float) -> str | None:
    """How reading a file went wrong; None if it went as it should."""
    begin = time.process_time()
    try:
        with warnings.catch_warnings(), guarded(seconds):
            warnings.simplefilter("error")
            read(path)
    except UsageError as error:
        if not error.message.strip():
            return "an error without words"
    except (Exception, Hang):
        return traceback.format_exc()
    taken = time.process_time() - begin
    return f"it took {taken:.1f} s" if taken > seconds else None


@contextmanager
def guarded(seconds: float) -> Iterator[None]:
    """Interrupt what computes too long, or hangs for much longer, between two steps of Python; nothing where there is no
    alarm, or in other threads."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        raise Hang(f"more than {seconds} s")

    clocks = (
        (signal.ITIMER_PROF, signal.SIGPROF, seconds),
        (signal.ITIMER_REAL, signal.SIGALRM, HANG * seconds),
    )
    before = [signal.signal(number, ring) for _, number, _ in clocks]
    for clock, _, limit in clocks:
        signal.setitimer(clock, limit)
    try:
        yield
    finally:
        for (clock, number, _), handler in zip(clocks, before, strict=True):
            signal.setitimer(clock, 0)
            signal.signal(number, handler)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for the files that fail")
    chosen = parser.parse_args()
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, most))
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        for kind in chosen.kind or KINDS:
            begin, here = time.monotonic(), 0
            cases = range(chosen.first, chosen.first + chosen.cases)
            for failure in failures(kind, cases, chosen.seed, Path(folder)):
                here += 1
                if chosen.keep is not None:
                    chosen.keep.mkdir(parents=True, exist_ok=True)
                    (chosen.keep / f"{kind}-{failure.case}.{ENDINGS.get(kind, kind)}").write_bytes(
                        failure.content
                    )
                print(f"{kind} {failure.case}: {failure.words}", flush=True)
            print(
                f"{kind}: {chosen.cases} cases, {here} failures, {time.monotonic() - begin:.0f} s", flush=True
            )
            bad += here
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
