"""Kill runs at random moments, resume them, and compare with runs that were left alone.

    python tests/resume/kills.py [--kills 50] [--seed 1] [--kinds fountain cloth memory] [--command] [--longer 20]

After every kill (SIGKILL) the finished frames are read and compared, and at the end every byte of physics data. A killed run
is a fork of this process, in which everything is imported and compiled; with --command it is `psim run --resume`, which
takes longer to begin, so that runs should be longer, too.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from conftest import KINDS, assert_same

import particlesim as ps
from particlesim.scenario.dump import dump

PAUSE = 0.01
"""Seconds that every frame of a fork is slowed down by, so that kills fall everywhere."""

Start = Callable[[ps.Scenario, Path], int]
"""Begins a run, or goes on with it, in a process of its own; its id."""


def scenario_of(kind: str, longer: int) -> ps.Scenario:
    """A scenario that lasts so many times as long as its kind says."""
    table = KINDS[kind]
    duration = longer * table["simulation"]["duration"]
    return ps.from_table({**table, "simulation": {**table["simulation"], "duration": duration}})


def checkpoint_every(scenario: ps.Scenario) -> float:
    """Simulated time between checkpoints [s]: thirteen in a run, none of them at a frame."""
    return scenario.simulation.duration / 13


def fork(scenario: ps.Scenario, path: Path) -> int:
    """A run in a fork of this process."""
    child = os.fork()
    if child == 0:
        sys.executable = (
            ""  # so that it looks through files itself: a process for that is slower to start than the run
        )
        try:
            ps.run(
                scenario,
                path,
                threads=1,
                resume=True,
                checkpoint_every=checkpoint_every(scenario),
                progress=lambda _: time.sleep(PAUSE),
            )
            os._exit(0)
        except BaseException as error:
            print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
            os._exit(1)
    return child


def command(scenario: ps.Scenario, path: Path) -> int:
    """A run by the command line."""
    file = path.with_suffix(".toml")
    file.write_text(dump(scenario), encoding="utf-8")
    asked = ["run", str(file), "-o", str(path), "--resume", "--quiet"]
    asked += ["--threads", "1", "--checkpoint-every", str(checkpoint_every(scenario))]
    return subprocess.Popen([sys.executable, "-m", "psim", *asked]).pid


def wait(child: int) -> int:
    """The exit status of a process that ends by itself."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def frames_left(path: Path, whole: Path) -> int:
    """How many frames the file of a killed run has; all must be those of the whole run."""
    if not path.exists():
        return 0
    with ps.open(path) as killed, ps.open(whole) as reference:
        for frame, expected in zip(killed, reference, strict=False):
            for field in killed.fields:
                assert frame[field].tobytes() == expected[field].tobytes(), (frame.index, field)
        return len(killed)


def torment(
    scenario: ps.Scenario, kills: int, generator: random.Random, folder: Path, start: Start
) -> list[int]:
    """Kill a run so many times, then let it end; frames that were left by each kill.

    A run that ended before it could be killed must be right, and is begun anew.
    """
    whole, path = folder / "whole.vtkhdf", folder / "a.vtkhdf"
    ps.run(scenario, whole, threads=1, overwrite=True)  # which also compiles, for all forks
    began = time.monotonic()
    end = wait(start(scenario, path))
    assert end in (0, 1)  # the command tells by 1 that a check has failed
    takes = time.monotonic() - began
    assert_same(path, whole)
    path.unlink()
    left: list[int] = []
    while len(left) < kills:
        child = start(scenario, path)
        time.sleep(generator.uniform(0, takes))
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            assert os.waitstatus_to_exitcode(status) == end
            assert_same(path, whole)
            path.unlink()
            continue
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        left.append(frames_left(path, whole))
    assert wait(start(scenario, path)) == end
    assert_same(path, whole)
    path.unlink()
    return left


def main() -> None:
    """Parse arguments, torment, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50, help="in all, shared out to the kinds")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--command", action="store_true", help="kill the command line")
    parser.add_argument("--longer", type=int, default=1, help="how many times as long runs are")
    asked = parser.parse_args()
    generator, start = random.Random(asked.seed), command if asked.command else fork
    all_left: list[int] = []
    with tempfile.TemporaryDirectory() as folder:
        for k, kind in enumerate(asked.kinds):
            kills = len(range(k, asked.kills, len(asked.kinds)))
            left = torment(scenario_of(kind, asked.longer), kills, generator, Path(folder), start)
            print(f"{kind}: frames left by each kill: {left}", flush=True)
            all_left += left
    print(f"{len(all_left)} kills, {len(set(all_left))} different moments")


if __name__ == "__main__":
    main()
