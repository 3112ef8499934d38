"""Who does the runs: this process, or worker processes on this machine."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol, TypeAlias, TypeVar

from particlesim.errors import InputOutputError
from particlesim.process.beside import Beside

R = TypeVar("R")
Ends: TypeAlias = Generator[tuple[int, R | None], None, None]

AHEAD = 4
"""Short runs that wait in front of a worker, so that it never waits for the next one."""
SHORT = 0.1
"""Seconds that a short run takes at most. Of longer ones a worker gets one at a time, so that all end together."""
ATTEMPTS = 2
"""How often a run may take its worker down before it is given up."""


@dataclass(frozen=True)
class Ready:
    """What a worker says first."""


class Executor(Protocol):
    """Does runs, in any order."""

    def each(self, task: Callable[[int], R], numbers: Iterable[int]) -> Ends[R]:
        """Number and result of each run as it ends; None for a run whose worker died, again and again.

        Closing the iterator stops all work.
        """
        ...


class InProcess:
    """One run after the other, in this process."""

    def each(self, task: Callable[[int], R], numbers: Iterable[int]) -> Ends[R]:
        """As `Executor.each`."""
        for number in numbers:
            yield number, task(number)


class LocalWorkers:
    """Worker processes; each starts once, keeps its kernels, and does many runs."""

    def __init__(self, workers: int) -> None:
        self._count = workers

    def each(self, task: Callable[[int], R], numbers: Iterable[int]) -> Ends[R]:
        """As `Executor.each`; `task` must survive pickling."""
        queue = _Queue(numbers)
        team: list[_Worker] = []
        short = False  # whether the last run was
        try:
            while True:
                ahead = AHEAD if short else 1
                while len(team) < self._count and queue.more():
                    team.append(_Worker(task, [worker.connection for worker in team]))
                for worker in team:
                    while len(worker.waiting) < ahead and queue.more():
                        worker.give(queue.next())
                busy = {worker.connection: worker for worker in team if worker.waiting}
                if not busy:
                    return
                for connection in wait(list(busy)):
                    worker = busy[connection]
                    message = worker.receive()
                    if isinstance(message, Ready):
                        continue
                    if message is None:
                        team.remove(worker)
                        worker.stop()
                        lost = queue.returned(worker.waiting)
                        if lost is not None:
                            yield lost, None
                        continue
                    number, result, took = message
                    short = took < SHORT
                    if isinstance(result, BaseException):
                        raise result
                    yield number, result
        finally:
            for worker in team:
                worker.stop()


class _Queue:
    """Numbers of runs to be done; those that a worker lost come first."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self._numbers = iter(numbers)
        self._returned: deque[int] = deque()
        self._attempts: dict[int, int] = {}

    def more(self) -> bool:
        """Whether there is another one."""
        if not self._returned:
            try:
                self._returned.append(next(self._numbers))
            except StopIteration:
                return False
        return True

    def next(self) -> int:
        """The next one; only after `more`."""
        return self._returned.popleft()

    def returned(self, waiting: Iterable[int]) -> int | None:
        """Take back what a dead worker had. The first was being done: after some attempts it is given up, and returned."""
        first, *rest = waiting
        self._returned.extendleft(reversed(rest))
        self._attempts[first] = self._attempts.get(first, 0) + 1
        if self._attempts[first] >= ATTEMPTS:
            return first
        self._returned.appendleft(first)
        return None


class _Worker:
    """A worker process, and the runs that it has been given, in order."""

    def __init__(self, task: Callable[[int], Any], others: Sequence[Connection]) -> None:
        self._process = Beside(_work, [task], others)
        self.connection = self._process.connection
        self.waiting: deque[int] = deque()
        self._ready = False

    def give(self, number: int) -> None:
        """One more run to do. If the worker is dead, `receive` will tell."""
        self.waiting.append(number)
        try:
            self.connection.send(number)
        except (BrokenPipeError, ConnectionError):
            return

    def receive(self) -> tuple[int, Any, float] | Ready | None:
        """Number, result and seconds of a run; Ready when it has started, None when it has died.

        Raises InputOutputError when it died before it was ready.
        """
        try:
            message = self.connection.recv()
        except (EOFError, ConnectionError):
            if not self._ready:
                raise InputOutputError(
                    "a worker process cannot start",
                    'A script that starts workers needs: if __name__ == "__main__"; or take one worker.',
                ) from None
            return None
        if isinstance(message, Ready):
            self._ready = True
            return message
        number, result, seconds = message
        self.waiting.remove(number)
        return number, result, seconds

    def stop(self) -> None:
        """End the process, whatever it does."""
        self._process.end()


def _work(connection: Connection, task: Callable[[int], Any]) -> None:
    """The work of a worker process: runs, until the pipe to it is closed."""
    try:
        connection.send(Ready())
        while True:
            number = connection.recv()
            began = time.perf_counter()
            try:
                result = task(number)
            except Exception as error:
                result = error
            connection.send((number, result, time.perf_counter() - began))
    except (EOFError, ConnectionError):
        return
