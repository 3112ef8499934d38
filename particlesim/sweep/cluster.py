"""Sweeps on many machines: an executor on top of Dask distributed.

The workers must reach the sweep's folder under the same path, as on the shared file system of a cluster.
Source: https://distributed.dask.org.
"""

from __future__ import annotations

import re
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TypeVar

from particlesim.errors import InputOutputError, UsageError
from particlesim.sweep.executor import Ends
from particlesim.version import __version__

if TYPE_CHECKING:
    from distributed import Client

R = TypeVar("R")

TIMEOUT = 10.0
"""Seconds in which a scheduler has to answer, and the first worker to be there."""
PATIENCE = 600.0
"""Seconds that a queue of batch jobs may take until the first worker is there."""
CHUNK_SECONDS = 0.5
"""Runs that are shorter than this go to a worker together, so that sending them costs nothing to speak of."""
MOST_IN_CHUNK = 256
AHEAD = 3
"""Chunks for every worker that wait at the scheduler."""

_NOT_IMPORTED = re.compile(r"(ModuleNotFound|Import)Error\(")
_NEEDED = "pip install 'particlesim[cluster]'"


class DaskExecutor:
    """Runs on the workers of a Dask scheduler; a run whose worker is lost is done by another one."""

    def __init__(self, client: Client, version: str = __version__) -> None:
        self._client = client
        self._version = version
        self._check_versions()

    def _check_versions(self) -> None:
        """Raise UsageError for workers without psim, or with another version of it."""
        try:
            found = self._client.run(worker_version)
        except Exception as error:
            # The scheduler passes on what a worker could not import as text in a plain Exception.
            if not isinstance(error, ImportError) and not _NOT_IMPORTED.match(str(error)):
                raise
            raise UsageError(
                f"a worker cannot import psim: {error}", "Install the same particlesim on all of them."
            ) from None
        for worker, version in found.items():
            if version != self._version:
                raise _another(str(worker), version, self._version)

    def each(self, task: Callable[[int], R], numbers: Iterable[int]) -> Ends[R]:
        """As `Executor.each`. Raises InputOutputError when the scheduler is lost.

        A worker that is lost is held against all that it had to do. So runs whose workers were lost time and again are done
        once more at the end, one at a time, before one of them is held to be the cause.
        """
        from distributed import as_completed

        todo: deque[list[int]] = deque()
        suspects: deque[int] = deque()
        alone = False
        remaining = iter(numbers)
        flow = as_completed([], loop=self._client.loop)
        waiting: dict[Any, list[int]] = {}
        size = 1

        def send(chunk: list[int]) -> None:
            future = self._client.submit(do_chunk, task, chunk, self._version, pure=False)
            waiting[future] = chunk
            flow.add(future)

        try:
            while True:
                with _scheduler_there():
                    for _ in range(AHEAD * max(len(self._client.nthreads()), 1) - len(waiting)):
                        chunk = todo.popleft() if todo else _take(remaining, size)
                        if not chunk:
                            break
                        send(chunk)
                    if not waiting and suspects:
                        alone = True
                        send([suspects.popleft()])
                if not waiting:
                    return
                future = next(flow)
                chunk = waiting.pop(future)
                done = _result(future)
                if done is None:
                    if alone:
                        yield chunk[0], None
                    elif len(chunk) == 1:
                        suspects.append(chunk[0])
                    else:  # one of them may have taken its workers down, and nobody knows which
                        todo.extend([number] for number in chunk)
                    continue
                results, seconds = done
                size = _next_size(size, seconds / len(chunk))
                yield from zip(chunk, results, strict=True)
        finally:
            with suppress(OSError, CancelledError):
                self._client.cancel(list(waiting))


@contextmanager
def _scheduler_there() -> Iterator[None]:
    """Raise InputOutputError for errors that follow from the loss of the scheduler."""
    try:
        yield
    except (OSError, TimeoutError, CancelledError) as error:
        raise InputOutputError(
            "the scheduler is lost", "The runs that have ended are kept; the same command continues."
        ) from error


