"""Progress of long work: a live line on a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from psim.console import animated, counted, duration, plain, rate, say

if TYPE_CHECKING:
    import threading

    from particlesim.runs.runner import Progress
    from particlesim.sweep import SweepProgress

FIRST_LINE, LINE_EVERY = 10.0, 30.0
"""Seconds before the first plain line, and between them: a log of CI stays short."""
REDRAWN = 8
"""Times per second that a bar is drawn."""
WAITED = 2.0
"""Seconds after which a preparation is told."""
COMPILING = "compiling kernels, to be kept"


@contextmanager
def run_progress(name: str, *, quiet: bool) -> Iterator[Callable[[Progress], None] | None]:
    """A function that shows the progress of a run; None when nothing is to be shown."""
    if quiet:
        yield None
    elif not animated():
        with told_when_long(name):
            yield _plain_run(name)
    else:
        from particlesim.compiler import told_of_compiling
        from particlesim.process.preparing import told_of_preparing

        with _bar(name, remaining=False) as bar:
            task = bar.add_task(plain(name), total=None, note="preparing")
            speed, last = _Speed(), "preparing"

            def show(p: Progress) -> None:
                nonlocal last
                fast = speed.of(p)
                last = f"{counted(p.particles, 'particle')}  t = {p.time:.4g} s  {fast}"
                if fast:
                    last += f"  {duration(speed.left(p))} left"
                bar.update(task, total=p.steps, completed=p.step, note=last)

            def compiling(busy: bool) -> None:
                bar.update(task, note=COMPILING if busy else last)

            def preparing(what: str | None) -> None:
                nonlocal last
                last = what or "preparing"
                bar.update(task, note=last)

            with told_of_compiling(compiling), told_of_preparing(preparing):
                yield show


@contextmanager
def fit_progress(name: str, *, quiet: bool) -> Iterator[Callable[[int, float], None] | None]:
    """A function that shows how many runs a fit has made, and the sum of squares of the last; None for nothing."""
    if quiet or not animated():
        yield None
    else:
        with _bar(name) as bar:
            task = bar.add_task(plain(name), total=None, note="preparing")
            yield lambda runs, chi2: bar.update(task, note=f"{runs:,} runs  sum of squares {chi2:.4g}")


@contextmanager
def render_progress(name: str, *, quiet: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A function that shows how many pictures are done; None when nothing is to be shown."""
    if quiet:
        yield None
    elif not animated():
        due, pace = _Due(), _Pace()

        def line(done: int, total: int) -> None:
            rate = pace.of(done)
            if rate and due.now():
                left = duration((total - done) / rate)
                say(f"{plain(name)}: {done} of {total} pictures, {left} left")

        with told_when_long(name):
            yield line
    else:
        from particlesim.compiler import told_of_compiling

        with _bar(name, remaining=False) as bar:
            task = bar.add_task(plain(name), total=None, note="preparing")
            pace, last = _Pace(), "preparing"

            def show(done: int, total: int) -> None:
                nonlocal last
                last = f"picture {done} of {total}"
                if rate := pace.of(done):
                    last += f"  {rate:.1f}/s  {duration((total - done) / rate)} left"
                bar.update(task, total=total, completed=done, note=last)

            def compiling(busy: bool) -> None:
                bar.update(task, note=COMPILING if busy else last)

            with told_of_compiling(compiling):
                yield show


@contextmanager
def sweep_progress(name: str, *, quiet: bool) -> Iterator[Callable[[SweepProgress], None] | None]:
    """A function that shows how many runs of a sweep have ended; None when nothing is to be shown."""
    if quiet:
        yield None
    elif not animated():
        due, pace = _Due(), _Pace()

        def line(p: SweepProgress) -> None:
            rate = pace.of(p.ended - p.earlier)
            if rate and due.now():
                left = duration((p.total - p.ended) / rate)
                say(f"{plain(name)}: {_sweep_note(p)}, {left} left")

        yield line
    else:
        # No thread redraws it: workers can then be copies of this process.
        with _bar(name, auto_refresh=False) as bar:
            task = bar.add_task(plain(name), total=None, note="preparing")
            redraw_at = 0.0

            def show(p: SweepProgress) -> None:
                nonlocal redraw_at
                bar.update(task, total=p.total, completed=p.ended, note=_sweep_note(p))
                if time.perf_counter() > redraw_at:
                    bar.refresh()
                    redraw_at = time.perf_counter() + 1 / REDRAWN

            yield show


