"""Machine code kept on disk: one file for each kernel and structure of its arguments.

The name of a file is a digest of the kernel's name, its arguments, this compiler, LLVM, and the processor. The file also has
the digests of the modules of all compiled functions, and the constants that were read from modules. All are compared
before the code is used, so an edit recompiles only the kernels that depend on it. Shared functions, which many kernels call,
have files of their own, named by a digest of their LLVM code.

Machine code is run without further checks: so the folder and its files are used only if they belong to the user and nobody
else may write there. Nothing is unpickled.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import json
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from particlesim.compiler.values import KnownForm, TupleForm

problem: str | None = None
"""Why kernels are not kept on disk, or None when they are."""


@dataclass(frozen=True)
class Entry:
    """Where the code of a kernel is kept, and what its file must say of itself."""

    path: Path
    name: str


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
def folder() -> Path | None:
    """The folder of kernels, made if need be; None, with `problem` set, when it is not the user's own to write."""
    try:
        path = cache_root() / "kernels"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(mode=0o700, exist_ok=True)
        if path.is_symlink():
            _trouble(f"{path} is a link, and not followed")
            return None
        if not _own(path.lstat(), stat.S_ISDIR):
            _trouble(f"{path} belongs to, or can be written by, somebody else")
            return None
        if not os.access(path, os.W_OK):
            _trouble(f"{path} cannot be written")
            return None
    except FileExistsError as error:
        _trouble(f"{error.filename} is not a folder")
        return None
    except OSError as error:
        _trouble(f"{error.filename} cannot be made: {error.strerror}")
        return None
    except RuntimeError as error:  # no home directory
        _trouble(str(error))
        return None
    return path


def _trouble(why: str) -> None:
    global problem
    problem = f"kernels are compiled anew in every process: {why}; set PSIM_CACHE_DIR to a folder of your own"


def _own(status: os.stat_result, kind: Callable[[int], bool]) -> bool:
    """Whether a file is of this kind, the user's, and closed to others' writing."""
    if not kind(status.st_mode):
        return False
    return not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)


