"""The video of a run, made by another process while the run goes on.

The process reads the trajectory as it grows: see `particlesim.render.following`. By the end of the run it has compiled its
kernels and surveyed the frames; where the view does not depend on later frames, it has drawn pictures, too.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from particlesim.errors import PsimError
from particlesim.process.beside import Beside
from particlesim.process.signals import held_signals
from particlesim.process.threads import available_cores

if TYPE_CHECKING:
    from particlesim.render.video import RenderReport

GRACE = 5.0
"""Seconds that it has to take away what it has begun."""


@dataclass(frozen=True)
class Video:
    """What is asked for: the file, overrides of the scenario, and as in `film`."""

    out: Path
    overrides: Mapping[str, Any]
    overwrite: bool
    threads: int | None


class Filming:
    """The video of a run in the making. A context manager: at the end of the block the process ends, and nothing unfinished
    is left. With a single thread there is nothing to gain, and all is made after the run.
    """

    def __init__(self, video: Video) -> None:
        self._video = video
        alone = (available_cores() if video.threads is None else video.threads) == 1
        self._beside = None if alone else Beside(_film, [video])
        self._told: list[Any] = []
        self._begun = self._gone = False

    def begin(self, path: Path) -> None:
        """The run writes this trajectory now; to be called often while it does."""
        if self._beside is not None:
            if not self._begun:
                self._begun = True
                self._send(path)
            self._listen(0.0)

    @property
    def drawn(self) -> int:
        """How many pictures are known to be drawn."""
        return next((message[0] for message in reversed(self._told) if isinstance(message, tuple)), 0)

    def finish(self, path: Path, progress: Callable[[int, int], None] | None) -> RenderReport:
        """Wait for the video of a run that has ended; `progress(done, total)` is called as by `film`. Raises as it does."""
        report = self._wait(progress) if self._begun else None
        if report is None:  # there is no such process, or it could not follow the run
            from particlesim.render.film import film

            video = self._video
            report = film(
                path,
                video.out,
                video.overrides,
                overwrite=video.overwrite,
                threads=video.threads,
                progress=progress,
            )
        return report

    def _wait(self, progress: Callable[[int, int], None] | None) -> RenderReport | None:
        """What the process reports; None if it has made none."""
        self._send(None)
        with held_signals() as signals:
            while not self._gone:
                self._listen(0.1)
                signals.check()
                for message in self._told:
                    if isinstance(message, BaseException):
                        raise message
                    if not isinstance(message, tuple):
                        report: RenderReport | None = message
                        return report
                    if progress is not None:
                        progress(*message)
                self._told.clear()
        return None

    def _send(self, message: Any) -> None:
        assert self._beside is not None
        with suppress(OSError):  # it is gone, which is noticed by who listens
            self._beside.connection.send(message)

    def _listen(self, seconds: float) -> None:
        """Take what the process says, so that it never waits for us. Of its progress the latest is enough."""
        assert self._beside is not None
        connection = self._beside.connection
        try:
            while connection.poll(seconds):
                message = connection.recv()
                if isinstance(message, tuple) and self._told and isinstance(self._told[-1], tuple):
                    self._told.pop()
                self._told.append(message)
                seconds = 0.0
        except (EOFError, OSError):
            self._gone = True

    def __enter__(self) -> Filming:
        return self

    def __exit__(self, *_: object) -> None:
        if self._beside is not None:
            self._beside.end(GRACE)


def _film(connection: Connection, video: Video) -> None:
    """The process: wait for the run to begin, make its video, tell of it."""
    from particlesim.render.film import film
    from particlesim.render.following import LostError

    def follow() -> bool:
        if not connection.poll():
            return False
        connection.recv()  # that the run has ended, or EOFError: that nobody waits for its video any more
        return True

    def progress(done: int, total: int) -> None:
        connection.send((done, total))

    answer: RenderReport | PsimError | None = None
    try:
        path = connection.recv()
        try:
            signal.signal(signal.SIGTERM, _stop)  # before and after it, there is nothing to put in order
            answer = film(
                path,
                video.out,
                video.overrides,
                overwrite=video.overwrite,
                threads=video.threads,
                progress=progress,
                follow=follow,
            )
        finally:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
    except (EOFError, ConnectionError, KeyboardInterrupt):
        return
    except PsimError as error:
        answer = None if isinstance(error, LostError) else error
    except Exception:  # a mistake of ours, which is seen again when the video is made in another way
        answer = None
    with suppress(OSError):
        connection.send(answer)


def _stop(*_: object) -> None:
    raise KeyboardInterrupt
