"""Standard input, output and error, made fit for use: they may be closed, full, or a pipe whose reader has gone.

stdout carries data: what cannot be written there is an error. stderr carries talk: when nobody can hear it, the work
goes on, and the exit code says how it ended.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any

STDIN, STDOUT, STDERR = 0, 1, 2

OUTPUT = "standard output"
"""The file name in errors about stdout."""


def prepare() -> None:
    """Open what is closed, and replace Python's streams; without effect where they have been replaced already."""
    if sys.stdout is not sys.__stdout__ or sys.stderr is not sys.__stderr__:
        return
    # A closed descriptor would be given to the next file that is opened, and talk would go into a trajectory. stdout is
    # opened for reading, so that data that nobody takes is still an error.
    for descriptor, mode in ((STDIN, os.O_RDONLY), (STDOUT, os.O_RDONLY), (STDERR, os.O_WRONLY)):
        if _closed(descriptor):
            os.dup2(os.open(os.devnull, mode), descriptor)
    sys.stdout = _text(_Data(STDOUT, "wb", closefd=False), getattr(sys.stdout, "encoding", None))
    sys.stderr = _text(_Talk(STDERR, "wb", closefd=False), getattr(sys.stderr, "encoding", None), eager=True)


def discard_output() -> None:
    """Let go of what waits for a stdout that cannot take it: Python would try again, and complain, at its end."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError:  # stdout is no file
        return


def _closed(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return True
    return False


class _Data(io.FileIO):
    """stdout: its errors say that they are about it."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise OSError(error.errno, error.strerror, OUTPUT) from None


class _Talk(io.FileIO):
    """stderr: what cannot be said is not said."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError:
            return len(data)


def _text(raw: io.FileIO, encoding: str | None, *, eager: bool = False) -> io.TextIOWrapper:
    """A text stream like Python's own, except that no character is an error.

    File names keep the bytes that are no text; an encoding without ≤ or µ shows something else.
    """
    encoding = encoding or "utf-8"
    errors = "surrogateescape" if encoding.lower().replace("-", "") == "utf8" else "replace"
    return io.TextIOWrapper(
        io.BufferedWriter(raw), encoding, errors, line_buffering=eager or raw.isatty(), write_through=eager
    )
