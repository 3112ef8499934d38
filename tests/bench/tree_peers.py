"""Gravity of many bodies by other programs, timed and compared with direct sums; `bench_tree.py` runs this.

    python tests/bench/tree_peers.py pytreegrav BODIES.npz THETA
    python tests/bench/tree_peers.py fmm3d BODIES.npz EPS

BODIES.npz holds x [n, 3], mass [n], softening, and the rows whose errors are looked at. One line of JSON: wall and
processor time [s] of the second call, and the rms relative error. pytreegrav's softening is that of a spline, so it is
compared with its own direct sums.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np


def timed(work: Any) -> tuple[Any, float, float]:
    work()
    wall, cpu = time.perf_counter(), time.process_time()
    found = work()
    return found, time.perf_counter() - wall, time.process_time() - cpu


def rms(found: Any, exact: Any) -> float:
    miss = np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)
    return float(np.sqrt(np.mean(miss**2)))


def pytreegrav(x: Any, mass: Any, softening: float, rows: Any, theta: float) -> tuple[float, float, float]:
    from pytreegrav import Accel, AccelTarget

    h = np.full(len(mass), 2.8 * softening)
    found, wall, cpu = timed(lambda: Accel(x, mass, h, theta=theta, method="tree", parallel=True))
    exact = AccelTarget(x[rows], x, mass, h[rows], h, method="bruteforce", parallel=True)
    return wall, cpu, rms(found[rows], exact)


def fmm3d(x: Any, mass: Any, softening: float, rows: Any, eps: float) -> tuple[float, float, float]:
    from fmm3dpy import lfmm3d

    sources = np.ascontiguousarray(x.T)
    found, wall, cpu = timed(lambda: lfmm3d(eps=eps, sources=sources, charges=mass, pg=2).grad.T)
    exact = np.empty((len(rows), 3))
    for k, i in enumerate(rows):
        d = x - x[i]
        r2 = (d * d).sum(1)
        r2[i] = np.inf
        exact[k] = ((mass / r2**1.5)[:, None] * d).sum(0)
    scale = np.linalg.norm(exact) / np.linalg.norm(found[rows])  # potentials may be over 4 pi
    return wall, cpu, rms(found[rows] * scale, exact)


if __name__ == "__main__":
    which, path, number = sys.argv[1:]
    held = np.load(path)
    peer = {"pytreegrav": pytreegrav, "fmm3d": fmm3d}[which]
    wall, cpu, error = peer(held["x"], held["mass"], float(held["softening"]), held["rows"], float(number))
    print(json.dumps({"wall": wall, "cpu": cpu, "error": error}))