def entry(function: Callable[..., Any], key: Any, identity: str) -> Entry | None:
    """Where a kernel for such arguments is kept; None where it is not."""
    home = folder()
    if home is None or _module_digest(function.__module__) is None:
        return None
    name = f"{function.__module__}.{function.__qualname__}"
    closed_over = tuple(cell.cell_contents for cell in function.__closure__ or ())
    try:
        text = f"{compiler()} {name} {identity} {_text(closed_over)} {_text(key)}"
    except _Nameless:
        return None
    return Entry(home / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.kernel", name)


@functools.cache
def compiler() -> str:
    """A digest of the compiler's own source: another one may make other code of the same kernels."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


class _Nameless(Exception):
    """Something in a key has no name that means the same in every process."""


def _text(part: Any) -> str:
    """A part of a key in words that mean the same in every process. Raises _Nameless where there are none."""
    if isinstance(part, tuple):
        return f"{_text(type(part)) if type(part) is not tuple else ''}({' '.join(map(_text, part))})"
    if isinstance(part, type):
        return f"{part.__module__}.{part.__qualname__}{getattr(part, '_fields', '')}"
    if part is None or isinstance(part, bool | int | float | str | np.number | np.dtype):
        return repr(part)
    code = getattr(part, "__code__", None)
    if code is not None and not part.__closure__:
        return f"{part.__module__}.{part.__qualname__}:{code.co_firstlineno}"
    if hasattr(part, "python"):
        return _text(part.python)
    raise _Nameless


def _file(name: str | None) -> str | None:
    if name is None or name in sys.modules:
        return getattr(sys.modules.get(name or ""), "__file__", None)
    try:
        found = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    return found.origin if found else None


def _module(name: str | None) -> Any:
    """A module that has gone into a kernel; None where there is no such module any more.

    It may not be there yet: what only the compiler needs, as its elementary functions, a process imports that compiles.
    """
    if name is None or name in sys.modules:
        return sys.modules.get(name or "")
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


@functools.cache
def _module_digest(name: str | None) -> str | None:
    """SHA-256 of a module's source; None for one that has no file. A module that is not there yet is not imported for it."""
    file = _file(name)
    if name == "__main__" or file is None:
        return None
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return None


def shared(text: str, identity: str) -> Path | None:
    """Where the code of a shared function is kept: under what its module says."""
    home = folder()
    if home is None:
        return None
    digest = hashlib.sha256(f"{compiler()} {identity} {text}".encode()).hexdigest()
    return home / f"{digest[:32]}.shared"


def read(entry: Entry | None) -> tuple[list[bytes], Any] | None:
    """The code, after that of the shared functions it calls, and the form of the result; None when nothing is kept, or what
    is kept does not hold any more."""
    kept = read_code(entry.path if entry else None)
    if entry is None or kept is None:
        return None
    facts, code = kept
    try:
        holds = (
            facts["kernel"] == entry.name
            and all(_module_digest(name) == digest for name, digest in facts["modules"].items())
            and all(_number(module, name) == text for module, name, text in facts["numbers"])
        )
        codes = []
        for name in facts["shared"] if holds else ():
            part = read_code(entry.path.with_name(name))
            if part is None:
                return None
            codes.append(part[1])
        return ([*codes, code], _form(facts["result"])) if holds else None
    except (ValueError, KeyError, TypeError):
        return None


def read_code(path: Path | None) -> tuple[dict[str, Any], bytes] | None:
    """What a file says of itself, and the code in it; None without a file that is whole and the user's own."""
    if path is None:
        return None
    try:
        with open(path, "rb", opener=_opened) as file:
            if not _own(os.fstat(file.fileno()), stat.S_ISREG):
                return None
            head, code = file.readline(), file.read()
        facts = json.loads(head)
        return (facts, code) if facts["code"] == hashlib.sha256(code).hexdigest() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _opened(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def write(entry: Entry | None, code: bytes, form: Any, unit: Any, shared: list[Path | None]) -> None:
    """Keep the code of a kernel that calls the shared functions which are kept there."""
    result = _plain(form)
    if entry is None or result is Ellipsis or unit.nameless:
        return
    modules = {name: _module_digest(name) for name in sorted(unit.modules)}
    if None in modules.values():
        return
    facts = {
        "kernel": entry.name,
        "modules": modules,
        "numbers": [[module, name, _number(module, name)] for module, name in sorted(unit.numbers)],
        "shared": [path.name for path in shared if path],
        "result": result,
    }
    write_code(entry.path, facts, code)


def write_code(path: Path | None, facts: dict[str, Any], code: bytes) -> None:
    """Keep code, and what is to be said of it; a disk that is full or read-only does without, and `problem` says so."""
    if path is None:
        return
    head = json.dumps({**facts, "code": hashlib.sha256(code).hexdigest()}).encode()
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", delete=False) as file:
            try:
                file.write(head + b"\n" + code)
                file.flush()
                Path(file.name).replace(path)
            except BaseException:
                Path(file.name).unlink(missing_ok=True)
                raise
    except OSError as error:
        _trouble(f"{error.strerror} in {path.parent}")


@functools.cache
def _number(module: str, name: str) -> str | None:
    """A number of a module, or an array of them, in words that tell it from every other."""
    value = getattr(_module(module), name, None)
    if isinstance(value, np.ndarray):
        return (
            f"{value.dtype} {value.shape} {hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
        )
    return f"{type(value).__name__} {value!r}"


def _plain(form: Any) -> Any:
    """The form of a result as JSON; Ellipsis when it holds more than numbers, None and tuples."""
    if isinstance(form, str):
        return form
    if isinstance(form, KnownForm):
        return None if form[0] is None else Ellipsis
    if isinstance(form, TupleForm) and form[0] is tuple:
        parts = [_plain(each) for each in form[1]]
        return Ellipsis if Ellipsis in parts else parts
    return Ellipsis


def _form(plain: Any) -> Any:
    if isinstance(plain, list):
        return TupleForm((tuple, tuple(_form(each) for each in plain)))
    return KnownForm((None,)) if plain is None else plain
