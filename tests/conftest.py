"""Kernels compiled by the tests are kept in a temporary directory, unless PSIM_CACHE_DIR says where; signals mean what
they mean by default, also where the tests run in the background of a shell or under nohup, which ignore some.

The directory must be known before any kernel is declared, hence before the package is imported. Hypothesis keeps no
database here: a test run leaves the working directory as it was.
"""

import atexit
import gc
import os
import shutil
import signal
import tempfile
from collections import Counter
from collections.abc import Iterator

import pytest
from hypothesis import settings

if "PSIM_CACHE_DIR" not in os.environ:
    _directory = tempfile.mkdtemp(prefix="psim-kernels-")
    os.environ["PSIM_CACHE_DIR"] = _directory
    atexit.register(shutil.rmtree, _directory, ignore_errors=True)

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

settings.register_profile("psim", database=None, deadline=None, max_examples=60, derandomize=True)
settings.load_profile("psim")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--slow", action="store_true", help="also tests marked slow: more cases of what others show"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--slow"):
        return
    cases = Counter(_name(each) for each in items)
    seen = Counter[str]()
    slow = []
    for each in items:
        name = _name(each)
        if each.get_closest_marker("slow") or _between_samples(seen[name], _sampled(each, cases[name])):
            slow.append(each)
        seen[name] += 1
    config.hook.pytest_deselected(items=slow)
    left = set(map(id, slow))
    items[:] = [each for each in items if id(each) not in left]


def _name(item: pytest.Item) -> str:
    """The name of a test without that of its case."""
    return item.nodeid.partition("[")[0]


GRIDS = ((12, 8), (8, 6), (4, 3), (3, 2))
"""Of so many cases of a test of physics, and more, one in so many runs: each compiles kernels of its own."""


def _sampled(item: pytest.Item, cases: int) -> int:
    """How many cases of a test there are for each one that runs: as many as its mark `sampled(n)` says, or `GRIDS`."""
    mark = item.get_closest_marker("sampled")
    if mark is not None:
        return int(mark.args[0])
    grids = GRIDS if item.path.parent.name == "physics" else ()
    return next((n for least, n in grids if cases >= least), 1)


def _between_samples(case: int, n: int) -> bool:
    """Whether a case is none of those that run. They are not each n-th one, which may all have the same value of the
    parameter that changes most often."""
    return (case + case // n) % n != 0


def pytest_collection_finish() -> None:
    """Thousands of tests live to the end: the collector of garbage, which syntax trees of kernels call often, need not
    go through them each time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)


@pytest.fixture(scope="session", autouse=True)
def _one_thread_unless_a_test_says_more(pytestconfig: pytest.Config) -> Iterator[None]:
    """Workers of pytest have all cores busy: threads that meet after each part of a step wait for a core, which takes twice
    the processor time of one thread, and longer. Tests of threads say how many; with --slow all cores are taken, as by
    users."""
    with pytest.MonkeyPatch.context() as patch:
        if not pytestconfig.getoption("--slow"):
            patch.setattr("particlesim.process.threads.available_cores", lambda: 1)
        yield


OPTIMISED = {"compiler", "determinism", "gallery", "render", "resume", "same", "sweep"}
"""Folders of tests that need the kernels that users run: bits, scenarios, the compiler itself."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[object]:
    """Other tests compile their kernels quickly, which takes most of their time, unless they are marked `optimised`; with
    --slow none does."""
    from particlesim.compiler import quickly

    optimised = item.path.parent.name in OPTIMISED or item.get_closest_marker("optimised")
    with quickly(not optimised and not item.config.getoption("--slow")):
        return (yield)
