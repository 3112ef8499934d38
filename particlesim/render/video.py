"""From a trajectory to a video, or to one picture."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from particlesim.compiler import compiling_seconds
from particlesim.errors import UsageError
from particlesim.process.signals import Held, held_signals
from particlesim.process.threads import Team
from particlesim.render.renderer import Picture, Renderer
from particlesim.render.scene.source import BallShape, Frame, FrameSource, MeshShape, PlaneShape
from particlesim.render.timeline import timeline
from particlesim.render.writers import Writer, open_writer
from particlesim.scenario.rendering import RenderSettings

QUEUE = 3
"""Finished pictures that may wait for the encoder."""


@dataclass(frozen=True)
class RenderReport:
    """What was made: the number of pictures, the seconds it took, the files (several only of PNG),
    warnings, and how many of the seconds went into compiling kernels, which are kept."""

    frames: int
    seconds: float
    paths: tuple[Path, ...]
    warnings: tuple[str, ...]
    compiling: float = 0.0

    @property
    def path(self) -> Path:
        """The file, of several PNG the first."""
        return self.paths[0]


def render_frame(
    source: FrameSource,
    index: int,
    settings: RenderSettings,
    *,
    planes: Sequence[PlaneShape] = (),
    balls: Sequence[BallShape] = (),
    meshes: Sequence[MeshShape] = (),
    title: str = "",
    threads: int | None = None,
) -> Picture:
    """One recorded frame as a picture, uint8 [height, width, 3] sRGB, with the camera that its video would
    have.

    A negative index counts from the end. Raises UsageError for a frame or a field that does not exist.
    """
    if not -len(source) <= index < len(source):
        raise UsageError(
            f"there is no frame {index}", f"The trajectory holds the frames 0 to {len(source) - 1}."
        )
    index %= len(source)
    with Team(threads) as team:
        renderer = Renderer(
            source,
            settings,
            planes=tuple(planes),
            balls=tuple(balls),
            meshes=tuple(meshes),
            title=title,
            team=team,
        )
        return renderer.draw(source[index])


def render_video(
    source: FrameSource,
    out: Path,
    settings: RenderSettings,
    *,
    planes: Sequence[PlaneShape] = (),
    balls: Sequence[BallShape] = (),
    meshes: Sequence[MeshShape] = (),
    title: str = "",
    frames: slice | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> RenderReport:
    """Render a trajectory, or those recorded `frames`, to `out`: .mp4, .webp or .png (numbered files).

    Frames follow each other as the settings' speed says; chosen `frames` as PNG are a picture each.

    `progress(done, total)` is called after each picture. The file appears when it is whole; after an error
    or an interrupt nothing is left. The picture does not depend on `threads`. Raises UsageError when the
    request cannot be met (nothing is written), InputOutputError when writing fails.
    """
    started, compiled = time.perf_counter(), compiling_seconds()
    chosen = range(len(source))[frames or slice(None)]
    if not chosen:
        raise UsageError(
            "no frame is chosen" if len(source) else "the trajectory holds no frame",
            f"The trajectory holds {len(source)} frames.",
        )
    chosen = chosen if chosen.step > 0 else chosen[::-1]
    pictures_of_frames = Path(out).suffix.lower() == ".png" and frames is not None
    shown = range(len(chosen)) if pictures_of_frames else timeline(source.times[list(chosen)], settings)
    with held_signals() as signals, Team(threads) as team:
        # Camera, colours and trails are those of the whole trajectory: a picture is that of its video.
        renderer = Renderer(
            source,
            settings,
            planes=tuple(planes),
            balls=tuple(balls),
            meshes=tuple(meshes),
            title=title,
            team=team,
        )
        writer = open_writer(Path(out), settings, len(shown), overwrite)
        try:
            pictures = _pictures(renderer, source, [chosen[k] for k in shown], settings, team)
            _encode(writer, pictures, len(shown), progress, signals)
            paths = writer.finish()
        except BaseException:  # also Ctrl-C: nothing half written stays
            writer.discard()
            raise
    warnings = []
    if renderer.bad_positions:
        bad = renderer.bad_positions
        number = "1 position is" if bad == 1 else f"{bad:,} positions are"
        warnings.append(f"{number} not finite and left out of the pictures")
    if not renderer.scene.count:
        warnings.append("there is no particle in the trajectory")
    compiling = compiling_seconds() - compiled
    return RenderReport(len(shown), time.perf_counter() - started, paths, tuple(warnings), compiling)


def _pictures(
    renderer: Renderer, source: FrameSource, indices: list[int], settings: RenderSettings, team: Team
) -> Iterator[Picture]:
    """The pictures in order. With several threads two frames are in work, so that one's serial part costs no
    time.

    A recorded frame that is shown several times by a still camera is drawn once.
    """
    turn = settings.camera.orbit / settings.fps
    ahead = min(team.threads, 2)
    pending: deque[Future[Picture]] = deque()
    last: tuple[int, Frame, Future[Picture]] | None = None
    with ThreadPoolExecutor(ahead, "frame") as pool:
        try:
            for k, index in enumerate(indices):
                if last is not None and last[0] == index:
                    frame = last[1]
                    future = last[2] if turn == 0 else pool.submit(renderer.draw, frame, k * turn)
                else:
                    frame = source[index]
                    future = pool.submit(renderer.draw, frame, k * turn)
                last = index, frame, future
                pending.append(future)
                if len(pending) > ahead:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()


def _encode(
    writer: Writer,
    pictures: Iterator[Picture],
    total: int,
    progress: Callable[[int, int], None] | None,
    signals: Held,
) -> None:
    """Hand the pictures to the writer from a thread of its own, so that encoding overlaps rendering."""
    waiting: queue.Queue[Picture | None] = queue.Queue(QUEUE)
    failure: list[BaseException] = []

    def feed() -> None:
        while (picture := waiting.get()) is not None:
            if not failure:
                try:
                    writer.add(picture)
                except BaseException as error:  # handed to the caller's thread below
                    failure.append(error)

    feeder = threading.Thread(target=feed, name="encode")
    feeder.start()
    try:
        for done, picture in enumerate(pictures, 1):
            waiting.put(picture)
            if failure:
                break
            signals.check()
            if progress is not None:
                progress(done, total)
    finally:
        waiting.put(None)
        feeder.join()
    if failure:
        raise failure[0]
