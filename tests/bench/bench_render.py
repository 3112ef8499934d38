"""Frames per second of the renderer at 1080p, encoding included.

    python tests/bench/bench_render.py [threads]
    python tests/bench/bench_render.py --video scenarios/fountain.toml

Prints, per scene, the time of the first picture (kernels from the cache) and the rate of a whole MP4; or what a scenario
and its video take, on the clock and of processors.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import particlesim as ps
from particlesim.render import PlaneShape, RenderSettings, render_frame, render_video

FLOOR = (PlaneShape((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),)


class Cloud:
    """`count` particles of a ball that swirls above the floor; positions are computed when they are asked
    for."""

    fields = ("velocity",)

    def __init__(self, count: int, frames: int) -> None:
        rng = np.random.default_rng(1)
        direction = rng.normal(size=(count, 3)).astype(np.float32)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        self.start = direction * np.cbrt(rng.uniform(0, 1, (count, 1)).astype(np.float32)) + [0, 1.05, 0]
        self.times = np.arange(frames) / 30
        self.made = [Frame(float(time), *self._at(float(time))) for time in self.times]

    def _at(self, t: float):
        angle = 0.4 * t / (0.3 + np.hypot(self.start[:, 0], self.start[:, 2]))
        c, s = np.cos(angle), np.sin(angle)
        x, y, z = self.start.T
        position = np.stack([c * x + s * z, y, c * z - s * x], axis=1).astype(np.float32)
        return position, np.cross([0, 1, 0], position).astype(np.float32)

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, index: int):
        return self.made[index]


class Frame:
    def __init__(self, time: float, position: np.ndarray, velocity: np.ndarray) -> None:
        self.time, self.position, self.velocity = time, position, velocity
        self.id = np.arange(len(position))

    def __getitem__(self, name: str) -> np.ndarray:
        return {"velocity": self.velocity}[name]


def measure(name: str, count: int, frames: int, threads: int | None, planes, **settings) -> None:
    source = Cloud(count, frames)
    chosen = RenderSettings(**settings)
    start = time.perf_counter()
    render_frame(source, 0, chosen, planes=planes, threads=threads)
    first = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as folder:
        report = render_video(source, Path(folder) / "a.mp4", chosen, planes=planes, threads=threads)
    print(f"{name:44s} first picture {first:5.2f} s   {report.frames / report.seconds:6.2f} frames/s")


def processor_time() -> tuple[float, float]:
    """Seconds that this process has computed so far, and those of its children that have ended: ffmpeg."""
    used = os.times()
    return used.user + used.system, used.children_user + used.children_system


def measure_video(scenario: Path) -> None:
    """A run and its video, as `psim run --video` makes them, both for the second time."""
    with tempfile.TemporaryDirectory() as folder:
        path, size = Path(folder) / "a.vtkhdf", {"render.size": [1280, 720]}
        for _ in range(2):
            moments = [(time.perf_counter(), *processor_time())]
            ps.run(scenario, path, overwrite=True)
            moments.append((time.perf_counter(), *processor_time()))
            report = ps.film(path, overrides=size, overwrite=True)
            moments.append((time.perf_counter(), *processor_time()))
    for name, before, after in zip(("run", f"{report.frames} pictures"), moments, moments[1:], strict=False):
        wall, own, encoding = (b - a for a, b in zip(before, after, strict=True))
        print(
            f"{name:14s} {wall:6.2f} s on the clock   {own:6.2f} s of processors, {encoding:.2f} s of the encoder's"
        )
    print(f"{1000 * own / report.frames:.1f} ms of one core for a picture")


def main() -> None:
    if sys.argv[1:2] == ["--video"]:
        measure_video(Path(sys.argv[2]))
        return
    threads = int(sys.argv[1]) if len(sys.argv) > 1 else None
    measure("10^3 spheres, ground, shadows", 1_000, 60, threads, FLOOR)
    measure("10^5 spheres, ground, shadows", 100_000, 60, threads, FLOOR)
    measure("10^5 spheres", 100_000, 60, threads, (), shadows=False)
    measure("10^6 dots", 1_000_000, 20, threads, (), look="dots")
    measure("10^6 dots, ground, shadows", 1_000_000, 20, threads, FLOOR, look="dots")


if __name__ == "__main__":
    main()