def _result(future: Any) -> tuple[list[Any], float] | None:
    """Results of a chunk and the seconds that it took; None when its workers died, one after the other."""
    from distributed.scheduler import KilledWorker

    with _scheduler_there():
        try:
            done: tuple[list[Any], float] = future.result()
        except KilledWorker:
            return None
    return done


def worker_version() -> str:
    """The version of psim where this is called."""
    return __version__


def do_chunk(task: Callable[[int], R], numbers: list[int], version: str) -> tuple[list[R], float]:
    """Some runs, one after the other, and the seconds that they took. Raises UsageError where psim is another version."""
    if version != __version__:
        raise _another("a worker that came later", __version__, version)
    began = time.perf_counter()
    return [task(number) for number in numbers], time.perf_counter() - began


def _another(worker: str, theirs: str, ours: str) -> UsageError:
    return UsageError(
        f"{worker} has psim {theirs}, and this is {ours}: results would not be those of single runs",
        "Install the same particlesim on all of them.",
    )


def _take(numbers: Iterator[int], size: int) -> list[int]:
    return [number for _, number in zip(range(size), numbers, strict=False)]


def _next_size(size: int, seconds: float) -> int:
    """How many runs of so many seconds go together; it grows at most twofold."""
    fitting = int(CHUNK_SECONDS / seconds) if seconds > 0 else MOST_IN_CHUNK
    return max(1, min(fitting, 2 * size, MOST_IN_CHUNK))


@contextmanager
def scheduler(address: str, timeout: float = TIMEOUT) -> Iterator[DaskExecutor]:
    """An executor on the scheduler at an address such as tcp://node7:8786.

    Raises UsageError when nobody answers, there is no worker, one has another version, or Dask is not installed.
    """
    client = _connected(address, timeout)
    try:
        yield _ready(client, address, timeout)
    finally:
        client.close()


@contextmanager
def slurm(jobs: int) -> Iterator[DaskExecutor]:
    """An executor on workers that Slurm starts, as dask-jobqueue's configuration says (queue, memory, time).

    Raises UsageError when the configuration does not suffice, or no job has begun for ten minutes.
    """
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise UsageError("--cluster slurm needs dask-jobqueue, which is not installed", _NEEDED) from None
    try:
        cluster = SLURMCluster()
    except (ValueError, OSError) as error:
        raise UsageError(
            f"Slurm's jobs cannot be made: {error}",
            "Say cores, memory and queue in ~/.config/dask/jobqueue.yaml.",
        ) from None
    with cluster:
        cluster.scale(jobs)
        client = _connected(cluster.scheduler_address, TIMEOUT)
        try:
            yield _ready(client, "Slurm", PATIENCE)
        finally:
            client.close()


def _connected(address: str, timeout: float) -> Client:
    try:
        from distributed import Client
    except ImportError:
        raise UsageError("clusters need Dask distributed, which is not installed", _NEEDED) from None
    try:
        _listen(address, timeout)
        return Client(address, timeout=timeout, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UsageError(
            f"no scheduler answers at {address} ({str(error).splitlines()[0]})",
            "Start one with `dask scheduler`; it prints its address, such as tcp://node7:8786.",
        ) from None


def _listen(address: str, timeout: float) -> None:
    """Raise OSError unless something at a tcp:// address speaks, as Dask's servers do first.

    Dask's client waits for ever for one that accepts connections and says nothing. ValueError for what is no address.
    """
    from distributed.comm import parse_address, parse_host_port

    scheme, place = parse_address(address)
    if scheme != "tcp":
        return
    with socket.create_connection(parse_host_port(place), timeout) as connection:
        if not connection.recv(1):
            raise OSError("it closes the connection")


def _ready(client: Client, place: str, timeout: float) -> DaskExecutor:
    try:
        client.wait_for_workers(1, timeout=timeout)
    except TimeoutError:
        raise UsageError(
            f"the scheduler at {place} has no workers after {timeout:g} s", "Start some: dask worker ADDRESS"
        ) from None
    return DaskExecutor(client)
