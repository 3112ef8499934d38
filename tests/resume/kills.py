"""Kill runs at random moments, resume them, and compare with runs that were left alone.

    python tests/resume/kills.py [--kills 50] [--seed 1] [--kinds fountain cloth memory]

After every kill (SIGKILL) the finished frames are read and compared, and at the end every byte of physics data.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from conftest import KINDS, assert_same

import particlesim as ps

PAUSE = 0.02
"""Seconds that every frame is slowed down by, so that kills fall everywhere."""


def rest(_: ps.Progress) -> None:
    time.sleep(PAUSE)


def start(kind: str, path: Path, **options: object) -> int:
    """A process that runs a scenario; its id."""
    child = os.fork()
    if child == 0:
        try:
            ps.run(ps.from_table(KINDS[kind]), path, threads=1, **options)
            os._exit(0)
        except BaseException as error:
            print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
            os._exit(1)
    return child


def prefix_of(path: Path, whole: Path) -> int:
    """How many frames the file of a killed run has; all must be those of the whole run."""
    if not path.exists():
        return 0
    with ps.open(path) as killed, ps.open(whole) as reference:
        for frame, expected in zip(killed, reference, strict=False):
            for field in killed.fields:
                assert frame[field].tobytes() == expected[field].tobytes(), (frame.index, field)
        return len(killed)


def torment(kind: str, kills: int, generator: random.Random, folder: Path) -> list[int]:
    """Kill a run so many times, then let it end; frames that were left by each kill."""
    whole, path = folder / f"{kind}.whole.vtkhdf", folder / f"{kind}.vtkhdf"
    takes = 0.0
    for _ in range(2):  # the first one may compile
        began = time.monotonic()
        assert os.waitpid(start(kind, whole, overwrite=True), 0)[1] == 0
        takes = time.monotonic() - began
    every = KINDS[kind]["simulation"]["duration"] / 13
    options = {"resume": True, "progress": rest, "checkpoint_every": every}
    left: list[int] = []
    while len(left) < kills:
        child = start(kind, path, **options)
        time.sleep(generator.uniform(0, takes + 40 * PAUSE))
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            assert status == 0
            assert_same(path, whole)
            path.unlink()
            continue
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        left.append(prefix_of(path, whole))
    assert os.waitpid(start(kind, path, **options), 0)[1] == 0
    assert_same(path, whole)
    return left


def main() -> None:
    """Parse arguments, torment, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    asked = parser.parse_args()
    generator = random.Random(asked.seed)
    with tempfile.TemporaryDirectory() as folder:
        for kind in asked.kinds:
            left = torment(kind, asked.kills, generator, Path(folder))
            print(f"{kind}: {len(left)} kills, frames left by each: {left}", flush=True)


if __name__ == "__main__":
    main()
