"""Every exception that psim raises on purpose.

Each carries a *message* (what is wrong), a *hint* (what to do about it) and the exit code with which the
command line ends. `ScenarioError` holds one `Diagnostic` per mistake, so that all of them are shown at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Span:
    """A place in a text file: 1-based line and column, and how many characters the caret underlines."""

    line: int
    column: int
    length: int = 1


@dataclass(frozen=True)
class Label:
    """A second place that a diagnostic points at, with what to read there."""

    span: Span
    text: str


@dataclass(frozen=True)
class Diagnostic:
    """One mistake in a scenario.

    `path` is the dotted address of the value ("forces.air.coefficient"), `span` its place in `source`, which
    is the text of `file` or of an override (None when nothing is written there), `labels` further places that
    take part in the mistake, `allowed` what would be accepted, `hint` what to try ("did you mean 'drag'?").
    """

    message: str
    path: str = ""
    file: Path | None = None
    source: str = ""
    span: Span | None = None
    labels: tuple[Label, ...] = field(default=())
    allowed: str | None = None
    hint: str | None = None


class PsimError(Exception):
    """Base of all errors that a user can cause or meet. `exit_code` is what the command returns."""

    exit_code = 1

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return self.message if self.hint is None else f"{self.message}\n{self.hint}"

    def __reduce__(self) -> tuple[Any, ...]:
        """As it is, without `__init__`, whose arguments differ; what cannot be pickled breaks a pool of processes."""
        return Exception.__new__, (type(self), *self.args), vars(self)


class UsageError(PsimError):
    """A wrong argument, a missing or unusable input, an output that exists. Nothing was written."""

    exit_code = 2


class ResourceError(UsageError):
    """A run that this machine has no memory or no disk for, at present: another one might, and this one later."""


class OutputExistsError(UsageError):
    """An output that is there already, and would be overwritten."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path} exists", "Overwrite it with overwrite=True, or choose another name.")


class ScenarioError(UsageError):
    """A scenario that cannot be run. `diagnostics` lists every mistake with its place."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(_one_line(d) for d in self.diagnostics))


@dataclass(frozen=True)
class PostMortem:
    """How a run went wrong: the first particle, when and where, and why it may have been.

    `particle` is an id; `time` [s], `position` [m] and `velocity` [m/s] are those of the first sign; `force` is the label of
    the force that was strongest on it, and `newtons` its size; `stable_dt` is the largest stable step there [s], infinite
    without a limit, None where it is not known. `cause` is "not finite", "not solved", "not held" (rods), "path" (a motion
    without a value), "birth" (at the place of another), "energy" or "speed", and `noticed` the time at which that was seen
    [s]. `frame` and `frame_time` [s] are the last good frame, None before there is one.
    """

    cause: str
    noticed: float
    particle: int
    group: str
    time: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    force: str | None
    newtons: float
    dt: float
    stable_dt: float | None
    frame: int | None = None
    frame_time: float | None = None


class DivergenceError(PsimError):
    """The simulation produced a NaN or an infinity, or energy from nothing. What was recorded before it is kept."""

    exit_code = 3

    def __init__(self, message: str, hint: str | None = None, post_mortem: PostMortem | None = None) -> None:
        super().__init__(message, hint)
        self.post_mortem = post_mortem

    def after_frame(self, frame: int, time: float) -> None:
        """Add the last good frame, and its time [s], to what is told."""
        self.message += f"; the last good frame is number {frame}, at t = {time:.6g} s"
        self.args = (self.message,)
        if self.post_mortem is not None:
            self.post_mortem = replace(self.post_mortem, frame=frame, frame_time=time)


class InputOutputError(PsimError):
    """Reading or writing failed: disk full, file vanished, device error, a place where nothing may be written."""

    exit_code = 4


class Interrupted(PsimError):
    """The user or the system stopped the run. Every finished frame is kept."""

    exit_code = 130


def _one_line(d: Diagnostic) -> str:
    """'scenario.toml:12:3: forces.air.coefficient: must be finite (allowed: ...)' for logs and Python."""
    place = str(d.file) if d.file is not None else ""
    if d.file is not None and d.span is not None:
        place += f":{d.span.line}:{d.span.column}"
    parts = [p for p in (place, d.path) if p]
    text = ": ".join([*parts, d.message])
    if d.allowed:
        text += f" (allowed: {d.allowed})"
    if d.hint:
        text += f"; {d.hint}"
    return text
