"""Compiled kernels kept on disk, in a directory named by a digest of the package's own sources.

Numba's own check looks only at the file of the cached function, not at the laws it inlines; with the digest in the path
a stale kernel can never be found. A directory that cannot be written costs a recompile in every process, nothing else.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config

from particlesim.engine.linking import KernelPipeline, PartPipeline


def _without_blas() -> None:
    """Import the part of Numba that would import SciPy, without SciPy.

    It only asks whether BLAS is there for np.dot; that takes a tenth of a second in every process, and no kernel here
    uses it. The answer is whether SciPy is installed. Kernels of others that use np.dot import it when they are compiled.
    """
    from importlib.util import find_spec

    from numba.np import linalg

    asked = linalg.ensure_blas

    def installed() -> None:
        if find_spec("scipy") is None:
            raise ImportError("scipy is not installed")

    linalg.ensure_blas = installed
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        linalg.ensure_blas = asked


_without_blas()

# contract: a·b + c in one rounding; nsz: −0 may become 0; arcp: x/m, y/m, z/m share one reciprocal.
# Never nnan or ninf: a NaN must stay visible. Never reassoc: sums keep the order in which they are written.
FAST = {"contract", "nsz", "arcp"}
INLINE: dict[str, Any] = {
    "pipeline_class": PartPipeline,
    "forceinline": True,
    "fastmath": FAST,
    "error_model": "numpy",
    # Kernels only borrow arrays. Counting references to them would take most of the time of short loops, since every view
    # of a row counts, and a tenth of the time of compiling.
    "_nrt": False,
    # Nobody calls what is inlined from Python or C: a tenth of the time of compiling goes into these wrappers.
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}

_KERNEL: dict[str, Any] = {
    "pipeline_class": KernelPipeline,
    "nogil": True,
    "fastmath": FAST,
    "error_model": "numpy",
    "_nrt": False,
    "no_cfunc_wrapper": True,  # called from Python, never from C
}

F = TypeVar("F", bound=Callable[..., Any])
_njit: Any = numba.njit  # its type hints do not know all of these options

problem: str | None = None
"""Why kernels are not kept on disk, or None when they are."""


@functools.cache
def source_digest() -> str:
    """Digest of every Python file of the package: the name of the cache directory."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    digest.update(f"{numba.__version__} {sys.version}".encode())
    return digest.hexdigest()[:16]


def cache_root() -> Path:
    """Where kernels are kept: $PSIM_CACHE_DIR, else the user's cache directory."""
    if chosen := os.environ.get("PSIM_CACHE_DIR"):
        return Path(chosen)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "psim"


@functools.cache
def cache_directory() -> Path | None:
    """The directory of this version's kernels, made if need be; None (and `problem` set) when it cannot be written."""
    global problem
    try:
        path = cache_root() / source_digest()
        path.mkdir(parents=True, exist_ok=True)
        probe = path / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except (OSError, RuntimeError) as error:  # RuntimeError: no home directory
        problem = (
            f"kernels are compiled anew in every process: {error}; set PSIM_CACHE_DIR to a writable directory"
        )
        return None
    return path


def kernel(function: F) -> F:
    """Compile a function for the hot path: releases the GIL, kept on disk, arithmetic as in `FAST`.

    It cannot make arrays: whoever calls it brings room for what it has to remember.
    """
    compiled: F = keep_on_disk(_njit(**_KERNEL)(function))
    return compiled


def maker(function: F) -> F:
    """Compile a kernel that makes arrays."""
    compiled: F = keep_on_disk(_njit(**{**_KERNEL, "_nrt": True})(function))
    return compiled


def part(function: F) -> F:
    """Compile a function that kernels call by its name: it is inlined."""
    compiled: F = _njit(**INLINE)(function)
    return compiled


def keep_on_disk(dispatcher: Any) -> Any:
    """Switch on the disk cache of a compiled function."""
    directory = cache_directory()
    if directory is not None:
        # Numba reads the directory when caching is switched on. Its setting is global, so it is given back at once:
        # other users of Numba in this process keep their own.
        before = config.CACHE_DIR
        config.CACHE_DIR = str(directory)
        try:
            dispatcher.enable_caching()
        finally:
            config.CACHE_DIR = before
        cache = dispatcher._cache
        cache.save_overload = _if_it_fits(cache.save_overload)
    return dispatcher


def _if_it_fits(save: Callable[..., None]) -> Callable[..., None]:
    """`save`, on a disk that is full or with a limit on the size of files, does without; `problem` tells it."""

    def attempt(*arguments: Any) -> None:
        global problem
        try:
            save(*arguments)
        except OSError as error:
            problem = f"kernels are compiled anew in every process: {error.strerror} in {cache_root()}"

    return attempt