def _sweep_note(p: SweepProgress) -> str:
    """'120 of 1,000 runs, 3 not well, 150 runs/s'."""
    failures = f", {p.failures:,} not well" if p.failures else ""
    return f"{p.ended:,} of {p.total:,} runs{failures}, {p.rate:.3g} runs/s"


class _Due:
    """Tells when the next plain line is due."""

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self._next = FIRST_LINE

    @property
    def elapsed(self) -> float:
        """Seconds since the work began."""
        return time.perf_counter() - self._began

    def now(self) -> bool:
        if self.elapsed < self._next:
            return False
        self._next = self.elapsed + LINE_EVERY
        return True


class _Pace:
    """How fast pieces of work follow each other since the first, before which much is compiled and set up; the time of
    compiling does not count."""

    def __init__(self) -> None:
        self._first: tuple[int, float] | None = None

    def of(self, done: int) -> float:
        """Pieces per second, after so many; 0 while nothing tells."""
        from particlesim.compiler import compiling_seconds

        now = time.perf_counter() - compiling_seconds()
        if self._first is None:
            self._first = (done, now) if done else None
            return 0.0
        number, began = self._first
        return (done - number) / (now - began) if now > began else 0.0


@contextmanager
def told_when_long(name: str, *, quiet: bool = False) -> Iterator[None]:
    """A line when kernels have been compiled for a while, and when something else before the first step takes its time."""
    if quiet:
        yield
        return
    from particlesim.compiler import told_of_compiling
    from particlesim.process.preparing import told_of_preparing

    waiting = _Waiting(name)
    try:
        with told_of_compiling(waiting.compiling), told_of_preparing(waiting.preparing):
            yield
    finally:
        waiting.end()


class _Waiting:
    """Tells what is waited for once it has taken long. Kernels are compiled in the middle of preparations, whose time begins
    again after that."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._timer: threading.Timer | None = None
        self._what: str | None = None
        self._told: set[str] = set()

    def compiling(self, busy: bool) -> None:
        if busy:
            self._tell_after(FIRST_LINE, "compiling kernels, which are kept for the next run")
        else:
            self.preparing(self._what)

    def preparing(self, what: str | None) -> None:
        self._what = what
        if what is None:
            self.end()
        else:
            self._tell_after(WAITED, what)

    def end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _tell_after(self, seconds: float, what: str) -> None:
        import threading

        self.end()
        if what not in self._told:
            self._timer = threading.Timer(seconds, self._tell, (what,))
            self._timer.daemon = True
            self._timer.start()

    def _tell(self, what: str) -> None:
        self._told.add(what)
        say(f"{plain(self._name)}: {what}")


class _Speed:
    """How fast a run is since its first interval, in which much is set up; the time of compiling does not count."""

    def __init__(self) -> None:
        self._first: Progress | None = None

    def of(self, p: Progress) -> str:
        if self._first is None or p.step < self._first.step:  # an interval is done again
            self._first = p if p.step else None
            return ""
        seconds = self._stepping(p)
        return rate((p.particle_steps - self._first.particle_steps) / seconds) if seconds > 0 else ""

    def left(self, p: Progress) -> float:
        """Seconds to the end, once `of` has had something to tell."""
        assert self._first is not None
        done = p.step - self._first.step
        return self._stepping(p) * (p.steps - p.step) / done if done else 0.0

    def _stepping(self, p: Progress) -> float:
        """Seconds since the first interval, without those of compiling."""
        assert self._first is not None
        return (p.elapsed - p.compiling) - (self._first.elapsed - self._first.compiling)


def _plain_run(name: str) -> Callable[[Progress], None]:
    due, speed = _Due(), _Speed()

    def line(p: Progress) -> None:
        fast = speed.of(p)
        if fast and due.now():
            left = duration(speed.left(p))
            done = f"{100 * p.step / p.steps:.0f} %"
            say(
                f"{plain(name)}: {done}, t = {p.time:.4g} s, {counted(p.particles, 'particle')}, {fast}, {left} left"
            )

    return line


def _bar(name: str, *, auto_refresh: bool = True, remaining: bool = True) -> Any:
    """A bar that takes itself away when the work is done: a summary follows. With `remaining` it tells the time left."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        SpinnerColumn,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}", style="bold", markup=False),
        BarColumn(bar_width=None),
        TaskProgressColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        *([TimeRemainingColumn(compact=True)] if remaining else []),
        console=Console(stderr=True, highlight=False),
        transient=True,
        refresh_per_second=REDRAWN,
        auto_refresh=auto_refresh,
    )
